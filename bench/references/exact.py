"""The 22 statistics of a surface, computed in whole numbers and fractions.

Only square roots and results are rounded. No code is shared with `gen`: the definitions are written
again, in plain slices.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from decimal import Decimal, localcontext
from fractions import Fraction
from math import nan
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.references.half_space import Field

SMALL_ENOUGH = 2**20
"""Range of the heights, in units of `integers`, below which they are kept in machine words.

Curvatures then fit into machine words, too.
"""

DIGITS = 60
"""Number of decimal digits of square roots."""

Whole = NDArray[Any]
"""Whole numbers, as machine words or as Python's integers of any length."""


@dataclass(frozen=True)
class Moments:
    """Moments of numbers; all of them are NaN if there are no numbers."""

    mean: float  # in the unit of the numbers
    rms: float  # standard deviation, in the unit of the numbers
    kurtosis: float  # 3 for a normal distribution [1]; NaN if all numbers are equal
    skewness: float  # [1]; NaN if all numbers are equal

    @property
    def excess(self) -> float:
        """Kurtosis less that of a normal distribution [1]."""
        return self.kurtosis - 3


class _Profiles:
    """The profiles along an axis, at the nodes that have both neighbours along this axis.

    `inner` holds the heights of these nodes, `before` and `after` the heights of their neighbours.
    All three arrays have one shape.

    Attributes
    ----------
    curvatures : ndarray
        Second differences of the heights with the opposite sign, positive on peaks.
    is_peak : ndarray of bool
        Whether a node is higher than both neighbours.
    peaks : ndarray, shape (number of peaks,)
        Heights of the peaks.
    """

    def __init__(self, before: Whole, inner: Whole, after: Whole) -> None:
        self.curvatures = 2 * inner - before - after
        self.is_peak = (inner > before) & (inner > after)
        self.peaks = inner[self.is_peak]


def statistics(heights: Field, spacing: tuple[float, float]) -> dict[str, float]:
    """Compute the 22 statistics of Table 1, each rounded once.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Finite heights [um].
    spacing : (float, float)
        Spacing of the nodes along x and y [um].

    Returns
    -------
    dict
        Statistics by their names, in the order of `gen.statistics.NAMES` [um, um-1 or 1].
    """
    z, unit = integers(heights)
    dx2 = Fraction(spacing[0]) ** 2
    dy2 = Fraction(spacing[1]) ** 2
    squared_ratio = dx2 / dy2
    along_x = _Profiles(z[:-2], z[1:-1], z[2:])
    along_y = _Profiles(z[:, :-2], z[:, 1:-1], z[:, 2:])
    peaks = np.concatenate((along_x.peaks, along_y.peaks))
    # Asperities are peaks along both axes; border nodes are peaks along one axis at most.
    summits = along_x.is_peak[:, 1:-1] & along_y.is_peak[1:-1]
    # Curvatures along both axes in whole numbers of one unit [um-1].
    curvature_unit = unit / dx2 / squared_ratio.denominator
    curvatures_x = _times(along_x.curvatures, squared_ratio.denominator)
    curvatures_y = _times(along_y.curvatures, squared_ratio.numerator)
    on_peaks = np.concatenate(
        (curvatures_x[along_x.is_peak], curvatures_y[along_y.is_peak])
    )
    summits_x = curvatures_x[:, 1:-1][summits]
    summits_y = curvatures_y[1:-1][summits]

    height = moments(z.ravel(), unit)
    peak = moments(peaks, unit)
    peak_curvature = moments(on_peaks, curvature_unit)
    inner = z[1:-1, 1:-1]
    asperity = moments(inner[summits], unit)
    # The curvature of an asperity is the mean along both axes: the sum, in half units.
    curvature = moments(summits_x + summits_y, curvature_unit / 2)
    return {
        "peak_mean": peak.mean,
        "peak_rms": peak.rms,
        "peak_kurtosis_pearson": peak.kurtosis,
        "peak_skewness": peak.skewness,
        "peak_density": peaks.size / (2 * z.size),
        "peak_curvature_mean": peak_curvature.mean,
        "peak_curvature_kurtosis_excess": peak_curvature.excess,
        "peak_curvature_skewness": peak_curvature.skewness,
        "bandwidth_x": _bandwidth(z, np.diff(z, axis=0), along_x.curvatures),
        "bandwidth_y": _bandwidth(z, np.diff(z, axis=1), along_y.curvatures),
        "asperity_mean": asperity.mean,
        "asperity_rms": asperity.rms,
        "asperity_kurtosis_excess": asperity.excess,
        "asperity_skewness": asperity.skewness,
        "asperity_density": summits_x.size / z.size,
        "asperity_curvature_mean": curvature.mean,
        "asperity_curvature_rms": curvature.rms,
        "asperity_curvature_kurtosis_pearson": curvature.kurtosis,
        "asperity_curvature_skewness": curvature.skewness,
        "height_mean": height.mean,
        "height_max": float(int(z.max()) * unit),
        "height_rms": height.rms,
    }


