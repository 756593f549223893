"""The 22 statistics of rough surfaces (Table 1 of the paper), computed together.

Profiles run along x (axis 0) and y (axis 1). Table 1 leaves the following conventions open. The
ranges that it states decide which kurtosis is meant, and agree with every statistic except the
bandwidth (tests/gen/test_statistics.py):

- A peak is a node of a profile above both neighbours. The peaks along x and along y are pooled. An
  asperity (summit) is a node above its four neighbours. Peaks and asperities are interior nodes;
  plateaus have none.
- Heights are counted from the lowest node. "rms" is the standard deviation of the population.
- Kurtosis is Pearson's (normal: 3) or excess (normal: 0), as the name says. It is Pearson's for
  heights of peaks and curvatures of asperities, and excess for heights of asperities and curvatures
  of peaks.
- Curvature is minus the second difference over the squared spacing; at asperities it is the mean
  of the curvatures along x and y.
- Densities are numbers per node. The number of asperities is divided by n_x n_y. The number of
  peaks is divided by 2 n_x n_y, since a node can be a peak along x and along y.
- The bandwidth parameter of an axis is Nayak's (1971), m0 m4 / m2^2, in which the spacing cancels.
  m0 is the variance of all heights. m2 and m4 are the means of the squared slopes (first
  differences over the spacing) and of the squared curvatures of all profiles along the axis. The
  paper does not define its bandwidth, whose ranges are three to seven times lower.
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

# smallest and largest spacing that is allowed [um]: no power of a curvature overflows between them
FINEST = 1e-15
COARSEST = 1e15
# largest second difference that rounding makes, over the distance of neighbouring floating-point
# numbers at the largest height
ROUNDING = 8.0

LOST = 1000.0
"""Smallest rms height that has a shape, over the distance of neighbouring floating-point numbers at
the largest height. Below it, neighbouring heights become equal, and skewness and kurtosis are wrong
by more than about one part in a hundred."""

UNDEFINED = "no asperity or one, peaks of equal height or curvature, or flat profiles"
"""Reason for NaN on a surface that is not flat and whose heights are not lost in rounding."""

# subscripts of `numpy.einsum` for a sum of products; by BLAS its last bits would depend on the
# number of threads
DOT = "i,i->"
# rms over mean below which the rounding of the mean would show in the third moment
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
    """Number of values and their population moments; a moment that is not defined is NaN."""

    number: int
    mean: float
    variance: float  # of the population: squares are divided by their number
    rms: float  # root of the variance
    skewness: float
    kurtosis: float  # Pearson's (normal distribution: 3)


class Profiles(NamedTuple):
    """All profiles along one axis of scaled heights, whose N nodes are numbered row by row.

    Arrays are of shape (N - 2 stride,); entry i belongs to node i + stride.
    """

    stride: int  # difference of the numbers of neighbouring nodes of a profile
    curvature: Values  # minus the second difference of heights, 0 at the ends of profiles
    # whether a node is above both neighbours; false at the ends of profiles
    peaks: NDArray[np.bool_]
    slope_square: float  # mean of the squared first differences
    # mean of the squared second differences; NaN for profiles of two nodes
    curvature_square: float


class ScaledHeights(NamedTuple):
    """Heights of a surface, divided by a power of two near their range; their offset stays."""

    nodes: Values  # scaled heights, shape (nx, ny), row by row in memory [unit]
    unit: float  # the power of two [um]
    # distance of neighbouring floating-point numbers at the largest height [unit]
    rounding: float
    lowest: float  # smallest scaled height [unit]
    highest: float  # largest scaled height [unit]

    @property
    def noise(self) -> float:
        """Largest second difference that rounding makes [unit]."""
        return ROUNDING * self.rounding


class Points(NamedTuple):
    """Heights and curvatures of points that are peaks of profiles, or asperities."""

    heights: Values  # scaled heights, shape (points,)
    # curvatures times dx^2, in the unit of scaled heights, shape (points,): minus the second
    # difference along x, and minus (dx / dy)^2 times the second difference along y. An asperity has
    # the mean of both.
    curvatures: Values


class PointMoments(NamedTuple):
    """Moments of the numbers in `Points`."""

    heights: Moments  # moments of the heights; the mean is counted from the lowest node
    curvatures: Moments  # moments of the curvatures times dx^2


class SurfaceMoments(NamedTuple):
    """Moments from which the statistics of a surface follow, in the unit of scaled heights."""

    heights: Moments  # moments of the heights of all nodes; the mean counts from the lowest node
    peaks: PointMoments
    asperities: PointMoments
    bandwidth_x: float  # Nayak's bandwidth parameter of the profiles along x [1]
    bandwidth_y: float  # Nayak's bandwidth parameter of the profiles along y [1]


def describe(heights: Values, spacing: float | tuple[float, float]) -> Description:
    """Compute the 22 statistics of a surface by the conventions of this module.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights [um] of 2 x 2 nodes or more, with any offset.
    spacing : float or pair of float
        Distance between neighbouring nodes along both axes, or a pair along x and along y [um].

    Returns
    -------
    Description
        All statistics of `NAMES`: means, maxima and rms of heights [um] and of curvatures [1/um];
        all others have no unit. Statistics are NaN, and the reason says why, in these cases:

        - Statistics of peaks (asperities) if the surface has no peak (asperity), except for their
          density, which is 0.
        - Skewness and kurtosis of values that are equal but for rounding.
        - The bandwidth of profiles that are flat or have two nodes.
        - All but the mean, rms and range of the heights if an offset leaves too few digits for
          the roughness.

    Raises
    ------
    InputError
        If the heights are not a 2-D grid of 2 x 2 or more real, finite numbers, a spacing is
        not from `FINEST` to `COARSEST`, or curvatures are too large or too small for a number.

    References
    ----------
    Section 2.3 (sec_stat_of_top) and Table 1 (tab:list_of_params) of the paper.
    """
    dx, dy = _spacings(spacing)
    surface = _scaled(heights)
    moments = _surface_moments(surface, (dx / dy) ** 2)
    curvature_unit = surface.unit / dx / dx  # [1/um]
    values = _table_1(moments, surface, curvature_unit)
    underflows = curvature_unit < np.finfo(np.float64).tiny  # smaller numbers lose digits
    if underflows or any(map(math.isinf, values.values())):
        raise InputError(
            f"heights over {values['height_max']:g} um on a spacing of {dx:g} um: their curvatures"
            " are beyond what numbers hold; give other units"
        )
    smallest_variance = (LOST * surface.rounding) ** 2
    if 0.0 < moments.heights.variance <= smallest_variance:
        return _lost_in_rounding(values, surface)
    return Description(values, _reason(values, surface, heights))


def _spacings(spacing: float | tuple[float, float]) -> tuple[float, float]:
    """Return the spacings along x and y [um] for one spacing or a pair.

    Raise InputError if one is outside `FINEST` to `COARSEST` or there are not two.
    """
    pair = spacing if isinstance(spacing, tuple) else (spacing, spacing)
    if len(pair) != 2 or not all(FINEST <= length <= COARSEST for length in pair):
        raise InputError(
            f"spacing {np.asarray(spacing).tolist()}: give one or a pair, from {FINEST:g} to"
            f" {COARSEST:g} um"
        )
    return pair


def _surface_moments(surface: ScaledHeights, ratio: float) -> SurfaceMoments:
    """Compute all moments of a surface; `ratio` is (dx / dy)^2 of its spacings dx and dy."""
    nodes = surface.nodes.ravel()
    along_x = _profiles(surface.nodes, axis=0)
    along_y = _profiles(surface.nodes, axis=1)
    # Table 1 has no skewness and kurtosis of all heights: an infinite noise leaves them out.
    heights = _moments(nodes, origin=surface.lowest, noise=math.inf)
    peaks = _peaks(nodes, along_x, along_y, ratio)
    peak_moments = _point_moments(peaks, surface, ratio)
    del peaks  # They may take as much memory as the heights.
    asperities = _asperities(nodes, along_x, along_y, ratio)
    return SurfaceMoments(
        heights=heights,
        peaks=peak_moments,
        asperities=_point_moments(asperities, surface, ratio),
        bandwidth_x=_bandwidth(along_x, heights.variance, surface.noise),
        bandwidth_y=_bandwidth(along_y, heights.variance, surface.noise),
    )


def _point_moments(points: Points, surface: ScaledHeights, ratio: float) -> PointMoments:
    """Compute the moments of points of a surface; `ratio` is (dx / dy)^2 of its spacings."""
    # The second differences along y, and so their rounding, are multiplied by `ratio`.
    curvature_noise = surface.noise * max(1.0, ratio)
    return PointMoments(
        heights=_moments(points.heights, origin=surface.lowest, noise=surface.noise),
        curvatures=_moments(points.curvatures, origin=0.0, noise=curvature_noise),
    )


def _bandwidth(profiles: Profiles, variance: float, noise: float) -> float:
    """Compute Nayak's bandwidth parameter of the profiles along one axis [1].

    `variance` is that of all heights, and `noise` the largest difference that rounding makes. The
    parameter is NaN if the rms first difference is not above the noise, or profiles have two nodes.
    """
    if profiles.slope_square <= noise * noise:
        return math.nan
    over_slopes = variance / profiles.slope_square
    return over_slopes * (profiles.curvature_square / profiles.slope_square)


def _table_1(
    moments: SurfaceMoments, surface: ScaledHeights, curvature_unit: float
) -> dict[str, float]:
    """Return the statistics by name, in the units of Table 1.

    `curvature_unit` is the unit of the curvatures in `moments` [1/um].
    """
    heights = moments.heights
    peaks = moments.peaks
    asperities = moments.asperities
    unit = surface.unit
    nodes = surface.nodes.size
    return {
        "peak_mean": peaks.heights.mean * unit,
        "peak_rms": peaks.heights.rms * unit,
        "peak_kurtosis_pearson": peaks.heights.kurtosis,
        "peak_skewness": peaks.heights.skewness,
        "peak_density": peaks.heights.number / (2 * nodes),
        "peak_curvature_mean": peaks.curvatures.mean * curvature_unit,
        "peak_curvature_kurtosis_excess": peaks.curvatures.kurtosis - 3.0,
        "peak_curvature_skewness": peaks.curvatures.skewness,
        "bandwidth_x": moments.bandwidth_x,
        "bandwidth_y": moments.bandwidth_y,
        "asperity_mean": asperities.heights.mean * unit,
        "asperity_rms": asperities.heights.rms * unit,
        "asperity_kurtosis_excess": asperities.heights.kurtosis - 3.0,
        "asperity_skewness": asperities.heights.skewness,
        "asperity_density": asperities.heights.number / nodes,
        "asperity_curvature_mean": asperities.curvatures.mean * curvature_unit,
        "asperity_curvature_rms": asperities.curvatures.rms * curvature_unit,
        "asperity_curvature_kurtosis_pearson": asperities.curvatures.kurtosis,
        "asperity_curvature_skewness": asperities.curvatures.skewness,
        "height_mean": heights.mean * unit,
        "height_max": (surface.highest - surface.lowest) * unit,
        "height_rms": heights.rms * unit,
    }


def _lost_in_rounding(values: dict[str, float], surface: ScaledHeights) -> Description:
    """Return the description of heights whose offset leaves too few digits for their roughness.

    The three statistics of all heights are taken from `values`; all others are NaN.
    """
    kept = {name: values[name] for name in ("height_mean", "height_max", "height_rms")}
    apart = surface.rounding * surface.unit
    reason = (
        f"heights lost in rounding: rms {values['height_rms']:.3g} um at an offset where numbers"
        f" are {apart:.2g} um apart"
    )
    return Description(dict.fromkeys(NAMES, math.nan) | kept, reason)


def _reason(values: dict[str, float], surface: ScaledHeights, heights: Values) -> str:
    """Return why some values are NaN, "" if no value is NaN.

    `values` are the statistics of the surface, and `heights` [um] its heights before scaling.
    """
    if surface.lowest == surface.highest:
        return "flat surface: no profile peak, no asperity"
    if not any(map(math.isnan, values.values())):
        return ""
    # A few nodes far away from all others may set the rounding of all heights.
    lower_quartile, upper_quartile = np.percentile(surface.nodes, [25.0, 75.0])
    middle_half = upper_quartile - lower_quartile
    if 0.0 < middle_half <= LOST * surface.rounding:
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
        Root of the sum of the mean squared slopes along x and along y [1]; infinite if that is
        beyond the largest number. Pairs of neighbours of which one is missing are left out.

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
    statistics: Mapping[str, Values], spacing: tuple[Values | float, Values | float]
) -> Values:
    """Estimate the rms slopes of surfaces from their statistics, without the surfaces.

    Nayak's bandwidth parameter is m0 m4 / m2^2 of a profile, where m0 is the mean square height.
    The density of peaks gives m4 / m2 = 2 (1 - cos(2 pi density)) / spacing^2 for a sine wave and
    for normally distributed slopes. The two equations give the mean square slope m2. On surfaces of
    the shipped scenes the estimate is within 8 % of `rms_slope` (`tests/gen/test_statistics.py`).

    Parameters
    ----------
    statistics : mapping of str to ndarray, shape (surfaces,)
        The statistics height_rms [um], peak_density, bandwidth_x and bandwidth_y [1].
    spacing : pair of float, or of ndarray, shape (surfaces,)
        Distances between neighbouring nodes along x and y [um].

    Returns
    -------
    ndarray, shape (surfaces,)
        Rms slopes [1]; NaN where a statistic is NaN.

    References
    ----------
    Nayak, P. R., 1971. Random process model of rough surfaces. Journal of Lubrication Technology
    93, 398-407.
    """
    angles = 2.0 * math.pi * statistics["peak_density"]
    change = 2.0 * (1.0 - np.cos(angles))  # m4 / m2 times the squared spacing
    # An even slope has a bandwidth of 0, and files may hold any numbers, of which the square may
    # be infinite: Python's own floats would raise OverflowError.
    with np.errstate(all="ignore"):
        squared_x = np.asarray(spacing[0], dtype=np.float64) ** 2
        squared_y = np.asarray(spacing[1], dtype=np.float64) ** 2
        # m2 / m0 of the profiles along each axis
        along_x = change / (statistics["bandwidth_x"] * squared_x)
        along_y = change / (statistics["bandwidth_y"] * squared_y)
        return np.asarray(statistics["height_rms"] * np.sqrt(along_x + along_y))


def refuse_masked(name: str, array: Any) -> None:
    """Raise InputError if an array has masked entries.

    A masked array of which no entry is masked is accepted.

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
    """Divide heights [um] by a power of two near their range, so that no moment overflows.

    Raise InputError if they are not a grid of finite numbers. A flat surface becomes zeros in a
    unit of 1 um.
    """
    _refuse_all_but_heights(heights)
    lowest = float(heights.min())
    highest = float(heights.max())
    if not math.isfinite(highest - lowest):
        raise InputError(
            "heights with NaN, infinities or an infinite range: give finite heights"
        )
    if lowest == highest:
        return ScaledHeights(
            nodes=np.zeros(heights.shape),
            unit=1.0,
            rounding=0.0,
            lowest=0.0,
            highest=0.0,
        )
    exponent = math.frexp(highest - lowest)[1]
    unit = 2.0 ** min(max(exponent, -1000), 1000)
    nodes = np.multiply(heights, 1.0 / unit, order="C", dtype=np.float64)
    largest = max(abs(lowest), abs(highest)) / unit
    return ScaledHeights(
        nodes=nodes,
        unit=unit,
        rounding=_precision(heights) * largest,
        lowest=float(nodes.min()),
        highest=float(nodes.max()),
    )


