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
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Values
from gen.runtime.errors import InputError
from gen.schema import TABLE_1

NAMES = tuple(column.name for column in TABLE_1)
"""Names of the statistics in the order of Table 1."""

# smallest and largest spacing [um], between which no power of a curvature overflows
FINEST = 1e-15
COARSEST = 1e15
ROUNDING = 8.0  # largest second difference by rounding, in spacings of numbers at the top

LOST = 1000.0
"""Smallest rms of heights that has a shape, in spacings of numbers at the largest height: below it
peaks become ties, and skewness and kurtosis are wrong by more than about one part in a hundred."""

UNDEFINED = "no asperity or one, peaks of equal height or curvature, or flat profiles"
"""Why statistics are NaN on a surface that is not flat."""

DOT = "i,i->"  # sum of products by einsum: BLAS's last bits would depend on the number of threads
# rms over mean below which rounding of the mean would show in the third moment
NEARLY_EQUAL = 1e-3


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
    """Number of values and their population moments; a moment that they do not define is NaN."""

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
    # mean of the squared second differences; NaN for profiles of two nodes
    curvature_square: float


class ScaledHeights(NamedTuple):
    """Heights of a surface, divided by a power of two near their range."""

    nodes: Values  # scaled heights, shape (nx, ny), row by row in memory
    unit: float  # the power of two [um]
    rounding: float  # distance of neighbouring numbers at the largest height, in units
    lowest: float  # smallest scaled height
    highest: float  # largest scaled height

    @property
    def noise(self) -> float:
        """Largest second difference that rounding makes, in units."""
        return ROUNDING * self.rounding


class Points(NamedTuple):
    """Peaks of profiles or asperities, in the units of scaled heights."""

    heights: Values  # scaled heights, shape (points,)
    # minus the second differences times (dx / spacing)^2, where the spacing is dx along x and dy
    # along y; of an asperity the mean of both axes; shape (points,)
    curvatures: Values


class PointMoments(NamedTuple):
    """Moments of the heights and curvatures of peaks or asperities."""

    heights: Moments  # with the mean counted from the lowest node
    curvatures: Moments


