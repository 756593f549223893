"""Prepare a measured topography for contact: only the steps that the user asks for, recorded.

Reasons to distrust what is left are codes for missing heights, pits and spikes, a tilt, slopes,
borders that differ, and a lost unit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Heights
from gen.doubts import STEEP, steep_slopes
from gen.maps.filters import filled, filtered, without_form
from gen.maps.outliers import (
    local_medians,
    refuse_beyond_numbers,
    with_codes_named,
    with_single_named,
)
from gen.maps.read import BEYOND_INSTRUMENTS, NEAREST, WIDEST, Sides, Topography, read
from gen.maps.settings import KEYS, SPIKE, Reading, as_option, numbers_in
from gen.runtime.errors import InputError
from gen.statistics import rms_slope

if TYPE_CHECKING:
    from bem.problem import Boundary
    from gen.maps.bodies import Opposite

ROUNDING = 1e-9  # relative difference of numbers that are taken for the same
# share of nodes above which those taken out as spikes are probably part of the surface
MANY_SPIKES = 0.01


def prepare(topography: Topography, settings: Reading) -> Topography:
    """Crop, invert, mask, despike, level, fill, filter and downsample a map, in this order.

    Heights out of range are no part of any median, so the mask comes before the spikes. Spikes
    would bend a fit, and stand at the rims of holes, which are filled from there. A filter needs
    all nodes, and no slope at the borders. Means come last, when the S-filter has taken out the
    waves that they would fold back. Raises InputError if a setting does not suit the map.
    """
    if settings.level and settings.form is not None:
        raise InputError(
            f"--level {settings.level} and --form {settings.form} given: give one; forms of"
            " degree 1 and 2 are levels too"
        )
    followed = {key for key in STEPS if getattr(settings, key)} - {"level", "despike"}
    followed |= {f"level {settings.level}"} if settings.level else set()
    # a threshold of spikes counts as the one that is advised if it takes out as many
    followed |= {f"despike {SPIKE:g}"} if (settings.despike or np.inf) <= SPIKE else set()
    followed |= topography.followed
    topography = replace(topography, followed=frozenset(followed))
    topography = _taken(topography, settings, "crop", "invert", "mask")
    refuse_beyond_numbers(topography)
    topography = _taken(topography, settings, "despike")
    topography = _with_span_named(with_codes_named(topography))
    measured = topography.heights
    topography = _taken(topography, settings, "level", "form", "fill", "fill_most")
    if topography.missing:  # from here on every node is needed
        fault = (
            f"{topography.missing} of {topography.heights.size} heights are missing (NaN)"
        )
        remedies = ("fill", "closes holes"), ("crop", "leaves them out")
        raise InputError(f"{topography.name}: {topography.advised(fault, *remedies)}")
    topography = with_single_named(topography, measured, _without_tilt(topography))
    topography = _taken(topography, settings, "filter", "downsample")
    return _with_tilt_named(topography)


def _taken(topography: Topography, settings: Reading, *keys: str) -> Topography:
    """Take the steps of some keys that are given, in this order; refuse a value that is wrong."""
    for key in keys:
        value, whole = getattr(settings, key), not topography.missing
        if (
            value is None
            or value is False
            or value == ""
            or (whole and key.startswith("fill"))
        ):
            continue
        if not KEYS[key].suits(value):
            option = as_option(f"{key} {value!r}")
            raise InputError(f"{option}: give {KEYS[key].allowed}")
        topography = STEPS[key](topography, settings)
    return topography


def _with_span_named(topography: Topography) -> Topography:
    """Warn if heights that are no codes span more or less than instruments measure."""
    heights = _without_doubtful(topography)
    span = float(np.nanmax(heights) - np.nanmin(heights))
    if not span or NEAREST <= span <= WIDEST:
        return topography
    warning = f"its heights span {span:.3g} um, {BEYOND_INSTRUMENTS}"
    return replace(topography, warnings=(*topography.warnings, warning))


def _with_tilt_named(topography: Topography) -> Topography:
    """Warn if the mean plane of a map outweighs its roughness."""
    heights = _without_doubtful(topography)
    whole = replace(
        topography, heights=np.nan_to_num(heights, nan=float(np.nanmean(heights)))
    )
    if not is_tilted(whole):
        return topography
    _, (x, y) = least_squares(replace(topography, heights=heights))
    fault = f"tilted by {x:.2g} along x and {y:.2g} along y, more than it is rough, so one edge"
    fault += " carries the load"  # as the map lay under its instrument
    warning = topography.advised(fault, ("level plane", "takes the tilt out"))
    return replace(topography, warnings=(*topography.warnings, warning))


def _without_tilt(topography: Topography) -> Heights:
    """Return the heights without their mean plane if it outweighs the roughness."""
    if not is_tilted(topography):
        return topography.heights
    heights = _without_doubtful(topography)
    plane, _ = least_squares(replace(topography, heights=heights))
    return topography.heights - plane


def _without_doubtful(topography: Topography) -> Heights:
    """Return the heights with NaN at nodes that a warning calls codes, pits or spikes.

    They are all there if too few others are left for slopes along both axes.
    """
    if topography.doubtful is None:
        return topography.heights
    known = ~topography.doubtful
    if not (known[1:] & known[:-1]).any() or not (known[:, 1:] & known[:, :-1]).any():
        return topography.heights
    return np.where(topography.doubtful, np.nan, topography.heights)


# what each key of the preparation does, if it is given, in the order of the steps
STEPS: Mapping[str, Callable[[Topography, Any], Topography]] = {
    "crop": lambda given, how: cropped(given, how.crop),
    "invert": lambda given, _: given.changed(-given.heights, "turned upside down"),
    "mask": lambda given, how: masked(given, how.ends("mask")),
    "despike": lambda given, how: despiked(given, how.despike),
    "level": lambda given, how: levelled(given, how.level),
    "form": lambda given, how: without_form(given, how.form),
    "fill": lambda given, how: filled(given, insisted=how.fill_most),
    "fill_most": lambda given, how: filled(given, insisted=how.fill_most),
    "filter": lambda given, how: filtered(given, *how.ends("filter")),
    "downsample": lambda given, how: downsampled(given, how.downsample),
}


def cropped(topography: Topography, text: str) -> Topography:
    """Cut out the nodes within "x0:x1,y0:y1" [um]."""
    named = f"--crop {text!r}"
    spacing = topography.spacing
    limits = [numbers_in(part, ":") for part in text.split(",")]
    if [len(ends) for ends in limits] != [2, 2]:
        raise InputError(f"{named}: give x0:x1,y0:y1 in um, as 100:900,0:500")
    heights = topography.heights
    for axis, ((low, high), apart) in enumerate(zip(limits, spacing, strict=True)):
        places = np.arange(heights.shape[axis])
        kept = (places >= low / apart - ROUNDING) & (places <= high / apart + ROUNDING)
        heights = np.compress(kept, heights, axis)
    if min(heights.shape) < 2:
        whole = " x ".join(f"{side:.6g}" for side in topography.sides)
        raise InputError(f"{named}: holds fewer than 2 x 2 nodes of {whole} um")
    if np.isnan(heights).all():
        raise InputError(f"{named}: all heights are missing there")
    step = f"cropped to {heights.shape[0]} x {heights.shape[1]} nodes, {text} um"
    return topography.changed(heights, step, spacing)


def masked(topography: Topography, kept: tuple[float | None, float | None]) -> Topography:
    """Make holes of the heights that are outside two ends [um], None for an open one."""
    heights, (low, high) = topography.heights, kept
    below, above = -np.inf if low is None else low, np.inf if high is None else high
    outside = (heights < below) | (heights > above)
    left = np.where(outside, np.nan, heights)
    if np.isnan(left).all():
        raise InputError(
            f"{topography.name}: --mask {below:g}:{above:g} leaves no height, they are"
            f" {np.nanmin(heights):.6g} to {np.nanmax(heights):.6g} um"
        )
    step = f"masked {_share(outside)} outside {below:g} to {above:g} um"
    return topography.changed(left, step)


def despiked(topography: Topography, threshold: float) -> Topography:
    """Replace spikes by their local median; warn if there are too many to be spikes."""
    heights = topography.heights
    medians, scatter = local_medians(heights)
    with np.errstate(over="ignore"):  # a bound beyond all numbers leaves no spike
        spikes = np.abs(heights - medians) > threshold * scatter
    taken = _share(spikes)
    step = f"despiked: {taken} further than {threshold:g} times the scatter from their local median"
    clean = topography.changed(np.where(spikes, medians, heights), step)
    if spikes.mean() <= MANY_SPIKES:
        return clean
    warning = f"{taken} were taken out as spikes: probably a part of the surface; raise --despike"
    return replace(clean, warnings=(*clean.warnings, warning))


def least_squares(topography: Topography, degree: int = 1) -> tuple[Heights, Sides]:
    """Fit a plane or a quadratic to the measured nodes; return it [um], and its tilt.

    The tilt is the pair of slopes along x and y in the middle of the map [1].
    """
    heights = topography.heights
    x, y = np.meshgrid(
        *(np.linspace(-1, 1, nodes) for nodes in heights.shape), indexing="ij"
    )
    columns = [np.ones_like(x), x, y, *([x * x, x * y, y * y] if degree == 2 else [])]
    measured = ~np.isnan(heights)
    matrix = np.stack([column[measured] for column in columns], axis=1)
    offset = float(np.mean(heights[measured]))
    coefficients = np.linalg.lstsq(matrix, heights[measured] - offset, rcond=None)[0]
    fit = np.full_like(heights, offset)
    for coefficient, column in zip(coefficients, columns, strict=True):
        fit = fit + coefficient * column
    slopes = 2 * coefficients[1:3] / (np.subtract(heights.shape, 1) * topography.spacing)
    return fit, (float(slopes[0]), float(slopes[1]))


def levelled(topography: Topography, level: str) -> Topography:
    """Subtract a least-squares fit of the measured nodes."""
    heights = topography.heights
    if level == "mean":
        mean = float(np.nanmean(heights))
        return topography.changed(heights - mean, f"levelled by the mean, {mean:.6g} um")
    fit, (x, y) = least_squares(topography)
    if level == "quadratic":
        fit, _ = least_squares(topography, 2)
    step = f"levelled by a {level} (tilt was {x:.4g} along x, {y:.4g} along y)"
    return topography.changed(heights - fit, step)


def downsampled(topography: Topography, nodes: int) -> Topography:
    """Replace square blocks of nodes by their means; nodes beyond the last block are left out."""
    heights = topography.heights
    nx, ny = (length // nodes for length in heights.shape)
    if min(nx, ny) < 2:
        named = f"{topography.name}: --downsample {nodes}"
        of = " x ".join(map(str, heights.shape))
        raise InputError(f"{named} leaves fewer than 2 x 2 of {of} nodes")
    means = (
        heights[: nx * nodes, : ny * nodes]
        .reshape(nx, nodes, ny, nodes)
        .mean(axis=(1, 3))
    )
    left = tuple(length % nodes for length in heights.shape)
    rest = f", the last {left[0]} and {left[1]} lines left out" if any(left) else ""
    dx, dy = topography.spacing
    step = f"downsampled to {nx} x {ny} means of {nodes} x {nodes} nodes{rest}"
    return topography.changed(means, step, (nodes * dx, nodes * dy))


def _share(chosen: NDArray[np.bool_]) -> str:
    """Say how many nodes are chosen, and which share of all nodes they are."""
    count = int(np.count_nonzero(chosen))
    return f"{count} node{'' if count == 1 else 's'} ({100 * count / chosen.size:.3g} %)"


# rms slope below which the unit of the heights was probably lost; polished mirrors have 1e-4
FLAT = 1e-5
# share of the variance in the mean plane from which a map is called tilted: the rms height of this
# plane is twice that of the rest. Pieces of self-affine surfaces without a roll-off rarely do
TILTED = 0.8
# nodes a side from which a map can be called tilted: a plane fits fewer by chance
FEWEST_TILTED = 8


def surface_warnings(topography: Topography) -> list[str]:
    """List reasons to distrust contacts of a surface: its own, slopes, wrong units, borders."""
    warnings, heights = list(topography.warnings), topography.heights
    slope = rms_slope(_without_doubtful(topography), topography.spacing)
    apart = max(topography.spacing)
    if slope > STEEP:
        warnings.append(steep_slopes(slope, apart))
    if (
        0 < slope < FLAT and apart <= WIDEST
    ):  # else their distance is wrong, which `read` says
        fault = f"rms slope {slope:.2g} between nodes {apart:.3g} um apart: flatter than a mirror;"
        fault += " are the heights in metres"
        warnings.append(topography.advised(fault, ("unit m", "reads them so")))
    if topography.boundary == "periodic" and not is_tilted(topography):
        borders = heights[-1] - heights[0], heights[:, -1] - heights[:, 0]
        step, rms = (
            max(float(np.sqrt(np.mean(each**2))) for each in borders),
            heights.std(),
        )
        if step > rms:
            fault = f"opposite borders differ by {step:.4g} um (rms), more than the rms height,"
            fault += f" {rms:.4g} um: the map is not periodic"
            warnings.append(
                topography.advised(fault, ("boundary mirror", "takes it as it is"))
            )
    return warnings


def read_surface(
    path: Path,
    reading: Reading,
    boundary: Boundary = "free",
    opposite: Opposite | None = None,
) -> tuple[Topography, list[str]]:
    """Read and prepare a surface, or the composite surface of two bodies; return warnings too."""
    try:
        surface = prepare(read(path, reading, boundary), reading)
        if opposite is not None:
            from gen.maps.bodies import composite

            body = opposite.prepared(boundary)
            surface = composite(surface, body, opposite.turned, opposite.shift)
    except InputError as error:
        named = opposite is not None or str(error).startswith(("--", str(path)))
        raise InputError(f"{'' if named else f'{path}: '}{error}") from None
    return surface, surface_warnings(surface)


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
