"""A polynomial is taken out to rounding, whatever is missing; the rest is the least-squares one."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gen.maps.filters import ALPHA, fitted_polynomial, long_waves
from gen.maps.outliers import WINDOW, local_medians, scatter_of
from gen.maps.prepare import despiked
from gen.maps.read import Topography

SHAPES = [(30, 41), (41, 30), (21, 21), (100, 22)]


def polynomial(shape, degree, random):
    """A random polynomial of a total degree on a map, with coefficients of any sign."""
    x, y = np.meshgrid(*(np.linspace(-1, 2, nodes) for nodes in shape), indexing="ij")
    heights = np.zeros(shape)
    for i in range(degree + 1):
        for j in range(degree + 1 - i):
            heights += random.normal() * x**i * y**j
    return heights


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("degree", [1, 2, 3, 6, 10, 20])
@pytest.mark.parametrize("holes", [False, True])
def test_a_polynomial_is_its_own_fit(shape, degree, holes):
    random = np.random.default_rng(degree)
    heights = polynomial(shape, degree, random)
    measured = ~(holes & (random.random(shape) < 0.1))
    fit = fitted_polynomial(np.where(measured, heights, np.nan), degree)
    np.testing.assert_allclose(
        fit[measured], heights[measured], atol=1e-12 * np.ptp(heights)
    )


def planted_nodes(shape, random):
    """Some nodes, alone in their neighbourhoods as dust is; borders and corners too."""
    nodes = np.zeros(shape, dtype=bool)
    for x in range(0, shape[0], WINDOW):
        for y in range(0, shape[1], WINDOW):
            nodes[x, y] = random.random() < 0.3
    return nodes


def without_spikes(heights, threshold):
    """Heights without spikes, and where they were."""
    clear = despiked(Topography("map", heights, (1.0, 1.0)), threshold).heights
    return clear, (clear != heights) & ~np.isnan(heights)


@given(st.integers(0, 2**32 - 1), st.integers(16, 40), st.integers(16, 41))
def test_planted_spikes_are_found_and_only_they(seed, nx, ny):
    random = np.random.default_rng(seed)
    x, y = np.meshgrid(np.arange(nx), np.arange(ny), indexing="ij")
    clean = (
        random.normal(size=(nx, ny)) + random.normal() * 20 * x + random.normal() * 20 * y
    )
    planted = planted_nodes((nx, ny), random)
    signs = random.choice([-1, 1], size=(nx, ny))
    heights = np.where(planted, clean + signs * 3000, clean)
    clear, spikes = without_spikes(heights, 25)
    assert np.array_equal(spikes, planted)
    assert np.array_equal(clear[~planted], clean[~planted])
    assert np.abs(clear - clean)[planted].max(initial=0) < 300


@pytest.mark.parametrize(
    "seed", range(5)
)  # in some others a spike is all that neighbours see
def test_holes_are_neither_spikes_nor_neighbours(seed):
    random = np.random.default_rng(seed)
    heights = random.normal(size=(23, 30))
    heights[4:14, 6:20] = np.nan
    heights[random.random(heights.shape) < 0.2] = np.nan
    heights[3, 8] = 1000.0
    clear, spikes = without_spikes(heights, 20)
    assert np.argwhere(spikes).tolist() == [[3, 8]]
    assert np.array_equal(np.isnan(clear), np.isnan(heights))


SPACING = (0.5, 0.8)  # um


def wave(shape, wavelength, angle):
    """A cosine of unit amplitude along a direction, with a crest at node (0, 0)."""
    x, y = np.meshgrid(
        *(step * np.arange(nodes) for nodes, step in zip(shape, SPACING, strict=True)),
        indexing="ij",
    )
    return np.cos(2 * np.pi / wavelength * (x * np.cos(angle) + y * np.sin(angle)))


@pytest.mark.parametrize("ratio", [0.5, 1, 2])
def test_waves_pass_as_the_standard_says(ratio):
    cutoff = 12.0
    waves = wave((200, 141), cutoff / ratio, 0.7)
    smooth = long_waves(waves, SPACING, cutoff)
    inner = slice(40, -40), slice(40, -40)
    np.testing.assert_allclose(smooth[inner], 0.5 ** (ratio**2) * waves[inner], atol=1e-5)


@pytest.mark.parametrize("cutoff", [3.2, 40.0])  # the longest reaches round the map
def test_a_periodic_map_is_filtered_as_one_that_is_repeated(cutoff):
    heights = np.random.default_rng(2).normal(size=(81, 50))
    smooth = long_waves(heights, SPACING, cutoff, "periodic")
    repeated = long_waves(np.tile(heights, (5, 5)), SPACING, cutoff)
    np.testing.assert_allclose(smooth, repeated[162:243, 100:150], atol=1e-7)
    shifted = long_waves(np.roll(heights, (7, -11), (0, 1)), SPACING, cutoff, "periodic")
    np.testing.assert_allclose(shifted, np.roll(smooth, (7, -11), (0, 1)), atol=1e-12)


@pytest.mark.parametrize("cutoff", [3.2, 40.0])
def test_a_mirrored_map_is_filtered_as_the_periodic_one_of_its_images(cutoff):
    heights = np.random.default_rng(3).normal(size=(41, 50))
    images = np.block([[heights, heights[:, ::-1]], [heights[::-1], heights[::-1, ::-1]]])
    smooth = long_waves(heights, SPACING, cutoff, "mirror")
    whole = long_waves(images, SPACING, cutoff, "periodic")
    np.testing.assert_allclose(smooth, whole[:41, :50], atol=1e-12)


def test_weights_at_a_border_are_the_normalised_ones():
    random = np.random.default_rng(1)
    heights = random.normal(size=(17, 12))
    cutoff = 4.0
    smooth = np.empty_like(heights)
    axes = [
        step * np.arange(nodes)
        for nodes, step in zip(heights.shape, SPACING, strict=True)
    ]
    for (i, j), _ in np.ndenumerate(heights):
        squares = np.add.outer((axes[0] - axes[0][i]) ** 2, (axes[1] - axes[1][j]) ** 2)
        weights = np.exp(-np.pi * squares / (ALPHA * cutoff) ** 2)
        smooth[i, j] = (weights * heights).sum() / weights.sum()
    np.testing.assert_allclose(long_waves(heights, SPACING, cutoff), smooth, atol=1e-7)


def test_distances_of_normal_heights_are_counted_in_their_deviation():
    heights = np.random.default_rng(0).normal(scale=3.0, size=(80, 80))
    distances = heights - local_medians(heights)
    assert np.std(distances / scatter_of(distances, heights)) == pytest.approx(1, abs=0.1)
