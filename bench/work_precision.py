"""Work against precision: the error of a contact's force, area and pressure over its cost.

Errors are against a solution that is exact to rounding, or against the finest grid; cost is wall
time, and applications of the influence matrix, which no other load on the machine can blur. Each
study varies the tolerance, the grid, the solver or the hardness. A row is either a measurement,
with the columns of `evaluate`, or has the keys study, solver and reason, and says what was left
out and why.
"""

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
import pandas as pd

from bem.influence import KERNELS, Kernel
from bench.circumstances import circumstances
from bench.picture import STYLES, new_figure
from bench.report import Report, remark
from bench.solvers.case import Case, Exact, find_exact
from bench.solvers.others import installed, missing
from bench.solvers.own import BEM
from bench.solvers.solver import Answer, Failure, Solver, back_and_forth
from gen.generation.plan import parameters
from gen.generation.sample import surface_of
from gen.runtime.figure import log_axis
from gen.scene import load

Row = dict[str, Any]

# What a solver has to meet before any of its times counts: relative errors of force and pressure,
# and the share of the contact nodes that may be wrong, rounded up.
FORCE_GATE = 1e-4
PRESSURE_GATE = 1e-3
AREA_GATE = 1e-3


@dataclass(frozen=True, eq=False)
class Task:
    """A measurement that is to be made: of a study, to a tolerance, against an exact solution."""

    study: str
    solver: Solver
    case: Case
    rtol: float
    exact: Exact

    def run(self) -> Row:
        """Solve the case, and return the row of the answer; raise `Failure` if that fails."""
        return evaluate(self, self.solver.solve(self.case, self.rtol))

    def left_out(self, reason: object) -> Row:
        """Return the row that says why there is no measurement."""
        place = f"{self.case.name}, {self.case.kernel}, {self.case.nodes} nodes a side"
        words = f"{place}, tolerance {self.rtol:.0e}: {reason}"
        return {"study": self.study, "solver": self.solver.name, "reason": words}


def admit(tasks: Sequence[Task]) -> tuple[list[Task], list[Row]]:
    """Let a solver be timed on a case only if it solves it; this also warms its caches up.

    Parameters
    ----------
    tasks : sequence of Task
        One solver on one case, the tightest tolerance first, held against the exact solution on
        the same grid. The answer that counts is that at the tightest tolerance that is reached.

    Returns
    -------
    admitted : list of Task
        The tasks that may be timed; none if that answer is wrong.
    left_out : list of dict
        Rows of the tasks that may not.
    """
    left_out = []
    for place, task in enumerate(tasks):
        try:
            fault = complaint(task.run())
        except Failure as failure:
            left_out.append(task.left_out(failure))
            continue
        return ([], [*left_out, task.left_out(fault)]) if fault else (list(tasks[place:]), left_out)
    return [], left_out


def complaint(row: Row) -> str:
    """Say what is wrong with an answer on the grid of its reference; "" if nothing is."""
    right = row["area_percent"] / 100 * row["nodes"] ** 2
    found = (
        ("force", row["force_error"] or 0.0, FORCE_GATE),
        ("pressure", row["pressure_error"], PRESSURE_GATE),
        ("contact nodes", row["area_error_nodes"] or 0, math.ceil(round(AREA_GATE * right, 9))),
    )
    return "; ".join(
        f"{name} off by {error:.3g}, allowed is {gate:g}"
        for name, error, gate in found
        if not error <= gate
    )


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
        "hardness": case.hardness,  # over E*, None for elastic bodies
    }


def measure(tasks: Sequence[Task], rounds: int) -> Iterator[Row]:
    """Do all tasks in turn, keep the shortest time of each, and yield their rows in order.

    The shortest time, since other work on the machine can only add to it.
    """
    rows: dict[int, Row] = {}
    for index in back_and_forth(range(len(tasks)), rounds):
        before = rows.get(index, {"seconds": math.inf})
        if "reason" in before:
            continue
        try:
            row = tasks[index].run()
        except Failure as failure:
            row = tasks[index].left_out(failure)
        if "reason" in row or row["seconds"] < before["seconds"]:
            rows[index] = row
    yield from (rows[index] for index in range(len(tasks)))


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

# The grid matters in the third digit: its reference and its gates need not go down to rounding.
GRID_RTOL = 1e-6
GRID_EXACT_RTOL = 1e-10

