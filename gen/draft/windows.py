"""Choose the spacing and the windows for maps of several sizes."""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence

from gen.measured.resampling import is_same
from gen.measured.topography import Sides

SIZES = (128, 96, 64, 48, 32)
"""Nodes a side of the windows, the best first; cosine transforms of these numbers are fast."""

WIDER = (192, 256)
"""Nodes a side where windows of `SIZES` are narrow beside the texture."""

WIDE = 5.0
"""Sides of a window in autocorrelation lengths from which its statistics are those of the map."""

MOST_MAPS = 0.75
"""Share of the maps that have to hold two windows along both axes."""

FINE = 0.8
"""Share of the maps that are not coarsened for the sake of the others."""

COARSE = 4.0
"""Spacing over the median one from which maps are left out, however many they are."""


def common_spacing(spacings: Sequence[Sides]) -> float | None:
    """Choose the spacing that all maps are resampled to.

    Parameters
    ----------
    spacings : sequence of (float, float)
        Spacing of each map along x and y [um].

    Returns
    -------
    float or None
        The spacing that the share `FINE` of the maps have or are finer than, without those that
        are coarser than `COARSE` times the median [um]: finer maps can lose detail, coarser ones
        cannot gain it and are left out. None if all maps have the same spacing.
    """
    first = spacings[0]
    if all(is_same(*pair) for each in spacings for pair in zip(each, first, strict=True)):
        return None
    coarsest = sorted(max(each) for each in spacings)
    limit = COARSE * statistics.median(coarsest)
    kept = [each for each in coarsest if each <= limit]
    place = min(math.ceil(FINE * len(spacings)), len(kept)) - 1
    return float(f"{kept[place]:.6g}")


def window_nodes(shapes: Sequence[tuple[int, int]], length: float) -> int | None:
    """Choose the nodes along each side of the windows.

    Parameters
    ----------
    shapes : sequence of (int, int)
        Nodes of each prepared map.
    length : float
        Autocorrelation length of a usual map [nodes]; NaN if it is unknown.

    Returns
    -------
    int or None
        The largest of `SIZES` of which most maps hold two side by side along both axes, so that
        each map has tiles for training and for testing; one of `WIDER` where texture asks for it.
        Where no size fits twice, the largest that most maps hold once. Maps that hold none do not
        count; None if all are so small.
    """
    sides = [min(shape) for shape in shapes if min(shape) >= SIZES[-1]]
    if not sides:
        return None
    for windows in (2, 1):
        fitting = [size for size in SIZES if _share(sides, windows * size) >= MOST_MAPS]
        if not fitting:
            continue
        best = fitting[0]
        if windows == 2 and best == SIZES[0]:
            for size in WIDER:
                if best < WIDE * length and _share(sides, windows * size) >= MOST_MAPS:
                    best = size
        return best
    raise AssertionError("every map that counts holds the smallest window")


def _share(sides: Sequence[int], nodes: int) -> float:
    """Return the share of the maps that are at least this wide."""
    return sum(side >= nodes for side in sides) / len(sides)
