"""Time tables, convolutions, preconditioners and solves; each benchmark asserts its answer.

    pytest bench/suites/test_solver.py --benchmark-only

A round of `test_solve_paper` solves the first 64 rows of the paper's database. It records the
convolutions, the residual, and the cost of a solve in bare convolutions.
"""

import time
from collections.abc import Callable
from functools import partial
from statistics import median
from typing import Any
from unittest import mock

import numpy as np
import pytest
from numpy.typing import NDArray
from pytest_benchmark.fixture import BenchmarkFixture
from scipy import optimize

import bem
from bem import influence
from bem.bodies import HALF_SPACE, KERNELS, REDUCED, Kernel
from bem.derived.flow import flows_through
from bem.derived.stiffness import punch_of
from bem.operators import patch
from bem.operators.displacement import displacement_filter
from bem.operators.filters import filtered
from bem.operators.patch import Patch
from bem.problem import BOUNDARIES, RTOL, Boundary
from bench.references import half_space as references
from bench.resolution import random_waves
from bench.work_precision import paper_case

SIZES = {"smoke": 33, "paper": 129, "large": 513}
"""Nodes a side of the surfaces, by size of the benchmark."""

SIDE = 1000.0
"""Scan length [um]."""

ROWS = 64
"""Number of the first rows of the paper's database that are solved."""

EXACT = 1e-10
"""Relative tolerance of the solutions that answers are compared with."""

DELTAS = {
    33: {1: 6.48, 10: 16.09, 50: 43.35},
    129: {1: 7.86, 10: 20.05, 50: 60.32},
    513: {1: 9.56, 10: 24.38, 50: 84.25},
}
"""Delta that brings a share of the nodes of the first row's surface into contact [um], by the nodes
a side and by the share [%]."""

sizes = pytest.mark.parametrize("nodes", SIZES.values(), ids=SIZES)
kernels = pytest.mark.parametrize("kernel", KERNELS)
precisions = pytest.mark.parametrize("dtype", ["float64", "float32"])

Work = Callable[[], object]
"""A function whose time is taken."""


def random_field(nodes: int, seed: int = 7) -> NDArray[np.float64]:
    """Draw standard normal numbers, shape (nodes, nodes)."""
    return np.random.default_rng(seed).standard_normal((nodes, nodes))


def assert_exact(contact: bem.Contact) -> None:
    """Assert that a contact has the nodes and the force of a solution of tolerance `EXACT`.

    The number of nodes in contact may differ by 0.05 %, or by one node. The force may differ by
    0.001 %.
    """
    problem = contact.problem
    exact = bem.solve(
        problem.heights, SIDE, problem.delta, kernel=problem.kernel, rtol=EXACT
    )
    difference = abs(contact.contact_nodes - exact.contact_nodes)
    assert difference <= max(exact.contact_nodes // 2000, 1)
    assert contact.force == pytest.approx(exact.force, rel=1e-5)


def convolutions(contacts: list[bem.Contact]) -> int:
    """Return the sum of the convolutions of contacts."""
    return sum(contact.convolutions for contact in contacts)


def seconds_of(work: Work, rounds: int = 5) -> list[float]:
    """Return the wall-clock time of each of several repetitions [s]."""
    seconds = []
    for _ in range(rounds):
        began = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - began)
    return seconds


def record_time_over(
    benchmark: BenchmarkFixture, name: str, work: Work, other: Work
) -> None:
    """Record the median time of `work` over that of `other` by a name, if times are taken."""
    if benchmark.enabled:
        benchmark.extra_info[name] = median(seconds_of(work)) / median(seconds_of(other))


