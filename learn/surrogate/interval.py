"""Intervals of predictions, and distances from the training.

Intervals are conformal: they are as wide as the errors of models that have not seen a row's
surface, map or database (`learn.surrogate.calibration`). The score of a row is its error over the
usual error of rows with its features. Half the width of an interval is a quantile of the scores
times the usual error. The usual error is the product of two factors (normalised conformal
prediction: J. Lei et al. (2018), J. Am. Stat. Assoc. 113, 1094, section 5.2):

- an `ErrorScale` of the features: errors on windows of turned surfaces are two to three times as
  large as on isotropic ones;
- a `Growth` with the distance from the training, which is equal for all fits (`GROWTH`). Surfaces
  of a kind that the training lacks are further from it, though not always far enough to be flagged.
  Their errors are larger, but no row of the training shows how much larger.

Surfaces are exchangeable, rows are not. The weight of a surface is therefore shared by its rows,
and all surfaces have an equal weight. The surface of a prediction is counted as one more surface,
whose error may have any size, so that K surfaces reach a level of K / (K + 1) at most. If rows come
from a few maps or databases, each of these has scores of its own surfaces, and a prediction uses
the scores of the nearest one. If rows come from nine maps or databases or more, all of these have
an equal weight, and intervals hold for rows of another map or database too (R. Dunn, L. Wasserman,
A. Ramdas (2022), J. Am. Stat. Assoc. 118, 2491, "pooling CDFs"; Y. Lee, R. F. Barber, R. Willett
(2023), arXiv:2306.06342, hierarchical conformal prediction). The level is the mean coverage over
all new surfaces or maps; the coverage of a single one may be lower.

The theory guarantees the level for a model of half the surfaces that is calibrated on the other
half. Here predictions come from one model of all surfaces: this is the jackknife, not the
jackknife+ (R. F. Barber et al. (2021), Ann. Stat. 49, 486). `bench coverage` and `bench scans`
measure the coverage.

Rows far from the training are flagged (`learn.surrogate.training`). Each feature may be within its
range although all of them together are far from those of any surface of the training. The distance
is the Mahalanobis distance over the root of the number of features. Its limit is the distance that
97 % of the training rows do not exceed, each measured from rows of other surfaces. If there are
many maps or databases, each is left out in turn, and the limit is chosen so that a row of a similar
new one exceeds it with a probability of 10 % at most.

A few databases are a few clouds of features with nothing between them, for example elastic bodies
of one kind of surface and bodies that yield of another. Distances are then measured from the
nearest cloud. The covariance of a cloud is shrunk towards the mean covariance of all clouds, as a
database may have fewer rows than features (J. H. Friedman (1989), J. Am. Stat. Assoc. 84, 165,
regularised discriminant analysis).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from gen.arrays import Indices, Values
from gen.runtime.errors import InputError

# Level of intervals if the user names none and the calibration reaches it.
USUAL_LEVEL = 0.9
# Added to the largest level, in thousandths, before it is rounded down. It follows from a sum of
# fractions, and may be below its exact value by rounding.
ROUNDING = 1e-6
# Subtracted from a level before it is compared with sums of fractions, which may be below their
# exact value by rounding.
ROUNDING_OF_LEVEL = 1e-9
# Smallest probability with which a row of a new map or database is within the limit of the flag,
# if maps or databases decide this limit.
SHARE = 0.9
# Share of the training rows that are within the limit of the flag, if surfaces decide this limit.
INSIDE = 0.97

# Added to the variances of features that have deviation 1. Without it the covariance could be
# singular: some features nearly repeat another one, as roots do.
RIDGE = 1e-4
# Added to these variances, in place of `RIDGE`, if the rows of many maps are one cloud: maps differ
# in few directions.
RIDGE_OF_MAPS = 0.01


class Growth(NamedTuple):
    """The growth of errors with the distance from the training.

    The logarithm of the errors is linear in a power of the distance.
    """

    # errors at the limit of the flag, over errors in the middle of the training
    at_limit: float
    power: float  # exponent of the distance over the limit

    def at(self, distance: Values, limit: float) -> Values:
        """Return the factors by which errors have grown at distances from the training.

        Parameters
        ----------
        distance : ndarray, shape (n,)
            Distances from the training; NaN is taken for the limit.
        limit : float
            Limit of the flag. Errors do not grow beyond it.

        Returns
        -------
        ndarray, shape (n,)
            Errors over errors in the middle of the training, from 1 to `at_limit`.
        """
        # `fmin` returns the limit for NaN. The limit is 0 if all rows of the training are equal.
        share = np.fmin(distance, limit) / max(limit, np.finfo(float).tiny)
        exponent = share**self.power
        return np.asarray(self.at_limit**exponent)


# Chosen among the powers from 2 to 8 with 18 kinds of changed surfaces (peaks cut, skewed, waves
# added ...) and the first 23 kinds of `bench coverage`. With each power, intervals were made wide
# enough to contain the truth in 86 % of the rows of every kind. With the power 4 they then contain
# it in 94 % of all rows, the smallest share of all powers. With the power 2 it is 95 %, although
# intervals are a quarter narrower on these kinds.
GROWTH = Growth(at_limit=40.0, power=4.0)
# Weight of the penalty on the slopes of usual errors, for features of deviation 1 and a mean
# squared error. On the made maps of `bench scans`, widths with weights of 0.3 to 3 agree within
# 3 %.
SHRINKAGE = 1.0
# Smallest error in the fit of usual errors, over the median error; smaller ones are raised to it.
# Otherwise the large negative logarithms of errors near 0 would dominate the fit.
SMALLEST = 1e-3
# Quantiles of the fitted usual errors of the training rows, to which all usual errors are clipped.
ENDS = (0.02, 0.98)
# Largest deviation of a feature over its largest magnitude with which it is taken for constant.
CONSTANT = 1e-9


class Scores(NamedTuple):
    """Scores of rows that are grouped by surfaces, maps or databases: errors over usual errors."""

    errors: Values  # (n,), scores in ascending order
    # (n,), weight of each score: 1 over the number of rows in its group, so that groups weigh 1
    weights: Values

    @classmethod
    def of(cls, errors: Values, groups: Indices) -> Scores:
        """Sort scores, and weight them so that all groups have an equal weight.

        Parameters
        ----------
        errors : ndarray, shape (n,)
            Absolute errors over usual errors; or distances from the training.
        groups : ndarray, shape (n,)
            Number of the surface, map or database of each row.

        Returns
        -------
        Scores
            The scores with their weights.
        """
        order = np.argsort(errors, kind="stable")
        weights = 1.0 / _sizes_of_groups(groups)
        return cls(errors=errors[order], weights=weights[order])

    def quantile(self, level: float) -> float:
        """Return the score that a row of a new group does not exceed with a given probability.

        Each of the K groups has the weight 1 / (K + 1), shared by its rows. The new group has this
        weight too, and an infinite score (Lee, Barber, Willett (2023), section 3).

        Parameters
        ----------
        level : float
            The probability, between 0 and 1.

        Returns
        -------
        float
            The score; infinite if the level is above K / (K + 1).

        Raises
        ------
        InputError
            If the level is not between 0 and 1.
        """
        require_probability(level)
        # The weights of the K groups sum to K.
        reached = np.cumsum(self.weights) / (self.weights.sum() + 1)
        place = int(np.searchsorted(reached, level - ROUNDING_OF_LEVEL))
        if place == self.errors.size:
            return np.inf  # No score of the K groups reaches the level.
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
        If the level is not between 0 and 1.
    """
    if not 0 < level < 1:
        raise InputError(f"--interval {level:g}: give a coverage between 0 and 1, as 0.9")


