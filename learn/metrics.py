"""The four scores by which the paper judges its models (section 3.4), and their uncertainty."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from gen.arrays import Indices, Values

# Number of resamples of a bootstrap.
BOOTSTRAP = 1000
# Coverage of intervals, if the user gives none.
LEVEL = 0.9
# Largest variance of a resample, over that of all rows, that may be a rounding error.
ROUNDING = 1e-12


@dataclass(frozen=True)
class Scores:
    """The four scores of predictions of one target."""

    # mean squared error over the mean magnitude of the truth [% times the target's unit]
    nmse: float
    nmae: float  # mean absolute error over the mean magnitude of the truth [%]
    nmaxe: float  # largest absolute error over the largest absolute truth [%]
    r2: float  # coefficient of determination [%]


class Interval(NamedTuple):
    """An interval of a score, in the unit of the score in `Scores`."""

    low: float  # lower end
    high: float  # upper end


def scores(truth: ArrayLike, prediction: ArrayLike) -> Scores:
    """Score predictions as the paper does.

    Parameters
    ----------
    truth : array_like, shape (n,)
        True values, which have to vary.
    prediction : array_like, shape (n,)
        Predicted values in the unit of the truth.

    Returns
    -------
    Scores
        The four scores.

    Raises
    ------
    ValueError
        If the lengths differ, a value is not finite, or the truth is not of one dimension or does
        not vary.
    """
    from sklearn.metrics import (
        max_error,
        mean_absolute_error,
        mean_squared_error,
        r2_score,
    )

    true = np.asarray(truth, dtype=float)
    predicted = np.asarray(prediction, dtype=float)
    # The functions of scikit-learn raise ValueError for other lengths and values not finite.
    if true.ndim != 1 or true.size < 2 or np.ptp(true) == 0:
        raise ValueError("truth must be a vector that varies")
    mean_magnitude = magnitude(true)
    return Scores(
        nmse=100 * float(mean_squared_error(true, predicted)) / mean_magnitude,
        nmae=100 * float(mean_absolute_error(true, predicted)) / mean_magnitude,
        nmaxe=100 * float(max_error(true, predicted)) / float(np.abs(true).max()),
        r2=100 * float(r2_score(true, predicted)),
    )


def magnitude(truth: ArrayLike) -> float:
    """Return the mean magnitude of the truth, by which errors are divided.

    Errors are not divided by the mean, which may be near 0 or negative.

    Parameters
    ----------
    truth : array_like, shape (n,)
        True values.

    Returns
    -------
    float
        Mean of the absolute values, in the unit of the truth.
    """
    values = np.asarray(truth, dtype=float)
    return float(np.abs(values).mean())


def no_better(r2: float) -> str:
    """Return a remark if predictions are no better than a constant.

    Parameters
    ----------
    r2 : float
        Coefficient of determination on the test rows [%].

    Returns
    -------
    str
        The remark; "" if `r2` is above 0.
    """
    if r2 > 0:
        return ""
    return f"R2 {r2:.2f} % on the test rows: no better than a constant"


def spread(truth: ArrayLike) -> float:
    """Return the variance of the truth over its mean magnitude.

    The spread connects two scores: nMSE = (1 - R2) times the spread. The nMSE therefore has the
    unit of the target, and may differ between data sets with equal R2.

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
    """Estimate intervals of scores from `BOOTSTRAP` resamples of the rows.

    An interval tells how much a score of one model would vary if the test rows were drawn again.
    The largest error has no interval, because no resample has a larger one. Rows of one group are
    drawn together: a model makes similar errors at rows of one surface, and rows drawn one by one
    would give intervals that are too narrow (B. Efron and R. Tibshirani, An Introduction to the
    Bootstrap, chapter 8). The seed is fixed: calls with equal numbers of groups draw equal
    resamples.

    Parameters
    ----------
    truth : array_like, shape (n,)
        True values, which have to vary.
    prediction : array_like, shape (n,)
        Predicted values in the unit of the truth.
    level : float
        Coverage of the intervals, between 0 and 1.
    groups : array_like, shape (n,), optional
        Group of each row. If left out, each row is a group.

    Returns
    -------
    dict of str to Interval
        Intervals of the scores "nmse", "nmae" and "r2"; empty if all rows are one group.

    Raises
    ------
    ValueError
        If the scores of all rows are undefined; see `scores`.
    """
    scores(truth, prediction)  # refuses vectors whose scores are undefined
    true = np.asarray(truth, dtype=float)
    error = np.abs(np.asarray(prediction, dtype=float) - true)
    numbers = np.arange(true.size)  # number of the group of each row
    if groups is not None:
        numbers = np.unique(groups, return_inverse=True)[1]
    if numbers.max() < 1:  # all rows are in group 0
        return {}
    means = _resampled_means(true, error, numbers)
    # Scores of a resample are undefined if its truth is 0 everywhere or does not vary. This can
    # happen if one group was drawn every time.
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
    """Means over the rows of each of b resamples."""

    magnitude: Values  # (b,), mean of the absolute truth, in its unit
    variance: Values  # (b,), variance of the truth, in the square of its unit
    squared_error: Values  # (b,), mean squared error, in the square of the truth's unit
    absolute_error: Values  # (b,), mean absolute error, in the truth's unit


def _resampled_means(true: Values, error: Values, numbers: Indices) -> ResampledMeans:
    """Draw `BOOTSTRAP` resamples of the groups, and return means over the rows of each resample.

    Takes the truth, the absolute errors and the numbers of the groups, counted from 0: an entry for
    each row, (n,). To avoid cancellation, magnitude and variance of a resample are computed from
    differences to the means of all rows.
    """
    mean_magnitude = magnitude(true)
    from_mean = true - float(true.mean())
    quantities = {
        "rows": np.ones_like(true),
        "squared_error": error**2,
        "absolute_error": error,
        "magnitude_difference": np.abs(true) - mean_magnitude,
        "from_mean": from_mean,
        "squared_from_mean": from_mean**2,
    }
    counts = _drawn_counts(int(numbers.max()) + 1)
    totals = {}  # sums over the rows of each resample, (b,)
    for name, quantity in quantities.items():
        sums_of_groups = np.bincount(numbers, quantity)
        totals[name] = counts @ sums_of_groups
    rows = totals["rows"]
    mean_difference = totals["from_mean"] / rows
    return ResampledMeans(
        magnitude=mean_magnitude + totals["magnitude_difference"] / rows,
        variance=totals["squared_from_mean"] / rows - mean_difference**2,
        squared_error=totals["squared_error"] / rows,
        absolute_error=totals["absolute_error"] / rows,
    )


def _drawn_counts(groups: int) -> Indices:
    """Return how often each group is drawn in each resample, (BOOTSTRAP, groups)."""
    random = np.random.default_rng(0)
    counts = []
    for _ in range(BOOTSTRAP):
        drawn = random.integers(groups, size=groups)
        counts.append(np.bincount(drawn, minlength=groups))
    return np.array(counts)


def _interval(values: Values, level: float) -> Interval:
    """Return the interval that contains the share `level` of b values, (b,).

    It is central: equal numbers of values are below and above it.
    """
    low = float(np.quantile(values, (1 - level) / 2))
    high = float(np.quantile(values, (1 + level) / 2))
    return Interval(low, high)
