"""The 22 statistics of a surface again, in whole numbers and fractions: exact to the last step.

Nothing here is shared with `gen`: the definitions stand a second time, in plain slices, and a float
appears only when a result is handed over.
"""

from decimal import Decimal, localcontext
from fractions import Fraction
from math import nan
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.references.half_space import Field
from gen.statistics import NAMES

SMALL_ENOUGH = (
    2**20
)  # whole heights up to here are kept in machine words: their curvatures fit too
DIGITS = 60  # of powers of two and roots that are no fractions


def statistics(heights: Field, spacing: tuple[float, float]) -> dict[str, float]:
    """Compute the 22 statistics by the names of Table 1, rounded once [um, um-1 or 1].

    Heights (n_x, n_y) are finite [um]; the spacing is that of the nodes along x and y [um].
    """
    z, unit = integers(heights)
    squares = [Fraction(each) ** 2 for each in spacing]
    ratio = squares[0] / squares[1]
    along_x = 2 * z[1:-1] - z[:-2] - z[2:]
    along_y = 2 * z[:, 1:-1] - z[:, :-2] - z[:, 2:]
    on_x = (z[1:-1] > z[:-2]) & (z[1:-1] > z[2:])
    on_y = (z[:, 1:-1] > z[:, :-2]) & (z[:, 1:-1] > z[:, 2:])
    summits = on_x[:, 1:-1] & on_y[1:-1]
    # Curvatures over unit / (spacing_x^2 denominator), twice that at summits: whole numbers.
    over, under = ratio.numerator, ratio.denominator
    pooled = np.concatenate((_times(along_x[on_x], under), _times(along_y[on_y], over)))
    both = _times(along_x[:, 1:-1][summits], under) + _times(along_y[1:-1][summits], over)
    per_length = unit / squares[0] / under
    peaks = np.concatenate((z[1:-1][on_x], z[:, 1:-1][on_y]))
    peak_curvature = moments(pooled, per_length)
    asperity = moments(z[1:-1, 1:-1][summits], unit)
    height = moments(z.ravel(), unit)
    values = (
        *moments(peaks, unit),
        peaks.size / (2 * z.size),
        *(peak_curvature[0], peak_curvature[2] - 3, peak_curvature[3]),
        _bandwidth(z, np.diff(z, axis=0), along_x),
        _bandwidth(z, np.diff(z, axis=1), along_y),
        *(asperity[0], asperity[1], asperity[2] - 3, asperity[3]),
        both.size / z.size,
        *moments(both, per_length / 2),
        *(height[0], float(int(z.max()) * unit), height[1]),
    )
    return dict(zip(NAMES, values, strict=True))


def integers(heights: Field) -> tuple[NDArray[Any], Fraction]:
    """Return heights above the lowest as whole numbers of a unit, all of their bits [um]."""
    pairs = [float(height).as_integer_ratio() for height in np.unique(heights)]
    unit = max(denominator for _, denominator in pairs)
    lowest, highest = (top * (unit // bottom) for top, bottom in (pairs[0], pairs[-1]))
    if highest - lowest < SMALL_ENOUGH and unit < 2**40 and abs(lowest) < 2**53:
        return (heights * unit).astype(np.int64) - lowest, Fraction(1, unit)
    steps = np.vectorize(
        lambda height: int(Fraction(height) * unit) - lowest, otypes=[object]
    )
    return steps(heights), Fraction(1, unit)


def moments(values: NDArray[Any], unit: Fraction) -> tuple[float, float, float, float]:
    """Return mean and rms value of whole numbers of a unit, kurtosis and skewness [1].

    All are nan for no numbers, and the last two where all numbers are equal.
    """
    if not values.size:
        return nan, nan, nan, nan
    counts, number = _counts(values), values.size
    total = sum(value * count for value, count in counts)
    second, third, fourth = (
        Fraction(
            sum(count * (number * value - total) ** power for value, count in counts),
            number ** (power + 1),
        )
        for power in (2, 3, 4)
    )
    rms = root(second)
    shapes = (
        (float(fourth / second**2), float(third / (second * rms)))
        if second
        else (nan, nan)
    )
    return float(Fraction(total, number) * unit), float(rms * unit), *shapes


def root(square: Fraction) -> Fraction:
    """Return a square root to 60 digits."""
    with localcontext() as context:
        context.prec = DIGITS
        return Fraction((Decimal(square.numerator) / Decimal(square.denominator)).sqrt())


def _times(values: NDArray[Any], factor: int) -> NDArray[Any]:
    """Whole numbers times another, which may be longer than a machine word."""
    return values if factor == 1 else values.astype(object) * factor


def _bandwidth(z: NDArray[Any], slopes: NDArray[Any], curvatures: NDArray[Any]) -> float:
    """Nayak's m0 m4 / m2^2 along one axis."""
    if not curvatures.size or not (m2 := _mean_square(slopes)):
        return nan
    mean = Fraction(sum(value * count for value, count in _counts(z)), z.size)
    return float((_mean_square(z) - mean**2) * _mean_square(curvatures) / m2**2)


def _mean_square(values: NDArray[Any]) -> Fraction:
    return Fraction(
        sum(value * value * count for value, count in _counts(values)), values.size
    )


def _counts(values: NDArray[Any]) -> list[tuple[int, int]]:
    """Each value, and how often it is there."""
    distinct, counts = np.unique(values, return_counts=True)
    return list(zip(distinct.tolist(), counts.tolist(), strict=True))
