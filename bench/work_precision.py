"""Work against precision: the error of a contact's force, area and pressure over its cost.

Errors are against a solution that is exact to rounding, or against the finest grid; cost is wall
time, and applications of the influence matrix, which no other load on the machine can blur. Each
study varies the tolerance, the grid or the solver.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache
from statistics import fmean

import numpy as np

from bem.influence import KERNELS, Kernel
from bench.files import Row
from bench.record import circumstances
from bench.report import Report, remark
from bench.solvers.case import Case, Exact, find_exact
from bench.solvers.others import installed, missing
from bench.solvers.solver import BEM, Answer, Failure, Solver, back_and_forth
from gen.generation.plan import parameters
from gen.generation.sample import surface_of
from gen.scene import load


@dataclass(frozen=True, eq=False)
class Task:
    """A measurement that is to be made: of a study, to a tolerance, against an exact solution."""

    study: str
    solver: Solver
    case: Case
    rtol: float
    exact: Exact

    def run(self) -> Row | None:
        """Solve the case, and return the row of the answer; None if the solver fails."""
        try:
            return evaluate(self, self.solver.solve(self.case, self.rtol))
        except Failure as failure:
            place = f"{self.case.name}, {self.case.nodes} nodes a side, tolerance {self.rtol:.0e}"
            remark(f"{self.study}: left out {self.solver.name}: {place}: {failure}")
            return None


def evaluate(task: Task, answer: Answer) -> Row:
    """Return the row of an answer: its setting, its cost and its errors."""
    case, exact, pressure = task.case, task.exact, answer.pressure
    touching = int(np.count_nonzero(pressure > 0))
    right = round(exact.contact_share * exact.nodes**2)
    given_force = task.solver.control == "force"
    force_error = abs(float(pressure.sum()) * case.spacing**2 / exact.force - 1)
    difference = np.linalg.norm(pressure - exact.pressure) / np.linalg.norm(exact.pressure)
    return {
        "study": task.study,
        "solver": task.solver.name,
        "kernel": case.kernel,
        "precision": task.solver.precision,
        "control": task.solver.control,
        "case": case.name,
        "nodes": case.nodes,  # a side
        "rtol": task.rtol,  # in the solver's own definition
        "delta_um": case.delta,  # of the far field, from this grid's first touch on
        "reference": exact.method,
        "reference_nodes": exact.nodes,
        "area_percent": 100 * exact.contact_share,  # of the reference's nodes
        "seconds": answer.seconds,  # of wall time, the shortest of the rounds
        "convolutions": answer.convolutions,  # None where the solver does not say
        "iterations": answer.iterations,
        "force_error": None if given_force else force_error,  # relative
        "area_error_nodes": abs(touching - right) if exact.nodes == case.nodes else None,
        "area_error_percent": 100 * abs(touching / pressure.size / exact.contact_share - 1),
        # L2 norm over that of the pressure; of averages over coarse cells against a finer grid
        "pressure_error": float(difference),
    }


def measure(tasks: Sequence[Task], rounds: int) -> Iterator[Row]:
    """Do all tasks in turn, keep the shortest time of each, and yield their rows in order.

    A first round, which is not timed, warms caches up and leaves out who fails. The shortest time
    counts, since other work on the machine can only add to it.
    """
    able = [task for task in tasks if task.run() is not None]
    rows: dict[int, Row] = {}
    for index in back_and_forth(range(len(able)), rounds):
        row = able[index].run()
        if row and row["seconds"] < rows.get(index, {"seconds": math.inf})["seconds"]:
            rows[index] = row
    yield from (rows[index] for index in sorted(rows))


DECADES = tuple(10.0**-digits for digits in range(1, 13))


@dataclass(frozen=True)
class Extent:
    """How much is measured."""

    nodes: int  # a side of the paper's samples
    samples: int  # number of the paper's first samples
    rtols: tuple[float, ...]  # tolerances, falling
    rounds: int  # times that each solve is timed
    levels: tuple[int, ...]  # k of the grids with 2^k + 1 nodes a side, rising to the reference


FULL = Extent(nodes=129, samples=8, rtols=DECADES, rounds=4, levels=(5, 6, 7, 8, 9, 10))
QUICK = Extent(nodes=65, samples=2, rtols=DECADES[::2], rounds=2, levels=(4, 5, 6, 7))

# The grid matters in the third digit: its reference need not go down to rounding.
GRID_RTOL = 1e-6
GRID_EXACT_RTOL = 1e-10

# Samples of the paper with few, some and many nodes in contact, and the tightest tolerance, on and
# to which the solvers of others are measured.
PEER_ROWS = (4, 0, 7)
PEER_RTOL = 1e-8


@lru_cache(maxsize=64)  # the same case has its exact solution found once
def paper_case(row: int, nodes: int, kernel: Kernel = "uniform-pressure") -> Case:
    """A sample of the paper preset; its surface with more or fewer nodes a side."""
    paper = load("paper")
    surface = paper.surface.model_copy(update={"nodes": nodes})
    scene = paper.model_copy(update={"surface": surface})
    plan = parameters(scene, row, row + 1)
    heights = surface_of(scene, plan, 0)
    return Case(f"paper {row}", heights, scene.sides[0], float(plan.delta[0]), kernel)


@lru_cache(maxsize=4)
def nested_cases(levels: tuple[int, ...], kernel: Kernel) -> tuple[Case, ...]:
    """The paper's first sample on ever finer grids, each holding the nodes of the one before.

    The body stays where it is: a grid that misses the highest asperity's top touches later, so
    that its Delta, which counts from first touch on, is smaller by what it misses. Who refines the
    grid of a given body holds its position, not the Delta of a coarser picture of it.
    """
    finest = paper_case(0, 2 ** levels[-1] + 1, kernel)
    top = float(finest.heights.max())
    cases = []
    for level in levels:
        step = 2 ** (levels[-1] - level)
        heights = finest.heights[::step, ::step].copy()
        missed = top - float(heights.max())
        cases.append(Case(finest.name, heights, finest.side, finest.delta - missed, kernel))
    return tuple(cases)


def compare(
    study: str,
    solvers: Sequence[Solver],
    cases: Sequence[Case],
    rtols: Sequence[float],
    rounds: int,
) -> Iterator[Row]:
    """Time solvers on the same cases at the same tolerances, what competes side by side."""
    tasks = [
        Task(study, solver, case, rtol, find_exact(case))
        for case in cases
        for rtol in rtols
        for solver in solvers
    ]
    return measure(tasks, rounds)


def tolerance_study(extent: Extent) -> Iterator[Row]:
    """Vary the tolerance, with both kernels, each against its own exact solution."""
    cases = [
        paper_case(row, extent.nodes, kernel) for row in range(extent.samples) for kernel in KERNELS
    ]
    return compare("tolerance", [BEM], cases, extent.rtols, extent.rounds)


def grid_study(extent: Extent) -> Iterator[Row]:
    """Vary the grid, with both kernels, against the default kernel on the finest grid.

    Either kernel's limit is the same continuum; the uniform pressure is nearer to it (compare
    `python -m bench hertz`), so that its finest grid speaks for both.
    """
    *_, finest = nested_cases(extent.levels, KERNELS[0])
    truth = find_exact(finest, GRID_EXACT_RTOL)
    tasks = [
        Task("grid", BEM, case, GRID_RTOL, truth.on_grid(case.nodes))
        for kernel in KERNELS
        for case in nested_cases(extent.levels, kernel)
    ]
    return measure(tasks, rounds=2)


def peer_study(extent: Extent) -> Iterator[Row]:
    """Compare with solvers by other people, where they are installed.

    Each has its own notion of a tolerance: only errors compare. Those that are given the force
    instead of the displacement get the exact one, which costs them nothing.
    """
    for package, install in missing().items():
        remark(f"peers: left out {package}: not installed: {install}")
    cases = [paper_case(row, extent.nodes) for row in PEER_ROWS[: extent.samples]]
    rtols = [rtol for rtol in extent.rtols if rtol >= PEER_RTOL]
    return compare("peers", [BEM, *installed()], cases, rtols, rounds=2)


STUDIES = {
    "tolerance": tolerance_study,
    "grid": grid_study,
    "peers": peer_study,
}

CURVES = {
    "tolerance": "{kernel}",
    "grid": "{kernel}",
    "peers": "{solver}",
}
"""What tells the curves of a study apart."""

AVERAGED = "force_error", "area_error_percent", "pressure_error", "seconds", "convolutions"


def curves(points: Sequence[Row]) -> list[Row]:
    """Average errors and costs over the cases of a study, for each curve and setting.

    The setting is the tolerance, or nodes a side. One at which a case is missing has no mean: it
    would be that of other cases. Nor has the grid that is its own reference, whose error is none of
    the grid's. A mean is None where a value is not known.
    """
    groups: dict[tuple[str, str, float], list[Row]] = {}
    cases: dict[tuple[object, ...], set[str]] = {}
    for row in points:
        study, grid = row["study"], row["study"] == "grid"
        if not grid or row["nodes"] != row["reference_nodes"]:
            setting = row["nodes" if grid else "rtol"]
            groups.setdefault((study, CURVES[study].format(**row), setting), []).append(row)
            cases.setdefault((study, row["nodes"]), set()).add(row["case"])
    return [
        {"study": study, "curve": curve, "setting": setting}
        | {name: _mean([row[name] for row in own]) for name in AVERAGED}
        for (study, curve, setting), own in groups.items()
        if len(own) == len(cases[study, own[0]["nodes"]])
    ]


def _mean(values: Sequence[float | None]) -> float | None:
    """Return the mean, None if a value is not known."""
    known = [value for value in values if value is not None]
    return fmean(known) if len(known) == len(values) else None


def solver(*, quick: bool) -> Report:
    """Measure all studies, on small grids if that is to be `quick`."""
    extent = QUICK if quick else FULL
    points: list[Row] = []
    for name, study in STUDIES.items():
        remark(name)
        points += study(extent)
    record = {**circumstances(), "extent": asdict(extent)}
    return Report({"solver": points, "curves": curves(points)}, records={"solver": record})
