"""Larger steps of the preparation: form, waves by ISO 16610-61, holes, another spacing."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Heights, Values
from gen.maps.read import Sides, Topography, spacing_text
from gen.runtime.errors import InputError

if TYPE_CHECKING:
    from bem.problem import Boundary

ROUNDING = 1e-9  # relative difference of lengths that are taken for the same
MANY_HOLES = 0.1  # share of missing heights above which filling them deserves a warning
# share of missing heights above which filling them is refused unless the user insists
MOST_HOLES = 0.5
FIT_NODES = 1 << 15  # nodes that enter the fit at a time, which bounds the memory


def fitted_polynomial(heights: Heights, degree: int) -> Heights:
    """Fit a polynomial to the measured nodes of a map by least squares.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights, NaN at holes [um]. There are more nodes along each side than the degree, and more
        heights than coefficients.
    degree : int
        Total degree of the polynomial in x and y.

    Returns
    -------
    ndarray, shape (nx, ny)
        Heights of the polynomial at all nodes [um].
    """
    along_x = _orthonormal_polynomials(heights.shape[0], degree)
    along_y = _orthonormal_polynomials(heights.shape[1], degree)
    powers = np.arange(degree + 1)
    i, j = np.nonzero(np.add.outer(powers, powers) <= degree)
    # QR factorisation of all equations, to which some lines of nodes are added at a time
    triangle: Values = np.empty((0, i.size + 1))
    step = max(1, FIT_NODES // heights.shape[1])
    for first in range(0, len(heights), step):
        lines = heights[first : first + step]
        terms = along_x[first : first + step, None, i] * along_y[None, :, j]
        equations = np.concatenate([terms, lines[:, :, None]], axis=2)
        measured = equations[~np.isnan(lines)]
        triangle = np.asarray(
            np.linalg.qr(np.concatenate([triangle, measured]), mode="r")
        )
    coefficients = np.zeros((degree + 1, degree + 1))
    matrix = triangle[:, :-1]
    right = triangle[:, -1]
    coefficients[i, j] = np.linalg.lstsq(matrix, right, rcond=None)[0]
    fit: Heights = along_x @ coefficients @ along_y.T
    return fit


def _orthonormal_polynomials(nodes: int, degree: int) -> Values:
    """Return orthonormal polynomials at the nodes of an axis, shape (nodes, degree + 1)."""
    legendre = np.polynomial.legendre.legvander(np.linspace(-1, 1, nodes), degree)
    return np.asarray(np.linalg.qr(legendre)[0])


def without_form(topography: Topography, degree: int) -> Topography:
    """Subtract the least-squares polynomial of the measured nodes from a map.

    Parameters
    ----------
    topography : Topography
        The map.
    degree : int
        Total degree of the polynomial in x and y.

    Returns
    -------
    Topography
        The map without this form.

    Raises
    ------
    InputError
        If the polynomial has too many coefficients for the map.
    """
    heights = topography.heights
    nx, ny = heights.shape
    coefficients = (degree + 1) * (degree + 2) // 2
    measured = heights.size - topography.missing
    if degree >= min(nx, ny) or measured <= coefficients:
        raise InputError(
            f"{topography.name}: --form {degree} has {coefficients} coefficients, too"
            f" many for {measured} heights on {nx} x {ny} nodes"
        )
    fit = fitted_polynomial(heights, degree)
    span = np.ptp(fit[~np.isnan(heights)])
    step = f"form taken out: a polynomial of degree {degree}, which spans {span:.4g} um"
    return topography.changed(heights - fit, step)


# constant of the standard's weighting function, for which half of a wave of the cut-off passes
ALPHA = math.sqrt(math.log(2) / math.pi)
# reach of the weights in standard deviations, beyond which they are 1e-8 of the largest
REACH = 6.0
# shortest cut-off in spacings: there the sampled weights let 50.2 % pass, at 3 spacings 56 %
FINEST = 4.0


def long_waves(
    heights: Heights,
    spacing: tuple[float, float],
    cutoff: float,
    boundary: Boundary = "free",
) -> Heights:
    """Smooth a map by the Gaussian weights of ISO 16610-61.

    The share exp(-ln 2 (cutoff / wavelength)^2) of a wave along any direction passes. Near the
    border of a free patch the weights inside the map are divided by their sum; other patches
    continue beyond their borders.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights without holes [um].
    spacing : tuple of float
        Distance of the nodes along x and y [um].
    cutoff : float
        Wavelength of which half passes [um].
    boundary : {"free", "periodic", "mirror"}, optional
        Boundary of the patch.

    Returns
    -------
    ndarray, shape (nx, ny)
        Smoothed heights [um].
    """
    deviation = ALPHA * cutoff / math.sqrt(2 * math.pi)  # of the weights [um]
    smooth = heights
    for axis in (0, 1):
        smooth = _smoothed(smooth, deviation / spacing[axis], axis, boundary)
    return smooth


def _smoothed(heights: Heights, sigma: float, axis: int, boundary: Boundary) -> Heights:
    """Smooth heights [um] along an axis by weights with a standard deviation in spacings."""
    from scipy.ndimage import gaussian_filter1d

    radius = math.ceil(REACH * sigma)
    if boundary != "free":
        mode: Literal["wrap", "reflect"] = "reflect"
        if boundary == "periodic":
            mode = "wrap"
        return gaussian_filter1d(heights, sigma, axis=axis, mode=mode, radius=radius)
    nodes = heights.shape[axis]
    weights = {"sigma": sigma, "radius": min(radius, nodes - 1)}
    inside = gaussian_filter1d(np.ones(nodes), mode="constant", **weights)
    smooth = gaussian_filter1d(heights, axis=axis, mode="constant", **weights)
    return np.asarray(smooth / np.expand_dims(inside, 1 - axis))


def filtered(
    topography: Topography, short: float | None, long: float | None
) -> Topography:
    """Remove waves shorter than the S-filter's cut-off, then waves longer than the L-filter's.

    Parameters
    ----------
    topography : Topography
        The map, without holes.
    short : float or None
        Cut-off of the S-filter, None to leave it out [um].
    long : float or None
        Cut-off of the L-filter, None to leave it out [um].

    Returns
    -------
    Topography
        The filtered map.

    Raises
    ------
    InputError
        If a cut-off is below four spacings or above the shorter side.
    """
    heights = topography.heights
    spacing = topography.spacing
    boundary = topography.boundary
    filters = []
    if short is not None:
        _check_cutoff(topography, "S-filter", short)
        heights = long_waves(heights, spacing, short, boundary)
        filters.append(f"S-filter {short:g} um")
    if long is not None:
        _check_cutoff(topography, "L-filter", long)
        heights = heights - long_waves(heights, spacing, long, boundary)
        filters.append(f"L-filter {long:g} um")
    step = f"filtered after ISO 16610-61 (Gaussian): {', '.join(filters)}"
    if boundary == "periodic":
        step += ", on past the borders"
    elif boundary == "mirror":
        step += ", mirrored at the borders"
    return topography.changed(heights, step)


def _check_cutoff(topography: Topography, name: str, cutoff: float) -> None:
    """Raise InputError if the cut-off [um] of a named filter does not suit a map."""
    finest = FINEST * max(topography.spacing)
    side = min(topography.sides)
    if not finest * (1 - ROUNDING) <= cutoff <= side * (1 + ROUNDING):
        raise InputError(
            f"{topography.name}: --filter: the {name}'s cut-off,"
            f" {cutoff:g} um, is outside {finest:.6g} to {side:.6g} um, four spacings to"
            " the shorter side"
        )


def filled_harmonically(
    heights: Heights, spacing: tuple[float, float], *, periodic: bool = False
) -> Heights:
    """Fill holes with the solution of Laplace's equation between the heights of their rims.

    No flux crosses the border of the patch, unless it is periodic.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights, NaN at holes but not at all nodes [um].
    spacing : tuple of float
        Distance of the nodes along x and y [um].
    periodic : bool, optional
        Whether the patch continues with its opposite border.

    Returns
    -------
    ndarray, shape (nx, ny)
        Heights without holes [um]; the same array if there was no hole.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.linalg import spsolve

    holes = np.flatnonzero(np.isnan(heights))
    if not holes.size:
        return heights
    number = np.full(heights.size, -1)  # of the hole at each node, -1 where there is none
    number[holes] = np.arange(holes.size)
    flat = heights.reshape(-1)
    # Five-point equations, one row for each hole: the sum of the differences to its neighbours,
    # over the squares of their distances, is zero.
    diagonal = np.zeros(holes.size)
    right = np.zeros(holes.size)
    rows = [np.arange(holes.size)]
    columns = [np.arange(holes.size)]
    values = []
    for axis in (0, 1):
        weight = spacing[axis] ** -2
        for direction in (-1, 1):
            pairs = _neighbours(heights.shape, holes, axis, direction, periodic=periodic)
            diagonal[pairs.holes] += weight
            measured = number[pairs.nodes] < 0
            right[pairs.holes[measured]] += weight * flat[pairs.nodes[measured]]
            rows.append(pairs.holes[~measured])
            columns.append(number[pairs.nodes[~measured]])
            values.append(np.full(np.count_nonzero(~measured), -weight))
    entries = np.concatenate([diagonal, *values])
    places = (np.concatenate(rows), np.concatenate(columns))
    complete = heights.copy()
    matrix = coo_matrix((entries, places)).tocsc()
    complete.reshape(-1)[holes] = spsolve(matrix, right)
    return complete


