"""Influence coefficients: the displacement of one cell under unit pressure on another.

Lengths are in units of the cell's first side and E* = 1, so that one table serves every scan
length and every material: a caller multiplies by spacing / E*.
"""

import math
from functools import lru_cache
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from bem.arrays import Field, Nodes, Real, Values
from bem.threads import share

Kernel = Literal["uniform-pressure", "concentrated-force"]
KERNELS: tuple[Kernel, ...] = get_args(Kernel)

# Pairs of a distance, in units of the cell's longer side, and the Gauss-Legendre points a side that
# integrate 1/r over the cell to the last digit from there on: the error falls as (2 d)^(-2 points).
QUADRATURE = ((3.0, 8), (16.0, 5), (128.0, 3))

# Longest side of a square table that boxes of any shape are cut from. The boxes of nodes that may
# touch come in many shapes, and such a table serves all of them at little cost.
ALWAYS_SHARED = 288

# Largest ratio of the nodes of a square table to those of a box cut from it, for longer sides:
# above it a table of the box's own shape is cheaper.
LARGEST_WASTE = 4

# Entries of a table from which on none is kept, because the filters made of it are.
LARGE = 2**20

# Rows of a matrix gathered at a time: their indices fit into the cache.
ROWS = 64

# Largest grid for which the coefficients of offsets of either sign are tabulated: an index then
# takes a single subtraction, and the table four times the memory.
MIRRORED_NODES = 2**20

# Largest grid of which many such tables are kept: boxes of one grid have many shapes.
FEW_NODES = 2**15


def influence_coefficients(
    shape: tuple[int, int], kernel: Kernel = "uniform-pressure", aspect: float = 1.0
) -> Field:
    """Compute the displacement at a cell's centre by unit pressure on the cell (i, j) away.

    Parameters
    ----------
    shape : tuple of int
        Nodes (nx, ny) of the grid.
    kernel : str
        "uniform-pressure", a constant pressure on a rectangular cell (Love 1929; Pohrt and Li
        2014, eq. 12), or "concentrated-force", the point force asin(a/r)/(pi a) of MIRCO with
        a = half a cell, whose diagonal lacks a factor pi/2.
    aspect : float
        Second side of a cell over its first side [1].

    Returns
    -------
    ndarray, shape (nx, ny)
        Displacement, read-only [first side of a cell x pressure / E*]. The offset (-i, -j) has the
        coefficient of (i, j).

    Raises
    ------
    ValueError
        If the kernel is unknown.
    """
    side = _shared_side(max(shape))
    shared = side <= ALWAYS_SHARED or side * side <= LARGEST_WASTE * shape[0] * shape[1]
    whole = (side, side) if shared and side * side < LARGE else shape
    tabulate = _table if math.prod(whole) < LARGE else _table.__wrapped__
    return tabulate(whole, kernel, aspect)[: shape[0], : shape[1]]


def _shared_side(nodes: int) -> int:
    """Return the smallest of the sides 144, 192, 288, 384, 576, ... that holds the nodes.

    Every second of them, 9 2^j, holds a box of 2^(j + 3) + 1 nodes a side and its circulant.
    """
    side = 144
    while side * 4 // 3 < nodes:
        side *= 2
    return side if nodes <= side else side * 4 // 3


@lru_cache(maxsize=8)
def _table(shape: tuple[int, int], kernel: Kernel, aspect: float) -> Field:
    """Compute the coefficients of all offsets (i, j) with i, j >= 0 on a grid of a shape."""
    rows, columns = np.ogrid[: shape[0], : shape[1]]
    if kernel == "uniform-pressure":
        table = np.empty(shape)

        def tabulate(_: int, some: slice) -> None:
            table[some] = _uniform_pressure(rows[some], columns, aspect)

        slices = [slice(first, first + ROWS) for first in range(0, shape[0], ROWS)]
        share(tabulate, slices)
    elif kernel == "concentrated-force":
        table = _concentrated_force(rows, columns, aspect)
    else:
        raise ValueError(
            f"kernel {kernel!r} is unknown: choose one of {', '.join(KERNELS)}"
        )
    table.setflags(write=False)
    return table


def _uniform_pressure(
    rows: NDArray[np.int64], columns: NDArray[np.int64], aspect: float
) -> Field:
    """Use the closed form near the loaded cell, and quadrature where its terms would cancel."""
    if aspect == 1.0:  # sorted offsets make the table symmetric to the last bit
        x, y = np.maximum(rows, columns) * 1.0, np.minimum(rows, columns) * 1.0
    else:
        x, y = np.broadcast_arrays(rows * 1.0, columns * aspect)
    distance = np.hypot(x, y) / max(1.0, aspect)
    table = np.empty(x.shape)
    near = distance < QUADRATURE[0][0]
    table[near] = _closed_form(x[near], y[near], aspect)
    limits = [start for start, _ in QUADRATURE[1:]] + [np.inf]
    for (start, points), stop in zip(QUADRATURE, limits, strict=True):
        zone = (distance >= start) & (distance < stop)
        table[zone] = _quadrature(x[zone], y[zone], aspect, points)
    return table


