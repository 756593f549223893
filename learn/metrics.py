"""The four scores by which the paper judges its models (section 3.4)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from sklearn.metrics import max_error, mean_absolute_error, mean_squared_error, r2_score


@dataclass(frozen=True)
class Scores:
    """Scores of predictions, all in percent.

    Attributes
    ----------
    nmse : float
        Mean squared error over the mean truth; it carries the target's unit.
    nmae : float
        Mean absolute error over the mean truth.
    nmaxe : float
        Largest absolute error over the largest absolute truth.
    r2 : float
        Coefficient of determination.
    """

    nmse: float
    nmae: float
    nmaxe: float
    r2: float


def scores(truth: ArrayLike, prediction: ArrayLike) -> Scores:
    """Score predictions as the paper does.

    Parameters
    ----------
    truth : array_like, shape (n,)
        Solved values, of which two at least differ.
    prediction : array_like, shape (n,)
        Predicted values.

    Raises
    ------
    ValueError
        If the lengths differ, a value is not finite, or the truth has a mean of zero or does not
        vary: the scores are undefined then.
    """
    known, guessed = np.asarray(truth, dtype=float), np.asarray(prediction, dtype=float)
    if known.ndim != 1 or known.shape != guessed.shape:
        raise ValueError(
            f"truth has shape {known.shape}, prediction {guessed.shape}: two vectors of one length"
            " are needed"
        )
    if not (np.isfinite(known).all() and np.isfinite(guessed).all()):
        raise ValueError("truth and prediction must be finite, without NaN or infinity")
    if known.size < 2 or np.ptp(known) == 0 or known.mean() == 0:
        raise ValueError("truth must vary and have a mean other than zero")
    return Scores(
        nmse=100 * float(mean_squared_error(known, guessed)) / float(known.mean()),
        nmae=100 * float(mean_absolute_error(known, guessed)) / float(known.mean()),
        nmaxe=100 * float(max_error(known, guessed)) / float(np.abs(known).max()),
        r2=100 * float(r2_score(known, guessed)),
    )


BOOTSTRAP = 1000
"""Draws of a bootstrap."""


def bootstrap(
    truth: ArrayLike, prediction: ArrayLike, level: float = 0.9
) -> dict[str, tuple[float, float]]:
    """Return intervals of the scores: quantiles over draws of the rows, with replacement.

    They tell how much a score would differ on other rows of the same kind, with the same model. The
    largest error has none: a draw cannot exceed it.

    Parameters
    ----------
    truth, prediction : array_like, shape (n,)
        See `scores`.
    level : float
        Coverage of the intervals, between 0 and 1.

    Returns
    -------
    dict of str to tuple of float
        Low and high of "nmse", "nmae" and "r2" [%].
    """
    scores(truth, prediction)  # refuses vectors whose scores are undefined
    known = np.asarray(truth, dtype=float)
    error = np.abs(np.asarray(prediction, dtype=float) - known)
    generator = np.random.default_rng(0)
    drawn: dict[str, list[float]] = {"nmse": [], "nmae": [], "r2": []}
    for _ in range(BOOTSTRAP):
        rows = generator.integers(known.size, size=known.size)
        mean, variance = known[rows].mean(), known[rows].var()
        if mean == 0 or variance == 0:  # one row alone, drawn again and again
            continue
        square = float((error[rows] ** 2).mean())
        drawn["nmse"].append(100 * square / mean)
        drawn["nmae"].append(100 * float(error[rows].mean()) / mean)
        drawn["r2"].append(100 * (1 - square / variance))
    low, high = (1 - level) / 2, (1 + level) / 2
    return {
        name: (float(np.quantile(each, low)), float(np.quantile(each, high)))
        for name, each in drawn.items()
    }
