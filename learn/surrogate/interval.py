"""Intervals of predictions, and distances from the training.

Intervals are conformal: as wide as the errors of models that have not seen a row's surface, map or
database (`learn.surrogate.calibration`). An error over the error that is usual at its place is a
score. A quantile of the scores times the usual error is half the width of an interval. The usual
error is the product of two factors (normalised conformal prediction: J. Lei et al. (2018), J. Am.
Stat. Assoc. 113, 1094, section 5.2):

- an `ErrorScale` of the features: errors on windows of turned surfaces are two to three times as
  large as on isotropic ones;
- a growth with the distance from the training, the same for all fits (`GROWTH`). Kinds of surfaces
  that a training lacks lie further out, within the limit of the flag. Errors are larger there, but
  no row of the training tells how much larger.

Surfaces are exchangeable, rows are not. All rows of one surface together therefore weigh as much as
those of another one. The surface of a prediction counts as one more, with an error of any size, so
that K surfaces reach a level of K / (K + 1) at most. Where rows come from a few maps or databases,
each of these has scores of its own surfaces, and a prediction takes the scores of the nearest one.
With nine maps or databases or more, each weighs as much as another, and intervals hold for rows of
a further one. (R. Dunn, L. Wasserman, A. Ramdas (2022), J. Am. Stat. Assoc. 118, 2491, "pooling
CDFs"; Y. Lee, R. F. Barber, R. Willett (2023), arXiv:2306.06342, hierarchical conformal
prediction.) The level is the mean over all new surfaces or maps. A single one may be covered less.

The theory guarantees the level for a model of half the surfaces, calibrated on the other half. Here
predictions come from one model of all surfaces: this is the jackknife, not the jackknife+ (R. F.
Barber et al. (2021), Ann. Stat. 49, 486). `bench coverage` and `bench scans` measure the coverage.

Rows far from the training are flagged (`learn.surrogate.training`). Each feature may lie within its
range while all of them together are far from any surface of the training. The distance is the
Mahalanobis distance over the root of the number of features. Its limit is the distance that 97 % of
the training rows keep, each measured from rows of other surfaces. Where there are many maps or
databases, each is left out in turn, and a row of a similar new one lies beyond the limit with a
probability of 10 % at most.

A few databases are a few clouds of features with nothing between them: elastic bodies of one kind
of surface, bodies that yield of another. Distances are then measured from the nearest cloud. The
covariance of a cloud is drawn towards the mean of all clouds, as a database may have fewer rows
than features (J. H. Friedman (1989), J. Am. Stat. Assoc. 84, 165, regularised discriminant
analysis).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from gen.arrays import Indices, Values
from gen.runtime.errors import InputError

# level of intervals where the user names none, and the calibration reaches it
USUAL_LEVEL = 0.9
# slack of largest levels, in thousandths: the weights that they follow from are sums of fractions
ROUNDING = 1e-6
# share of the rows of a new map or database that lie within the limit, at least
SHARE = 0.9
# share of the training rows within the limit, unless maps or databases decide it
INSIDE = 0.97

# Added to the variances of features of deviation 1, because some features repeat others: roots do.
RIDGE = 1e-4
# The same where maps are one cloud: few directions tell one map from another.
RIDGE_OF_MAPS = 0.01


class Growth(NamedTuple):
    """How errors grow with the distance from the training."""

    at_limit: float  # errors at the limit of the flag, over those in the middle
    power: float  # of the distance, in which the logarithm of the errors is linear

    def at(self, distance: Values, limit: float) -> Values:
        """Return the size of errors at distances from the training.

        Parameters
        ----------
        distance : ndarray, shape (n,)
            Distances from the training; NaN counts as the limit.
        limit : float
            Limit of the flag. Beyond it errors are taken to be no larger than at the limit.

        Returns
        -------
        ndarray, shape (n,)
            Size of errors over that in the middle of the training.
        """
        share = np.fmin(distance, limit) / max(limit, np.finfo(float).tiny)
        return np.asarray(self.at_limit**share**self.power)


# Chosen with 18 kinds of surfaces that were changed in ways of their own (peaks cut, skewed, waves
# added ...) and the first 23 of `bench coverage`: of the second to the eighth power, the one that
# needs the smallest share of rows inside over all kinds to have 86 % of each of them inside. By the
# square, which needs 95 % instead of 94, intervals are a quarter narrower on these kinds.
GROWTH = Growth(40.0, 4.0)
# weight of the penalty on the slopes of usual errors, for features of deviation 1 and a mean
# squared error; on the made maps of `bench scans`, 0.3 to 3 give the same widths within 3 %
SHRINKAGE = 1.0
# Least error that counts, over the median: otherwise logarithms near 0 would weigh most.
SMALLEST = 1e-3
# quantiles of the usual errors beyond which none is extrapolated
ENDS = (0.02, 0.98)
# largest deviation of a constant feature, over its largest size
CONSTANT = 1e-9


class Scores(NamedTuple):
    """Errors, over their usual size, of rows that belong to surfaces, maps or databases."""

    errors: Values  # (n,), ascending
    weights: Values  # (n,), the inverse of the number of rows of the same surface, map or database

    @classmethod
    def of(cls, errors: Values, groups: Indices) -> Scores:
        """Sort and weight errors.

        Parameters
        ----------
        errors : ndarray, shape (n,)
            Absolute errors over their usual size.
        groups : ndarray, shape (n,)
            Number of the surface, map or database of each row.

        Returns
        -------
        Scores
            The errors, ascending, with their weights.
        """
        order = np.argsort(errors, kind="stable")
        weights = 1.0 / _sizes_of_groups(groups)
        return cls(errors[order], weights[order])

    def quantile(self, level: float) -> float:
        """Return the score that a row of a new surface does not exceed with a probability.

        Each of K surfaces weighs 1 / (K + 1), shared by its rows. An infinite score weighs
        1 / (K + 1) too (Lee, Barber, Willett (2023), section 3).

        Parameters
        ----------
        level : float
            The probability, between 0 and 1.

        Returns
        -------
        float
            Score; infinite if the level is above K / (K + 1).

        Raises
        ------
        InputError
            If the level is not between 0 and 1.
        """
        require_probability(level)
        reached = np.cumsum(self.weights) / (self.weights.sum() + 1)
        place = int(np.searchsorted(reached, level - 1e-9))
        if place == self.errors.size:
            return np.inf
        return float(self.errors[place])


def require_probability(level: float) -> None:
    """Refuse a level of intervals that is not between 0 and 1.

    Parameters
    ----------
    level : float
        Coverage of intervals.

    Raises
    ------
    InputError
        If it is not between 0 and 1.
    """
    if not 0 < level < 1:
        raise InputError(f"--interval {level:g}: give a coverage between 0 and 1, as 0.9")


def _sizes_of_groups(groups: Indices) -> Indices:
    """Return the number of rows of each row's group, (n,)."""
    _, place, sizes = np.unique(groups, return_inverse=True, return_counts=True)
    return np.asarray(sizes[place])