class SurfaceMoments(NamedTuple):
    """What the statistics of a surface are made of, in the units of scaled heights."""

    heights: Moments  # of all nodes, with the mean counted from the lowest one
    peaks: PointMoments
    asperities: PointMoments
    bandwidth_x: float  # Nayak's parameter of the profiles along x [1]
    bandwidth_y: float


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
        not from `FINEST` to `COARSEST`, or curvatures are beyond the largest number.

    References
    ----------
    Section 2.3 (sec_stat_of_top) and Table 1 (tab:list_of_params) of the paper.
    """
    dx, dy = _spacings(spacing)
    surface = _scaled(heights)
    moments = _surface_moments(surface, (dx / dy) ** 2)
    per_length = surface.unit / dx / dx
    values = _table_1(moments, surface, per_length)
    if per_length < np.finfo(np.float64).tiny or any(map(math.isinf, values.values())):
        raise InputError(
            f"heights over {values['height_max']:g} um on a spacing of {dx:g} um: their curvatures"
            " are beyond what numbers hold; give other units"
        )
    if 0.0 < moments.heights.variance <= (LOST * surface.rounding) ** 2:
        return _lost_in_rounding(values, surface)
    return Description(values, _reason(values, surface, heights))


def _spacings(spacing: float | tuple[float, float]) -> tuple[float, float]:
    """Return the spacings along x and y [um]; refuse those outside `FINEST` to `COARSEST`."""
    pair = spacing if isinstance(spacing, tuple) else (spacing, spacing)
    if len(pair) != 2 or not all(FINEST <= length <= COARSEST for length in pair):
        raise InputError(
            f"spacing {np.asarray(spacing).tolist()}: give one or a pair, from {FINEST:g} to"
            f" {COARSEST:g} um"
        )
    return pair


def _surface_moments(surface: ScaledHeights, ratio: float) -> SurfaceMoments:
    """Compute all moments of a surface; `ratio` is (dx / dy)^2 of its spacings dx and dy."""
    nodes = surface.nodes
    along_x = _profiles(nodes, axis=0)
    along_y = _profiles(nodes, axis=1)
    # Table 1 has no skewness and kurtosis of all heights: an infinite noise leaves them out.
    heights = _moments(nodes.ravel(), surface.lowest, noise=math.inf)
    peaks = _peaks(nodes.ravel(), along_x, along_y, ratio)
    peak_moments = _point_moments(peaks, surface, ratio)
    del peaks  # which may take as much memory as the heights
    asperities = _asperities(nodes.ravel(), along_x, along_y, ratio)
    return SurfaceMoments(
        heights=heights,
        peaks=peak_moments,
        asperities=_point_moments(asperities, surface, ratio),
        bandwidth_x=_bandwidth(along_x, heights.variance, surface.noise),
        bandwidth_y=_bandwidth(along_y, heights.variance, surface.noise),
    )


def _point_moments(points: Points, surface: ScaledHeights, ratio: float) -> PointMoments:
    """Compute the moments of points of a surface; `ratio` is (dx / dy)^2 of its spacings.

    Rounding of curvatures along y is `ratio` times that along x.
    """
    curvature_noise = surface.noise * max(1.0, ratio)
    return PointMoments(
        heights=_moments(points.heights, surface.lowest, surface.noise),
        curvatures=_moments(points.curvatures, 0.0, curvature_noise),
    )


def _bandwidth(profiles: Profiles, variance: float, noise: float) -> float:
    """Compute Nayak's bandwidth parameter of an axis; NaN if profiles are flat to rounding.

    The variance is that of all heights, the noise the largest difference by rounding.
    """
    if profiles.slope_square <= noise * noise:
        return math.nan
    over_slopes = variance / profiles.slope_square
    return over_slopes * (profiles.curvature_square / profiles.slope_square)


def _table_1(
    moments: SurfaceMoments, surface: ScaledHeights, per_length: float
) -> dict[str, float]:
    """Return the statistics by name, in the units of Table 1.

    `per_length` is the unit of the curvatures in `moments` [1/um].
    """
    heights, peaks, asperities = moments.heights, moments.peaks, moments.asperities
    unit = surface.unit
    nodes = surface.nodes.size
    return {
        "peak_mean": peaks.heights.mean * unit,
        "peak_rms": peaks.heights.rms * unit,
        "peak_kurtosis_pearson": peaks.heights.kurtosis,
        "peak_skewness": peaks.heights.skewness,
        "peak_density": peaks.heights.number / (2 * nodes),
        "peak_curvature_mean": peaks.curvatures.mean * per_length,
        "peak_curvature_kurtosis_excess": peaks.curvatures.kurtosis - 3.0,
        "peak_curvature_skewness": peaks.curvatures.skewness,
        "bandwidth_x": moments.bandwidth_x,
        "bandwidth_y": moments.bandwidth_y,
        "asperity_mean": asperities.heights.mean * unit,
        "asperity_rms": asperities.heights.rms * unit,
        "asperity_kurtosis_excess": asperities.heights.kurtosis - 3.0,
        "asperity_skewness": asperities.heights.skewness,
        "asperity_density": asperities.heights.number / nodes,
        "asperity_curvature_mean": asperities.curvatures.mean * per_length,
        "asperity_curvature_rms": asperities.curvatures.rms * per_length,
        "asperity_curvature_kurtosis_pearson": asperities.curvatures.kurtosis,
        "asperity_curvature_skewness": asperities.curvatures.skewness,
        "height_mean": heights.mean * unit,
        "height_max": (surface.highest - surface.lowest) * unit,
        "height_rms": heights.rms * unit,
    }


def _lost_in_rounding(values: dict[str, float], surface: ScaledHeights) -> Description:
    """Return the description of heights whose offset has left too few of their digits.

    Only the three statistics of all heights are numbers, and the others NaN.
    """
    kept = {name: values[name] for name in ("height_mean", "height_max", "height_rms")}
    return Description(
        dict.fromkeys(NAMES, math.nan) | kept,
        f"heights lost in rounding: rms {values['height_rms']:.3g} um at an offset where numbers"
        f" are {surface.rounding * surface.unit:.2g} um apart",
    )


def _reason(values: dict[str, float], surface: ScaledHeights, heights: Values) -> str:
    """Say why some statistics of a surface with these heights [um] are NaN; "" if none is."""
    if surface.lowest == surface.highest:
        return "flat surface: no profile peak, no asperity"
    if not any(map(math.isnan, values.values())):
        return ""
    lower_quartile, upper_quartile = np.percentile(surface.nodes, [25.0, 75.0])
    if 0.0 < upper_quartile - lower_quartile <= LOST * surface.rounding:
        largest = max(float(heights.min()), float(heights.max()), key=abs)
        return f"most heights are lost in rounding beside one of {largest:.6g} um"
    return UNDEFINED


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
    mean_square = 0.0
    for axis, length in enumerate(spacing):
        with np.errstate(over="ignore"):
            slopes = np.diff(heights, axis=axis) / length
            mean_square += float(np.nanmean(slopes**2))
    return math.sqrt(mean_square)


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
    # An even slope has no curvature, and files may hold any numbers.
    with np.errstate(all="ignore"):
        along_x = change / (statistics["bandwidth_x"] * spacing[0] ** 2)
        along_y = change / (statistics["bandwidth_y"] * spacing[1] ** 2)
        return np.asarray(statistics["height_rms"] * np.sqrt(along_x + along_y))


def refuse_masked(name: str, array: Any) -> None:
    """Refuse an array with masked entries; one whose mask hides nothing is as any other.

    Parameters
    ----------
    name : str
        What the array holds, in the plural, for the message.
    array : array_like
        Numbers of any shape and unit.

    Raises
    ------
    InputError
        If an entry is masked.
    """
    if np.ma.is_masked(array):
        raise InputError(f"{name} are masked in places: fill or crop them")


def _scaled(heights: Values) -> ScaledHeights:
    """Check heights [um] and divide them by a power of two, so that no moment overflows."""
    _refuse_all_but_heights(heights)
    lowest = float(heights.min())
    highest = float(heights.max())
    if not math.isfinite(highest - lowest):
        raise InputError(
            "heights with NaN, infinities or an infinite range: give finite heights"
        )
    if lowest == highest:
        return ScaledHeights(np.zeros(heights.shape), 1.0, 0.0, 0.0, 0.0)
    exponent = math.frexp(highest - lowest)[1]
    unit = 2.0 ** min(max(exponent, -1000), 1000)
    nodes = np.multiply(heights, 1.0 / unit, order="C", dtype=np.float64)
    largest = max(abs(lowest), abs(highest)) / unit
    return ScaledHeights(
        nodes,
        unit,
        rounding=_precision(heights) * largest,
        lowest=float(nodes.min()),
        highest=float(nodes.max()),
    )


def _refuse_all_but_heights(heights: Values) -> None:
    """Refuse arrays that are no grid of real numbers, 2 x 2 or more, or masked in places."""
    if heights.ndim != 2 or min(heights.shape) < 2:
        raise InputError(
            f"heights of shape {heights.shape}: give 2-D heights, 2 x 2 nodes or more"
        )
    if heights.dtype.kind not in "buif":
        raise InputError(f"heights of type {heights.dtype}: give real numbers")
    refuse_masked("heights", heights)


def _precision(heights: Values) -> float:
    """Return the relative distance of the numbers that heights are given in.

    It is that of double precision, or of the single or half precision of the array.
    """
    if heights.dtype.kind == "f" and heights.dtype.itemsize < 8:
        return float(np.finfo(heights.dtype).eps)
    return float(np.finfo(np.float64).eps)


def _profiles(surface: Values, axis: int) -> Profiles:
    """Compute the differences and peaks of all profiles of scaled heights along one axis."""
    nodes = surface.ravel()
    columns = surface.shape[1]
    stride = columns if axis == 0 else 1
    length = surface.shape[axis]
    number = surface.size // length  # of profiles
    # Not of heights above the lowest: those far above it would be rounded, and neighbours tie.
    difference = nodes[stride:] - nodes[:-stride]
    if axis == 1:  # from the end of a row to the next one
        difference[columns - 1 :: columns] = 0.0
    curvature = difference[:-stride] - difference[stride:]
    if axis == 1:
        curvature[columns - 2 :: columns] = 0.0
        curvature[columns - 1 :: columns] = 0.0
    slope_square = _sum_of_squares(difference) / (number * (length - 1))
    curvature_square = math.nan
    if length > 2:
        curvature_square = _sum_of_squares(curvature) / (number * (length - 2))
    return Profiles(
        stride=stride,
        curvature=curvature,
        peaks=(difference[:-stride] > 0.0) & (difference[stride:] < 0.0),
        slope_square=slope_square,
        curvature_square=curvature_square,
    )


def _sum_of_squares(values: Values) -> float:
    """Return the sum of the squares of values (count,), alike for any number of threads."""
    return float(np.einsum(DOT, values, values))


def _peaks(nodes: Values, along_x: Profiles, along_y: Profiles, ratio: float) -> Points:
    """Return the peaks of the profiles along x and y of scaled heights (nx ny,)."""
    on_x = np.flatnonzero(along_x.peaks)
    on_y = np.flatnonzero(along_y.peaks)
    heights = (nodes[on_x + along_x.stride], nodes[on_y + along_y.stride])
    curvatures = (along_x.curvature[on_x], along_y.curvature[on_y] * ratio)
    return Points(np.concatenate(heights), np.concatenate(curvatures))


def _asperities(
    nodes: Values, along_x: Profiles, along_y: Profiles, ratio: float
) -> Points:
    """Return the asperities of scaled heights (nx ny,): nodes that are peaks along x and y."""
    # The node of an entry of `along_x` has its entry of `along_y` this much later.
    shift = along_x.stride - along_y.stride
    is_peak_along_y = along_y.peaks[shift : shift + along_x.peaks.size]
    entries = np.flatnonzero(along_x.peaks & is_peak_along_y)
    curvatures = along_x.curvature[entries] + along_y.curvature[entries + shift] * ratio
    return Points(nodes[entries + along_x.stride], 0.5 * curvatures)


def _moments(values: Values, origin: float, noise: float) -> Moments:
    """Compute the moments of values (count,), with the mean counted from an origin.

    There is no skewness or kurtosis if the rms is not above that of noise.
    """
    number = values.size
    if number == 0:
        return Moments(0, math.nan, math.nan, math.nan, math.nan, math.nan)
    mean = float(values.sum()) / number
    deviations = values - mean
    variance = _sum_of_squares(deviations) / number
    correction = 0.0  # of the mean, whose rounding may be large beside the deviations
    if math.sqrt(variance) < NEARLY_EQUAL * abs(mean):
        correction = float(deviations.sum()) / number
        deviations -= correction
        variance = _sum_of_squares(deviations) / number
    mean = (mean - origin) + correction
    rms = math.sqrt(variance)
    if rms <= noise:
        return Moments(number, mean, variance, rms, math.nan, math.nan)
    squares = deviations * deviations
    third = float(np.einsum(DOT, squares, deviations)) / number
    fourth = _sum_of_squares(squares) / number
    skewness = third / (variance * rms)
    kurtosis = fourth / (variance * variance)
    return Moments(number, mean, variance, rms, skewness, kurtosis)
