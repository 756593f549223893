"""Contacts under a given force, against contacts at the displacement that belongs to it."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import bem
from bem.influence import KERNELS
from bem.problem import FAR_FIELDS
from bench.references.surfaces import SURFACES, surface
from gen.runtime.signals import at_most
from gen.surface import generate

pytestmark = pytest.mark.usefixtures("both_ways")

RTOL = 1e-9


@settings(max_examples=60)
@given(
    kind=st.sampled_from(list(SURFACES)),
    seed=st.integers(0, 2**32 - 1),
    shape=st.tuples(st.integers(2, 24), st.integers(2, 24)),
    kernel=st.sampled_from(KERNELS),
    share=st.floats(0.01, 3.0),
)
def test_force_and_displacement_lead_to_one_another(
    kind: str, seed: int, shape: tuple[int, int], kernel: bem.influence.Kernel, share: float
) -> None:
    heights = surface(kind, shape, seed)
    side = (10.0 * (shape[0] - 1), 10.0 * (shape[1] - 1))
    delta = share * (float(np.ptp(heights)) or 1.0)
    given_delta = bem.solve(heights, side, delta, modulus=7.0, kernel=kernel, rtol=RTOL)
    given_force = bem.solve(
        heights, side, force=given_delta.force, modulus=7.0, kernel=kernel, rtol=RTOL
    )
    assert given_force.force == pytest.approx(given_delta.force, rel=2e-6)
    assert given_force.delta == pytest.approx(delta, rel=1e-5)
    largest = given_delta.pressure.max()
    assert np.abs(given_force.pressure - given_delta.pressure).max() < 1e-4 * largest
    assert given_force.residual <= RTOL


ROUGH = generate("diamond-square", 129, 0.65, 12.5, np.random.default_rng(4))


@pytest.mark.parametrize("far_field", FAR_FIELDS)
@pytest.mark.parametrize("delta", [0.5, 4.0, 9.0, 14.0, 17.0])
def test_it_is_cheap_and_exact_on_rough_surfaces(delta: float, far_field: str) -> None:
    """The count of convolutions is the cost; its mean ratio is in `pytest bench -k given_force`."""
    expected = bem.solve(ROUGH, 1000.0, delta, modulus=3.0, far_field=far_field)
    contact = bem.solve(ROUGH, 1000.0, force=expected.force, modulus=3.0, far_field=far_field)
    assert contact.force == pytest.approx(expected.force, rel=2e-6)
    assert contact.delta == pytest.approx(delta, rel=5e-6)
    assert contact.approach == pytest.approx(expected.approach, rel=5e-6)
    assert abs(contact.contact_nodes - expected.contact_nodes) <= 1
    assert contact.convolutions <= 60


def test_a_given_force_takes_hardly_more_convolutions_than_a_given_displacement() -> None:
    """At most 1.5 times as many on the whole; the time is in `pytest bench -k given_force`."""
    deltas = np.linspace(6.0, 30.0, 9)
    given_delta = [bem.solve(ROUGH, 1000.0, delta) for delta in deltas]
    given_force = [bem.solve(ROUGH, 1000.0, force=contact.force) for contact in given_delta]
    counts = [
        sum(contact.convolutions for contact in contacts) for contacts in (given_force, given_delta)
    ]
    assert counts[0] <= 1.5 * counts[1]


def test_mean_pressure_is_the_mean_over_all_nodes() -> None:
    contact = bem.solve(ROUGH, 1000.0, pressure=0.02, modulus=3.0)
    assert contact.pressure.mean() == pytest.approx(0.02, rel=2e-6)
    assert contact.problem.delta is None
    assert contact.delta > 0


def test_no_force_is_first_touch() -> None:
    contact = bem.solve(ROUGH, 1000.0, force=0.0)
    assert (contact.force, contact.delta, contact.contact_nodes) == (0.0, 0.0, 0)


def test_flat_surfaces_and_single_nodes_have_a_displacement() -> None:
    flat = bem.solve(np.zeros((9, 9)), 80.0, force=5.0)
    assert bem.solve(np.zeros((9, 9)), 80.0, flat.delta).force == pytest.approx(5.0, rel=1e-5)
    one = bem.solve(np.zeros((1, 1)), 1.0, force=5.0, spacing=2.0)
    assert bem.solve(np.zeros((1, 1)), 1.0, one.delta, spacing=2.0).force == pytest.approx(5.0)


@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
@pytest.mark.parametrize("pressure", [1e-30, 1e-24, 1e-15, 1e-6])
def test_forces_far_below_any_guess_are_carried(pressure: float) -> None:
    """The highest node of the grid is not among those that the displacement is guessed on."""
    heights = generate("diamond-square", 513, 0.7, 12.5, np.random.default_rng(0))
    contact = bem.solve(heights, 1.0, pressure=pressure, spacing=1.0)
    assert contact.pressure.mean() == pytest.approx(pressure, rel=1e-6)
    assert 0 < contact.delta < 1


def ridges(shape: tuple[int, int], row: int, column: int | None = None) -> np.ndarray:
    heights = np.zeros(shape)
    heights[row] = 1
    if column is not None:
        heights[:, column] = 1
    return heights


@pytest.mark.parametrize(
    ("heights", "pressure", "rtol"),
    [
        (ridges((19, 28), 9, 14), 0.018963090011501784, 1e-12),
        *((ridges((12, 37), row), 0.030927496547942784, 1e-10) for row in range(6)),
    ],
)
def test_ties_under_tight_tolerances_end(heights: np.ndarray, pressure: float, rtol: float) -> None:
    """Rounding in the displacement of the far field must not add to the residual."""
    with at_most(20):
        contact = bem.solve(heights, 1.0, pressure=pressure, spacing=1.0, rtol=rtol)
    assert contact.residual <= rtol
    assert contact.iterations < 60


@pytest.mark.parametrize("rtol", [2e-10, 1e-10, 1e-12])
def test_tight_tolerances_cost_a_force_hardly_more_than_a_displacement(rtol: float) -> None:
    given_force = bem.solve(ROUGH, 1000.0, pressure=0.02, rtol=rtol)
    given_delta = bem.solve(ROUGH, 1000.0, given_force.delta, rtol=rtol)
    assert given_force.convolutions <= 1.5 * given_delta.convolutions + 5
    assert given_force.force == pytest.approx(given_delta.force, rel=20 * rtol)


@pytest.mark.parametrize("across", [0.0105, 1e-3, 300.0])
def test_a_force_on_oblong_cells(across: float) -> None:
    """The preconditioner is weaker there, for a force as for a displacement."""
    heights = np.indices((60, 71)).sum(0) % 2.0
    given_force = bem.solve(heights, 1.0, pressure=9.9, spacing=(1.0, across))
    given_delta = bem.solve(heights, 1.0, given_force.delta, spacing=(1.0, across))
    assert given_force.force == pytest.approx(given_delta.force, rel=1e-6)
    assert given_force.iterations <= 2 * given_delta.iterations + 20


@pytest.mark.parametrize("far_field", FAR_FIELDS)
@pytest.mark.parametrize("rtol", [1e-3, 2e-7, 1e-12])
def test_residual_and_force_are_what_is_said(rtol: float, far_field: str) -> None:
    for pressure in (1e-3, 0.02, 0.2):
        contact = bem.solve(ROUGH, 1000.0, pressure=pressure, rtol=rtol, far_field=far_field)
        gap = np.where(contact.pressure > 0, np.abs(contact.gap), -contact.gap)
        assert contact.residual == pytest.approx(gap.max() / contact.approach, rel=0, abs=2e-14)
        assert contact.pressure.mean() == pytest.approx(pressure, rel=1e-14)


@pytest.mark.parametrize("most", [1, 2, 5])
def test_what_is_reached_before_the_bound_makes_sense(most: int) -> None:
    contact = bem.solve(ROUGH, 1000.0, pressure=0.02)
    with pytest.raises(bem.NotConverged, match="raise max_iterations") as stopped:
        bem.solve(ROUGH, 1000.0, pressure=0.02, max_iterations=most, rtol=1e-12)
    reached = stopped.value.contact
    assert contact.delta / 3 < reached.delta < 3 * contact.delta
    assert reached.pressure.mean() == pytest.approx(0.02, rel=1e-12)
    gap = np.where(reached.pressure > 0, np.abs(reached.gap), -reached.gap)
    assert reached.residual == pytest.approx(gap.max() / reached.approach, rel=1e-9)
    assert reached.residual > 1e-12


def test_too_few_iterations_are_reported() -> None:
    with pytest.raises(bem.NotConverged, match=r"after [1-4] iterations") as stopped:
        bem.solve(ROUGH, 1000.0, pressure=0.02, max_iterations=3)
    assert stopped.value.contact.residual > 1e-6


@pytest.mark.parametrize("force", [1e-3, 0.1, 10.0, 1e7])
def test_the_resulting_displacement_carries_the_force(force: float) -> None:
    """From one node in contact to almost all of them."""
    contact = bem.solve(ROUGH, 1000.0, force=force, modulus=1e3)
    again = bem.solve(ROUGH, 1000.0, contact.delta, modulus=1e3)
    assert again.force == pytest.approx(force, rel=3e-6)


@pytest.mark.parametrize(
    ("side", "scale", "load"),
    [
        (1e50, 1.0, {"force": 1e-300}),
        (1e-50, 1.0, {"force": 1e300}),
        (1.0, 1e200, {"force": 1e-150}),
        (1e-30, 1.0, {"pressure": 1e-300}),
    ],
)
def test_forces_that_would_vanish_or_overflow_are_refused(
    side: float, scale: float, load: dict[str, Any]
) -> None:
    with pytest.raises(bem.OutOfRange, match="double precision"):
        bem.solve(scale * ROUGH[:20, :20], side, **load)


@pytest.mark.parametrize("rtol", [0.9, 1e-3, 1e-9, 1e-13])
def test_every_tolerance_keeps_the_force(rtol: float) -> None:
    contact = bem.solve(ROUGH[:40, :40], 300.0, force=2000.0, rtol=rtol)
    assert contact.force == pytest.approx(2000.0, rel=1e-5)
    assert contact.residual <= rtol
