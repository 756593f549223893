"""Properties on every surface: monotony, symmetry, scaling, superposition, uniqueness.

Solutions are checked in reduced units, spacing 1 um and E* = 1 MPa, on surfaces of height 1 um.
"""

from functools import lru_cache, partial

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import bem
from bem.active_set import ActiveSet
from bem.bodies import KERNELS, REDUCED
from bem.far_field import critical_delta
from bem.iterate import Iterate
from bem.operators.patch import Patch
from bem.problem import FAR_FIELDS
from bench.references import dense
from bench.references.surfaces import SURFACES, surface
from bench.stability.random_contacts import judge_yielding, yielding_problem

pytestmark = pytest.mark.usefixtures("both_ways")

RTOL = 1e-10
UNDECIDED = (
    1e-7  # pressure or gap over Delta below which a node may count as in contact or not
)

kinds = st.sampled_from(list(SURFACES))
seeds = st.integers(0, 2**32 - 1)
shapes = st.tuples(st.integers(1, 20), st.integers(1, 20))
kernels = st.sampled_from(KERNELS)
far_fields = st.sampled_from(FAR_FIELDS)
depths = st.one_of(st.floats(0.001, 1), st.floats(1, 10))

press = partial(bem.solve, side=1.0, spacing=1.0, rtol=RTOL)


def reach(heights, kernel, far_field, depth):
    """Largest Delta of a test: `depth` um, or below what a compliant far field can hold."""
    if far_field == "rigid":
        return depth
    critical = critical_delta(heights, REDUCED[kernel])
    assume(critical > 1e-3)  # surfaces that are flat have no equilibrium
    return min(depth, 0.98 * critical)


def turned(field, turns, transposed):
    return np.rot90(field.T if transposed else field, turns)


@settings(max_examples=80)
@given(
    kinds, seeds, shapes, kernels, far_fields, depths, st.integers(0, 3), st.booleans()
)
def test_symmetries_of_the_square(
    kind, seed, shape, kernel, far_field, depth, turns, transposed
):
    """Of the field itself; nodes with neither pressure nor gap may be either."""
    heights = surface(kind, shape, seed)
    delta = reach(heights, kernel, far_field, depth)
    settings = {"delta": delta, "kernel": kernel, "far_field": far_field}
    contact = press(turned(heights, turns, transposed), **settings)
    still = press(heights, **settings)
    scale = UNDECIDED * still.approach
    expected = turned(still.pressure, turns, transposed)
    np.testing.assert_allclose(contact.pressure, expected, rtol=0, atol=scale)
    decided = (expected > scale) | (turned(still.gap, turns, transposed) > scale)
    np.testing.assert_array_equal(
        (contact.pressure > 0)[decided], (expected > 0)[decided]
    )
    assert contact.force == pytest.approx(still.force, rel=1e-7)


@settings(max_examples=60)
@given(
    kinds,
    seeds,
    shapes,
    kernels,
    depths,
    st.sampled_from([0.0, 1e-3, 1.0, 1e3]),
    st.floats(0, 1),
)
def test_every_start_leads_to_the_same_pressure(
    kind, seed, shape, kernel, depth, scale, loaded
):
    """From no pressure to a thousand times too much, on few nodes or all: there is one solution."""
    heights = surface(kind, shape, seed)
    patch, below = (
        Patch(shape, "free", REDUCED[kernel], 1.0),
        (heights - heights.max()) / depth,
    )
    random = np.random.default_rng(seed)
    iterate = Iterate(patch, below, shift=1.0, rtol=RTOL, max_iterations=5000)
    iterate.begin(scale * random.random(shape) * (random.random(shape) < loaded))
    assert ActiveSet(iterate).run()
    expected, gap = dense.press(heights, depth, kernel)
    np.testing.assert_allclose(iterate.pressure, expected, rtol=0, atol=UNDECIDED)
    decided = (expected > UNDECIDED) | (gap > UNDECIDED)
    np.testing.assert_array_equal(
        (iterate.pressure > 0)[decided], (expected > UNDECIDED)[decided]
    )


ROUGH = surface("self-affine", (24, 33), seed=1)
LEVEL = np.round(ROUGH * 2**20) / 2**20  # to which whole offsets are added exactly


@pytest.mark.parametrize(
    ("material", "height", "size", "offset"),
    [
        ({"modulus": 2.1e5, "poisson": 0.3}, 1.0, 1.0, 0.0),
        ({"modulus": 1e-6, "poisson": -0.5}, 1.0, 1.0, 0.0),
        ({}, 2.0**-7, 1.0, 0.0),
        ({}, 1e5, 1.0, 0.0),
        ({}, 1.0, 1e-6, 0.0),
        ({}, 1.0, 10.0, 0.0),
        ({}, 1.0, 1.0, 4096.0),
    ],
)
def test_force_follows_modulus_heights_and_side_and_the_area_none(
    material, height, size, offset
):
    """Exactly where all numbers only move their points, or differences of heights are the same."""
    delta, sides = 0.4 * float(np.ptp(LEVEL)), (230.0, 320.0)
    unit = bem.solve(LEVEL, sides, delta, rtol=RTOL)
    scaled = tuple(size * side for side in sides)
    contact = bem.solve(
        height * LEVEL + offset, scaled, height * delta, rtol=RTOL, **material
    )
    plane_strain = material.get("modulus", 1.0) / (1 - material.get("poisson", 0.0) ** 2)
    np.testing.assert_array_equal(contact.pressure > 0, unit.pressure > 0)
    force = plane_strain * height * size * unit.force
    assert contact.force == pytest.approx(force, rel=1e-14 if material else 1e-9)
    largest = plane_strain * height / size * unit.largest_pressure
    assert contact.largest_pressure == pytest.approx(largest, rel=1e-9)
    if offset or height == 2.0**-7:
        np.testing.assert_array_equal(contact.pressure, height * unit.pressure)
        np.testing.assert_array_equal(contact.gap, height * unit.gap)


drawn = lru_cache(yielding_problem)  # both ways have the same problems, and one reference


@pytest.mark.few(48)
@pytest.mark.parametrize("seed", range(100))
def test_contact_is_that_of_bounded_least_squares(seed):
    asked = drawn(seed)
    failed = [
        str(finding)
        for finding in judge_yielding(asked, asked.solve())
        if not finding.passed
    ]
    assert not failed
