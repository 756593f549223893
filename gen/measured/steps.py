"""Steps of the preparation of a measured map; each returns a map that tells what was done."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gen.arrays import Heights
from gen.measured import form, gaussian_filter
from gen.measured.despiking import without_spikes
from gen.measured.topography import Topography, intervals
from gen.runtime.errors import InputError
from gen.runtime.numbers import MAGNITUDES

ROUNDING = 1e-9
"""Relative difference of lengths that are taken for the same."""

MANY_SPIKES = 0.01
"""Share of nodes above which those taken out as spikes are probably part of the surface."""


def changed(topography: Topography, heights: Heights, step: str) -> Topography:
    """Return the topography with new heights and one more recorded step."""
    return replace(topography, heights=heights, steps=(*topography.steps, step))


def require_useful_heights(topography: Topography) -> None:
    """Refuse heights whose sums and products overflow."""
    largest = float(np.nanmax(np.abs(topography.heights)))
    if largest > MAGNITUDES[1]:
        raise InputError(f"{topography.name}: heights of {largest:.3g} um; check their unit")


def cropped(topography: Topography, text: str) -> Topography:
    """Cut out the nodes within "x0:x1,y0:y1" [um]."""
    try:
        limits = [[float(end) for end in part.split(":")] for part in text.split(",")]
    except ValueError:
        limits = []
    if len(limits) != 2 or any(len(ends) != 2 for ends in limits):
        raise InputError(f"--crop {text!r}: give x0:x1,y0:y1 in um, as 100:900,0:500")
    parts, sides = [], []
    for (low, high), spacing, nodes in zip(
        limits, topography.spacing, topography.heights.shape, strict=True
    ):
        positions = np.arange(nodes) * spacing
        rounding = 1e-9 * spacing
        within = np.flatnonzero((positions >= low - rounding) & (positions <= high + rounding))
        if within.size < 2:
            whole = " x ".join(f"{side:.6g}" for side in topography.sides)
            raise InputError(f"--crop {text!r}: holds fewer than 2 x 2 nodes of {whole} um")
        parts.append(slice(int(within[0]), int(within[-1]) + 1))
        sides.append(intervals(within.size, topography.boundary) * spacing)
    heights = np.ascontiguousarray(topography.heights[tuple(parts)])
    if np.isnan(heights).all():
        raise InputError(f"--crop {text!r}: all heights are missing there")
    step = f"cropped to {heights.shape[0]} x {heights.shape[1]} nodes, {text} um"
    part = replace(topography, sides=(sides[0], sides[1]), repeats=False)
    return changed(part, heights, step)


def masked(topography: Topography, kept: tuple[float, float]) -> Topography:
    """Make holes of the heights that are outside two ends [um]."""
    heights, (below, above) = topography.heights, kept
    outside = (heights < below) | (heights > above)
    masked_heights = np.where(outside, np.nan, heights)
    if np.isnan(masked_heights).all():
        span = f"{np.nanmin(heights):.6g} to {np.nanmax(heights):.6g} um"
        raise InputError(
            f"{topography.name}: --mask {below:g}:{above:g} leaves no height, they are {span}"
        )
    count = int(np.count_nonzero(outside))
    step = f"masked {_share(count, heights.size)} outside {below:g} to {above:g} um"
    return changed(topography, masked_heights, step)


def despiked(topography: Topography, threshold: float) -> Topography:
    """Replace spikes by their local median; warn if there are too many to be spikes."""
    heights, spikes = without_spikes(topography.heights, threshold)
    count = int(np.count_nonzero(spikes))
    taken = _share(count, heights.size)
    step = f"despiked: {taken} further than {threshold:g} times the scatter from their local median"
    clean = changed(topography, heights, step)
    if count <= MANY_SPIKES * heights.size:
        return clean
    warning = f"{taken} were taken out as spikes: probably a part of the surface; raise --despike"
    return replace(clean, warnings=(*clean.warnings, warning))


def without_form(topography: Topography, degree: int) -> Topography:
    """Subtract the least-squares polynomial of a total degree from the measured nodes."""
    heights, terms = topography.heights, form.number_of_terms(degree)
    nx, ny = heights.shape
    measured = heights.size - topography.missing
    if degree >= min(nx, ny) or measured <= terms:
        raise InputError(
            f"{topography.name}: --form {degree} has {terms} coefficients, too many for {measured}"
            f" heights on {nx} x {ny} nodes"
        )
    fit = form.fitted_polynomial(heights, degree)
    span = f"{np.ptp(fit[~np.isnan(heights)]):.4g} um"
    step = f"form taken out: a polynomial of degree {degree}, which spans {span}"
    return changed(topography, heights - fit, step)


def filtered(topography: Topography, short: float | None, long: float | None) -> Topography:
    """Take out waves shorter than the S-filter's cut-off and longer than the L-filter's [um]."""
    heights, spacing = topography.heights, topography.spacing
    finest, side = gaussian_filter.FINEST * max(spacing), min(topography.sides)
    names = []
    for name, cutoff in (("S-filter", short), ("L-filter", long)):
        if cutoff is None:
            continue
        if not finest * (1 - ROUNDING) <= cutoff <= side * (1 + ROUNDING):
            raise InputError(
                f"{topography.name}: --filter: the {name}'s cut-off, {cutoff:g} um, is outside"
                f" {finest:.6g} to {side:.6g} um, four spacings to the shorter side"
            )
        names.append(f"{name} {cutoff:g} um")
    if short is not None:
        heights = gaussian_filter.long_waves(heights, spacing, short, topography.boundary)
    if long is not None:
        long_waves = gaussian_filter.long_waves(heights, spacing, long, topography.boundary)
        heights = heights - long_waves
    beyond = {"periodic": ", on past the borders", "mirror": ", mirrored at the borders"}
    said = ", ".join(names) + beyond.get(topography.boundary, "")
    step = f"filtered after ISO 16610-61 (Gaussian): {said}"
    return changed(topography, heights, step)


def downsampled(topography: Topography, nodes: int) -> Topography:
    """Replace square blocks of nodes by their means; nodes beyond the last block are left out."""
    heights = topography.heights
    blocks = [length // nodes for length in heights.shape]
    shape = " x ".join(str(length) for length in heights.shape)
    if min(blocks) < 2:
        raise InputError(
            f"{topography.name}: --downsample {nodes} leaves fewer than 2 x 2 of {shape} nodes"
        )
    (nx, ny), whole = blocks, heights[: blocks[0] * nodes, : blocks[1] * nodes]
    means = whole.reshape(nx, nodes, ny, nodes).mean(axis=(1, 3))
    left = tuple(length % nodes for length in heights.shape)
    rest = f", the last {left[0]} and {left[1]} lines left out" if any(left) else ""
    spacing = [nodes * step for step in topography.spacing]
    sides = [intervals(n, topography.boundary) * d for n, d in zip(blocks, spacing, strict=True)]
    step = f"downsampled to {nx} x {ny} means of {nodes} x {nodes} nodes{rest}"
    return changed(replace(topography, sides=(sides[0], sides[1])), means, step)


def _share(count: int, size: int) -> str:
    """Say a number of nodes, and which share of all nodes they are."""
    return f"{count} node{'' if count == 1 else 's'} ({100 * count / size:.3g} %)"
