"""The four scores by which the paper judges its models (section 3.4)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike


@dataclass(frozen=True)
class Scores:
    """Scores of predictions, all in percent."""

    nmse: float  # mean squared error over the mean magnitude of the truth, in the target's unit
    nmae: float  # mean absolute error over the mean magnitude of the truth
    nmaxe: float  # largest absolute error over the largest absolute truth
    r2: float  # coefficient of determination


def scores(truth: ArrayLike, prediction: ArrayLike) -> Scores:
    """Score predictions of a truth that varies, both (n,), as the paper does.

    ValueError is raised if the lengths differ, a value is not finite, or the truth does not vary.
    """
    from sklearn.metrics import (
        max_error,
        mean_absolute_error,
        mean_squared_error,
        r2_score,
    )

    known, guessed = np.asarray(truth, dtype=float), np.asarray(prediction, dtype=float)
    if known.ndim != 1 or known.size < 2 or np.ptp(known) == 0:
        raise ValueError("truth must be a vector that varies")
    return Scores(
        nmse=100 * float(mean_squared_error(known, guessed)) / magnitude(known),
        nmae=100 * float(mean_absolute_error(known, guessed)) / magnitude(known),
        nmaxe=100 * float(max_error(known, guessed)) / float(np.abs(known).max()),
        r2=100 * float(r2_score(known, guessed)),
    )


def magnitude(truth: ArrayLike) -> float:
    """Return the mean magnitude of the truth, which errors are divided by.

    A mean of quantities with both signs may be near 0, or negative.
    """
    return float(np.abs(np.asarray(truth, dtype=float)).mean())


def no_better(r2: float) -> str:
    """Say that predictions are no better than a constant, with their R2 [%]; "" if they are."""
    return "" if r2 > 0 else f"R2 {r2:.2f} % on the test rows: no better than a constant"


def spread(truth: ArrayLike) -> float:
    """Return the variance of the truth, (n,), over its mean magnitude, in the target's unit.

    It is the factor between nMSE and unexplained variance: nMSE = (1 - R2) times the spread. So the
    nMSE carries the target's unit, and differs between data sets on which R2 is the same.
    """
    return float(np.asarray(truth, dtype=float).var()) / magnitude(truth)


BOOTSTRAP = 1000  # resamples of a bootstrap
LEVEL = 0.9  # coverage of intervals, where nothing else is asked for


def bootstrap(
    truth: ArrayLike,
    prediction: ArrayLike,
    level: float = LEVEL,
    groups: ArrayLike | None = None,
) -> dict[str, tuple[float, float]]:
    """Return low and high of "nmse", "nmae" and "r2" over resamples of the rows [%]; {} for one
    group.

    They tell how much a score would differ on other rows of the same kind, with the same model. The
    largest error has none: a resample cannot exceed it. Rows of one group, (n,), are drawn
    together: a model errs alike on rows of one surface, and rows drawn one by one would make too
    much of them (B. Efron and R. Tibshirani, An Introduction to the Bootstrap, chapter 8).
    """
    scores(truth, prediction)  # refuses vectors whose scores are undefined
    known = np.asarray(truth, dtype=float)
    error = np.abs(np.asarray(prediction, dtype=float) - known)
    own = (
        np.arange(known.size)
        if groups is None
        else np.unique(groups, return_inverse=True)[1]
    )
    number = int(own.max()) + 1
    if number < 2:
        return {}
    middle = float(
        known.mean()
    )  # variances are of the distances from it, without cancellation
    size = magnitude(known)
    from_middle = known - middle
    each = (
        np.ones_like(known),
        error**2,
        error,
        np.abs(known) - size,
        from_middle,
        from_middle**2,
    )
    sums = np.stack([np.bincount(own, part, number) for part in each], axis=1)
    random = np.random.default_rng(0)
    draws = (random.integers(number, size=number) for _ in range(BOOTSTRAP))
    rows, *totals = (
        np.array([np.bincount(each, minlength=number) for each in draws]) @ sums
    ).T
    square, absolute, beyond, distance, distances = (total / rows for total in totals)
    mean, variance = size + beyond, distances - distance**2
    usable = (mean > 0) & (
        variance > ROUNDING * known.var()
    )  # not one group, again and again
    low, high = (1 - level) / 2, (1 + level) / 2
    drawn = {
        "nmse": 100 * square[usable] / mean[usable],
        "nmae": 100 * absolute[usable] / mean[usable],
        "r2": 100 * (1 - square[usable] / variance[usable]),
    }
    return {
        name: (float(np.quantile(each, low)), float(np.quantile(each, high)))
        for name, each in drawn.items()
    }


ROUNDING = (
    1e-12  # share of the variance of all rows below which that of a resample is rounding
)
