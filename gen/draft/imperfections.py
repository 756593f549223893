"""Imperfections of a map: pits, dust and scratches that are no part of its texture.

A few pits can carry half of the mean square slope of a map although a contact hardly touches them.
A spectrum would spread this slope over whole surfaces, which would be too rough everywhere. The
squares of a map that are by far the steepest are therefore separated from its texture. ISO
8785:1998 calls them surface imperfections.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Heights, Values
from gen.maps.filters import filled_harmonically
from gen.maps.outliers import TO_DEVIATION
from gen.maps.read import Sides

SQUARE = 16  # nodes along each side of the squares whose rms slopes are compared
# Fewest squares of a map of which imperfections are separated: the median and the upper quartile of
# fewer rms slopes are uncertain.
FEWEST_SQUARES = 64
# Smallest rms slope of a square with an imperfection over the median of all squares [1]
STEEPER = 3.0
# Smallest logarithm of this ratio, in standard deviations of the logarithms of all rms slopes. The
# rms slopes of squares of a smooth surface scatter, because each square holds a part of a wave: a
# steep one is no imperfection.
DEVIATIONS = 4.0
# Largest share of all squares that have an imperfection [1]. If more are steep, none has one.
MOST_SQUARES = 0.05
MOST_HEIGHTS = 100_000
"""Largest number of heights of all imperfections of a population, which its file holds."""


@dataclass(frozen=True, eq=False)
class SeparatedMap:
    """A map whose imperfections are separated from its texture."""

    # heights [um], shape (nx, ny); squares with an imperfection are filled harmonically
    texture: Heights
    # heights of each imperfection above the texture, in a rectangle of nodes around it [um]
    imperfections: tuple[Heights, ...]


def separate_imperfections(
    heights: Heights, spacing: Sides, most_heights: int = MOST_HEIGHTS
) -> SeparatedMap:
    """Separate the imperfections of a map from its texture.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights of the map [um].
    spacing : tuple of float
        Distance of the nodes along x and y [um].
    most_heights : int
        Largest number of heights in the rectangles of all imperfections together. If there are
        more, nothing is separated.

    Returns
    -------
    SeparatedMap
        Texture and imperfections. Without imperfections, the texture is the map itself.
    """
    from scipy.ndimage import find_objects, label

    unchanged = SeparatedMap(texture=heights, imperfections=())
    is_imperfect = _imperfect_nodes(heights, spacing)
    if not is_imperfect.any():
        return unchanged
    # Squares that touch by an edge or a corner are one imperfection.
    labels, _ = label(is_imperfect, np.ones((3, 3)))
    boxes = find_objects(labels)
    sizes = [labels[box].size for box in boxes]
    if sum(sizes) > most_heights:
        return unchanged
    texture = filled_harmonically(np.where(is_imperfect, np.nan, heights), spacing)
    above = heights - texture
    imperfections = tuple(
        np.where(labels[box] == number, above[box], 0.0)
        for number, box in enumerate(boxes, start=1)
    )
    return SeparatedMap(texture=texture, imperfections=imperfections)


def _imperfect_nodes(heights: Heights, spacing: Sides) -> NDArray[np.bool_]:
    """Return whether each node is in a square with an imperfection, shape of `heights`."""
    nowhere = np.zeros(heights.shape, dtype=bool)
    edges_x, edges_y = (_edges(nodes) for nodes in heights.shape)
    slopes = _rms_slopes(heights, spacing, edges_x, edges_y)
    if slopes.size < FEWEST_SQUARES:
        return nowhere
    median = float(np.median(slopes))
    if median == 0.0:
        return nowhere
    # The standard deviation of the logarithms is estimated from the upper quartile, so that a few
    # steep squares do not change it.
    upper_quartile = float(np.quantile(slopes, 0.75))
    deviation = TO_DEVIATION * math.log(upper_quartile / median)
    factor = max(STEEPER, math.exp(DEVIATIONS * deviation))
    is_steep = slopes > factor * median
    if np.mean(is_steep) > MOST_SQUARES:
        return nowhere
    along_x = np.repeat(is_steep, np.diff(edges_x), axis=0)
    return np.repeat(along_x, np.diff(edges_y), axis=1)


def _edges(nodes: int) -> NDArray[np.int64]:
    """Return the first node of each square along an axis, and after them the number of nodes."""
    squares = max(1, nodes // SQUARE)
    return np.linspace(0, nodes, squares + 1).astype(np.int64)


def _rms_slopes(
    heights: Heights,
    spacing: Sides,
    edges_x: NDArray[np.int64],
    edges_y: NDArray[np.int64],
) -> Values:
    """Return the rms slope of each square, shape (squares along x, squares along y) [1].

    `heights` are in um, and the edges along both axes are those of `_edges`.
    """
    dx, dy = spacing
    squared = np.zeros(heights.shape)
    squared[:-1] += (np.diff(heights, axis=0) / dx) ** 2
    squared[:, :-1] += (np.diff(heights, axis=1) / dy) ** 2
    sums = np.add.reduceat(squared, edges_x[:-1], axis=0)
    sums = np.add.reduceat(sums, edges_y[:-1], axis=1)
    return np.asarray(np.sqrt(sums / np.outer(np.diff(edges_x), np.diff(edges_y))))
