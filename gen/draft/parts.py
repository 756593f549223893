"""Parts of maps: what a population needs where a map is not the same everywhere.

A translation field is the same everywhere. Maps are not: roughness, the directions of short waves
and the depth of valleys differ from place to place. Surfaces as small as the patches of a scene
then scatter less than parts of the map of this size, and a surrogate that is trained on them flags
the map. If it would, the population keeps the spectrum and the distribution of heights of each
part, and a patch is like one of them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Heights, Values
from gen.draft.bands import FLOOR, WaveGrid, periodogram
from gen.draft.height_curve import HeightCurve
from gen.draft.likeness import rounded
from gen.maps.read import Sides
from gen.population import MOST_PARTS, Part, Parts, Population, generate_like
from gen.ranges import margins, outside
from gen.statistics import describe

PATCHES = 500
"""Number of surfaces whose statistics are compared with those of the parts."""

MOST_OUTSIDE = 0.05
"""Largest share of the parts beyond the ranges of the surfaces with which a surrogate of these
surfaces is said to hold the map [1]."""

FEWEST_PARTS = 4  # smallest number of parts with which they are kept
# ratio of the largest to the smallest wavenumber of a ring of the spectrum of a part
RING_RATIO = math.sqrt(2)
# number of surfaces of the population whose mean spectrum that of a part is compared with
COMPARED = 100
DIGITS = 5  # significant digits of the numbers of a part


def cut_parts(heights: Heights, nodes: int) -> list[Heights]:
    """Cut a map into parts of equal size that overlap by half.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights of the map [um].
    nodes : int
        Nodes along each side of a part; along a shorter side of the map, all nodes.

    Returns
    -------
    list of ndarray, shape (nodes, nodes)
        The parts [um].
    """
    starts = []
    sizes = []
    for length in heights.shape:
        size = min(nodes, length)
        number = math.ceil(2 * (length - size) / size) + 1
        starts.append(np.linspace(0, length - size, number).astype(int))
        sizes.append(size)
    return [
        heights[x : x + sizes[0], y : y + sizes[1]] for x in starts[0] for y in starts[1]
    ]


@dataclass(frozen=True)
class Outside:
    """The parts of a map that a surrogate of surfaces flags by the ranges of its features."""

    number: int  # number of parts of which any statistic is beyond its range
    parts: int  # number of all parts
    # names of the statistics that are beyond their ranges, the most frequent ones first
    names: tuple[str, ...]

    @property
    def share(self) -> float:
        """Share of the parts that are beyond a range [1]."""
        return self.number / self.parts

    @property
    def is_rare(self) -> bool:
        """Whether so few parts are beyond a range that the surrogate is said to hold the map.

        It is the share `MOST_OUTSIDE` at most, or a single part, which may be so by chance.
        """
        return self.number <= max(1.0, MOST_OUTSIDE * self.parts)


def compare_ranges(
    parts: Sequence[Heights], patches: Sequence[Heights], spacing: Sides
) -> Outside:
    """Compare statistics of parts of a map with the ranges of those of surfaces.

    Ranges and their margins are those of the flags of a surrogate, see `gen.ranges`.

    Parameters
    ----------
    parts, patches : sequence of ndarray, shape (nx, ny)
        Heights of the parts and of the surfaces [um].
    spacing : tuple of float
        Distance of the nodes along x and y [um].

    Returns
    -------
    Outside
        Share of the parts beyond the ranges, and the statistics.
    """
    names = list(describe(parts[0], spacing).values)
    of_parts = _statistics(parts, spacing)
    of_patches = _statistics(patches, spacing)
    # These ignore NaN. A statistic that is undefined everywhere flags no part.
    low = np.fmin.reduce(of_patches, axis=0)
    high = np.fmax.reduce(of_patches, axis=0)
    margin = margins(low, high, np.zeros(len(names), dtype=np.bool_))
    is_outside = outside(of_parts, low, high, margin)
    shares = is_outside.mean(axis=0)
    order = np.argsort(-shares, kind="stable")
    return Outside(
        number=int(is_outside.any(axis=1).sum()),
        parts=len(parts),
        names=tuple(names[place] for place in order if shares[place] > 0),
    )


def _statistics(surfaces: Sequence[Heights], spacing: Sides) -> Values:
    """Return the statistics of surfaces [um], (surfaces, statistics); NaN if undefined."""
    return np.array(
        [list(describe(surface, spacing).values.values()) for surface in surfaces],
        dtype=np.float64,
    )


def with_parts(
    population: Population, textures: Sequence[Heights], nodes: int
) -> Population:
    """Return a population with the parts of its maps, if it lacks their scatter.

    Parameters
    ----------
    population : Population
        The population, without parts.
    textures : sequence of ndarray, shape (nx, ny)
        The maps without their imperfections, with the rms height of the population [um].
    nodes : int
        Nodes along each side of the parts, as of the patches of a scene.

    Returns
    -------
    Population
        The population with parts. It is unchanged if there are too few of them, or if their
        statistics are within the ranges of those of surfaces.
    """
    parts = [part for texture in textures for part in cut_parts(texture, nodes)]
    parts = [part for part in parts if part.shape == (nodes, nodes) and np.ptp(part) > 0]
    if len(parts) < FEWEST_PARTS:
        return population
    if len(parts) > MOST_PARTS:
        places = np.linspace(0, len(parts) - 1, MOST_PARTS).astype(int)
        parts = [parts[place] for place in places]
    patches = patches_of(population, nodes, PATCHES)
    if compare_ranges(parts, patches, population.spacing).is_rare:
        return population
    return replace(population, parts=_fitted_parts(parts, patches, population.spacing))


def patches_of(population: Population, nodes: int, number: int) -> list[Heights]:
    """Make surfaces of a population of the size of a scene's patches.

    Parameters
    ----------
    population : Population
        The population.
    nodes : int
        Nodes along each side.
    number : int
        Number of the surfaces.

    Returns
    -------
    list of ndarray, shape (nodes, nodes)
        Heights [um].
    """
    nx, ny = (max(nodes, min(longest, 2 * nodes)) for longest in population.nodes)
    return [
        generate_like(
            population, (nodes, nodes), (nx, ny), np.random.default_rng([number, seed])
        )
        for seed in range(number)
    ]


def _fitted_parts(
    parts: Sequence[Heights], patches: Sequence[Heights], spacing: Sides
) -> Parts:
    """Return spectra and heights of parts [um], compared with surfaces of the population [um]."""
    nodes_x, nodes_y = parts[0].shape
    grid = WaveGrid(shape=(nodes_x, nodes_y), spacing=spacing)
    rings = _Rings.of(grid)
    of_patches = np.mean(
        [rings.log_means(patch, grid) for patch in patches[:COMPARED]], axis=0
    )
    members = []
    curves = [HeightCurve.by_quantiles([part - part.mean()]) for part in parts]
    for part, curve in zip(parts, curves, strict=True):
        along_x, along_y = _along_axes(rings.log_means(part, grid) - of_patches)
        members.append(
            Part(
                ratios_x=_rounded_numbers(along_x),
                ratios_y=_rounded_numbers(along_y),
                heights=_rounded_numbers(curve.heights),
            )
        )
    return Parts(
        nodes=grid.shape,
        waves=_rounded_numbers(rings.middles),
        scores=_rounded_numbers(curves[0].scores),
        members=tuple(members),
    )


def _rounded_numbers(numbers: Values) -> tuple[float, ...]:
    """Return numbers with `DIGITS` significant digits."""
    return tuple(rounded(number, DIGITS) for number in numbers)


def _along_axes(of_sectors: Values) -> Values:
    """Return ratios for waves along x and along y, (2, rings), from means of two sectors [1].

    A sector has the waves that are nearer to x, or nearer to y. Between the axes, ratios follow the
    square of the cosine of the angle, whose mean over the nearer sector is 1/2 + 1/pi.
    """
    near = 0.5 + 1 / math.pi
    to_sectors = np.array([[near, 1 - near], [1 - near, near]])
    return np.asarray(np.linalg.solve(to_sectors, of_sectors))


@dataclass(frozen=True, eq=False)
class _Rings:
    """Rings of waves around the origin, each in two sectors: waves nearer to x, and nearer to y."""

    middles: Values  # wavenumber of each ring, rising, shape (rings,) [1/um]
    # number of the sector of each wave, shape of `rfft2`: first those nearer to x, ring by ring
    sector_of_wave: NDArray[np.int64]

    @classmethod
    def of(cls, grid: WaveGrid) -> _Rings:
        """Return rings for all waves of a period."""
        qx = np.abs(grid.qx)[:, None]
        qy = grid.qy[None, :]
        wavenumbers = np.hypot(qx, qy)
        # The first ring has all waves of up to about two periods along the shorter side: a ring of
        # longer ones only would have none in one of its sectors.
        smallest = 2 * max(grid.qx[1], grid.qy[1])
        # The corners of the plane belong to the last ring that reaches the nearer axis.
        largest = max(min(grid.qx.max(), grid.qy.max()), RING_RATIO * smallest)
        number = max(2, int(math.log(largest / smallest) / math.log(RING_RATIO)))
        ratio = (largest / smallest) ** (1 / number)
        with np.errstate(divide="ignore"):
            exponents = np.log(wavenumbers / smallest) / math.log(ratio)
        ring_of_wave = np.clip(np.round(exponents), 0, number).astype(np.int64)
        return cls(
            middles=smallest * ratio ** np.arange(number + 1),
            sector_of_wave=ring_of_wave + (number + 1) * (qx < qy),
        )

    def log_means(self, heights: Heights, grid: WaveGrid) -> Values:
        """Return logarithms of the mean spectral density in both sectors, (2, rings) [um^4].

        A sector without waves, as where spacings along x and y differ much, has the mean of all.
        """
        densities = periodogram(heights, grid)
        is_wave = np.ones(densities.shape)
        is_wave[0, 0] = 0.0  # the mean of the heights
        sectors = self.sector_of_wave.ravel()
        number = 2 * self.middles.size
        sums = np.bincount(sectors, (is_wave * densities).ravel(), number)
        waves = np.bincount(sectors, is_wave.ravel(), number)
        mean = sums.sum() / waves.sum()
        means = np.where(waves > 0, sums / np.maximum(waves, 1.0), mean)
        logarithms = np.log(np.maximum(means, FLOOR * means.max()))
        return np.asarray(logarithms.reshape(2, -1))