def _closed_form(x: Values, y: Values, aspect: float) -> Values:
    """Integrate 1/(pi r) over a cell of sides 1 and `aspect` at (x, y) (Love 1929)."""
    total = np.zeros_like(x)
    for sign_x in (1, -1):
        for sign_y in (1, -1):
            along, across = x + sign_x * 0.5, y + sign_y * 0.5 * aspect
            corner = along * np.arcsinh(across / np.abs(along))
            corner += across * np.arcsinh(along / np.abs(across))
            total += sign_x * sign_y * corner
    return total / np.pi


def _quadrature(x: Values, y: Values, aspect: float, points: int) -> Values:
    """Integrate 1/(pi r) over the cell by the Gauss-Legendre rule, with `points` a side."""
    nodes, weights = np.polynomial.legendre.leggauss(points)
    total = np.zeros_like(x)
    for node_x, weight_x in zip(nodes / 2, weights / 2, strict=True):
        square = (x + node_x) ** 2
        for node_y, weight_y in zip(nodes / 2, weights / 2, strict=True):
            total += (weight_x * weight_y) / np.sqrt(square + (y + aspect * node_y) ** 2)
    return total * (aspect / np.pi)


def _concentrated_force(
    rows: NDArray[np.int64], columns: NDArray[np.int64], aspect: float
) -> Field:
    """Compute u = F asin(a/r)/(pi a) of a point force a cell, F/(pi a) on the diagonal (MIRCO)."""
    radius = 0.5 * np.sqrt(
        aspect
    )  # half a cell, or half of a square of the same area if the cell is oblong
    distance = np.hypot(rows, columns * aspect)
    distance[0, 0] = radius
    table: Field = np.arcsin(radius / distance) * (aspect / (np.pi * radius))
    table[0, 0] = aspect / (np.pi * radius)
    return table


class InfluenceMatrix:
    """The influence matrix H between nodes of a grid, entry by entry.

    Parameters
    ----------
    shape : tuple of int
        Nodes (nx, ny) of the grid.
    kernel : str
        Influence coefficients, see `influence_coefficients`.
    aspect : float
        Second side of a cell over its first side [1].
    dtype : str
        Precision of the entries, "float64" or "float32".

    Attributes
    ----------
    dtype : numpy.dtype
        Precision of the entries.
    """

    def __init__(
        self,
        shape: tuple[int, int],
        kernel: Kernel,
        aspect: float,
        dtype: str = "float64",
    ) -> None:
        self.dtype = np.dtype(dtype)
        self._shape = shape
        self._mirrored = shape[0] * shape[1] <= MIRRORED_NODES
        tabulated = (
            _few_coefficients if shape[0] * shape[1] <= FEW_NODES else _coefficients
        )
        self._coefficients = tabulated(shape, kernel, aspect, dtype, self._mirrored)

    def between(self, nodes: Nodes, loaded: Nodes) -> Real:
        """Return the (a, b) displacements of (a,) nodes by unit pressure on (b,) loaded nodes."""
        entries: Real = self._coefficients.take(self._offsets(nodes, loaded), mode="clip")
        return entries

    def among(self, nodes: Nodes, give: float = 0.0) -> Real:
        """Return the lower triangle of the (n, n) matrix of (n,) nodes, in Fortran's order.

        Parameters
        ----------
        nodes : ndarray, shape (n,)
            Flat indices of the nodes.
        give : float
            How far the far field gives way under a unit load, which is taken off every entry.
        """
        n = len(nodes)
        matrix = np.empty((n, n), self.dtype)
        for first in range(0, n, ROWS):
            rows = slice(first, first + ROWS)
            offsets = self._offsets(nodes[rows], nodes[first:])
            np.take(self._coefficients, offsets, out=matrix[rows, first:], mode="clip")
            if give:
                matrix[rows, first:] -= self.dtype.type(give)
        return matrix.T

    def _offsets(self, nodes: Nodes, loaded: Nodes) -> Nodes:
        """Return the (a, b) indices into the table for the offsets of (a,) from (b,) nodes."""
        rows, columns = self._shape
        if self._mirrored:
            beyond = columns - 1  # columns of the table, less those of the grid
            centre = (rows - 1) * (columns + beyond) + beyond
            here, there = (some // columns * beyond + some for some in (nodes, loaded))
            mirrored: Nodes = np.subtract.outer(here, there - centre)
            return mirrored
        along, across = zip(
            np.divmod(nodes, columns), np.divmod(loaded, columns), strict=True
        )
        offsets: Nodes = np.abs(np.subtract.outer(*along))
        offsets *= columns
        offsets += np.abs(np.subtract.outer(*across))
        return offsets


@lru_cache(maxsize=4)
def _coefficients(
    shape: tuple[int, int], kernel: Kernel, aspect: float, dtype: str, mirrored: bool
) -> Real:
    """Return the flat table of coefficients, for offsets of either sign if `mirrored`."""
    table = influence_coefficients(shape, kernel, aspect).astype(dtype)
    if mirrored:
        table = np.concatenate([table[:0:-1], table])
        table = np.concatenate([table[:, :0:-1], table], axis=1)
    table.setflags(write=False)
    return table.reshape(-1)


@lru_cache(maxsize=32)
def _few_coefficients(
    shape: tuple[int, int], kernel: Kernel, aspect: float, dtype: str, mirrored: bool
) -> Real:
    """Return the table of a small grid, of which many are kept."""
    return _coefficients.__wrapped__(shape, kernel, aspect, dtype, mirrored)
