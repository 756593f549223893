"""The symmetries and scalings of the contact problem."""

import numpy as np
import pytest

import bem
from bem.influence import Kernel
from bench.references.surfaces import surface

pytestmark = pytest.mark.usefixtures("both_ways")

KERNELS: list[Kernel] = ["uniform-pressure", "concentrated-force"]
RTOL = 1e-10


ROUGH = surface("self-affine", (24, 33), seed=1)


DELTA = 0.4 * np.ptp(ROUGH)


SIDE = (230.0, 320.0)


def solved(
    heights: np.ndarray = ROUGH,
    side: tuple[float, float] = SIDE,
    delta: float = DELTA,
    **settings: float,
) -> bem.Contact:
    return bem.solve(heights, side, delta, rtol=RTOL, **settings)


@pytest.mark.parametrize("modulus", [1e-6, 3.0, 2.1e5])
@pytest.mark.parametrize("poisson", [-0.5, 0.0, 0.3, 0.5])
def test_area_ignores_the_material_and_force_follows_it(modulus: float, poisson: float) -> None:
    contact, unit = solved(modulus=modulus, poisson=poisson), solved()
    plane_strain = modulus / (1 - poisson**2)
    np.testing.assert_array_equal(contact.pressure > 0, unit.pressure > 0)
    assert contact.area_percent == unit.area_percent
    assert contact.force == pytest.approx(plane_strain * unit.force, rel=1e-14)
    assert contact.pressure == pytest.approx(plane_strain * unit.pressure, rel=1e-14)
    assert contact.gap == pytest.approx(unit.gap, rel=0, abs=1e-14 * DELTA)


@pytest.mark.parametrize("scale", [2.0**-7, 1e-3, 3.0, 1e5])
def test_taller_asperities_scale_force_and_leave_area(scale: float) -> None:
    contact = solved(heights=scale * ROUGH, delta=scale * DELTA)
    unit = solved()
    np.testing.assert_array_equal(contact.pressure > 0, unit.pressure > 0)
    assert contact.force == pytest.approx(scale * unit.force, rel=1e-9)
    if scale == 2.0**-7:  # exact: every step is the same to the last bit
        np.testing.assert_array_equal(contact.pressure, scale * unit.pressure)


@pytest.mark.parametrize("scale", [1e-6, 1 / 3, 10.0, 1e6])
def test_force_scales_with_the_side(scale: float) -> None:
    """Heights stay: pressure falls with the slopes, the area that carries it grows twice."""
    contact = solved(side=(scale * SIDE[0], scale * SIDE[1]))
    np.testing.assert_array_equal(contact.pressure > 0, solved().pressure > 0)
    assert contact.force == pytest.approx(scale * solved().force, rel=1e-9)
    assert contact.largest_pressure == pytest.approx(solved().largest_pressure / scale, rel=1e-9)


@pytest.mark.parametrize("offset", [-3.0, 1.0, 4096.0])
def test_only_differences_of_height_matter(offset: float) -> None:
    heights = np.round(ROUGH * 2**20) / 2**20  # so that adding the offset is exact
    contact, level = solved(heights=heights + offset), solved(heights=heights)
    np.testing.assert_array_equal(contact.pressure, level.pressure)
    np.testing.assert_array_equal(contact.gap, level.gap)


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("transposed", [False, True])
@pytest.mark.parametrize("turns", [0, 1, 2, 3])
def test_the_8_symmetries_of_the_square(turns: int, transposed: bool, kernel: Kernel) -> None:
    def turned(field: np.ndarray) -> np.ndarray:
        return np.rot90(field.T if transposed else field, turns)

    heights = surface("self-affine", (26, 26))
    delta = 0.3 * np.ptp(heights)
    contact = bem.solve(turned(heights), 1.0, delta, kernel=kernel, rtol=RTOL)
    still = bem.solve(heights, 1.0, delta, kernel=kernel, rtol=RTOL)
    np.testing.assert_array_equal(contact.pressure > 0, turned(still.pressure > 0))
    assert contact.force == pytest.approx(still.force, rel=1e-8)
    assert contact.perimeter == pytest.approx(still.perimeter, rel=1e-14)


def test_turning_a_patch_turns_its_sides() -> None:
    contact = solved(heights=ROUGH.T, side=SIDE[::-1])
    np.testing.assert_array_equal(contact.pressure.T > 0, solved().pressure > 0)
    assert contact.force == pytest.approx(solved().force, rel=1e-8)


@pytest.mark.parametrize("kernel", KERNELS)
def test_two_far_spikes_carry_twice_the_load_of_one(kernel: Kernel) -> None:
    """Less a share for the displacement 1 / (pi r) by unit force on the other spike."""
    one = np.zeros((9, 257))
    one[4, 4] = 100.0
    two = one.copy()
    two[4, -5] = 100.0
    alone, both = (
        bem.solve(z, 1.0, 1.0, spacing=1.0, kernel=kernel, rtol=RTOL) for z in (one, two)
    )
    assert (alone.contact_nodes, both.contact_nodes) == (1, 2)
    compliance = 1 / alone.force
    assert both.force == pytest.approx(2 / (compliance + 1 / (np.pi * 248)), rel=1e-6)
