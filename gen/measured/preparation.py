"""Make a measured topography ready for contact, each step asked for and recorded."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gen.measured.topography import Heights, Topography
from gen.runtime.errors import InputError

LEVELS = ("mean", "plane", "quadratic")

# The highest node is taken for a spike when it stands so many robust standard deviations further
# above its neighbours' median than nodes usually do. Self-affine surfaces stay below 5.
SPIKE = 7.0
# Rows of nodes whose neighbours are looked at together: large maps are in memory a few times only.
ROWS = 64
# Half-space theory takes slopes for small; rough surfaces of the paper have 0.07 to 0.26.
STEEP = 0.3
# Polished mirrors have 1e-4: what is flatter has probably lost the unit of its heights.
FLAT = 1e-5
# Shares of missing heights above which filling is warned of, and refused unless insisted upon.
MANY = 0.1
MOST = 0.5
# Rows of so many triples are hardly a strip three nodes wide.
TRIPLES = 100


def prepare(
    topography: Topography,
    *,
    crop: str = "",
    invert: bool = False,
    level: str = "",
    fill: bool = False,
    fill_most: bool = False,
) -> Topography:
    """Crop, invert, level and fill, in this order, whatever of it is asked for.

    A surface of which more than `MANY` is filled gets a warning.

    Parameters
    ----------
    crop : "x0:x1,y0:y1", the part to keep, from the first node on [um]
    invert : turn the surface upside down, where the file's heights point into the material
    level : take away the "mean", the least-squares "plane" or "quadratic" of the measured nodes
    fill : close holes harmonically: no filled node is higher or lower than a hole's rim
    fill_most : fill even where more than half of the heights are missing

    Raises
    ------
    InputError
        For a part that is empty, a level that is none of these, holes that stay, or more holes than
        heights
    """
    if crop:
        topography = _cropped(topography, crop)
    if invert:
        topography = _changed(topography, -topography.heights, "turned upside down")
    if level:
        topography = _levelled(topography, level)
    if (fill or fill_most) and topography.missing:
        topography = _filled(topography, insisted=fill_most)
    if topography.missing:
        raise InputError(
            f"{topography.name}: {topography.missing} of {topography.heights.size} heights are"
            " missing (NaN): --fill closes holes, --crop leaves them out"
        )
    return topography


def warnings_about(topography: Topography) -> list[str]:
    """What a user should know before trusting a contact of this surface, a line each."""
    notes = list(topography.warnings)
    spike = _spike(topography.heights)
    if spike is not None:
        row, column, above = spike
        notes.append(
            f"the highest node ({row}, {column}) is a spike, {above:.4g} um above its neighbours:"
            " Delta counts from its tip; crop it, or mark it as missing and --fill"
        )
    slope = rms_slope(topography)
    if slope > STEEP:
        notes.append(
            f"rms slope {slope:.2g}: the theory of the half-space takes slopes for small"
            f" (below {STEEP:g}); check the unit of heights and lengths"
        )
    if 0 < slope < FLAT:
        notes.append(
            f"rms slope {slope:.2g}: flatter than a mirror; are the heights in metres? --unit says"
        )
    rows, columns = topography.heights.shape
    if columns == 3 and rows >= TRIPLES:
        notes.append(
            f"{rows} x 3 nodes: if this is a list of x, y and z, give the heights as a grid"
        )
    return notes


def rms_slope(topography: Topography) -> float:
    """Root mean square of the gradient between neighbouring nodes [1]."""
    squares = 0.0
    for axis, spacing in enumerate(topography.spacing):
        with np.errstate(over="ignore"):  # a slope without end is warned of like any that is steep
            squares += float(np.nanmean((np.diff(topography.heights, axis=axis) / spacing) ** 2))
    return float(np.sqrt(squares))


def tilt(topography: Topography) -> tuple[float, float]:
    """Slope of the least-squares plane along x and y [1]."""
    _, coefficients = _least_squares(topography.heights, _plane)
    width, length = topography.sides
    return 2 * float(coefficients[1]) / width, 2 * float(coefficients[2]) / length


def filled_harmonically(heights: Heights, spacing: tuple[float, float]) -> Heights:
    """Solve Laplace's equation in the holes, their rims given, the patch's border free.

    Parameters
    ----------
    heights : (nx, ny), NaN in holes, some finite [um]
    spacing : along x and y [um]

    Returns
    -------
    (nx, ny) without NaN; finite heights are kept
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.linalg import spsolve

    holes = np.isnan(heights)
    unknown = np.flatnonzero(holes)
    number = np.full(heights.size, -1)
    number[unknown] = np.arange(unknown.size)
    diagonal, right = np.zeros(unknown.size), np.zeros(unknown.size)
    flat, columns = heights.reshape(-1), heights.shape[1]
    rows: list[NDArray[np.intp]] = []
    others: list[NDArray[np.intp]] = []
    weights: list[Heights] = []
    for axis, stride in ((0, columns), (1, 1)):
        position = unknown // columns if axis == 0 else unknown % columns
        weight = spacing[axis] ** -2
        for step, inside in ((-1, position > 0), (1, position < heights.shape[axis] - 1)):
            here = np.flatnonzero(inside)
            there = unknown[here] + step * stride
            diagonal[here] += weight
            known = number[there] < 0
            np.add.at(right, here[known], weight * flat[there[known]])
            rows.append(here[~known])
            others.append(number[there[~known]])
            weights.append(np.full(int((~known).sum()), -weight))
    everyone = np.arange(unknown.size)
    matrix = coo_matrix(
        (
            np.concatenate([diagonal, *weights]),
            (np.concatenate([everyone, *rows]), np.concatenate([everyone, *others])),
        )
    ).tocsc()
    filled = heights.copy()
    filled.reshape(-1)[unknown] = spsolve(matrix, right)
    return filled


