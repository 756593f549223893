"""Closed forms of waves and of their sums: consistent with the half-space and with one another."""

import numpy as np
import pytest
from scipy.integrate import quad

import bem
from bem.analytic import DoublySinusoidal, Paraboloid, WavySurface

MODULUS = 2.5
WAVE = WavySurface(0.3, 40.0)
FULL = WAVE.full_contact_pressure(MODULUS)
LOADS = [1e-3, 0.1, 0.5, 0.9, 0.999]
PLACES = np.linspace(-40, 40, 161)


@pytest.mark.parametrize("load", LOADS)
def test_wavy_pressure_and_gap_have_their_means(load):
    """By quadrature over half a wavelength, to 1e-8."""
    half = WAVE.wavelength * WAVE.area_share(load * FULL, MODULUS) / 2
    carried = quad(
        lambda x: float(WAVE.pressure(np.array(x), load * FULL, MODULUS)), 0, half
    )[0]
    opened = quad(lambda x: float(WAVE.gap(np.array(x), load * FULL, MODULUS)), half, 20)[
        0
    ]
    assert carried / 20 == pytest.approx(load * FULL, rel=1e-8)
    assert opened / 20 == pytest.approx(WAVE.mean_gap(load * FULL, MODULUS), rel=1e-7)
    assert WAVE.area_share(load * FULL, MODULUS) == pytest.approx(half / 20, rel=1e-14)
    assert np.sin(np.pi * half / 40) ** 2 == pytest.approx(load, rel=1e-12)


@pytest.mark.parametrize("load", LOADS)
def test_wavy_stiffness_and_inverse_follow_from_the_approach(load):
    """The stiffness by central differences, to 1e-6; the inverse to 1e-10, less near its branch."""
    pressure, step = load * FULL, 1e-5 * load * FULL
    rise = WAVE.approach(pressure + step, MODULUS) - WAVE.approach(
        pressure - step, MODULUS
    )
    assert WAVE.stiffness(pressure, MODULUS) == pytest.approx(2 * step / rise, rel=1e-6)
    again = WAVE.mean_pressure(WAVE.approach(pressure, MODULUS), MODULUS)
    assert again == pytest.approx(pressure, rel=1e-10)


def test_wavy_contact_ends_at_full_contact():
    assert pytest.approx(np.pi * MODULUS * 0.3 / 40, rel=1e-15) == FULL
    for pressure in (FULL, 2 * FULL):
        expected = pressure + FULL * np.cos(2 * np.pi * PLACES / 40)
        assert WAVE.pressure(PLACES, pressure, MODULUS) == pytest.approx(
            expected, abs=1e-14
        )
        assert WAVE.area_share(pressure, MODULUS) == pytest.approx(1, rel=1e-15)
        assert WAVE.approach(pressure, MODULUS) == 0.3
        assert WAVE.mean_gap(pressure, MODULUS) == 0
        assert WAVE.stiffness(pressure, MODULUS) == np.inf
        assert WAVE.gap(PLACES, pressure, MODULUS) == pytest.approx(
            np.zeros(161), abs=1e-15
        )
    below = WAVE.pressure(PLACES, FULL * (1 - 1e-15), MODULUS)
    assert below == pytest.approx(WAVE.pressure(PLACES, FULL, MODULUS), abs=1e-14)


@pytest.mark.parametrize("value", [0.0, -1.0, np.nan])
def test_flat_surfaces_are_refused(value):
    for kind in (WavySurface, DoublySinusoidal):
        with pytest.raises(ValueError, match=r"^amplitude = .*: must be above 0 um$"):
            kind(value, 1.0)
        with pytest.raises(ValueError, match=r"^wavelength = .*: must be above 0 um$"):
            kind(1.0, value)
    with pytest.raises(ValueError, match=r"^approach = .*: must be below 0.3 um$"):
        WAVE.mean_pressure(0.3)


def pressed(surface, pressure):
    """Return the contact of one period of a surface, (n, m), with cells of 40 / n um."""
    nodes = surface.shape
    side = (40.0, 40.0 * nodes[1] / nodes[0])
    return bem.solve(
        surface, side, pressure=pressure, boundary="periodic", modulus=MODULUS
    )


