"""The band of a law of several surfaces: where a further surface of their kind is expected.

The band at a load is a prediction interval, not an interval of the mean: its level is the chance
that one further surface is between its ends at this load. The chance to be inside at all loads is
smaller. The K surfaces and the further one are assumed to be drawn from one distribution, and
independently.

- If (K - 1) / (K + 1) is at the level or above, no form of this distribution is assumed. A further
  surface has each rank among all K + 1 with an equal chance. So it is below the j-th smallest of
  the K with a chance of j / (K + 1). The ends are the order statistics at the ranks
  p (K + 1), interpolated between whole ranks. For 90 % that takes 19 surfaces.
- Fewer surfaces have no such ranks. Then the logarithms of a quantity, and the logits of areas in
  percent, are assumed to be normal. The ends are those of Student's prediction interval, the mean
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

ROUNDING = 1e-9
"""Rounding error of a computed number of surfaces: 1.9 / 0.1 may be a little above 19."""


class Band(NamedTuple):
    """Both ends of a band at k loads, each (k,), NaN where there is none."""

    low: Values
    high: Values


def fewest_surfaces(level: float) -> int:
    """Compute the fewest surfaces whose band assumes no distribution.

    Parameters
    ----------
    level : float
        Chance that a further surface is inside the band, between 0 and 1.

    Returns
    -------
    int
        The smallest K with (K - 1) / (K + 1) at the level or above: 19 for 0.9.
    """
    return math.ceil((1 + level) / (1 - level) - ROUNDING)


def further_surface(values: Values, level: float, *, percent: bool = False) -> Band:
    """Compute the band in which a further surface lies, for each load by itself.

    Parameters
    ----------
    values : ndarray, shape (K, k)
        A quantity of K surfaces, 2 or more, at k loads.
    level : float
        Chance that a further surface is inside the band, between 0 and 1.
    percent : bool
        True if the quantity is a share in percent. With fewer surfaces than `fewest_surfaces`, its
        logit is then assumed to be normal, instead of its logarithm.

    Returns
    -------
    Band
        Both ends, (k,). They are NaN where a value is 0, negative or not finite, where a share is
        100 % and its logit is needed, and where an end exceeds the largest float.
    """
    ranked = len(values) >= fewest_surfaces(level)
    usable = (values > 0) & np.isfinite(values)
    if percent and not ranked:
        usable &= values < 100
    places = usable.all(axis=0)
    low = np.full(places.size, np.nan)
    high = np.full(places.size, np.nan)
    if not places.any():
        return Band(low=low, high=high)
    if ranked:
        band = _by_ranks(values[:, places], level)
    elif percent:
        logits = _students(logit(values[:, places] / 100), level)
        band = Band(low=100 * expit(logits.low), high=100 * expit(logits.high))
    else:
        logarithms = _students(np.log(values[:, places]), level)
        with np.errstate(over="ignore", under="ignore"):
            band = Band(low=np.exp(logarithms.low), high=np.exp(logarithms.high))
    bounded = np.isfinite(band.low + band.high)
    low[places] = np.where(bounded, band.low, np.nan)
    high[places] = np.where(bounded, band.high, np.nan)
    return Band(low=low, high=high)


def _by_ranks(values: Values, level: float) -> Band:
    """Return the order statistics of K surfaces at the ranks p (K + 1), as quantiles of Weibull.

    `values` has shape (K, k), and p is (1 - level) / 2 and (1 + level) / 2.
    """
    shares = ((1 - level) / 2, (1 + level) / 2)
    low, high = np.quantile(values, shares, axis=0, method="weibull")
    return Band(low=low, high=high)


def _students(values: Values, level: float) -> Band:
    """Return Student's prediction interval of one more value at each load, if values are normal.

    `values` has shape (K, k): those of K surfaces at k loads. `level` is the chance that the
    further value is inside the interval.
    """
    surfaces = len(values)
    factor = stdtrit(surfaces - 1, (1 + level) / 2) * math.sqrt(1 + 1 / surfaces)
    reach = factor * values.std(axis=0, ddof=1)
    mean = values.mean(axis=0)
    return Band(low=mean - reach, high=mean + reach)


def described(number: int, level: float) -> str:
    """Describe the band of a population.

    Parameters
    ----------
    number : int
        Number of surfaces.
    level : float
        Chance that a further surface is inside the band, between 0 and 1.

    Returns
    -------
    str
        Part of a line, without a full stop.
    """
    text = (
        f"{100 * level:g} % of further surfaces lie inside, at each load by itself; {number}"
        " surfaces"
    )
    if number >= fewest_surfaces(level):
        return text
    return f"{text}, whose logarithms (of areas the logits) are taken for normal"


def assumption(number: int, level: float) -> str:
    """Say what the band of a population assumes about the distribution of its quantities.

    Parameters
    ----------
    number : int
        Number of surfaces.
    level : float
        Chance that a further surface is inside the band, between 0 and 1.

    Returns
    -------
    str
        One line; "" if the surfaces are enough for a band that assumes no distribution.
    """
    enough = fewest_surfaces(level)
    if number >= enough:
        return ""
    return (
        f"a band of {100 * level:g} % by {number} surfaces assumes that the logarithms of each"
        f" quantity, and of areas the logits, are normal: {enough} surfaces or more need no such"
        " assumption"
    )
