"""Intervals of predictions, and the flag of rows where they do not hold.

Intervals are conformal: as wide as the errors of models that have not seen a row's surface, map or
database (`learn.surrogate.calibration`). An error over the size that is usual at its place is a
score; a quantile of the scores times the usual size is half the width of an interval. The usual
size is the product of two (normalised conformal prediction: J. Lei et al. (2018), J. Am. Stat.
Assoc. 113, 1094, section 5.2):

- an `ErrorScale` of the features: errors on windows of turned surfaces are two to three times as
  large as on isotropic ones;
- a growth with the distance from the training, the same for all fits (`GROWTH`). Kinds of surfaces
  that a training lacks lie further out, within the limit of the flag, where errors are larger; by
  how much no row of the training tells.

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

The flag names rows that are unlike the training: their features, distance, grid or hardness. Each
feature may lie within its range, and all of them together far from any surface of the training. The
distance is Mahalanobis's, over the root of the number of features. Its limit is the distance that
97 % of the training rows keep, each measured from rows of other surfaces. Where there are many maps
or databases, each is left out in turn, and a new row of one like these lies beyond the limit with a
probability of 10 % at most.

A few databases are a few clouds of features with nothing between them: elastic bodies of one kind
of surface, bodies that yield of another. Distances are then measured from the nearest of them. Its
covariance is drawn towards the mean of all, as a database may have fewer rows than features (J. H.
Friedman (1989), J. Am. Stat. Assoc. 84, 165, regularised discriminant analysis).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from bem.problem import node_spacing
from gen.arrays import Indices, Values
from gen.runtime.errors import InputError
from learn.features.columns import NODES
from learn.features.rows import Rows

if TYPE_CHECKING:
    from learn.surrogate.model import Surrogate

USUAL_LEVEL = 0.9  # of intervals, where nobody asks for another one and it is reached
ROUNDING = 1e-6  # of levels in thousandths, whose weights are sums of fractions
SHARE = (
    0.9  # share of the rows of a new map or database that lie within the limit, or more
)
INSIDE = 0.97  # share of the training rows within the limit, unless maps or databases decide it

# added to the variances of features of deviation 1: some repeat others, as roots do
RIDGE = 1e-4
RIDGE_OF_MAPS = (
    0.01  # the same where maps are one cloud: few directions tell one from another
)
SAME = 1e-6  # relative distance from the training's hardness within which two are equal


class Growth(NamedTuple):
    """How errors grow with the distance from the training."""

    most: (
        float  # errors at the limit of the flag, over those in the middle of the training
    )
    power: float  # of the distance, in which the logarithm of the errors is linear

    def at(self, far: Values, limit: float) -> Values:
        """Return the size of errors, (n,), at distances, over that in the middle of the training.

        Beyond the limit of the flag errors are taken for no larger than at the limit.
        """
        inside = np.fmin(far, limit) / max(limit, np.finfo(float).tiny)
        return np.asarray(self.most**inside**self.power)


# Chosen with 18 kinds of surfaces that were changed in ways of their own (peaks cut, skewed, waves
# added ...) and the first 23 of `bench coverage`: of the second to the eighth power, the one that
# needs the smallest share of rows inside over all kinds to have 86 % of each of them inside. By the
# square, which needs 95 % instead of 94, intervals are a quarter narrower on these kinds.
GROWTH = Growth(40.0, 4.0)
# weight of the penalty on the slopes of usual errors, for features of deviation 1 and a mean
# squared error; on the made maps of `bench scans`, 0.3 to 3 give the same widths within 3 %
SHRINKAGE = 1.0
SMALLEST = (
    1e-3  # least error that counts, over the median: logarithms near 0 would weigh most
)
ENDS = (0.02, 0.98)  # quantiles of the usual errors beyond which none is extrapolated
CONSTANT = 1e-9  # deviation of a constant feature over its largest size, at most


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
            raise InputError(
                f"--interval {level:g}: give a coverage between 0 and 1, as 0.9"
            )
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
class Distance:
    """Distances from the training of d features, or from the nearest of its k databases or maps."""

    centres: Values  # (k, d), mean features
    whitenings: (
        Values  # (k, d, d), after which differences from the mean are uncorrelated
    )
    limit: float  # largest distance that is not flagged

    def measured(self, inputs: Values) -> tuple[Values, Indices]:
        """Return the distance of rows from the nearest mean and its number, (n,), by (n, d)."""
        squares = np.full((len(self.centres), len(inputs)), np.inf)
        with np.errstate(over="ignore", invalid="ignore"):
            for own, centre, whitening in zip(
                squares, self.centres, self.whitenings, strict=True
            ):
                own[:] = np.mean(((inputs - centre) @ whitening) ** 2, axis=1)
        return np.sqrt(squares.min(axis=0)), squares.argmin(axis=0)

    def of(self, inputs: Values) -> Values:
        """Return the distance of each row, (n,), from the nearest mean, by its features, (n, d)."""
        return self.measured(inputs)[0]


def from_maps(inputs: Values, groups: Indices, others: Values | None = None) -> Distance:
    """Measure distances from rows, (n, d), with the limit that a new map or database keeps.

    Each of the groups of the rows, (n,), is left out in turn, or they are those of other rows,
    (m, d), from the training.
    """
    whole = _unlimited(inputs, ridge=RIDGE_OF_MAPS)
    if others is not None:
        found = whole.of(others)
    else:
        found = np.empty(len(inputs))
        for group in np.unique(groups):
            own = groups == group
            found[own] = _unlimited(inputs[~own], ridge=RIDGE_OF_MAPS).of(inputs[own])
    return replace(whole, limit=Scores.of(found, groups).quantile(SHARE))


def from_surfaces(
    inputs: Values, clouds: Indices, parts: Indices
) -> tuple[Distance, Values, Indices]:
    """Measure distances from the nearest cloud of rows, (n, d), with a limit that most rows keep.

    Clouds, (n,), are numbered from 0 on. Also return the distance of each row from the rows of
    other parts, (n,), and the number of the nearest cloud.
    """
    far, nearest = np.empty(len(inputs)), np.empty(len(inputs), dtype=np.int64)
    known = np.zeros(len(inputs), dtype=np.bool_)
    for part in np.unique(parts):
        own = parts == part
        seen = np.unique(clouds[~own])
        far[own], places = _unlimited(inputs[~own], clouds[~own]).measured(inputs[own])
        nearest[own] = seen[places]
        known[own] = np.isin(clouds[own], seen)
    # A cloud of which no other part has rows says nothing about the distance from its own.
    limit = float(
        np.quantile(far[known] if known.any() else far, INSIDE, method="higher")
    )
    return replace(_unlimited(inputs, clouds), limit=limit), far, nearest


def _unlimited(
    inputs: Values, labels: Indices | None = None, ridge: float = RIDGE
) -> Distance:
    """Return the distances from some rows, or from the nearest of their groups, without a limit."""
    labels = np.zeros(len(inputs), dtype=np.int64) if labels is None else labels
    features, deviation = inputs.shape[1], inputs.std(axis=0)
    groups = [inputs[labels == label] for label in np.unique(labels)]
    # A new value of a feature that is constant, in every group, is flagged by its range.
    least = CONSTANT * np.abs(inputs).max(axis=0)
    varying = np.any([own.std(axis=0) > least for own in groups], axis=0)
    scale = np.where(varying, deviation, np.inf)
    means = [own.mean(axis=0) for own in groups]
    units = [(own - mean) / scale for own, mean in zip(groups, means, strict=True)]
    squares = [unit.T @ unit for unit in units]
    shared = np.sum(squares, axis=0) / len(inputs)
    whitenings = []
    for own, products in zip(groups, squares, strict=True):
        covariance = (products + features * shared) / (len(own) + features)
        inverse = np.linalg.inv(covariance + ridge * np.eye(features))
        whitenings.append(np.linalg.cholesky(inverse) / scale[:, None])
    return Distance(np.array(means), np.array(whitenings), np.inf)


@dataclass(frozen=True, eq=False)
class Calibration:
    """Scores that intervals of one target over its scale are computed from."""

    scores: tuple[
        Scores, ...
    ]  # of each of the distance's clouds; or of all maps together
    usual: ErrorScale  # size of the errors by the features; scores are over it and over the growth
    distance: Distance | None = (
        None  # with which errors grow; None for intervals by whole maps
    )
    root: bool = False  # True for errors of the square root of the target
    growth: Growth = GROWTH

    @property
    def largest_level(self) -> float:
        """Largest level, rounded down to three digits, that the fewest surfaces or maps reach."""
        fewest = min((float(each.weights.sum()) for each in self.scores), default=0.0)
        return math.floor(1000 * fewest / (fewest + 1) + ROUNDING) / 1000

    def ends(
        self, prediction: Values, level: float, inputs: Values
    ) -> tuple[Values, Values]:
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
        if all(np.isfinite(scores.quantile(level)) for scores in each.calibration.scores):
            continue
        raise InputError(
            f"--interval {level:g}: intervals of {name} are calibrated by"
            f" {calibrated_by(surrogate.card)}, which reach {each.calibration.largest_level:g} at"
            " most: give less, or fit to more of them"
        )


def level_of(surrogate: Surrogate, asked: float | None, *, mean: bool = False) -> float:
    """Return the level of the intervals that a question gets.

    Parameters
    ----------
    surrogate : Surrogate
        The surrogate that is asked.
    asked : float or None
        The level that the user wants; None for `USUAL_LEVEL`, or the largest that holds below.
    mean : bool
        True for intervals of the mean over surfaces, which no rows calibrate: any level holds.

    Returns
    -------
    float
        A level that holds, between 0 and 1.

    Raises
    ------
    InputError
        If the level is not between 0 and 1, or too few surfaces or maps calibrate it.
    """
    level = asked
    if level is None:
        level = USUAL_LEVEL if mean else min(USUAL_LEVEL, surrogate.largest_level)
    if mean and not 0 < level < 1:
        raise InputError(f"--interval {level:g}: give a coverage between 0 and 1, as 0.9")
    if not mean:
        require_level(surrogate, level)
    return level


def level_note(surrogate: Surrogate, level: float, asked: float | None) -> str:
    """Tell the level of intervals where it is below the usual one and nobody asked for it."""
    if asked is not None or level >= USUAL_LEVEL:
        return ""
    return (
        f"intervals of {100 * level:g} %: {calibrated_by(surrogate.card)} calibrate them and reach"
        f" no more; for {100 * USUAL_LEVEL:g} % fit to more of them"
    )


def reasons_of(surrogate: Surrogate, rows: Rows, inputs: Values) -> list[str]:
    """Return why each row, with features (n, d), is outside the training; "" if it is inside.

    The rows' own notes stand first, then the grid, the hardness, the distance and the features.
    """
    features, number, found = (
        surrogate.features,
        len(inputs),
        [list[str]() for _ in inputs],
    )
    grids = {grid: grid_note(surrogate, *grid) for grid in set(rows.grids)}
    for notes in (rows.notes, [grids[grid] for grid in rows.grids]):
        for said, note in zip(
            found, [*notes] * number if len(notes) == 1 else notes, strict=False
        ):
            said.append(note)
    if surrogate.hardness_limits is not None and rows.hardness_ratio is not None:
        low, high = surrogate.hardness_limits
        high = np.inf if features.elastic else high  # elastic bodies are very hard ones
        for row, ratio in enumerate(
            np.broadcast_to(rows.hardness_ratio, number).tolist()
        ):
            if not low * (1 - SAME) <= ratio <= high * (1 + SAME):
                found[row].append(
                    f"hardness/E* {ratio:.4g} outside {low:.4g} to {high:.4g}"
                )
    far, limit = surrogate.distance.measured(inputs)[0], surrogate.distance.limit
    outside = (inputs < surrogate.low) | (inputs > surrogate.high)
    told, names = [inputs, surrogate.low, surrogate.high], features.names
    told = [features.shown(each) for each in told]  # without logarithms of scenes
    values, least, most = told
    for row in np.flatnonzero(outside.any(axis=1) | (far > limit)).tolist():
        if far[row] > limit:
            text = f"distance from the training {far[row]:.4g} outside 0 to {limit:.4g}"
            found[row].append(text)
        found[row] += [
            f"{names[place]} {values[row, place]:.4g} outside {least[place]:.4g} to"
            f" {most[place]:.4g}"
            for place in np.flatnonzero(outside[row])
        ]
    return ["; ".join(filter(None, each)) for each in found]


def grid_note(
    surrogate: Surrogate, shape: tuple[int, ...], sides: tuple[float, ...]
) -> str:
    """Return how a grid differs from the training's; "" if it does not.

    It has nodes along both axes and sides [um]. Features with units bind the surrogate to its side
    and spacing.
    """
    said, card, features = [], surrogate.card, surrogate.features
    grids = list(
        dict.fromkeys(tuple(each["nodes"]) for each in card.get("databases", [card]))
    )
    if shape not in grids and NODES not in features.columns:
        trained = ", ".join(f"{nodes[0]:g} x {nodes[1]:g}" for nodes in grids)
        said.append(f"{shape[0]} x {shape[1]} nodes, trained on {trained}")
    own = card["side"]
    if not np.isclose(sides[0] * own[1], sides[1] * own[0], rtol=1e-3):
        trained = (
            "square patches" if own[0] == own[1] else f"{own[0]:.6g} x {own[1]:.6g} um"
        )
        said.append(f"{sides[0]:.6g} x {sides[1]:.6g} um, trained on {trained}")
    elif not features.scaled and not np.isclose(sides[0], own[0], rtol=1e-3):
        said.append(f"side {sides[0]:.6g} um, trained on {own[0]:.6g} um")
    if (
        features.scaled or NODES in features.columns
    ):  # whose nodes are in their range or not
        return "; ".join(said)
    for nodes, side, usual in zip(shape, sides, card["spacing"], strict=True):
        spacing = node_spacing(max(nodes, 2), side, surrogate.boundary)
        if not np.isclose(spacing, usual, rtol=0.02):
            said.append(f"spacing {spacing:.4g} um, trained on {usual:.4g} um")
            break
    return "; ".join(said)


def between(limits: tuple[float, float]) -> str:
    """Describe a range of the hardness over E*: "0.003 to 0.1", or "0.01" for a fixed one."""
    low, high = limits
    return f"{low:.4g}" if low == high else f"{low:.4g} to {high:.4g}"