# Samples of the paper with few, some and many nodes in contact, and the tightest tolerance, on and
# to which the solvers of others are measured.
PEER_ROWS = (4, 0, 7)
PEER_RTOL = 1e-8

# Over E*; on the paper's samples few nodes yield at the first, nearly all in contact at the last.
HARDNESSES = (0.3, 0.1, 0.02)


def sweep(extent: Extent) -> Iterator[Row]:
    """Make all studies; yield a row for each measurement, and for each one that was left out."""
    for name, study in STUDIES.items():
        remark(name)
        yield from study(extent)


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
    """Time solvers on the same cases at the same tolerances.

    A solver that misses the exact solution of a case is left out there. What competes is timed side
    by side, at nearly the same moment.
    """
    tasks: list[Task] = []
    for case in cases:
        exact = find_exact(case)
        competing: list[Task] = []
        for solver in solvers:
            asked = [Task(study, solver, case, rtol, exact) for rtol in sorted(rtols)]
            admitted, left_out = admit(asked)
            competing += admitted
            yield from left_out
        tasks += sorted(competing, key=lambda task: -task.rtol)
    yield from measure(tasks, rounds)


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
    tasks: list[Task] = []
    *_, finest = nested_cases(extent.levels, KERNELS[0])
    truth = find_exact(finest, GRID_EXACT_RTOL)
    for kernel in KERNELS:
        for case in nested_cases(extent.levels, kernel):
            exact = find_exact(case, GRID_EXACT_RTOL)
            admitted, left_out = admit([Task("grid", BEM, case, GRID_RTOL, exact)])
            tasks += [replace(task, exact=truth.on_grid(case.nodes)) for task in admitted]
            yield from left_out
    yield from measure(tasks, rounds=2)


def peer_study(extent: Extent) -> Iterator[Row]:
    """Compare with solvers by other people, where they are installed.

    Each has its own notion of a tolerance: only errors compare. Those that are given the force
    instead of the displacement get the exact one, which costs them nothing.
    """
    for package, install in missing().items():
        yield {"study": "peers", "solver": package, "reason": f"not installed: {install}"}
    cases = [paper_case(row, extent.nodes) for row in PEER_ROWS[: extent.samples]]
    rtols = [rtol for rtol in extent.rtols if rtol >= PEER_RTOL]
    yield from compare("peers", [BEM, *installed()], cases, rtols, rounds=2)


def hardness_study(extent: Extent) -> Iterator[Row]:
    """Compare on bodies that yield, with other solvers that know a hardness."""
    cases = [
        replace(paper_case(row, extent.nodes), hardness=hardness)
        for row in PEER_ROWS[: extent.samples]
        for hardness in HARDNESSES
    ]
    solvers = [BEM, *(solver for solver in installed() if solver.plastic)]
    rtols = [rtol for rtol in extent.rtols if rtol >= PEER_RTOL]
    return compare("hardness", solvers, cases, rtols, rounds=2)


STUDIES = {
    "tolerance": tolerance_study,
    "grid": grid_study,
    "peers": peer_study,
    "hardness": hardness_study,
}


TITLES = {
    "tolerance": "Tolerance: 1e-1 (right) to 1e-12 (left), both kernels",
    "grid": "Grid: both kernels, nodes a side as labelled, against the default's finest grid",
    "peers": "Other solvers at tolerances of their own; no error in a force that was given",
    "hardness": "Bodies that yield, hardness over E* as named; others at tolerances of their own",
}

CURVES = {
    "tolerance": "{kernel}",
    "grid": "{kernel}",
    "peers": "{solver}",
    "hardness": "{solver}, {hardness:g}",
}
"""The column that tells the curves of a study apart."""

ERRORS = {
    "force_error": "relative error of the force [1]",
    "area_error_percent": "error of the area [% of the exact area]",
    "pressure_error": "relative error of the pressure, L2 [1]",
}
COSTS = {"seconds": "wall time a solve [s]", "convolutions": "applications of H"}


def draw(rows: Sequence[Row]) -> Any:
    """Draw a row of diagrams for each study and cost, over three kinds of error."""
    drawn = {study: means(study, rows) for study in TITLES if study in {r["study"] for r in rows}}
    costs = {study: _compared_costs(table) for study, table in drawn.items()}
    heights = [1.4 + 2.0 * len(names) for names in costs.values()]
    figure = new_figure(11, sum(heights))
    parts = figure.subfigures(len(drawn), 1, squeeze=False, height_ratios=heights)[:, 0]
    for letter, part, study in zip("abcdef", parts, drawn, strict=False):
        part.suptitle(f"({letter}) {TITLES[study]}", x=0.01, ha="left", fontweight="bold")
        _draw_study(part, study, drawn[study], costs[study])
    return figure


