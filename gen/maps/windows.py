"""Windows of maps: tiles that share no node, and the draw of a window from one of them.

A window lies in one tile. Rows of one tile stay together in every split of a database, so that a
model is never tested on a node that it was trained on. A window follows from a surface's stream of
random numbers and the shapes of the maps alone: no height is needed to know where it lies.
"""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate
from typing import NamedTuple

import numpy as np

from gen.arrays import Heights, Values

Shape = tuple[int, int]

WIDE = 2  # side of a tile over that of the window, at least, where the map is large enough
# tiles along an axis that a map has at least, where it holds that many windows side by side
FEWEST = 2


class Tile(NamedTuple):
    """A piece of a map: the nodes from the first to one past the last, along x and along y."""

    map: int  # index of the map
    x: Shape
    y: Shape


@dataclass(frozen=True)
class Tiling:
    """The tiles of several maps for windows of one shape."""

    shapes: tuple[Shape, ...]  # nodes of each map along x and y
    window: Shape  # nodes of a window along x and y

    @cached_property
    def tiles(self) -> list[list[Tile]]:
        """The tiles of each map."""
        return [
            [
                Tile(number, x, y)
                for x in _cut(shape[0], self.window[0])
                for y in _cut(shape[1], self.window[1])
            ]
            for number, shape in enumerate(self.shapes)
        ]

    @cached_property
    def starts(self) -> list[int]:
        """Number of each map's first tile, and that of all tiles at the end."""
        return list(accumulate(map(len, self.tiles), initial=0))

    @property
    def total(self) -> int:
        """Number of tiles of all maps."""
        return self.starts[-1]


def _cut(nodes: int, width: int) -> list[Shape]:
    """Cut an axis into tiles at least twice as wide as a window if that leaves two of them.

    A shorter axis has two narrower ones, so that one can train and the other test, and one that
    does not hold two windows side by side is one tile.
    """
    if nodes < width:  # `gen.maps.library` says it in words
        raise ValueError(f"an axis of {nodes} nodes holds no window of {width}")
    count = max(nodes // (WIDE * width), min(FEWEST, nodes // width))
    return [(place * nodes // count, (place + 1) * nodes // count) for place in range(count)]


DRAWS = 5  # random numbers of a window: map, tile, two for the place, symmetry
TRANSPOSED = 4  # symmetries from this number on swap the axes: they are those of the square alone


@dataclass(frozen=True)
class Window:
    """Place of a surface in the maps."""

    map: int  # index of the map
    tile: int  # number of the tile, counted over all maps
    corner: tuple[int, int]  # first node along x and y, in the map
    # symmetry of the rectangle, from 0 to 3, or of the square, to 7: 1 mirrors x, 2 mirrors y, 4
    # swaps the axes thereafter
    symmetry: int


def drawn(random: np.random.Generator, tiling: Tiling, *, square: bool) -> Window:
    """Draw a window: all maps alike, all tiles of a map, all places in a tile, all symmetries."""
    numbers = random.random(DRAWS)
    index = _among(numbers[0], len(tiling.shapes))
    place = _among(numbers[1], len(tiling.tiles[index]))
    return _placed(numbers[2:], tiling, tiling.starts[index] + place, square=square)


def facing(random: np.random.Generator, tiling: Tiling, tiles: range, *, square: bool) -> Window:
    """Draw the window of a second body: all tiles that may face the first one alike."""
    numbers = random.random(DRAWS)
    return _placed(numbers[2:], tiling, tiles[_among(numbers[0], len(tiles))], square=square)


def _placed(numbers: Values, tiling: Tiling, tile: int, *, square: bool) -> Window:
    """Turn three numbers in [0, 1) into a window of a tile: two for its place, one to turn it."""
    index = bisect_right(tiling.starts, tile) - 1
    _, *ends = tiling.tiles[index][tile - tiling.starts[index]]
    x, y = (
        start + _among(number, stop - start - nodes + 1)
        for number, (start, stop), nodes in zip(numbers[:2], ends, tiling.window, strict=True)
    )
    symmetry = _among(numbers[2], 2 * TRANSPOSED if square else TRANSPOSED)
    return Window(index, tile, (x, y), symmetry)


def cut(heights: Heights, window: Window, shape: tuple[int, int]) -> Heights:
    """Cut a window out of its map and turn it round."""
    (x, y), (nx, ny) = window.corner, shape
    patch = turned(heights[x : x + nx, y : y + ny], window.symmetry)
    return np.ascontiguousarray(patch - patch.min())


def turned(patch: Heights, symmetry: int) -> Heights:
    """Apply a symmetry of `Window` to a patch; views of the same heights."""
    patch = patch[:: -1 if symmetry & 1 else 1, :: -1 if symmetry & 2 else 1]
    return patch.T if symmetry & TRANSPOSED else patch


def _among(number: float, count: int) -> int:
    """Turn a number in [0, 1) into one of 0, ..., count - 1."""
    return min(int(number * count), count - 1)
