"""Influence coefficients: the displacement of one cell under unit pressure on another.

Lengths are in units of the cell's first side and E* = 1, so that one table serves every scan
length and every material: a caller multiplies by spacing / E*.
"""

from functools import lru_cache
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

Kernel = Literal["uniform-pressure", "concentrated-force"]
KERNELS: tuple[Kernel, ...] = get_args(Kernel)

Nodes = NDArray[np.intp]
Real = NDArray[Any]  # of float64 or float32

# Distance in units of the cell's longer side -> Gauss-Legendre points a side that integrate
# 1/r over the cell to the last digit from there on (the error falls as (2 d)^(-2 points)).
QUADRATURE = ((3.0, 8), (16.0, 5), (128.0, 3))

# Boxes round what may touch come in many shapes. They are cut from square tables of 9 2^j or
# 12 2^j a side, of which the former hold 2^(j + 3) + 1 nodes and the circulant next to them: all
# boxes of these nodes a side, and larger ones unless the square has so many times their nodes.
ALWAYS_SHARED = 288
LARGEST_WASTE = 4

# Rows gathered at a time, whose places fit into the cache; and the largest grid for which the
# coefficients of all offsets, of either sign, are kept for that: their places take one subtraction.
ROWS = 64
MIRRORED_NODES = 2**20


def influence_coefficients(
    shape: tuple[int, int], kernel: Kernel = "uniform-pressure", aspect: float = 1.0
) -> NDArray[np.float64]:
    """Displacement at a cell's centre from unit pressure on the cell (i, j) away.

    Parameters
    ----------
    shape : (nx, ny) nodes of the grid
    kernel : "uniform-pressure", a constant pressure on a rectangular cell (Love 1929; Pohrt and
        Li 2014, eq. 12), or "concentrated-force", the point force asin(a/r)/(pi a) of MIRCO with
        a = half a cell, whose diagonal lacks a factor pi/2
    aspect : second side of a cell over its first side [1]

    Returns
    -------
    (nx, ny) displacement [first side of a cell x pressure / E*], read-only; the coefficient of
    the offset (-i, -j) is that of (i, j)

    Raises
    ------
    ValueError
        for an unknown kernel
    """
    side = _shared_side(max(shape))
    shared = side <= ALWAYS_SHARED or side * side <= LARGEST_WASTE * shape[0] * shape[1]
    table = _table((side, side) if shared else shape, kernel, aspect)
    return table[: shape[0], : shape[1]]


def _shared_side(nodes: int) -> int:
    """The smallest of 144, 192, 288, 384, 576, ... that holds so many nodes."""
    side = 144
    while side * 4 // 3 < nodes:
        side *= 2
    return side if nodes <= side else side * 4 // 3


@lru_cache(maxsize=8)
def _table(shape: tuple[int, int], kernel: Kernel, aspect: float) -> NDArray[np.float64]:
    rows, columns = np.ogrid[: shape[0], : shape[1]]
    if kernel == "uniform-pressure":
        table = _uniform_pressure(rows, columns, aspect)
    elif kernel == "concentrated-force":
        table = _concentrated_force(rows, columns, aspect)
    else:
        raise ValueError(f"kernel {kernel!r} is unknown: choose one of {', '.join(KERNELS)}")
    table.setflags(write=False)
    return table


def _uniform_pressure(
    rows: NDArray[np.int64], columns: NDArray[np.int64], aspect: float
) -> NDArray[np.float64]:
    """Closed form near the loaded cell, where it is exact; quadrature where it would cancel."""
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


def _closed_form(
    x: NDArray[np.float64], y: NDArray[np.float64], aspect: float
) -> NDArray[np.float64]:
    """Integral of 1/(pi r) over a cell of sides 1 and `aspect` at (x, y) (Love 1929)."""
    total = np.zeros_like(x)
    for sign_x in (1, -1):
        for sign_y in (1, -1):
            along, across = x + sign_x * 0.5, y + sign_y * 0.5 * aspect
            corner = along * np.arcsinh(across / np.abs(along))
            corner += across * np.arcsinh(along / np.abs(across))
            total += sign_x * sign_y * corner
    return total / np.pi


