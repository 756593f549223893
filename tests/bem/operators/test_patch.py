"""The influence matrix of a patch and its approximate inverse, against matrices written out."""

import numpy as np
import pytest

from bem.bodies import HALF_SPACE, KERNELS, REDUCED
from bem.operators.displacement import fast_period
from bem.operators.patch import Patch
from bem.problem import BOUNDARIES, Boundary
from bench.references import dense

EDGELESS: list[Boundary] = ["periodic", "mirror"]
SHAPES = [
    (1, 1),
    (1, 2),
    (2, 1),
    (1, 17),
    (23, 1),
    (2, 3),
    (8, 8),
    (9, 9),
    (16, 33),
    (37, 10),
]


def random_field(shape):
    return np.random.default_rng(shape).standard_normal(shape)


def relative_error(computed, expected):
    return float(np.abs(computed - expected).max() / np.abs(expected).max())


def exact(patch, pressure):
    return patch.displace(pressure, exactly=True)


def matrix_of(patch):
    """The influence matrix of all nodes, column by column."""
    units = np.eye(patch.shape[0] * patch.shape[1]).reshape(-1, *patch.shape)
    return np.array([exact(patch, unit).reshape(-1).copy() for unit in units]).T


@pytest.mark.parametrize(
    ("kernel", "aspect"),
    [(KERNELS[0], 1.0), (KERNELS[1], 1.0), ("uniform-pressure", 7.3)],
)
@pytest.mark.parametrize("shape", [*SHAPES, (65, 65), (128, 65)])
def test_displacement_is_the_dense_product(shape, kernel, aspect):
    pressure, patch = random_field(shape), Patch(shape, "free", REDUCED[kernel], aspect)
    expected = dense.displace(pressure, kernel, aspect)
    assert relative_error(exact(patch, pressure), expected) < 1e-12
    single = patch.displace(pressure)
    assert single.dtype == np.float32
    assert relative_error(single, expected) < 1e-6


def test_periods_are_even_and_hold_every_offset():
    for nodes in range(1, 600):
        period = fast_period(nodes)
        assert period % 2 == 0
        assert period >= max(2 * nodes - 2, 2)


@pytest.mark.parametrize("aspect", [1.0, 0.3, 5.0])
@pytest.mark.parametrize("shape", SHAPES)
def test_periodic_displacement_is_that_of_numpys_transform(shape, aspect):
    pressure = random_field(shape)
    along, across = (np.fft.fftfreq(cells) for cells in shape)
    numbers = 2 * np.pi * np.hypot(along[:, np.newaxis], across / aspect)
    numbers[0, 0] = np.inf
    expected = np.fft.ifft2(np.fft.fft2(pressure) * 2 / numbers).real
    tolerance = 1e-13 * (np.abs(expected).max() + 1)
    patch = Patch(shape, "periodic", HALF_SPACE, aspect)
    np.testing.assert_allclose(exact(patch, pressure), expected, rtol=0, atol=tolerance)
    single = patch.displace(pressure)
    np.testing.assert_allclose(single, expected, rtol=0, atol=1e7 * tolerance)


@pytest.mark.parametrize("boundary", EDGELESS)
@pytest.mark.parametrize("aspect", [1.0, 0.3])
@pytest.mark.parametrize("shape", SHAPES)
def test_the_inverse_gives_back_a_pressure_but_for_its_mean(shape, aspect, boundary):
    pressure, patch = (
        random_field(shape),
        Patch(shape, boundary, HALF_SPACE, aspect),
    )
    displacement = exact(patch, pressure).copy()
    assert displacement.mean() == pytest.approx(0, abs=1e-13)
    back = patch.zero_mean_pressure(displacement)
    np.testing.assert_allclose(back, pressure - pressure.mean(), rtol=0, atol=1e-12)


@pytest.mark.parametrize("boundary", BOUNDARIES)
@pytest.mark.parametrize(
    ("shape", "aspect"), [((1, 9), 1.0), ((8, 8), 1.0), ((13, 10), 0.3)]
)
def test_entries_are_those_of_the_transforms(shape, aspect, boundary):
    patch = Patch(shape, boundary, HALF_SPACE, aspect)
    matrix = matrix_of(patch)
    nodes = np.random.default_rng(2).permutation(matrix.shape[0])[
        : 2 * matrix.shape[0] // 3
    ]
    expected = np.tril(matrix[np.ix_(nodes, nodes)])
    np.testing.assert_allclose(
        np.tril(patch.entries(nodes, "float64")), expected, atol=1e-12
    )
    assert np.linalg.eigvalsh(matrix).max() <= patch.norm * (1 + 1e-12)
