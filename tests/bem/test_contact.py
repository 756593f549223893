"""The numbers and fields that `solve` returns, and its behaviour at the ends of its range."""

import dataclasses
import tracemalloc

import numpy as np
import pytest

import bem
from bem.equilibrium import equilibrium_of
from bem.influence import Kernel, influence_coefficients
from bem.operators.patch import fast_period
from bem.problem import pose
from bem.solving import contact_of
from gen.surface import generate

pytestmark = pytest.mark.usefixtures("both_ways")

KERNELS: list[Kernel] = ["uniform-pressure", "concentrated-force"]
SIDE = (240.0, 320.0)


def rough(shape: tuple[int, int] = (25, 33), seed: int = 0) -> np.ndarray:
    """A random walk, smoothed, with a range of heights of 10."""
    random = np.random.default_rng(seed)
    walk = np.cumsum(np.cumsum(random.standard_normal(shape), axis=0), axis=1)
    walk += random.standard_normal(shape)
    return 10 * walk / np.ptp(walk)


HEIGHTS = rough()


def test_perimeter_goes_on_past_the_borders_of_a_periodic_patch():
    contact = bem.solve(HEIGHTS, (30.0, 70.0), pressure=1e-2, boundary="periodic")
    touching, (dx, dy) = contact.pressure > 0, contact.problem.spacing
    across, along = (np.sum(touching != np.roll(touching, 1, axis)) for axis in (0, 1))
    assert 0 < across != along > 0
    assert contact.perimeter == pytest.approx(across * dy + along * dx, rel=1e-14)


def test_a_residual_that_is_no_number_is_refused():
    problem = pose(HEIGHTS, SIDE, 2.0)
    solved = equilibrium_of(problem)
    assert solved is not None
    lost = dataclasses.replace(solved, pressure=np.nan * solved.pressure, converged=False)
    with pytest.raises(bem.NotConverged):
        contact_of(problem, lost)


def test_results_cannot_be_rewritten():
    contact = bem.solve(HEIGHTS, SIDE, 2.0)
    with pytest.raises(dataclasses.FrozenInstanceError):
        contact.force = 0.0
    fields = contact.problem.heights, contact.pressure, contact.displacement, contact.gap
    for field in (*fields, bem.solve(HEIGHTS, SIDE, 0.0).pressure):
        with pytest.raises(ValueError, match="read-only"):
            field[0, 0] = 0.0


@pytest.mark.parametrize("delta", [0.0, -0.0, -1e300, 0])
@pytest.mark.parametrize("far_field", ["rigid", "compliant"])
def test_nothing_touches_up_to_delta_zero(delta, far_field):
    contact = bem.solve(HEIGHTS, SIDE, delta, far_field=far_field)
    assert not contact.pressure.any()
    assert contact.force == contact.area_percent == contact.contact_nodes == 0
    assert contact.iterations == contact.convolutions == contact.residual == 0
    assert contact.perimeter == contact.largest_pressure == 0
    assert contact.mean_gap == pytest.approx((HEIGHTS.max() - HEIGHTS).mean() - delta, rel=1e-14)
    assert contact.gap.min() == -delta


@pytest.mark.parametrize("kernel", KERNELS)
def test_one_spike_is_one_cell_under_load(kernel):
    heights = np.zeros((20, 31))
    heights[3, 30] = 1e3
    contact = bem.solve(heights, 1.0, 10.0, spacing=0.25, kernel=kernel)
    stiffness = 0.25 / influence_coefficients((1, 1), kernel)[0, 0]
    assert contact.contact_nodes == 1
    assert contact.force == pytest.approx(10 * stiffness, rel=1e-6)
    assert contact.perimeter == 0.75  # the patch's border is no edge


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("delta", [1e-9, 1.0, 1e9])
def test_flat_surfaces_touch_everywhere(delta, kernel):
    contact = bem.solve(np.full((20, 31), 7.0), 1.0, delta, spacing=0.5, kernel=kernel)
    unit = bem.solve(np.zeros((20, 31)), 1.0, 1.0, spacing=0.5, kernel=kernel)
    assert contact.area_percent == 100.0
    assert contact.perimeter == 0.0
    assert contact.force == pytest.approx(delta * unit.force, rel=1e-12)
    assert contact.pressure[0, 0] > contact.pressure[10, 15]  # as under any flat punch


@pytest.mark.usefixtures("iterations_alone")
def test_bound_on_iterations_raises_with_the_numbers_reached():
    with pytest.raises(bem.NotConverged) as stopped:
        bem.solve(HEIGHTS, SIDE, 5.0, rtol=1e-9, max_iterations=2)
    contact, message = stopped.value.contact, str(stopped.value)
    assert contact.iterations == 2
    assert contact.residual > 1e-9
    assert contact.pressure.min() >= 0
    assert contact.force > 0
    assert len(message.splitlines()) == 1
    for part in (f"residual {contact.residual:.1e}", "after 2", "1.0e-09", "max_iterations (2)"):
        assert part in message


@pytest.mark.usefixtures("iterations_alone")
@pytest.mark.parametrize("far_field", ["rigid", "compliant"])
@pytest.mark.parametrize("bound", [1, 7])
def test_the_bound_on_iterations_is_never_passed(bound, far_field):
    heights = rough((33, 33))
    with pytest.raises(bem.NotConverged) as stopped:
        bem.solve(heights, 1.0, 2.0, rtol=1e-14, max_iterations=bound, far_field=far_field)
    assert stopped.value.contact.iterations == bound


@pytest.mark.parametrize("percent", [1, 10, 50])
def test_memory_is_at_most_twelve_padded_arrays(percent):
    nodes = 239 + 2 * percent  # odd sizes of their own: nothing is kept from another test
    heights = generate("diamond-square", 513, 0.65, 12.5, np.random.default_rng(1))[:nodes, :nodes]
    delta = float(np.quantile(heights.max() - heights, min(3.5 * percent / 100, 1.0)))
    tracemalloc.start()
    try:
        contact = bem.solve(heights, 1000.0, delta)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert 0.3 * percent < contact.area_percent < 2 * percent
    assert peak <= 12 * 8 * fast_period(nodes) ** 2
