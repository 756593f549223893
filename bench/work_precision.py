"""Work against precision: the error of a contact's force, area and pressure over its cost.

Errors are against a solution that is exact to rounding; cost is wall time, and applications of the
influence matrix, which no other load on the machine can blur. One study varies the tolerance and
the kernel, the other the solver; `bench.resolution` varies the grid.
"""

import math
from collections.abc import Iterator, Sequence
from functools import lru_cache
from itertools import product
from statistics import fmean

import numpy as np

from bem.influence import KERNELS, Kernel
from bench.files import Row
from bench.report import Report, remark
from bench.solvers.others import installed, missing
from bench.solvers.solver import BEM, Case, Failure, Solver, back_and_forth, find_exact
from gen.generation.plan import parameters
from gen.generation.sample import surface_of
from gen.quantities import AREA, DELTA
from gen.scene import load

DECADES = tuple(10.0**-digits for digits in range(1, 13))  # tolerances
# Samples of the paper with few, some and many nodes in contact, and the tightest tolerance, on and
# to which the solvers of others are measured.
PEER_ROWS = (4, 0, 7)
PEER_RTOL = 1e-8


def _evaluate(study: str, case: Case, rtol: float, solver: Solver) -> Row | None:
    """Solve a case; return its setting, cost and errors, None if the solver fails."""
    try:
        answer = solver.solve(case, rtol)
    except Failure as failure:
        place = f"{case.name}, {case.nodes} nodes a side, tolerance {rtol:.0e}"
        remark(f"{study}: left out {solver.name}: {place}: {failure}")
        return None
    exact, pressure = find_exact(case), answer.pressure
    touching = int(np.count_nonzero(pressure > 0))
    right = round(exact.contact_share * pressure.size)
    force_error = abs(float(pressure.sum()) * case.spacing**2 / exact.force - 1)
    difference = np.linalg.norm(pressure - exact.pressure) / np.linalg.norm(
        exact.pressure
    )
    return {
        "study": study,
        "solver": solver.name,
        "kernel": case.kernel,
        "control": solver.control,
        "case": case.name,
        "nodes": case.nodes,  # a side
        "rtol": rtol,  # in the solver's own definition
        DELTA.in_tables: case.delta,
        "reference": f"rtol {exact.rtol:.0e}",
        AREA.name: 100 * exact.contact_share,
        "seconds": answer.seconds,  # of wall time, the shortest of the rounds
        "convolutions": answer.convolutions,  # None where the solver does not say
        "force_error": None if solver.control == "force" else force_error,  # relative
        "area_error_nodes": abs(touching - right),
        "area_error_percent": 100
        * abs(touching / pressure.size / exact.contact_share - 1),
        "pressure_error": float(difference),  # L2 norm over that of the pressure
    }


@lru_cache(maxsize=64)  # the same case has its exact solution found once
def paper_case(row: int, nodes: int, kernel: Kernel = "uniform-pressure") -> Case:
    """A sample of the paper preset; its surface with more or fewer nodes a side."""
    paper = load("paper")
    surface = paper.surface.model_copy(update={"nodes": nodes})
    scene = paper.model_copy(update={"surface": surface})
    plan = parameters(scene, row, row + 1)
    heights = surface_of(scene, plan, 0)
    return Case(f"paper {row}", heights, scene.sides[0], float(plan.load[0]), kernel)


def compare(
    study: str,
    solvers: Sequence[Solver],
    cases: Sequence[Case],
    rtols: Sequence[float],
    rounds: int,
) -> Iterator[Row]:
    """Time solvers on the same cases at the same tolerances, what competes side by side.

    A first round, which is not timed, warms caches up and leaves out who fails. The shortest time
    of the others counts, since other work on the machine can only add to it.
    """
    tasks = product(cases, rtols, solvers)
    able = [task for task in tasks if _evaluate(study, *task) is not None]
    rows: dict[int, Row] = {}
    for index in back_and_forth(range(len(able)), rounds):
        row = _evaluate(study, *able[index])
        if row and row["seconds"] < rows.get(index, {"seconds": math.inf})["seconds"]:
            rows[index] = row
    yield from (rows[index] for index in sorted(rows))


CURVES = {"tolerance": "kernel", "peers": "solver"}
"""The studies, and the column that tells the curves of each apart."""

AVERAGED = (
    "force_error",
    "area_error_percent",
    "pressure_error",
    "seconds",
    "convolutions",
)


def curves(points: Sequence[Row]) -> list[Row]:
    """Average errors and costs over the cases of a study, for each curve and tolerance.

    A tolerance at which a case is missing has no mean: it would be that of other cases. A mean is
    None where a value is not known.
    """
    groups: dict[tuple[str, str, float], list[Row]] = {}
    for row in points:
        key = row["study"], row[CURVES[row["study"]]], row["rtol"]
        groups.setdefault(key, []).append(row)
    cases = {
        study: {r["case"] for r in points if r["study"] == study} for study in CURVES
    }
    rows = []
    for (study, curve, rtol), own in groups.items():
        if len(own) == len(cases[study]):
            known = {name: [row[name] for row in own] for name in AVERAGED}
            means = {
                name: None if None in each else fmean(each)
                for name, each in known.items()
            }
            rows.append({"study": study, "curve": curve, "setting": rtol, **means})
    return rows


def solver(*, quick: bool) -> Report:
    """Measure both studies, on small grids and few samples if that is to be `quick`.

    The solvers of others have their own notions of a tolerance: only errors compare. Those that are
    given the force instead of the displacement get the exact one, which costs them nothing.
    """
    nodes, samples, rtols, rounds = (
        (65, 2, DECADES[::2], 2) if quick else (129, 8, DECADES, 4)
    )
    for package, install in missing().items():
        remark(f"peers: left out {package}: not installed: {install}")
    kernels = [
        paper_case(row, nodes, kernel) for row in range(samples) for kernel in KERNELS
    ]
    peers = [paper_case(row, nodes) for row in PEER_ROWS[:samples]]
    loose = [rtol for rtol in rtols if rtol >= PEER_RTOL]
    points = [
        *compare("tolerance", [BEM], kernels, rtols, rounds),
        *compare("peers", [BEM, *installed()], peers, loose, rounds=2),
    ]
    return Report({"solver": points, "curves": curves(points)})
