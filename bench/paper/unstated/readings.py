"""Other readings of Table 1: what a bandwidth, a peak and an asperity may be.

Our readings are those of `gen.statistics`; here every reading is written anew and plainly, on whole
surfaces, so that one can be exchanged for another.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from bench.paper.facts import RANGES
from gen.generation.plan import parameters
from gen.generation.sample import surface_of
from gen.runtime.errors import InputError
from gen.scene import Scene

Heights = NDArray[np.float64]
Values = NDArray[np.float64]
Offsets = Sequence[tuple[int, int]]

ALONG, ACROSS = ((-1, 0), (1, 0)), ((0, -1), (0, 1))
"""Neighbours in profiles along x and along y."""

NEIGHBOURS: dict[int, Offsets] = {
    4: (*ALONG, *ACROSS),
    8: [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j],
}
"""Neighbours that an asperity stands above, by their number."""


@dataclass(frozen=True)
class Reading:
    """A meaning that a quantity of Table 1 may have.

    Attributes
    ----------
    column : str
        The quantity, as our databases name it.
    words : str
        The definition.
    value : callable
        Its value, of a surface and its spacing.
    ours : bool
        Whether our databases have this one.
    """

    column: str
    words: str
    value: Callable[[Heights, float], float]
    ours: bool = False


@dataclass(frozen=True)
class Row:
    """The range of one reading beside the paper's.

    Attributes
    ----------
    quantity, reading : str
        The quantity, and its definition.
    ours : str
        "ours" for the definition of our databases.
    low, high : float
        Smallest and largest value over the surfaces.
    paper_low, paper_high : float
        The range of Table 1.
    distance : float
        Mean distance of both ends from the paper's [% of the width of its range].
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
    """Evaluate every reading on the first surfaces of a scene, two or more."""
    plan = parameters(scene, 0, surfaces)
    heights = [surface_of(scene, plan, row) for row in range(surfaces)]
    spacing = scene.surface.side / (scene.surface.nodes - 1)
    for reading in READINGS:
        values = np.array([reading.value(surface, spacing) for surface in heights])
        yield Row(
            reading.column,
            reading.words,
            "ours" if reading.ours else "",
            float(values.min()),
            float(values.max()),
            *RANGES[reading.column],
            range_distance(values, reading.column),
        )


def range_distance(values: Values, name: str) -> float:
    """Measure how far the ends of a quantity's range are from Table 1's [% of its width].

    Raises
    ------
    InputError
        If Table 1 does not have the quantity, or no value is finite.
    """
    if name not in RANGES:
        raise InputError(f"{name}: not in the paper's Table 1")
    if not np.isfinite(values).any():
        raise InputError(f"{name}: no finite value")
    low, high = RANGES[name]
    ends = np.array([np.nanmin(values), np.nanmax(values)])
    return float(100 * np.abs(ends - (low, high)).mean() / (high - low))


def above(heights: Heights, offsets: Offsets, *, border: bool) -> NDArray[np.bool_]:
    """Mark the nodes that are above all of their neighbours.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights.
    offsets : sequence of (int, int)
        The neighbours' places relative to a node.
    border : bool
        True if a node at the border is compared with the neighbours that it has, False if it is
        never marked.

    Returns
    -------
    ndarray of bool, shape (nx, ny)
    """
    # No number is above NaN, every height is above -inf.
    padded = np.pad(heights, 1, constant_values=-np.inf if border else np.nan)
    nx, ny = heights.shape
    neighbours = (padded[1 + i : 1 + i + nx, 1 + j : 1 + j + ny] for i, j in offsets)
    return np.asarray(np.all([heights > neighbour for neighbour in neighbours], axis=0))


def peak_density(heights: Heights, spacing: float, *, border: bool) -> float:
    """Count the peaks of the profiles in both directions, for each node and direction."""
    counts = [above(heights, each, border=border).sum() for each in (ALONG, ACROSS)]
    return float(sum(counts) / (2 * heights.size))


def peak_mean(heights: Heights, spacing: float, *, border: bool) -> float:
    """Return the mean height of the peaks of the profiles in both directions [um]."""
    peaks = [heights[above(heights, each, border=border)] for each in (ALONG, ACROSS)]
    return float(np.concatenate(peaks).mean())


def asperity_density(heights: Heights, spacing: float, *, neighbours: int, border: bool) -> float:
    """Count the nodes above their 4 or 8 neighbours, for each node."""
    return float(above(heights, NEIGHBOURS[neighbours], border=border).mean())


def asperity_mean(heights: Heights, spacing: float, *, neighbours: int, border: bool) -> float:
    """Return the mean height of the nodes above their 4 or 8 neighbours [um]."""
    return float(heights[above(heights, NEIGHBOURS[neighbours], border=border)].mean())


def _bandwidth(m0: Values, m2: Values, m4: Values) -> float:
    """Nayak's parameter of a surface, or its mean over profiles."""
    return float(np.mean(m0 * m4 / m2**2))


def _slopes(heights: Heights, spacing: float) -> Values:
    return np.diff(heights, axis=0) / spacing


def _curvatures(heights: Heights, spacing: float) -> Values:
    return np.diff(heights, n=2, axis=0) / spacing**2


def _square(values: Values, axis: int | None = None) -> Values:
    """The mean square, of all values or along an axis."""
    return np.asarray(np.mean(values**2, axis=axis))


def _with_m0(m0: Callable[[Heights], Values]) -> Callable[[Heights, float], float]:
    """Nayak's parameter with m0 of another kind: m2 and m4 are mean squares over the surface."""
    return lambda z, d: _bandwidth(m0(z), _square(_slopes(z, d)), _square(_curvatures(z, d)))


nayak = _with_m0(np.var)
BANDWIDTHS: dict[str, Callable[[Heights, float], float]] = {
    "Nayak: m0 m4 / m2^2, first and second differences": nayak,
    "the same, slopes over two cells": lambda z, d: _bandwidth(
        z.var(), _square((z[2:] - z[:-2]) / (2 * d)), _square(_curvatures(z, d))
    ),
    "the same, m0 within each profile": _with_m0(lambda z: z.var(axis=0).mean()),
    "the same of each profile, then the mean": lambda z, d: _bandwidth(
        z.var(axis=0), _square(_slopes(z, d), 0), _square(_curvatures(z, d), 0)
    ),
    "the same of variances within profiles": lambda z, d: _bandwidth(
        *(part.var(axis=0).mean() for part in (z, _slopes(z, d), _curvatures(z, d)))
    ),
    "the same, m0 of the peaks only": _with_m0(lambda z: z[above(z, ALONG, border=False)].var()),
    "its root": lambda z, d: float(np.sqrt(nayak(z, d))),
}
"""Bandwidths along x, by their definitions; ours is the first."""

READINGS = (
    *(
        Reading("bandwidth_x", words, value, ours=value is nayak)
        for words, value in BANDWIDTHS.items()
    ),
    *(
        Reading(column, words, partial(value, border=border), ours=not border)
        for column, value in (("peak_density", peak_density), ("peak_mean", peak_mean))
        for words, border in (("peaks inside profiles", False), ("and at their ends", True))
    ),
    *(
        Reading(
            column,
            f"above {neighbours} neighbours{', at the border too' if border else ''}",
            partial(value, neighbours=neighbours, border=border),
            ours=neighbours == 4 and not border,
        )
        for column, value in (
            ("asperity_density", asperity_density),
            ("asperity_mean", asperity_mean),
        )
        for neighbours in NEIGHBOURS
        for border in (False, True)
    ),
)
"""All readings, those of a quantity together."""
