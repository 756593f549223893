"""What is varied: tolerance, grid, kernel, precision, solver."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

from bem.influence import KERNELS, Kernel
from bench.solvers.case import Case, find_exact
from bench.solvers.others import installed, missing
from bench.solvers.own import BEM, DOUBLE, MIXED
from bench.solvers.solver import Solver
from bench.work_precision.measurement import LeftOut, Point, Task, admit, measure
from gen.generation.plan import parameters
from gen.generation.sample import surface_of
from gen.scene import load

DECADES = tuple(10.0**-digits for digits in range(1, 13))


@dataclass(frozen=True)
class Extent:
    """How much is measured.

    Attributes
    ----------
    nodes : nodes a side of the paper's samples
    samples : how many of the paper's first samples
    rtols : tolerances, falling
    rounds : times that each solve is timed
    levels : k of the grids with 2^k + 1 nodes a side, rising; the last is the reference
    large : nodes a side of the one larger surface on which the two precisions meet
    """

    nodes: int
    samples: int
    rtols: tuple[float, ...]
    rounds: int
    levels: tuple[int, ...]
    large: int


FULL = Extent(nodes=129, samples=8, rtols=DECADES, rounds=4, levels=(5, 6, 7, 8, 9, 10), large=513)
QUICK = Extent(nodes=33, samples=2, rtols=DECADES[::3], rounds=2, levels=(4, 5, 6), large=65)

# The grid matters in the third digit: its reference and its gates need not go down to rounding.
GRID_RTOL = 1e-6
GRID_EXACT_RTOL = 1e-10

# The larger surface is pressed less: its contact still fits into the dense reference.
LARGE_DELTA = 9.56  # um; 1 % contact at 513 nodes a side

# Samples of the paper with few, some and many nodes in contact, and the tightest tolerance, on and
# to which the solvers of others are measured.
PEER_ROWS = (4, 0, 7)
PEER_RTOL = 1e-8

# Over E*; on the paper's samples few nodes yield at the first, nearly all in contact at the last.
HARDNESSES = (0.3, 0.1, 0.02)


Found = tuple[list[Point], list[LeftOut]]
"""Everything that was measured, and what was left out."""


def sweep(extent: Extent = FULL, announce: Callable[[str], None] = lambda line: None) -> Found:
    """Make all studies.

    Parameters
    ----------
    extent : how much
    announce : told what is about to be measured, a line a study
    """
    points: list[Point] = []
    left_out: list[LeftOut] = []
    for study, make in STUDIES.items():
        announce(study)
        measured, unsolved = make(extent)
        points += measured
        left_out += unsolved
    return points, left_out


@lru_cache(maxsize=64)  # the same case has its exact solution found once
def paper_case(row: int, nodes: int, kernel: Kernel = "uniform-pressure") -> Case:
    """A sample of the paper preset; its surface with more or fewer nodes a side."""
    paper = load("paper")
    surface = paper.surface.model_copy(update={"nodes": nodes})
    scene = paper.model_copy(update={"surface": surface})
    plan = parameters(scene, row, row + 1)
    heights = surface_of(scene, plan, 0)
    return Case(f"paper {row}", heights, surface.side, float(plan.delta[0]), kernel)


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
) -> Found:
    """Time solvers on the same cases at the same tolerances, side by side.

    A solver that misses the exact solution of a case is left out there.
    """
    tasks: list[Task] = []
    left_out: list[LeftOut] = []
    for case in cases:
        exact = find_exact(case)
        entries = []
        for solver in solvers:
            reached, missing = admit(study, solver, case, rtols, exact)
            left_out += missing
            entries += [Task(study, solver, case, rtol, exact) for rtol in reached]
        # Solvers side by side: what competes is timed at nearly the same moment.
        tasks += sorted(entries, key=lambda task: -task.rtol)
    points, failed = measure(tasks, rounds)
    return points, left_out + failed


def tolerance_study(extent: Extent) -> Found:
    """The tolerance, with both kernels, each against its own exact solution."""
    cases = [
        paper_case(row, extent.nodes, kernel) for row in range(extent.samples) for kernel in KERNELS
    ]
    return compare("tolerance", [BEM], cases, extent.rtols, extent.rounds)


def grid_study(extent: Extent) -> Found:
    """The grid, with both kernels, against the default kernel on the finest grid.

    Either kernel's limit is the same continuum; the uniform pressure is nearer to it (compare
    `python -m bench hertz`), so that its finest grid speaks for both.
    """
    tasks: list[Task] = []
    left_out: list[LeftOut] = []
    *_, finest = nested_cases(extent.levels, KERNELS[0])
    truth = find_exact(finest, GRID_EXACT_RTOL)
    for kernel in KERNELS:
        for case in nested_cases(extent.levels, kernel):
            exact = find_exact(case, GRID_EXACT_RTOL)
            reached, missing = admit("grid", BEM, case, [GRID_RTOL], exact)
            left_out += missing
            on_grid = truth.on_grid(case.nodes)
            tasks += [Task("grid", BEM, case, rtol, on_grid) for rtol in reached]
    points, failed = measure(tasks, rounds=2)
    return points, left_out + failed


def precision_study(extent: Extent) -> Found:
    """Double precision throughout against single precision for search directions."""
    cases = [paper_case(row, extent.nodes) for row in range(extent.samples)]
    large = paper_case(0, extent.large)
    cases.append(Case(large.name, large.heights, large.side, LARGE_DELTA))
    return compare("precision", [MIXED, DOUBLE], cases, extent.rtols, extent.rounds)


def peer_study(extent: Extent) -> Found:
    """Solvers by other people, where they are installed, and ours.

    Each has its own notion of a tolerance: only errors compare. Those that are given the force
    instead of the displacement get the exact one, which costs them nothing.
    """
    left_out = [
        LeftOut("peers", package, f"not installed: {install}")
        for package, install in missing().items()
    ]
    cases = [paper_case(row, extent.nodes) for row in PEER_ROWS[: extent.samples]]
    rtols = [rtol for rtol in extent.rtols if rtol >= PEER_RTOL]
    points, unsolved = compare("peers", [BEM, *installed()], cases, rtols, rounds=2)
    return points, left_out + unsolved


def hardness_study(extent: Extent) -> Found:
    """Bodies that yield, by ours and by other solvers that know a hardness."""
    cases = [
        replace(paper_case(row, extent.nodes), hardness=hardness)
        for row in PEER_ROWS[: extent.samples]
        for hardness in HARDNESSES
    ]
    solvers = [BEM, *(solver for solver in installed() if solver.plastic)]
    rtols = [rtol for rtol in extent.rtols if rtol >= PEER_RTOL]
    return compare("hardness", solvers, cases, rtols, rounds=2)


STUDIES: dict[str, Callable[[Extent], Found]] = {
    "tolerance": tolerance_study,
    "grid": grid_study,
    "precision": precision_study,
    "peers": peer_study,
    "hardness": hardness_study,
}