@dataclass(frozen=True, eq=False)
class _Neighbours:
    """Pairs of a hole and its neighbour in one direction."""

    holes: NDArray[np.intp]  # numbers of the holes that have such a neighbour, shape (k,)
    nodes: NDArray[np.intp]  # flat places of these neighbours in the map, shape (k,)


def _neighbours(
    shape: tuple[int, ...],
    holes: NDArray[np.intp],
    axis: int,
    direction: Literal[-1, 1],
    *,
    periodic: bool,
) -> _Neighbours:
    """Return the neighbours of holes, which are flat places in a map, along an axis."""
    stride = shape[1] if axis == 0 else 1
    position = np.unravel_index(holes, shape)[axis]
    neighbour = position + direction
    numbers = np.arange(holes.size)
    if periodic:
        neighbour = neighbour % shape[axis]
    else:
        inside = (neighbour >= 0) & (neighbour < shape[axis])
        numbers = numbers[inside]
    steps = (neighbour - position)[numbers]
    return _Neighbours(numbers, holes[numbers] + steps * stride)


def filled(topography: Topography, *, insisted: bool) -> Topography:
    """Fill the holes of a map by Laplace's equation, and warn if they are many.

    Parameters
    ----------
    topography : Topography
        The map, with a hole or more.
    insisted : bool
        Whether the user insists on filling more nodes than were measured.

    Returns
    -------
    Topography
        The map without holes.

    Raises
    ------
    InputError
        If more heights are missing than `MOST_HOLES` of all, and the user does not insist.
    """
    missing = topography.missing
    nodes = topography.heights.size
    share = f"{100 * missing / nodes:.3g} %"
    if missing > MOST_HOLES * nodes and not insisted:
        raise InputError(
            f"{topography.name}: {missing} of {nodes} heights are missing ({share}):"
            " --fill would make up more than was measured; crop, measure again, or insist"
            " by --fill-most"
        )
    heights = filled_harmonically(
        topography.heights,
        topography.spacing,
        periodic=topography.boundary == "periodic",
    )
    complete = topography.changed(
        heights, f"filled {missing} nodes ({share}) harmonically"
    )
    if missing <= MANY_HOLES * nodes:
        return complete
    warning = (
        f"{share} of the heights were missing and are filled: filled parts are too smooth"
    )
    return replace(complete, warnings=(*complete.warnings, warning))


