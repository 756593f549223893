"""The studies: each varies the tolerance, the grid, the solver or the hardness."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

from bem.influence import KERNELS, Kernel
from bench.report import remark
from bench.solvers.case import Case, find_exact
from bench.solvers.others import installed, missing
from bench.solvers.own import BEM
from bench.solvers.solver import Solver
from bench.work_precision.measurement import Row, Task, admit, measure
from gen.generation.plan import parameters
from gen.generation.sample import surface_of
from gen.scene import load

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