@dataclass(frozen=True, eq=False)
class ErrorScale:
    """Usual errors, whose logarithm is a linear or quadratic function of the d features."""

    # change of the logarithm with each feature, (d,); of a quadratic one, with each term of
    # `quadratic`
    slopes: Values
    offset: float  # logarithm where all features are 0
    low: float  # least value of the logarithm
    high: float  # largest value of the logarithm

    def at(self, inputs: Values) -> Values:
        """Return the usual errors of rows.

        Parameters
        ----------
        inputs : ndarray, shape (n, d)
            Features; the largest usual error is returned where one is NaN.

        Returns
        -------
        ndarray, shape (n,)
            Usual errors, in the unit of the errors that were fitted.
        """
        with np.errstate(over="ignore", invalid="ignore"):
            terms = inputs
            if self.slopes.size != inputs.shape[1]:
                terms = quadratic(inputs)
            logarithm = terms @ self.slopes + self.offset
        logarithm[np.isnan(logarithm)] = self.high
        return np.asarray(np.exp(np.clip(logarithm, self.low, self.high)))


def quadratic(inputs: Values) -> Values:
    """Append the products of two features to the features.

    Parameters
    ----------
    inputs : ndarray, shape (n, d)
        Features.

    Returns
    -------
    ndarray, shape (n, d (d + 3) / 2)
        Features, their squares and their products.
    """
    first, second = np.triu_indices(inputs.shape[1])
    return np.column_stack([inputs, inputs[:, first] * inputs[:, second]])


def fit_scale(
    inputs: Values, errors: Values, groups: Indices, shrinkage: float = SHRINKAGE
) -> ErrorScale:
    """Fit usual errors by ridge regression of the logarithm of errors.

    Parameters
    ----------
    inputs : ndarray, shape (n, d)
        Features, or the terms of `quadratic`.
    errors : ndarray, shape (n,)
        Absolute errors.
    groups : ndarray, shape (n,)
        Number of the surface, map or database of each row. All groups weigh the same.
    shrinkage : float
        Weight of the penalty on the slopes, for features of deviation 1 and a mean squared error.

    Returns
    -------
    ErrorScale
        Usual errors, in the unit of the errors.
    """
    weights = 1.0 / (_sizes_of_groups(groups) * np.unique(groups).size)
    smallest = max(SMALLEST * float(np.median(errors)), np.finfo(float).tiny)
    logarithms = np.log(np.maximum(errors, smallest))
    centre = weights @ inputs
    mean = float(weights @ logarithms)
    differences = inputs - centre
    deviation = np.sqrt(weights @ differences**2)
    varying = deviation > CONSTANT * np.abs(inputs).max(axis=0)
    unit = differences[:, varying] / deviation[varying]
    weighted = unit * weights[:, None]
    matrix = weighted.T @ unit + shrinkage * np.eye(unit.shape[1])
    coefficients = np.linalg.solve(matrix, weighted.T @ (logarithms - mean))
    slopes = np.zeros(inputs.shape[1])
    slopes[varying] = coefficients / deviation[varying]
    low, high = np.quantile(mean + unit @ coefficients, ENDS)
    return ErrorScale(slopes, mean - float(centre @ slopes), float(low), float(high))


