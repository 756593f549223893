"""Conformal intervals: as wide as the errors on rows that the model was not fitted to.

Where all rows are of one population, the intervals are split-conformal. The conformity scores,
absolute errors on the calibration rows, come from MAPIE; the stored scores give intervals of any
level without it. Errors grow with the prediction. The scores are therefore kept separately for
ranges of the prediction, cut at quantiles of the training target (Mondrian), so that the coverage
holds in each range, not only on average.

Where rows come from several maps or databases, these groups are what is exchangeable, not the rows.
The scores, of models that have not seen the group, are kept by group (`learn.surrogate.groups`):

- With nine groups or more, intervals hold for a row of a further group like these. Every group has
  the same weight, whatever its number of rows, and so has the new one, whose errors may be of any
  size: of K groups, the largest level is K / (K + 1). (R. Dunn, L. Wasserman, A. Ramdas (2022), J.
  Am. Stat. Assoc. 118, 2491, "pooling CDFs"; Y. Lee, R. F. Barber, R. Willett (2023),
  arXiv:2306.06342, hierarchical conformal prediction.) The level is that of all new groups
  together: a single one may be covered less.
- With fewer groups they hold for new rows of each known group: they are as wide as for the worst.

Their guarantee is that for a model of half the groups, calibrated on the other half. Predictions
come from one model of all groups, and the scores from models of all groups but one, which are a
little worse: this is the jackknife, not the jackknife+, which would need all these models in every
prediction (R. F. Barber et al. (2021), Ann. Stat. 49, 486). `bench scans` measures the coverage.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from learn.arrays import Indices, Values
from learn.surrogate.error_growth import Growth
from learn.surrogate.error_scale import ErrorScale
from learn.surrogate.quantiles import quantile, quantile_over_groups

Scheme = Literal["ranges", "each", "others"]
"""Classes that intervals hold for, with scores of their own: ranges of the prediction; each of the
known groups; or other groups too.
"""

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
        For each of the k ranges, the absolute errors on the calibration rows, ascending; or for
        each group, these errors over their usual size.
    root : bool
        True if the errors are those of the square root of the target.
    scheme : {"ranges", "each", "others"}
        Classes that intervals hold for.
    usual : ErrorScale, optional
        The usual errors, where each group has scores of its own.
    growth : Growth, optional
        How errors grow with the distance from the training; the scores are over this growth.
    """

    borders: Values
    scores: tuple[Values, ...]
    root: bool = False
    scheme: Scheme = "ranges"
    usual: ErrorScale | None = None
    growth: Growth | None = None

    @property
    def largest_level(self) -> float:
        """Largest level whose intervals are finite everywhere."""
        if self.scheme == "others":
            return len(self.scores) / (len(self.scores) + 1)
        rows = min(scores.size for scores in self.scores)
        return rows / (rows + 1)

    def ends(
        self, prediction: Values, level: float, inputs: Values | None = None
    ) -> tuple[Values, Values]:
        """Return both ends of the interval at each prediction, each (n,).

        Parameters
        ----------
        prediction : ndarray, shape (n,)
            Predictions; not below 0 if the errors are those of the square root.
        level : float
            Wanted coverage, between 0 and 1.
        inputs : ndarray, shape (n, d)
            Features, needed where groups have scores of their own or errors grow with the distance.
        """
        if not self.root:
            half = self.half_width(prediction, level, inputs)
            return prediction - half, prediction + half
        root = np.sqrt(prediction)
        half = self.half_width(root, level, inputs)
        return np.maximum(root - half, 0.0) ** 2, (root + half) ** 2

    def half_width(self, prediction: Values, level: float, inputs: Values | None = None) -> Values:
        """Return half the width of the interval at each prediction, on the scale of the errors.

        Parameters
        ----------
        prediction : ndarray, shape (n,)
            Predictions, or their square roots.
        level : float
            Wanted coverage, between 0 and 1.
        inputs : ndarray, shape (n, d)
            See `ends`.

        Returns
        -------
        ndarray, shape (n,)
            Half widths, infinite where there are too few calibration rows for the level.
        """
        if self.usual is None:
            widths = np.array([quantile(scores, level) for scores in self.scores])
            half = widths[np.searchsorted(self.borders, prediction, side="right")]
        elif self.scheme == "others":
            half = quantile_over_groups(self.scores, level) * self.usual.at(_given(inputs))
        else:
            worst = max(quantile(scores, level) for scores in self.scores)
            half = worst * self.usual.at(_given(inputs))
        return np.asarray(half if self.growth is None else half * self.growth.at(_given(inputs)))


