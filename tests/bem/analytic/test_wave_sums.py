"""Closed forms of sums of waves: consistent with the half-space and with one another."""

import mpmath
import numpy as np
import pytest
from scipy.integrate import quad

import bem
from bem.analytic import DoublySinusoidal, Paraboloid, Sine, SumOfSines, WavySurface
from bem.analytic.waves import SQUARE_LATTICE

MODULUS = 2.5
WAVE = WavySurface(0.3, 40.0)
FULL = WAVE.full_contact_pressure(MODULUS)
CROSSED = DoublySinusoidal(0.3, 40.0)
PLACES = np.linspace(-40, 40, 161)


@pytest.mark.parametrize("value", [0.0, -1.0, np.inf, np.nan])
def test_flat_crossed_surfaces_are_refused(value: float) -> None:
    with pytest.raises(ValueError, match=r"^amplitude = .*: must be above 0 um$"):
        DoublySinusoidal(value, 1.0)
    with pytest.raises(ValueError, match=r"^wavelength = .*: must be above 0 um$"):
        DoublySinusoidal(1.0, value)


def test_one_sine_in_full_contact_is_the_wavy_surface() -> None:
    sine = SumOfSines((Sine(0.3, (2 * np.pi / 40, 0.0)),))
    y = np.zeros(161)
    assert sine.heights(PLACES, y) == pytest.approx(WAVE.heights(PLACES), abs=1e-15)
    assert sine.full_contact_pressure(PLACES, y, MODULUS) == pytest.approx(FULL, rel=1e-14)
    pressure = sine.pressure(PLACES, y, 2 * FULL, MODULUS)
    assert pressure == pytest.approx(WAVE.pressure(PLACES, 2 * FULL, MODULUS), abs=1e-14)


def test_oblique_sines_hold_the_half_space_up_by_their_heights() -> None:
    """By the kernel of line forces along their crests, one sine each direction, to 1e-9."""
    for qx, qy, phase in [(0.3, 0.0, 0.0), (0.2, -0.5, 1.0), (-0.1, 0.7, 4.0)]:
        sine, q = Sine(0.2, (qx, qy), phase), np.hypot(qx, qy)
        pressed = SumOfSines((sine,))

        def strip(along: float, q: float = q, sine: SumOfSines = pressed) -> float:
            x, y = along * np.array(sine.sines[0].wavevector) / q
            pressure = float(sine.pressure(x, y, 0.0, MODULUS))
            return -2 / (np.pi * MODULUS) * pressure * np.log(2 * np.sin(q * along / 2))

        moved = quad(strip, 0, 2 * np.pi / q, epsabs=1e-12, limit=200)[0]
        assert moved == pytest.approx(float(sine.heights(np.array(0.0), np.array(0.0))), abs=1e-9)


def test_the_doubly_sinusoidal_surface_is_two_oblique_sines() -> None:
    q = 2 * np.pi / 40
    sines = SumOfSines((Sine(0.15, (q, q)), Sine(0.15, (q, -q))))
    x, y = np.meshgrid(PLACES[:80:2], PLACES[:80:2], indexing="ij")
    assert sines.heights(x, y) == pytest.approx(CROSSED.heights(x, y), abs=1e-15)
    full = sines.full_contact_pressure(x, y, MODULUS)
    assert CROSSED.full_contact_pressure(MODULUS) == pytest.approx(full, rel=1e-14)


def test_doubly_sinusoidal_contact_at_light_load_is_hertz_at_every_peak() -> None:
    load, cell = 1e-9 * CROSSED.full_contact_pressure(MODULUS), 40.0**2 / 2
    sphere = Paraboloid(1 / (0.3 * (2 * np.pi / 40) ** 2))
    delta = (load * cell / sphere.force(1.0, MODULUS)) ** (2 / 3)
    share = np.pi * sphere.contact_radius(delta) ** 2 / cell
    assert CROSSED.area_share_at_light_load(load, MODULUS) == pytest.approx(share, rel=1e-12)
    assert CROSSED.approach_at_light_load(load, MODULUS) == pytest.approx(delta, rel=3e-3)


def test_potential_of_the_square_lattice() -> None:
    """By the Hurwitz zeta functions of Riemann's and Dirichlet's series, and by Fourier series."""
    dirichlet = (mpmath.zeta(0.5, 0.25) - mpmath.zeta(0.5, 0.75)) / 2
    assert float(4 * mpmath.zeta(0.5) * dirichlet) == pytest.approx(SQUARE_LATTICE, rel=1e-15)


