"""Tiles of maps: a window lies in one tile, and no two tiles share a node.

Rows of one tile stay together in every split of a database, so that a model is never tested on a
node that it was trained on.
"""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate

Shape = tuple[int, int]

WIDE = 2
"""Side of a tile over that of the window, at least, where the map is large enough."""

FEWEST = 2
"""Tiles along an axis that a map has at least, where it holds that many windows side by side."""


def tiles_along(nodes: int, window: int) -> int:
    """Return the number of tiles of a map along one axis.

    A tile is at least twice as wide as the window if that leaves two tiles. A smaller map has
    two narrower ones, so that one can train and the other test, and a map that does not hold two
    windows side by side is one tile.

    Parameters
    ----------
    nodes : int
        Nodes of the map along the axis, at least those of the window.
    window : int
        Nodes of the window along the axis.
    """
    return max(nodes // (WIDE * window), min(FEWEST, nodes // window))


@dataclass(frozen=True)
class Pairing:
    """Tiles of two sets of maps in groups: windows of two bodies always come from one group.

    Each tile is in one group, and each group has tiles of both sets, as evenly as they divide. Rows
    of one group stay together in a split, so that its parts share no node of either set.

    Attributes
    ----------
    first, second : int
        Numbers of tiles of both sets.
    """

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
    """The tiles of several maps for windows of one shape.

    Attributes
    ----------
    shapes : tuple of (int, int)
        Nodes of each map along x and y.
    window : tuple of int
        Nodes of a window along x and y.
    """

    shapes: tuple[Shape, ...]
    window: Shape

    def __post_init__(self) -> None:
        """Refuse maps that hold no window; `gen.scans.library` says which in words."""
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
        """Return the numbers of tiles of a map along x and y."""
        (nx, ny), (wx, wy) = self.shapes[index], self.window
        return tiles_along(nx, wx), tiles_along(ny, wy)

    def number(self, index: int) -> int:
        """Return the number of tiles of a map."""
        along_x, along_y = self.counts(index)
        return along_x * along_y

    def first(self, index: int) -> int:
        """Return the number of a map's first tile: that of all tiles of the maps before it."""
        return self._starts[index]

    def map_of(self, tile: int) -> int:
        """Return the index of the map that a tile belongs to, by its number among all tiles."""
        return bisect_right(self._starts, tile) - 1

    def bounds(self, index: int, place: int) -> tuple[Shape, Shape]:
        """Return the nodes of a tile: first and one past the last along x, and along y.

        Parameters
        ----------
        index : int
            Index of the map.
        place : int
            Number of the tile among those of the map, ascending along y first.
        """
        counts = self.counts(index)
        nx, ny = self.shapes[index]
        along_x, along_y = divmod(place, counts[1])
        return (
            (along_x * nx // counts[0], (along_x + 1) * nx // counts[0]),
            (along_y * ny // counts[1], (along_y + 1) * ny // counts[1]),
        )