def _refuse_all_but_heights(heights: Values) -> None:
    """Raise InputError unless an array is a grid of 2 x 2 real numbers or more without a mask."""
    if heights.ndim != 2 or min(heights.shape) < 2:
        raise InputError(
            f"heights of shape {heights.shape}: give 2-D heights, 2 x 2 nodes or more"
        )
    if heights.dtype.kind not in "buif":
        raise InputError(f"heights of type {heights.dtype}: give real numbers")
    refuse_masked("heights", heights)


def _precision(heights: Values) -> float:
    """Return the relative distance of neighbouring floating-point numbers of the heights' type.

    Integers, and types of more than 8 bytes, count as double precision.
    """
    if heights.dtype.kind == "f" and heights.dtype.itemsize < 8:
        return float(np.finfo(heights.dtype).eps)
    return float(np.finfo(np.float64).eps)


def _profiles(surface: Values, axis: int) -> Profiles:
    """Compute the differences and peaks of all profiles along one axis of scaled heights.

    The heights are of shape (nx, ny).
    """
    nodes = surface.ravel()
    columns = surface.shape[1]
    stride = columns if axis == 0 else 1
    length = surface.shape[axis]
    profiles = surface.size // length
    # The heights keep their offset: if the lowest one were subtracted, heights far above it would
    # be rounded, and neighbours become equal.
    difference = nodes[stride:] - nodes[:-stride]
    if axis == 1:
        # The last node of a row has no neighbour: the next number belongs to the next row.
        difference[columns - 1 :: columns] = 0.0
    to_node = difference[:-stride]
    from_node = difference[stride:]
    curvature = to_node - from_node
    if axis == 1:
        # The last node of a row and the first one of the next row are ends of profiles.
        curvature[columns - 2 :: columns] = 0.0
        curvature[columns - 1 :: columns] = 0.0
    slopes = profiles * (length - 1)
    curvatures = profiles * (length - 2)
    curvature_square = math.nan
    if length > 2:
        curvature_square = _sum_of_squares(curvature) / curvatures
    return Profiles(
        stride=stride,
        curvature=curvature,
        peaks=(to_node > 0.0) & (from_node < 0.0),
        slope_square=_sum_of_squares(difference) / slopes,
        curvature_square=curvature_square,
    )


