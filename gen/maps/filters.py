"""Larger steps of the preparation: form, waves by ISO 16610-61, holes, another spacing."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from gen.arrays import Heights, Values
from gen.maps.read import Sides, Topography, in_words
from gen.runtime.errors import InputError

if TYPE_CHECKING:
    from bem.problem import Boundary

ROUNDING = 1e-9  # relative difference of lengths that are taken for the same
MANY_HOLES = 0.1  # share of missing heights above which filling them deserves a warning
# share of missing heights above which filling them is refused unless the user insists
MOST_HOLES = 0.5
BLOCK = 1 << 15  # nodes that enter the fit at a time, which bounds the memory


def fitted_polynomial(heights: Heights, degree: int) -> Heights:
    """Fit a polynomial of a total degree to the measured nodes by least squares."""
    legendre = (
        np.polynomial.legendre.legvander
    )  # made orthonormal on the nodes of each axis
    along_x, along_y = (
        np.linalg.qr(legendre(np.linspace(-1, 1, nodes), degree))[0]
        for nodes in heights.shape
    )
    i, j = np.nonzero(
        np.add.outer(np.arange(degree + 1), np.arange(degree + 1)) <= degree
    )
    triangle: Values = np.empty((0, i.size + 1))
    rows = max(1, BLOCK // heights.shape[1])
    for first in range(0, len(heights), rows):
        block = heights[first : first + rows]
        terms = along_x[first : first + rows, None, i] * along_y[None, :, j]
        equations = np.concatenate([terms, block[:, :, None]], axis=2)[~np.isnan(block)]
        triangle = np.asarray(
            np.linalg.qr(np.concatenate([triangle, equations]), mode="r")
        )
    coefficients = np.zeros((degree + 1, degree + 1))
    coefficients[i, j] = np.linalg.lstsq(triangle[:, :-1], triangle[:, -1], rcond=None)[0]
    fit: Heights = along_x @ coefficients @ along_y.T
    return fit


def without_form(topography: Topography, degree: int) -> Topography:
    """Subtract the least-squares polynomial of a total degree from the measured nodes."""
    heights, terms = topography.heights, (degree + 1) * (degree + 2) // 2
    (nx, ny), measured = heights.shape, heights.size - topography.missing
    if degree >= min(nx, ny) or measured <= terms:
        named = f"--form {degree}"
        raise InputError(
            f"{topography.name}: {named} has {terms} coefficients, too many for {measured} heights"
            f" on {nx} x {ny} nodes"
        )
    fit = fitted_polynomial(heights, degree)
    span = f"{np.ptp(fit[~np.isnan(heights)]):.4g} um"
    step = f"form taken out: a polynomial of degree {degree}, which spans {span}"
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
    """Smooth a map by the Gaussian weights of ISO 16610-61, normalised at the borders it has.

    Of a wave along any direction exp(-ln 2 (cutoff / wavelength)^2) passes. Near the border of a
    free patch the weights inside the map are divided by their sum.
    """
    from scipy.ndimage import gaussian_filter1d

    smooth, deviation = heights, ALPHA * cutoff / math.sqrt(2 * math.pi)
    for axis, (nodes, step) in enumerate(zip(heights.shape, spacing, strict=True)):
        sigma = deviation / step
        radius = math.ceil(REACH * sigma)
        if boundary != "free":
            mode: Literal["wrap", "reflect"] = (
                "wrap" if boundary == "periodic" else "reflect"
            )
            smooth = gaussian_filter1d(smooth, sigma, axis=axis, mode=mode, radius=radius)
            continue
        weights = {"sigma": sigma, "radius": min(radius, nodes - 1)}
        inside = gaussian_filter1d(np.ones(nodes), mode="constant", **weights)
        smooth = gaussian_filter1d(smooth, axis=axis, mode="constant", **weights)
        smooth = smooth / np.expand_dims(inside, 1 - axis)
    return smooth


def filtered(
    topography: Topography, short: float | None, long: float | None
) -> Topography:
    """Take out waves shorter than the S-filter's cut-off and longer than the L-filter's [um]."""
    heights, spacing, boundary = (
        topography.heights,
        topography.spacing,
        topography.boundary,
    )
    finest, side = FINEST * max(spacing), min(topography.sides)
    cutoffs = {"S-filter": short, "L-filter": long}
    given = {name: cutoff for name, cutoff in cutoffs.items() if cutoff is not None}
    for name, cutoff in given.items():
        if not finest * (1 - ROUNDING) <= cutoff <= side * (1 + ROUNDING):
            raise InputError(
                f"{topography.name}: --filter: the {name}'s cut-off,"
                f" {cutoff:g} um, is outside {finest:.6g} to {side:.6g} um, four spacings to the"
                " shorter side"
            )
        waves = long_waves(heights, spacing, cutoff, boundary)
        heights = waves if name == "S-filter" else heights - waves
    beyond = {"periodic": ", on past the borders", "mirror": ", mirrored at the borders"}
    names = ", ".join(f"{name} {cutoff:g} um" for name, cutoff in given.items())
    step = f"filtered after ISO 16610-61 (Gaussian): {names}{beyond.get(boundary, '')}"
    return topography.changed(heights, step)


def filled_harmonically(
    heights: Heights, spacing: tuple[float, float], *, periodic: bool = False
) -> Heights:
    """Fill holes with the solution of Laplace's equation between the heights of their rims.

    No flux crosses the border of the patch, unless it is periodic.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.linalg import spsolve

    unknown = np.flatnonzero(np.isnan(heights))
    if not unknown.size:
        return heights
    number = np.full(heights.size, -1)
    number[unknown] = np.arange(unknown.size)
    diagonal, right = np.zeros(unknown.size), np.zeros(unknown.size)
    filled, line = heights.copy(), heights.shape[1]
    flat = filled.reshape(-1)
    # five-point equations at the unknown nodes, diagonal first
    rows, columns, weights = (
        [np.arange(unknown.size)],
        [np.arange(unknown.size)],
        [diagonal],
    )
    for axis, stride in ((0, line), (1, 1)):
        position = unknown // line if axis == 0 else unknown % line
        weight, length = spacing[axis] ** -2, heights.shape[axis]
        for neighbour in (position - 1, position + 1):
            here = np.flatnonzero(periodic | ((neighbour >= 0) & (neighbour < length)))
            there = unknown[here] + (neighbour % length - position)[here] * stride
            diagonal[here] += weight
            known = number[there] < 0
            np.add.at(right, here[known], weight * flat[there[known]])
            rows.append(here[~known])
            columns.append(number[there[~known]])
            weights.append(np.full(int((~known).sum()), -weight))
    places = np.concatenate(rows), np.concatenate(columns)
    flat[unknown] = spsolve(coo_matrix((np.concatenate(weights), places)).tocsc(), right)
    return filled


