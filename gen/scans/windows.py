"""The draw of windows: which map, which tile of it, where in the tile, which way round.

A window follows from a surface's stream of random numbers and the shapes of the maps alone: no
height is needed to know where it lies.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gen.arrays import Heights, Values
from gen.scans.tiles import Tiling

DRAWS = 5
"""Random numbers of a window: map, tile, two for the place, symmetry."""

TRANSPOSED = 4
"""Symmetries from this number on swap the axes: they are those of the square alone."""


@dataclass(frozen=True)
class Window:
    """Place of a surface in the maps.

    Attributes
    ----------
    map : int
        Index of the map.
    tile : int
        Number of the tile, counted over all maps.
    corner : tuple of int
        First node along x and y, in the map.
    symmetry : int
        Symmetry of the rectangle, from 0 to 3, or of the square, to 7: 1 mirrors x, 2 mirrors y,
        4 swaps the axes thereafter.
    """

    map: int
    tile: int
    corner: tuple[int, int]
    symmetry: int


def drawn(random: np.random.Generator, tiling: Tiling, *, square: bool) -> Window:
    """Draw a window: all maps alike, all tiles of a map, all places in a tile, all symmetries.

    Parameters
    ----------
    random : numpy.random.Generator
        The surface's own stream; `DRAWS` numbers in [0, 1) are taken.
    tiling : Tiling
        Tiles of the maps.
    square : bool
        Whether the window has the eight symmetries of the square: as many nodes along x as along y,
        and equal spacings. Other windows have four.

    Returns
    -------
    Window
        Place of the window.
    """
    numbers = random.random(DRAWS)
    index = _among(numbers[0], len(tiling.shapes))
    place = _among(numbers[1], tiling.number(index))
    return _placed(numbers[2:], tiling, index, place, square=square)


def facing(random: np.random.Generator, tiling: Tiling, tiles: range, *, square: bool) -> Window:
    """Draw the window of a second body: all tiles that may face the first one alike.

    Parameters
    ----------
    random : numpy.random.Generator
        The second body's own stream; `DRAWS` numbers in [0, 1) are taken.
    tiling : Tiling
        Tiles of the maps of second bodies.
    tiles : range
        Numbers of the tiles that the window may lie in.
    square : bool
        See `drawn`.

    Returns
    -------
    Window
        Place of the window.
    """
    numbers = random.random(DRAWS)
    tile = tiles[_among(numbers[0], len(tiles))]
    index = tiling.map_of(tile)
    return _placed(numbers[2:], tiling, index, tile - tiling.first(index), square=square)


def _placed(numbers: Values, tiling: Tiling, index: int, place: int, *, square: bool) -> Window:
    """Turn three numbers in [0, 1) into a window of a tile: two for its place, one to turn it."""
    corner = [
        start + _among(number, stop - start - nodes + 1)
        for number, (start, stop), nodes in zip(
            numbers[:2], tiling.bounds(index, place), tiling.window, strict=True
        )
    ]
    symmetry = _among(numbers[2], 2 * TRANSPOSED if square else TRANSPOSED)
    return Window(index, tiling.first(index) + place, (corner[0], corner[1]), symmetry)


def cut(heights: Heights, window: Window, shape: tuple[int, int]) -> Heights:
    """Cut a window out of its map and turn it round.

    Parameters
    ----------
    heights : ndarray, shape (mx, my)
        Heights of the window's map [um].
    window : Window
        Place of the window.
    shape : tuple of int
        Nodes (nx, ny) of the window.

    Returns
    -------
    ndarray, shape (nx, ny)
        Heights above the lowest node of the window [um].
    """
    (x, y), (nx, ny) = window.corner, shape
    patch = turned(heights[x : x + nx, y : y + ny], window.symmetry)
    return np.ascontiguousarray(patch - patch.min())


def turned(patch: Heights, symmetry: int) -> Heights:
    """Apply a symmetry of `Window` to a patch; views of the same heights.

    Parameters
    ----------
    patch : ndarray, shape (nx, ny)
        Heights [um].
    symmetry : int
        Symmetry, from 0, which changes nothing, to 7.

    Returns
    -------
    ndarray, shape (nx, ny), or (ny, nx) if the axes are swapped
        The same heights [um].
    """
    if symmetry & 1:
        patch = patch[::-1]
    if symmetry & 2:
        patch = patch[:, ::-1]
    return patch.T if symmetry & TRANSPOSED else patch


def _among(number: float, count: int) -> int:
    """Turn a number in [0, 1) into one of 0, ..., count - 1."""
    return min(int(number * count), count - 1)