def integers(heights: Field) -> tuple[Whole, Fraction]:
    """Convert heights to whole numbers of a unit, without rounding.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Finite heights [um].

    Returns
    -------
    ndarray, shape (nx, ny)
        Heights above the lowest one, in units; machine words or Python's integers.
    Fraction
        The unit [um].
    """
    ratios = [float(height).as_integer_ratio() for height in np.unique(heights)]
    # All denominators are powers of two. The largest one, the number of units in a um, is therefore
    # a multiple of all of them.
    per_um = max(denominator for _, denominator in ratios)
    numerator, denominator = ratios[0]
    lowest = numerator * (per_um // denominator)
    numerator, denominator = ratios[-1]
    highest = numerator * (per_um // denominator)
    unit = Fraction(1, per_um)
    # In this case floats hold the products `heights * per_um` exactly.
    is_exact_in_floats = per_um < 2**40 and abs(lowest) < 2**53
    if is_exact_in_floats and highest - lowest < SMALL_ENOUGH:
        numbers = (heights * per_um).astype(np.int64)
        return numbers - lowest, unit
    above_lowest = np.vectorize(
        lambda height: int(Fraction(height) * per_um) - lowest, otypes=[object]
    )
    return above_lowest(heights), unit


def moments(values: Whole, unit: Fraction) -> Moments:
    """Compute mean, standard deviation, kurtosis and skewness, each rounded once.

    Parameters
    ----------
    values : ndarray
        Whole numbers, of any shape.
    unit : Fraction
        Factor that makes lengths or curvatures of these numbers [um or um-1].

    Returns
    -------
    Moments
        Mean and standard deviation in um or um-1; kurtosis and skewness [1]. All are NaN if there
        are no numbers.
    """
    number = values.size
    if not number:
        return Moments(nan, nan, nan, nan)
    counts = _counts(values)
    total = _total(counts)

    def central(power: int) -> Fraction:
        """Return the mean of the deviations from the mean to a power, in units to that power."""
        # Deviations from the mean, times the number of values, are whole numbers.
        deviations = ((number * value - total, count) for value, count in counts)
        powers = (count * deviation**power for deviation, count in deviations)
        return Fraction(sum(powers), number ** (power + 1))

    variance = central(2)
    rms = root(variance)
    kurtosis = nan
    skewness = nan
    if variance:  # equal numbers have neither
        kurtosis = float(central(4) / variance**2)
        skewness = float(central(3) / (variance * rms))
    mean = float(Fraction(total, number) * unit)
    return Moments(mean=mean, rms=float(rms * unit), kurtosis=kurtosis, skewness=skewness)


def root(square: Fraction) -> Fraction:
    """Compute a square root.

    Parameters
    ----------
    square : Fraction
        A number that is not negative.

    Returns
    -------
    Fraction
        Its root to `DIGITS` decimal digits.
    """
    with localcontext() as context:
        context.prec = DIGITS
        return Fraction((Decimal(square.numerator) / Decimal(square.denominator)).sqrt())


def _times(values: Whole, factor: int) -> Whole:
    """Return whole numbers times a factor, which may be longer than a machine word."""
    if factor == 1:
        return values
    return values.astype(object) * factor


def _bandwidth(z: Whole, slopes: Whole, curvatures: Whole) -> float:
    """Return Nayak's bandwidth m0 m4 / m2^2 along an axis [1].

    `z` are heights, `slopes` and `curvatures` their first and second differences along the axis,
    not divided by the spacing, which cancels. The result is NaN if there are no curvatures, or if
    all slopes are 0.
    """
    if not curvatures.size:
        return nan
    m2 = _mean_square(slopes)
    if not m2:
        return nan
    mean = Fraction(_total(_counts(z)), z.size)
    m0 = _mean_square(z) - mean**2
    return float(m0 * _mean_square(curvatures) / m2**2)


def _mean_square(values: Whole) -> Fraction:
    """Return the mean of the squares of whole numbers."""
    squares = ((value * value, count) for value, count in _counts(values))
    return Fraction(_total(squares), values.size)


Counted = tuple[int, int]
"""A number, and how often it occurs."""


def _total(counts: Iterable[Counted]) -> int:
    """Return the sum of numbers, each multiplied by how often it occurs."""
    return sum(value * count for value, count in counts)


def _counts(values: Whole) -> list[Counted]:
    """Return each distinct number, in rising order, with how often it occurs."""
    distinct, counts = np.unique(values, return_counts=True)
    return list(zip(distinct.tolist(), counts.tolist(), strict=True))