def _quadrature(
    x: NDArray[np.float64], y: NDArray[np.float64], aspect: float, points: int
) -> NDArray[np.float64]:
    """Integral of 1/(pi r) over the cell by Gauss and Legendre's rule, `points` a side."""
    nodes, weights = np.polynomial.legendre.leggauss(points)
    total = np.zeros_like(x)
    for node_x, weight_x in zip(nodes / 2, weights / 2, strict=True):
        square = (x + node_x) ** 2
        for node_y, weight_y in zip(nodes / 2, weights / 2, strict=True):
            total += (weight_x * weight_y) / np.sqrt(square + (y + aspect * node_y) ** 2)
    return total * (aspect / np.pi)


def _concentrated_force(
    rows: NDArray[np.int64], columns: NDArray[np.int64], aspect: float
) -> NDArray[np.float64]:
    """Point force per cell, u = F asin(a/r)/(pi a), F/(pi a) on the diagonal (MIRCO)."""
    radius = 0.5 * np.sqrt(aspect)  # half a cell; of a square of the same area where it is oblong
    distance = np.hypot(rows, columns * aspect)
    distance[0, 0] = radius
    table: NDArray[np.float64] = np.arcsin(radius / distance) * (aspect / (np.pi * radius))
    table[0, 0] = aspect / (np.pi * radius)
    return table


class InfluenceMatrix:
    """H between nodes of a grid, entry by entry.

    Parameters
    ----------
    shape, kernel, aspect : see `bem.influence.influence_coefficients`
    dtype : "float64" or "float32"

    Attributes
    ----------
    dtype : of the entries
    """

    def __init__(
        self, shape: tuple[int, int], kernel: Kernel, aspect: float, dtype: str = "float64"
    ) -> None:
        self.dtype = np.dtype(dtype)
        self._shape = shape
        self._mirrored = shape[0] * shape[1] <= MIRRORED_NODES
        self._coefficients = _coefficients(shape, kernel, aspect, dtype, self._mirrored)

    def between(self, nodes: Nodes, loaded: Nodes) -> Real:
        """(a,), (b,) flat indices -> (a, b) displacement of nodes from unit pressure on loaded."""
        found: Real = self._coefficients.take(self._offsets(nodes, loaded), mode="clip")
        return found

    def among(self, nodes: Nodes) -> Real:
        """(n,) flat indices -> (n, n) in Fortran's order; what is above the diagonal is not set."""
        n = len(nodes)
        matrix = np.empty((n, n), self.dtype)
        for first in range(0, n, ROWS):
            rows = slice(first, first + ROWS)
            offsets = self._offsets(nodes[rows], nodes[first:])
            np.take(self._coefficients, offsets, out=matrix[rows, first:], mode="clip")
        return matrix.T

    def _offsets(self, nodes: Nodes, loaded: Nodes) -> Nodes:
        """(a,), (b,) -> (a, b) where the coefficients of the offsets stand."""
        rows, columns = self._shape
        here, there = np.divmod(nodes, columns), np.divmod(loaded, columns)
        if self._mirrored:
            width = 2 * columns - 1
            centre = (rows - 1) * width + columns - 1
            places = here[0] * width + here[1], there[0] * width + there[1] - centre
            offsets: Nodes = np.subtract.outer(*places)
            return offsets
        offsets = np.abs(np.subtract.outer(here[0], there[0]))
        offsets *= columns
        offsets += np.abs(np.subtract.outer(here[1], there[1]))
        return offsets


@lru_cache(maxsize=4)
def _coefficients(
    shape: tuple[int, int], kernel: Kernel, aspect: float, dtype: str, mirrored: bool
) -> Real:
    """Flat coefficients of all offsets, or of those that are not negative."""
    table = influence_coefficients(shape, kernel, aspect).astype(dtype)
    if mirrored:
        table = np.concatenate([table[:0:-1], table])
        table = np.concatenate([table[:, :0:-1], table], axis=1)
    table.setflags(write=False)
    return table.reshape(-1)
