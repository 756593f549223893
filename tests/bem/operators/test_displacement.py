"""The influence matrix in shear, against integrals, single waves and the normal one."""

import math

import numpy as np
import pytest
from scipy.integrate import dblquad

from bem.bodies import HALF_SPACE
from bem.operators.displacement import displacement_filter, shear_filter
from bem.operators.filters import filtered

NU = 0.3


def by_unit_traction(shape, aspect, poisson, axis):
    """Return the displacements of a free patch by a unit traction on its corner node."""
    traction = np.zeros(shape)
    traction[0, 0] = 1
    return filtered(shear_filter(shape, "free", aspect, poisson, axis), traction).copy()


@pytest.mark.parametrize("aspect", [1.0, 2.5])
@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("offset", [(0, 1), (2, 1), (5, 0), (20, 30)])
def test_coefficients_are_integrals_of_cerrutis_displacement(aspect, axis, offset):
    x, y = offset[0], offset[1] * aspect

    def point(dy, dx):
        """Return Cerruti's displacement of a point force at a distance, for E* = 1."""
        along, across = x + dx, y + dy
        square = along**2 + across**2
        in_line = (along, across)[axis] ** 2 / square
        return (1 + NU / (1 - NU) * in_line) / (math.pi * math.sqrt(square))

    expected, _ = dblquad(point, -0.5, 0.5, -aspect / 2, aspect / 2, epsabs=1e-12)
    table = by_unit_traction((24, 32), aspect, NU, axis)
    assert table[offset] == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("boundary", ["free", "periodic", "mirror"])
@pytest.mark.parametrize("shape", [(16, 16), (15, 18)])
@pytest.mark.parametrize("axis", [0, 1])
def test_without_lateral_strain_shear_is_as_compliant_as_pressure(boundary, shape, axis):
    field = np.random.default_rng(0).random(shape)
    normal = displacement_filter(shape, boundary, HALF_SPACE, 1.5, "float64")
    expected = filtered(normal, field).copy()
    sheared = filtered(shear_filter(shape, boundary, 1.5, 0.0, axis), field)
    np.testing.assert_allclose(sheared, expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(("axis", "factor"), [(0, 1.0), (1, 1 / (1 - NU))])
def test_a_wave_along_the_traction_is_as_stiff_as_pressure(axis, factor):
    x = np.arange(24) / 24
    wave = np.repeat(np.cos(2 * np.pi * x)[:, np.newaxis], 20, axis=1)
    displacement = filtered(shear_filter(wave.shape, "periodic", 1.0, NU, axis), wave)
    expected = factor * 2 / (2 * math.pi / 24) * wave
    np.testing.assert_allclose(displacement, expected, atol=1e-12)


def test_both_axes_together_have_the_mean_compliance_of_an_isotropic_contact():
    field = np.random.default_rng(1).random((17, 17))
    normal = displacement_filter(field.shape, "free", HALF_SPACE, 1.0, "float64")
    expected = filtered(normal, field) * (2 - NU) / (1 - NU)
    total = np.zeros(field.shape)
    for axis in (0, 1):
        total += filtered(shear_filter(field.shape, "free", 1.0, NU, axis), field)
    np.testing.assert_allclose(total, expected, rtol=1e-10)