# relative difference of two spacings that are the same but for an instrument's rounding
SAME = 1e-3


def is_same(first: float, second: float) -> bool:
    """Tell whether two spacings differ by no more than an instrument's rounding.

    Parameters
    ----------
    first, second : float
        Spacings, in one unit.

    Returns
    -------
    bool
        Whether they are the same.
    """
    return abs(first - second) <= SAME * max(first, second)


def resampled(topography: Topography, spacing: Sides) -> Topography:
    """Give a map another spacing by cubic splines along each axis on which it differs.

    Where the new nodes are closer, the splines are evaluated at the new nodes. Where they are
    further apart, the splines are averaged over the new cells: values at the new nodes would fold
    short waves back into long ones. A spacing that differs by rounding alone keeps the heights.

    Parameters
    ----------
    topography : Topography
        The map, without holes.
    spacing : tuple of float
        New distance of the nodes along x and y [um].

    Returns
    -------
    Topography
        The map with this spacing, from the same first node.

    Raises
    ------
    InputError
        If the map has fewer than 4 nodes along an axis to resample, or the new one fewer than 2.
    """
    heights = topography.heights
    for axis in (0, 1):
        old = topography.spacing[axis]
        new = spacing[axis]
        if is_same(old, new):
            continue
        nodes = heights.shape[axis]
        if nodes < 4:
            raise InputError(
                f"{topography.name}: {nodes} nodes along an axis, resampling needs 4"
            )
        heights = _resampled_along(heights, axis, old, new)
    if heights is topography.heights:
        return topography.changed(heights, "", spacing)
    nx, ny = heights.shape
    every = spacing_text(spacing)
    if min(nx, ny) < 2:
        raise InputError(
            f"{topography.name}: a spacing of {every} um leaves {nx} x {ny} nodes, give"
            " one that leaves 2 x 2 or more"
        )
    step = f"resampled to {nx} x {ny} nodes every {every} um by cubic splines"
    return topography.changed(heights, step, spacing)


def _resampled_along(heights: Heights, axis: int, old: float, new: float) -> Heights:
    """Return heights [um] with a new spacing along an axis instead of the old one [um]."""
    from scipy.interpolate import make_interp_spline

    nodes = heights.shape[axis]
    last = (nodes - 1) * old
    number = int(last / new * (1 + 1e-12)) + 1
    places = np.minimum(new * np.arange(number), last)
    spline: Any = make_interp_spline(old * np.arange(nodes), heights, k=3, axis=axis)
    if new < old:
        return np.ascontiguousarray(spline(places))
    integrals = spline.antiderivative()(places)
    return np.ascontiguousarray(np.diff(integrals, axis=axis) / new)
