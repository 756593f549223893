"""Conformal intervals: as wide as the errors of models that have not seen a row's surface.

Every training row is predicted by a model without its surface, or without its whole map or database
(`learn.surrogate.calibration`). Its error, over the size that is usual at its place, is a score; a
quantile of the scores times the usual size is half the width of an interval. The usual size is the
product of two (normalised conformal prediction: J. Lei et al. (2018), J. Am. Stat. Assoc. 113,
1094, section 5.2):

- an `ErrorScale` of the features: errors on windows of turned surfaces are two to three times as
  large as on isotropic ones;
- a growth with the distance from the training, the same for all fits (`GROWTH`). Random rows lie in
  the midst of a training; kinds of surfaces that it lacks lie further out, within the limit of the
  flag, where errors are larger, and by how much no row of the training tells.

What is exchangeable are surfaces, not rows: all rows of one together weigh as much as another
surface, and so does the new one, whose errors may be of any size. Of K surfaces, the largest level
is K / (K + 1). Where rows come from a few maps or databases, each has scores of its own surfaces,
and those of the nearest one count. Of nine maps or databases or more, each weighs as much as
another, and intervals hold for a row of a further one. (R. Dunn, L. Wasserman, A. Ramdas (2022), J.
Am. Stat. Assoc. 118, 2491, "pooling CDFs"; Y. Lee, R. F. Barber, R. Willett (2023),
arXiv:2306.06342, hierarchical conformal prediction.) The level is that of all new ones together: a
single one may be covered less.

Their guarantee is that for a model of half the surfaces, calibrated on the other half; predictions
come from one model of all: this is the jackknife, not the jackknife+ (R. F. Barber et al. (2021),
Ann. Stat. 49, 486). `bench coverage` and `bench scans` measure the coverage.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from gen.arrays import Indices, Values
from gen.runtime.errors import InputError

if TYPE_CHECKING:
    from learn.surrogate.flag import Distance
    from learn.surrogate.model import Surrogate


class Growth(NamedTuple):
    """How errors grow with the distance from the training."""

    most: float  # errors at the limit of the flag, over those in the middle of the training
    power: float  # of the distance, in which the logarithm of the errors is linear

    def at(self, far: Values, limit: float) -> Values:
        """Return the size of errors, (n,), at distances, over that in the middle of the training.

        Beyond the limit of the flag errors are taken for no larger than at the limit.
        """
        inside = np.fmin(far, limit) / max(limit, np.finfo(float).tiny)
        return np.asarray(self.most**inside**self.power)


GROWTH = Growth(40.0, 4.0)
"""Chosen with 18 kinds of surfaces that were changed in ways of their own (peaks cut, skewed, waves
added ...) and the first 23 of `bench coverage`: of the second to the eighth power, the one that
needs the smallest share of rows inside over all kinds to have 86 % of each of them inside. By the
square, which needs 95 % instead of 94, intervals are a quarter narrower on these kinds."""

EARLIER = Growth(18.0, 2.0)
"""Of files that say only whether errors grow."""

SHRINKAGE = 1.0
"""Weight of the penalty on the slopes of usual errors, for features of deviation 1 and a mean
squared error. On the made maps of `bench scans`, 0.3 to 3 give the same widths within 3 %."""

SMALLEST = 1e-3
"""Smallest error that counts, over the median: logarithms of errors near 0 would weigh most."""

ENDS = (0.02, 0.98)
"""Quantiles of the usual errors at known places, beyond which none is extrapolated."""

CONSTANT = 1e-9
"""Deviation of a constant feature over its largest size, at most."""


class Scores(NamedTuple):
    """Errors, over their usual size, of rows that belong to surfaces, maps or databases."""

    errors: Values  # (n,), ascending
    weights: Values  # (n,), the inverse of the number of rows of the same surface, map or database

    @classmethod
    def of(cls, errors: Values, groups: Indices) -> Scores:
        """Sort the errors, (n,), of rows whose surfaces, maps or databases are numbered, (n,)."""
        _, place, sizes = np.unique(groups, return_inverse=True, return_counts=True)
        order = np.argsort(errors, kind="stable")
        return cls(errors[order], 1.0 / sizes[place][order])

    def quantile(self, level: float) -> float:
        """Return the score that a row of a new surface does not exceed with a probability.

        It is the quantile of all scores of K surfaces, each of which weighs 1 / (K + 1) over its
        rows, and of an infinite one of weight 1 / (K + 1) (Lee, Barber, Willett (2023), section 3).
        """
        if not 0 < level < 1:
            raise InputError(f"--interval {level:g}: give a coverage between 0 and 1, as 0.9")
        reached = np.cumsum(self.weights) / (self.weights.sum() + 1)
        place = int(np.searchsorted(reached, level - 1e-9))
        return float(self.errors[place]) if place < self.errors.size else np.inf


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
    least = max(SMALLEST * float(np.median(errors)), np.finfo(float).tiny)
    logarithms = np.log(np.maximum(errors, least))
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


@dataclass(frozen=True, eq=False)
class Calibration:
    """Scores that intervals of one target over its scale are computed from."""

    scores: tuple[Scores, ...]  # of each of the distance's clouds; or of all maps together
    usual: ErrorScale  # size of the errors by the features; scores are over it and over the growth
    distance: Distance | None = None  # with which errors grow; None for intervals by whole maps
    root: bool = False  # True for errors of the square root of the target
    growth: Growth = GROWTH

    def ends(self, prediction: Values, level: float, inputs: Values) -> tuple[Values, Values]:
        """Return both ends of the interval at each prediction, each (n,), at the features, (n, d).

        They are infinite where there are too few surfaces for the level.
        """
        widths = np.array([each.quantile(level) for each in self.scores])
        half = self.usual.at(inputs)
        if self.distance is None:
            half *= widths[0]
        else:
            far, nearest = self.distance.measured(inputs)
            half *= widths[nearest] * self.growth.at(far, self.distance.limit)
        if not self.root:
            return prediction - half, prediction + half
        root = np.sqrt(np.maximum(prediction, 0.0))
        return np.maximum(root - half, 0.0) ** 2, (root + half) ** 2


def calibrated_by(card: Mapping[str, Any]) -> str:
    """Say by how many surfaces, maps or databases intervals are calibrated: "17 maps"."""
    entry = card["calibration"]
    many = f"{entry['groups']} {entry['kind']}s"
    return f"the surfaces of {many}" if entry["scheme"] == "each" else many


def require_level(surrogate: Surrogate, level: float) -> None:
    """Refuse a level of intervals that has too few surfaces or maps to be calibrated."""
    for name, each in surrogate.learnt.items():
        intervals = each.calibration.scores
        if all(np.isfinite(scores.quantile(level)) for scores in intervals):
            continue
        fewest = min(float(scores.weights.sum()) for scores in intervals)
        largest = math.floor(1000 * fewest / (fewest + 1)) / 1000
        raise InputError(
            f"--interval {level:g}: intervals of {name} are calibrated by"
            f" {calibrated_by(surrogate.card)}, which reach {largest:g} at most: give less, or fit"
            " to more of them"
        )
