"""Imperfections of a map: pits, dust and scratches that are no part of its texture.

A few pits can carry half of the mean square slope of a map although a contact hardly touches them.
If such a slope is spread over the whole surface by a spectrum, the surface is too rough everywhere.
So the places that are by far the steepest of a map are separated from its texture. They are what
ISO 8785:1998 calls surface imperfections.
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
FEWEST_SQUARES = 64  # fewer squares do not tell which rms slopes are usual
# Least rms slope of a square of an imperfection over the median of all squares [1]. Its mean square
# slope is then nine times the usual one.
STEEPER = 3.0
# Least distance of the logarithm of this rms slope from the median, in standard deviations. They
# are estimated from the upper quartile, so that steep squares do not count. Squares of a smooth
# surface differ much, because each holds a part of a wave; they are no imperfections.
DEVIATIONS = 4.0
# Largest share of all squares that are imperfections [1]. If there are more, they are the texture.
MOST_SQUARES = 0.05
MOST_HEIGHTS = 100_000
"""Largest number of heights of all imperfections of a population: its file holds them."""


@dataclass(frozen=True, eq=False)
class SeparatedMap:
    """A map whose imperfections are separated from its texture."""

    # heights without the imperfections, whose places are filled harmonically [um], shape (nx, ny)
    texture: Heights
    # heights of each imperfection above the texture [um], in a rectangle around it
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
        Largest number of heights of all imperfections together. If there are more, nothing is
        separated.

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
    """Return whether each node is in a square that is by far steeper than usual squares."""
    nowhere = np.zeros(heights.shape, dtype=bool)
    edges_x, edges_y = (_edges(nodes) for nodes in heights.shape)
    slopes = _rms_slopes(heights, spacing, edges_x, edges_y)
    if slopes.size < FEWEST_SQUARES:
        return nowhere
    median = float(np.median(slopes))
    if median == 0.0:
        return nowhere
    # distance of the upper quartile of normally distributed numbers from their median
    deviation = TO_DEVIATION * math.log(float(np.quantile(slopes, 0.75)) / median)
    factor = max(STEEPER, math.exp(DEVIATIONS * deviation))
    is_steep = slopes > factor * median
    if np.mean(is_steep) > MOST_SQUARES:
        return nowhere
    along_x = np.repeat(is_steep, np.diff(edges_x), axis=0)
    return np.repeat(along_x, np.diff(edges_y), axis=1)


def _edges(nodes: int) -> NDArray[np.int64]:
    """Return the first node of each square along an axis, and the number of nodes as the last."""
    squares = max(1, nodes // SQUARE)
    return np.linspace(0, nodes, squares + 1).astype(np.int64)


def _rms_slopes(
    heights: Heights,
    spacing: Sides,
    edges_x: NDArray[np.int64],
    edges_y: NDArray[np.int64],
) -> Values:
    """Return the rms slope in each square between the edges, shape (squares, squares) [1]."""
    dx, dy = spacing
    squared = np.zeros(heights.shape)
    squared[:-1] += (np.diff(heights, axis=0) / dx) ** 2
    squared[:, :-1] += (np.diff(heights, axis=1) / dy) ** 2
    sums = np.add.reduceat(squared, edges_x[:-1], axis=0)
    sums = np.add.reduceat(sums, edges_y[:-1], axis=1)
    return np.asarray(np.sqrt(sums / np.outer(np.diff(edges_x), np.diff(edges_y))))
