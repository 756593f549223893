"""Reasons to distrust a map: its tilt, a spike, its slopes, borders that differ, a lost unit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gen.arrays import Heights
from gen.maps.filters import least_squares, plane
from gen.maps.read import WIDEST, Topography, intervals
from gen.maps.settings import SPIKE
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


TILTED = 0.8
"""Share of the variance in the mean plane from which a map is called tilted: the rms height of this
plane is twice that of the rest. Pieces of self-affine surfaces without a roll-off rarely do."""


FEWEST_TILTED = 8
"""Nodes a side from which a map can be called tilted: a plane fits fewer by chance."""


def surface_warnings(topography: Topography) -> list[str]:
    """List reasons to distrust contacts of a surface: spikes, slopes, wrong units."""
    warnings = list(topography.warnings)
    spike = _spike(topography.heights)
    if spike is not None:
        row, column, above = spike
        fault = f"the highest node ({row}, {column}) is a spike from whose tip Delta counts,"
        fault += f" {above:.4g} um above its neighbours"
        remedies = (f"despike {SPIKE:g}", "removes spikes"), ("crop", "leaves this part out")
        warnings.append(advised(topography, fault, *remedies))
    slope, step = rms_slope(topography.heights, topography.spacing), max(topography.spacing)
    scale = f"rms slope {slope:.2g} between nodes {step:.3g} um apart"
    if slope > STEEP:
        warnings.append(
            f"{scale}: the theory of the half-space takes slopes for small"
            f" (below {STEEP:g}); check the unit of heights and lengths"
        )
    if 0 < slope < FLAT and step <= WIDEST:  # else their distance is wrong, which `read` says
        fault = f"{scale}: flatter than a mirror; are the heights in metres"
        warnings.append(advised(topography, fault, ("unit m", "reads them so")))
    warnings += _border_warnings(topography)
    return warnings


def _border_warnings(topography: Topography) -> list[str]:
    """Warn of a boundary that the file contradicts, or that the heights do: borders that differ."""
    if topography.boundary != "periodic" and topography.repeats:
        fault = (
            f"the file says that its map is periodic, and it is taken as a {topography.boundary}"
        )
        follows = "boundary periodic", "of gen describe, contact and law follows the file"
        return [advised(topography, f"{fault} patch", follows)]
    if topography.boundary != "periodic" or is_tilted(topography):
        return []
    step, rms = _border_step(topography.heights), float(topography.heights.std())
    if step <= rms:
        return []
    said = f"opposite borders differ by {step:.4g} um (rms), more than the rms height, {rms:.4g} um"
    fault = f"{said}: the map is not periodic"
    return [advised(topography, fault, ("boundary mirror", "takes it as it is"))]


def _border_step(heights: Heights) -> float:
    """Return the larger rms difference between opposite borders [um]; 0 where none was measured."""
    differences = (heights[-1] - heights[0], heights[:, -1] - heights[:, 0])
    squares = (np.square(each[~np.isnan(each)]) for each in differences)
    return max(float(np.sqrt(each.mean())) if each.size else 0.0 for each in squares)


def with_level_warning(before: Topography, after: Topography) -> Topography:
    """Warn if a level or form taken out of a periodic map has left steps at its borders."""
    if after is before or after.boundary != "periodic":
        return after
    step, was = _border_step(after.heights), _border_step(before.heights)
    if step <= LEVEL_STEP * was:
        return after
    said = f"the fit that was taken out is not periodic: opposite borders differ by {step:.4g} um"
    fault = f"{said} (rms), {was:.4g} um before"
    warning = advised(after, fault, ("level mean", "keeps the map periodic"))
    return replace(after, warnings=(*after.warnings, warning))


def advised(topography: Topography, fault: str, *remedies: tuple[str, str]) -> str:
    """Add remedies to a fault, each a step and what it does, but none that is followed."""
    followed = {*topography.followed, f"boundary {topography.boundary}"}
    followed |= {"unit m"} if topography.unit else set()
    left = [f"{topography.said(step)} {does}" for step, does in remedies if step not in followed]
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


def with_tilt_warning(topography: Topography) -> Topography:
    """Warn of a surface that lies as it lay under its instrument."""
    if not is_tilted(topography):
        return topography
    x, y = tilt(topography)
    fault = f"tilted by {x:.2g} along x and {y:.2g} along y, more than it is rough, so one edge"
    warning = advised(
        topography, f"{fault} carries the load", ("level plane", "takes the tilt out")
    )
    return replace(topography, warnings=(*topography.warnings, warning))


def tilt(topography: Topography) -> tuple[float, float]:
    """Fit a plane to the measured nodes and return its slopes along x and y [1]."""
    _, coefficients = least_squares(topography.heights, plane)
    slopes = []
    for side, nodes, slope in zip(
        topography.sides, topography.heights.shape, coefficients[1:], strict=True
    ):
        between = side * ((nodes - 1) / intervals(nodes, topography.boundary))  # outer nodes
        slopes.append(2 * float(slope) / between)
    return slopes[0], slopes[1]


def _spike(heights: Heights) -> tuple[int, int, float] | None:
    """Return node and height above its neighbours [um] of the highest node if it is a spike."""
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
