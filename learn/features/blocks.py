"""A surface in blocks: the mean heights for a coarse solve, and the roughness inside blocks.

The blocks are pressed as if each were smooth. What their means do not resolve is described by its
rms height and, for each block, by the rms slope inside it. From this slope and the pressure on a
block follows the share of it that is in contact, by Persson's theory.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from learn.arrays import Values

PERSSON = math.sqrt(2.0)
"""Persson's share of the area in contact is erf(sqrt(2) p / (E* h')), with the pressure p and the
rms slope h'."""


@dataclass(frozen=True, eq=False)
class Blocks:
    """The blocks of a surface.

    Attributes
    ----------
    heights : ndarray, shape (nx, ny)
        Heights of the nodes [um].
    steps : tuple of float
        Spacing of the nodes along x and y [um].
    most : int
        Largest number of blocks per side; with fewer nodes every node is a block.
    """

    heights: Values
    steps: tuple[float, float]
    most: int

    @cached_property
    def means(self) -> Values:
        """Mean height of each block, (bx, by) [um]."""
        return self._over_blocks(self.heights)

    @cached_property
    def roughness(self) -> float:
        """Rms of the heights that the means, interpolated to the nodes, do not resolve [um]."""
        return float(self._unresolved.std())

    @cached_property
    def slopes(self) -> Values:
        """Rms slope of these heights inside each block, (bx, by); 0 where it is one node [1]."""
        rest, (step_x, step_y) = self._unresolved, self.steps
        squares = _squares(rest, step_x) + _squares(rest.T, step_y).T
        return np.asarray(np.sqrt(self._over_blocks(squares)))

    def interpolated(self, values: Values) -> Values:
        """Interpolate from the blocks' centres to the nodes, (nx, ny), constant outside."""
        across, along = self._weights
        return np.asarray(across @ values @ along.T)

    def local_area(self, pressure: Values, factor: float) -> float:
        """Return the share of the nodes in contact by Persson's theory, inside each block.

        Parameters
        ----------
        pressure : ndarray, shape (bx, by)
            Mean pressure on each block, over E*.
        factor : float
            Multiple of these pressures that is taken.

        Returns
        -------
        float
            Share; blocks without slopes count in full where they are pressed.

        Source: B. N. J. Persson (2001), J. Chem. Phys. 115, 3840.
        """
        from scipy.special import erf

        pressed = pressure > 0
        with np.errstate(divide="ignore", over="ignore"):
            shares = erf(factor * PERSSON * pressure[pressed] / self.slopes[pressed])
        (_, sizes_x), (_, sizes_y) = self._along
        return float((np.outer(sizes_x, sizes_y)[pressed] * shares).sum()) / self.heights.size

    @cached_property
    def _unresolved(self) -> Values:
        """Heights less the interpolated means, (nx, ny) [um]."""
        return np.asarray(self.heights - self.interpolated(self.means))

    def _over_blocks(self, values: Values) -> Values:
        """Return means of nodes over each block, (bx, by)."""
        (rows, sizes_x), (columns, sizes_y) = self._along
        sums = np.add.reduceat(np.add.reduceat(values, rows, axis=0), columns, axis=1)
        return np.asarray(sums / np.outer(sizes_x, sizes_y))

    @cached_property
    def _along(self) -> list[tuple[NDArray[np.int64], NDArray[np.int64]]]:
        """First node and size of each block, along x and along y."""
        return [_blocks(nodes, self.most) for nodes in self.heights.shape]

    @cached_property
    def _weights(self) -> tuple[Values, Values]:
        """Weights of linear interpolation from blocks to nodes, along x and along y."""
        nx, ny = self.heights.shape
        return _interpolation(nx, self.most), _interpolation(ny, self.most)


def _blocks(nodes: int, most: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the first node and the size of each block along an axis."""
    blocks = min(nodes, most)
    edges = np.arange(blocks + 1) * nodes // blocks
    return edges[:-1], np.diff(edges)


def _interpolation(nodes: int, most: int) -> Values:
    """Return the weights of linear interpolation from blocks to nodes, (nodes, blocks)."""
    first, sizes = _blocks(nodes, most)
    centres = first + (sizes - 1) / 2
    unit = np.eye(centres.size)
    return np.stack([np.interp(np.arange(nodes), centres, each) for each in unit], axis=1)


def _squares(heights: Values, step: float) -> Values:
    """Return the squared slope along the first axis at each node, the mean of both sides of it."""
    between = (np.diff(heights, axis=0) / step) ** 2
    ends = np.concatenate([between[:1], between, between[-1:]])
    return np.asarray((ends[1:] + ends[:-1]) / 2)
