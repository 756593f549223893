"""The four scores by which the paper judges its models (section 3.4), and their uncertainty."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from gen.arrays import Indices, Values

BOOTSTRAP = 1000  # resamples of a bootstrap
LEVEL = 0.9  # coverage of intervals that is used unless another one is chosen
# share of the variance of all rows below which the variance of a resample is rounding
ROUNDING = 1e-12


@dataclass(frozen=True)
class Scores:
    """Scores of predictions, all in percent."""

    nmse: float  # mean squared error over the mean magnitude of the truth, in the target's unit
    nmae: float  # mean absolute error over the mean magnitude of the truth
    nmaxe: float  # largest absolute error over the largest absolute truth
    r2: float  # coefficient of determination


class Interval(NamedTuple):
    """An interval of a score [%]."""

    low: float
    high: float


def scores(truth: ArrayLike, prediction: ArrayLike) -> Scores:
    """Score predictions as the paper does.

    Parameters
    ----------
    truth : array_like, shape (n,)
        True values, which have to vary.
    prediction : array_like, shape (n,)
        Predicted values in the same unit.

    Returns
    -------
    Scores
        The four scores [%].

    Raises
    ------
    ValueError
        If the lengths differ, a value is not finite, or the truth does not vary.
    """
    from sklearn.metrics import (
        max_error,
        mean_absolute_error,
        mean_squared_error,
        r2_score,
    )

    true = np.asarray(truth, dtype=float)
    predicted = np.asarray(prediction, dtype=float)
    if true.ndim != 1 or true.size < 2 or np.ptp(true) == 0:
        raise ValueError("truth must be a vector that varies")
    return Scores(
        nmse=100 * float(mean_squared_error(true, predicted)) / magnitude(true),
        nmae=100 * float(mean_absolute_error(true, predicted)) / magnitude(true),
        nmaxe=100 * float(max_error(true, predicted)) / float(np.abs(true).max()),
        r2=100 * float(r2_score(true, predicted)),
    )


def magnitude(truth: ArrayLike) -> float:
    """Return the mean magnitude of the truth, which errors are divided by.

    The mean itself may be near 0, or negative, for quantities with both signs.

    Parameters
    ----------
    truth : array_like, shape (n,)
        True values.

    Returns
    -------
    float
        Mean of their absolute values, in their unit.
    """
    values = np.asarray(truth, dtype=float)
    return float(np.abs(values).mean())


def no_better(r2: float) -> str:
    """Say that predictions are no better than a constant, if they are not.

    Parameters
    ----------
    r2 : float
        Coefficient of determination on the test rows [%].

    Returns
    -------
    str
        The sentence; "" if they are better.
    """
    if r2 > 0:
        return ""
    return f"R2 {r2:.2f} % on the test rows: no better than a constant"


def spread(truth: ArrayLike) -> float:
    """Return the variance of the truth over its mean magnitude.

    It is the factor between nMSE and unexplained variance: nMSE = (1 - R2) times the spread. So the
    nMSE carries the target's unit, and differs between data sets on which R2 is the same.

    Parameters
    ----------
    truth : array_like, shape (n,)
        True values.

    Returns
    -------
    float
        The spread in the unit of the truth.
    """
    variance = float(np.asarray(truth, dtype=float).var())
    return variance / magnitude(truth)


def bootstrap(
    truth: ArrayLike,
    prediction: ArrayLike,
    level: float = LEVEL,
    groups: ArrayLike | None = None,
) -> dict[str, Interval]:
    """Return intervals of scores over `BOOTSTRAP` resamples of the rows.

    They tell how much a score would differ on other rows of the same kind, with the same model. The
    largest error has no interval, because a resample cannot exceed it. Rows of one group are drawn
    together: a model errs alike on rows of one surface, and rows drawn one by one would give
    intervals that are too narrow (B. Efron and R. Tibshirani, An Introduction to the Bootstrap,
    chapter 8). The resamples are the same in each call.

    Parameters
    ----------
    truth : array_like, shape (n,)
        True values, which have to vary.
    prediction : array_like, shape (n,)
        Predicted values in the same unit.
    level : float
        Coverage of the intervals, between 0 and 1.
    groups : array_like, shape (n,), optional
        Group of each row; each row is a group of its own if left out.

    Returns
    -------
    dict
        Intervals by the names "nmse", "nmae" and "r2"; empty if all rows are one group.

    Raises
    ------
    ValueError
        If the scores of all rows are undefined; see `scores`.
    """
    scores(truth, prediction)  # refuses vectors whose scores are undefined
    true = np.asarray(truth, dtype=float)
    error = np.abs(np.asarray(prediction, dtype=float) - true)
    numbers = np.arange(true.size)
    if groups is not None:
        numbers = np.unique(groups, return_inverse=True)[1]
    if numbers.max() < 1:
        return {}
    means = _resampled_means(true, error, numbers)
    # A resample of one group, drawn again and again, has no variance.
    usable = means.magnitude > 0
    usable &= means.variance > ROUNDING * true.var()
    squared_error = means.squared_error[usable]
    absolute_error = means.absolute_error[usable]
    return {
        "nmse": _interval(100 * squared_error / means.magnitude[usable], level),
        "nmae": _interval(100 * absolute_error / means.magnitude[usable], level),
        "r2": _interval(100 * (1 - squared_error / means.variance[usable]), level),
    }


@dataclass(frozen=True, eq=False)
class ResampledMeans:
    """Means over the rows of each resample, (b,) each, in powers of the target's unit."""

    magnitude: Values  # of the absolute truth
    variance: Values  # of the truth
    squared_error: Values
    absolute_error: Values


def _resampled_means(true: Values, error: Values, numbers: Indices) -> ResampledMeans:
    """Draw groups with replacement, and return means over the rows of each draw.

    Takes the truth, the absolute errors and the number of the group of each row, (n,). Magnitudes
    and variances are computed from distances to those of all rows, without cancellation.
    """
    size = magnitude(true)
    from_mean = true - float(true.mean())
    quantities = (
        np.ones_like(true),
        error**2,
        error,
        np.abs(true) - size,
        from_mean,
        from_mean**2,
    )
    groups = int(numbers.max()) + 1
    sums = [np.bincount(numbers, quantity, groups) for quantity in quantities]
    random = np.random.default_rng(0)
    counts = []  # how often each group is drawn
    for _ in range(BOOTSTRAP):
        drawn = random.integers(groups, size=groups)
        counts.append(np.bincount(drawn, minlength=groups))
    totals = np.array(counts) @ np.stack(sums, axis=1)
    rows = totals[:, 0]
    distance = totals[:, 4] / rows
    return ResampledMeans(
        magnitude=size + totals[:, 3] / rows,
        variance=totals[:, 5] / rows - distance**2,
        squared_error=totals[:, 1] / rows,
        absolute_error=totals[:, 2] / rows,
    )


def _interval(values: Values, level: float) -> Interval:
    """Return the interval that a share of the values is inside of, as many below as above it."""
    low = float(np.quantile(values, (1 - level) / 2))
    high = float(np.quantile(values, (1 + level) / 2))
    return Interval(low, high)
