"""Directional power spectra of maps in bands of waves, smoothed so that they are a population's.

Along an axis, each of the first bands holds one number of waves a side, and each further band the
same ratio of wavenumbers. A map is multiplied by a Hann window, so that steps between opposite
borders add no waves. The power that the window leaks from each wave to its neighbours is known
(`leaked`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Heights, Values
from gen.maps.read import Sides
from gen.population import densities_at, total_power

# ratio of the largest to the smallest wavenumber of a band of several numbers of waves
BAND_RATIO = 1.12
SINGLE = 5  # number of bands that hold one number of waves each
# Number of independent waves whose weight a band's neighbourhood has. A band with this number gets
# the mean of its own logarithm and of its neighbourhood's.
NEIGHBOURHOOD = 3.0
REACH = 1.0  # standard deviation of the weights of a band's neighbourhood [bands]
# Share of the waves that are independent: neighbouring waves share power through the window.
INDEPENDENT = 0.5
# Largest number of independent waves by which a band is weighted in its neighbourhood.
MOST_OF_A_NEIGHBOUR = 8.0
# number of corrections by which an interpolated spectrum gets the means of its bands
ROUNDS_OF_MEANS = 6
MOST_OF_A_ROUND = 2.0  # largest change of a logarithm in one correction
# smallest power of a band over the largest: about the rounding of heights
FLOOR = 1e-20


@dataclass(frozen=True)
class WaveGrid:
    """The waves of a period: entries of `rfft2` of heights, shape (nx, ny // 2 + 1)."""

    shape: tuple[int, int]  # nodes (nx, ny) of the period
    spacing: Sides  # distance of the nodes along x and y [um]

    @cached_property
    def qx(self) -> Values:
        """Components of wavevectors along x, shape (nx,) [1/um]."""
        frequencies = np.fft.fftfreq(self.shape[0], self.spacing[0])
        return np.asarray(2 * math.pi * frequencies, dtype=np.float64)

    @cached_property
    def qy(self) -> Values:
        """Components of wavevectors along y, shape (ny // 2 + 1,) [1/um]."""
        frequencies = np.fft.rfftfreq(self.shape[1], self.spacing[1])
        return np.asarray(2 * math.pi * frequencies, dtype=np.float64)

    @cached_property
    def slopes_x(self) -> Values:
        """Mean square slope between nodes along x of waves of unit variance, (nx, 1) [1/um^2]."""
        dx = self.spacing[0]
        return ((2 / dx * np.sin(self.qx * dx / 2)) ** 2)[:, None]

    @cached_property
    def slopes_y(self) -> Values:
        """Mean square slope between nodes along y, of shape (1, ny // 2 + 1) [1/um^2]."""
        dy = self.spacing[1]
        return ((2 / dy * np.sin(self.qy * dy / 2)) ** 2)[None, :]

    @property
    def area(self) -> float:
        """Area of the period [um^2]."""
        return math.prod(self.shape) * math.prod(self.spacing)

    def total(self, densities: Values) -> float:
        """Return the integral of a spectral density over all waves: the variance of the heights.

        Parameters
        ----------
        densities : ndarray, shape (nx, ny // 2 + 1)
            Spectral density; 0 for waves of two nodes along y [um^4].

        Returns
        -------
        float
            Its integral over the wavevectors, divided by (2 pi)^2 [um^2].
        """
        return total_power(densities) / self.area


@dataclass(frozen=True, eq=False)
class BandSpectrum:
    """Means of a spectral density in bands, for waves with components of equal and opposite signs.

    Waves along an axis are in both parts.
    """

    densities: Values  # shape (2, bands along x, bands along y), NaN without waves [um^4]
    waves: Values  # number of waves in each band, of the same shape


@dataclass(frozen=True)
class WaveBands:
    """Bands of waves along both axes."""

    # wavenumbers at which bands begin, and the end of the last one, rising from 0 [1/um]
    ends_x: tuple[float, ...]
    ends_y: tuple[float, ...]

    @classmethod
    def of(cls, grid: WaveGrid) -> WaveBands:
        """Return bands for all waves of a period of more than two nodes.

        Parameters
        ----------
        grid : WaveGrid
            The waves of the period.

        Returns
        -------
        WaveBands
            The bands.
        """
        ends = [_band_ends(nodes) for nodes in grid.shape]
        lengths = np.multiply(grid.shape, grid.spacing)  # of the period
        # Bands end between two waves.
        ends_x, ends_y = (
            tuple(2 * math.pi / length * np.maximum(0.0, numbers - 0.5))
            for numbers, length in zip(ends, lengths, strict=True)
        )
        return cls(ends_x=ends_x, ends_y=ends_y)

    @property
    def shape(self) -> tuple[int, int, int]:
        """Shape of a table over the bands."""
        return (2, len(self.ends_x) - 1, len(self.ends_y) - 1)

    @cached_property
    def middles(self) -> tuple[Values, Values]:
        """Middles of the bands along x and along y [1/um]; the first ones are 0."""
        return _middles(self.ends_x), _middles(self.ends_y)

    def means(self, grid: WaveGrid, densities: Values) -> BandSpectrum:
        """Return the means of a spectral density in the bands.

        Parameters
        ----------
        grid : WaveGrid
            The waves.
        densities : ndarray, shape (nx, ny // 2 + 1)
            Spectral density of the waves [um^4].

        Returns
        -------
        BandSpectrum
            The means.
        """
        places, is_inside = self._places(grid)
        inside = places[is_inside]
        size = math.prod(self.shape)
        sums = np.bincount(inside, densities[is_inside], size).reshape(self.shape)
        counts = np.bincount(inside, minlength=size).reshape(self.shape)
        numbers = counts.astype(np.float64)
        for table in (sums, numbers):
            # The column of qy = 0 holds both of two opposite waves, one in either part.
            table[:, :, 0] = table[:, :, 0].sum(axis=0)
            # Waves along y have no sign along x, and are in the first part.
            table[1, 0, 1:] = table[0, 0, 1:]
        with np.errstate(invalid="ignore"):  # 0 / 0 in bands without waves
            return BandSpectrum(densities=sums / numbers, waves=numbers)

    def _places(self, grid: WaveGrid) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Return the index of each wave in a flat table over the bands, and whether it has one.

        Waves of two nodes have none, nor has the mean of the heights.
        """
        _, bands_x, bands_y = self.shape
        band_x = np.searchsorted(self.ends_x, np.abs(grid.qx), side="right") - 1
        band_y = np.searchsorted(self.ends_y, grid.qy, side="right") - 1
        part = (grid.qx < 0).astype(np.int64)
        places = ((part * bands_x + band_x) * bands_y)[:, None] + band_y[None, :]
        is_inside = (band_x < bands_x)[:, None] & (band_y < bands_y)[None, :]
        is_inside[0, 0] = False
        return places, is_inside

    def spread(self, grid: WaveGrid, logarithms: Values) -> Values:
        """Interpolate a spectral density in bands at all waves of a period.

        Parameters
        ----------
        grid : WaveGrid
            The waves.
        logarithms : ndarray, shape of a table over the bands
            Logarithms of the density [um^4].

        Returns
        -------
        ndarray, shape (nx, ny // 2 + 1)
            The density [um^4], 0 for waves of two nodes.
        """
        densities = densities_at(logarithms, self.middles, grid.qx, grid.qy)
        nx, ny = grid.shape
        if nx % 2 == 0:
            densities[nx // 2] = 0.0
        if ny % 2 == 0:
            densities[:, -1] = 0.0
        return densities


def _band_ends(nodes: int) -> NDArray[np.int64]:
    """Return the number of waves at which each band along an axis begins, and one for the end."""
    end = (nodes + 1) // 2  # the number of waves of two nodes, or the next larger number
    ends = list(range(min(SINGLE, end) + 1))
    while ends[-1] < end:
        ends.append(max(ends[-1] + 1, round(ends[-1] * BAND_RATIO)))
    ends[-1] = end
    return np.array(ends)


def _middles(ends: Sequence[float]) -> Values:
    """Return the middles of bands with these ends; that of the first band is 0 [1/um]."""
    array = np.array(ends)
    middles = (array[:-1] + array[1:]) / 2
    middles[0] = 0.0
    return np.asarray(middles, dtype=np.float64)


def periodogram(heights: Heights, grid: WaveGrid) -> Values:
    """Compute the spectral density of a map at all waves of a period as long as the map.

    Parameters
    ----------
    heights : ndarray, shape of the grid
        Heights [um].
    grid : WaveGrid
        The waves.

    Returns
    -------
    ndarray, shape (nx, ny // 2 + 1)
        Spectral density of the heights about their mean, through a Hann window [um^4].
    """
    from scipy import fft

    window = np.outer(*(_hann(nodes) for nodes in heights.shape))
    mean = np.average(heights, weights=window)
    powers = np.abs(fft.rfft2(window * (heights - mean))) ** 2
    return np.asarray(powers * (math.prod(grid.spacing) / np.sum(window**2)))


def _hann(nodes: int) -> Values:
    """Return the Hann window at the nodes of an axis, shape (nodes,)."""
    places = (np.arange(nodes) + 0.5) / nodes
    return np.asarray(np.sin(math.pi * places) ** 2)


def leaked(densities: Values) -> Values:
    """Return the mean periodogram, through a Hann window, of a field with a spectral density.

    The window leaks a sixth of the power of a wave to each of its two neighbours along an axis.

    Parameters
    ----------
    densities : ndarray, shape (nx, ny // 2 + 1)
        Spectral density of the field [um^4].

    Returns
    -------
    ndarray, shape (nx, ny // 2 + 1)
        The mean of `periodogram` [um^4]. It is too small in the last column, because `densities`
        lacks the neighbour on one side.
    """
    neighbours_x = np.roll(densities, 1, axis=0) + np.roll(densities, -1, axis=0)
    along_x = densities * (2 / 3) + neighbours_x / 6
    result = along_x * (2 / 3)
    result[:, 1:] += along_x[:, :-1] / 6
    result[:, :-1] += along_x[:, 1:] / 6
    # The neighbour of (qx, 0) on the other side is opposite to (-qx, step).
    opposite = np.roll(along_x[::-1, 1], 1)
    result[:, 0] += opposite / 6
    return np.asarray(result)


def smoothed(spectrum: BandSpectrum) -> Values:
    """Return the logarithm of a map's spectrum in bands, smoothed to that of a population.

    The standard deviation of the power of a single wave is as large as its mean. A band with few
    waves therefore takes over the mean of its neighbourhood; a band with many keeps its own.

    Parameters
    ----------
    spectrum : BandSpectrum
        Means of a periodogram in the bands; not all of them may be 0.

    Returns
    -------
    ndarray, shape of a table over the bands
        Logarithms of the density, also in bands without waves [um^4].
    """
    from scipy.ndimage import gaussian_filter
    from scipy.special import digamma

    independent = np.where(spectrum.waves > 0, INDEPENDENT * spectrum.waves, 0.0)
    floor = FLOOR * np.nanmax(spectrum.densities)
    densities = np.where(independent > 0, np.fmax(spectrum.densities, floor), 1.0)
    # a band without waves is taken as one of a single wave
    at_least_one = np.maximum(independent, INDEPENDENT)
    # The mean logarithm of a mean of n exponentially distributed powers is below that of their
    # expectation by log(n) - digamma(n).
    logarithms = np.log(densities) + np.log(at_least_one) - digamma(at_least_one)
    weights = np.minimum(independent, MOST_OF_A_NEIGHBOUR)
    sums = gaussian_filter(_whole_plane(weights * logarithms), REACH, mode="nearest")
    totals = gaussian_filter(_whole_plane(weights), REACH, mode="nearest")
    totals = np.maximum(totals, 1e-300)
    neighbourhood = _half_plane(sums / totals, spectrum.waves.shape)
    share = independent / (independent + NEIGHBOURHOOD)
    return np.asarray(share * logarithms + (1 - share) * neighbourhood)


def _whole_plane(table: Values) -> Values:
    """Return a table over bands with opposite waves too, shape (2 bands_x - 1, 2 bands_y - 1).

    Bands with negative components come first, so that neighbours of the axes are neighbours.
    """
    equal, opposite = table
    half = np.concatenate((opposite[:0:-1], equal))  # components along y of 0 and more
    return np.concatenate((half[::-1, :0:-1], half), axis=1)


def _half_plane(plane: Values, shape: tuple[int, ...]) -> Values:
    """Return the table over bands, of the given shape, that `_whole_plane` has laid out."""
    _, bands_x, bands_y = shape
    half = plane[:, bands_y - 1 :]
    return np.stack((half[bands_x - 1 :], half[bands_x - 1 :: -1]))


def log_means(spectrum: BandSpectrum) -> Values:
    """Return the logarithms of means in bands.

    Parameters
    ----------
    spectrum : BandSpectrum
        The means.

    Returns
    -------
    ndarray, shape of a table over the bands
        Logarithms of the means [um^4]; 0 in bands without waves.
    """
    densities = np.where(spectrum.waves > 0, spectrum.densities, 1.0)
    return np.asarray(np.log(np.maximum(densities, 1e-300)))


def with_means(bands: WaveBands, grid: WaveGrid, means: Values) -> Values:
    """Return a spectrum in bands whose means over the waves of each band are the given ones.

    The logarithms of a spectrum are interpolated between the middles of bands. At a sharp bend its
    means differ from its values in the middles.

    Parameters
    ----------
    bands : WaveBands
        The bands.
    grid : WaveGrid
        The waves over which means are taken.
    means : ndarray, shape of a table over the bands
        Logarithms of the means [um^4].

    Returns
    -------
    ndarray, shape of a table over the bands
        Logarithms of the spectrum [um^4].
    """
    logarithms = means.copy()
    for _ in range(ROUNDS_OF_MEANS):
        spectrum = bands.means(grid, bands.spread(grid, logarithms))
        lacking = np.where(spectrum.waves > 0, means - log_means(spectrum), 0.0)
        logarithms += np.clip(lacking, -MOST_OF_A_ROUND, MOST_OF_A_ROUND)
    return logarithms
