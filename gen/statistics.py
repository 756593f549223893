"""The 22 statistics that describe a rough surface (Table 1 of the paper), all in one pass."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gen.errors import InputError

NAMES = (
    "peak_mean",
    "peak_rms",
    "peak_kurtosis_pearson",
    "peak_skewness",
    "peak_density",
    "peak_curvature_mean",
    "peak_curvature_kurtosis_excess",
    "peak_curvature_skewness",
    "bandwidth_x",
    "bandwidth_y",
    "asperity_mean",
    "asperity_rms",
    "asperity_kurtosis_excess",
    "asperity_skewness",
    "asperity_density",
    "asperity_curvature_mean",
    "asperity_curvature_rms",
    "asperity_curvature_kurtosis_pearson",
    "asperity_curvature_skewness",
    "height_mean",
    "height_max",
    "height_rms",
)
"""The statistics in the order of Table 1."""

SPACINGS = (1e-15, 1e15)
"""Smallest and largest spacing [um]; between them no power of a curvature overflows."""

ROUNDING = 8.0 * float(np.finfo(np.float64).eps)
"""What rounding can fake in second differences, relative to the largest height given."""


@dataclass(frozen=True)
class Description:
    """What `describe` found: all of `NAMES`, and why some of them are NaN.

    Attributes
    ----------
    values : the 22 statistics by name, in the order of `NAMES`
    reason : why some values are NaN, in one short text; empty where none is
    """

    values: dict[str, float]
    reason: str


class Moments(NamedTuple):
    """Population moments of a sample, NaN where it does not define them.

    Attributes
    ----------
    mean : mean
    rms : standard deviation (squares over their number, not their number less one)
    skewness : third standardised moment
    kurtosis : fourth standardised moment, Pearson's (normal: 3)
    """

    mean: float
    rms: float
    skewness: float
    kurtosis: float


class Profiles(NamedTuple):
    """All profiles along one axis, over the N nodes of the surface numbered row by row.

    Attributes
    ----------
    stride : step from a node to the next of its profile; entry i below is of node i + stride
    candidates : number of nodes inside profiles, where a peak can be
    curvature : (N - 2 stride,) minus the second difference, 0 at the ends of profiles
    peaks : (N - 2 stride,) whether the node is above both neighbours, false at the ends
    slope_square : mean squared first difference
    curvature_square : mean squared second difference
    """

    stride: int
    candidates: int
    curvature: NDArray[np.float64]
    peaks: NDArray[np.bool_]
    slope_square: float
    curvature_square: float


class Sample(NamedTuple):
    """Peaks or asperities of a surface, as found.

    Attributes
    ----------
    count : their number
    heights : moments of their heights
    curvatures : moments of their curvatures
    density : their number over that of candidates, NaN without candidates
    """

    count: int
    heights: Moments
    curvatures: Moments
    density: float


def describe(heights: NDArray[np.float64], spacing: float | tuple[float, float]) -> Description:
    """Statistics of a surface: peaks of its profiles, asperities, heights, bandwidth.

    Profiles run along x (axis 0) and y (axis 1). A peak is a node of a profile above both of its
    neighbours, peaks along x and y pooled; an asperity (summit) is a node above its four
    neighbours, so both need an interior node and plateaus have none. Curvature is minus the second
    difference over the squared spacing, at an asperity the mean of x and y. A density is a number
    over that of candidates: n_y (n_x - 2) + n_x (n_y - 2) positions on profiles for peaks,
    (n_x - 2)(n_y - 2) nodes for asperities. Means are of heights above the lowest node; "rms" is
    the standard deviation about the mean (of the population). Kurtosis is Pearson's (normal: 3) or
    excess (normal: 0) as the name says, which is what the ranges of Table 1 show: Pearson's for
    peaks and for the curvature of asperities, excess for asperities and the curvature of peaks.

    The bandwidth parameter is Nayak's (1971), alpha = m0 m4 / m2^2 for each axis: m0 the variance
    of all heights, m2 the mean of squared first differences and m4 that of squared second
    differences along the axis, over all profiles and each over its power of the spacing, which
    cancels. The paper does not state its definition: its ranges are about a seventh of these.

    Sums are not left to BLAS: it splits them by its number of threads, and the last bits of a
    database would depend on how many a rank was given.

    Parameters
    ----------
    heights : (n_x, n_y) heights [um], 2 x 2 or more; any offset, which is taken off first
    spacing : distance of neighbouring nodes [um], of one kind or a pair (along x, along y)

    Returns
    -------
    The statistics and why some are NaN, as they are on flat surfaces and small grids: moments of
    an empty sample, skewness and kurtosis of one whose values are equal to rounding, densities
    without candidates, the bandwidth along flat profiles or profiles of two nodes.
    Heights and their rms [um], curvatures and their rms [1/um], all others without unit.

    Raises
    ------
    InputError : heights that are not a finite 2-D array of 2 x 2 nodes or more, spacings that are
        not within `SPACINGS`

    Source: Table 1 (tab:list_of_params) and section 2.3 (sec_stat_of_top) of the paper.
    """
    spacing_x, spacing_y = _spacings(spacing)
    surface, unit, noise = _normalised(heights)
    along_x, along_y = _profiles(surface, axis=0), _profiles(surface, axis=1)
    ratio = (spacing_x / spacing_y) ** 2
    peaks = _peaks(surface, along_x, along_y, ratio, noise)
    asperities = _asperities(surface, along_x, along_y, ratio, noise)
    mean, variance = _mean_and_variance(surface.ravel())
    highest = float(surface.max())
    per_length = unit / spacing_x / spacing_x
    values = (
        peaks.heights.mean * unit,
        peaks.heights.rms * unit,
        peaks.heights.kurtosis,
        peaks.heights.skewness,
        peaks.density,
        peaks.curvatures.mean * per_length,
        peaks.curvatures.kurtosis - 3.0,
        peaks.curvatures.skewness,
        _bandwidth(variance, along_x, noise),
        _bandwidth(variance, along_y, noise),
        asperities.heights.mean * unit,
        asperities.heights.rms * unit,
        asperities.heights.kurtosis - 3.0,
        asperities.heights.skewness,
        asperities.density,
        asperities.curvatures.mean * per_length,
        asperities.curvatures.rms * per_length,
        asperities.curvatures.kurtosis,
        asperities.curvatures.skewness,
        mean * unit,
        highest * unit,
        math.sqrt(variance) * unit,
    )
    reason = _reason(highest, peaks, asperities, along_x, along_y, noise)
    return Description(dict(zip(NAMES, values, strict=True)), reason)


def _spacings(spacing: float | tuple[float, float]) -> tuple[float, float]:
    """Spacings along x and y [um], checked."""
    pair = spacing if isinstance(spacing, tuple) else (spacing, spacing)
    smallest, largest = SPACINGS
    if len(pair) != 2 or not all(smallest <= value <= largest for value in pair):
        raise InputError(
            f"spacing {spacing!r}: give one number or a pair, each from {smallest:g} to {largest:g} um"
        )
    return float(pair[0]), float(pair[1])


def _normalised(
    heights: NDArray[np.float64],
) -> tuple[NDArray[np.float64], float, float]:
    """Heights above the lowest node in a unit near the highest, so that no power over- or underflows.

    Returns
    -------
    surface : (n_x, n_y) C-contiguous heights above the lowest node, the highest from 0.5 to 1 [unit]
    unit : the unit, a power of two, so that scaling rounds nothing [um]
    noise : what the rounding of the given heights can fake, offset included [unit]
    """
    if heights.ndim != 2 or min(heights.shape) < 2:
        raise InputError(f"heights of shape {heights.shape}: give 2-D heights, 2 x 2 nodes or more")
    lowest, highest = float(heights.min()), float(heights.max())
    if not math.isfinite(highest - lowest):
        raise InputError("heights with NaN, infinities or an infinite range: give finite heights")
    exponent = math.frexp(highest - lowest)[1]
    unit = 2.0 ** min(max(exponent, -1000), 1000)
    surface = np.subtract(heights, lowest, order="C", dtype=np.float64)
    surface *= 1.0 / unit
    return surface, unit, ROUNDING * max(abs(lowest), abs(highest)) / unit


def _profiles(surface: NDArray[np.float64], axis: int) -> Profiles:
    """Differences and peaks of all profiles along one axis.

    Works on the flat array, where all operations are contiguous. Profiles along y follow one
    another there: what would reach over an end is set to zero, which is neither a peak nor counted
    in a sum.
    """
    nodes, columns = surface.ravel(), surface.shape[1]
    stride = columns if axis == 0 else 1
    length = surface.shape[axis]
    profiles = surface.size // length
    difference = nodes[stride:] - nodes[:-stride]
    if axis == 1:
        difference[columns - 1 :: columns] = 0.0
    curvature = difference[:-stride] - difference[stride:]
    if axis == 1:
        curvature[columns - 2 :: columns] = 0.0
        curvature[columns - 1 :: columns] = 0.0
    peaks = (difference[:-stride] > 0.0) & (difference[stride:] < 0.0)
    return Profiles(
        stride=stride,
        candidates=profiles * (length - 2),
        curvature=curvature,
        peaks=peaks,
        slope_square=_sum_of_products(difference, difference) / (profiles * (length - 1)),
        curvature_square=_sum_of_products(curvature, curvature) / max(profiles * (length - 2), 1),
    )


def _peaks(
    surface: NDArray[np.float64], along_x: Profiles, along_y: Profiles, ratio: float, noise: float
) -> Sample:
    """Peaks of the profiles, x and y pooled; `ratio` converts curvature along y to units of x."""
    nodes = surface.ravel()
    on_x, on_y = np.flatnonzero(along_x.peaks), np.flatnonzero(along_y.peaks)
    heights = np.concatenate((nodes[on_x + along_x.stride], nodes[on_y + along_y.stride]))
    curvatures = np.concatenate((along_x.curvature[on_x], along_y.curvature[on_y] * ratio))
    return _sample(heights, curvatures, along_x.candidates + along_y.candidates, ratio, noise)


def _asperities(
    surface: NDArray[np.float64], along_x: Profiles, along_y: Profiles, ratio: float, noise: float
) -> Sample:
    """Nodes above their four neighbours, with the mean of both curvatures."""
    rows, columns = surface.shape
    shift = along_x.stride - along_y.stride
    on_both = along_x.peaks & along_y.peaks[shift : shift + along_x.peaks.size]
    found = np.flatnonzero(on_both)
    heights = surface.ravel()[found + along_x.stride]
    curvatures = along_x.curvature[found] + along_y.curvature[found + shift] * ratio
    curvatures *= 0.5
    return _sample(heights, curvatures, (rows - 2) * (columns - 2), ratio, noise)


def _sample(
    heights: NDArray[np.float64],
    curvatures: NDArray[np.float64],
    candidates: int,
    ratio: float,
    noise: float,
) -> Sample:
    """Moments and density of the peaks or asperities found among so many candidates."""
    return Sample(
        count=heights.size,
        heights=_moments(heights, noise),
        curvatures=_moments(curvatures, noise * max(1.0, ratio)),
        density=heights.size / candidates if candidates else math.nan,
    )


def _moments(values: NDArray[np.float64], noise: float) -> Moments:
    """Moments of values (count,), in two passes; a spread within `noise` has no shape."""
    if not values.size:
        return Moments(math.nan, math.nan, math.nan, math.nan)
    mean = float(values.sum()) / values.size
    deviations = values - mean
    squares = deviations * deviations
    variance = float(squares.sum()) / values.size
    rms = math.sqrt(variance)
    if rms <= noise:
        return Moments(mean, rms, math.nan, math.nan)
    third = _sum_of_products(squares, deviations) / values.size
    fourth = _sum_of_products(squares, squares) / values.size
    return Moments(mean, rms, third / (variance * rms), fourth / (variance * variance))


def _mean_and_variance(values: NDArray[np.float64]) -> tuple[float, float]:
    """Mean and population variance, in two passes."""
    mean = float(values.sum()) / values.size
    deviations = values - mean
    return mean, _sum_of_products(deviations, deviations) / values.size


def _sum_of_products(first: NDArray[np.float64], second: NDArray[np.float64]) -> float:
    """Sum of products by einsum: BLAS would split it by threads, and change its last bits."""
    return float(np.einsum("i,i->", first, second))


def _bandwidth(variance: float, along: Profiles, noise: float) -> float:
    """Nayak's alpha = m0 m4 / m2^2 of one axis; the spacing cancels."""
    if not along.candidates or math.sqrt(along.slope_square) <= noise:
        return math.nan
    return (variance / along.slope_square) * (along.curvature_square / along.slope_square)


def _reason(
    highest: float,
    peaks: Sample,
    asperities: Sample,
    along_x: Profiles,
    along_y: Profiles,
    noise: float,
) -> str:
    """What is missing, in one short text; empty where all statistics are defined."""
    if highest == 0.0:
        return "flat surface: no profile peak, no asperity"
    faults = []
    for axis, along in (("x", along_x), ("y", along_y)):
        if not along.candidates:
            faults.append(f"two nodes along {axis}")
        elif math.sqrt(along.slope_square) <= noise:
            faults.append(f"flat profiles along {axis}")
    for one, all_of_them, sample in (
        ("profile peak", "profile peaks", peaks),
        ("asperity", "asperities", asperities),
    ):
        if sample.count < 2:
            faults.append(f"{'one' if sample.count else 'no'} {one}")
            continue
        for quantity, moments in (("height", sample.heights), ("curvature", sample.curvatures)):
            if math.isnan(moments.kurtosis):
                faults.append(f"{all_of_them} of equal {quantity}")
    return ", ".join(faults)
