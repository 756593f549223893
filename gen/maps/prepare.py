"""Prepare a measured map for contact by the steps that the user chose, and record each step.

Warnings name the reasons to distrust the prepared map: codes for missing heights, pits and spikes,
a tilt, lines at different heights, steep slopes, opposite borders that differ, and a lost unit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Heights, Values
from gen.doubts import STEEP, steep_slopes
from gen.maps.codes import refuse_overflowing_heights, with_code_warnings
from gen.maps.filters import filled, filtered, without_form
from gen.maps.lines import (
    shifts_of_lines,
    with_line_warning,
    without_straight_line,
)
from gen.maps.needs import MANY_SPIKES, MapNeeds, with_needed_steps
from gen.maps.outliers import local_medians, scatter_of, with_outlier_warnings
from gen.maps.read import BEYOND_INSTRUMENTS, NEAREST, WIDEST, Remedy, Topography
from gen.maps.settings import KEYS, SPIKE, Reading, as_option, numbers_in
from gen.runtime.errors import InputError
from gen.statistics import rms_slope

# Nodes outside the ends of a crop by up to this distance [spacing] are kept, because the ends are
# rounded.
ROUNDING = 1e-9
# Smallest relative change of the rms height or the rms slope that the steps of `--prepare` report.
REPORTED = 0.05


def prepare(topography: Topography, settings: Reading) -> Topography:
    """Crop, invert, mask, despike, level, fill, filter and downsample a map, in this order.

    Only the steps that the settings name are taken. The setting `prepare` adds the steps that the
    map needs after it was cropped and masked.

    The order is that of metrologists. A map is masked before it is despiked, so that heights out of
    range are no part of a median. It is despiked before it is levelled, because spikes would bend
    the fit, and before its holes are filled from their rims. It is filtered afterwards, because a
    filter needs all nodes and no slope at the borders. It is downsampled last, when the S-filter
    has removed the short waves that means of nodes would fold into long ones.

    Parameters
    ----------
    topography : Topography
        A map as it was read.
    settings : Reading
        The steps to take, with their values.

    Returns
    -------
    Topography
        The prepared map without holes. A line for each step is added to its `steps`, and one for
        each reason to distrust its heights to its `warnings`. `doubtful` are the nodes of codes,
        spikes and pits, unless the map was downsampled; `followed` are the steps that were taken.

    Raises
    ------
    InputError
        If a setting does not suit the map, or heights are missing and the settings do not fill
        them.
    """
    _refuse_two_forms(settings)
    topography = _following(topography, settings)
    topography = _after_steps(topography, settings, "crop", "invert", "mask")
    refuse_overflowing_heights(topography)
    as_measured = topography
    if settings.prepare:
        settings = _with_steps_for(topography, settings)
        topography = _following(topography, settings)
    topography = _after_steps(topography, settings, "despike")
    topography = with_code_warnings(topography)
    topography = _with_span_warning(topography)
    measured = topography.heights
    topography = _after_steps(topography, settings, "level", "form", "fill", "fill_most")
    _refuse_holes(topography)
    if settings.prepare:
        effect = effect_of_steps(as_measured, topography)
        if effect:
            topography = replace(topography, steps=(*topography.steps, effect))
    untilted = _without_tilt(topography)
    topography = with_outlier_warnings(topography, measured, untilted)
    topography = with_line_warning(topography)
    topography = _after_steps(topography, settings, "filter", "downsample")
    return _with_tilt_warning(topography)


def _refuse_two_forms(settings: Reading) -> None:
    """Raise InputError if both a level and a form are to be subtracted.

    Lines may be shifted to each other before a form is subtracted.
    """
    if settings.level not in {"", "lines"} and settings.form is not None:
        raise InputError(
            f"--level {settings.level} and --form {settings.form} given: give one; forms"
            " of degree 1 and 2 are levels too"
        )


def _following(topography: Topography, settings: Reading) -> Topography:
    """Record the steps that the settings take, so that no later warning advises them."""
    followed = topography.followed | _followed_steps(settings)
    return replace(topography, followed=followed)


def needed_steps(topography: Topography, settings: Reading) -> Reading:
    """Choose the steps that `--prepare` takes for a map, as `gen scene` chooses them.

    Parameters
    ----------
    topography : Topography
        The map as it was read.
    settings : Reading
        The settings of the user. Steps in them are kept.

    Returns
    -------
    Reading
        The settings with the chosen steps.

    Raises
    ------
    InputError
        If a setting does not suit the map.
    """
    part = _after_steps(topography, settings, "crop", "invert", "mask")
    return _with_steps_for(part, settings)


def _with_steps_for(part: Topography, settings: Reading) -> Reading:
    """Return the settings with the steps that a cropped and masked map needs."""
    return with_needed_steps(settings, [MapNeeds.of(part.heights)])


def effect_of_steps(as_measured: Topography, prepared: Topography) -> str:
    """Say by how much the steps of a preparation have changed the roughness of a map.

    Parameters
    ----------
    as_measured : Topography
        The map before the steps, which may have holes.
    prepared : Topography
        The map after the steps, without holes.

    Returns
    -------
    str
        A clause with the rms height and the rms slope before and after the steps, or with the one
        that has changed by more than the share `REPORTED`; "" if neither has.
    """
    height_before = float(np.nanstd(as_measured.heights))
    height = float(prepared.heights.std())
    slope_before = rms_slope(as_measured.heights, as_measured.spacing)
    slope = rms_slope(prepared.heights, prepared.spacing)
    changes = []
    if is_changed(height_before, height):
        changes.append(f"the rms height from {height_before:.3g} to {height:.3g} um")
    if is_changed(slope_before, slope):
        changes.append(f"the rms slope from {slope_before:.3g} to {slope:.3g}")
    if not changes:
        return ""
    return f"these steps change {' and '.join(changes)}"


def is_changed(before: float, after: float) -> bool:
    """Return whether a number has changed enough by a preparation to report it.

    Parameters
    ----------
    before, after : float
        The number without and with the steps, in the same unit; 0 or more.

    Returns
    -------
    bool
        Whether it has changed by more than the share `REPORTED`.
    """
    return abs(after - before) > REPORTED * before


def _followed_steps(settings: Reading) -> frozenset[str]:
    """Return the steps that the settings take, as `Remedy.setting` writes them.

    Warnings advise none of these steps again. A step is a key of the settings, as "crop". "level"
    is followed by its kind, as "level plane". "despike" is followed by the threshold that warnings
    advise, and is left out if the user's threshold is higher.
    """
    steps = {key for key in STEPS if getattr(settings, key)}
    if settings.level:
        steps.remove("level")
        steps.add(f"level {settings.level}")
    if settings.despike:
        steps.remove("despike")
        # A lower threshold replaces all spikes that the advised threshold would.
        if settings.despike <= SPIKE:
            steps.add(f"despike {SPIKE:g}")
    return frozenset(steps)


def _after_steps(topography: Topography, settings: Reading, *keys: str) -> Topography:
    """Return the map after the steps of the given keys of the settings, in their order.

    A key that the user has not set is skipped. So are "fill" and "fill_most" if no height is
    missing. Raise InputError if the value of a key is not allowed, or its step fails.
    """
    for key in keys:
        value = getattr(settings, key)
        # The number 0 counts as set, so that the check below refuses it.
        if value is None or value is False or value == "":
            continue
        # The map had no holes, or "fill" has closed them before "fill_most".
        if key in {"fill", "fill_most"} and not topography.missing:
            continue
        if not KEYS[key].suits(value):
            option = as_option(f"{key} {value!r}")
            raise InputError(f"{option}: give {KEYS[key].allowed}")
        topography = STEPS[key](topography, settings)
    return topography


def _refuse_holes(topography: Topography) -> None:
    """Raise InputError if heights are missing; the message advises to fill or crop them."""
    if not topography.missing:
        return
    fault = f"{topography.missing} of {topography.heights.size} heights are missing (NaN)"
    fill = Remedy("fill", "closes holes")
    crop = Remedy("crop", "leaves them out")
    raise InputError(f"{topography.name}: {topography.advised(fault, fill, crop)}")


def _with_warning(topography: Topography, warning: str) -> Topography:
    """Return the map with one more warning."""
    return replace(topography, warnings=(*topography.warnings, warning))


def _with_span_warning(topography: Topography) -> Topography:
    """Add a warning if the heights, codes left out, span more or less than instruments measure."""
    heights = _without_doubtful(topography)
    span = float(np.nanmax(heights) - np.nanmin(heights))
    if span == 0 or NEAREST <= span <= WIDEST:
        return topography
    warning = f"its heights span {span:.3g} um, {BEYOND_INSTRUMENTS}"
    return _with_warning(topography, warning)


def _with_tilt_warning(topography: Topography) -> Topography:
    """Add a warning if the mean plane of a map without holes outweighs its roughness.

    Doubtful nodes are left out.
    """
    heights = _without_doubtful(topography)
    mean = float(np.nanmean(heights))
    complete = np.nan_to_num(heights, nan=mean)
    if not is_tilted(replace(topography, heights=complete)):
        return topography
    tilt = least_squares(replace(topography, heights=heights)).tilt
    fault = (
        f"tilted by {tilt.x:.2g} along x and {tilt.y:.2g} along y, more than it is rough,"
        " so one edge carries the load"
    )
    warning = topography.advised(fault, Remedy("level plane", "takes the tilt out"))
    return _with_warning(topography, warning)


def _without_tilt(topography: Topography) -> Heights:
    """Return the heights [um] of a map without holes, less its mean plane if this is a tilt.

    A mean plane is a tilt if it outweighs the roughness (`is_tilted`, judged by all nodes);
    otherwise the heights are returned as they are. Doubtful nodes are left out of the fit.
    """
    if not is_tilted(topography):
        return topography.heights
    heights = _without_doubtful(topography)
    plane = least_squares(replace(topography, heights=heights)).heights
    return topography.heights - plane


def _without_doubtful(topography: Topography) -> Heights:
    """Return the heights [um] with NaN at nodes that a warning calls codes, pits or spikes.

    Return all heights if they would leave no two neighbours along x, or none along y, because
    slopes need neighbours.
    """
    doubtful = topography.doubtful
    if doubtful is None:
        return topography.heights
    trusted = ~doubtful
    pairs_along_x = trusted[1:] & trusted[:-1]
    pairs_along_y = trusted[:, 1:] & trusted[:, :-1]
    if not pairs_along_x.any() or not pairs_along_y.any():
        return topography.heights
    return np.where(doubtful, np.nan, topography.heights)


STEPS: Mapping[str, Callable[[Topography, Any], Topography]] = {
    "crop": lambda topography, settings: cropped(topography, settings.crop),
    "invert": lambda topography, _: inverted(topography),
    "mask": lambda topography, settings: masked(topography, *settings.ends("mask")),
    "despike": lambda topography, settings: despiked(topography, settings.despike),
    "level": lambda topography, settings: levelled(topography, settings.level),
    "form": lambda topography, settings: without_form(topography, settings.form),
    "fill": lambda topography, settings: filled(topography, insisted=settings.fill_most),
    "fill_most": lambda topography, _: filled(topography, insisted=True),
    "filter": lambda topography, settings: filtered(topography, *settings.ends("filter")),
    "downsample": lambda topography, settings: downsampled(
        topography, settings.downsample
    ),
}
"""Function of each step by its key in the settings, in the order in which steps are taken.