def _sizes_of_groups(groups: Indices) -> Indices:
    """Return for each row the number of rows in its group, (n,), by the groups' numbers, (n,)."""
    _, group_of_row, sizes = np.unique(groups, return_inverse=True, return_counts=True)
    return np.asarray(sizes[group_of_row])


@dataclass(frozen=True, eq=False)
class ErrorScale:
    """Usual errors, whose logarithm is a linear or quadratic function of d features.

    The errors are in the unit of the errors that were fitted.
    """

    # change of the logarithm with each term: (d,) features, or (d (d + 3) / 2,) from `quadratic`
    slopes: Values
    offset: float  # logarithm where all features are 0
    low: float  # smallest logarithm; smaller ones are raised to it
    high: float  # largest logarithm; larger ones are lowered to it

    def at(self, inputs: Values) -> Values:
        """Return the usual errors of rows.

        Parameters
        ----------
        inputs : ndarray, shape (n, d)
            Features. A row with a NaN gets the largest usual error.

        Returns
        -------
        ndarray, shape (n,)
            Usual errors, in the unit of the errors that were fitted.
        """
        with np.errstate(over="ignore", invalid="ignore"):
            terms = inputs
            is_quadratic = self.slopes.size != inputs.shape[1]
            if is_quadratic:
                terms = quadratic(inputs)
            logarithm = terms @ self.slopes + self.offset
        logarithm[np.isnan(logarithm)] = self.high
        return np.asarray(np.exp(np.clip(logarithm, self.low, self.high)))


