"""Steps of the preparation: subtract a form, filter waves (ISO 16610-61), fill holes, resample."""

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

ROUNDING = 1e-9  # relative amount by which a cut-off may exceed its bounds
MANY_HOLES = 0.1  # share of missing heights above which filling them deserves a warning
# share of missing heights above which filling them is refused unless the user insists
MOST_HOLES = 0.5
# number of nodes whose equations are added to a fit at a time, which bounds the memory
FIT_NODES = 2**15


def fitted_polynomial(heights: Heights, degree: int) -> Heights:
    """Fit a polynomial to the measured nodes of a map by least squares.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights, NaN at holes [um]. There are more nodes along each side than the degree, and more
        heights than coefficients.
    degree : int
        Total degree of the polynomial in x and y: the largest sum of the exponents of a term.

    Returns
    -------
    ndarray, shape (nx, ny)
        Heights of the polynomial at all nodes, also at holes [um].
    """
    nx, ny = heights.shape
    along_x = _orthonormal_polynomials(nx, degree)
    along_y = _orthonormal_polynomials(ny, degree)
    powers = np.arange(degree + 1)
    total_degree = np.add.outer(powers, powers)
    i, j = np.nonzero(total_degree <= degree)  # degrees of each term along x and along y
    # The QR factorisation of all equations is updated by some lines of nodes at a time.
    triangle: Values = np.empty((0, i.size + 1))
    step = max(1, FIT_NODES // ny)
    for first in range(0, nx, step):
        lines = slice(first, first + step)
        heights_of_lines = heights[lines]
        terms = along_x[lines, None, i] * along_y[None, :, j]
        # The equation of a node has its terms, followed by its height.
        equations = np.concatenate([terms, heights_of_lines[:, :, None]], axis=2)
        measured = equations[~np.isnan(heights_of_lines)]
        stacked = np.concatenate([triangle, measured])
        triangle = np.asarray(np.linalg.qr(stacked, mode="r"))
    coefficients = np.zeros((degree + 1, degree + 1))
    matrix = triangle[:, :-1]
    right = triangle[:, -1]
    coefficients[i, j] = np.linalg.lstsq(matrix, right, rcond=None)[0]
    fit: Heights = along_x @ coefficients @ along_y.T
    return fit


def _orthonormal_polynomials(nodes: int, degree: int) -> Values:
    """Return a polynomial of each degree from 0 at the nodes of an axis, orthonormal there.

    The shape is (nodes, degree + 1).
    """
    places = np.linspace(-1, 1, nodes)
    legendre = np.polynomial.legendre.legvander(places, degree)
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
        The map without this form. The new line of its `steps` names the degree and the span.

    Raises
    ------
    InputError
        If the degree is not below the number of nodes along each side, or the polynomial has as
        many coefficients as there are heights.
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


# constant of the weighting function of ISO 16610-61: with it, half the amplitude of a wave as long
# as the cut-off passes
ALPHA = math.sqrt(math.log(2) / math.pi)
# distance in standard deviations at which the weights end: there they are 1e-8 of the largest
REACH = 6.0
# shortest cut-off in spacings. Of a wave as long as the cut-off, weights at the nodes then let
# 50.2 % pass instead of 50 %; for a cut-off of 3 spacings it would be 56 %.
FINEST = 4.0


def long_waves(
    heights: Heights,
    spacing: tuple[float, float],
    cutoff: float,
    boundary: Boundary = "free",
) -> Heights:
    """Smooth a map by the Gaussian weights of ISO 16610-61.

    The share exp(-ln 2 (cutoff / wavelength)^2) of the amplitude of a wave passes. Near the border
    of a free patch the weights inside the map are divided by their sum. A periodic patch repeats
    beyond its borders, and a mirror patch is mirrored there.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights without holes [um].
    spacing : tuple of float
        Distance of the nodes along x and y [um].
    cutoff : float
        Wavelength of the waves of which half the amplitude passes [um].
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
    """Smooth heights [um] along an axis by Gaussian weights.

    `sigma` is the standard deviation of the weights in spacings.
    """
    from scipy.ndimage import gaussian_filter1d

    radius = math.ceil(REACH * sigma)
    if boundary != "free":
        mode: Literal["wrap", "reflect"] = "reflect"
        if boundary == "periodic":
            mode = "wrap"
        return gaussian_filter1d(heights, sigma, axis=axis, mode=mode, radius=radius)
    nodes = heights.shape[axis]
    weights = {"sigma": sigma, "radius": min(radius, nodes - 1)}
    # sum of the weights inside the map for each node of the axis
    sums = gaussian_filter1d(np.ones(nodes), mode="constant", **weights)
    smooth = gaussian_filter1d(heights, axis=axis, mode="constant", **weights)
    # The sums become a column for axis 0 and a row for axis 1.
    return np.asarray(smooth / np.expand_dims(sums, 1 - axis))


def filtered(
    topography: Topography, short: float | None, long: float | None
) -> Topography:
    """Remove waves that are shorter than one cut-off, then waves that are longer than another one.

    Parameters
    ----------
    topography : Topography
        The map, without holes.
    short : float or None
        Cut-off of the S-filter, which removes shorter waves [um]; None for no such filter.
    long : float or None
        Cut-off of the L-filter, which removes longer waves [um]; None for no such filter. One of
        the cut-offs is given at least.

    Returns
    -------
    Topography
        The filtered map.

    Raises
    ------
    InputError
        If a cut-off is below four times the larger spacing or above the shorter side.
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
        step += ", continued periodically past the borders"
    elif boundary == "mirror":
        step += ", mirrored at the borders"
    return topography.changed(heights, step)


def _check_cutoff(topography: Topography, name: str, cutoff: float) -> None:
    """Raise InputError if a cut-off [um] does not suit a map; the message names the filter."""
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
    """Fill holes with the solution of Laplace's equation between the heights at their rims.

    At the border of a patch that is not periodic, the slope across the border is 0.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights, NaN at holes but not at all nodes [um].
    spacing : tuple of float
        Distance of the nodes along x and y [um].
    periodic : bool, optional
        Whether the patch repeats beyond its borders.

    Returns
    -------
    ndarray, shape (nx, ny)
        Heights without holes [um]: a new array, or the argument itself if it has no hole.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.linalg import spsolve

    holes = np.flatnonzero(np.isnan(heights))
    if not holes.size:
        return heights
    numbers = np.arange(holes.size)
    # number of the hole at each node, -1 at a node with a height
    number_at = np.full(heights.size, -1)
    number_at[holes] = numbers
    flat = heights.reshape(-1)
    # Five-point equations, a row for each hole: the sum of the differences to its neighbours, over
    # the squares of their distances, is zero. Neighbours with a height enter the right side.
    diagonal = np.zeros(holes.size)
    right = np.zeros(holes.size)
    rows = [numbers]
    columns = [numbers]
    off_diagonal = []
    for axis in (0, 1):
        weight = spacing[axis] ** -2
        for direction in (-1, 1):
            pairs = _neighbours(heights.shape, holes, axis, direction, periodic=periodic)
            diagonal[pairs.holes] += weight
            neighbour_number = number_at[pairs.nodes]
            measured = neighbour_number < 0
            right[pairs.holes[measured]] += weight * flat[pairs.nodes[measured]]
            rows.append(pairs.holes[~measured])
            columns.append(neighbour_number[~measured])
            off_diagonal.append(np.full(np.count_nonzero(~measured), -weight))
    entries = np.concatenate([diagonal, *off_diagonal])
    places = (np.concatenate(rows), np.concatenate(columns))
    matrix = coo_matrix((entries, places)).tocsc()
    complete = heights.copy()
    complete.reshape(-1)[holes] = spsolve(matrix, right)
    return complete


@dataclass(frozen=True, eq=False)
class _Neighbours:
    """Pairs of a hole and its neighbour in one direction, for all holes that have this neighbour.

    A neighbour may be a hole itself.
    """

    holes: NDArray[np.intp]  # number of the hole of each pair, shape (pairs,)
    nodes: NDArray[np.intp]  # flat index of its neighbour in the map, shape (pairs,)


def _neighbours(
    shape: tuple[int, ...],
    holes: NDArray[np.intp],
    axis: int,
    direction: Literal[-1, 1],
    *,
    periodic: bool,
) -> _Neighbours:
    """Return the neighbours of holes along an axis, at the next lower (-1) or higher (1) index.

    `holes`, shape (holes,), are the flat indices of the holes in a map of the given shape. In a map
    that is not periodic, a hole at the border may have no neighbour.
    """
    stride = shape[1] if axis == 0 else 1  # between flat indices of neighbours
    position = np.unravel_index(holes, shape)[axis]
    neighbour = position + direction
    numbers = np.arange(holes.size)
    if periodic:
        neighbour = neighbour % shape[axis]
    else:
        inside = (neighbour >= 0) & (neighbour < shape[axis])
        numbers = numbers[inside]
    steps = (neighbour - position)[numbers]
    return _Neighbours(holes=numbers, nodes=holes[numbers] + steps * stride)


def filled(topography: Topography, *, insisted: bool) -> Topography:
    """Fill the holes of a map as `filled_harmonically` does, and warn if they are many.

    Parameters
    ----------
    topography : Topography
        The map, with a hole or more.
    insisted : bool
        Whether the user insists on filling more nodes than were measured.

    Returns
    -------
    Topography
        The map without holes, with one more warning if more than the share `MANY_HOLES` of its
        heights was missing.

    Raises
    ------
    InputError
        If more than the share `MOST_HOLES` of the heights is missing, and the user does not insist.
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


# largest relative difference between two spacings that instruments' rounding may explain
SAME = 1e-3


def is_same(first: float, second: float) -> bool:
    """Tell whether two spacings differ by no more than the rounding of instruments.

    Parameters
    ----------
    first, second : float
        Spacings, both in the same unit.

    Returns
    -------
    bool
        Whether they differ by at most `SAME` times the larger one.
    """
    return abs(first - second) <= SAME * max(first, second)


def resampled(topography: Topography, spacing: Sides) -> Topography:
    """Give a map another spacing, by cubic splines along each axis.

    If the new nodes are closer, heights are the values of the splines at the new nodes. If they are
    further apart, heights are the means of the splines over the cells between new nodes, because
    values at the nodes would fold short waves into long ones. Along an axis whose spacings differ
    by rounding alone, the heights stay as they are.

    Parameters
    ----------
    topography : Topography
        The map, without holes.
    spacing : tuple of float
        New distance of the nodes along x and y [um].

    Returns
    -------
    Topography
        The map with this spacing, in all cases. A line is added to its `steps` unless all heights
        stay as they are.

    Raises
    ------
    InputError
        If the map has fewer than 4 nodes along an axis that is resampled, or the new map fewer than
        2 along an axis.
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
    """Return heights [um] whose spacing along an axis is `new` instead of `old` [um].

    See `resampled`. For a larger spacing there is a height for each cell between new nodes.
    """
    from scipy.interpolate import make_interp_spline

    nodes = heights.shape[axis]
    old_places = old * np.arange(nodes)
    last = (nodes - 1) * old
    # The factor keeps a new node that coincides with the last old one but for rounding.
    number = int(last / new * (1 + 1e-12)) + 1
    places = np.minimum(new * np.arange(number), last)
    spline: Any = make_interp_spline(old_places, heights, k=3, axis=axis)
    if new < old:
        return np.ascontiguousarray(spline(places))
    integrals = spline.antiderivative()(places)
    means = np.diff(integrals, axis=axis) / new
    return np.ascontiguousarray(means)
