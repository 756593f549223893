"""Stiffness and conductance of contacts, against closed forms and differences of forces."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import bem
from bem.bodies import HALF_SPACE
from bem.derived.stiffness import PUNCH_RTOL, patch_stiffness, punch_of
from bem.influence import InfluenceMatrix
from bem.operators.patch import Patch
from bem.problem import pose

E = 1000.0
SIDE = 100.0


def rough(shape, seed=0):
    """Return a smooth random surface that repeats itself, with an rms height of 1 um."""
    rng = np.random.default_rng(seed)
    waves = np.hypot(
        np.fft.fftfreq(shape[0])[:, np.newaxis] * shape[0],
        np.fft.rfftfreq(shape[1]) * shape[1],
    )
    amplitude = np.where(
        (waves > 0) & (waves < min(shape) / 4), np.maximum(waves, 3) ** -1.8, 0
    )
    heights = np.fft.irfft2(
        amplitude * np.exp(2j * np.pi * rng.random(waves.shape)), s=shape
    )
    return heights / heights.std()


def paraboloids(nodes, centres, radius):
    """Return the highest of equal paraboloids at some centres, on SIDE x SIDE."""
    x = np.linspace(0, SIDE, nodes)
    parts = [
        -((x[:, np.newaxis] - cx) ** 2 + (x - cy) ** 2) / (2 * radius)
        for cx, cy in centres
    ]
    return np.max(parts, axis=0)


def sides_of(shape):
    """Return sides with square cells, SIDE along the first axis, for every boundary."""
    return SIDE, SIDE * (shape[1] - 1) / (shape[0] - 1)


@pytest.mark.parametrize(
    ("nodes", "accuracy"), [(64, 0.01), (65, 0.01), (129, 1e-3), (257, 1e-3)]
)
def test_a_circular_spot_is_that_of_hertz(nodes, accuracy):
    radius, delta = 500.0, 1.5
    heights = paraboloids(nodes, [(SIDE / 2, SIDE / 2)], radius)
    contact = bem.solve(heights, SIDE, delta, modulus=E)
    a = math.sqrt(radius * delta)
    assert contact.stiffness == pytest.approx(2 * E * a, rel=accuracy)
    k = 2 * 20.0 * 60.0 / 80.0
    assert contact.conductance(20.0, 60.0) == pytest.approx(2 * a * k, rel=accuracy)
    assert contact.conductance(60.0, 20.0) == contact.conductance(20.0, 60.0)
    assert contact.conductance(20.0, math.inf) == pytest.approx(
        2 * 20.0 * 2 * a, rel=accuracy
    )


@pytest.mark.parametrize("boundary", ["free", "periodic", "mirror"])
@pytest.mark.parametrize("shape", [(48, 48), (33, 40)])
@pytest.mark.parametrize("pressure", [3.0, 30.0])
def test_stiffness_is_the_slope_of_the_force(boundary, shape, pressure):
    def solved(**load):
        return bem.solve(
            rough(shape),
            sides_of(shape),
            boundary=boundary,
            modulus=E,
            rtol=1e-12,
            **load,
        )

    contact = solved(pressure=pressure)
    step = 1e-7 * contact.delta
    low, high = (solved(delta=contact.delta + end) for end in (-step, step))
    for other in (low, high):
        assert np.array_equal(other.pressure > 0, contact.pressure > 0)
    slope = (high.force - low.force) / (2 * step)
    assert contact.stiffness == pytest.approx(slope, rel=1e-5)
    assert contact.loading_stiffness == contact.stiffness


@pytest.mark.parametrize("boundary", ["free", "periodic", "mirror"])
def test_bodies_that_yield_load_softer_than_they_unload(boundary):
    heights, settings_ = (
        rough((40, 40)),
        {"boundary": boundary, "modulus": E, "rtol": 1e-11},
    )
    contact = bem.solve(heights, SIDE, pressure=20.0, hardness=150.0, **settings_)
    assert contact.yielded_percent > 1
    assert contact.loading_stiffness < contact.stiffness
    step = 1e-6 * contact.delta
    low, high = (
        bem.solve(heights, SIDE, contact.delta + end, hardness=150.0, **settings_)
        for end in (-step, step)
    )
    for other in (low, high):
        assert np.array_equal(other.pressure >= 150, contact.pressure >= 150)
        assert np.array_equal(other.pressure > 0, contact.pressure > 0)
    slope = (high.force - low.force) / (2 * step)
    assert contact.loading_stiffness == pytest.approx(slope, rel=1e-5)
    # Unloading is elastic, on the surface that yielding has left.
    lower = float(heights.max() - contact.flattened.max())
    less = bem.solve(contact.flattened, SIDE, contact.delta - lower - step, **settings_)
    assert np.array_equal(less.pressure > 0, contact.pressure > 0)
    assert contact.stiffness == pytest.approx(
        (contact.force - less.force) / step, rel=1e-4
    )


@pytest.mark.parametrize("boundary", ["periodic", "mirror"])
def test_full_contact_without_edges_is_infinitely_stiff(boundary):
    contact = bem.solve(
        rough((16, 20)), (16.0, 20.0), pressure=1e6, boundary=boundary, modulus=E
    )
    assert contact.area_percent == 100
    assert contact.stiffness == contact.interface_stiffness == math.inf
    assert contact.conductance(1.0, 1.0) == math.inf


def test_full_contact_of_a_free_patch_leaves_nothing_to_the_interface():
    heights = 1e-3 * rough((21, 24))
    contact = bem.solve(heights, sides_of((21, 24)), pressure=1e5, modulus=E)
    assert contact.area_percent == 100
    assert contact.stiffness == pytest.approx(patch_stiffness(contact.problem), rel=1e-11)
    assert contact.interface_stiffness == math.inf
    # A square punch has F = 1.15 E* side Delta, to the order of the grid.
    square = bem.solve(np.zeros((65, 65)), SIDE, 1.0, modulus=E)
    wide = SIDE * 65 / 64
    assert square.stiffness == pytest.approx(1.1516 * E * wide, rel=0.01)


def test_a_compliant_far_field_has_the_stiffness_of_the_interface():
    heights, step = rough((33, 33)), 1e-6
    near = [
        bem.solve(heights, SIDE, 1.0 + end, modulus=E, far_field="compliant", rtol=1e-12)
        for end in (-step, 0.0, step)
    ]
    slope = (near[2].force - near[0].force) / (2 * step)
    assert near[1].loading_stiffness == near[1].interface_stiffness
    assert near[1].interface_stiffness == pytest.approx(slope, rel=1e-5)


@pytest.mark.parametrize(
    "conductivities",
    [(0.0, 1.0), (1.0, -1.0), (math.inf, math.inf), (1e308, 1e308), (1j, 1.0)],
)
def test_bodies_apart_have_none_and_impossible_conductivities_are_refused(conductivities):
    contact = bem.solve(rough((9, 9)), SIDE, 0.0)
    assert (
        contact.stiffness == contact.interface_stiffness == contact.loading_stiffness == 0
    )
    assert contact.conductance(1.0, 2.0) == contact.spots.number == 0
    with pytest.raises(ValueError, match="conductivities"):
        contact.conductance(*conductivities)


@given(
    seed=st.integers(0, 1000),
    share=st.floats(0.01, 0.99),
    aspect=st.sampled_from([1.0, 2.5]),
)
@settings(max_examples=25, deadline=None)
def test_any_set_has_the_stiffness_of_dense_algebra(seed, share, aspect):
    shape = 11, 14
    rng = np.random.default_rng(seed)
    nodes = np.flatnonzero(rng.random(shape) < share)
    assume(nodes.size < shape[0] * shape[1])  # else infinite without edges
    for boundary in ("free", "periodic", "mirror"):
        problem = pose(
            np.zeros(shape), SIDE, None, force=1.0, spacing=(1.5, 1.5 * aspect), modulus=E,
            boundary=boundary,
        )  # fmt: skip
        if boundary == "free":
            every = np.arange(problem.heights.size)
            matrix = InfluenceMatrix(shape, problem.reduced_body, aspect).between(
                every, every
            )
        else:
            patch = Patch(shape, boundary, HALF_SPACE, aspect)
            units = np.eye(problem.heights.size).reshape(-1, *shape)
            matrix = np.stack(
                [patch.displace(unit, exactly=True).reshape(-1).copy() for unit in units]
            )
        inside = matrix[np.ix_(nodes, nodes)]
        dense = np.linalg.solve(inside, np.ones(nodes.size)).sum() * E * 1.5 * aspect
        punch = punch_of(problem, nodes)
        assert punch.stiffness == pytest.approx(dense, rel=1e-9)
        assert punch.residual <= PUNCH_RTOL


def test_it_costs_nothing_until_it_is_asked_for():
    contact = bem.solve(rough((33, 33)), SIDE, 1.0)
    assert not {"punch", "spots", "loading_stiffness"} & contact.__dict__.keys()
