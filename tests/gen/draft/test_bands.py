"""Spectra of maps in bands: what a window leaks, and means of bands."""

import numpy as np
import pytest

from gen.draft.bands import WaveBands, WaveGrid, leaked, periodogram, smoothed

GRID = WaveGrid(shape=(24, 33), spacing=(0.5, 2.0))


@pytest.mark.parametrize("wave", [(3, 5), (-4, 1), (0, 2), (6, 0), (2, 1)])
def test_the_leak_is_the_mean_periodogram_of_a_wave(wave):
    """Against heights of this wave; the mean over two phases is that over all phases."""
    kx, ky = wave
    x, y = np.meshgrid(np.arange(24) / 24, np.arange(33) / 33, indexing="ij")
    phase = 2 * np.pi * (kx * x + ky * y)
    windowed = np.mean(
        [
            periodogram(np.sqrt(2) * np.cos(phase + shift), GRID)
            for shift in (0.0, np.pi / 2)
        ],
        axis=0,
    )
    densities = np.zeros((24, 17))
    # unit variance, of which the opposite wave has half
    densities[kx, ky] = GRID.area / 2
    if ky == 0:
        densities[-kx, ky] = GRID.area / 2
    assert GRID.total(densities) == pytest.approx(1.0)
    expected = leaked(densities)
    # The mean of the heights through the window is subtracted.
    expected[0, 0] = windowed[0, 0]
    assert windowed == pytest.approx(expected, abs=1e-9 * GRID.area)


def test_slopes_of_a_wave_are_those_between_nodes():
    waves = np.cos(2 * np.pi * 3 * np.arange(24) / 24)
    slope = np.mean((np.roll(waves, -1) - waves) ** 2) / 0.5**2
    assert GRID.slopes_x[3, 0] / 2 == pytest.approx(slope)


def test_means_of_bands_are_those_of_their_waves():
    """A density that is constant along y has in each band the mean over its waves along x."""
    bands = WaveBands.of(GRID)
    densities = np.repeat(np.abs(GRID.qx)[:, None], 17, axis=1)
    means = bands.means(GRID, densities).densities
    numbers = np.arange(12)
    wavenumbers = 2 * np.pi / 12.0 * numbers  # of a period of 24 * 0.5 um
    for band in range(1, bands.shape[1]):
        start, end = bands.ends_x[band : band + 2]
        inside = wavenumbers[(wavenumbers >= start) & (wavenumbers < end)]
        assert means[:, band, 2] == pytest.approx(inside.mean())


def test_all_waves_but_those_of_two_nodes_are_in_one_band():
    bands = WaveBands.of(GRID)
    waves = bands.means(GRID, np.ones((24, 17))).waves
    # Waves along an axis are in both parts, and the column of qy = 0 holds opposite ones.
    along_x = waves[0, 1:, 0].sum()
    along_y = waves[0, 0, 1:].sum()
    others = waves[:, 1:, 1:].sum()
    assert (along_x, along_y, others) == (22, 16, 22 * 16)


def test_the_spectrum_of_white_noise_is_smoothed_to_its_variance():
    """Single waves scatter by their mean; their smoothed logarithm by half of it."""
    grid = WaveGrid(shape=(128, 128), spacing=(1.0, 1.0))
    bands = WaveBands.of(grid)
    heights = np.random.default_rng(0).standard_normal(grid.shape)
    logarithms = smoothed(bands.means(grid, periodogram(heights, grid)))
    weights = bands.means(grid, np.ones((128, 65))).waves
    assert np.average(logarithms, weights=weights) == pytest.approx(0.0, abs=0.05)
    assert logarithms[:, 1:, 1:].std() < 0.6


def test_bands_of_a_spread_spectrum_are_those_of_the_table():
    bands = WaveBands.of(GRID)
    logarithms = np.zeros(bands.shape)
    densities = bands.spread(GRID, logarithms)
    assert densities[0, 0] == 0.0
    # waves of two nodes along x; 33 nodes have none along y
    assert (densities[12] == 0.0).all()
    assert densities[1:12, :] == pytest.approx(1.0)
