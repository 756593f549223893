"""Surfaces and their 22 statistics again, in whole numbers and fractions: exact to the last step.

Nothing here is shared with `gen`: the definitions stand a second time, node by node or in plain
slices, and a float appears only when a result is handed over.
"""

from decimal import Decimal, localcontext
from fractions import Fraction
from math import isqrt, nan
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gen.statistics import NAMES

Field = NDArray[np.float64]

SMALL_ENOUGH = 2**20
"""Whole heights up to here are kept in machine words: their curvatures fit too."""

DIGITS = 60
"""Of powers of two that are no fractions."""


DIAGONAL = ((1, 1), (1, -1), (-1, 1), (-1, -1))
STRAIGHT = ((1, 0), (-1, 0), (0, 1), (0, -1))


class Moments(NamedTuple):
    """Of a sample, as `gen.statistics` names them; nan where it does not define them."""

    mean: Fraction | float
    rms: Fraction | float
    skewness: float
    kurtosis: float


def statistics(heights: Field, spacing: tuple[float, float]) -> dict[str, float]:
    """The 22 statistics of heights as they are given.

    Parameters
    ----------
    heights : (n_x, n_y) finite heights [um]
    spacing : along x and y [um]

    Returns
    -------
    By the names of Table 1, rounded once [um, um-1 or 1]
    """
    z, unit = whole(heights)
    squares = [Fraction(each) ** 2 for each in spacing]
    ratio = squares[0] / squares[1]
    along_x = 2 * z[1:-1] - z[:-2] - z[2:]
    along_y = 2 * z[:, 1:-1] - z[:, :-2] - z[:, 2:]
    on_x = (z[1:-1] > z[:-2]) & (z[1:-1] > z[2:])
    on_y = (z[:, 1:-1] > z[:, :-2]) & (z[:, 1:-1] > z[:, 2:])
    summits = on_x[:, 1:-1] & on_y[1:-1]
    # Curvatures over unit / (spacing_x^2 denominator), twice that at summits: whole numbers.
    over, under = ratio.numerator, ratio.denominator
    pooled = _joined(_times(along_x[on_x], under), _times(along_y[on_y], over))
    both = _times(along_x[:, 1:-1][summits], under) + _times(along_y[1:-1][summits], over)
    per_length = unit / squares[0] / under
    peak = moments(_joined(z[1:-1][on_x], z[:, 1:-1][on_y]))
    peak_curvature, asperity = moments(pooled), moments(z[1:-1, 1:-1][summits])
    curvature, height = moments(both), moments(z.ravel())
    peaks = int(on_x.sum()) + int(on_y.sum())
    values = (
        _times_unit(peak.mean, unit),
        _times_unit(peak.rms, unit),
        peak.kurtosis,
        peak.skewness,
        peaks / (2 * z.size),
        _times_unit(peak_curvature.mean, per_length),
        peak_curvature.kurtosis - 3,
        peak_curvature.skewness,
        _bandwidth(z, np.diff(z, axis=0), along_x),
        _bandwidth(z, np.diff(z, axis=1), along_y),
        _times_unit(asperity.mean, unit),
        _times_unit(asperity.rms, unit),
        asperity.kurtosis - 3,
        asperity.skewness,
        int(summits.sum()) / z.size,
        _times_unit(curvature.mean, per_length / 2),
        _times_unit(curvature.rms, per_length / 2),
        curvature.kurtosis,
        curvature.skewness,
        _times_unit(height.mean, unit),
        float(int(z.max()) * unit),
        _times_unit(height.rms, unit),
    )
    return dict(zip(NAMES, values, strict=True))


