"""Influence coefficients: the displacement of one cell under unit pressure or traction on another.

Lengths are in units of the cell's first side, and E* = 1. One table therefore serves every scan
length and every material: a caller multiplies by spacing / E*.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from bem.arrays import Field, Mask, Nodes, Real, Values
from bem.bodies import HALF_SPACE, Body
from bem.threads import share

# Pairs (d, points): from the distance d from the loaded cell [longer side of the cell], up to that
# of the next pair, `points` Gauss-Legendre points along each side of the cell integrate 1/r over
# the cell to the last digit. The error falls as (2 d)^(-2 points). Below the first distance the
# closed form is used.
QUADRATURE = ((3.0, 8), (16.0, 5), (128.0, 3))

# Difference of a body's relative compliance from 1 that is neglected [1].
RESOLVED = 1e-13

# Product of a wave number q and the depth h of a layer at which exp(-2 q h), by which the relative
# compliance differs from 1, is about `RESOLVED` [1].
DECAYED = 15.0

# Wave numbers between which the difference has to fall to `RESOLVED` [1 / first side of a cell].
SMALLEST_WAVE_NUMBER = 1e-9
LARGEST_WAVE_NUMBER = 100.0

# Rings around the loaded cell: the distance at which each ends [longer side of a cell], and the
# Gauss-Legendre points along each side of the cell, for layers of the size of the cell.
DEPTH_RINGS = ((3.0, 8), (8.0, 6), (64.0, 4), (math.inf, 3))

# Distance up to which thinner layers need more of these points [longer side of a cell].
FAR = 8.0

# Most points along a side of the cell.
MOST_POINTS = 48

# Gauss-Legendre points of a panel of wave numbers.
PANEL_POINTS = 16

# Most half waves of the Bessel function in a panel.
WAVES_OF_PANEL = 4.0

# Points of the table of displacements for each factor e in distance.
TABLE_POINTS = 160

# Longest side of a square table that serves grids of all shapes that fit into it [nodes]. The boxes
# of nodes that may touch have many shapes, and one table for all of them costs little.
ALWAYS_SHARED = 288

# Largest ratio of a longer square table's entries to the grid's nodes for which the table is shared
# [1]. Above it a table of the grid's own shape is cheaper.
LARGEST_WASTE = 4

# Least number of entries of a table that is not kept for later calls. The filters made from it are
# kept instead.
LARGE = 2**20

# Rows of a matrix or table that are computed at a time: their indices fit into the cache.
ROWS = 64

# Largest number of nodes of a grid for which `InfluenceMatrix` tabulates offsets of either sign. An
# index then needs one subtraction instead of three operations, and the table four times the memory.
MIRRORED_NODES = 2**20

# Largest number of nodes of a grid for which 32 tables of `InfluenceMatrix` are kept instead of 4,
# because boxes of nodes within one grid have many shapes.
FEW_NODES = 2**15


def influence_coefficients(
    shape: tuple[int, int], body: Body = HALF_SPACE, aspect: float = 1.0
) -> Field:
    """Compute the displacement at a cell's centre by unit pressure on a cell i and j cells away.

    Parameters
    ----------
    shape : tuple of int
        Nodes (nx, ny) of the grid.
    body : Body
        Reduced body, see `Body.reduced`. The pressure of a node is spread by its `kernel`.
        "uniform-pressure": a constant pressure on a rectangular cell (Love 1929; Pohrt and Li
        2014, eq. 12). "concentrated-force": MIRCO's displacement asin(a/r)/(pi a) by a point force,
        with a = half a cell, whose diagonal lacks a factor pi/2.
    aspect : float
        Second side of a cell over its first side; from 1/4 to 4 for "concentrated-force" [1].

    Returns
    -------
    ndarray, shape (nx, ny)
        Displacement for the offsets i and j from 0 [first side of a cell x pressure / E*]. The
        offsets (-i, j), (i, -j) and (-i, -j) have the coefficient of (i, j). The array is
        read-only, and may be a part of a table that later calls share.
    """
    side = _shared_side(max(shape))
    entries = side * side
    wastes_little = entries <= LARGEST_WASTE * shape[0] * shape[1]
    tabulated = shape
    may_share = entries < LARGE and (side <= ALWAYS_SHARED or wastes_little)
    if may_share and body.is_homogeneous:  # other bodies share a table over the distance
        tabulated = side, side
    if math.prod(tabulated) < LARGE:
        table = _kept_table(tabulated, body, aspect)
    else:
        table = _table(tabulated, body, aspect)
    return table[: shape[0], : shape[1]]


def shear_coefficients(
    shape: tuple[int, int], aspect: float, poisson: float, axis: int
) -> Field:
    """Compute the displacement along an axis by unit traction along it, i and j cells away.

    The cells are those of two half-spaces of like elastic constants, see
    `bem.operators.displacement`.

    Parameters
    ----------
    shape : tuple of int
        Nodes (nx, ny) of the grid.
    aspect : float
        Second side of a cell over its first side [1].
    poisson : float
        Poisson's ratio nu of both bodies, above -1 and at most 0.5 [1].
    axis : int
        0 for traction and displacement along x, 1 for those along y.

    Returns
    -------
    ndarray, shape (nx, ny)
        Displacement at the cell's centre for the offsets i and j from 0, which those of either sign
        have too [first side of a cell x traction / E*].
    """
    cerruti = _PointForce(excess=poisson / (1 - poisson), axis=axis)
    return _uniform_load(shape, aspect, cerruti)


@dataclass(frozen=True)
class _PointForce:
    """Displacement of a half-space by a point force at the distance r, with E* = 1.

    It is (1 + excess x^2 / r^2) / (pi r), with x along an axis: that of a normal force without
    excess (Boussinesq), and that along a tangential force with the excess nu / (1 - nu) (Cerruti).

    Attributes
    ----------
    excess : float
        Displacement along the axis over that across it, less 1 [1].
    axis : int
        0 for x, 1 for y; it makes no difference without excess.
    """

    excess: float = 0.0
    axis: int = 0

    @property
    def factors(self) -> tuple[float, float]:
        """Factors of the terms of a cell's closed form that belong to its sides along x and y [1].

        The integral of 1 / r has two terms with factors 1. The excess belongs to the term of the
        other axis.
        """
        if self.axis == 0:
            return 1.0, 1 + self.excess
        return 1 + self.excess, 1.0


def _shared_side(nodes: int) -> int:
    """Return the smallest side of a shared table with room for `nodes` nodes along an axis.

    The sides are 144, 192, 288, 384, 576 and so on. Every second one, 9 2^j, has room for a grid of
    2^(j + 3) + 1 nodes a side and for the circulant that approximates its matrix.
    """
    side = 144
    while side * 4 // 3 < nodes:
        side *= 2
    return side if nodes <= side else side * 4 // 3


@lru_cache(maxsize=8)
def _kept_table(shape: tuple[int, int], body: Body, aspect: float) -> Field:
    """Return the result of `_table`, and keep it for later calls."""
    return _table(shape, body, aspect)


def _table(shape: tuple[int, int], body: Body, aspect: float) -> Field:
    """Compute the coefficients of all offsets (i, j) with i, j >= 0 within a grid, read-only."""
    if body.kernel == "uniform-pressure":
        table = _uniform_load(shape, aspect, _PointForce())
        if not body.is_homogeneous:
            table += _below_surface(shape, body, aspect)
    else:
        rows, columns = np.ogrid[: shape[0], : shape[1]]
        table = _concentrated_force(rows, columns, aspect)
    table.setflags(write=False)
    return table


def _uniform_load(shape: tuple[int, int], aspect: float, force: _PointForce) -> Field:
    """Compute the coefficients of a uniform load on a cell for all offsets, (nx, ny), from 0.

    Threads share the rows.
    """
    rows, columns = np.ogrid[: shape[0], : shape[1]]
    table = np.empty(shape)

    def tabulate(_thread: int, band: slice) -> None:
        table[band] = _uniform_load_at(rows[band], columns, aspect, force)

    bands = [slice(first, first + ROWS) for first in range(0, shape[0], ROWS)]
    share(tabulate, bands)
    return table


def _uniform_load_at(
    rows: NDArray[np.int64],
    columns: NDArray[np.int64],
    aspect: float,
    force: _PointForce,
) -> Field:
    """Compute the (m, n) coefficients of a uniform load on a cell for some offsets.

    `rows`, (m, 1), are the offsets along the first axis and `columns`, (1, n), along the second
    [cells]. Near the loaded cell the closed form is used. Farther away its terms would cancel, so
    that quadrature is used.
    """
    if aspect == 1.0 and not force.excess:
        # Sorted offsets make the table symmetric to the last bit.
        x = np.maximum(rows, columns) * 1.0
        y = np.minimum(rows, columns) * 1.0
    else:
        x, y = np.broadcast_arrays(rows * 1.0, columns * aspect)
    distance = np.hypot(x, y) / max(1.0, aspect)
    table = np.empty(x.shape)
    nearest = QUADRATURE[0][0]
    near = distance < nearest
    table[near] = _closed_form(x[near], y[near], aspect, force)
    stops = [start for start, _ in QUADRATURE[1:]] + [np.inf]
    for (start, points), stop in zip(QUADRATURE, stops, strict=True):
        zone = (distance >= start) & (distance < stop)
        table[zone] = _quadrature(x[zone], y[zone], aspect, force, points)
    return table


def _closed_form(x: Values, y: Values, aspect: float, force: _PointForce) -> Values:
    """Integrate the displacement by point forces over a cell of sides 1 and `aspect` at (x, y).

    The integral is a sum over the cell's corners (Love 1929).
    """
    of_along, of_across = force.factors
    total = np.zeros_like(x)
    for sign_x in (1, -1):
        for sign_y in (1, -1):
            along = x + sign_x * 0.5
            across = y + sign_y * 0.5 * aspect
            corner = of_along * along * np.arcsinh(across / np.abs(along))
            corner += of_across * across * np.arcsinh(along / np.abs(across))
            total += sign_x * sign_y * corner
    return total / np.pi


def _quadrature(
    x: Values, y: Values, aspect: float, force: _PointForce, points: int
) -> Values:
    """Integrate the displacement by point forces over a cell of sides 1 and `aspect` at (x, y).

    The Gauss-Legendre rule has `points` points along each side.
    """
    nodes, weights = np.polynomial.legendre.leggauss(points)
    total = np.zeros_like(x)
    for node_x, weight_x in zip(nodes / 2, weights / 2, strict=True):
        square_along = (x + node_x) ** 2
        for node_y, weight_y in zip(nodes / 2, weights / 2, strict=True):
            square_across = (y + aspect * node_y) ** 2
            square = square_along + square_across
            strength: float | Values = weight_x * weight_y
            if force.excess:
                in_line = (square_along, square_across)[force.axis]
                strength = strength * (1 + force.excess * in_line / square)
            total += strength / np.sqrt(square)
    return total * (aspect / np.pi)


def _below_surface(shape: tuple[int, int], body: Body, aspect: float) -> Field:
    """Compute what a body's depth adds to the coefficients of its surface's material, (nx, ny).

    A unit force displaces a layered body by 1 / (pi r), as a half-space of the material at its
    surface, plus

        G(r) = 1 / pi * integral over q of (C(q) / C_surface(q) - 1) J0(q r)

    whose integrand is finite at q = 0, and decays as exp(-2 q h) over a layer of depth h. G is
    smooth: it is tabulated over r, interpolated, and averaged over the loaded cell by
    Gauss-Legendre points. `body` is reduced.
    """
    farthest = math.hypot(shape[0] + 1, (shape[1] + 1) * aspect)
    depth = DECAYED / largest_wave_number(body)  # the length on which G changes
    # A power of two, so that grids of similar sizes share a table.
    octaves = max(math.ceil(math.log2(farthest)), 4)
    displacement = _tabulated_depth(body, 2.0**octaves, depth)
    rows, columns = np.ogrid[: shape[0], : shape[1]]
    table = np.zeros(shape)
    for zone, points in _zones_of_depth(shape, aspect, depth):
        x = np.broadcast_to(rows, shape)[zone] * 1.0
        y = np.broadcast_to(columns, shape)[zone] * aspect
        nodes, weights = np.polynomial.legendre.leggauss(points)
        total = np.zeros_like(x)
        for node_x, weight_x in zip(nodes / 2, weights / 2, strict=True):
            for node_y, weight_y in zip(nodes / 2, weights / 2, strict=True):
                distance = np.hypot(x + node_x, y + aspect * node_y)
                total += weight_x * weight_y * displacement(distance)
        table[zone] = total * aspect
    return table


def largest_wave_number(body: Body) -> float:
    """Return a wave number above which a body is as compliant as the material at its surface.

    Parameters
    ----------
    body : Body
        Reduced body that is not homogeneous.

    Returns
    -------
    float
        Wave number, inf if it is above `LARGEST_WAVE_NUMBER` [1 / first side of a cell].
    """
    wave_number = SMALLEST_WAVE_NUMBER
    while wave_number <= LARGEST_WAVE_NUMBER:
        relative = np.ravel(body.relative_compliance(np.array([wave_number])))
        if abs(float(relative[0]) - 1) < RESOLVED:
            return wave_number
        wave_number *= 2**0.25
    return math.inf


def _zones_of_depth(
    shape: tuple[int, int], aspect: float, depth: float
) -> Iterator[tuple[Mask, int]]:
    """Yield masks of the offsets in rings around the loaded cell, and the points for each.

    The points are those of a Gauss-Legendre rule along each side of the cell. `depth` is the length
    on which G of `_below_surface` changes [first side of a cell].
    """
    rows, columns = np.ogrid[: shape[0], : shape[1]]
    distance = np.hypot(rows, columns * aspect) / max(1.0, aspect)
    start = 0.0
    for stop, least_points in DEPTH_RINGS:
        points = least_points
        if stop <= FAR:  # farther away G is that of a point force
            points = math.ceil(points * max(1.0, max(1.0, aspect) / depth))
        yield (distance >= start) & (distance < stop), min(points, MOST_POINTS)
        start = stop


@lru_cache(maxsize=8)
def _tabulated_depth(body: Body, farthest: float, depth: float) -> Callable[[Real], Real]:
    """Return the function G of `_below_surface` up to a distance, from a table.

    `depth` is the length on which G changes. Lengths are in first sides of a cell.
    """
    # Imported here, because half-spaces do not need it.
    from scipy.interpolate import make_interp_spline
    from scipy.special import j0

    edges = _panel_edges(largest_wave_number(body), farthest)
    nodes, weights = np.polynomial.legendre.leggauss(PANEL_POINTS)
    middles = (edges[1:] + edges[:-1]) / 2
    halves = np.diff(edges) / 2
    wave_numbers = (middles[:, np.newaxis] + np.outer(halves, nodes)).ravel()
    strengths = np.outer(halves, weights).ravel()
    strengths *= (body.relative_compliance(wave_numbers) - 1) / np.pi
    # Distances are even in arsinh(r / depth): even below the depth, at equal ratios beyond it.
    end = math.asinh(farthest / depth)
    places = np.linspace(0, end, math.ceil(end * TABLE_POINTS) + 8)
    distances = depth * np.sinh(places)
    values = np.zeros(len(distances))
    for first in range(0, len(distances), ROWS):
        block = slice(first, first + ROWS)
        values[block] = j0(np.outer(distances[block], wave_numbers)) @ strengths
    spline = make_interp_spline(places, values, 5)

    def displacement(distance: Real) -> Real:
        """Return G at some distances [first side of a cell x pressure / E*]."""
        interpolated: Real = spline(np.arcsinh(distance / depth))
        return interpolated

    return displacement


def _panel_edges(largest: float, farthest: float) -> Values:
    """Return the edges of panels of wave numbers from 0 to `largest`, (n + 1,).

    Panels double in width from the smallest wave number, until J0 has `WAVES_OF_PANEL` half waves
    in one at the distance `farthest`.
    """
    widest = min(WAVES_OF_PANEL * math.pi / farthest, largest / 8)
    edges = [0.0, SMALLEST_WAVE_NUMBER / farthest]
    while edges[-1] < largest:
        edges.append(min(2 * edges[-1], edges[-1] + widest, largest))
    return np.array(edges)


def _concentrated_force(
    rows: NDArray[np.int64], columns: NDArray[np.int64], aspect: float
) -> Field:
    """Compute MIRCO's u = F asin(a/r)/(pi a) for the force F of unit pressure on a cell.

    F is `aspect`, the area of the cell. The radius a is half a side of a square cell, or of a
    square of the same area. At the loaded node u is F/(pi a). Offsets are (m, 1) rows and (1, n)
    columns, the first of which are 0. `aspect` is from 1/4 to 4: beyond, a is larger than the
    distance r of neighbouring nodes, and asin gives nan. Problems have square cells only.
    """
    radius = 0.5 * np.sqrt(aspect)
    distance = np.hypot(rows, columns * aspect)
    distance[0, 0] = radius  # any number above 0: the entry is replaced below
    table: Field = np.arcsin(radius / distance) * (aspect / (np.pi * radius))
    table[0, 0] = aspect / (np.pi * radius)
    return table


class InfluenceMatrix:
    """The influence matrix H between nodes of a free patch, entry by entry.

    Parameters
    ----------
    shape : tuple of int
        Nodes (nx, ny) of the grid.
    body : Body
        Reduced body, see `bem.bodies.Body.reduced`.
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
        body: Body,
        aspect: float,
        dtype: str = "float64",
    ) -> None:
        self.dtype = np.dtype(dtype)
        self._shape = shape
        self._mirrored = shape[0] * shape[1] <= MIRRORED_NODES
        is_small = shape[0] * shape[1] <= FEW_NODES
        coefficients = _coefficients_of_small_grid if is_small else _coefficients_of_grid
        self._coefficients = coefficients(shape, body, aspect, dtype, self._mirrored)

    def between(self, nodes: Nodes, loaded: Nodes) -> Real:
        """Return the displacements of nodes by unit pressure on loaded nodes.

        Parameters
        ----------
        nodes : ndarray, shape (a,)
            Flat indices of the displaced nodes.
        loaded : ndarray, shape (b,)
            Flat indices of the loaded nodes.

        Returns
        -------
        ndarray, shape (a, b)
            Displacements [first side of a cell x pressure / E*].
        """
        entries: Real = self._coefficients.take(self._offsets(nodes, loaded), mode="clip")
        return entries

    def among(self, nodes: Nodes, give: float = 0.0) -> Real:
        """Return the lower triangle of the matrix of some nodes.

        Parameters
        ----------
        nodes : ndarray, shape (n,)
            Flat indices of the nodes.
        give : float
            Displacement of the far field under a unit load, which is subtracted from every entry
            [first side of a cell x pressure / E*].

        Returns
        -------
        ndarray, shape (n, n)
            Matrix in Fortran's order [first side of a cell x pressure / E*]. Most of its upper
            triangle is undefined.
        """
        count = len(nodes)
        matrix = np.empty((count, count), self.dtype)
        for first in range(0, count, ROWS):
            # Each band begins at the diagonal; the transpose then has the lower triangle.
            rows = slice(first, first + ROWS)
            offsets = self._offsets(nodes[rows], nodes[first:])
            np.take(self._coefficients, offsets, out=matrix[rows, first:], mode="clip")
            if give:
                matrix[rows, first:] -= self.dtype.type(give)
        return matrix.T

    def _offsets(self, nodes: Nodes, loaded: Nodes) -> Nodes:
        """Return the (a, b) flat indices into the table for the offsets of (a,) from (b,) nodes."""
        rows, columns = self._shape
        offsets: Nodes
        if self._mirrored:  # the table has 2 columns - 1 columns
            extra = columns - 1  # columns of the table beyond those of the grid
            centre = (rows - 1) * (columns + extra) + extra  # index of the offset (0, 0)
            nodes_in_table = nodes // columns * extra + nodes
            loaded_in_table = loaded // columns * extra + loaded
            offsets = np.subtract.outer(nodes_in_table, loaded_in_table - centre)
            return offsets
        node_rows, node_columns = np.divmod(nodes, columns)
        loaded_rows, loaded_columns = np.divmod(loaded, columns)
        offsets = np.abs(np.subtract.outer(node_rows, loaded_rows))
        offsets *= columns
        offsets += np.abs(np.subtract.outer(node_columns, loaded_columns))
        return offsets


def _coefficients(
    shape: tuple[int, int], body: Body, aspect: float, dtype: str, mirrored: bool
) -> Real:
    """Return the flat table of the coefficients of all offsets within a grid, read-only.

    If `mirrored`, the table has offsets of either sign, (2 nx - 1) (2 ny - 1) entries; otherwise it
    has those from 0, nx ny entries.
    """
    table = influence_coefficients(shape, body, aspect).astype(dtype)
    if mirrored:
        table = np.concatenate([table[:0:-1], table])
        table = np.concatenate([table[:, :0:-1], table], axis=1)
    table.setflags(write=False)
    return table.reshape(-1)


_coefficients_of_grid = lru_cache(maxsize=4)(_coefficients)
_coefficients_of_small_grid = lru_cache(maxsize=32)(_coefficients)
