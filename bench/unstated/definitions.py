"""Other readings of Table 1: what a bandwidth, a peak and an asperity may be.

Our readings are `gen.statistics`'; here each is written anew and plainly, on whole surfaces, so
that one reading can be exchanged for another. The last row or column of a surface is at its border.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from bench.unstated.measurement import RANGES, range_distance
from gen.generation.plan import parameters
from gen.generation.sample import surface_of
from gen.scene import Scene

Heights = NDArray[np.float64]
Quantity = Callable[[Heights, float], float]


@dataclass(frozen=True)
class Reading:
    """What a quantity of Table 1 may mean.

    Attributes
    ----------
    column : the quantity's, as our databases name it
    words : the definition
    value : of a surface and its spacing
    ours : whether it is ours
    """

    column: str
    words: str
    value: Quantity
    ours: bool = False


@dataclass(frozen=True)
class Row:
    """The range of one reading beside the paper's.

    Attributes
    ----------
    quantity, reading : which, and how it is defined
    ours : "ours" where it is
    low, high : over the surfaces
    paper_low, paper_high : Table 1's
    distance : mean of both ends' distances from the paper's [% of its range's width]
    """

    quantity: str
    reading: str
    ours: str
    low: float
    high: float
    paper_low: float
    paper_high: float
    distance: float


def compare(scene: Scene, surfaces: int) -> Iterator[Row]:
    """Evaluate every reading on the first surfaces of a scene.

    Parameters
    ----------
    scene : whose surfaces
    surfaces : how many, two or more
    """
    plan = parameters(scene, 0, surfaces)
    heights = [surface_of(scene, plan, row) for row in range(surfaces)]
    spacing = scene.surface.side / (scene.surface.nodes - 1)
    for reading in READINGS:
        values = np.array([reading.value(surface, spacing) for surface in heights])
        yield Row(
            quantity=reading.column,
            reading=reading.words,
            ours="ours" if reading.ours else "",
            low=float(values.min()),
            high=float(values.max()),
            paper_low=RANGES[reading.column][0],
            paper_high=RANGES[reading.column][1],
            distance=range_distance(values, reading.column),
        )


# --- bandwidth ---------------------------------------------------------------


def nayak(heights: Heights, spacing: float) -> float:
    """m0 m4 / m2^2 along x: m0 the variance of all heights, first and second differences."""
    return float(heights.var() * _m4(heights, spacing) / _m2(heights, spacing) ** 2)


def nayak_central(heights: Heights, spacing: float) -> float:
    """The same with slopes over two cells."""
    slopes = (heights[2:] - heights[:-2]) / (2 * spacing)
    return float(heights.var() * _m4(heights, spacing) / np.mean(slopes**2) ** 2)


def nayak_of_profiles(heights: Heights, spacing: float) -> float:
    """The same with m0 the variance within each profile, all three averaged over the profiles."""
    within = heights.var(axis=0).mean()
    return float(within * _m4(heights, spacing) / _m2(heights, spacing) ** 2)


def nayak_mean_over_profiles(heights: Heights, spacing: float) -> float:
    """The parameter of each profile, averaged."""
    m0 = heights.var(axis=0)
    m2 = np.mean((np.diff(heights, axis=0) / spacing) ** 2, axis=0)
    m4 = np.mean((np.diff(heights, n=2, axis=0) / spacing**2) ** 2, axis=0)
    return float(np.mean(m0 * m4 / m2**2))


def nayak_of_variances(heights: Heights, spacing: float) -> float:
    """The same with variances, not mean squares, of slopes and curvatures within profiles."""
    slopes, curvatures = np.diff(heights, axis=0) / spacing, np.diff(heights, 2, 0) / spacing**2
    m2, m4 = slopes.var(axis=0).mean(), curvatures.var(axis=0).mean()
    return float(heights.var(axis=0).mean() * m4 / m2**2)


def root_of_nayak(heights: Heights, spacing: float) -> float:
    """The root of it."""
    return float(np.sqrt(nayak(heights, spacing)))


def of_the_summits(heights: Heights, spacing: float) -> float:
    """m0 m4 / m2^2 with m0 the variance of the peaks' heights instead of all heights'."""
    peaks = heights[1:-1][_peaks(heights)]
    return float(peaks.var() * _m4(heights, spacing) / _m2(heights, spacing) ** 2)


def _m2(heights: Heights, spacing: float) -> float:
    return float(np.mean((np.diff(heights, axis=0) / spacing) ** 2))


def _m4(heights: Heights, spacing: float) -> float:
    return float(np.mean((np.diff(heights, n=2, axis=0) / spacing**2) ** 2))


# --- peaks and asperities ----------------------------------------------------


def _peaks(heights: Heights) -> NDArray[np.bool_]:
    """(nx - 2, ny) inner nodes of the profiles along x above both neighbours."""
    inside = heights[1:-1]
    return np.asarray((inside > heights[:-2]) & (inside > heights[2:]))


def _peaks_to_the_border(heights: Heights) -> NDArray[np.bool_]:
    """(nx, ny) nodes above those neighbours that they have."""
    padded = np.pad(heights, ((1, 1), (0, 0)), constant_values=-np.inf)
    return _peaks(padded)


def peak_density(heights: Heights, spacing: float, *, border: bool) -> float:
    """Peaks of both directions per node and direction."""
    count = _peaks_to_the_border if border else _peaks
    return float(sum(count(each).sum() for each in (heights, heights.T)) / (2 * heights.size))


def peak_mean(heights: Heights, spacing: float, *, border: bool) -> float:
    """Mean height of the peaks of both directions [um]."""
    found = []
    for each in (heights, heights.T):
        if border:
            found.append(each[_peaks_to_the_border(each)])
        else:
            found.append(each[1:-1][_peaks(each)])
    return float(np.concatenate(found).mean())


def asperity_density(heights: Heights, spacing: float, *, neighbours: int, border: bool) -> float:
    """Nodes above their 4 or 8 neighbours, per node."""
    return float(_asperities(heights, neighbours, border=border).sum() / heights.size)


def asperity_mean(heights: Heights, spacing: float, *, neighbours: int, border: bool) -> float:
    """Mean height of those nodes [um]."""
    chosen = _asperities(heights, neighbours, border=border)
    nodes = heights if border else heights[1:-1, 1:-1]
    return float(nodes[chosen].mean())


def _asperities(heights: Heights, neighbours: int, *, border: bool) -> NDArray[np.bool_]:
    nodes = np.pad(heights, 1, constant_values=-np.inf) if border else heights
    rows, columns = nodes.shape
    inside = nodes[1:-1, 1:-1]
    above = np.ones_like(inside, dtype=bool)
    for i in (-1, 0, 1):
        for j in (-1, 0, 1):
            if (i or j) and (neighbours == 8 or not (i and j)):
                above &= inside > nodes[1 + i : rows - 1 + i, 1 + j : columns - 1 + j]
    return above


READINGS = (
    Reading("bandwidth_x", "Nayak: m0 m4 / m2^2, first and second differences", nayak, ours=True),
    Reading("bandwidth_x", "the same, slopes over two cells", nayak_central),
    Reading("bandwidth_x", "the same, m0 within each profile", nayak_of_profiles),
    Reading("bandwidth_x", "the same of each profile, then the mean", nayak_mean_over_profiles),
    Reading("bandwidth_x", "the same of variances within profiles", nayak_of_variances),
    Reading("bandwidth_x", "the same, m0 of the peaks only", of_the_summits),
    Reading("bandwidth_x", "its root", root_of_nayak),
    Reading(
        "peak_density", "peaks inside profiles", partial(peak_density, border=False), ours=True
    ),
    Reading("peak_density", "and at their ends", partial(peak_density, border=True)),
    Reading("peak_mean", "peaks inside profiles", partial(peak_mean, border=False), ours=True),
    Reading("peak_mean", "and at their ends", partial(peak_mean, border=True)),
    *(
        Reading(
            f"asperity_{name}",
            f"above {neighbours} neighbours{', at the border too' if border else ''}",
            partial(value, neighbours=neighbours, border=border),
            ours=neighbours == 4 and not border,
        )
        for name, value in (("density", asperity_density), ("mean", asperity_mean))
        for neighbours in (4, 8)
        for border in (False, True)
    ),
)
