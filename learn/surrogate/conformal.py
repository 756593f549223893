"""Split-conformal intervals: as wide as the errors on rows that the model has not seen.

The conformity scores, absolute errors on the calibration rows, are MAPIE's; what is kept of them
answers for any level without it. Errors grow with the prediction, so the scores are kept apart for
ranges of the prediction, cut at quantiles of the training rows' target (Mondrian): the coverage
holds in each range, not only on average.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gen.runtime.errors import InputError

Values = NDArray[np.float64]

RANGES = 5
"""Ranges of the prediction at most."""

ROWS = 100
"""Calibration rows of a range at least, where there is more than one."""


@dataclass(frozen=True, eq=False)
class Calibration:
    """What intervals need.

    Attributes
    ----------
    borders : (k - 1,) between the ranges of the prediction
    scores : k arrays of absolute errors on the calibration rows, ascending
    """

    borders: Values
    scores: tuple[Values, ...]

    def half_width(self, prediction: Values, level: float) -> Values:
        """Half the width of the interval at each prediction.

        Parameters
        ----------
        prediction : (n,)
        level : wanted coverage, between 0 and 1

        Returns
        -------
        (n,) infinite where too few calibration rows say anything about such a level
        """
        widths = np.array([quantile(scores, level) for scores in self.scores])
        return np.asarray(widths[np.searchsorted(self.borders, prediction, side="right")])


def quantile(scores: Values, level: float) -> float:
    """The score that a new row stays below with a probability of `level` or more.

    Parameters
    ----------
    scores : (n,) ascending
    level : between 0 and 1

    Returns
    -------
    The k-th score, k = ceil((n + 1) level), infinity where k > n

    Source: A. N. Angelopoulos, S. Bates (2021), arXiv:2107.07511, section 1.
    """
    place = math.ceil((scores.size + 1) * checked_level(level) - 1e-9)
    return float(scores[place - 1]) if place <= scores.size else math.inf


def checked_level(level: float) -> float:
    """Return a coverage that intervals can have.

    Raises
    ------
    InputError
        Unless it is between 0 and 1.
    """
    if not 0 < level < 1:
        raise InputError(f"--interval {level:g}: give a coverage between 0 and 1, as 0.9")
    return level


def calibrate(predicted: Values, target: Values, training: Values) -> Calibration:
    """Score a model by its predictions of rows that it has not seen.

    Parameters
    ----------
    predicted, target : (n,) of the calibration rows
    training : (m,) target of the training rows, which decides the ranges
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
    """A fitted model whose predictions of the rows at hand are known: none is made twice."""

    def __init__(self, predicted: Values) -> None:
        self.predicted_ = predicted
        self.fitted_ = True

    def fit(self, inputs: Values, target: Values) -> "_Known":
        """Do nothing: it is fitted."""
        return self

    def predict(self, inputs: Values) -> Values:
        """Return what is known."""
        return self.predicted_


def _borders(predicted: Values, training: Values) -> Values:
    """Quantiles of the training target with enough calibration rows between them."""
    for ranges in range(min(RANGES, predicted.size // ROWS), 1, -1):
        borders = np.quantile(training, np.arange(1, ranges) / ranges)
        rows = np.bincount(np.searchsorted(borders, predicted, side="right"), minlength=ranges)
        if rows.min() >= ROWS // 2:
            return np.asarray(borders, dtype=np.float64)
    return np.empty(0)


def coverage(
    calibration: Calibration, prediction: Values, truth: Values, levels: tuple[float, ...]
) -> Iterator[tuple[float, float, Values]]:
    """Count how many intervals hold the truth.

    Yields
    ------
    level, share of the rows inside, (n,) half widths
    """
    for level in levels:
        half = calibration.half_width(prediction, level)
        yield level, float(np.mean(np.abs(truth - prediction) <= half)), half