def record_effort(benchmark: BenchmarkFixture, contacts: list[bem.Contact]) -> None:
    """Record the mean convolutions of the contacts of a round, and their largest residual.

    If times are taken, this also records the mean time of a solve [s], and the time of a solve over
    that of a bare convolution. The latter is from the fastest round, which other work on the
    machine disturbs least.
    """
    benchmark.extra_info["convolutions"] = convolutions(contacts) / len(contacts)
    benchmark.extra_info["residual"] = max(c.residual for c in contacts)
    if benchmark.stats is not None:
        rows, columns = contacts[0].pressure.shape
        kernel = contacts[0].problem.kernel
        operator = displacement_filter(
            (rows, columns), "free", REDUCED[kernel], 1.0, "float64"
        )
        # The transform works in place. A field that is not 0 would grow from one call to the next.
        operator.field.fill(0)
        bare = min(seconds_of(operator.transform, 50))
        solves = len(contacts)
        benchmark.extra_info["seconds_per_solve"] = benchmark.stats["mean"] / solves
        fastest = benchmark.stats["min"] / solves
        benchmark.extra_info["bare_convolutions_per_solve"] = fastest / bare


@sizes
@kernels
def test_influence_coefficients(
    benchmark: BenchmarkFixture, kernel: Kernel, nodes: int
) -> None:
    """Tabulate the influence coefficients; no round reuses the table of an earlier one."""

    def tabulate() -> NDArray[np.float64]:
        """Compute the table anew."""
        influence._kept_table.cache_clear()
        return influence.influence_coefficients((nodes, nodes), REDUCED[kernel])

    table = benchmark(tabulate)
    self_displacement = {
        "uniform-pressure": 4 * np.log(1 + np.sqrt(2)) / np.pi,
        "concentrated-force": 2 / np.pi,
    }
    assert table.shape == (nodes, nodes)
    assert np.array_equal(table, table.T)
    assert table[0, 0] == pytest.approx(self_displacement[kernel], rel=1e-15)
    assert table[0, -1] == pytest.approx(1 / (np.pi * (nodes - 1)), rel=1e-4)


@sizes
@precisions
def test_convolution(benchmark: BenchmarkFixture, dtype: str, nodes: int) -> None:
    """Compute displacements from pressures, and compare them with direct sums."""
    pressure = random_field(nodes).astype(dtype)
    operator = displacement_filter((nodes, nodes), "free", HALF_SPACE, 1.0, dtype)
    displacement = benchmark(filtered, operator, pressure)
    expected = references.displacement(pressure.astype(np.float64), "uniform-pressure")
    accepted = {"float64": 1e-12, "float32": 1e-5}[dtype] * np.abs(expected).max()
    np.testing.assert_allclose(displacement, expected, rtol=0, atol=accepted)


@sizes
@pytest.mark.parametrize("boundary", BOUNDARIES)
def test_approximate_inverse(
    benchmark: BenchmarkFixture, boundary: Boundary, nodes: int
) -> None:
    """Precondition half of the nodes; the operator is symmetric and positive definite."""
    operator = Patch((nodes, nodes), boundary, HALF_SPACE, 1.0)
    operator.take_contact(random_field(nodes) > 0)
    residual, other = (random_field(nodes, seed) * operator.contact for seed in (1, 2))

    def correct(field: NDArray[np.float64]) -> NDArray[np.float64]:
        """Apply the approximate inverse to a field of the contact set."""
        return operator.correct(operator.in_contact(field))

    correction = benchmark(correct, residual).astype(np.float64)
    product = (other * correction).sum()
    transposed = (correct(other) * residual).sum()
    accepted = 1e-5 * np.abs(correction * other).sum()
    assert (residual * correction).sum() > 0
    assert product == pytest.approx(transposed, rel=0, abs=accepted)


