"""Filters of heights: polynomials, spikes, the Gaussian filter of ISO 16610-61, and holes."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal

import numpy as np

from gen.arrays import Heights, Values

if TYPE_CHECKING:
    from bem.problem import Boundary

BLOCK = 1 << 15  # nodes that enter the fit at a time, which bounds the memory


def fitted_polynomial(heights: Heights, degree: int) -> Heights:
    """Fit a polynomial of a total degree to the measured nodes by least squares."""
    legendre = np.polynomial.legendre.legvander  # made orthonormal on the nodes of each axis
    along_x, along_y = (
        np.linalg.qr(legendre(np.linspace(-1, 1, nodes), degree))[0] for nodes in heights.shape
    )
    i, j = np.nonzero(np.add.outer(np.arange(degree + 1), np.arange(degree + 1)) <= degree)
    triangle: Values = np.empty((0, i.size + 1))
    rows = max(1, BLOCK // heights.shape[1])
    for first in range(0, len(heights), rows):
        block = heights[first : first + rows]
        terms = along_x[first : first + rows, None, i] * along_y[None, :, j]
        equations = np.concatenate([terms, block[:, :, None]], axis=2)[~np.isnan(block)]
        triangle = np.asarray(np.linalg.qr(np.concatenate([triangle, equations]), mode="r"))
    coefficients = np.zeros((degree + 1, degree + 1))
    coefficients[i, j] = np.linalg.lstsq(triangle[:, :-1], triangle[:, -1], rcond=None)[0]
    fit: Heights = along_x @ coefficients @ along_y.T
    return fit


# nodes along each side of the neighbourhood: its median ignores spikes of up to 3 x 4 nodes
WINDOW = 5
ROWS = 64  # rows of nodes whose neighbourhoods are gathered at a time, which bounds the memory
# scatter of the smoothest surfaces, as a share of the span of the heights: less is rounding
ROUNDING = 1e-9


def local_medians(heights: Heights) -> tuple[Heights, float]:
    """Return the median of the measured nodes around each node, on their slope, and the scatter.

    Beside a hole, a spike or the border, a slope would shift the median. So the plane through
    the node whose slopes are the medians of those in its neighbourhood is taken out before. The
    scatter of the distances from the medians is their median absolute deviation times 1.4826, the
    standard deviation if they are normal, and at least that of rounding [um].
    """
    padded = np.pad(heights, WINDOW // 2, constant_values=np.nan)
    windows = np.lib.stride_tricks.sliding_window_view(padded, (WINDOW, WINDOW))
    steps = np.arange(WINDOW) - WINDOW // 2
    medians = np.empty(heights.shape)
    for first in range(0, len(heights), ROWS):
        block = windows[first : first + ROWS].reshape(-1, WINDOW, WINDOW)
        along_x, along_y = (
            np.nan_to_num(_medians(np.diff(block, axis=axis)), copy=False)[:, None, None]
            for axis in (1, 2)
        )
        level = block - along_x * steps[:, None] - along_y * steps
        medians[first : first + ROWS] = _medians(level).reshape(-1, heights.shape[1])
    distances = heights - medians
    measured = distances[~np.isnan(distances)]
    scatter = 1.4826 * float(np.median(np.abs(measured - np.median(measured))))
    return medians, max(scatter, ROUNDING * float(np.nanmax(heights) - np.nanmin(heights)))


def _medians(values: Values) -> Values:
    """Return the median of the numbers of each entry of the first axis, NaN if it has none."""
    each = values.reshape(len(values), -1)
    ordered = np.sort(each, axis=1)  # NaN come last
    count = np.count_nonzero(~np.isnan(each), axis=1)
    entries = np.arange(len(each))
    lower, upper = (
        ordered[entries, np.maximum(place, 0)] for place in ((count - 1) // 2, count // 2)
    )
    return np.asarray(np.where(count % 2 == 1, lower, lower / 2 + upper / 2))


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
            mode: Literal["wrap", "reflect"] = "wrap" if boundary == "periodic" else "reflect"
            smooth = gaussian_filter1d(smooth, sigma, axis=axis, mode=mode, radius=radius)
            continue
        weights = {"sigma": sigma, "radius": min(radius, nodes - 1)}
        inside = gaussian_filter1d(np.ones(nodes), mode="constant", **weights)
        smooth = gaussian_filter1d(smooth, axis=axis, mode="constant", **weights)
        smooth = smooth / np.expand_dims(inside, 1 - axis)
    return smooth


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
    rows, columns, weights = [np.arange(unknown.size)], [np.arange(unknown.size)], [diagonal]
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


def least_squares(heights: Heights, degree: int) -> tuple[Heights, Values]:
    """Fit a plane or a quadratic to the measured nodes; return the fit and its coefficients [um].

    Coordinates of the coefficients go from -1 to 1 along both axes.
    """
    x, y = np.meshgrid(*(np.linspace(-1, 1, nodes) for nodes in heights.shape), indexing="ij")
    columns = [np.ones_like(x), x, y, *([x * x, x * y, y * y] if degree == 2 else [])]
    measured = ~np.isnan(heights)
    matrix = np.stack([column[measured] for column in columns], axis=1)
    offset = float(np.mean(heights[measured]))
    coefficients = np.linalg.lstsq(matrix, heights[measured] - offset, rcond=None)[0]
    fit = np.full_like(heights, offset)
    for coefficient, column in zip(coefficients, columns, strict=True):
        fit = fit + coefficient * column
    return fit, np.asarray(coefficients)