class Nearest(NamedTuple):
    """The nearest cloud of each of n rows."""

    distance: Values  # (n,), distance from the mean of this cloud
    cloud: Indices  # (n,), number of this cloud


@dataclass(frozen=True, eq=False)
class Distance:
    """Distances from k clouds of training rows: all rows, or those of each database or map."""

    centres: Values  # (k, d), mean features of the clouds
    # (k, d, d), matrices after which differences from the mean are uncorrelated
    whitenings: Values
    limit: float  # largest distance that is not flagged

    def nearest(self, inputs: Values) -> Nearest:
        """Find the nearest cloud of each row.

        Parameters
        ----------
        inputs : ndarray, shape (n, d)
            Features.

        Returns
        -------
        Nearest
            Distance from the nearest mean, NaN where a feature is NaN, and number of its cloud.
        """
        squares = np.empty((len(self.centres), len(inputs)))
        with np.errstate(over="ignore", invalid="ignore"):
            for cloud, centre in enumerate(self.centres):
                differences = (inputs - centre) @ self.whitenings[cloud]
                squares[cloud] = np.mean(differences**2, axis=1)
        return Nearest(np.sqrt(squares.min(axis=0)), squares.argmin(axis=0))

    def of(self, inputs: Values) -> Values:
        """Return the distance of each row from the nearest mean.

        Parameters
        ----------
        inputs : ndarray, shape (n, d)
            Features.

        Returns
        -------
        ndarray, shape (n,)
            Distances; NaN where a feature is NaN.
        """
        return self.nearest(inputs).distance


class MeasuredRows(NamedTuple):
    """Rows, and where they lie seen from the training."""

    training: Distance  # distances from the training, with the limit of the flag
    nearest: (
        Nearest  # of each row; of training rows, measured without the part they are in
    )


def from_maps(inputs: Values, groups: Indices) -> Distance:
    """Measure distances from training rows, with the limit that rows of a new map keep.

    To find the limit, each map or database is left out in turn.

    Parameters
    ----------
    inputs : ndarray, shape (n, d)
        Features of the training rows.
    groups : ndarray, shape (n,)
        Number of the map or database of each row.

    Returns
    -------
    Distance
        Distances from the one cloud of all rows.
    """
    distances = np.empty(len(inputs))
    for group in np.unique(groups):
        inside = groups == group
        without = _from_one_cloud(inputs[~inside])
        distances[inside] = without.of(inputs[inside])
    limit = Scores.of(distances, groups).quantile(SHARE)
    return replace(_from_one_cloud(inputs), limit=limit)


def from_training(inputs: Values, other_inputs: Values, groups: Indices) -> Distance:
    """Measure distances from training rows, with the limit that rows of further maps keep.

    Parameters
    ----------
    inputs : ndarray, shape (n, d)
        Features of the training rows.
    other_inputs : ndarray, shape (m, d)
        Features of rows of maps or databases that are not in the training.
    groups : ndarray, shape (m,)
        Number of the map or database of each of these other rows.

    Returns
    -------
    Distance
        Distances from the one cloud of the training rows.
    """
    training = _from_one_cloud(inputs)
    limit = Scores.of(training.of(other_inputs), groups).quantile(SHARE)
    return replace(training, limit=limit)


def _from_one_cloud(inputs: Values) -> Distance:
    """Return the distances from rows of many maps or databases, without a limit."""
    return _unlimited(inputs, np.zeros(len(inputs), dtype=np.int64), ridge=RIDGE_OF_MAPS)


