"""How far a row's features lie from those of the training: a flag of surfaces of another kind.

Each feature may lie within its range and all of them together may still be unlike any surface of
the training. The distance is Mahalanobis's, over the root of the number of features. Its limit is
the largest distance that intervals vouch for: each group is left out in turn, and a new row of a
group like these lies beyond the limit with a probability of 10 % at most. Where there are too few
groups to tell what others are like, it is the distance that 99 % of the training rows keep, each
measured from other rows: features depend on each other, and those of surfaces of another generator
do so in other ways.

A few databases are a few clouds of features with nothing between them: elastic bodies of one kind
of surface, bodies that yield of another. Distances are then measured from the nearest of them. Its
covariance is drawn towards the mean of all, as a database may have fewer rows than features (J. H.
Friedman (1989), J. Am. Stat. Assoc. 84, 165, regularised discriminant analysis).
"""

from dataclasses import dataclass, replace

import numpy as np

from learn.arrays import Indices, Values
from learn.surrogate.quantiles import quantile_over_groups

SHARE = 0.9
"""Share of the rows of a new group that lie within the limit, or more."""

INSIDE = 0.99
"""Share of the training rows that lie within the limit where groups do not decide it."""

RIDGE = 0.01
"""Added to the variances of features of deviation 1: features that repeat others, such as roots,
leave directions without any."""

CONSTANT = 1e-9
"""Deviation of a constant feature over its largest size, at most."""


@dataclass(frozen=True, eq=False)
class Distance:
    """Distances from the training, with their limit.

    Attributes
    ----------
    centres : ndarray, shape (k, d)
        Mean features of the training, or of each of its databases or maps.
    whitenings : ndarray, shape (k, d, d)
        For each, the matrix after which differences from the mean are uncorrelated.
    limit : float
        Largest distance that is not flagged.
    """

    centres: Values
    whitenings: Values
    limit: float

    def of(self, inputs: Values) -> Values:
        """Return the distance of each row, (n,), from the nearest mean, by its features, (n, d)."""
        nearest = np.full(len(inputs), np.inf)
        with np.errstate(over="ignore", invalid="ignore"):
            for centre, whitening in zip(self.centres, self.whitenings, strict=True):
                scaled = (inputs - centre) @ whitening
                nearest = np.minimum(nearest, np.sqrt(np.mean(scaled**2, axis=1)))
        return nearest

    def noted(self, inputs: Values, notes: tuple[str, ...]) -> tuple[str, ...]:
        """Add to notes how far rows lie outside the limit.

        Parameters
        ----------
        inputs : ndarray, shape (n, d)
            Features.
        notes : tuple of str
            Notes on the rows: n, or one for all, or none.

        Returns
        -------
        tuple of str
            n notes; "" for a row without any.
        """
        found = self.of(inputs)
        far = [
            f"distance from the training {each:.4g} outside 0 to {self.limit:.4g}" if beyond else ""
            for each, beyond in zip(found, found > self.limit, strict=True)
        ]
        given = notes if len(notes) == len(far) else (notes or ("",)) * len(far)
        return tuple("; ".join(filter(None, each)) for each in zip(given, far, strict=True))


def from_training(inputs: Values, groups: Indices) -> Distance:
    """Measure distances from training rows; the limit comes from groups that are left out.

    Parameters
    ----------
    inputs : ndarray, shape (n, d)
        Features of the training rows.
    groups : ndarray of int, shape (n,)
        Group of each row.
    """
    found = np.empty(len(inputs))
    for group in np.unique(groups):
        own = groups == group
        found[own] = _unlimited(inputs[~own]).of(inputs[own])
    return _limited(inputs, found, groups)


def from_others(inputs: Values, others: Values, groups: Indices) -> Distance:
    """Measure distances from training rows; the limit comes from other rows.

    Parameters
    ----------
    inputs : ndarray, shape (n, d)
        Features of the training rows.
    others : ndarray, shape (m, d)
        Features of the rows that calibrate.
    groups : ndarray of int, shape (m,)
        Groups of the latter.
    """
    return _limited(inputs, _unlimited(inputs).of(others), groups)


