"""The 22 statistics of a surface in whole numbers and fractions, which are exact to the last step.

Nothing here is shared with `gen`: the definitions are written again, in plain slices. Only
results are rounded to floats.
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
"""Range of whole heights below which machine words hold them, and their curvatures too."""

DIGITS = 60
"""Decimal digits of square roots that are no fractions."""

Whole = NDArray[Any]
"""Whole numbers, as machine words or as Python's integers of any length."""


@dataclass(frozen=True)
class Moments:
    """Moments of numbers; all are NaN for no numbers."""

    mean: float  # in the unit of the numbers
    rms: float  # standard deviation, in the unit of the numbers
    kurtosis: float  # 3 for a normal distribution [1]; NaN if all numbers are equal
    skewness: float  # [1]; NaN if all numbers are equal

    @property
    def excess(self) -> float:
        """Kurtosis less that of a normal distribution [1]."""
        return self.kurtosis - 3


class _Profiles:
    """The profiles along an axis, at the nodes that have both neighbours on it.

    `inner` holds the heights of these nodes, `before` and `after` the heights of their neighbours.
    All three arrays have one shape.
    """

    def __init__(self, before: Whole, inner: Whole, after: Whole) -> None:
        # Second differences with the opposite sign, positive on peaks.
        self.curvatures = 2 * inner - before - after
        self.is_peak = (inner > before) & (inner > after)
        self.peaks = inner[self.is_peak]  # heights of the peaks, (number of peaks,)


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
    ratio = dx2 / dy2
    along_x = _Profiles(z[:-2], z[1:-1], z[2:])
    along_y = _Profiles(z[:, :-2], z[:, 1:-1], z[:, 2:])
    peaks = np.concatenate((along_x.peaks, along_y.peaks))
    # Asperities are peaks along both axes.
    summits = along_x.is_peak[:, 1:-1] & along_y.is_peak[1:-1]
    # Curvatures in whole numbers of unit / (dx2 denominator); the unit of sums of two is half.
    curvatures_x = _times(along_x.curvatures, ratio.denominator)
    curvatures_y = _times(along_y.curvatures, ratio.numerator)
    per_length = unit / dx2 / ratio.denominator
    on_peaks = np.concatenate(
        (curvatures_x[along_x.is_peak], curvatures_y[along_y.is_peak])
    )
    summits_x = curvatures_x[:, 1:-1][summits]
    summits_y = curvatures_y[1:-1][summits]

    height = moments(z.ravel(), unit)
    peak = moments(peaks, unit)
    peak_curvature = moments(on_peaks, per_length)
    inner = z[1:-1, 1:-1]
    asperity = moments(inner[summits], unit)
    curvature = moments(summits_x + summits_y, per_length / 2)
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
    """Convert heights to whole numbers of a unit, with all of their bits.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Finite heights [um].

    Returns
    -------
    ndarray, shape (nx, ny)
        Heights above the lowest one, in units.
    Fraction
        The unit [um].
    """
    ratios = [float(height).as_integer_ratio() for height in np.unique(heights)]
    unit = max(denominator for _, denominator in ratios)
    # The unit is a multiple of all denominators, as all are powers of two.
    numerator, denominator = ratios[0]
    lowest = numerator * (unit // denominator)
    numerator, denominator = ratios[-1]
    highest = numerator * (unit // denominator)
    fits = unit < 2**40 and abs(lowest) < 2**53
    if fits and highest - lowest < SMALL_ENOUGH:
        numbers = (heights * unit).astype(np.int64)
        return numbers - lowest, Fraction(1, unit)
    steps = np.vectorize(
        lambda height: int(Fraction(height) * unit) - lowest, otypes=[object]
    )
    return steps(heights), Fraction(1, unit)


def moments(values: Whole, unit: Fraction) -> Moments:
    """Compute mean, standard deviation, kurtosis and skewness, each rounded once.

    Parameters
    ----------
    values : ndarray
        Numbers in units, of any shape.
    unit : Fraction
        The unit.

    Returns
    -------
    Moments
        Mean and standard deviation in the unit's own unit, kurtosis and skewness [1].
    """
    number = values.size
    if not number:
        return Moments(nan, nan, nan, nan)
    counts = _counts(values)
    total = _total(counts)

    def central(power: int) -> Fraction:
        """Return the central moment of a power, in units to that power."""
        # Deviations from the mean, times the number of values: whole numbers.
        deviations = ((number * value - total, count) for value, count in counts)
        powers = (count * deviation**power for deviation, count in deviations)
        return Fraction(sum(powers), number ** (power + 1))

    variance = central(2)
    rms = root(variance)
    kurtosis = nan
    skewness = nan
    if variance:
        kurtosis = float(central(4) / variance**2)
        skewness = float(central(3) / (variance * rms))
    mean = float(Fraction(total, number) * unit)
    return Moments(mean, float(rms * unit), kurtosis, skewness)


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
    """Return Nayak's bandwidth m0 m4 / m2^2 along an axis [1]; NaN without curvatures or slopes.

    `z` are heights, `slopes` and `curvatures` their first and second differences along the axis.
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


def _total(counts: Iterable[tuple[int, int]]) -> int:
    """Return the sum of numbers, given as pairs of a number and its count."""
    return sum(value * count for value, count in counts)


def _counts(values: Whole) -> list[tuple[int, int]]:
    """Return pairs of each distinct number, in rising order, and its count."""
    distinct, counts = np.unique(values, return_counts=True)
    return list(zip(distinct.tolist(), counts.tolist(), strict=True))