def quadratic(inputs: Values) -> Values:
    """Append the products of all pairs of features to the features.

    Parameters
    ----------
    inputs : ndarray, shape (n, d)
        Features.

    Returns
    -------
    ndarray, shape (n, d (d + 3) / 2)
        Features, then their squares and products, in the order of `np.triu_indices`.
    """
    first, second = np.triu_indices(inputs.shape[1])
    products = inputs[:, first] * inputs[:, second]
    return np.column_stack([inputs, products])


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
        Number of the surface, map or database of each row. All groups have an equal weight.
    shrinkage : float
        Weight of the penalty on the slopes, for features of deviation 1 and a mean squared error.

    Returns
    -------
    ErrorScale
        Usual errors, in the unit of the errors.
    """
    weights = 1.0 / (_sizes_of_groups(groups) * np.unique(groups).size)  # They sum to 1.
    # The bound is above 0 even if most errors are 0, so that all logarithms are finite.
    smallest = max(SMALLEST * float(np.median(errors)), np.finfo(float).tiny)
    logarithms = np.log(np.maximum(errors, smallest))
    centre = weights @ inputs
    mean = float(weights @ logarithms)
    differences = inputs - centre
    deviation = np.sqrt(weights @ differences**2)
    # Constant features keep a slope of 0.
    varying = deviation > CONSTANT * np.abs(inputs).max(axis=0)
    standardised = differences[:, varying] / deviation[varying]
    weighted = standardised * weights[:, None]
    penalty = shrinkage * np.eye(standardised.shape[1])
    matrix = weighted.T @ standardised + penalty
    coefficients = np.linalg.solve(matrix, weighted.T @ (logarithms - mean))
    slopes = np.zeros(inputs.shape[1])
    slopes[varying] = coefficients / deviation[varying]
    fitted = mean + standardised @ coefficients
    low, high = np.quantile(fitted, ENDS)
    return ErrorScale(
        slopes=slopes,
        offset=mean - float(centre @ slopes),
        low=float(low),
        high=float(high),
    )


class Nearest(NamedTuple):
    """The cloud of training rows that is nearest to each of n rows."""

    distance: Values  # (n,), distance from the mean of the nearest cloud
    cloud: Indices  # (n,), number of the nearest cloud


@dataclass(frozen=True, eq=False)
class Distance:
    """A measure of distances from k clouds of training rows.

    All training rows are one cloud, or the rows of each database or map are a cloud.
    """

    centres: Values  # (k, d), mean features of the clouds
    # (k, d, d), matrices that turn differences from the mean into uncorrelated numbers of
    # deviation 1
    whitenings: Values
    # largest distance of a row that is not flagged; infinite if distances flag no row
    limit: float

    def nearest(self, inputs: Values) -> Nearest:
        """Find the nearest cloud of each row.

        Parameters
        ----------
        inputs : ndarray, shape (n, d)
            Features.

        Returns
        -------
        Nearest
            Distance from the mean of the nearest cloud, NaN where a feature is NaN, and number of
            this cloud.
        """
        squares = np.empty((len(self.centres), len(inputs)))
        with np.errstate(over="ignore", invalid="ignore"):
            for cloud, centre in enumerate(self.centres):
                differences = (inputs - centre) @ self.whitenings[cloud]
                squares[cloud] = np.mean(differences**2, axis=1)
        return Nearest(
            distance=np.sqrt(squares.min(axis=0)), cloud=squares.argmin(axis=0)
        )

    def of(self, inputs: Values) -> Values:
        """Return the distance of each row from the training: from the mean of the nearest cloud.

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
    """The distances of some rows from the training."""

    training: Distance  # the measure of the surrogate, with the limit of the flag
    # Nearest cloud of each row. Training rows may be measured from rows of other parts only.
    nearest: Nearest


