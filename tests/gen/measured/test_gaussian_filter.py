"""Waves pass as ISO 16610-61 says; constants pass everywhere, at the borders too."""

import numpy as np
import pytest
from scipy.special import erf

from gen.measured.gaussian_filter import ALPHA, FINEST, long_waves

SPACING = (0.5, 0.8)  # um


def wave(shape: tuple[int, int], wavelength: float, angle: float) -> np.ndarray:
    """A cosine of unit amplitude along a direction, with a crest at node (0, 0)."""
    x, y = np.meshgrid(
        *(step * np.arange(nodes) for nodes, step in zip(shape, SPACING, strict=True)),
        indexing="ij",
    )
    return np.cos(2 * np.pi / wavelength * (x * np.cos(angle) + y * np.sin(angle)))


@pytest.mark.parametrize("shape", [(200, 141), (161, 180), (181, 181)])
@pytest.mark.parametrize("angle", [0, 0.7, np.pi / 2])
@pytest.mark.parametrize("ratio", [0.5, 1, 2, 4])
def test_waves_pass_as_the_standard_says(
    shape: tuple[int, int], angle: float, ratio: float
) -> None:
    cutoff = 12.0
    waves = wave(shape, cutoff / ratio, angle)
    smooth = long_waves(waves, SPACING, cutoff)
    inner = slice(40, -40), slice(40, -40)
    np.testing.assert_allclose(smooth[inner], 0.5 ** (ratio**2) * waves[inner], atol=1e-5)


@pytest.mark.parametrize("angle", [0, np.pi / 2])
def test_half_of_the_shortest_cutoff_passes(angle: float) -> None:
    cutoff = FINEST * max(SPACING)
    waves = wave((120, 121), cutoff, angle)
    inner = slice(30, -30), slice(30, -30)
    smooth = long_waves(waves, SPACING, cutoff)
    np.testing.assert_allclose(smooth[inner], 0.5 * waves[inner], atol=0.003)


@pytest.mark.parametrize("cutoff", [3.2, 11.0, 40.0])
def test_constants_pass_up_to_the_border(cutoff: float) -> None:
    smooth = long_waves(np.full((81, 50), 3.7), SPACING, cutoff)
    np.testing.assert_allclose(smooth, 3.7, rtol=1e-14)


@pytest.mark.parametrize("cutoff", [3.2, 11.0, 40.0])  # the longest reaches round the map
def test_a_periodic_map_is_filtered_as_one_that_is_repeated(cutoff: float) -> None:
    heights = np.random.default_rng(2).normal(size=(81, 50))
    smooth = long_waves(heights, SPACING, cutoff, "periodic")
    repeated = long_waves(np.tile(heights, (5, 5)), SPACING, cutoff)
    np.testing.assert_allclose(smooth, repeated[162:243, 100:150], atol=1e-7)
    shifted = long_waves(np.roll(heights, (7, -11), (0, 1)), SPACING, cutoff, "periodic")
    np.testing.assert_allclose(shifted, np.roll(smooth, (7, -11), (0, 1)), atol=1e-12)


@pytest.mark.parametrize("ratio", [1, 2])
def test_periodic_waves_pass_up_to_the_border(ratio: int) -> None:
    waves = wave((80, 50), 40.0 / ratio, 0.0)
    smooth = long_waves(waves, SPACING, 40.0, "periodic")
    np.testing.assert_allclose(smooth, 0.5 ** (ratio**2) * waves, atol=1e-7)


@pytest.mark.parametrize("cutoff", [3.2, 11.0, 40.0])
def test_a_mirrored_map_is_filtered_as_the_periodic_one_of_its_images(cutoff: float) -> None:
    heights = np.random.default_rng(3).normal(size=(41, 50))
    images = np.block([[heights, heights[:, ::-1]], [heights[::-1], heights[::-1, ::-1]]])
    smooth = long_waves(heights, SPACING, cutoff, "mirror")
    whole = long_waves(images, SPACING, cutoff, "periodic")
    np.testing.assert_allclose(smooth, whole[:41, :50], atol=1e-12)


def test_a_step_is_the_standards_error_function() -> None:
    x = SPACING[0] * (np.arange(200) - 99.5)
    heights = np.repeat(np.sign(x)[:, None], 9, axis=1)
    smooth = long_waves(heights, SPACING, 20.0)
    expected = erf(np.sqrt(np.pi) * x / (ALPHA * 20.0))
    inner = slice(50, -50)
    np.testing.assert_allclose(smooth[inner, 4], expected[inner], atol=5e-4)


def test_weights_at_a_border_are_the_normalised_ones() -> None:
    random = np.random.default_rng(1)
    heights = random.normal(size=(17, 12))
    cutoff = 4.0
    smooth = np.empty_like(heights)
    axes = [step * np.arange(nodes) for nodes, step in zip(heights.shape, SPACING, strict=True)]
    for (i, j), _ in np.ndenumerate(heights):
        squares = np.add.outer((axes[0] - axes[0][i]) ** 2, (axes[1] - axes[1][j]) ** 2)
        weights = np.exp(-np.pi * squares / (ALPHA * cutoff) ** 2)
        smooth[i, j] = (weights * heights).sum() / weights.sum()
    np.testing.assert_allclose(long_waves(heights, SPACING, cutoff), smooth, atol=1e-7)