def _sum_of_squares(values: Values) -> float:
    """Return the sum of the squares of values, shape (count,).

    Its last bits do not depend on the number of threads.
    """
    return float(np.einsum(DOT, values, values))


def _peaks(nodes: Values, along_x: Profiles, along_y: Profiles, ratio: float) -> Points:
    """Return the peaks of all profiles of scaled heights, along x and then along y.

    `nodes`, shape (nx ny,), are the heights, and `ratio` is (dx / dy)^2 of the spacings. A node
    that is a peak along both axes is returned twice.
    """
    on_x = np.flatnonzero(along_x.peaks)
    on_y = np.flatnonzero(along_y.peaks)
    heights = (nodes[on_x + along_x.stride], nodes[on_y + along_y.stride])
    curvatures = (along_x.curvature[on_x], along_y.curvature[on_y] * ratio)
    return Points(np.concatenate(heights), np.concatenate(curvatures))


def _asperities(
    nodes: Values, along_x: Profiles, along_y: Profiles, ratio: float
) -> Points:
    """Return the asperities of scaled heights: the nodes that are peaks along both axes.

    `nodes`, shape (nx ny,), are the heights, and `ratio` is (dx / dy)^2 of the spacings.
    """
    # Entry i of `along_x` and entry i + shift of `along_y` belong to the same node.
    shift = along_x.stride - along_y.stride
    is_peak_along_y = along_y.peaks[shift : shift + along_x.peaks.size]
    entries = np.flatnonzero(along_x.peaks & is_peak_along_y)
    curvatures = along_x.curvature[entries] + along_y.curvature[entries + shift] * ratio
    return Points(nodes[entries + along_x.stride], 0.5 * curvatures)