def distance_by_maps(inputs: Values, groups: Indices) -> Distance:
    """Make a measure of distances from training rows of many maps or databases.

    A row of a new map or database is within the limit with a probability of `SHARE` or more. To
    find the limit, each map or database is left out in turn and measured from the others.

    Parameters
    ----------
    inputs : ndarray, shape (n, d)
        Features of the training rows.
    groups : ndarray, shape (n,)
        Number of the map or database of each row.

    Returns
    -------
    Distance
        Distances from a single cloud of all training rows, with the limit.
    """
    distances = np.empty(len(inputs))
    for group in np.unique(groups):
        inside = groups == group
        without = _from_one_cloud(inputs[~inside])
        distances[inside] = without.of(inputs[inside])
    # A quantile of distances is taken as that of scores: all maps have an equal weight.
    limit = Scores.of(distances, groups).quantile(SHARE)
    return replace(_from_one_cloud(inputs), limit=limit)


def distance_by_other_maps(
    inputs: Values, other_inputs: Values, groups: Indices
) -> Distance:
    """Make a measure of distances from training rows, with a limit by rows of other maps.

    A row of a new map or database is within the limit with a probability of `SHARE` or more.

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
        Distances from a single cloud of the training rows, with the limit.
    """
    training = _from_one_cloud(inputs)
    limit = Scores.of(training.of(other_inputs), groups).quantile(SHARE)
    return replace(training, limit=limit)


def _from_one_cloud(inputs: Values) -> Distance:
    """Return the measure of distances from a single cloud of n rows, (n, d), without a limit."""
    one_label = np.zeros(len(inputs), dtype=np.int64)
    return _unlimited(inputs, one_label, ridge=RIDGE_OF_MAPS)


def rows_measured_by_surfaces(
    inputs: Values, clouds: Indices, parts: Indices
) -> MeasuredRows:
    """Measure training rows by their distance from the nearest cloud of rows of other surfaces.

    Surfaces are left out in parts. The limit of the flag is the distance that a share `INSIDE` of
    the training rows does not exceed.

    Parameters
    ----------
    inputs : ndarray, shape (n, d)
        Features of the training rows.
    clouds : ndarray, shape (n,)
        Number of the cloud of each row: 0, 1, ...
    parts : ndarray, shape (n,)
        Number of the part of each row; rows of one surface are in one part.

    Returns
    -------
    MeasuredRows
        The measure of distances from the clouds of all rows, with the limit; and for each row the
        nearest of the clouds of rows that are in other parts.
    """
    distances = np.empty(len(inputs))
    nearest = np.empty(len(inputs), dtype=np.int64)
    has_cloud = np.zeros(len(inputs), dtype=np.bool_)
    for part in np.unique(parts):
        inside = parts == part
        without_part = _unlimited(inputs[~inside], clouds[~inside])
        measured = without_part.nearest(inputs[inside])
        distances[inside] = measured.distance
        # A cloud with all its rows in this part is missing in `without_part`, which numbers the
        # remaining clouds 0, 1, ...: turn these numbers into those of all clouds.
        remaining = np.unique(clouds[~inside])
        nearest[inside] = remaining[measured.cloud]
        has_cloud[inside] = np.isin(clouds[inside], remaining)
    # Rows of a missing cloud were measured from another cloud. They do not decide the limit, unless
    # there are no other rows.
    if not has_cloud.any():
        has_cloud[:] = True
    limit = float(np.quantile(distances[has_cloud], INSIDE, method="higher"))
    training = replace(_unlimited(inputs, clouds), limit=limit)
    return MeasuredRows(
        training=training, nearest=Nearest(distance=distances, cloud=nearest)
    )