def test_doubly_sinusoidal_peaks_move_by_the_approach_at_light_load() -> None:
    """The displacement of peaks under Hertz's pressure on the lattice, by Fourier series.

    In units of the lattice's spacing, the force on a peak and E*: sum of 2 p(q) / |q| with p(q) =
    3 (sin s - s cos s) / s^3, s = |q| a. To 1e-4: discs are not quite points for each other.
    """
    radius = 0.05
    integers = np.arange(-800, 1501)
    q = 2 * np.pi * np.hypot(integers[:, None], integers[None, :])
    q[800, 800] = np.inf
    s = np.minimum(q, 1e9) * radius
    moved = float((2 / q * 3 * (np.sin(s) - s * np.cos(s)) / s**3).sum())
    load = 8 * np.pi / 3 * radius**3  # p / p*, by the area share of light load
    spacing = 40 / np.sqrt(2)
    pressure = load * CROSSED.full_contact_pressure(MODULUS)
    assert CROSSED.area_share_at_light_load(pressure, MODULUS) == pytest.approx(np.pi * radius**2)
    unit = pressure * spacing / MODULUS
    approach = CROSSED.approach_at_light_load(pressure, MODULUS) / unit
    assert approach == pytest.approx(moved, rel=1e-4)


def test_doubly_sinusoidal_gaps_near_full_contact_close_without_singularity() -> None:
    """The traction that a crack relieves, by quadrature (Sneddon's integrals), to 1e-8."""
    full = CROSSED.full_contact_pressure(MODULUS)
    pressure = full * (1 - 1e-4)
    share = CROSSED.area_share_near_full_contact(pressure, MODULUS)
    edge = np.sqrt((1 - share) * 40**2 / (2 * np.pi))
    rise = 2 * (np.pi / 40) ** 2 * full

    def relieved(s: float) -> float:
        """Return the integral of t traction(t) / sqrt(s^2 - t^2) from 0 to s, t = s sin u."""
        return quad(
            lambda u: s * np.sin(u) * (full - pressure - rise * (s * np.sin(u)) ** 2), 0, np.pi / 2
        )[0]

    def gap(r: float) -> float:
        """Return the opening, s = sqrt(r^2 + v^2)."""
        reach = np.sqrt(edge**2 - r**2)
        work = quad(lambda v: relieved(np.hypot(r, v)) / np.hypot(r, v), 0, reach)[0]
        return 4 / (np.pi * MODULUS) * work

    assert relieved(edge) == pytest.approx(0, abs=1e-8 * relieved(edge / 2))
    volume = quad(lambda r: 2 * np.pi * r * gap(r), 0, edge, epsabs=0, epsrel=1e-8)[0]
    mean = 2 * volume / 40**2
    assert CROSSED.mean_gap_near_full_contact(pressure, MODULUS) == pytest.approx(mean, rel=1e-8)
    assert CROSSED.area_share_near_full_contact(full, MODULUS) == 1
    assert CROSSED.mean_gap_near_full_contact(full, MODULUS) == 0


def crossed(load: float) -> bem.Contact:
    """Return the solved contact of the doubly sinusoidal surface at a share of p*."""
    x = np.arange(192) * 40 / 192
    heights = CROSSED.heights(x[:, None], x[None, :])
    pressure = load * CROSSED.full_contact_pressure(MODULUS)
    return bem.solve(heights, (40.0, 40.0), pressure=pressure, boundary="periodic", modulus=MODULUS)


def test_solved_crossed_waves_are_hertz_at_light_load() -> None:
    """At 1 % of p*: Delta to 1 %; the area to 7 %, as a grid counts it too large."""
    load = 0.01 * CROSSED.full_contact_pressure(MODULUS)
    contact = crossed(0.01)
    assert contact.delta == pytest.approx(CROSSED.approach_at_light_load(load, MODULUS), rel=0.01)
    share = CROSSED.area_share_at_light_load(load, MODULUS)
    assert contact.area_percent / 100 == pytest.approx(share, rel=0.07)


def test_solved_crossed_waves_close_as_cracks_do() -> None:
    """At 95 and 98 % of p*: the area to 0.1 % of the whole, the mean gap to 5 %."""
    for part in (0.95, 0.98):
        load, contact = part * CROSSED.full_contact_pressure(MODULUS), crossed(part)
        share = CROSSED.area_share_near_full_contact(load, MODULUS)
        assert contact.area_percent / 100 == pytest.approx(share, abs=1e-3)
        gap = CROSSED.mean_gap_near_full_contact(load, MODULUS)
        assert contact.mean_gap == pytest.approx(gap, rel=0.05)


def test_solved_sums_of_sines_in_full_contact_are_exact() -> None:
    """Pressures to 1e-12 of their mean, on a grid that is neither square nor even."""
    waves = [(0.2, 1, 0, 0.3), (0.1, -2, 3, 1.0), (0.05, 4, 5, 2.0)]
    q = 2 * np.pi / 40
    sines = SumOfSines(tuple(Sine(a, (q * kx, q * ky), phase) for a, kx, ky, phase in waves))
    x, y = np.arange(45)[:, None] * 40 / 45, np.arange(64)[None, :] * 40 / 64
    mean = 1.001 * sines.full_contact_pressure(x, y, MODULUS)
    contact = bem.solve(
        sines.heights(x, y), (40.0, 40.0), pressure=mean, boundary="periodic", modulus=MODULUS
    )
    exact = sines.pressure(x, y, mean, MODULUS)
    assert contact.pressure == pytest.approx(exact, abs=1e-12 * mean)
