"""The numbers and fields that `solve` returns, also recomputed without `bem`, and its ends."""

import dataclasses
import math
import tracemalloc

import numpy as np
import pytest
from hypothesis import given, reject, settings
from hypothesis import strategies as st
from scipy import ndimage

import bem
from bem.bodies import KERNELS
from bem.operators.displacement import fast_period
from bem.problem import FAR_FIELDS
from bench.references import dense
from bench.references.half_space import flat_punch
from bench.references.surfaces import SURFACES, surface
from gen.surface import generate

pytestmark = pytest.mark.usefixtures("both_ways")

SIDE = (240.0, 320.0)


HEIGHTS = 10 * surface("random walk", (25, 33))


def test_perimeter_goes_on_past_the_borders_of_a_periodic_patch():
    contact = bem.solve(HEIGHTS, (30.0, 70.0), pressure=1e-2, boundary="periodic")
    touching, (dx, dy) = contact.pressure > 0, contact.problem.spacing
    across, along = (np.sum(touching != np.roll(touching, 1, axis)) for axis in (0, 1))
    assert 0 < across != along > 0
    assert contact.perimeter == pytest.approx(across * dy + along * dx, rel=1e-14)


def test_results_cannot_be_rewritten():
    contact = bem.solve(HEIGHTS, SIDE, 2.0)
    with pytest.raises(dataclasses.FrozenInstanceError):
        contact.force = 0.0
    fields = contact.problem.heights, contact.pressure, contact.displacement, contact.gap
    for field in (*fields, bem.solve(HEIGHTS, SIDE, 0.0).pressure):
        with pytest.raises(ValueError, match="read-only"):
            field[0, 0] = 0.0


up_to_zero = pytest.mark.parametrize("delta", [0.0, -0.0, -1e300, 0])
far_fields = pytest.mark.parametrize("far_field", FAR_FIELDS)


@up_to_zero
@far_fields
def test_nothing_touches_up_to_delta_zero(delta, far_field):
    contact = bem.solve(HEIGHTS, SIDE, delta, far_field=far_field)
    assert not contact.pressure.any()
    assert contact.force == contact.area_percent == contact.contact_nodes == 0
    assert contact.perimeter == contact.largest_pressure == 0


@up_to_zero
@far_fields
def test_bodies_that_are_apart_take_no_work(delta, far_field):
    contact = bem.solve(HEIGHTS, SIDE, delta, far_field=far_field)
    assert contact.iterations == contact.convolutions == contact.residual == 0


@up_to_zero
@far_fields
def test_bodies_that_are_apart_keep_their_shape(delta, far_field):
    contact = bem.solve(HEIGHTS, SIDE, delta, far_field=far_field)
    assert contact.mean_gap == pytest.approx(
        (HEIGHTS.max() - HEIGHTS).mean() - delta, rel=1e-14
    )
    assert contact.gap.min() == -delta


@pytest.mark.parametrize("percent", [1, 10, 50])
def test_memory_is_at_most_twelve_padded_arrays(percent):
    nodes = 239 + 2 * percent  # odd sizes of their own: nothing is kept from another test
    heights = generate("diamond-square", 513, 0.65, 12.5, np.random.default_rng(1))[
        :nodes, :nodes
    ]
    delta = float(np.quantile(heights.max() - heights, min(3.5 * percent / 100, 1.0)))
    tracemalloc.start()
    try:
        contact = bem.solve(heights, 1000.0, delta)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert 0.3 * percent < contact.area_percent < 2 * percent
    assert peak <= 12 * 8 * fast_period(nodes) ** 2


ASPECTS = [1.0, 2.0, 0.3]


def displacement(contact):
    """Recompute the (nx, ny) field [um]."""
    problem = contact.problem
    reduced = dense.displace(contact.pressure, problem.kernel, problem.aspect)
    return reduced * problem.spacing[0] / problem.modulus


def gap(contact):
    """Recompute the (nx, ny) field [um]."""
    heights = contact.problem.heights
    return displacement(contact) - (heights - heights.max() + approach(contact))


def approach(contact):
    """Delta, plus F / K on a compliant far field [um]."""
    problem = contact.problem
    if problem.far_field == "rigid":
        return problem.delta
    punch = flat_punch(contact.pressure.shape, problem.kernel, problem.aspect).sum()
    return problem.delta + contact.pressure.sum() * problem.spacing[0] / (
        punch * problem.modulus
    )


def perimeter(contact):
    """Edges between touching and open cells, by differences that vanish at the border [um]."""
    touching = (contact.pressure > 0).astype(int)
    edges = [
        np.abs(ndimage.correlate1d(touching, [-1, 1], axis=axis, mode="nearest")).sum()
        for axis in (0, 1)
    ]
    return float(
        edges[0] * contact.problem.spacing[1] + edges[1] * contact.problem.spacing[0]
    )