@pytest.mark.parametrize("rtol", [1e-6, RTOL])
def test_solve_paper(benchmark: BenchmarkFixture, rtol: float) -> None:
    """Solve contacts of the paper's database, at a tolerance of 1e-6 and at the default one."""
    cases = [paper_case(row, SIZES["paper"]) for row in range(ROWS)]
    contacts = benchmark(
        lambda: [bem.solve(case.heights, SIDE, case.delta, rtol=rtol) for case in cases]
    )
    record_effort(benchmark, contacts)
    for contact in contacts[:: ROWS // 8]:
        assert_exact(contact)


@sizes
@pytest.mark.parametrize("percent", [1, 10, 50])
def test_solve_at_contact(benchmark: BenchmarkFixture, percent: int, nodes: int) -> None:
    """Solve contacts with small, medium and large shares of the nodes in contact."""
    contact = benchmark(
        bem.solve, paper_case(0, nodes).heights, SIDE, DELTAS[nodes][percent]
    )
    record_effort(benchmark, [contact])
    assert contact.area_percent == pytest.approx(percent, rel=0.1)
    assert_exact(contact)


@pytest.mark.parametrize("percent", [0.5, 1.0, 2.0, 4.0])
@pytest.mark.parametrize("nodes", [129, 257])
def test_solve_few_in_contact(
    benchmark: BenchmarkFixture, nodes: int, percent: float
) -> None:
    """Solve contacts of few nodes by dense algebra; record the time over that of iterations alone.

    Both solutions have equal forces.
    """
    heights = paper_case(0, nodes).heights

    def excess(delta: float) -> float:
        """Return the share in contact at a Delta [um] less the wanted share [%]."""
        return bem.solve(heights, SIDE, delta, rtol=1e-2).area_percent - percent

    delta = optimize.brentq(excess, 1, 60, xtol=0.1)
    solve = partial(bem.solve, heights, SIDE, delta)

    def iterate() -> bem.Contact:
        """Solve without dense algebra."""
        never_dense = ((0.0, 1.0),)
        with mock.patch.object(patch, "FEW_FREE", never_dense):
            return solve()

    contact = benchmark(solve)
    iterated = iterate()
    assert_exact(contact)
    assert iterated.force == pytest.approx(contact.force, rel=1e-5)
    record_effort(benchmark, [contact])
    benchmark.extra_info["contact_nodes"] = contact.contact_nodes
    benchmark.extra_info["convolutions_of_iterations_alone"] = iterated.convolutions
    record_time_over(benchmark, "time_over_iterations_alone", solve, iterate)


@pytest.mark.parametrize("control", ["force", "pressure"])
def test_solve_given_force(benchmark: BenchmarkFixture, control: str) -> None:
    """Solve contacts under a given force or mean pressure; record the cost over a given Delta."""
    cases = [paper_case(row, SIZES["paper"]) for row in range(ROWS // 4)]

    def solve_for_delta() -> list[bem.Contact]:
        """Solve all cases at their Delta."""
        return [bem.solve(case.heights, SIDE, case.delta) for case in cases]

    expected = solve_for_delta()
    solves = []
    for case, contact in zip(cases, expected, strict=True):
        if control == "force":
            solve = partial(bem.solve, case.heights, SIDE, force=contact.force)
        else:
            pressure = float(contact.pressure.mean())
            solve = partial(bem.solve, case.heights, SIDE, pressure=pressure)
        solves.append(solve)

    def solve_for_load() -> list[bem.Contact]:
        """Solve all cases under the force or the mean pressure of the contact at their Delta."""
        return [solve() for solve in solves]

    contacts = benchmark(solve_for_load)
    for contact, exact in zip(contacts, expected, strict=True):
        assert contact.delta == pytest.approx(exact.delta, rel=1e-5)
        assert contact.force == pytest.approx(exact.force, rel=1e-5)
    ratio = convolutions(contacts) / convolutions(expected)
    benchmark.extra_info["convolutions_over_given_delta"] = ratio
    record_effort(benchmark, contacts)
    record_time_over(benchmark, "time_over_given_delta", solve_for_load, solve_for_delta)


@pytest.mark.parametrize("boundary", BOUNDARIES)
@sizes
def test_stiffness(benchmark: BenchmarkFixture, nodes: int, boundary: Boundary) -> None:
    """Solve for the stiffness of a contact; record the cost over that of the contact.

    The stiffness is the slope of force over Delta, by central differences. A free patch has 10 % of
    its nodes in contact; other patches are pressed by 0.01 E*.
    """
    heights = paper_case(0, nodes).heights[:-1, :-1]
    solve = partial(bem.solve, heights, SIDE, DELTAS[nodes][10], boundary=boundary)
    if boundary != "free":
        solve = partial(bem.solve, heights, SIDE, pressure=0.01, boundary=boundary)
    contact = solve()
    touching = np.flatnonzero(contact.pressure)
    work = partial(punch_of, contact.problem, touching)
    punch = benchmark(work)
    step = 1e-5 * contact.delta

    def force_at(delta: float) -> float:
        """Return the force at a Delta [um], solved to `EXACT` [uN]."""
        return bem.solve(heights, SIDE, delta, boundary=boundary, rtol=EXACT).force

    slope = (force_at(contact.delta + step) - force_at(contact.delta - step)) / (2 * step)
    assert punch.stiffness == pytest.approx(slope, rel=1e-2)  # a node may come to touch
    benchmark.extra_info["convolutions"] = punch.effort.convolutions
    benchmark.extra_info["convolutions_of_the_contact"] = contact.convolutions
    record_time_over(benchmark, "time_over_the_contact", work, solve)


FLOWS = [(129, load, boundary) for load in (0.003, 0.01, 0.03) for boundary in BOUNDARIES]
"""Nodes a side, mean pressure over E*, and boundary of each contact whose flow is solved for."""


@pytest.mark.parametrize(
    ("nodes", "pressure", "boundary"), [*FLOWS, (1025, 0.03, "free")]
)
def test_flow(benchmark: Any, nodes: int, pressure: float, boundary: Boundary) -> None:
    """Solve for the flow through the gap along x; record the cost over that of the contact."""
    heights = paper_case(0, nodes).heights[:-1, :-1]
    solve = partial(bem.solve, heights, SIDE, pressure=pressure, boundary=boundary)
    contact = solve()
    gap = np.where(contact.pressure > 0, 0, contact.gap.clip(0))
    periodic = boundary == "periodic"
    # `Contact.flow` solves both axes of a periodic patch, with one factorisation.
    axes = (0, 1) if periodic else (0,)
    work = partial(flows_through, gap, contact.problem.spacing, axes, periodic=periodic)
    rounds = 1 if nodes > SIZES["paper"] else 9
    flow, *_ = benchmark.pedantic(work, rounds=rounds)
    assert flow.aperture == contact.flow().aperture > 0
    benchmark.extra_info["area_percent"] = contact.area_percent
    record_time_over(benchmark, "time_over_the_contact", work, solve)


@pytest.mark.parametrize("error", [0.03, 0.01])
def test_solve_within(benchmark: BenchmarkFixture, error: float) -> None:
    """Solve a smooth map within an error of the area; record its time over the full map's."""
    surface = random_waves(1, 8, 0.8, np.random.default_rng(1))
    heights = surface(np.arange(256) / 256)
    load: dict[str, Any] = {"pressure": 0.005, "boundary": "periodic"}
    solve = partial(bem.solve_within, heights, 1.0, error, **load)

    def solve_full() -> bem.Contact:
        """Solve the full map, with the bar of its grid."""
        contact = bem.solve(heights, 1.0, **load)
        contact.grid_error()
        return contact

    contact = benchmark(solve)
    exact = solve_full().continuum_area_percent
    assert contact.continuum_area_percent == pytest.approx(exact, rel=error)
    benchmark.extra_info["nodes"] = len(contact.pressure)
    record_time_over(benchmark, "time_over_the_full_map", solve, solve_full)


@pytest.mark.parametrize("rungs", [9, 41, 161])
def test_solve_ladder(benchmark: BenchmarkFixture, rungs: int) -> None:
    """Solve contacts at Deltas from 5 to 45 um as a ladder; record the cost over single solves.

    On a ladder, each contact starts from the three contacts before it.
    """
    heights = paper_case(0, SIZES["paper"]).heights
    deltas = np.linspace(5, 45, rungs)

    def together() -> list[bem.Contact]:
        """Solve all contacts as a ladder."""
        return list(bem.ladder(heights, SIDE, deltas))

    def apart() -> list[bem.Contact]:
        """Solve each contact on its own."""
        return [bem.solve(heights, SIDE, delta) for delta in deltas]

    ladder = benchmark(together)
    alone = apart()
    for of_ladder, single in zip(ladder, alone, strict=True):
        assert abs(of_ladder.contact_nodes - single.contact_nodes) <= 1
        assert of_ladder.force == pytest.approx(single.force, rel=1e-5)
    record_effort(benchmark, ladder)
    ratio = convolutions(ladder) / convolutions(alone)
    benchmark.extra_info["convolutions_over_single_solves"] = ratio
    record_time_over(benchmark, "time_over_single_solves", together, apart)
