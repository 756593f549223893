"""Other readings of Table 1: what a bandwidth, a peak and an asperity may be.

Our readings are those of `gen.statistics`; here every reading is written anew and plainly, on whole
surfaces, so that one can be exchanged for another.
"""

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from bench.paper.facts import RANGES
from gen.arrays import Values
from gen.generation.plan import parameters
from gen.generation.sample import surface_of
from gen.runtime.errors import InputError
from gen.scene import Scene

Offsets = Sequence[tuple[int, int]]
# What a quantity may mean: its value, of a surface and its spacing [um].
Reading = Callable[[Values, float], float]
# Neighbours that marked nodes stand above, and whether the border counts, by definition.
Kinds = dict[str, tuple[Sequence[Offsets], bool]]
ALONG, ACROSS = ((-1, 0), (1, 0)), ((0, -1), (0, 1))  # neighbours in profiles along x and along y

NEIGHBOURS: dict[int, Offsets] = {
    4: (*ALONG, *ACROSS),
    8: [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j],
}
"""Neighbours that an asperity stands above, by their number."""


def compare(scene: Scene, surfaces: int) -> Iterator[dict[str, str | float]]:
    """Compare the range of every reading with Table 1's, on the first surfaces of a scene."""
    plan = parameters(scene, 0, surfaces)
    heights = [surface_of(scene, plan, row) for row in range(surfaces)]
    spacing = scene.sides[0] / (scene.shape[0] - 1)
    for column, readings in READINGS.items():
        low, high = RANGES[column]
        for number, (words, value) in enumerate(readings.items()):
            values = np.array([value(surface, spacing) for surface in heights])
            yield {
                "quantity": column,
                "reading": words,
                "ours": "" if number else "ours",
                "low": float(values.min()),
                "high": float(values.max()),
                "paper_low": low,
                "paper_high": high,
                "distance": range_distance(values, column),
            }


def range_distance(values: Values, name: str) -> float:
    """Measure how far the ends of a quantity's range are from Table 1's [% of its width]."""
    if name not in RANGES:
        raise InputError(f"{name}: not in the paper's Table 1")
    if not np.isfinite(values).any():
        raise InputError(f"{name}: no finite value")
    low, high = RANGES[name]
    ends = np.array([np.nanmin(values), np.nanmax(values)])
    return float(100 * np.abs(ends - (low, high)).mean() / (high - low))


def above(heights: Values, offsets: Offsets, *, border: bool) -> NDArray[np.bool_]:
    """Mark the nodes that are above all of their neighbours, given by places relative to a node.

    At the border a node is compared with the neighbours that it has, or never marked.
    """
    # No number is above NaN, every height is above -inf.
    padded = np.pad(heights, 1, constant_values=-np.inf if border else np.nan)
    nx, ny = heights.shape
    neighbours = (padded[1 + i : 1 + i + nx, 1 + j : 1 + j + ny] for i, j in offsets)
    return np.asarray(np.all([heights > neighbour for neighbour in neighbours], axis=0))


def _marked(offsets: Sequence[Offsets], *, density: bool, border: bool) -> Reading:
    """Count the nodes above each set of neighbours, for each node, or take their mean height."""

    def value(heights: Values, spacing: float) -> float:
        marks = np.array([above(heights, each, border=border) for each in offsets])
        return float(marks.mean() if density else np.stack([heights] * len(marks))[marks].mean())

    return value


def _bandwidth(m0: Values, m2: Values, m4: Values) -> float:
    """Nayak's parameter of a surface, or its mean over profiles."""
    return float(np.mean(m0 * m4 / m2**2))


def _slopes(heights: Values, spacing: float, order: int = 1) -> Values:
    """Return differences of an order along x."""
    return np.diff(heights, n=order, axis=0) / spacing**order


def _square(values: Values, axis: int | None = None) -> Values:
    """The mean square, of all values or along an axis."""
    return np.asarray(np.mean(values**2, axis=axis))


def _with_m0(m0: Callable[[Values], Values]) -> Reading:
    """Nayak's parameter with m0 of another kind: m2 and m4 are mean squares over the surface."""
    return lambda z, d: _bandwidth(m0(z), _square(_slopes(z, d)), _square(_slopes(z, d, 2)))


nayak = _with_m0(np.var)
BANDWIDTHS: dict[str, Reading] = {
    "Nayak: m0 m4 / m2^2, first and second differences": nayak,
    "the same, slopes over two cells": lambda z, d: _bandwidth(
        z.var(), _square((z[2:] - z[:-2]) / (2 * d)), _square(_slopes(z, d, 2))
    ),
    "the same, m0 within each profile": _with_m0(lambda z: z.var(axis=0).mean()),
    "the same of each profile, then the mean": lambda z, d: _bandwidth(
        z.var(axis=0), _square(_slopes(z, d), 0), _square(_slopes(z, d, 2), 0)
    ),
    "the same of variances within profiles": lambda z, d: _bandwidth(
        *(part.var(axis=0).mean() for part in (z, _slopes(z, d), _slopes(z, d, 2)))
    ),
    "the same, m0 of the peaks only": _with_m0(lambda z: z[above(z, ALONG, border=False)].var()),
    "its root": lambda z, d: float(np.sqrt(nayak(z, d))),
}
"""Bandwidths along x, by their definitions; ours is the first."""

PEAKS: Kinds = {
    "peaks inside profiles": ((ALONG, ACROSS), False),
    "and at their ends": ((ALONG, ACROSS), True),
}
ASPERITIES: Kinds = {
    f"above {number} neighbours{', at the border too' if border else ''}": ((offsets,), border)
    for number, offsets in NEIGHBOURS.items()
    for border in (False, True)
}
READINGS: dict[str, dict[str, Reading]] = {
    "bandwidth_x": BANDWIDTHS,
    **{
        f"{name}_{quantity}": {
            words: _marked(offsets, density=quantity == "density", border=border)
            for words, (offsets, border) in kinds.items()
        }
        for name, kinds in (("peak", PEAKS), ("asperity", ASPERITIES))
        for quantity in ("density", "mean")
    },
}
"""Readings of each quantity by their definitions; the first is that of our databases."""