def _moments(values: Values, origin: float, noise: float) -> Moments:
    """Compute the moments of values, shape (count,), with the mean counted from an origin.

    Skewness and kurtosis are NaN if the rms is not above the noise. If there are no values, the
    number is 0 and all moments are NaN.
    """
    number = values.size
    if number == 0:
        return Moments(
            number=0,
            mean=math.nan,
            variance=math.nan,
            rms=math.nan,
            skewness=math.nan,
            kurtosis=math.nan,
        )
    mean = float(values.sum()) / number
    deviations = values - mean
    variance = _sum_of_squares(deviations) / number
    # The rounding of a mean that is large beside the deviations is corrected.
    correction = 0.0
    if math.sqrt(variance) < NEARLY_EQUAL * abs(mean):
        correction = float(deviations.sum()) / number
        deviations -= correction
        variance = _sum_of_squares(deviations) / number
    mean = (mean - origin) + correction
    rms = math.sqrt(variance)
    skewness = math.nan
    kurtosis = math.nan
    if rms > noise:
        squares = deviations * deviations
        third = float(np.einsum(DOT, squares, deviations)) / number
        fourth = _sum_of_squares(squares) / number
        skewness = third / (variance * rms)
        kurtosis = fourth / (variance * variance)
    return Moments(
        number=number,
        mean=mean,
        variance=variance,
        rms=rms,
        skewness=skewness,
        kurtosis=kurtosis,
    )
