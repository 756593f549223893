"""The band of a law of several surfaces: where a further surface of the same kind lies.

The band at a load is a prediction interval, not an interval of the mean: with a chance that is its
level, one further surface lies between its ends, at this load by itself. All loads together are
left by more surfaces. K surfaces and the further one are taken for drawn alike, and independently.

- From K surfaces on with (K - 1) / (K + 1) at the level or above, no distribution is assumed. A
  further surface is as likely to have any rank among all K + 1, so that it lies below the j-th
  smallest of the K with a chance of j / (K + 1). The ends are the order statistics at the ranks
  p (K + 1), interpolated between whole ranks. For 90 % that takes 19 surfaces.
- Fewer surfaces have no such ranks. There the logarithms of a quantity are taken for normal, and
  of areas in percent the logits, and the ends are those of Student's prediction interval, the mean
  -+ t s sqrt(1 + 1 / K) with K - 1 degrees of freedom. `assumption` says so in words.

Sources: S. B. Vardeman (1992), "What about the other intervals?", The American Statistician 46,
193; G. J. Hahn, W. Q. Meeker (1991), Statistical Intervals, Wiley, chapters 4 (normal) and 5
(distribution-free). `bench bands` counts further surfaces inside.
"""

import math
from typing import NamedTuple

import numpy as np
from scipy.special import expit, logit, stdtrit

from gen.arrays import Values

ROUNDING = 1e-9  # of a level: 0.9 is the largest level of 19 surfaces, 18/20


class Band(NamedTuple):
    """Both ends of a band at k loads, each (k,), NaN where there is none."""

    low: Values
    high: Values


def fewest_surfaces(level: float) -> int:
    """Return the number of surfaces from which on a band assumes no distribution.

    Parameters
    ----------
    level : float
        Chance that a further surface lies inside, between 0 and 1.

    Returns
    -------
    int
        The smallest K with (K - 1) / (K + 1) at the level or above: 19 for 0.9.
    """
    return math.ceil((1 + level) / (1 - level) - ROUNDING)


def further_surface(values: Values, level: float, *, percent: bool = False) -> Band:
    """Return where a further surface lies at each load by itself.

    Parameters
    ----------
    values : ndarray, shape (K, k)
        A quantity of K surfaces, 2 or more, at k loads.
    level : float
        Chance that a further surface lies inside, between 0 and 1.
    percent : bool
        Whether the quantity is a share in percent, which fewer surfaces than `fewest_surfaces`
        have a band of by its logit, not its logarithm.

    Returns
    -------
    Band
        Both ends. There are none where a value is 0, negative or not finite, nor where a share is
        100 % and its logit is needed, and none that are beyond what numbers hold.
    """
    number = len(values)
    ranked = number >= fewest_surfaces(level)
    usable = (values > 0) & np.isfinite(values)
    if percent and not ranked:
        usable &= values < 100
    known = usable.all(axis=0)
    low = np.full(known.size, np.nan)
    high = np.full(known.size, np.nan)
    if not known.any():
        return Band(low, high)
    if ranked:
        shares = (1 - level) / 2, (1 + level) / 2
        # the ranks p (K + 1), as E. J. Gumbel and W. Weibull have them
        ends = np.quantile(values[:, known], shares, axis=0, method="weibull")
    else:
        numbers = logit(values[:, known] / 100) if percent else np.log(values[:, known])
        factor = stdtrit(number - 1, (1 + level) / 2) * math.sqrt(1 + 1 / number)
        reach = factor * numbers.std(axis=0, ddof=1)
        ends = numbers.mean(axis=0) + np.array([-reach, reach])
        with np.errstate(over="ignore", under="ignore"):
            ends = 100 * expit(ends) if percent else np.exp(ends)
    low[known], high[known] = ends
    unbounded = ~np.isfinite(low + high)
    low[unbounded] = np.nan
    high[unbounded] = np.nan
    return Band(low, high)


def described(number: int, level: float) -> str:
    """Say of how many surfaces a band is, and what lies inside it."""
    text = (
        f"{100 * level:g} % of further surfaces lie inside, at each load by itself; {number}"
        " surfaces"
    )
    if number >= fewest_surfaces(level):
        return text
    return f"{text}, whose logarithms (of areas the logits) are taken for normal"


def assumption(number: int, level: float) -> str:
    """Say what a band of few surfaces assumes; "" where it assumes no distribution."""
    if number >= (fewest := fewest_surfaces(level)):
        return ""
    return (
        f"a band of {100 * level:g} % by {number} surfaces assumes that the logarithms of each"
        f" quantity, and of areas the logits, are normal: {fewest} surfaces or more need no such"
        " assumption"
    )
