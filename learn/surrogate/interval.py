"""Conformal intervals: as wide as the errors on rows that the model was not fitted to.

Where all rows are of one population, the intervals are split-conformal. The scores, absolute errors
on the calibration rows, give intervals of any level. Errors grow with the prediction: the scores
are kept separately for ranges of it, cut at quantiles of the training target (Mondrian), so that
the coverage holds in each range, not only on average.

Where rows come from several maps or databases, these groups are what is exchangeable, not the rows.
Scores, of models that have not seen the group, are kept by group (`learn.surrogate.calibration`):

- With nine groups or more, intervals hold for a row of a further group like these. Every group has
  the same weight, whatever its number of rows, and so has the new one, whose errors may be of any
  size: of K groups, the largest level is K / (K + 1). (R. Dunn, L. Wasserman, A. Ramdas (2022), J.
  Am. Stat. Assoc. 118, 2491, "pooling CDFs"; Y. Lee, R. F. Barber, R. Willett (2023),
  arXiv:2306.06342, hierarchical conformal prediction.) The level is that of all new groups
  together: a single one may be covered less.
- With fewer groups they hold for new rows of each known group: they are as wide as for the worst.

Their guarantee is that for a model of half the groups, calibrated on the other half; predictions
come from one model of all groups: this is the jackknife, not the jackknife+ (R. F. Barber et al.
(2021), Ann. Stat. 49, 486). `bench scans` measures the coverage.

Scores may be over two sizes of the errors (normalised conformal prediction: J. Lei et al. (2018),
J. Am. Stat. Assoc. 113, 1094, section 5.2). Groups of different kinds have an `ErrorScale`: on
windows of turned surfaces errors are two to three times as large as on isotropic ones. Rows of one
population have a `Growth`: random rows lie in the midst of the training, surfaces of another kind
further out, within the limit of the flag, where errors are larger. How much larger is learnt from
clusters of the training, each predicted by a model of the others.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from gen.arrays import Indices, Values
from gen.runtime.errors import InputError

if TYPE_CHECKING:
    from learn.surrogate.flag import Distance

Scheme = Literal["ranges", "each", "others"]
"""Classes that intervals hold for, with scores of their own: ranges of the prediction; each of the
known groups; or other groups too.
"""

RANGES = 5
"""Largest number of ranges of the prediction."""

ROWS = 100
"""Smallest number of calibration rows per range, where there are several ranges."""

SHRINKAGE = 1.0
"""Weight of the penalty on the slopes of usual errors, for features of deviation 1 and a mean
squared error. On the made maps of `bench scans`, 0.3 to 3 give the same widths within 3 %."""

SMALLEST = 1e-3
"""Smallest error that counts, over the median: logarithms of errors near 0 would weigh most."""

ENDS = (0.02, 0.98)
"""Quantiles of the usual errors at known places, beyond which none is extrapolated."""

CONSTANT = 1e-9
"""Deviation of a constant feature over its largest size, at most."""

SPREAD = 1.0
"""Deviation that is expected of the logarithm's growth from the centre to the limit, before any
error is seen: few rows, which cannot tell, then leave the growth near 0."""


def quantile(scores: Values, level: float) -> float:
    """Return the score that a new row does not exceed with a probability of `level` or more.

    Of n ascending scores it is the k-th, k = ceil((n + 1) level), and infinity where k > n (A. N.
    Angelopoulos, S. Bates (2021), arXiv:2107.07511, section 1).
    """
    place = math.ceil((scores.size + 1) * checked_level(level) - 1e-9)
    return float(scores[place - 1]) if place <= scores.size else math.inf


def quantile_over_groups(scores: tuple[Values, ...], level: float) -> float:
    """Return the score that a row of a new group does not exceed with a probability of `level`.

    It is the quantile of all scores of K groups, each of which weighs 1 / (K + 1) over the rows of
    its group, and of an infinite one of weight 1 / (K + 1) (Y. Lee, R. F. Barber, R. Willett
    (2023), arXiv:2306.06342, section 3).
    """
    together = np.concatenate(scores)
    weights = np.concatenate([np.full(each.size, 1.0 / each.size) for each in scores])
    order = np.argsort(together, kind="stable")
    reached = np.cumsum(weights[order]) / (len(scores) + 1)
    place = int(np.searchsorted(reached, checked_level(level) - 1e-9))
    return float(together[order[place]]) if place < together.size else math.inf


def checked_level(level: float) -> float:
    """Return a coverage, after InputError unless it is between 0 and 1."""
    if not 0 < level < 1:
        raise InputError(f"--interval {level:g}: give a coverage between 0 and 1, as 0.9")
    return level


@dataclass(frozen=True, eq=False)
class ErrorScale:
    """Usual errors, whose logarithm is linear in the d features, or quadratic."""

    slopes: Values  # (d,), change of the logarithm with each feature; and with products of two
    offset: float  # logarithm where all features are 0
    low: float  # least value of the logarithm
    high: float  # and largest one

    def at(self, inputs: Values) -> Values:
        """Return the usual errors, (n,), at the features, (n, d)."""
        with np.errstate(over="ignore", invalid="ignore"):
            terms = inputs if self.slopes.size == inputs.shape[1] else quadratic(inputs)
            logarithm = terms @ self.slopes + self.offset
        logarithm[np.isnan(logarithm)] = self.high
        return np.asarray(np.exp(np.clip(logarithm, self.low, self.high)))


def quadratic(inputs: Values) -> Values:
    """Return the features, (n, d), and their products of two, (n, d (d + 3) / 2)."""
    first, second = np.triu_indices(inputs.shape[1])
    return np.column_stack([inputs, inputs[:, first] * inputs[:, second]])


def fit_scale(
    inputs: Values, errors: Values, groups: Indices, shrinkage: float = SHRINKAGE
) -> ErrorScale:
    """Fit usual errors by ridge regression of the logarithm of errors, (n,); groups weigh alike."""
    _, place, sizes = np.unique(groups, return_inverse=True, return_counts=True)
    weights = 1.0 / (sizes[place] * sizes.size)
    logarithms = _floored_logarithm(errors)
    centre, mean = weights @ inputs, float(weights @ logarithms)
    offset = inputs - centre
    deviation = np.sqrt(weights @ offset**2)
    varying = deviation > CONSTANT * np.abs(inputs).max(axis=0)
    unit = offset[:, varying] / deviation[varying]
    weighted = unit * weights[:, None]
    matrix = weighted.T @ unit + shrinkage * np.eye(unit.shape[1])
    found = np.linalg.solve(matrix, weighted.T @ (logarithms - mean))
    slopes = np.zeros(inputs.shape[1])
    slopes[varying] = found / deviation[varying]
    low, high = np.quantile(mean + unit @ found, ENDS)
    return ErrorScale(slopes, mean - float(centre @ slopes), float(low), float(high))


def _floored_logarithm(errors: Values) -> Values:
    """Return the logarithms of absolute errors, each of them `SMALLEST` at least."""
    least = max(SMALLEST * float(np.median(errors)), np.finfo(float).tiny)
    return np.asarray(np.log(np.maximum(errors, least)))


@dataclass(frozen=True, eq=False)
class Growth:
    """Errors that grow with the distance from the training.

    Their logarithm is linear in the squared distance, which is the leverage of a row: the rate, 0
    or more, is its slope.
    """

    distance: Distance
    rate: float

    def at(self, inputs: Values) -> Values:
        """Return the errors' size, (n,), at the features, (n, d), over that at the distance 1.

        The root mean square of the training's distances is about 1. Beyond the limit of the flag
        errors are taken for no larger than at the limit: no row there counts for the rate.
        """
        return self.of_squares(np.square(self.distance.of(inputs)))

    def of_squares(self, squares: Values) -> Values:
        """Return the errors' size, (n,), at squared distances, (n,); see `at`."""
        return np.asarray(np.exp(self.rate * (np.fmin(squares, self.distance.limit**2) - 1.0)))


