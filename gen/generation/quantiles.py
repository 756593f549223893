"""Quantiles of the distributions in a scene: numbers in [0, 1) become values.

All operations are rounded alike on every processor, so that a plan is the same everywhere.
"""

import functools
import math

import numpy as np

from gen.arrays import Values
from gen.scene.distribution import Choice, Distribution, LogUniform, Normal

DIGITS = 53
"""Binary digits of a random number in [0, 1)."""

KNOTS = 2**16
"""Intervals of equal probability inside which a normal distribution's quantiles are linear."""

SIGNIFICANT = 9
"""Decimal digits of the quantiles at the ends of these intervals, on which processors agree."""


def quantiles(distribution: Distribution, uniform: Values) -> Values:
    """Map numbers in [0, 1) to the values of a distribution.

    Parameters
    ----------
    distribution : Distribution
        A number, a pair, which is uniform, or a table, as a scene has it.
    uniform : ndarray
        Numbers in [0, 1).

    Returns
    -------
    ndarray, shape of `uniform`
        Values that are within the distribution's limits.
    """
    match distribution:
        case LogUniform():
            return log_within(*distribution.log_uniform, uniform)
        case Normal():
            return _normal(distribution.normal, distribution.ends, uniform)
        case Choice():
            return _chosen(distribution, uniform)
        case (low, high):
            return within(low, high, uniform)
    return np.full(uniform.shape, distribution)


def within(low: Values | float, high: Values | float, uniform: Values) -> Values:
    """Map numbers in [0, 1) linearly to [low, high].

    Rounding cannot exceed the upper end: the largest number, 1 - 2^-53, takes off as much as the
    rounding of high - low can add.
    """
    return low + (high - low) * uniform


def log_within(low: float, high: float, uniform: Values) -> Values:
    """Map numbers in [0, 1) logarithmically to [low, high].

    Each binary digit of a number multiplies by a root of high / low. Roots and products are rounded
    alike on every processor, which logarithms and exponentials are not: a plan must not differ.
    """
    values = np.full(uniform.shape, low)
    factor = math.sqrt(high) / math.sqrt(low)
    rest = uniform.copy()
    for _ in range(DIGITS):
        rest *= 2.0
        digit = rest >= 1.0
        values[digit] *= factor
        rest -= digit
        factor = math.sqrt(factor)
    np.minimum(values, high, out=values)
    return values


def _normal(normal: tuple[float, float], ends: tuple[float, float], uniform: Values) -> Values:
    """Map numbers in [0, 1) to a truncated normal distribution, linear between its knots."""
    knots = _normal_knots(*normal, *ends)
    places = uniform * KNOTS
    left = places.astype(np.intp)
    steps = knots[left + 1] - knots[left]
    steps *= places - left
    return np.clip(knots[left] + steps, *ends)


@functools.lru_cache(maxsize=16)
def _normal_knots(mean: float, deviation: float, low: float, high: float) -> Values:
    """Compute quantiles of a truncated normal distribution at equal steps of probability.

    The normal distribution and its inverse are not rounded alike on all processors: the quantiles
    are rounded to `SIGNIFICANT` digits, beyond which they may differ.
    """
    from scipy.special import ndtr, ndtri

    # In the lower tail probabilities keep their digits: a range above the mean is turned over.
    below, above = (low - mean) / deviation, (high - mean) / deviation
    turned = below > 0
    first, last = (-above, -below) if turned else (below, above)
    shares = np.linspace(ndtr(first), ndtr(last), KNOTS + 1)
    reduced = ndtri(shares)
    reduced[0], reduced[-1] = first, last
    if turned:
        reduced = -reduced[::-1]
    rounded = np.array([float(f"{value:.{SIGNIFICANT}g}") for value in reduced.tolist()])
    return np.clip(mean + deviation * rounded, low, high)


def _chosen(distribution: Choice, uniform: Values) -> Values:
    """Map numbers in [0, 1) to the numbers of a choice."""
    values = np.array(distribution.choice)
    shares = distribution.shares or (1.0 / len(values),) * len(values)
    # The last number takes the rest: rounded shares cannot leave a gap below 1.
    return np.asarray(values[np.searchsorted(np.cumsum(shares)[:-1], uniform, side="right")])
