"""Windows of maps: tiles that share no node, and the draw of a window from one of them.

A window lies in one tile. Rows of one tile stay together in every split of a database, so that a
model is never tested on a node that it was trained on. A window follows from a surface's stream of
random numbers and the shapes of the maps alone: no height is needed to know where it lies.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate

import numpy as np

from gen.arrays import Heights, Values

Shape = tuple[int, int]

WIDE = 2  # side of a tile over that of the window, at least, where the map is large enough
# tiles along an axis that a map has at least, where it holds that many windows side by side
FEWEST = 2


@dataclass(frozen=True)
class Pairing:
    """Tiles of two sets of maps in groups: windows of two bodies always come from one group.

    Each tile is in one group, and each group has tiles of both sets, as evenly as they divide.
    Rows of one group stay together in a split, so that its parts share no node of either set.
    """

    # numbers of tiles of both sets
    first: int
    second: int

    @property
    def groups(self) -> int:
        """Number of groups."""
        return min(self.first, self.second)

    def group(self, tile: int) -> int:
        """Return the group of a tile of either set."""
        return tile % self.groups

    def partners(self, tile: int) -> range:
        """Return the tiles of the second set that may face a tile of the first one."""
        return range(self.group(tile), self.second, self.groups)


@dataclass(frozen=True)
class Tiling:
    """The tiles of several maps for windows of one shape."""

    shapes: tuple[Shape, ...]  # nodes of each map along x and y
    window: Shape  # nodes of a window along x and y

    def __post_init__(self) -> None:
        """Refuse maps that hold no window; `gen.maps.library` says which in words."""
        for shape in self.shapes:
            if any(nodes < least for nodes, least in zip(shape, self.window, strict=True)):
                raise ValueError(f"a map of {shape} nodes holds no window of {self.window}")

    @cached_property
    def _starts(self) -> tuple[int, ...]:
        """Numbers of tiles before each map, and of all tiles at the end."""
        numbers = (self.number(index) for index in range(len(self.shapes)))
        return tuple(accumulate(numbers, initial=0))

    @property
    def total(self) -> int:
        """Number of tiles of all maps."""
        return self._starts[-1]

    def counts(self, index: int) -> Shape:
        """Return the numbers of tiles of a map along x and y.

        A tile is at least twice as wide as the window if that leaves two tiles. A smaller map has
        two narrower ones, so that one can train and the other test, and a map that does not hold
        two windows side by side is one tile.
        """
        along_x, along_y = (
            max(nodes // (WIDE * width), min(FEWEST, nodes // width))
            for nodes, width in zip(self.shapes[index], self.window, strict=True)
        )
        return along_x, along_y

    def number(self, index: int) -> int:
        """Return the number of tiles of a map."""
        return math.prod(self.counts(index))

    def first(self, index: int) -> int:
        """Return the number of a map's first tile: that of all tiles of the maps before it."""
        return self._starts[index]

    def map_of(self, tile: int) -> int:
        """Return the index of the map that a tile belongs to, by its number among all tiles."""
        return bisect_right(self._starts, tile) - 1

    def bounds(self, index: int, place: int) -> tuple[Shape, Shape]:
        """Return the nodes of a tile: first and one past the last along x, and along y."""
        counts = self.counts(index)
        nx, ny = self.shapes[index]
        along_x, along_y = divmod(place, counts[1])
        return (
            (along_x * nx // counts[0], (along_x + 1) * nx // counts[0]),
            (along_y * ny // counts[1], (along_y + 1) * ny // counts[1]),
        )


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
    place = _among(numbers[1], tiling.number(index))
    return _placed(numbers[2:], tiling, index, place, square=square)


def facing(random: np.random.Generator, tiling: Tiling, tiles: range, *, square: bool) -> Window:
    """Draw the window of a second body: all tiles that may face the first one alike."""
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