@pytest.mark.parametrize("load", [0.01, 0.3, 0.95, 1.7])
@pytest.mark.parametrize("nodes", [255, 256])
def test_solved_waves_are_the_closed_form(load, nodes):
    """The width to a cell on both sides, Delta to 1 % of it, pressures to 6 % of p*.

    Pressures are off most at the ends of contact, where their slope is infinite.
    """
    x = np.arange(nodes) * 40 / nodes
    contact = pressed(np.repeat(WAVE.heights(x)[:, None], 2, axis=1), load * FULL)
    width = 40 * contact.area_percent / 100
    assert width == pytest.approx(
        WAVE.wavelength * WAVE.area_share(load * FULL, MODULUS), abs=2 * 40 / nodes
    )
    assert contact.delta == pytest.approx(WAVE.approach(load * FULL, MODULUS), rel=0.01)
    exact = WAVE.pressure(x, load * FULL, MODULUS)
    assert contact.pressure[:, 0] == pytest.approx(exact, abs=0.06 * FULL)
    if load >= 1:
        assert contact.pressure[:, 1] == pytest.approx(exact, abs=1e-12 * FULL)
        assert contact.area_percent == 100


CROSSED = DoublySinusoidal(0.3, 40.0)


def test_doubly_sinusoidal_contact_at_light_load_is_hertz_at_every_peak():
    load, cell = 1e-9 * CROSSED.full_contact_pressure(MODULUS), 40.0**2 / 2
    sphere = Paraboloid(1 / (0.3 * (2 * np.pi / 40) ** 2))
    delta = (load * cell / sphere.force(1.0, MODULUS)) ** (2 / 3)
    share = np.pi * sphere.contact_radius(delta) ** 2 / cell
    assert CROSSED.area_share_at_light_load(load, MODULUS) == pytest.approx(
        share, rel=1e-12
    )
    assert CROSSED.approach_at_light_load(load, MODULUS) == pytest.approx(delta, rel=3e-3)


def crossed(load):
    """Return the solved contact of the doubly sinusoidal surface at a share of p*."""
    x = np.arange(192) * 40 / 192
    heights = CROSSED.heights(x[:, None], x[None, :])
    pressure = load * CROSSED.full_contact_pressure(MODULUS)
    return bem.solve(
        heights, (40.0, 40.0), pressure=pressure, boundary="periodic", modulus=MODULUS
    )


def test_solved_crossed_waves_are_hertz_at_light_load():
    """At 1 % of p*: Delta to 1 %; the area to 7 %, as a grid counts it too large."""
    load = 0.01 * CROSSED.full_contact_pressure(MODULUS)
    contact = crossed(0.01)
    assert contact.delta == pytest.approx(
        CROSSED.approach_at_light_load(load, MODULUS), rel=0.01
    )
    share = CROSSED.area_share_at_light_load(load, MODULUS)
    assert contact.area_percent / 100 == pytest.approx(share, rel=0.07)


def test_solved_crossed_waves_close_as_cracks_do():
    """At 95 and 98 % of p*: the area to 0.1 % of the whole, the mean gap to 5 %."""
    for part in (0.95, 0.98):
        load, contact = part * CROSSED.full_contact_pressure(MODULUS), crossed(part)
        share = CROSSED.area_share_near_full_contact(load, MODULUS)
        assert contact.area_percent / 100 == pytest.approx(share, abs=1e-3)
        gap = CROSSED.mean_gap_near_full_contact(load, MODULUS)
        assert contact.mean_gap == pytest.approx(gap, rel=0.05)


def test_solved_sums_of_sines_in_full_contact_are_exact():
    """Each adds E* q / 2 times its height; to 1e-12, on a grid neither square nor even."""
    x, y = np.arange(45)[:, None] * 40 / 45, np.arange(64)[None, :] * 40 / 64
    heights, exact = np.zeros((45, 64)), np.zeros((45, 64))
    for amplitude, along, across, phase in (
        (0.2, 1, 0, 0.3),
        (0.1, -2, 3, 1.0),
        (0.05, 4, 5, 2.0),
    ):
        qx, qy = 2 * np.pi / 40 * along, 2 * np.pi / 40 * across
        sine = amplitude * np.cos(qx * x + qy * y + phase)
        heights += sine
        exact += MODULUS * np.hypot(qx, qy) / 2 * sine
    mean = -1.001 * float(exact.min())
    contact = bem.solve(
        heights, (40.0, 40.0), pressure=mean, boundary="periodic", modulus=MODULUS
    )
    assert contact.pressure == pytest.approx(mean + exact, abs=1e-12 * mean)