def fit_growth(distance: Distance, squares: Values, errors: Values, kinds: Indices) -> Growth:
    """Fit the rate at which errors, (n,), grow, by the rows within the limit of the flag.

    Their squared distances, (n,), are from the rows that their model was fitted to. Kinds, (n,),
    are groups and ranges of predictions: errors differ between these at the same distance, so that
    rows are compared with those of the same kind.
    """
    inside = squares <= distance.limit**2
    logarithms, place = _floored_logarithm(errors)[inside], kinds[inside]
    if np.unique(place).size == place.size:  # none is of the same kind as another
        return Growth(distance, 0.0)
    offset, grown = _centred(squares[inside], place), _centred(logarithms, place)
    penalty = float(np.var(logarithms)) * (distance.limit**2 / SPREAD) ** 2
    rate = float(offset @ grown) / max(float(offset @ offset) + penalty, np.finfo(float).tiny)
    return Growth(distance, max(rate, 0.0))


def _centred(values: Values, place: Indices) -> Values:
    """Subtract from each value the mean of its kind."""
    sums, sizes = np.bincount(place, values), np.bincount(place)
    return np.asarray(values - (sums / np.maximum(sizes, 1))[place])


@dataclass(frozen=True, eq=False)
class Calibration:
    """Scores that intervals of one target over its scale are computed from."""

    borders: Values  # (k - 1,), between the ranges of the prediction
    scores: tuple[
        Values, ...
    ]  # ascending errors of each range; or of each group, over their usual size
    root: bool = False  # True for errors of the square root of the target
    scheme: Scheme = "ranges"  # classes that intervals hold for
    usual: ErrorScale | None = None  # the usual errors, where each group has scores of its own
    growth: Growth | None = None  # of errors with the distance; the scores are over this growth

    @property
    def largest_level(self) -> float:
        """Largest level whose intervals are finite everywhere."""
        if self.scheme == "others":
            return len(self.scores) / (len(self.scores) + 1)
        rows = min(scores.size for scores in self.scores)
        return rows / (rows + 1)

    def ends(self, prediction: Values, level: float, inputs: Values) -> tuple[Values, Values]:
        """Return both ends of the interval at each prediction, each (n,), at the features, (n, d).

        They are infinite where there are too few calibration rows for the level.
        """
        if not self.root:
            half = self._half_width(prediction, level, inputs)
            return prediction - half, prediction + half
        root = np.sqrt(prediction)
        half = self._half_width(root, level, inputs)
        return np.maximum(root - half, 0.0) ** 2, (root + half) ** 2

    def _half_width(self, prediction: Values, level: float, inputs: Values) -> Values:
        """Return half the width of the intervals, (n,), on the scale of the errors."""
        if self.usual is None:
            widths = np.array([quantile(scores, level) for scores in self.scores])
            half = widths[np.searchsorted(self.borders, prediction, side="right")]
        elif self.scheme == "others":
            half = quantile_over_groups(self.scores, level) * self.usual.at(inputs)
        else:
            worst = max(quantile(scores, level) for scores in self.scores)
            half = worst * self.usual.at(inputs)
        return np.asarray(half if self.growth is None else half * self.growth.at(inputs))

    def coverage(
        self, prediction: Values, truth: Values, level: float, inputs: Values
    ) -> tuple[float, Values, Values]:
        """Return the share of rows whose interval holds the truth, and both ends; see `ends`."""
        low, high = self.ends(prediction, level, inputs)
        return float(np.mean((low <= truth) & (truth <= high))), low, high


def calibrate(
    predicted: Values,
    target: Values,
    training: Values,
    inputs: Values,
    *,
    root: bool = False,
    growth: Growth | None = None,
) -> Calibration:
    """Calibrate intervals by predictions and targets, (n,), of rows that trained nothing.

    Their features are (n, d). Quantiles of the training target, (m,), are the borders of the
    ranges.
    """
    if root:
        predicted, target, training = np.sqrt(predicted), np.sqrt(target), np.sqrt(training)
    errors = np.abs(target - predicted)
    if growth is not None:
        errors /= growth.at(inputs)
    borders = _borders(predicted, training)
    number = np.searchsorted(borders, predicted, side="right")
    scores = tuple(np.sort(errors[number == each]) for each in range(borders.size + 1))
    return Calibration(borders, scores, root, growth=growth)


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
