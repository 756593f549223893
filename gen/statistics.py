"""The 22 statistics of rough surfaces (Table 1 of the paper), computed together.

Profiles run along x (axis 0) and y (axis 1). Table 1 leaves the following conventions open. Its
ranges decide the kurtoses and agree with every statistic but the bandwidth
(tests/gen/test_statistics.py):

- A peak is a node of a profile above both neighbours; the peaks along x and y are pooled. An
  asperity (summit) is a node above its four neighbours. Peaks and asperities are interior nodes;
  plateaus have none.
- Heights are counted from the lowest node. "rms" is the standard deviation of the population.
- Kurtosis is Pearson's (normal: 3) or excess (normal: 0), as the name says: Pearson's for peaks
  and for the curvature of asperities, excess for asperities and for the curvature of peaks.
- Curvature is minus the second difference over the squared spacing, at asperities the mean of x
  and y.
- Densities are numbers per node: of asperities over n_x n_y, of peaks over 2 n_x n_y, since a
  node can be a peak along x and along y.
- The bandwidth parameter of an axis is Nayak's (1971), m0 m4 / m2^2: m0 the variance of all
  heights, m2 and m4 the means of squared slopes (first differences over the spacing) and squared
  curvatures over all profiles along it. The spacing cancels. The paper's definition is not
  stated, and its ranges are three to seven times lower.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Values
from gen.runtime.errors import InputError
from gen.schema import TABLE_1

NAMES = tuple(column.name for column in TABLE_1)
"""Names of the statistics in the order of Table 1."""

SPACINGS = (
    1e-15,
    1e15,
)  # least and most [um], between which no power of a curvature overflows
ROUNDING = 8.0  # largest second difference by rounding, in spacings of numbers at the top

LOST = 1000.0
"""Smallest rms of heights that has a shape, in spacings of numbers at the largest height: below it
peaks become ties, and skewness and kurtosis are wrong by more than about one part in a hundred."""

UNDEFINED = "no asperity or one, peaks of equal height or curvature, or flat profiles"
"""Why statistics are NaN on a surface that is not flat."""

DOT = "i,i->"  # sum of products by einsum: BLAS's last bits would depend on the number of threads
NEARLY_EQUAL = (
    1e-3  # spread over mean below which rounding would show in the third moment
)


@dataclass(frozen=True)
class Description:
    """The 22 statistics of a surface, and the reason why some of them are undefined.

    Attributes
    ----------
    values : dict of str to float
        The statistics by name, in the order of `NAMES`; NaN where the surface defines none.
    reason : str
        Short text that says why some values are NaN; empty if none is NaN.
    """

    values: dict[str, float]
    reason: str


class Moments(NamedTuple):
    """Number of values and their population moments; NaN for those that they do not define."""

    number: int
    mean: float
    variance: float  # of the population: squares are divided by their number
    rms: float  # root of the variance
    skewness: float
    kurtosis: float  # Pearson's (normal distribution: 3)


class Profiles(NamedTuple):
    """All profiles along one axis of a surface whose N nodes are numbered row by row.

    Arrays are of shape (N - 2 stride,); entry i belongs to node i + stride.
    """

    stride: int  # step from a node to the next one of its profile
    curvature: Values  # minus the second difference of heights, 0 at the ends of profiles
    peaks: NDArray[np.bool_]  # whether a node is above both neighbours; false at the ends
    slope_square: float  # mean of the squared first differences
    curvature_square: (
        float  # that of the second differences; NaN for profiles of two nodes
    )


def describe(heights: Values, spacing: float | tuple[float, float]) -> Description:
    """Compute the 22 statistics of a surface by the conventions of this module.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights [um] of 2 x 2 nodes or more, with any offset.
    spacing : float or pair of float
        Distance between neighbouring nodes [um], the same along both axes or along x and y.

    Returns
    -------
    Description
        All statistics of `NAMES`: heights and their rms [um], curvatures and their rms [1/um],
        the rest without unit. A statistic is NaN, with a reason, if the surface has no peak or
        asperity to take moments of, if the values whose skewness or kurtosis is asked for are
        equal to rounding, if profiles are flat or have two nodes (bandwidth), or if the offset of
        the heights has left too few of their digits (all statistics but the heights' own).

    Raises
    ------
    InputError
        If the heights are not a 2-D grid of 2 x 2 or more real, finite numbers, the spacing is
        outside `SPACINGS`, or curvatures are beyond the largest number.

    References
    ----------
    Section 2.3 (sec_stat_of_top) and Table 1 (tab:list_of_params) of the paper.
    """
    pair = spacing if isinstance(spacing, tuple) else (spacing, spacing)
    if len(pair) != 2 or not all(SPACINGS[0] <= value <= SPACINGS[1] for value in pair):
        raise InputError(
            f"spacing {np.asarray(spacing).tolist()}: give one or a pair, from {SPACINGS[0]:g} to"
            f" {SPACINGS[1]:g} um"
        )
    nodes, unit, rounding = _normalised(heights)
    noise, ratio = ROUNDING * rounding, (pair[0] / pair[1]) ** 2
    along_x, along_y = _profiles(nodes, axis=0), _profiles(nodes, axis=1)
    lowest, highest = float(nodes.min()), float(nodes.max())
    whole = _moments(
        nodes.ravel(), lowest, math.inf
    )  # Table 1 has no shape of all heights
    bandwidths = [
        math.nan
        if along.slope_square <= noise * noise  # flat to rounding
        else (whole.variance / along.slope_square)
        * (along.curvature_square / along.slope_square)
        for along in (along_x, along_y)
    ]
    peaks, asperities = (
        (
            _moments(summits, lowest, noise),
            _moments(curvatures, 0.0, noise * max(1.0, ratio)),
        )
        for summits, curvatures in _summits(nodes.ravel(), along_x, along_y, ratio)
    )
    per_length = unit / pair[0] / pair[0]
    values = (
        peaks[0].mean * unit,
        peaks[0].rms * unit,
        peaks[0].kurtosis,
        peaks[0].skewness,
        peaks[0].number / (2 * nodes.size),
        peaks[1].mean * per_length,
        peaks[1].kurtosis - 3.0,
        peaks[1].skewness,
        *bandwidths,
        asperities[0].mean * unit,
        asperities[0].rms * unit,
        asperities[0].kurtosis - 3.0,
        asperities[0].skewness,
        asperities[0].number / nodes.size,
        asperities[1].mean * per_length,
        asperities[1].rms * per_length,
        asperities[1].kurtosis,
        asperities[1].skewness,
        whole.mean * unit,
        (highest - lowest) * unit,
        whole.rms * unit,
    )
    if per_length < np.finfo(np.float64).tiny or any(map(math.isinf, values)):
        raise InputError(
            f"heights over {values[-2]:g} um on a spacing of {pair[0]:g} um: their curvatures are"
            " beyond what numbers hold; give other units"
        )
    named = dict(zip(NAMES, values, strict=True))
    if 0.0 < whole.variance <= (LOST * rounding) ** 2:
        kept = {name: named[name] for name in ("height_mean", "height_max", "height_rms")}
        return Description(
            dict.fromkeys(NAMES, math.nan) | kept,
            f"heights lost in rounding: rms {named['height_rms']:.3g} um at an offset where numbers"
            f" are {rounding * unit:.2g} um apart",
        )
    if lowest == highest:
        return Description(named, "flat surface: no profile peak, no asperity")
    reason = ""
    if any(map(math.isnan, values)):
        lower, upper = np.percentile(nodes, [25.0, 75.0])
        lost = 0.0 < upper - lower <= LOST * rounding
        reason = _lost_beside(heights) if lost else UNDEFINED
    return Description(named, reason)


def _lost_beside(heights: Values) -> str:
    """Return the reason why most heights have no shape beside the largest one."""
    lowest, highest = float(heights.min()), float(heights.max())
    largest = highest if highest > -lowest else lowest
    return f"most heights are lost in rounding beside one of {largest:.6g} um"


def rms_slope(heights: Values, spacing: tuple[float, float]) -> float:
    """Compute the root mean square of the slopes between neighbouring nodes.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights [um]; NaN where they are missing.
    spacing : pair of float
        Distances between neighbouring nodes along x and y [um].

    Returns
    -------
    float
        Root of the sum of both directions' mean squares [1]; infinite if that is beyond numbers.

    Raises
    ------
    InputError
        If heights are masked in places.
    """
    refuse_masked("heights", heights)
    squares = 0.0
    for axis, length in enumerate(spacing):
        with np.errstate(over="ignore"):
            squares += float(np.nanmean((np.diff(heights, axis=axis) / length) ** 2))
    return math.sqrt(squares)


def rms_slope_of(
    statistics: Mapping[str, Values], spacing: tuple[float, float]
) -> Values:
    """Estimate the rms slopes of surfaces from their statistics, without the surfaces.

    Nayak's bandwidth parameter is m0 m4 / m2^2 of a profile. Where slopes are normally distributed,
    and on a sine wave, the density of peaks gives m4 / m2 = 2 (1 - cos(2 pi density)) / spacing^2,
    and both together m2. On surfaces of the shipped scenes the estimate is within 8 % of that of
    `rms_slope` (`tests/gen/test_statistics.py`).

    Parameters
    ----------
    statistics : mapping of str to ndarray, shape (surfaces,)
        The statistics height_rms [um], peak_density, bandwidth_x and bandwidth_y [1].
    spacing : pair of float
        Distances between neighbouring nodes along x and y [um].

    Returns
    -------
    ndarray, shape (surfaces,)
        Rms slopes [1]; NaN where a statistic is.

    References
    ----------
    Nayak, P. R., 1971. Random process model of rough surfaces. Journal of Lubrication Technology
    93, 398-407.
    """
    change = 2.0 * (1.0 - np.cos(2.0 * math.pi * statistics["peak_density"]))
    with np.errstate(
        all="ignore"
    ):  # an even slope has no curvature; files may hold any numbers
        along_x = change / (statistics["bandwidth_x"] * spacing[0] ** 2)
        along_y = change / (statistics["bandwidth_y"] * spacing[1] ** 2)
        return np.asarray(statistics["height_rms"] * np.sqrt(along_x + along_y))


def refuse_masked(name: str, given: Any) -> None:
    """Refuse an array with masked entries; one with a mask of nothing is as any other."""
    if np.ma.is_masked(given):
        raise InputError(f"{name} are masked in places: fill or crop them")


def _normalised(heights: Values) -> tuple[Values, float, float]:
    """Return heights scaled by a power of two, the unit [um], and the spacing of numbers there."""
    if heights.ndim != 2 or min(heights.shape) < 2:
        raise InputError(
            f"heights of shape {heights.shape}: give 2-D heights, 2 x 2 nodes or more"
        )
    if heights.dtype.kind not in "buif":
        raise InputError(f"heights of type {heights.dtype}: give real numbers")
    refuse_masked("heights", heights)
    lowest, highest = float(heights.min()), float(heights.max())
    if not math.isfinite(highest - lowest):
        raise InputError(
            "heights with NaN, infinities or an infinite range: give finite heights"
        )
    if lowest == highest:
        return np.zeros(heights.shape), 1.0, 0.0
    exponent = math.frexp(highest - lowest)[1]
    unit = 2.0 ** min(max(exponent, -1000), 1000)
    nodes = np.multiply(heights, 1.0 / unit, order="C", dtype=np.float64)
    # Heights that were given in single precision keep its number of digits.
    single = heights.dtype.kind == "f" and heights.dtype.itemsize < 8
    eps = float(np.finfo(heights.dtype if single else np.float64).eps)
    return nodes, unit, eps * (max(abs(lowest), abs(highest)) / unit)


def _profiles(surface: Values, axis: int) -> Profiles:
    """Compute the differences and peaks of all profiles along one axis."""
    nodes, columns = surface.ravel(), surface.shape[1]
    stride = columns if axis == 0 else 1
    length = surface.shape[axis]
    profiles = surface.size // length
    # Not of heights above the lowest: those far above it would be rounded, and neighbours tie.
    difference = nodes[stride:] - nodes[:-stride]
    if axis == 1:
        difference[columns - 1 :: columns] = 0.0
    curvature = difference[:-stride] - difference[stride:]
    if axis == 1:
        curvature[columns - 2 :: columns] = 0.0
        curvature[columns - 1 :: columns] = 0.0
    inside = profiles * (length - 2)
    slopes, curvatures = (
        float(np.einsum(DOT, each, each)) for each in (difference, curvature)
    )
    return Profiles(
        stride=stride,
        curvature=curvature,
        peaks=(difference[:-stride] > 0.0) & (difference[stride:] < 0.0),
        slope_square=slopes / (profiles * (length - 1)),
        curvature_square=curvatures / inside if inside else math.nan,
    )


def _summits(
    nodes: Values, along_x: Profiles, along_y: Profiles, ratio: float
) -> Iterator[tuple[Values, Values]]:
    """Yield heights and curvatures, in units of x, of all profiles' peaks, then of asperities."""
    on_x, on_y = np.flatnonzero(along_x.peaks), np.flatnonzero(along_y.peaks)
    heights = np.concatenate((nodes[on_x + along_x.stride], nodes[on_y + along_y.stride]))
    yield (
        heights,
        np.concatenate((along_x.curvature[on_x], along_y.curvature[on_y] * ratio)),
    )
    shift = along_x.stride - along_y.stride
    on_x = np.flatnonzero(
        along_x.peaks & along_y.peaks[shift : shift + along_x.peaks.size]
    )
    curvatures = 0.5 * (along_x.curvature[on_x] + along_y.curvature[on_x + shift] * ratio)
    yield nodes[on_x + along_x.stride], curvatures


def _moments(values: Values, origin: float, noise: float) -> Moments:
    """Compute the moments of values (count,), with the mean counted from an origin.

    There is no skewness or kurtosis if the rms is not above that of noise.
    """
    if not values.size:
        return Moments(0, *[math.nan] * 5)
    mean = float(values.sum()) / values.size
    deviations = values - mean
    variance = float(np.einsum(DOT, deviations, deviations)) / values.size
    rest = 0.0  # of the mean, whose rounding may be too large beside the deviations
    if math.sqrt(variance) < NEARLY_EQUAL * abs(mean):
        rest = float(deviations.sum()) / values.size
        deviations -= rest
        variance = float(np.einsum(DOT, deviations, deviations)) / values.size
    mean, rms = (mean - origin) + rest, math.sqrt(variance)
    if rms <= noise:
        return Moments(values.size, mean, variance, rms, math.nan, math.nan)
    squares = deviations * deviations
    third = float(np.einsum(DOT, squares, deviations)) / values.size / (variance * rms)
    fourth = float(np.einsum(DOT, squares, squares)) / values.size / (variance * variance)
    return Moments(values.size, mean, variance, rms, third, fourth)