def whole(heights: Field) -> tuple[NDArray[Any], Fraction]:
    """Heights above the lowest as whole numbers of a unit, all of their bits [um]."""
    pairs = [float(height).as_integer_ratio() for height in np.unique(heights)]
    unit = max(denominator for _, denominator in pairs)
    lowest, highest = (top * (unit // bottom) for top, bottom in (pairs[0], pairs[-1]))
    if highest - lowest < SMALL_ENOUGH and unit < 2**40 and abs(lowest) < 2**53:
        return (heights * unit).astype(np.int64) - lowest, Fraction(1, unit)
    grid = np.empty(heights.size, dtype=object)
    for place, height in enumerate(heights.ravel().tolist()):
        top, bottom = height.as_integer_ratio()
        grid[place] = top * (unit // bottom) - lowest
    return grid.reshape(heights.shape), Fraction(1, unit)


def moments(values: NDArray[Any]) -> Moments:
    """Moments of whole numbers (count,); shapes are nan where all are equal."""
    if not values.size:
        return Moments(nan, nan, nan, nan)
    counts, number = _counts(values), values.size
    total = sum(value * count for value, count in counts)
    second, third, fourth = (
        Fraction(
            sum(count * (number * value - total) ** power for value, count in counts),
            number ** (power + 1),
        )
        for power in (2, 3, 4)
    )
    mean, rms = Fraction(total, number), root(second)
    if not second:
        return Moments(mean, rms, nan, nan)
    return Moments(mean, rms, float(third / (second * rms)), float(fourth / second**2))


def root(square: Fraction) -> Fraction:
    """Square root to 60 digits or more."""
    shift = 4 * DIGITS + square.denominator.bit_length()
    return Fraction(isqrt((square.numerator << (2 * shift)) // square.denominator), 1 << shift)


def _times(values: NDArray[Any], factor: int) -> NDArray[Any]:
    """Whole numbers times another, which may be longer than a machine word."""
    return values if factor == 1 else values.astype(object) * factor


def _joined(first: NDArray[Any], second: NDArray[Any]) -> NDArray[Any]:
    return np.concatenate((first.ravel(), second.ravel()))


def _times_unit(value: Fraction | float, unit: Fraction) -> float:
    return float(value * unit) if isinstance(value, Fraction) else nan


def _bandwidth(z: NDArray[Any], slopes: NDArray[Any], curvatures: NDArray[Any]) -> float:
    """Nayak's m0 m4 / m2^2 along one axis."""
    squares = [_sum_of_squares(each) for each in (slopes, curvatures)]
    if not squares[0] or not curvatures.size:
        return nan
    m2, m4 = Fraction(squares[0], slopes.size), Fraction(squares[1], curvatures.size)
    total, number = sum(value * count for value, count in _counts(z)), z.size
    m0 = Fraction(_sum_of_squares(z), number) - Fraction(total, number) ** 2
    return float(m0 * m4 / m2**2)


def _sum_of_squares(values: NDArray[Any]) -> int:
    return sum(value * value * count for value, count in _counts(values))


def _counts(values: NDArray[Any]) -> list[tuple[int, int]]:
    """Each value, and how often it is there."""
    distinct, counts = np.unique(values, return_counts=True)
    return list(zip(distinct.tolist(), counts.tolist(), strict=True))


def surface(
    generator: str, nodes: int, hurst: float, sigma0: float, random: np.random.Generator
) -> list[list[Fraction]]:
    """A random surface above its lowest node, node by node; parameters as for `gen.surface`."""
    grid: dict[tuple[int, int], Fraction] = {}
    last = nodes - 1
    for corner in ((0, 0), (0, last), (last, 0), (last, last)):
        grid[corner] = Fraction(0)
    step, level = last, 0
    both = generator == "diamond-square"
    while step > 1:
        half = step // 2
        odd, even = range(half, last, step), range(0, nodes, step)
        squares = [(i, j) for i in odd for j in odd]
        edges = [(i, j) for i in odd for j in even], [(i, j) for i in even for j in odd]
        amplitudes = _amplitudes(sigma0, hurst, level, both=both)
        _displace(grid, squares, half, amplitudes[0], random, diagonal=True)
        centres = set() if both else set(squares)
        corners = {at: height for at, height in grid.items() if at not in centres}
        for each in edges:
            new = dict(corners)
            _displace(new, each, half, amplitudes[1], random, diagonal=False)
            grid.update((at, new[at]) for at in each)
        step, level = half, level + 1
    lowest = min(grid.values())
    return [[grid[i, j] - lowest for j in range(nodes)] for i in range(nodes)]


def _amplitudes(
    sigma0: float, hurst: float, level: int, *, both: bool
) -> tuple[Fraction, Fraction]:
    """Of centres and of edges of a level; both steps decay with diamond-square."""
    with localcontext() as context:
        context.prec = DIGITS
        powers = [
            Fraction(Decimal(2) ** (-Decimal(hurst) * (level + later)))
            for later in ((Decimal(0), Decimal("0.5")) if both else (Decimal(0), Decimal(0)))
        ]
    return Fraction(sigma0) * powers[0], Fraction(sigma0) * powers[1]


def _displace(
    grid: dict[tuple[int, int], Fraction],
    nodes: list[tuple[int, int]],
    half: int,
    amplitude: Fraction,
    random: np.random.Generator,
    *,
    diagonal: bool,
) -> None:
    """Put new nodes at the mean of those around them that are there, plus a normal number."""
    around = DIAGONAL if diagonal else STRAIGHT
    draws = random.standard_normal(len(nodes)).tolist()
    old = dict(grid)
    for (i, j), draw in zip(nodes, draws, strict=True):
        found = [old[at] for di, dj in around if (at := (i + di * half, j + dj * half)) in old]
        grid[i, j] = sum(found, Fraction(0)) / len(found) + amplitude * Fraction(draw)
