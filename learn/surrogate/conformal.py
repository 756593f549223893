"""Split-conformal intervals: as wide as the errors on rows that the model was not fitted to.

The conformity scores, absolute errors on the calibration rows, come from MAPIE; the stored scores
give intervals of any level without it. Errors grow with the prediction. The scores are therefore
kept separately for ranges of the prediction, cut at quantiles of the training target (Mondrian), so
that the coverage holds in each range, not only on average.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from gen.runtime.errors import InputError
from learn.arrays import Values

RANGES = 5
"""Largest number of ranges of the prediction."""

ROWS = 100
"""Smallest number of calibration rows per range, where there are several ranges."""


@dataclass(frozen=True, eq=False)
class Calibration:
    """Scores that intervals are computed from.

    Attributes
    ----------
    borders : ndarray, shape (k - 1,)
        Borders between the ranges of the prediction.
    scores : tuple of ndarray
        For each of the k ranges, the absolute errors on the calibration rows, ascending.
    """

    borders: Values
    scores: tuple[Values, ...]

    def half_width(self, prediction: Values, level: float) -> Values:
        """Return half the width of the interval at each prediction.

        Parameters
        ----------
        prediction : ndarray, shape (n,)
            Predictions.
        level : float
            Wanted coverage, between 0 and 1.

        Returns
        -------
        ndarray, shape (n,)
            Half widths, infinite where there are too few calibration rows for the level.
        """
        widths = np.array([quantile(scores, level) for scores in self.scores])
        return np.asarray(widths[np.searchsorted(self.borders, prediction, side="right")])


def quantile(scores: Values, level: float) -> float:
    """Return the score that a new row does not exceed with a probability of `level` or more.

    Parameters
    ----------
    scores : ndarray, shape (n,)
        Ascending scores.
    level : float
        Probability between 0 and 1.

    Returns
    -------
    float
        The k-th score, k = ceil((n + 1) level), infinity where k > n.

    Source: A. N. Angelopoulos, S. Bates (2021), arXiv:2107.07511, section 1.
    """
    place = math.ceil((scores.size + 1) * checked_level(level) - 1e-9)
    return float(scores[place - 1]) if place <= scores.size else math.inf


def checked_level(level: float) -> float:
    """Return a coverage after a check that intervals can have it.

    Raises
    ------
    InputError
        Unless it is between 0 and 1.
    """
    if not 0 < level < 1:
        raise InputError(f"--interval {level:g}: give a coverage between 0 and 1, as 0.9")
    return level


def calibrate(predicted: Values, target: Values, training: Values) -> Calibration:
    """Calibrate intervals with predictions of rows that the model was not fitted to.

    Parameters
    ----------
    predicted, target : ndarray, shape (n,)
        Predictions and true values of the calibration rows.
    training : ndarray, shape (m,)
        Target of the training rows, whose quantiles are the borders of the ranges.
    """
    from mapie.regression import SplitConformalRegressor

    borders = _borders(predicted, training)
    number = np.searchsorted(borders, predicted, side="right")
    unit = float(np.std(training)) or 1.0  # MAPIE compares its numbers with 1e-8
    scores = []
    for each in range(borders.size + 1):
        rows = number == each
        conformal = SplitConformalRegressor(_Known(predicted[rows] / unit), prefit=True)
        conformal.conformalize(predicted[rows, None], target[rows] / unit)
        scores.append(unit * np.sort(np.asarray(conformal.conformity_scores, dtype=np.float64)))
    return Calibration(borders, tuple(scores))


class _Known:
    """A fitted model, for MAPIE, whose predictions have been computed already."""

    def __init__(self, predicted: Values) -> None:
        self.predicted_ = predicted
        self.fitted_ = True

    def fit(self, inputs: Values, target: Values) -> "_Known":
        """Do nothing, as the model is fitted."""
        return self

    def predict(self, inputs: Values) -> Values:
        """Return the known predictions."""
        return self.predicted_


def _borders(predicted: Values, training: Values) -> Values:
    """Return quantiles of the training target with enough calibration rows between them."""
    for ranges in range(min(RANGES, predicted.size // ROWS), 1, -1):
        borders = np.quantile(training, np.arange(1, ranges) / ranges)
        rows = np.bincount(np.searchsorted(borders, predicted, side="right"), minlength=ranges)
        if rows.min() >= ROWS // 2:
            return np.asarray(borders, dtype=np.float64)
    return np.empty(0)


def coverage(
    calibration: Calibration, prediction: Values, truth: Values, levels: tuple[float, ...]
) -> Iterator[tuple[float, float, Values]]:
    """Compute the share of intervals that contain the true value.

    Yields
    ------
    level, share : float
        Wanted coverage, and share of the rows inside their interval.
    half_width : ndarray, shape (n,)
        Half widths of the intervals.
    """
    for level in levels:
        half = calibration.half_width(prediction, level)
        yield level, float(np.mean(np.abs(truth - prediction) <= half)), half