def from_surfaces(inputs: Values, clouds: Indices, parts: Indices) -> MeasuredRows:
    """Measure distances from the nearest cloud of training rows, with a limit that most rows keep.

    Parameters
    ----------
    inputs : ndarray, shape (n, d)
        Features of the training rows.
    clouds : ndarray, shape (n,)
        Number of the cloud of each row, from 0 on.
    parts : ndarray, shape (n,)
        Number of the part of each row; rows of one surface are in the same part.

    Returns
    -------
    MeasuredRows
        Distances from the clouds, and the nearest cloud of each row among the rows of other parts.
    """
    distances = np.empty(len(inputs))
    nearest = np.empty(len(inputs), dtype=np.int64)
    has_cloud = np.zeros(len(inputs), dtype=np.bool_)
    for part in np.unique(parts):
        inside = parts == part
        remaining = np.unique(clouds[~inside])
        without = _unlimited(inputs[~inside], clouds[~inside]).nearest(inputs[inside])
        distances[inside] = without.distance
        nearest[inside] = remaining[without.cloud]
        has_cloud[inside] = np.isin(clouds[inside], remaining)
    # Rows of a cloud that no other part has cannot be measured from their own cloud.
    if not has_cloud.any():
        has_cloud[:] = True
    limit = float(np.quantile(distances[has_cloud], INSIDE, method="higher"))
    training = replace(_unlimited(inputs, clouds), limit=limit)
    return MeasuredRows(training, Nearest(distances, nearest))


def _unlimited(inputs: Values, labels: Indices, ridge: float = RIDGE) -> Distance:
    """Return the distances from the nearest cloud, without a limit.

    The clouds are the rows, (n, d), of each label, (n,).
    """
    features = inputs.shape[1]
    clouds = [inputs[labels == label] for label in np.unique(labels)]
    # A feature that is constant in every cloud does not count; its range flags a new value.
    rounding = CONSTANT * np.abs(inputs).max(axis=0)
    varying = np.any([cloud.std(axis=0) > rounding for cloud in clouds], axis=0)
    scale = np.where(varying, inputs.std(axis=0), np.inf)
    means = [cloud.mean(axis=0) for cloud in clouds]
    units = [(cloud - mean) / scale for cloud, mean in zip(clouds, means, strict=True)]
    squares = [unit.T @ unit for unit in units]
    shared = np.sum(squares, axis=0) / len(inputs)
    whitenings = []
    for cloud, products in zip(clouds, squares, strict=True):
        covariance = (products + features * shared) / (len(cloud) + features)
        inverse = np.linalg.inv(covariance + ridge * np.eye(features))
        whitenings.append(np.linalg.cholesky(inverse) / scale[:, None])
    return Distance(np.array(means), np.array(whitenings), np.inf)


@dataclass(frozen=True, eq=False)
class Calibration:
    """What intervals of one target are computed from. The target is over its scale."""

    scores: tuple[Scores, ...]  # of each cloud of `distance`; or of all maps together
    # usual errors by the features; scores are over these and over the growth
    usual: ErrorScale
    # distance that errors grow with; None for intervals by whole maps
    distance: Distance | None = None
    root: bool = False  # True for errors of the square root of the target
    growth: Growth = GROWTH

    @property
    def largest_level(self) -> float:
        """Largest level that the fewest surfaces or maps reach, rounded down to three digits."""
        fewest = min((float(scores.weights.sum()) for scores in self.scores), default=0.0)
        return math.floor(1000 * fewest / (fewest + 1) + ROUNDING) / 1000

    def ends(
        self, prediction: Values, level: float, inputs: Values
    ) -> tuple[Values, Values]:
        """Return the intervals about predictions.

        Parameters
        ----------
        prediction : ndarray, shape (n,)
            Predictions, over the scale of the target.
        level : float
            Coverage of the intervals, between 0 and 1.
        inputs : ndarray, shape (n, d)
            Features.

        Returns
        -------
        (ndarray, ndarray), each of shape (n,)
            Lower and upper ends, over the scale of the target. They are infinite if too few
            surfaces or maps were calibrated for the level.

        Raises
        ------
        InputError
            If the level is not between 0 and 1.
        """
        half = self._half_widths(level, inputs)
        if not self.root:
            return prediction - half, prediction + half
        root = np.sqrt(np.maximum(prediction, 0.0))
        return np.maximum(root - half, 0.0) ** 2, (root + half) ** 2

    def _half_widths(self, level: float, inputs: Values) -> Values:
        """Return half the width of each interval, (n,), over the target's scale or its root."""
        quantiles = np.array([scores.quantile(level) for scores in self.scores])
        usual = self.usual.at(inputs)
        if self.distance is None:
            return np.asarray(usual * quantiles[0])
        distance, cloud = self.distance.nearest(inputs)
        growth = self.growth.at(distance, self.distance.limit)
        return np.asarray(usual * (quantiles[cloud] * growth))


def calibrated_by(card: Mapping[str, Any]) -> str:
    """Name the number of surfaces, maps or databases that calibrate a surrogate's intervals.

    Parameters
    ----------
    card : mapping of str to object
        Card of the surrogate.

    Returns
    -------
    str
        As "17 maps", or "the surfaces of 4 databases".
    """
    entry = card["calibration"]
    groups = f"{entry['groups']} {entry['kind']}s"
    if entry["scheme"] == "each":
        return f"the surfaces of {groups}"
    return groups