def _given(inputs: Values | None) -> Values:
    """Return the features, without which some intervals have no width."""
    if inputs is None:
        raise ValueError("intervals that are calibrated by group or distance need the features")
    return inputs


def calibrate(
    predicted: Values,
    target: Values,
    training: Values,
    *,
    root: bool = False,
    growth: Growth | None = None,
    inputs: Values | None = None,
) -> Calibration:
    """Calibrate intervals with predictions of rows that the model was not fitted to.

    Parameters
    ----------
    predicted, target : ndarray, shape (n,)
        Predictions and true values of the calibration rows.
    training : ndarray, shape (m,)
        Target of the training rows, whose quantiles are the borders of the ranges.
    root : bool
        True for errors of the square root.
    growth : Growth, optional
        How errors grow with the distance from the training.
    inputs : ndarray, shape (n, d), optional
        Features of the calibration rows, for the growth.
    """
    from mapie.regression import SplitConformalRegressor

    if root:
        predicted, target, training = np.sqrt(predicted), np.sqrt(target), np.sqrt(training)
    borders = _borders(predicted, training)
    number = np.searchsorted(borders, predicted, side="right")
    sizes = np.ones(predicted.size) if growth is None else growth.at(_given(inputs))
    deviation = float(np.std(training)) or 1.0  # MAPIE compares its numbers with 1e-8
    predicted, target = predicted / (deviation * sizes), target / (deviation * sizes)
    scores = []
    for each in range(borders.size + 1):
        rows = number == each
        conformal = SplitConformalRegressor(_Known(predicted[rows]), prefit=True)
        conformal.conformalize(predicted[rows, None], target[rows])
        found = np.sort(np.asarray(conformal.conformity_scores, dtype=np.float64))
        scores.append(deviation * found)
    return Calibration(borders, tuple(scores), root, growth=growth)


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


def ranges_of(predicted: Values) -> Indices:
    """Return the fifth of the predictions that each one is in, (n,)."""
    ends = np.quantile(predicted, np.arange(1, RANGES) / RANGES)
    return np.asarray(np.searchsorted(ends, predicted, side="right"), dtype=np.int64)


def _borders(predicted: Values, training: Values) -> Values:
    """Return quantiles of the training target with enough calibration rows between them."""
    for ranges in range(min(RANGES, predicted.size // ROWS), 1, -1):
        borders = np.quantile(training, np.arange(1, ranges) / ranges)
        rows = np.bincount(np.searchsorted(borders, predicted, side="right"), minlength=ranges)
        if rows.min() >= ROWS // 2:
            return np.asarray(borders, dtype=np.float64)
    return np.empty(0)


def coverage(
    calibration: Calibration,
    prediction: Values,
    truth: Values,
    levels: tuple[float, ...],
    inputs: Values | None = None,
) -> Iterator[tuple[float, float, Values, Values]]:
    """Compute the share of intervals that contain the true value; see `Calibration.ends`.

    Yields
    ------
    level, share : float
        Wanted coverage, and share of the rows inside their interval.
    low, high : ndarray, shape (n,)
        Ends of the intervals.
    """
    for level in levels:
        low, high = calibration.ends(prediction, level, inputs)
        yield level, float(np.mean((low <= truth) & (truth <= high))), low, high
