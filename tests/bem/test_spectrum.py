"""The half-space under periodic and mirrored pressures, against numpy's transforms."""

import numpy as np
import pytest

from bem.spacing import Boundary
from bem.spectrum import inverse_filter, spectral_filter, wave_numbers

SHAPES = [(1, 1), (1, 2), (1, 9), (8, 1), (2, 3), (8, 8), (9, 9), (7, 12), (12, 7), (33, 64)]
EDGELESS: list[Boundary] = ["periodic", "mirror"]


def random_field(shape: tuple[int, int]) -> np.ndarray:
    return np.random.default_rng(shape).standard_normal(shape)


def displaced(pressure: np.ndarray, aspect: float) -> np.ndarray:
    """The displacement of a periodic half-space by numpy's complex transform."""
    along, across = (np.fft.fftfreq(cells) for cells in pressure.shape)
    numbers = 2 * np.pi * np.hypot(along[:, np.newaxis], across / aspect)
    numbers[0, 0] = np.inf
    return np.fft.ifft2(np.fft.fft2(pressure) * 2 / numbers).real


@pytest.mark.parametrize("aspect", [1.0, 0.3, 5.0])
@pytest.mark.parametrize("shape", SHAPES)
def test_periodic_displacement_is_that_of_numpys_transform(
    shape: tuple[int, int], aspect: float
) -> None:
    pressure = random_field(shape)
    expected = displaced(pressure, aspect)
    tolerance = 1e-13 * (np.abs(expected).max() + 1)
    computed = spectral_filter(shape, "periodic", aspect)(pressure)
    np.testing.assert_allclose(computed, expected, rtol=0, atol=tolerance)
    single = spectral_filter(shape, "periodic", aspect, "float32")(pressure)
    assert single.dtype == np.float32
    np.testing.assert_allclose(single, expected, rtol=0, atol=1e7 * tolerance)


@pytest.mark.parametrize("boundary", EDGELESS)
@pytest.mark.parametrize("aspect", [1.0, 0.3])
@pytest.mark.parametrize("shape", SHAPES)
def test_the_inverse_gives_back_a_pressure_but_for_its_mean(
    shape: tuple[int, int], aspect: float, boundary: Boundary
) -> None:
    pressure = random_field(shape)
    displacement = spectral_filter(shape, boundary, aspect)(pressure)
    assert displacement.mean() == pytest.approx(0, abs=1e-13)
    back = inverse_filter(shape, boundary, aspect)(displacement)
    np.testing.assert_allclose(back, pressure - pressure.mean(), rtol=0, atol=1e-12)


def test_wave_numbers_count_whole_periods_or_half_ones() -> None:
    periodic = wave_numbers((4, 5), "periodic", aspect=2.0)
    np.testing.assert_allclose(periodic[:, 0], 2 * np.pi * np.array([0, 1, 2, 1]) / 4)
    np.testing.assert_allclose(periodic[0], 2 * np.pi * np.arange(3) / 10)
    mirror = wave_numbers((4, 5), "mirror", aspect=2.0)
    np.testing.assert_allclose(mirror[:, 0], np.pi * np.arange(4) / 4)
    np.testing.assert_allclose(mirror[0], np.pi * np.arange(5) / 10)