def residual(contact):
    """Largest |gap| in contact or penetration outside, over Delta."""
    distance = gap(contact)
    wrong = np.where(contact.pressure > 0, np.abs(distance), -distance)
    return float(max(wrong.max(), 0.0)) / contact.problem.delta


@st.composite
def contacts(draw):
    """Draw a contact of any surface, grid, material and tolerance."""
    shape = draw(st.tuples(st.integers(1, 17), st.integers(1, 17)))
    kind = draw(st.sampled_from(list(SURFACES)))
    heights = draw(st.floats(0.1, 100)) * surface(
        kind, shape, draw(st.integers(0, 2**32 - 1))
    )
    kernel = draw(st.sampled_from(KERNELS))
    aspect = draw(st.sampled_from(ASPECTS)) if kernel == "uniform-pressure" else 1.0
    spacing = draw(st.sampled_from([0.01, 1.0, 7.8]))
    depth = draw(st.floats(0.001, 3))
    far_field = draw(st.sampled_from(FAR_FIELDS))
    try:
        return bem.solve(
            heights,
            1.0,
            depth * (np.ptp(heights) or 1.0),
            spacing=(spacing, spacing * aspect),
            modulus=draw(st.sampled_from([1.0, 3.0, 2.1e5])),
            poisson=draw(st.sampled_from([0.0, 0.3, 0.5])),
            kernel=kernel,
            far_field=far_field,
            rtol=draw(st.sampled_from([1e-3, 1e-6, 1e-11])),
        )
    except bem.NoSolution:  # too deep for a compliant far field
        reject()


@settings(max_examples=120)
@given(contacts())
def test_numbers_and_fields_are_those_of_the_pressure(contact):
    rounding = {"rel": 0, "abs": 1e-12 * contact.approach}
    assert contact.approach == pytest.approx(approach(contact), rel=1e-11)
    assert contact.displacement == pytest.approx(displacement(contact), **rounding)
    assert contact.gap == pytest.approx(gap(contact), **rounding)
    assert contact.mean_gap == pytest.approx(gap(contact).mean(), **rounding)
    accepted = 1e-12 * contact.approach / contact.problem.delta
    assert contact.residual == pytest.approx(residual(contact), rel=0, abs=accepted)
    assert residual(contact) <= contact.problem.rtol + accepted
    cell = contact.problem.spacing[0] * contact.problem.spacing[1]
    touching = contact.pressure > 0
    assert contact.force == pytest.approx(
        math.fsum(contact.pressure.flat) * cell, rel=1e-13
    )
    assert contact.largest_pressure == ndimage.maximum(contact.pressure)
    assert contact.contact_nodes == ndimage.sum_labels(touching)
    assert contact.area_percent == pytest.approx(100 * ndimage.mean(touching), rel=1e-14)
    assert contact.perimeter == pytest.approx(perimeter(contact), rel=1e-13)


def stopped_solve(kernel, far_field):
    """Return the error of a solve that needs more than its two iterations."""
    heights = surface("self-affine", (17, 16), seed=3)
    with pytest.raises(bem.NotConverged) as stopped:
        bem.solve(
            heights,
            1.0,
            0.4,
            spacing=0.5,
            kernel=kernel,
            far_field=far_field,
            max_iterations=2,
        )
    return stopped.value


@pytest.mark.usefixtures("iterations_alone")
@far_fields
@pytest.mark.parametrize("kernel", KERNELS)
def test_a_solve_that_was_stopped_says_how_far_it_came_and_what_helps(kernel, far_field):
    stopped = stopped_solve(kernel, far_field)
    contact = stopped.contact
    message = str(stopped)
    assert contact.residual > contact.problem.rtol
    for part in (f"residual {contact.residual:.1e}", "after 2", "max_iterations (2)"):
        assert part in message


@pytest.mark.usefixtures("iterations_alone")
@far_fields
@pytest.mark.parametrize("kernel", KERNELS)
def test_numbers_of_a_solve_that_was_stopped(kernel, far_field):
    """They belong to the pressure that was reached, not to the solution."""
    contact = stopped_solve(kernel, far_field).contact
    assert contact.residual == pytest.approx(residual(contact), rel=1e-10)
    assert contact.approach == pytest.approx(approach(contact), rel=1e-12)
    assert contact.gap == pytest.approx(gap(contact), rel=0, abs=1e-12)
    assert contact.force == pytest.approx(contact.pressure.sum() * 0.5**2, rel=1e-13)
