"""Closed forms of axisymmetric indenters: consistent with the theory and with one another."""

import numpy as np
import pytest
from scipy.integrate import quad

from bem.analytic import (
    Cone,
    FlatPunch,
    Paraboloid,
    PerssonInterface,
    PowerLaw,
    WavySurface,
    area_share,
    distances_to_centre,
)

SPHERE = Paraboloid(5000.0)
SNEDDON = [
    SPHERE,
    Cone(0.3),
    PowerLaw(0.1, 1.05),
    PowerLaw(0.02, 1.5),
    PowerLaw(1e-4, 2.7),
    PowerLaw(1e-9, 4.0),
    PowerLaw(1e-20, 12.5),
]
INDENTERS = [*SNEDDON, FlatPunch(40.0)]
MODULUS = 2.5


def angle_integral(indenter, delta, power):
    """Integral of p r^power dr over the contact, r = a sin t to tame the ends."""
    radius = indenter.contact_radius(delta)

    def integrand(angle):
        r = radius * np.sin(angle)
        pressure = float(indenter.pressure(np.array(r), delta, MODULUS))
        return pressure * r**power * radius * np.cos(angle)

    return quad(integrand, 0, np.pi / 2, epsabs=0, epsrel=1e-10)[0]


@pytest.mark.parametrize("delta", [0.01, 1.0, 30.0])
@pytest.mark.parametrize("indenter", INDENTERS, ids=repr)
def test_pressure_carries_the_force(indenter, delta):
    carried = 2 * np.pi * angle_integral(indenter, delta, power=1)
    assert carried == pytest.approx(indenter.force(delta, MODULUS), rel=1e-8)


def abel_transform(indenter, x):
    """g(x) = x times the integral of f'(r) / sqrt(x^2 - r^2) from 0 to x, r = x sin t; f = -z."""

    def steepness(r):
        below, above = indenter.heights(
            np.array([r * (1 - 1e-6), r * (1 + 1e-6)])
        ).tolist()
        return float((below - above) / (2e-6 * r)) if r else 0.0

    return (
        x
        * quad(lambda angle: steepness(x * np.sin(angle)), 0, np.pi / 2, epsrel=1e-10)[0]
    )


@pytest.mark.parametrize("delta", [0.01, 30.0])
@pytest.mark.parametrize("indenter", SNEDDON, ids=repr)
def test_force_and_radius_follow_from_the_profile_by_quadrature(indenter, delta):
    """g(a) = Delta, and F = 2 E* times the integral of Delta - g from 0 to a (Sneddon 1965)."""
    radius = indenter.contact_radius(delta)
    assert indenter.indentation(radius) == pytest.approx(delta, rel=1e-13)
    assert abel_transform(indenter, radius) == pytest.approx(delta, rel=1e-8)
    lost = quad(lambda x: abel_transform(indenter, x), 0, radius, epsrel=1e-8, epsabs=0)[
        0
    ]
    force = 2 * MODULUS * (radius * delta - lost)
    assert indenter.force(delta, MODULUS) == pytest.approx(force, rel=1e-7)


RADII = np.linspace(0.05, 60, 23)


@pytest.mark.parametrize("delta", [0.0, -1.0])
@pytest.mark.parametrize("indenter", INDENTERS, ids=repr)
def test_nothing_is_carried_without_indentation(indenter, delta):
    assert indenter.contact_radius(delta) == indenter.force(delta) == 0
    assert not indenter.pressure(RADII, delta).any()


@pytest.mark.parametrize(
    ("coefficient", "exponent", "told"),
    [
        (0.0, 2.0, r"^coefficient = .*: must be above 0"),
        (np.nan, 2.0, r"^coefficient = .*: must be above 0"),
        (1.0, 0.99, r"^exponent = .*: must be at least 1$"),
        (1.0, np.nan, r"^exponent = .*: must be at least 1$"),
    ],
)
def test_profiles_that_do_not_fall_are_refused(coefficient, exponent, told):
    with pytest.raises(ValueError, match=told):
        PowerLaw(coefficient, exponent)


def test_distances_from_the_centre_of_a_patch():
    distance = distances_to_centre((3, 5), (6.0, 16.0))
    assert distance.shape == (3, 5)
    assert distance[1, 2] == 0
    assert distance[0, 0] == pytest.approx(np.hypot(3, 8))
    assert distance[1].tolist() == [8.0, 4.0, 0.0, 4.0, 8.0]


def test_distances_from_an_axis_that_is_shifted():
    distance = distances_to_centre((3, 5), (6.0, 16.0), shift=(3.0, -4.0))
    assert distance[2, 1] == 0
    assert distance[0, 4] == pytest.approx(np.hypot(6, 12))


def test_the_centre_of_an_even_grid_is_between_its_nodes():
    distance = distances_to_centre((2, 4), 6.0)
    assert distance[:, 1:3] == pytest.approx(np.full((2, 2), np.hypot(3, 1)))


@pytest.mark.parametrize("side", [(1000.0,), (1.0, 2.0, 3.0), ()])
def test_sides_that_are_neither_one_nor_two_are_refused(side):
    with pytest.raises(ValueError, match="one length or two"):
        distances_to_centre((9, 9), side)


WAVES = np.geomspace(1.0, 100.0, 50)
PERSSON = PerssonInterface(WAVES, WAVES**-3.6)


@pytest.mark.parametrize(
    "formula",
    [Cone(0.3).heights, WavySurface(0.1, 1.0).heights, area_share, PERSSON.mean_gap],
)
def test_closed_forms_keep_what_is_masked(formula):
    masked = np.ma.masked_array(np.linspace(0.01, 0.5, 6), mask=[0, 1, 0, 0, 1, 0])
    values = formula(masked)
    np.testing.assert_array_equal(np.ma.getmaskarray(values), masked.mask)
    np.testing.assert_array_equal(values.compressed(), formula(masked.data)[~masked.mask])
    with pytest.raises(ValueError, match="spectrum are masked"):
        PerssonInterface(WAVES, np.ma.masked_less(WAVES**-3.6, 0.1))
