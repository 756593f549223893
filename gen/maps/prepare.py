"""Prepare a measured topography for contact: only the steps that the user asks for, recorded.

Reasons to distrust what is left are a tilt, a spike, slopes, borders that differ, a lost unit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Heights
from gen.maps import filters
from gen.maps.filters import ROWS, filled_harmonically, least_squares, local_medians
from gen.maps.read import WIDEST, Sides, Topography, in_words, read
from gen.maps.settings import SPIKE, Reading, numbers_in, said
from gen.runtime.errors import InputError
from gen.statistics import rms_slope

if TYPE_CHECKING:
    from bem.problem import Boundary
    from gen.maps.bodies import Opposite

ROUNDING = 1e-9  # relative difference of lengths that are taken for the same
# share of nodes above which those taken out as spikes are probably part of the surface
MANY_SPIKES = 0.01
MANY_HOLES = 0.1  # share of missing heights above which filling them deserves a warning
# share of missing heights above which filling them is refused unless the user insists
MOST_HOLES = 0.5


def prepare(topography: Topography, settings: Reading) -> Topography:
    """Crop, invert, mask, despike, level, fill, filter and downsample a map, in this order.

    Heights out of range are no part of any median, so the mask comes before the spikes. Spikes
    would bend a fit, and stand at the rims of holes, which are filled from there. A filter needs
    all nodes, and no slope at the borders. Means come last, when the S-filter has taken out the
    waves that they would fold back. Raises InputError if a setting does not suit the map.
    """
    settings.check()
    followed = {key for key in STEPS if getattr(settings, key)} - {"level", "despike"}
    followed |= {f"level {settings.level}"} if settings.level else set()
    # a threshold of spikes counts as the one that is advised if it takes out as many
    followed |= {f"despike {SPIKE:g}"} if (settings.despike or np.inf) <= SPIKE else set()
    followed |= topography.followed
    topography = replace(topography, followed=frozenset(followed), asked=settings.asked)
    for key, step in STEPS.items():
        if key == "filter" and topography.missing:  # from here on every node is needed
            fault = f"{topography.missing} of {topography.heights.size} heights are missing (NaN)"
            remedies = ("fill", "closes holes"), ("crop", "leaves them out")
            raise InputError(f"{topography.name}: {advised(topography, fault, *remedies)}")
        nothing = key in {"fill", "fill_most"} and not topography.missing  # to fill
        if getattr(settings, key) and not nothing:
            topography = step(topography, settings)
    if not is_tilted(topography):
        return topography
    x, y = tilt(topography)
    fault = f"tilted by {x:.2g} along x and {y:.2g} along y, more than it is rough, so one edge"
    fault += " carries the load"  # as the map lay under its instrument
    warning = advised(topography, fault, ("level plane", "takes the tilt out"))
    return replace(topography, warnings=(*topography.warnings, warning))


# what each key of the preparation does, if it is given, in the order of the steps
STEPS: Mapping[str, Callable[[Topography, Any], Topography]] = {
    "crop": lambda given, how: cropped(given, how.crop),
    "invert": lambda given, _: changed(given, -given.heights, "turned upside down"),
    "mask": lambda given, how: masked(given, how.ends("mask")),
    "despike": lambda given, how: despiked(given, how.despike),
    "level": lambda given, how: levelled(given, how.level),
    "form": lambda given, how: without_form(given, how.form),
    "fill": lambda given, how: filled(given, insisted=how.fill_most),
    "fill_most": lambda given, how: filled(given, insisted=how.fill_most),
    "filter": lambda given, how: filtered(given, *how.ends("filter")),
    "downsample": lambda given, how: downsampled(given, how.downsample),
}


def changed(
    topography: Topography, heights: Heights, step: str, spacing: Sides | None = None
) -> Topography:
    """Return the topography with new heights, perhaps of a new spacing [um], and a step more."""
    if spacing is not None:
        x, y = (
            (nodes - (topography.boundary == "free")) * apart
            for nodes, apart in zip(heights.shape, spacing, strict=True)
        )
        topography = replace(topography, sides=(x, y))
    return replace(topography, heights=heights, steps=(*topography.steps, *filter(None, [step])))


def cropped(topography: Topography, text: str) -> Topography:
    """Cut out the nodes within "x0:x1,y0:y1" [um]."""
    named, spacing = said(f"crop {text!r}", topography.asked), topography.spacing
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
    return changed(replace(topography, repeats=False), heights, step, spacing)


def masked(topography: Topography, kept: tuple[float | None, float | None]) -> Topography:
    """Make holes of the heights that are outside two ends [um], None for an open one."""
    heights, (low, high) = topography.heights, kept
    below, above = -np.inf if low is None else low, np.inf if high is None else high
    outside = (heights < below) | (heights > above)
    left = np.where(outside, np.nan, heights)
    if np.isnan(left).all():
        named = said(f"mask {below:g}:{above:g}", topography.asked)
        raise InputError(
            f"{topography.name}: {named} leaves no height, they are {np.nanmin(heights):.6g} to"
            f" {np.nanmax(heights):.6g} um"
        )
    step = f"masked {_share(outside)} outside {below:g} to {above:g} um"
    return changed(topography, left, step)


def despiked(topography: Topography, threshold: float) -> Topography:
    """Replace spikes by their local median; warn if there are too many to be spikes."""
    heights = topography.heights
    medians, scatter = local_medians(heights)
    with np.errstate(over="ignore"):  # a bound beyond all numbers leaves no spike
        spikes = np.abs(heights - medians) > threshold * scatter
    taken = _share(spikes)
    step = f"despiked: {taken} further than {threshold:g} times the scatter from their local median"
    clean = changed(topography, np.where(spikes, medians, heights), step)
    if spikes.mean() <= MANY_SPIKES:
        return clean
    named = said("despike", topography.asked)
    warning = f"{taken} were taken out as spikes: probably a part of the surface; raise {named}"
    return replace(clean, warnings=(*clean.warnings, warning))


def without_form(topography: Topography, degree: int) -> Topography:
    """Subtract the least-squares polynomial of a total degree from the measured nodes."""
    heights, terms = topography.heights, (degree + 1) * (degree + 2) // 2
    (nx, ny), measured = heights.shape, heights.size - topography.missing
    if degree >= min(nx, ny) or measured <= terms:
        named = said(f"form {degree}", topography.asked)
        raise InputError(
            f"{topography.name}: {named} has {terms} coefficients, too many for {measured} heights"
            f" on {nx} x {ny} nodes"
        )
    fit = filters.fitted_polynomial(heights, degree)
    span = f"{np.ptp(fit[~np.isnan(heights)]):.4g} um"
    step = f"form taken out: a polynomial of degree {degree}, which spans {span}"
    return changed(topography, heights - fit, step)


def levelled(topography: Topography, level: str) -> Topography:
    """Subtract a least-squares fit of the measured nodes."""
    heights = topography.heights
    if level == "mean":
        mean = float(np.nanmean(heights))
        return changed(topography, heights - mean, f"levelled by the mean, {mean:.6g} um")
    x, y = tilt(topography)
    fit, _ = least_squares(heights, 1 if level == "plane" else 2)
    step = f"levelled by a {level} (tilt was {x:.4g} along x, {y:.4g} along y)"
    return changed(topography, heights - fit, step)


def filled(topography: Topography, *, insisted: bool) -> Topography:
    """Fill holes; warn of many, and refuse more than heights unless the user insists."""
    missing, size = topography.missing, topography.heights.size
    share = f"{100 * missing / size:.3g} %"
    if missing > MOST_HOLES * size and not insisted:
        fill, insist = (said(key, topography.asked) for key in ("fill", "fill_most"))
        raise InputError(
            f"{topography.name}: {missing} of {size} heights are missing ({share}): {fill} would"
            f" make up more than was measured; crop, measure again, or insist by {insist}"
        )
    periodic = topography.boundary == "periodic"
    heights = filled_harmonically(topography.heights, topography.spacing, periodic=periodic)
    whole = changed(topography, heights, f"filled {missing} nodes ({share}) harmonically")
    if missing <= MANY_HOLES * size:
        return whole
    warning = f"{share} of the heights were missing and are filled: filled parts are too smooth"
    return replace(whole, warnings=(*whole.warnings, warning))


def filtered(topography: Topography, short: float | None, long: float | None) -> Topography:
    """Take out waves shorter than the S-filter's cut-off and longer than the L-filter's [um]."""
    heights, spacing, boundary = topography.heights, topography.spacing, topography.boundary
    finest, side = filters.FINEST * max(spacing), min(topography.sides)
    cutoffs = {"S-filter": short, "L-filter": long}
    given = {name: cutoff for name, cutoff in cutoffs.items() if cutoff is not None}
    for name, cutoff in given.items():
        if not finest * (1 - ROUNDING) <= cutoff <= side * (1 + ROUNDING):
            raise InputError(
                f"{topography.name}: {said('filter', topography.asked)}: the {name}'s cut-off,"
                f" {cutoff:g} um, is outside {finest:.6g} to {side:.6g} um, four spacings to the"
                " shorter side"
            )
        waves = filters.long_waves(heights, spacing, cutoff, boundary)
        heights = waves if name == "S-filter" else heights - waves
    beyond = {"periodic": ", on past the borders", "mirror": ", mirrored at the borders"}
    names = ", ".join(f"{name} {cutoff:g} um" for name, cutoff in given.items())
    step = f"filtered after ISO 16610-61 (Gaussian): {names}{beyond.get(boundary, '')}"
    return changed(topography, heights, step)


def downsampled(topography: Topography, nodes: int) -> Topography:
    """Replace square blocks of nodes by their means; nodes beyond the last block are left out."""
    heights = topography.heights
    nx, ny = (length // nodes for length in heights.shape)
    if min(nx, ny) < 2:
        named = f"{topography.name}: {said(f'downsample {nodes}', topography.asked)}"
        of = " x ".join(map(str, heights.shape))
        raise InputError(f"{named} leaves fewer than 2 x 2 of {of} nodes")
    means = heights[: nx * nodes, : ny * nodes].reshape(nx, nodes, ny, nodes).mean(axis=(1, 3))
    left = tuple(length % nodes for length in heights.shape)
    rest = f", the last {left[0]} and {left[1]} lines left out" if any(left) else ""
    dx, dy = topography.spacing
    step = f"downsampled to {nx} x {ny} means of {nodes} x {nodes} nodes{rest}"
    return changed(topography, means, step, (nodes * dx, nodes * dy))


def _share(chosen: NDArray[np.bool_]) -> str:
    """Say how many nodes are chosen, and which share of all nodes they are."""
    count = int(np.count_nonzero(chosen))
    return f"{count} node{'' if count == 1 else 's'} ({100 * count / chosen.size:.3g} %)"


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
            raise InputError(f"{topography.name}: {nodes} nodes along an axis, resampling needs 4")
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
    return changed(topography, heights, step * (heights is not topography.heights), spacing)


# rms slope above which half-space theory, made for small slopes, is in doubt; the paper's rough
# surfaces have 0.07 to 0.26
STEEP = 0.3
# rms slope below which the unit of the heights was probably lost; polished mirrors have 1e-4
FLAT = 1e-5
# share of the variance in the mean plane from which a map is called tilted: the rms height of this
# plane is twice that of the rest. Pieces of self-affine surfaces without a roll-off rarely do
TILTED = 0.8
# nodes a side from which a map can be called tilted: a plane fits fewer by chance
FEWEST_TILTED = 8


def surface_warnings(topography: Topography) -> list[str]:
    """List reasons to distrust contacts of a surface: spikes, slopes, wrong units, borders."""
    warnings, heights = list(topography.warnings), topography.heights
    if (spike := _spike(heights)) is not None:
        row, column, above = spike
        fault = f"the highest node ({row}, {column}) is a spike from whose tip Delta counts,"
        fault += f" {above:.4g} um above its neighbours"
        remedies = (f"despike {SPIKE:g}", "removes spikes"), ("crop", "leaves this part out")
        warnings.append(advised(topography, fault, *remedies))
    slope, apart = rms_slope(heights, topography.spacing), max(topography.spacing)
    scale = f"rms slope {slope:.2g} between nodes {apart:.3g} um apart"
    if slope > STEEP:
        warnings.append(
            f"{scale}: the theory of the half-space takes slopes for small"
            f" (below {STEEP:g}); check the unit of heights and lengths"
        )
    if 0 < slope < FLAT and apart <= WIDEST:  # else their distance is wrong, which `read` says
        fault = f"{scale}: flatter than a mirror; are the heights in metres"
        warnings.append(advised(topography, fault, ("unit m", "reads them so")))
    if topography.boundary == "periodic" and not is_tilted(topography):
        borders = heights[-1] - heights[0], heights[:, -1] - heights[:, 0]
        step, rms = max(float(np.sqrt(np.mean(each**2))) for each in borders), heights.std()
        if step > rms:
            fault = f"opposite borders differ by {step:.4g} um (rms), more than the rms height,"
            fault += f" {rms:.4g} um: the map is not periodic"
            warnings.append(advised(topography, fault, ("boundary mirror", "takes it as it is")))
    if topography.boundary != "periodic" and topography.repeats:
        fault = "the file says that its map is periodic, and it is taken as a"
        fault += f" {topography.boundary} patch"
        follows = "boundary periodic", "of gen describe, contact and law follows the file"
        warnings.append(advised(topography, fault, follows))
    return warnings


def read_surface(
    path: Path, reading: Reading, boundary: Boundary = "free", opposite: Opposite | None = None
) -> tuple[Topography, list[str]]:
    """Read and prepare a surface, or the composite surface of two bodies; return warnings too."""
    try:
        surface = prepare(read(path, reading, boundary), reading)
        if opposite is not None:
            from gen.maps.bodies import composite

            surface = composite(surface, opposite.prepared(boundary), opposite.placement)
    except InputError as error:
        named = opposite is not None or str(error).startswith(("--", str(path)))
        raise InputError(f"{'' if named else f'{path}: '}{error}") from None
    return surface, surface_warnings(surface)


def advised(topography: Topography, fault: str, *remedies: tuple[str, str]) -> str:
    """Add remedies to a fault, each a step and what it does, but none that is followed."""
    followed = {*topography.followed, f"boundary {topography.boundary}"}
    followed |= {"unit m"} if topography.unit else set()
    left = [
        f"{said(step, topography.asked)} {does}" for step, does in remedies if step not in followed
    ]
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


def tilt(topography: Topography) -> tuple[float, float]:
    """Fit a plane to the measured nodes and return its slopes along x and y [1]."""
    _, (_, *slopes) = least_squares(topography.heights, 1)
    x, y = (
        2 * float(slope) / (side * ((nodes - 1) / (nodes - (topography.boundary == "free"))))
        for side, nodes, slope in zip(
            topography.sides, topography.heights.shape, slopes, strict=True
        )
    )
    return x, y


def _spike(heights: Heights) -> tuple[int, int, float] | None:
    """Return node and height above its neighbours [um] of the highest node if it is a spike."""
    # The odd reflection continues slopes beyond the border.
    padded = np.pad(heights, 1, mode="reflect", reflect_type="odd")
    windows = np.lib.stride_tricks.sliding_window_view(padded, (3, 3))
    above = np.empty(heights.shape)
    for first in range(0, len(heights), ROWS):
        block = windows[first : first + ROWS].reshape(-1, heights.shape[1], 9)
        neighbours = np.delete(block, 4, axis=-1)
        above[first : first + ROWS] = block[..., 4] - np.median(neighbours, axis=-1)
    above -= np.median(above)
    usual = 1.4826 * float(np.median(np.abs(above)))
    row, column = np.unravel_index(int(np.argmax(heights)), heights.shape)
    step = float(above[row, column])
    noise = 1e-9 * float(np.ptp(heights))
    return (int(row), int(column), step) if step > SPIKE * max(usual, noise) else None
