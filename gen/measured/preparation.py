"""Prepare a measured topography for contact: only the steps that the user asks for, recorded."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Heights, Values
from gen.measured import steps
from gen.measured.settings import SPIKE, Preparation
from gen.measured.topography import WIDEST, Topography, intervals
from gen.runtime.errors import InputError
from gen.statistics import rms_slope

ROWS = 64
"""Rows of nodes whose neighbours are gathered at a time, which bounds the memory."""

STEEP = 0.3
"""Rms slope above which half-space theory, made for small slopes, is in doubt; the paper's rough
surfaces have 0.07 to 0.26."""

FLAT = 1e-5
"""Rms slope below which the unit of the heights was probably lost; polished mirrors have 1e-4."""

LEVEL_STEP = 1.5
"""Growth of the steps at the borders of a periodic map from which a level or form deserves a
warning: a little is the slope that the map has there by chance."""

MANY_HOLES = 0.1
"""Share of missing heights above which filling them deserves a warning."""

MOST_HOLES = 0.5
"""Share of missing heights above which filling them is refused unless the user insists."""

TILTED = 0.8
"""Share of the variance in the mean plane from which a map is called tilted: the rms height of this
plane is twice that of the rest. Pieces of self-affine surfaces without a roll-off rarely do."""

FEWEST_TILTED = 8
"""Nodes a side from which a map can be called tilted: a plane fits fewer by chance."""


def prepare(topography: Topography, settings: Preparation) -> Topography:
    """Crop, invert, mask, despike, level, fill, filter and downsample a map, in this order.

    The order is a metrologist's. Heights out of range are no part of any median, so the mask comes
    before the spikes. Spikes would bend a fit, and stand at the rims of holes, which are filled
    from there. The level or form is fitted to measured nodes only. A filter needs all nodes, and
    no slope that its weights would cut off at the borders. Means come last, when the S-filter has
    taken out the waves that they would fold back.

    Parameters
    ----------
    topography : Topography
        Surface as it was measured.
    settings : Preparation
        Steps to take. A surface of which more than `MANY_HOLES` is filled gets a warning.

    Returns
    -------
    Topography
        Surface without holes, with the steps that were taken. One that is still tilted gets a
        warning.

    Raises
    ------
    InputError
        If a setting is not allowed or does not suit the map, holes are left, there are more holes
        than heights, or heights are too large to compute with.
    """
    settings.check()
    if settings.options:
        topography = replace(topography, followed=topography.followed | settings.options)
    if settings.despike or settings.form or settings.filter or settings.downsample:
        steps.require_useful_heights(topography)
    topography = _with_measured_nodes(topography, settings)
    if topography.missing:
        fault = f"{topography.missing} of {topography.heights.size} heights are missing (NaN)"
        remedies = "--fill closes holes", "--crop leaves them out"
        raise InputError(f"{topography.name}: {_advised(topography, fault, *remedies)}")
    short, long = settings.cutoffs()
    if short is not None or long is not None:
        topography = steps.filtered(topography, short, long)
    if settings.downsample is not None:
        topography = steps.downsampled(topography, settings.downsample)
    return _with_tilt_warning(topography)


def _with_measured_nodes(topography: Topography, settings: Preparation) -> Topography:
    """Take the steps for which measured nodes are enough, up to the filling of the others."""
    if settings.crop:
        topography = steps.cropped(topography, settings.crop)
    if settings.invert:
        topography = steps.changed(topography, -topography.heights, "turned upside down")
    kept = settings.kept_heights()
    if kept is not None:
        topography = steps.masked(topography, kept)
    if settings.despike is not None:
        topography = steps.despiked(topography, settings.despike)
    sloping = topography
    if settings.level:
        topography = _levelled(topography, settings.level)
    if settings.form is not None:
        topography = steps.without_form(topography, settings.form)
    topography = _with_level_warning(sloping, topography)
    if (settings.fill or settings.fill_most) and topography.missing:
        topography = _filled(topography, insisted=settings.fill_most)
    return topography


def surface_warnings(topography: Topography) -> list[str]:
    """List reasons to distrust contacts of a surface: spikes, slopes, wrong units.

    Parameters
    ----------
    topography : Topography
        Surface without holes.

    Returns
    -------
    list of str
        One line for each warning, those of reading and preparing included.
    """
    warnings = list(topography.warnings)
    spike = _spike(topography.heights)
    if spike is not None:
        row, column, above = spike
        fault = f"the highest node ({row}, {column}) is a spike from whose tip Delta counts,"
        fault += f" {above:.4g} um above its neighbours"
        remedies = f"--despike {SPIKE:g} removes spikes", "--crop leaves this part out"
        warnings.append(_advised(topography, fault, *remedies))
    slope, step = rms_slope(topography.heights, topography.spacing), max(topography.spacing)
    scale = f"rms slope {slope:.2g} between nodes {step:.3g} um apart"
    if slope > STEEP:
        warnings.append(
            f"{scale}: the theory of the half-space takes slopes for small"
            f" (below {STEEP:g}); check the unit of heights and lengths"
        )
    if 0 < slope < FLAT and step <= WIDEST:  # else their distance is wrong, which `read` says
        fault = f"{scale}: flatter than a mirror; are the heights in metres"
        warnings.append(_advised(topography, fault, "--unit m reads them so"))
    warnings += _border_warnings(topography)
    return warnings


def _border_warnings(topography: Topography) -> list[str]:
    """Warn of a boundary that the file contradicts, or that the heights do: borders that differ."""
    if topography.boundary != "periodic" and topography.repeats:
        fault = (
            f"the file says that its map is periodic, and it is taken as a {topography.boundary}"
        )
        follows = "--boundary periodic of gen describe, contact and law follows the file"
        return [_advised(topography, f"{fault} patch", follows)]
    if topography.boundary != "periodic" or is_tilted(topography):
        return []
    step, rms = _border_step(topography.heights), float(topography.heights.std())
    if step <= rms:
        return []
    said = f"opposite borders differ by {step:.4g} um (rms), more than the rms height, {rms:.4g} um"
    fault = f"{said}: the map is not periodic"
    return [_advised(topography, fault, "--boundary mirror takes it as it is")]


def _border_step(heights: Heights) -> float:
    """Return the larger rms difference between opposite borders [um]; 0 where none was measured."""
    differences = (heights[-1] - heights[0], heights[:, -1] - heights[:, 0])
    squares = (np.square(each[~np.isnan(each)]) for each in differences)
    return max(float(np.sqrt(each.mean())) if each.size else 0.0 for each in squares)


def _with_level_warning(before: Topography, after: Topography) -> Topography:
    """Warn if a level or form taken out of a periodic map has left steps at its borders."""
    if after is before or after.boundary != "periodic":
        return after
    step, was = _border_step(after.heights), _border_step(before.heights)
    if step <= LEVEL_STEP * was:
        return after
    said = f"the fit that was taken out is not periodic: opposite borders differ by {step:.4g} um"
    fault = f"{said} (rms), {was:.4g} um before"
    warning = _advised(after, fault, "--level mean keeps the map periodic")
    return replace(after, warnings=(*after.warnings, warning))


def _advised(topography: Topography, fault: str, *remedies: str) -> str:
    """Add remedies to a fault, each an option and what it does, but none that is followed."""
    followed = {*topography.followed, f"--boundary {topography.boundary}"}
    followed |= {"--unit"} if topography.unit else set()
    left = [each for each in remedies if not each.startswith(tuple(f"{o} " for o in followed))]
    return f"{fault}: {', '.join(left)}" if left else fault


def is_tilted(topography: Topography) -> bool:
    """Tell whether the mean plane of a surface without holes outweighs its roughness."""
    heights = topography.heights
    if min(heights.shape) < FEWEST_TILTED:
        return False
    heights = (heights - heights.mean()) / (float(np.ptp(heights)) or 1.0)
    held = 0.0
    for axis in (0, 1):
        places = np.linspace(-1, 1, heights.shape[axis])
        slope = places @ heights.mean(axis=1 - axis) / (places @ places)
        held += float(slope**2 * np.mean(places**2))
    return held > TILTED * float(heights.var())


def _with_tilt_warning(topography: Topography) -> Topography:
    """Warn of a surface that lies as it lay under its instrument."""
    if not is_tilted(topography):
        return topography
    x, y = tilt(topography)
    fault = f"tilted by {x:.2g} along x and {y:.2g} along y, more than it is rough, so one edge"
    warning = _advised(topography, f"{fault} carries the load", "--level plane takes the tilt out")
    return replace(topography, warnings=(*topography.warnings, warning))


def tilt(topography: Topography) -> tuple[float, float]:
    """Fit a plane to the measured nodes and return its slopes along x and y [1]."""
    _, coefficients = _least_squares(topography.heights, _plane)
    slopes = []
    for side, nodes, slope in zip(
        topography.sides, topography.heights.shape, coefficients[1:], strict=True
    ):
        between = side * ((nodes - 1) / intervals(nodes, topography.boundary))  # outer nodes
        slopes.append(2 * float(slope) / between)
    return slopes[0], slopes[1]


def filled_harmonically(
    heights: Heights, spacing: tuple[float, float], *, periodic: bool = False
) -> Heights:
    """Fill holes with the solution of Laplace's equation between the heights of their rims.

    No flux crosses the border of the patch, unless it is periodic.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights with NaN in the holes, at least one of them finite [um].
    spacing : tuple of float
        Distance of the nodes along x and y [um].
    periodic : bool
        Whether the patch goes on past its border with its opposite side.

    Returns
    -------
    ndarray, shape (nx, ny)
        Heights without NaN; measured heights are kept [um].
    """
    from scipy.sparse.linalg import spsolve

    unknown = np.flatnonzero(np.isnan(heights))
    filled = heights.copy()
    filled.reshape(-1)[unknown] = spsolve(
        *_laplace_equations(heights, spacing, unknown, periodic=periodic)
    )
    return filled


def _laplace_equations(
    heights: Heights, spacing: tuple[float, float], unknown: NDArray[np.intp], *, periodic: bool
) -> tuple[Any, Values]:
    """Assemble the five-point Laplace equation at the unknown nodes: sparse matrix, right side."""
    from scipy.sparse import coo_matrix

    number = np.full(heights.size, -1)
    number[unknown] = np.arange(unknown.size)
    diagonal, right = np.zeros(unknown.size), np.zeros(unknown.size)
    flat, line = heights.reshape(-1), heights.shape[1]
    rows: list[NDArray[np.intp]] = [np.arange(unknown.size)]
    columns: list[NDArray[np.intp]] = [np.arange(unknown.size)]
    weights: list[Values] = [diagonal]
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
    return coo_matrix((np.concatenate(weights), places)).tocsc(), right


def _filled(topography: Topography, *, insisted: bool) -> Topography:
    """Fill holes; warn of many, and refuse more holes than heights unless the user insists."""
    missing, size = topography.missing, topography.heights.size
    share = f"{100 * missing / size:.3g} %"
    if missing > MOST_HOLES * size and not insisted:
        raise InputError(
            f"{topography.name}: {missing} of {size} heights are missing ({share}): --fill would"
            " make up more than was measured; crop, measure again, or insist by --fill-most"
        )
    periodic = topography.boundary == "periodic"
    heights = filled_harmonically(topography.heights, topography.spacing, periodic=periodic)
    filled = steps.changed(topography, heights, f"filled {missing} nodes ({share}) harmonically")
    if missing <= MANY_HOLES * size:
        return filled
    warning = f"{share} of the heights were missing and are filled: filled parts are too smooth"
    return replace(filled, warnings=(*filled.warnings, warning))


def _plane(x: Values, y: Values) -> list[Values]:
    return [np.ones_like(x), x, y]


def _quadratic(x: Values, y: Values) -> list[Values]:
    return [*_plane(x, y), x * x, x * y, y * y]


def _least_squares(
    heights: Heights, terms: Callable[[Values, Values], list[Values]]
) -> tuple[Heights, Values]:
    """Fit terms to the measured nodes.

    Returns
    -------
    fit : ndarray, shape (nx, ny)
        Fit at all nodes [um].
    coefficients : ndarray
        One for each term, with coordinates from -1 to 1 along both axes [um].
    """
    x, y = np.meshgrid(*(np.linspace(-1, 1, nodes) for nodes in heights.shape), indexing="ij")
    columns = terms(x, y)
    measured = ~np.isnan(heights)
    matrix = np.stack([column[measured] for column in columns], axis=1)
    offset = float(np.mean(heights[measured]))
    coefficients = np.linalg.lstsq(matrix, heights[measured] - offset, rcond=None)[0]
    fit: Heights = sum(
        (c * column for c, column in zip(coefficients, columns, strict=True)),
        np.full_like(heights, offset),
    )
    return fit, np.asarray(coefficients)


def _levelled(topography: Topography, level: str) -> Topography:
    """Subtract a least-squares fit of the measured nodes."""
    heights = topography.heights
    if level == "mean":
        mean = float(np.nanmean(heights))
        return steps.changed(topography, heights - mean, f"levelled by the mean, {mean:.6g} um")
    slopes = tilt(topography)
    fit, _ = _least_squares(heights, _plane if level == "plane" else _quadratic)
    was = f"tilt was {slopes[0]:.4g} along x, {slopes[1]:.4g} along y"
    return steps.changed(topography, heights - fit, f"levelled by a {level} ({was})")


def _spike(heights: Heights) -> tuple[int, int, float] | None:
    """Find out whether the highest node is a spike.

    Returns
    -------
    tuple of (int, int, float), optional
        Row, column, and height above the median of its neighbours [um]; None if it is no spike.
    """
    # The odd reflection continues slopes beyond the border.
    padded = np.pad(heights, 1, mode="reflect", reflect_type="odd")
    nx, ny = heights.shape
    above = np.empty(heights.shape)
    for first in range(0, nx, ROWS):
        rows = min(ROWS, nx - first)
        neighbours = np.stack(
            [
                padded[1 + i + first : 1 + i + first + rows, 1 + j : 1 + j + ny]
                for i in (-1, 0, 1)
                for j in (-1, 0, 1)
                if i or j
            ]
        )
        above[first : first + rows] = heights[first : first + rows] - np.median(neighbours, axis=0)
    above -= np.median(above)
    usual = 1.4826 * float(np.median(np.abs(above)))
    row, column = np.unravel_index(int(np.argmax(heights)), heights.shape)
    step = float(above[row, column])
    noise = 1e-9 * float(np.ptp(heights))
    return (int(row), int(column), step) if step > SPIKE * max(usual, noise) else None