def _changed(topography: Topography, heights: Heights, step: str) -> Topography:
    return replace(topography, heights=heights, steps=(*topography.steps, step))


def _filled(topography: Topography, *, insisted: bool) -> Topography:
    """Fill holes; refuse more holes than heights unless the user insisted, and warn of many."""
    missing, size = topography.missing, topography.heights.size
    share = f"{100 * missing / size:.3g} %"
    if missing > MOST * size and not insisted:
        raise InputError(
            f"{topography.name}: {missing} of {size} heights are missing ({share}): --fill would"
            " make up more than was measured; crop, measure again, or insist by --fill-most"
        )
    heights = filled_harmonically(topography.heights, topography.spacing)
    filled = _changed(topography, heights, f"filled {missing} nodes ({share}) harmonically")
    if missing <= MANY * size:
        return filled
    warning = f"{share} of the heights were missing and are filled: filled parts are too smooth"
    return replace(filled, warnings=(*filled.warnings, warning))


def _cropped(topography: Topography, text: str) -> Topography:
    """The nodes within "x0:x1,y0:y1" [um]."""
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
        sides.append((within.size - 1) * spacing)
    heights = np.ascontiguousarray(topography.heights[tuple(parts)])
    if np.isnan(heights).all():
        raise InputError(f"--crop {text!r}: all heights are missing there")
    step = f"cropped to {heights.shape[0]} x {heights.shape[1]} nodes, {text} um"
    cropped = replace(topography, sides=(sides[0], sides[1]))
    return _changed(cropped, heights, step)


def _plane(x: Heights, y: Heights) -> list[Heights]:
    return [np.ones_like(x), x, y]


def _quadratic(x: Heights, y: Heights) -> list[Heights]:
    return [*_plane(x, y), x * x, x * y, y * y]


def _least_squares(
    heights: Heights, terms: Callable[[Heights, Heights], list[Heights]]
) -> tuple[Heights, Heights]:
    """The fit to the measured nodes at all nodes, and its coefficients over -1 to 1 an axis."""
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
    if level not in LEVELS:
        raise InputError(f"--level {level!r}: give one of {', '.join(LEVELS)}")
    heights = topography.heights
    if level == "mean":
        mean = float(np.nanmean(heights))
        return _changed(topography, heights - mean, f"levelled by the mean, {mean:.6g} um")
    slopes = tilt(topography)
    fit, _ = _least_squares(heights, _plane if level == "plane" else _quadratic)
    tilted = f"tilt {slopes[0]:.4g} along x, {slopes[1]:.4g} along y"
    return _changed(topography, heights - fit, f"levelled by a {level}, {tilted}")


def _spike(heights: Heights) -> tuple[int, int, float] | None:
    """Where the highest node is, and how far above its neighbours' median, if that is a spike."""
    padded = np.pad(heights, 1, mode="reflect", reflect_type="odd")  # slopes go on
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
