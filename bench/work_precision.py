"""Errors of a contact's force, area and pressure against its cost, at falling tolerances.

Errors are differences from a solution that is exact to rounding. Costs are the wall time, and the
number of applications of the influence matrix, which does not depend on other work of the machine.
Study `tolerance` varies the kernel, study `peers` the solver; `bench.resolution` varies the grid.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from statistics import fmean
from typing import Any

import numpy as np

from bem.bodies import KERNELS, Kernel
from bench.files import Row
from bench.report import Report, remark
from bench.solvers.others import installed, missing
from bench.solvers.solver import BEM, Case, Failure, Solver, back_and_forth, find_exact
from gen.generation.plan import parameters
from gen.generation.sample import surface_of
from gen.quantities import AREA, DELTA
from gen.scene import load

DECADES = tuple(10.0**-digits for digits in range(1, 13))
"""Tolerances, falling from 0.1 to 1e-12 [1]."""

PEER_ROWS = (4, 0, 7)
"""Rows of the paper preset for other solvers, with few, some and many nodes in contact."""

PEER_RTOL = 1e-8
"""Tightest tolerance with which other solvers are measured [1]."""


def _evaluate(study: str, case: Case, rtol: float, solver: Solver) -> Row | None:
    """Solve a case with a tolerance; return a row with the setting, the cost and the errors.

    `rtol` is the tolerance as the solver defines it. If the solver fails, print the failure on
    standard error and return None.
    """
    try:
        answer = solver.solve(case, rtol)
    except Failure as failure:
        place = f"{case.name}, {case.nodes} nodes a side, tolerance {rtol:.0e}"
        remark(f"{study}: left out {solver.name}: {place}: {failure}")
        return None
    exact = find_exact(case)
    pressure = answer.pressure
    touching = int(np.count_nonzero(pressure > 0))
    exactly_touching = round(exact.contact_share * pressure.size)
    force_error = None  # solvers that are given the force have no error of it
    if solver.control == "displacement":
        force = float(pressure.sum()) * case.spacing**2
        force_error = abs(force / exact.force - 1)
    area_error = abs(touching / pressure.size / exact.contact_share - 1)
    difference = np.linalg.norm(pressure - exact.pressure)
    return {
        "study": study,
        "solver": solver.name,
        "kernel": case.kernel,
        "control": solver.control,
        "case": case.name,
        "nodes": case.nodes,  # a side
        "rtol": rtol,  # as the solver defines it
        DELTA.in_tables: case.delta,
        "reference": f"rtol {exact.rtol:.0e}",
        AREA.name: 100 * exact.contact_share,
        "seconds": answer.seconds,  # wall time, the shortest of the rounds
        "convolutions": answer.convolutions,  # None if the solver does not count them
        "force_error": force_error,  # relative; None if the force is given
        "area_error_nodes": abs(touching - exactly_touching),
        "area_error_percent": 100 * area_error,
        # In the L2 norm, over the norm of the exact pressure.
        "pressure_error": float(difference / np.linalg.norm(exact.pressure)),
    }


@lru_cache(maxsize=64)
def paper_case(row: int, nodes: int, kernel: Kernel = "uniform-pressure") -> Case:
    """Return the contact of a row of the paper preset.

    Calls with equal arguments return one object, so that its exact solution is found once.

    Parameters
    ----------
    row : int
        Number of the row.
    nodes : int
        Nodes a side, 2^k + 1; they replace those of the row.
    kernel : {"uniform-pressure", "concentrated-force"}
        Kernel.

    Returns
    -------
    Case
        The contact.
    """
    paper = load("paper")
    surface = paper.surface.model_copy(update={"nodes": nodes})
    scene = paper.model_copy(update={"surface": surface})
    plan = parameters(scene, row, row + 1)
    heights = surface_of(scene, plan, 0)
    delta = float(plan.load[0])
    return Case(f"paper {row}", heights, scene.sides[0], delta, kernel)


def compare(
    study: str,
    solvers: Sequence[Solver],
    cases: Sequence[Case],
    rtols: Sequence[float],
    rounds: int,
) -> Iterator[Row]:
    """Time all solvers on every case at every tolerance, solver after solver.

    A first round, which is not timed, fills caches and finds the settings with which a solver
    fails; these are left out. The shortest time of the other rounds is taken, as other work of the
    machine can only add to it.

    Parameters
    ----------
    study : str
        Name of the study in the rows.
    solvers : sequence of Solver
        The solvers.
    cases : sequence of Case
        The contacts.
    rtols : sequence of float
        Tolerances as each solver defines them [1].
    rounds : int
        Number of timed rounds.

    Yields
    ------
    Row
        Setting, cost and errors, for each case, tolerance and solver that does not fail.
    """
    settings = [
        setting
        for setting in product(cases, rtols, solvers)
        if _evaluate(study, *setting) is not None
    ]
    fastest: dict[int, Row] = {}
    for index in back_and_forth(range(len(settings)), rounds):
        row = _evaluate(study, *settings[index])
        if row is None:  # a solve that is not deterministic may fail only now
            continue
        if index not in fastest or row["seconds"] < fastest[index]["seconds"]:
            fastest[index] = row
    for index in sorted(fastest):
        yield fastest[index]


CURVES = {"tolerance": "kernel", "peers": "solver"}
"""Column whose values are the names of the curves of a study, by the name of the study."""

AVERAGED = (
    "force_error",
    "area_error_percent",
    "pressure_error",
    "seconds",
    "convolutions",
)
"""Columns of which curves have the means."""


def curves(points: Sequence[Row]) -> list[Row]:
    """Average errors and costs over the cases of a study, for each curve and tolerance.

    Parameters
    ----------
    points : sequence of Row
        Rows of `compare`, of any studies.

    Returns
    -------
    list of Row
        A row for each curve and tolerance at which the curve has all cases of its study: means over
        fewer cases would not be comparable. A mean is None if one of its values is None.
    """
    groups: dict[tuple[str, str, float], list[Row]] = {}
    cases: dict[str, set[str]] = {}
    for point in points:
        study = point["study"]
        curve = point[CURVES[study]]
        groups.setdefault((study, curve, point["rtol"]), []).append(point)
        cases.setdefault(study, set()).add(point["case"])
    rows: list[Row] = []
    for (study, curve, rtol), group in groups.items():
        if len(group) != len(cases[study]):  # a solver has failed on a case
            continue
        row: Row = {"study": study, "curve": curve, "setting": rtol}
        for name in AVERAGED:
            row[name] = _mean([point[name] for point in group])
        rows.append(row)
    return rows


def _mean(values: Sequence[Any]) -> float | None:
    """Return the mean of numbers; None if one of them is None."""
    return None if None in values else fmean(values)


@dataclass(frozen=True)
class _Extent:
    """How much the studies measure."""

    nodes: int  # nodes a side
    samples: int  # number of rows of the paper preset in study `tolerance`
    rtols: tuple[float, ...]  # tolerances, falling [1]
    rounds: int  # number of timed rounds of study `tolerance`


QUICK = _Extent(nodes=65, samples=2, rtols=DECADES[::2], rounds=2)
"""A measurement that takes some seconds."""

FULL = _Extent(nodes=129, samples=8, rtols=DECADES, rounds=4)
"""The published measurement."""


def solver(*, quick: bool) -> Report:
    """Measure both studies, and print on standard error which solvers are left out.

    Each solver defines its tolerance in its own way, so that only errors can be compared. Solvers
    that are given the force get the exact force; their times do not include its computation.

    Parameters
    ----------
    quick : bool
        Whether grids are small and samples few.

    Returns
    -------
    Report
        Table `solver` with all points, and table `curves` with their means.
    """
    extent = QUICK if quick else FULL
    for package, install in missing().items():
        remark(f"peers: left out {package}: not installed: {install}")
    both_kernels = [
        paper_case(row, extent.nodes, kernel)
        for row, kernel in product(range(extent.samples), KERNELS)
    ]
    for_peers = [paper_case(row, extent.nodes) for row in PEER_ROWS[: extent.samples]]
    loose = [rtol for rtol in extent.rtols if rtol >= PEER_RTOL]
    peers = [BEM, *installed()]
    points = [
        *compare("tolerance", [BEM], both_kernels, extent.rtols, extent.rounds),
        *compare("peers", peers, for_peers, loose, rounds=2),
    ]
    return Report({"solver": points, "curves": curves(points)})
