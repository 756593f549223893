"""Closed forms of waves along one axis: consistent with the half-space and with one another."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad

import bem
from bem.analytic import WavySurface

MODULUS = 2.5
WAVE = WavySurface(0.3, 40.0)
FULL = WAVE.full_contact_pressure(MODULUS)
LOADS = [1e-3, 0.1, 0.5, 0.9, 0.999]
PLACES = np.linspace(-40, 40, 161)


def displacement(x: float, mean_pressure: float) -> float:
    """Of the half-space, with zero mean, by the kernel -2 / (pi E*) ln |2 sin(pi x / wavelength)|.

    The kernel is the displacement under a row of line forces of 1 uN/um, one each wavelength.
    """

    def strip(place: float) -> float:
        pressure = float(WAVE.pressure(np.array(place), mean_pressure, MODULUS))
        return -pressure * np.log(2 * abs(np.sin(np.pi * (x - place) / 40))) if place != x else 0.0

    half = WAVE.contact_width(mean_pressure, MODULUS) / 2
    ends = sorted({-half, min(max(x, -half), half), half})
    parts = [quad(strip, *pair, limit=200, epsrel=1e-9)[0] for pair in pairwise(ends)]
    return 2 / (np.pi * MODULUS) * sum(parts)


@pytest.mark.parametrize("load", LOADS)
def test_wavy_pressure_makes_the_half_space_fit_the_surface(load: float) -> None:
    """Displacement - (height - highest + Delta) is the gap; 1e-7 of the amplitude is quadrature."""
    approach = WAVE.approach(load * FULL, MODULUS)
    half = WAVE.contact_width(load * FULL, MODULUS) / 2
    for x in [0.0, 0.4 * half, 0.95 * half, half + 0.3 * (20 - half), 20.0]:
        pressed = float(WAVE.heights(np.array(x))) - 0.3 + approach
        gap = float(WAVE.gap(np.array(x), load * FULL, MODULUS))
        assert displacement(x, load * FULL) - pressed == pytest.approx(gap, abs=3e-8)
        assert (gap > 0) == (abs(x) > half)


@pytest.mark.parametrize("load", LOADS)
def test_wavy_pressure_and_gap_have_their_means(load: float) -> None:
    """By quadrature over half a wavelength, to 1e-8."""
    half = WAVE.contact_width(load * FULL, MODULUS) / 2
    carried = quad(lambda x: float(WAVE.pressure(np.array(x), load * FULL, MODULUS)), 0, half)[0]
    opened = quad(lambda x: float(WAVE.gap(np.array(x), load * FULL, MODULUS)), half, 20)[0]
    assert carried / 20 == pytest.approx(load * FULL, rel=1e-8)
    assert opened / 20 == pytest.approx(WAVE.mean_gap(load * FULL, MODULUS), rel=1e-7)
    assert WAVE.area_share(load * FULL, MODULUS) == pytest.approx(half / 20, rel=1e-14)
    assert np.sin(np.pi * half / 40) ** 2 == pytest.approx(load, rel=1e-12)


@pytest.mark.parametrize("load", LOADS)
def test_wavy_stiffness_and_inverse_follow_from_the_approach(load: float) -> None:
    """The stiffness by central differences, to 1e-6; the inverse to 1e-10, less near its branch."""
    pressure, step = load * FULL, 1e-5 * load * FULL
    rise = WAVE.approach(pressure + step, MODULUS) - WAVE.approach(pressure - step, MODULUS)
    assert WAVE.stiffness(pressure, MODULUS) == pytest.approx(2 * step / rise, rel=1e-6)
    again = WAVE.mean_pressure(WAVE.approach(pressure, MODULUS), MODULUS)
    assert again == pytest.approx(pressure, rel=1e-10)


def test_wavy_contact_at_light_load_is_that_of_a_cylinder() -> None:
    """Half-width sqrt(4 P R / (pi E*)) of a cylinder of the peaks' radius R."""
    radius, load = (40 / (2 * np.pi)) ** 2 / 0.3, 1e-6
    half = np.sqrt(4 * load * FULL * 40 * radius / (np.pi * MODULUS))
    assert WAVE.contact_width(load * FULL, MODULUS) / 2 == pytest.approx(half, rel=1e-6)
    peak = 2 * load * FULL * 40 / (np.pi * half)
    assert WAVE.pressure(np.array(0.0), load * FULL, MODULUS) == pytest.approx(peak, rel=1e-6)