def filled(topography: Topography, *, insisted: bool) -> Topography:
    """Fill holes; warn of many, and refuse more than heights unless the user insists."""
    missing, size = topography.missing, topography.heights.size
    share = f"{100 * missing / size:.3g} %"
    if missing > MOST_HOLES * size and not insisted:
        raise InputError(
            f"{topography.name}: {missing} of {size} heights are missing ({share}): --fill would"
            f" make up more than was measured; crop, measure again, or insist by --fill-most"
        )
    periodic = topography.boundary == "periodic"
    heights = filled_harmonically(
        topography.heights, topography.spacing, periodic=periodic
    )
    whole = topography.changed(heights, f"filled {missing} nodes ({share}) harmonically")
    if missing <= MANY_HOLES * size:
        return whole
    warning = (
        f"{share} of the heights were missing and are filled: filled parts are too smooth"
    )
    return replace(whole, warnings=(*whole.warnings, warning))


# relative difference of two spacings that are the same but for an instrument's rounding
SAME = 1e-3


def is_same(one: float, other: float) -> bool:
    """Tell whether two spacings differ by no more than an instrument's rounding [um]."""
    return abs(one - other) <= SAME * max(one, other)


def resampled(topography: Topography, spacing: Sides) -> Topography:
    """Give a map another spacing [um], axis by axis, unless it has it but for rounding.

    Cubic splines through the nodes are evaluated where the new nodes are closer. Where they are
    further apart, the splines are averaged over the new cells: values at the new nodes would fold
    short waves back into long ones.
    """
    from scipy.interpolate import make_interp_spline

    heights = topography.heights
    for axis, (old, new) in enumerate(zip(topography.spacing, spacing, strict=True)):
        if is_same(old, new):
            continue
        nodes = heights.shape[axis]
        if nodes < 4:
            raise InputError(
                f"{topography.name}: {nodes} nodes along an axis, resampling needs 4"
            )
        last, number = (nodes - 1) * old, int((nodes - 1) * old / new * (1 + 1e-12)) + 1
        places = np.minimum(new * np.arange(number), last)
        spline: Any = make_interp_spline(old * np.arange(nodes), heights, k=3, axis=axis)
        if new < old:
            heights = np.ascontiguousarray(spline(places))
        else:
            means = np.diff(spline.antiderivative()(places), axis=axis) / new
            heights = np.ascontiguousarray(means)
    nx, ny = heights.shape
    if min(nx, ny) < 2:
        raise InputError(
            f"{topography.name}: a spacing of {in_words(spacing)} um leaves {nx} x {ny} nodes,"
            " give one that leaves 2 x 2 or more"
        )
    step = f"resampled to {nx} x {ny} nodes every {in_words(spacing)} um by cubic splines"
    return topography.changed(
        heights, step * (heights is not topography.heights), spacing
    )