def from_rows(inputs: Values) -> Distance:
    """Measure distances from training rows; the limit comes from each row's from the others.

    With n rows the square of the distance from the others is (n - 1) a / (n - d a), where a is the
    square of the distance from all of them and d the number of features (Sherman and Morrison).

    Parameters
    ----------
    inputs : ndarray, shape (n, d)
        Features of two training rows or more.
    """
    whole, (rows, features) = _unlimited(inputs), inputs.shape
    squares = np.minimum(features * np.square(whole.of(inputs)), 0.999 * rows)
    others = np.sqrt((rows - 1) * squares / (rows - squares) / features)
    limit = float(np.quantile(others, INSIDE, method="higher"))
    return replace(whole, limit=limit)


def from_groups(inputs: Values, labels: Indices, parts: Indices) -> Distance:
    """Measure distances from the nearest group of the training rows, or from all if it is one.

    The limit comes from the distances of the rows of each part from the other parts.

    Parameters
    ----------
    inputs : ndarray, shape (n, d)
        Features of the training rows.
    labels : ndarray of int, shape (n,)
        Group of each row.
    parts : ndarray of int, shape (n,)
        Part of each row.
    """
    found = np.full(len(inputs), np.nan)
    for part in np.unique(parts):
        own = parts == part
        known = own & np.isin(labels, labels[~own])  # from groups that lie in several parts
        found[known] = _unlimited(inputs[~own], labels[~own]).of(inputs[known])
    if np.unique(labels).size < 2 or np.isnan(found).all():
        return from_rows(inputs)
    limit = float(np.nanquantile(found, INSIDE, method="higher"))
    return replace(_unlimited(inputs, labels), limit=limit)


def squares_from(inputs: Values, labels: Indices, unseen: Indices, mine: Indices) -> Values:
    """Return the squared distances of some rows from training rows that a model has seen.

    Parameters
    ----------
    inputs : ndarray, shape (n, d)
        Features of the training rows.
    labels : ndarray of int, shape (n,)
        Group of each row.
    unseen, mine : ndarray of int
        Rows that the model has not seen, and those whose distances are asked for.
    """
    seen = _unlimited(np.delete(inputs, unseen, axis=0), np.delete(labels, unseen))
    return np.square(seen.of(inputs[mine]))


def _limited(inputs: Values, found: Values, groups: Indices) -> Distance:
    _, place = np.unique(groups, return_inverse=True)
    scores = tuple(np.sort(found[place == each]) for each in range(int(place.max()) + 1))
    return replace(_unlimited(inputs), limit=quantile_over_groups(scores, SHARE))


def _unlimited(inputs: Values, labels: Indices | None = None) -> Distance:
    """Return the distances from some rows, or from the nearest of their groups, without a limit."""
    labels = np.zeros(len(inputs), dtype=np.int64) if labels is None else labels
    centre, deviation = inputs.mean(axis=0), inputs.std(axis=0)
    groups = [inputs[labels == label] for label in np.unique(labels)]
    # A new value of a feature that is constant, in every group, is flagged by its range.
    least = CONSTANT * np.abs(inputs).max(axis=0)
    varying = np.any([own.std(axis=0) > least for own in groups], axis=0)
    scale = np.where(varying, deviation, np.inf)
    means = [own.mean(axis=0) for own in groups]
    squares = [_products((own - mean) / scale) for own, mean in zip(groups, means, strict=True)]
    features, shared = centre.size, np.sum(squares, axis=0) / len(inputs)
    whitenings = []
    for own, products in zip(groups, squares, strict=True):
        covariance = (products + features * shared) / (len(own) + features)
        inverse = np.linalg.inv(covariance + RIDGE * np.eye(features))
        whitenings.append(np.linalg.cholesky(inverse) / scale[:, None])
    return Distance(np.array(means), np.array(whitenings), np.inf)


def _products(unit: Values) -> Values:
    """Return the sums of the products of columns, (d, d)."""
    return np.asarray(unit.T @ unit)