def means(study: str, rows: Sequence[Row]) -> Any:
    """Average a study's errors and costs over its cases on a grid.

    A setting at which a case is missing has no mean: it would be that of other cases. Nor has the
    grid that is its own reference, whose error is none of the grid's.

    Returns
    -------
    DataFrame
        Means, not a number where one is not known, by the names of `ERRORS` and `COSTS`. The index
        is the name of the curve, and the setting: nodes a side, or the tolerance.
    """
    named = [row | {"curve": CURVES[study].format(**row)} for row in rows if row["study"] == study]
    table = pd.DataFrame(named).astype(dict.fromkeys((*ERRORS, *COSTS), float))
    if study == "grid":
        table = table[table["nodes"] != table["reference_nodes"]]
    setting = ["curve", "nodes" if study == "grid" else "rtol"]
    there, wanted = (
        table.groupby(by, dropna=False)["case"].transform("nunique")
        for by in (setting, ["nodes", "hardness"])
    )
    groups = table[there == wanted].groupby(setting, sort=False)
    return groups[[*ERRORS, *COSTS]].agg(lambda values: values.mean(skipna=False))


def _compared_costs(table: Any) -> list[str]:
    """Return the costs by which curves can be told apart: those that two or more of them know."""
    known = table.groupby(level="curve").count().gt(0)
    return [cost for cost in COSTS if known[cost].sum() >= min(len(known), 2)]


def _draw_study(part: Any, study: str, table: Any, costs: Sequence[str]) -> None:
    panels = part.subplots(len(costs), len(ERRORS), sharex="col", sharey="row", squeeze=False)
    curves = list(table.groupby(level="curve", sort=False))
    for (row, cost), (column, error) in itertools.product(enumerate(costs), enumerate(ERRORS)):
        panel = panels[row, column]
        for style, (name, curve) in zip(itertools.cycle(STYLES), curves, strict=False):
            known = curve[[error, cost]].dropna()
            panel.plot(known[error], known[cost], label=name, markersize=4, **style)
            if study == "grid":
                for (_, nodes), *place in known.itertuples():
                    panel.annotate(
                        str(nodes), place, (5, 3), textcoords="offset points", fontsize=7
                    )
        panel.margins(x=0.1, y=0.12)
        panel.grid(visible=True, which="major", color="0.9")
    for column, (error, label) in zip(panels.T, ERRORS.items(), strict=True):
        _scale(column[0].xaxis, table[[error, costs[0]]].dropna()[error])
        column[-1].set_xlabel(label)
    for row, cost in zip(panels, costs, strict=True):
        _scale(row[0].yaxis, table[["pressure_error", cost]].dropna()[cost])
        row[0].set_ylabel(COSTS[cost])
    part.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=4)


def _scale(axis: Any, values: Any) -> None:
    """Make an axis logarithmic, with a place for 0 if needed."""
    positive = values[values > 0]
    if positive.empty:
        return
    if len(positive) < len(values):
        floor = 10.0 ** math.floor(math.log10(positive.min()))
        # Errors stand on x: only they can be 0.
        axis.axes.set_xscale("symlog", linthresh=floor, linscale=0.5)
        axis.axes.set_xlim(-0.4 * floor, 2 * positive.max())
        return
    log_axis(axis)


def solver(*, quick: bool) -> Report:
    """Measure all studies, on small grids if that is to be `quick`."""
    extent = QUICK if quick else FULL
    rows = list(sweep(extent))
    points = [row for row in rows if "reason" not in row]
    left_out = [row for row in rows if "reason" in row]
    for row in left_out:
        remark(f"{row['study']}: left out {row['solver']}: {row['reason']}")
    record = {
        **circumstances(),
        "extent": asdict(extent),
        "gates": {"force": FORCE_GATE, "pressure": PRESSURE_GATE, "contact_nodes": AREA_GATE},
        "left_out": left_out,
    }
    return Report({"solver": points}, records={"solver": record}, pictures={"solver": draw(points)})