A function takes a map and the settings, and returns the map after the step."""


def cropped(topography: Topography, text: str) -> Topography:
    """Cut a part out of a map.

    Parameters
    ----------
    topography : Topography
        The map.
    text : str
        Distances of the part's ends from the first node along x and y, as "x0:x1,y0:y1" [um].

    Returns
    -------
    Topography
        The map of the nodes within these ends, both included.

    Raises
    ------
    InputError
        If the text is not of this form, or the part has fewer than 2 x 2 nodes or no height.
    """
    option = f"--crop {text!r}"
    limits = [numbers_in(part, ":") for part in text.split(",")]
    if [len(ends) for ends in limits] != [2, 2]:
        raise InputError(f"{option}: give x0:x1,y0:y1 in um, as 100:900,0:500")
    heights = topography.heights
    for axis, (low, high) in enumerate(limits):
        spacing = topography.spacing[axis]
        nodes = np.arange(heights.shape[axis])
        from_low = nodes >= low / spacing - ROUNDING
        to_high = nodes <= high / spacing + ROUNDING
        heights = np.compress(from_low & to_high, heights, axis)
    if min(heights.shape) < 2:
        sides = " x ".join(f"{side:.6g}" for side in topography.sides)
        raise InputError(f"{option}: holds fewer than 2 x 2 nodes of {sides} um")
    if np.isnan(heights).all():
        raise InputError(f"{option}: all heights are missing there")
    step = f"cropped to {heights.shape[0]} x {heights.shape[1]} nodes, {text} um"
    return topography.changed(heights, step, topography.spacing)


def inverted(topography: Topography) -> Topography:
    """Change the sign of all heights, for a map whose heights point into the material.

    Parameters
    ----------
    topography : Topography
        The map.

    Returns
    -------
    Topography
        The map that is turned upside down.
    """
    return topography.changed(-topography.heights, "turned upside down")


def masked(
    topography: Topography, lowest: float | None, highest: float | None
) -> Topography:
    """Make holes of all heights outside a range.

    Parameters
    ----------
    topography : Topography
        The map.
    lowest, highest : float or None
        Ends of the range, which belong to it [um]; None for no end.

    Returns
    -------
    Topography
        The map with NaN at nodes outside the range.

    Raises
    ------
    InputError
        If no height is in the range.
    """
    heights = topography.heights
    below = -np.inf if lowest is None else lowest
    above = np.inf if highest is None else highest
    outside = (heights < below) | (heights > above)
    kept = np.where(outside, np.nan, heights)
    if np.isnan(kept).all():
        raise InputError(
            f"{topography.name}: --mask {below:g}:{above:g} leaves no height, they are"
            f" {np.nanmin(heights):.6g} to {np.nanmax(heights):.6g} um"
        )
    step = f"masked {_share(outside)} outside {below:g} to {above:g} um"
    return topography.changed(kept, step)


def despiked(topography: Topography, threshold: float) -> Topography:
    """Replace spikes by their local median, and warn if there are too many to be spikes.

    Parameters
    ----------
    topography : Topography
        The map.
    threshold : float
        Distance from its local median above which a node is a spike, over the scatter of the
        distances of all nodes, see `gen.maps.outliers.scatter_of` [1].

    Returns
    -------
    Topography
        The map without spikes, with one more warning if they were more than `MANY_SPIKES` of all
        nodes.
    """
    heights = topography.heights
    medians = local_medians(heights)
    distances = heights - medians
    scatter = scatter_of(distances, heights)
    with np.errstate(over="ignore"):  # If the product overflows, no node is a spike.
        spikes = np.abs(distances) > threshold * scatter
    replaced = _share(spikes)
    step = (
        f"despiked: {replaced} further than {threshold:g} times the scatter from their"
        " local median"
    )
    despiked_heights = np.where(spikes, medians, heights)
    despiked_map = topography.changed(despiked_heights, step)
    if spikes.mean() <= MANY_SPIKES:
        return despiked_map
    warning = (
        f"{replaced} were taken out as spikes: probably a part of the surface;"
        " raise --despike"
    )
    return _with_warning(despiked_map, warning)


@dataclass(frozen=True)
class Tilt:
    """Slopes of a plane or quadratic in the middle of a map."""

    x: float  # slope along x [1]
    y: float  # slope along y [1]


@dataclass(frozen=True, eq=False)
class LeastSquares:
    """A plane or a quadratic that was fitted to a map by least squares."""

    heights: Heights  # heights of the fit at all nodes [um], shape (nx, ny)
    tilt: Tilt  # slopes of the fit in the middle of the map


def least_squares(topography: Topography, degree: Literal[1, 2] = 1) -> LeastSquares:
    """Fit a plane or a quadratic to the measured nodes of a map.

    Parameters
    ----------
    topography : Topography
        The map, which may have holes but has a height.
    degree : {1, 2}, optional
        1 for a plane, 2 for a quadratic.

    Returns
    -------
    LeastSquares
        Heights of the fit, also at holes, and its tilt.
    """
    heights = topography.heights
    nx, ny = heights.shape
    # coordinates from -1 at the first node to 1 at the last one
    along_x = np.linspace(-1, 1, nx)
    along_y = np.linspace(-1, 1, ny)
    x, y = np.meshgrid(along_x, along_y, indexing="ij")
    terms = [np.ones_like(x), x, y]
    if degree == 2:
        terms += [x * x, x * y, y * y]
    measured = ~np.isnan(heights)
    matrix = np.stack([term[measured] for term in terms], axis=1)
    offset = float(np.mean(heights[measured]))
    right = heights[measured] - offset
    coefficients = np.linalg.lstsq(matrix, right, rcond=None)[0]
    fit = np.full_like(heights, offset)
    for coefficient, term in zip(coefficients, terms, strict=True):
        fit = fit + coefficient * term
    # distances of the last node from the first one, along x and y [um]
    lengths = np.subtract(heights.shape, 1) * topography.spacing
    slopes = 2 * coefficients[1:3] / lengths
    tilt = Tilt(x=float(slopes[0]), y=float(slopes[1]))
    return LeastSquares(heights=fit, tilt=tilt)


def levelled(topography: Topography, level: str) -> Topography:
    """Subtract the mean of the measured nodes, or a plane or quadratic fitted to them.

    The level "lines" shifts the lines along x to each other before it subtracts a plane.

    Parameters
    ----------
    topography : Topography
        The map.
    level : {"mean", "plane", "quadratic", "lines"}
        Mean, plane or quadratic surface to subtract; or "lines", to shift each line along x until
        its median difference from the line before it is 0, and then to subtract a plane.

    Returns
    -------
    Topography
        The levelled map. Its new line of `steps` names the mean height or the tilt.
    """
    heights = topography.heights
    if level == "mean":
        mean = float(np.nanmean(heights))
        return topography.changed(heights - mean, f"levelled by the mean, {mean:.6g} um")
    if level == "lines":
        return _levelled_by_lines(topography)
    plane = least_squares(topography)
    fit = plane
    if level == "quadratic":
        fit = least_squares(topography, degree=2)
    tilt = f"tilt was {plane.tilt.x:.4g} along x, {plane.tilt.y:.4g} along y"
    step = f"levelled by a {level} ({tilt})"
    return topography.changed(heights - fit.heights, step)


def _levelled_by_lines(topography: Topography) -> Topography:
    """Shift the lines of a map to each other, and subtract a plane."""
    shifts = shifts_of_lines(topography.heights)
    heights = topography.heights - shifts
    plane = least_squares(replace(topography, heights=heights))
    tilt = least_squares(topography).tilt
    # The straight line in the shifts is a tilt of the map.
    off = _rms(without_straight_line(shifts))
    step = (
        f"levelled by lines along x, which were off by {off:.4g} um (rms), then by a plane (tilt"
        f" was {tilt.x:.4g} along x, {tilt.y:.4g} along y)"
    )
    return topography.changed(heights - plane.heights, step)


def downsampled(topography: Topography, nodes: int) -> Topography:
    """Replace each square of nodes by its mean, and leave out nodes beyond the last square.

    Parameters
    ----------
    topography : Topography
        The map, without holes.
    nodes : int
        Nodes along each side of a square.

    Returns
    -------
    Topography
        The coarser map; its spacing is `nodes` times as large.

    Raises
    ------
    InputError
        If fewer than 2 x 2 nodes are left.
    """
    heights = topography.heights
    old_nx, old_ny = heights.shape
    nx = old_nx // nodes
    ny = old_ny // nodes
    if min(nx, ny) < 2:
        raise InputError(
            f"{topography.name}: --downsample {nodes} leaves fewer than 2 x 2 of"
            f" {old_nx} x {old_ny} nodes"
        )
    inside = heights[: nx * nodes, : ny * nodes]
    squares = inside.reshape(nx, nodes, ny, nodes)
    means = squares.mean(axis=(1, 3))
    step = f"downsampled to {nx} x {ny} means of {nodes} x {nodes} nodes"
    beyond_x = old_nx % nodes
    beyond_y = old_ny % nodes
    if beyond_x or beyond_y:
        step += f", the last {beyond_x} and {beyond_y} lines left out"
    dx, dy = topography.spacing
    return topography.changed(means, step, (nodes * dx, nodes * dy))


def _share(chosen: NDArray[np.bool_]) -> str:
    """Write the number of chosen nodes and their share of all nodes, as "12 nodes (0.3 %)"."""
    number = int(np.count_nonzero(chosen))
    noun = "node" if number == 1 else "nodes"
    return f"{number} {noun} ({100 * number / chosen.size:.3g} %)"


# rms slope below which the unit of the heights was probably lost: even polished mirrors have 1e-4
FLAT = 1e-5
# share of the variance of the heights that the mean plane of a tilted map has at least. The rms
# height of this plane is then twice that of the roughness. Pieces of self-affine surfaces without a
# roll-off rarely reach this share.
TILTED = 0.8
# nodes a side that a tilted map has at least: a plane fits fewer nodes by chance
FEWEST_TILTED = 8


def surface_warnings(topography: Topography) -> list[str]:
    """List the reasons to distrust contacts of a surface.

    Parameters
    ----------
    topography : Topography
        A prepared surface, without holes.

    Returns
    -------
    list of str
        One line for each reason: the warnings of the map, then steep slopes, a lost unit of the
        heights, and borders of a periodic patch that do not meet.
    """
    warnings = list(topography.warnings)
    slope = rms_slope(_without_doubtful(topography), topography.spacing)
    apart = max(topography.spacing)
    if slope > STEEP:
        warnings.append(steep_slopes(slope, apart))
    # Nodes that are too far apart make slopes small, too; `read` warns of them.
    if 0 < slope < FLAT and apart <= WIDEST:
        fault = (
            f"rms slope {slope:.2g} between nodes {apart:.3g} um apart: flatter than a"
            " mirror; are the heights in metres"
        )
        warnings.append(topography.advised(fault, Remedy("unit m", "reads them so")))
    # Borders of a tilted map differ, too, and it has a warning already.
    if topography.boundary == "periodic" and not is_tilted(topography):
        warnings += _border_warnings(topography)
    return warnings


def _border_warnings(topography: Topography) -> list[str]:
    """Return a warning if opposite borders of a map differ by more than its rms height.

    The list is empty if they do not.
    """
    heights = topography.heights
    steps_along_x = heights[-1] - heights[0]
    steps_along_y = heights[:, -1] - heights[:, 0]
    step = max(_rms(steps_along_x), _rms(steps_along_y))
    rms_height = heights.std()
    if step <= rms_height:
        return []
    fault = (
        f"opposite borders differ by {step:.4g} um (rms), more than the rms height,"
        f" {rms_height:.4g} um: the map is not periodic"
    )
    return [topography.advised(fault, Remedy("boundary mirror", "takes it as it is"))]


def _rms(values: Values) -> float:
    """Return the root mean square of numbers, in their unit."""
    return float(np.sqrt(np.mean(values**2)))


def is_tilted(topography: Topography) -> bool:
    """Tell whether the mean plane of a surface outweighs its roughness.

    Parameters
    ----------
    topography : Topography
        The surface, without holes.

    Returns
    -------
    bool
        Whether the plane has more than `TILTED` of the variance of the heights; False for fewer
        than `FEWEST_TILTED` nodes along a side.
    """
    heights = topography.heights
    if min(heights.shape) < FEWEST_TILTED:
        return False
    span = float(np.ptp(heights)) or 1.0  # 1 for a flat surface, to divide by
    scaled = (heights - heights.mean()) / span
    plane_variance = 0.0
    for axis in (0, 1):
        places = np.linspace(-1, 1, heights.shape[axis])
        profile = scaled.mean(axis=1 - axis)  # mean profile along the axis
        slope = places @ profile / (places @ places)
        plane_variance += float(slope**2 * np.mean(places**2))
    return plane_variance > TILTED * float(scaled.var())
