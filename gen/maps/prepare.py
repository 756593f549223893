"""Prepare a measured topography for contact: only the steps that the user asks for, recorded.

Reasons to distrust the prepared map are codes for missing heights, pits and spikes, a tilt, slopes,
borders that differ, and a lost unit.
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
from gen.maps.outliers import local_medians, scatter_of, with_outlier_warnings
from gen.maps.read import BEYOND_INSTRUMENTS, NEAREST, WIDEST, Remedy, Topography
from gen.maps.settings import KEYS, SPIKE, Reading, as_option, numbers_in
from gen.runtime.errors import InputError
from gen.statistics import rms_slope

ROUNDING = 1e-9  # relative difference of numbers that are taken for the same
# share of nodes above which those replaced as spikes are probably part of the surface
MANY_SPIKES = 0.01


def prepare(topography: Topography, settings: Reading) -> Topography:
    """Crop, invert, mask, despike, level, fill, filter and downsample a map, in this order.

    Metrologists take the steps in this order. The mask comes before the spikes, so that heights out
    of range are no part of any median. The spikes come before the level, because they would bend a
    fit, and before the holes, which are filled from their rims. A filter needs all nodes, and no
    slope at the borders. Means of nodes come last, when the S-filter has removed the waves that
    they would fold back.

    Parameters
    ----------
    topography : Topography
        A map as it was read.
    settings : Reading
        The steps to take.

    Returns
    -------
    Topography
        The prepared map without holes, with a line for each step, a warning for each reason to
        distrust its heights, and the nodes that such a warning calls doubtful.

    Raises
    ------
    InputError
        If a setting does not suit the map, or heights are missing and the settings do not fill
        them.
    """
    _refuse_two_forms(settings)
    followed = topography.followed | _followed_steps(settings)
    topography = replace(topography, followed=followed)
    topography = _with_steps(topography, settings, "crop", "invert", "mask")
    refuse_overflowing_heights(topography)
    topography = _with_steps(topography, settings, "despike")
    topography = with_code_warnings(topography)
    topography = _with_span_warning(topography)
    measured = topography.heights
    topography = _with_steps(topography, settings, "level", "form", "fill", "fill_most")
    _refuse_holes(topography)
    level = _without_tilt(topography)
    topography = with_outlier_warnings(topography, measured, level)
    topography = _with_steps(topography, settings, "filter", "downsample")
    return _with_tilt_warning(topography)


def _refuse_two_forms(settings: Reading) -> None:
    """Raise InputError if both a level and a form are to be subtracted."""
    if settings.level and settings.form is not None:
        raise InputError(
            f"--level {settings.level} and --form {settings.form} given: give one; forms"
            " of degree 1 and 2 are levels too"
        )


def _followed_steps(settings: Reading) -> frozenset[str]:
    """Return the steps that the settings take, as warnings would advise them."""
    steps = {key for key in STEPS if getattr(settings, key)}
    if settings.level:
        steps.remove("level")
        steps.add(f"level {settings.level}")
    if settings.despike:
        steps.remove("despike")
        if settings.despike <= SPIKE:  # replaces at least the spikes of the advised one
            steps.add(f"despike {SPIKE:g}")
    return frozenset(steps)


def _with_steps(topography: Topography, settings: Reading, *keys: str) -> Topography:
    """Return the map after the steps of those keys that are set, in this order.

    A hole is not filled twice. InputError is raised for a value that its key does not allow.
    """
    for key in keys:
        value = getattr(settings, key)
        if value is None or value is False or value == "":
            continue
        if key in {"fill", "fill_most"} and not topography.missing:
            continue
        if not KEYS[key].suits(value):
            option = as_option(f"{key} {value!r}")
            raise InputError(f"{option}: give {KEYS[key].allowed}")
        topography = STEPS[key](topography, settings)
    return topography


def _refuse_holes(topography: Topography) -> None:
    """Raise InputError if heights are missing; the message advises how to close the holes."""
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
    """Add a warning if heights that are no codes span more or less than instruments measure."""
    heights = _without_doubtful(topography)
    span = float(np.nanmax(heights) - np.nanmin(heights))
    if span == 0 or NEAREST <= span <= WIDEST:
        return topography
    warning = f"its heights span {span:.3g} um, {BEYOND_INSTRUMENTS}"
    return _with_warning(topography, warning)


def _with_tilt_warning(topography: Topography) -> Topography:
    """Add a warning if the mean plane of a map without holes outweighs its roughness."""
    heights = _without_doubtful(topography)
    mean = float(np.nanmean(heights))
    if not is_tilted(replace(topography, heights=np.nan_to_num(heights, nan=mean))):
        return topography
    tilt = least_squares(replace(topography, heights=heights)).tilt
    fault = (
        f"tilted by {tilt.x:.2g} along x and {tilt.y:.2g} along y, more than it is rough,"
        " so one edge carries the load"
    )
    warning = topography.advised(fault, Remedy("level plane", "takes the tilt out"))
    return _with_warning(topography, warning)


def _without_tilt(topography: Topography) -> Heights:
    """Return the heights [um] without their mean plane if this outweighs the roughness."""
    if not is_tilted(topography):
        return topography.heights
    heights = _without_doubtful(topography)
    plane = least_squares(replace(topography, heights=heights)).heights
    return topography.heights - plane


def _without_doubtful(topography: Topography) -> Heights:
    """Return the heights [um] with NaN at nodes that a warning calls codes, pits or spikes.

    All heights are returned if no two neighbours along x, or along y, would be left.
    """
    if topography.doubtful is None:
        return topography.heights
    trusted = ~topography.doubtful
    pairs_along_x = trusted[1:] & trusted[:-1]
    pairs_along_y = trusted[:, 1:] & trusted[:, :-1]
    if not pairs_along_x.any() or not pairs_along_y.any():
        return topography.heights
    return np.where(topography.doubtful, np.nan, topography.heights)


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
"""The step of each key of the preparation, in the order in which the steps are taken."""


def cropped(topography: Topography, text: str) -> Topography:
    """Cut a part out of a map.

    Parameters
    ----------
    topography : Topography
        The map.
    text : str
        Ends of the part along x and y, from the first node, as "x0:x1,y0:y1" [um].

    Returns
    -------
    Topography
        The nodes within these ends.

    Raises
    ------
    InputError
        If the text is not of this form, or the part has fewer than 2 x 2 nodes or no height.
    """
    named = f"--crop {text!r}"
    limits = [numbers_in(part, ":") for part in text.split(",")]
    if [len(ends) for ends in limits] != [2, 2]:
        raise InputError(f"{named}: give x0:x1,y0:y1 in um, as 100:900,0:500")
    heights = topography.heights
    for axis, (low, high) in enumerate(limits):
        apart = topography.spacing[axis]
        places = np.arange(heights.shape[axis])
        inside = (places >= low / apart - ROUNDING) & (places <= high / apart + ROUNDING)
        heights = np.compress(inside, heights, axis)
    if min(heights.shape) < 2:
        sides = " x ".join(f"{side:.6g}" for side in topography.sides)
        raise InputError(f"{named}: holds fewer than 2 x 2 nodes of {sides} um")
    if np.isnan(heights).all():
        raise InputError(f"{named}: all heights are missing there")
    step = f"cropped to {heights.shape[0]} x {heights.shape[1]} nodes, {text} um"
    return topography.changed(heights, step, topography.spacing)


def inverted(topography: Topography) -> Topography:
    """Turn a map upside down, because its heights point into the material.

    Parameters
    ----------
    topography : Topography
        The map.

    Returns
    -------
    Topography
        The map with heights of the opposite sign.
    """
    return topography.changed(-topography.heights, "turned upside down")


def masked(
    topography: Topography, lowest: float | None, highest: float | None
) -> Topography:
    """Make holes of the heights that are outside two ends.

    Parameters
    ----------
    topography : Topography
        The map.
    lowest, highest : float or None
        Lowest and highest height that stay, None for an open end [um].

    Returns
    -------
    Topography
        The map with NaN at nodes outside.

    Raises
    ------
    InputError
        If no height stays.
    """
    heights = topography.heights
    below = -np.inf if lowest is None else lowest
    above = np.inf if highest is None else highest
    outside = (heights < below) | (heights > above)
    inside = np.where(outside, np.nan, heights)
    if np.isnan(inside).all():
        raise InputError(
            f"{topography.name}: --mask {below:g}:{above:g} leaves no height, they are"
            f" {np.nanmin(heights):.6g} to {np.nanmax(heights):.6g} um"
        )
    step = f"masked {_share(outside)} outside {below:g} to {above:g} um"
    return topography.changed(inside, step)


def despiked(topography: Topography, threshold: float) -> Topography:
    """Replace spikes by their local median, and warn if there are too many to be spikes.

    Parameters
    ----------
    topography : Topography
        The map.
    threshold : float
        Distance from the local median above which a node is a spike, over the scatter of these
        distances [1]; see `gen.maps.outliers.scatter_of`.

    Returns
    -------
    Topography
        The map without spikes.
    """
    heights = topography.heights
    medians = local_medians(heights)
    distances = heights - medians
    scatter = scatter_of(distances, heights)
    with np.errstate(over="ignore"):  # a bound beyond all numbers leaves no spike
        spikes = np.abs(distances) > threshold * scatter
    replaced = _share(spikes)
    step = (
        f"despiked: {replaced} further than {threshold:g} times the scatter from their"
        " local median"
    )
    clean = topography.changed(np.where(spikes, medians, heights), step)
    if spikes.mean() <= MANY_SPIKES:
        return clean
    return _with_warning(
        clean,
        f"{replaced} were taken out as spikes: probably a part of the surface; raise --despike",
    )


@dataclass(frozen=True)
class Tilt:
    """Slopes of a surface in the middle of a map."""

    x: float  # slope along x [1]
    y: float  # slope along y [1]


@dataclass(frozen=True, eq=False)
class LeastSquares:
    """A plane or a quadratic that fits a map by least squares."""

    heights: Heights  # heights of the fit at all nodes [um], shape (nx, ny)
    tilt: Tilt


def least_squares(topography: Topography, degree: Literal[1, 2] = 1) -> LeastSquares:
    """Fit a plane or a quadratic to the measured nodes of a map.

    Parameters
    ----------
    topography : Topography
        The map, with one height or more.
    degree : {1, 2}, optional
        1 for a plane, 2 for a quadratic.

    Returns
    -------
    LeastSquares
        Heights and tilt of the fit.
    """
    heights = topography.heights
    along_x, along_y = (np.linspace(-1, 1, nodes) for nodes in heights.shape)
    x, y = np.meshgrid(along_x, along_y, indexing="ij")
    terms = [np.ones_like(x), x, y]
    if degree == 2:
        terms += [x * x, x * y, y * y]
    measured = ~np.isnan(heights)
    matrix = np.stack([term[measured] for term in terms], axis=1)
    offset = float(np.mean(heights[measured]))
    coefficients = np.linalg.lstsq(matrix, heights[measured] - offset, rcond=None)[0]
    fit = np.full_like(heights, offset)
    for coefficient, term in zip(coefficients, terms, strict=True):
        fit = fit + coefficient * term
    # x and y run over 2 from the first node to the last one
    lengths = np.subtract(heights.shape, 1) * topography.spacing
    slopes = 2 * coefficients[1:3] / lengths
    return LeastSquares(fit, Tilt(float(slopes[0]), float(slopes[1])))


def levelled(topography: Topography, level: str) -> Topography:
    """Subtract the mean of the measured nodes, or a surface that fits them by least squares.

    Parameters
    ----------
    topography : Topography
        The map.
    level : {"mean", "plane", "quadratic"}
        The surface that is subtracted.

    Returns
    -------
    Topography
        The levelled map.
    """
    heights = topography.heights
    if level == "mean":
        mean = float(np.nanmean(heights))
        return topography.changed(heights - mean, f"levelled by the mean, {mean:.6g} um")
    plane = least_squares(topography)
    fit = plane if level == "plane" else least_squares(topography, 2)
    tilt = f"tilt was {plane.tilt.x:.4g} along x, {plane.tilt.y:.4g} along y"
    step = f"levelled by a {level} ({tilt})"
    return topography.changed(heights - fit.heights, step)


def downsampled(topography: Topography, nodes: int) -> Topography:
    """Replace squares of nodes by their means, and leave out nodes beyond the last square.

    Parameters
    ----------
    topography : Topography
        The map, without holes.
    nodes : int
        Nodes along each side of a square.

    Returns
    -------
    Topography
        The coarser map.

    Raises
    ------
    InputError
        If fewer than 2 x 2 nodes are left.
    """
    heights = topography.heights
    nx = heights.shape[0] // nodes
    ny = heights.shape[1] // nodes
    if min(nx, ny) < 2:
        raise InputError(
            f"{topography.name}: --downsample {nodes} leaves fewer than 2 x 2 of"
            f" {heights.shape[0]} x {heights.shape[1]} nodes"
        )
    squares = heights[: nx * nodes, : ny * nodes].reshape(nx, nodes, ny, nodes)
    step = f"downsampled to {nx} x {ny} means of {nodes} x {nodes} nodes"
    beyond_x = heights.shape[0] % nodes
    beyond_y = heights.shape[1] % nodes
    if beyond_x or beyond_y:
        step += f", the last {beyond_x} and {beyond_y} lines left out"
    dx, dy = topography.spacing
    return topography.changed(squares.mean(axis=(1, 3)), step, (nodes * dx, nodes * dy))


def _share(chosen: NDArray[np.bool_]) -> str:
    """Write how many nodes are chosen, and which share of all nodes they are."""
    number = int(np.count_nonzero(chosen))
    noun = "node" if number == 1 else "nodes"
    return f"{number} {noun} ({100 * number / chosen.size:.3g} %)"


# rms slope below which the unit of the heights was probably lost; polished mirrors have 1e-4
FLAT = 1e-5
# share of the variance in the mean plane from which a map is called tilted: the rms height of this
# plane is twice that of the roughness. Pieces of self-affine surfaces without a roll-off rarely
# have as much
TILTED = 0.8
# nodes a side from which a map can be called tilted: a plane fits fewer by chance
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
        The warnings about its heights, followed by one line each for steep slopes, a lost unit,
        and borders of a periodic patch that do not meet.
    """
    warnings = list(topography.warnings)
    slope = rms_slope(_without_doubtful(topography), topography.spacing)
    apart = max(topography.spacing)
    if slope > STEEP:
        warnings.append(steep_slopes(slope, apart))
    # Reading a map warns of nodes that are too far apart, which makes slopes small, too.
    if 0 < slope < FLAT and apart <= WIDEST:
        fault = (
            f"rms slope {slope:.2g} between nodes {apart:.3g} um apart: flatter than a"
            " mirror; are the heights in metres"
        )
        warnings.append(topography.advised(fault, Remedy("unit m", "reads them so")))
    if topography.boundary == "periodic" and not is_tilted(topography):
        warnings += _border_warnings(topography)
    return warnings


def _border_warnings(topography: Topography) -> list[str]:
    """Return one line if opposite borders of a surface differ by more than its rms height."""
    heights = topography.heights
    along_x = heights[-1] - heights[0]
    along_y = heights[:, -1] - heights[:, 0]
    step = max(_rms(along_x), _rms(along_y))
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
        Whether the plane holds more than `TILTED` of the variance of the heights; never for fewer
        than `FEWEST_TILTED` nodes a side.
    """
    heights = topography.heights
    if min(heights.shape) < FEWEST_TILTED:
        return False
    scaled = (heights - heights.mean()) / (float(np.ptp(heights)) or 1.0)
    variance = 0.0  # of the mean plane
    for axis in (0, 1):
        places = np.linspace(-1, 1, heights.shape[axis])
        slope = places @ scaled.mean(axis=1 - axis) / (places @ places)
        variance += float(slope**2 * np.mean(places**2))
    return variance > TILTED * float(scaled.var())