def _unlimited(inputs: Values, labels: Indices, ridge: float = RIDGE) -> Distance:
    """Return the measure of distances from clouds of rows, with an infinite limit.

    `inputs` are the features of n rows, (n, d), and `labels` their clouds, (n,): rows with equal
    labels are a cloud. Clouds are in the order of their labels. `ridge` is added to the variances
    of features, which are scaled to deviation 1.
    """
    features = inputs.shape[1]
    clouds = [inputs[labels == label] for label in np.unique(labels)]
    # A feature that is constant in every cloud has no effect on distances, as its scale is
    # infinite. Its training range flags other values.
    rounding = CONSTANT * np.abs(inputs).max(axis=0)
    varying = np.any([cloud.std(axis=0) > rounding for cloud in clouds], axis=0)
    scale = np.where(varying, inputs.std(axis=0), np.inf)
    means = []
    products = []  # of each cloud, (d, d): sums over rows of products of scaled differences
    for cloud in clouds:
        mean = cloud.mean(axis=0)
        differences = (cloud - mean) / scale
        means.append(mean)
        products.append(differences.T @ differences)
    mean_covariance = np.sum(products, axis=0) / len(inputs)
    whitenings = []
    for cloud, sums in zip(clouds, products, strict=True):
        # The mean covariance of all clouds weighs as much as d rows of this cloud.
        covariance = (sums + features * mean_covariance) / (len(cloud) + features)
        inverse = np.linalg.inv(covariance + ridge * np.eye(features))
        whitenings.append(np.linalg.cholesky(inverse) / scale[:, None])
    return Distance(
        centres=np.array(means), whitenings=np.array(whitenings), limit=np.inf
    )


@dataclass(frozen=True, eq=False)
class Calibration:
    """The numbers that the intervals of one target are computed from.

    Errors are those of the target over its scale, or of the square root of this if `root` is set.
    """

    # one entry for each cloud of `distance`; without a distance, one entry for all groups together
    scores: tuple[Scores, ...]
    usual: ErrorScale  # usual errors by the features, before they grow with the distance
    # measure of the distance that errors grow with; None for intervals that hold for other maps or
    # databases, or for a scene's own features: their errors do not grow with a distance
    distance: Distance | None = None
    root: bool = False  # True for errors of the square root of the target
    growth: Growth = GROWTH  # growth with the distance, if there is one

    @property
    def largest_level(self) -> float:
        """Largest level that all scores reach, rounded down to three digits; 0 without scores."""
        # The weights of the groups of one entry sum to the number of groups.
        numbers = [float(scores.weights.sum()) for scores in self.scores]
        fewest = min(numbers, default=0.0)
        thousandths = 1000 * fewest / (fewest + 1)
        return math.floor(thousandths + ROUNDING) / 1000

    def ends(
        self, prediction: Values, level: float, inputs: Values
    ) -> tuple[Values, Values]:
        """Return the ends of the intervals about predictions.

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
            Lower and upper ends, over the scale of the target. If too few surfaces or maps
            calibrate the level, both are infinite; if errors are those of roots, the lower end is
            then 0.

        Raises
        ------
        InputError
            If the level is not between 0 and 1.
        """
        half = self._half_widths(level, inputs)
        if not self.root:
            return prediction - half, prediction + half
        # Intervals of the root are squared.
        root = np.sqrt(np.maximum(prediction, 0.0))
        return np.maximum(root - half, 0.0) ** 2, (root + half) ** 2

    def _half_widths(self, level: float, inputs: Values) -> Values:
        """Return half the width of each interval, (n,), as an error of the target over its scale.

        If `root` is set, it is an error of the square root. `inputs` are the features of n rows,
        (n, d); `level` is between 0 and 1, otherwise InputError is raised.
        """
        quantiles = np.array([scores.quantile(level) for scores in self.scores])
        usual = self.usual.at(inputs)
        if self.distance is None:  # There is one entry of scores, and no growth.
            return np.asarray(usual * quantiles[0])
        distance, cloud = self.distance.nearest(inputs)
        growth = self.growth.at(distance, self.distance.limit)
        return np.asarray(usual * (quantiles[cloud] * growth))


def calibrated_by(card: Mapping[str, Any]) -> str:
    """Write the number and the kind of the groups that calibrate a surrogate's intervals.

    Parameters
    ----------
    card : mapping of str to object
        Card of the surrogate, with a "calibration".

    Returns
    -------
    str
        As "17 maps", or "the surfaces of 4 databases" if surfaces of each database calibrate.
    """
    entry = card["calibration"]
    groups = f"{entry['groups']} {entry['kind']}s"
    if entry["scheme"] == "each":
        return f"the surfaces of {groups}"
    return groups
