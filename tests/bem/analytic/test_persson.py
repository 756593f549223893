"""Laws of random surfaces: the integrals that they come from, and their limits."""

import numpy as np
import pytest
from scipy.integrate import dblquad, quad
from scipy.special import erf

from bem.analytic import BUSH_GIBSON_THOMAS, PERSSON, PerssonInterface, area_share

MODULUS = 2.5
HURST = 0.8
LONGEST, SHORTEST = 0.2, 12.8  # 1/um
REDUCED = np.array([1e-3, 0.05, 0.3, 1.0, 3.0])


def power_law(q):
    return 1e-4 * q ** (-2 - 2 * HURST)


def interface(gamma):
    q = np.geomspace(LONGEST, SHORTEST, 4000)
    return PerssonInterface(q, power_law(q), gamma)


SLOPE = interface(1.0).rms_slope()
PRESSURE = MODULUS * SLOPE * np.array([1e-3, 0.03, 0.2, 0.7])


def test_named_forms_of_the_area():
    assert area_share(REDUCED) == pytest.approx(erf(np.sqrt(2) * REDUCED), rel=1e-14)
    assert area_share(REDUCED, 2.0) == pytest.approx(
        erf(np.sqrt(np.pi) * REDUCED), rel=1e-14
    )
    assert area_share(np.array([0.0, 10.0])).tolist() == [0.0, 1.0]
    assert pytest.approx(1.5957691216) == PERSSON
    assert pytest.approx(2.5066282746) == BUSH_GIBSON_THOMAS


def test_moments_of_the_spectrum():
    """By quadrature; the trapezoidal rule of 4,000 wavenumbers has an error below 1e-5."""
    height = quad(lambda q: 2 * np.pi * q * power_law(q), LONGEST, SHORTEST)[0]
    slope = quad(lambda q: 2 * np.pi * q**3 * power_law(q), LONGEST, SHORTEST)[0]
    assert interface(1.0).rms_height() == pytest.approx(np.sqrt(height), rel=1e-5)
    assert pytest.approx(np.sqrt(slope), rel=1e-5) == SLOPE


@pytest.mark.parametrize("gamma", [1.0, 0.45])
def test_mean_gap_is_perssons_double_integral(gamma):
    """sqrt(pi) q^2 C w / p' (gamma + 3 (1 - gamma) P^2) exp(-(w p' / E*)^2), over q and p'; 1e-4.

    w(q) = (pi times the integral of q^3 C up to q)^(-1/2).
    """

    def rate(pressure, log_q):
        q, power = np.exp(log_q), 2 - 2 * HURST
        squared = np.pi * 1e-4 * (q**power - LONGEST**power) / power
        x = pressure / (MODULUS * np.sqrt(squared))
        shape = gamma + 3 * (1 - gamma) * erf(x) ** 2
        weight = np.sqrt(np.pi) * q**3 * power_law(q) / np.sqrt(squared)
        return weight / pressure * shape * np.exp(-(x**2))

    for pressure in PRESSURE[1:]:
        (computed,) = interface(gamma).mean_gap(np.array([pressure]), MODULUS)
        ends = np.log(LONGEST * (1 + 1e-12)), np.log(SHORTEST)
        expected = dblquad(rate, *ends, pressure, 6 * MODULUS * SLOPE, epsrel=1e-5)[0]
        assert computed == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("gamma", [1.0, 0.45])
def test_stiffness_is_the_slope_of_the_mean_gap(gamma):
    """By central differences, to 1e-6."""
    theory, step = interface(gamma), 1e-4
    fall = theory.mean_gap(PRESSURE * (1 - step), MODULUS)
    fall -= theory.mean_gap(PRESSURE * (1 + step), MODULUS)
    slope = 2 * step * PRESSURE / fall
    assert theory.stiffness(PRESSURE, MODULUS) == pytest.approx(slope, rel=1e-6)


@pytest.mark.parametrize("gamma", [1.0, 0.45])
def test_stiffness_at_light_load_is_the_pressure_over_a_length(gamma):
    """The length is about the rms height, and rises with gamma."""
    theory = interface(gamma)
    length = theory.light_load_length()
    pressure = MODULUS * SLOPE * np.array([1e-7, 2e-7])
    assert pressure / theory.stiffness(pressure, MODULUS) == pytest.approx(
        length, rel=1e-3
    )
    fall = -np.diff(theory.mean_gap(pressure, MODULUS))
    assert fall == pytest.approx(length * np.log(2), rel=1e-3)
    assert 0.3 * gamma < length / theory.rms_height() < 2 * gamma