def test_wavy_contact_ends_at_full_contact() -> None:
    assert pytest.approx(np.pi * MODULUS * 0.3 / 40, rel=1e-15) == FULL
    for pressure in (FULL, 2 * FULL):
        expected = pressure + FULL * np.cos(2 * np.pi * PLACES / 40)
        assert WAVE.pressure(PLACES, pressure, MODULUS) == pytest.approx(expected, abs=1e-14)
        assert WAVE.contact_width(pressure, MODULUS) == pytest.approx(40, rel=1e-15)
        assert WAVE.approach(pressure, MODULUS) == 0.3
        assert WAVE.mean_gap(pressure, MODULUS) == 0
        assert WAVE.stiffness(pressure, MODULUS) == np.inf
        assert WAVE.gap(PLACES, pressure, MODULUS) == pytest.approx(np.zeros(161), abs=1e-15)
    below = WAVE.pressure(PLACES, FULL * (1 - 1e-15), MODULUS)
    assert below == pytest.approx(WAVE.pressure(PLACES, FULL, MODULUS), abs=1e-14)


@pytest.mark.parametrize("pressure", [0.0, -1.0])
def test_wavy_surfaces_without_load_touch_at_their_peaks(pressure: float) -> None:
    assert WAVE.contact_width(pressure) == WAVE.approach(pressure) == WAVE.stiffness(pressure) == 0
    assert not WAVE.pressure(PLACES, pressure).any()
    assert WAVE.gap(PLACES, pressure) == pytest.approx(0.3 - WAVE.heights(PLACES), abs=1e-15)
    assert WAVE.mean_pressure(pressure) == 0


@pytest.mark.parametrize("approach", [0.3, 1.0, np.nan])
def test_full_contact_has_no_single_mean_pressure(approach: float) -> None:
    with pytest.raises(ValueError, match=r"^approach = .*: must be below 0.3 um$"):
        WAVE.mean_pressure(approach)


@pytest.mark.parametrize("value", [0.0, -1.0, np.inf, np.nan])
def test_flat_surfaces_are_refused(value: float) -> None:
    with pytest.raises(ValueError, match=r"^amplitude = .*: must be above 0 um$"):
        WavySurface(value, 1.0)
    with pytest.raises(ValueError, match=r"^wavelength = .*: must be above 0 um$"):
        WavySurface(1.0, value)


def pressed(surface: np.ndarray, pressure: float) -> bem.Contact:
    """Return the contact of one period of a surface, (n, m), with cells of 40 / n um."""
    nodes = surface.shape
    side = (40.0, 40.0 * nodes[1] / nodes[0])
    return bem.solve(surface, side, pressure=pressure, boundary="periodic", modulus=MODULUS)


@pytest.mark.parametrize("load", [0.01, 0.1, 0.3, 0.7, 0.95, 1.0, 1.7])
@pytest.mark.parametrize("nodes", [255, 256])
def test_solved_waves_are_the_closed_form(load: float, nodes: int) -> None:
    """The width to a cell on both sides, Delta to 1 % of it, pressures to 6 % of p*.

    Pressures are off most at the ends of contact, where their slope is infinite.
    """
    x = np.arange(nodes) * 40 / nodes
    contact = pressed(np.repeat(WAVE.heights(x)[:, None], 2, axis=1), load * FULL)
    width = 40 * contact.area_percent / 100
    assert width == pytest.approx(WAVE.contact_width(load * FULL, MODULUS), abs=2 * 40 / nodes)
    assert contact.delta == pytest.approx(WAVE.approach(load * FULL, MODULUS), rel=0.01)
    exact = WAVE.pressure(x, load * FULL, MODULUS)
    assert contact.pressure[:, 0] == pytest.approx(exact, abs=0.06 * FULL)
    if load >= 1:
        assert contact.pressure[:, 1] == pytest.approx(exact, abs=1e-12 * FULL)
        assert contact.area_percent == 100
