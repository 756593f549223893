"""How far a row's features lie from those of the training: a flag of surfaces of another kind.

Each feature may lie within its range and all of them together may still be unlike any surface of
the training. The distance is Mahalanobis's, over the root of the number of features. Its limit is
the largest distance that intervals vouch for: each group is left out in turn, and a new row of a
group like these lies beyond the limit with a probability of 10 % at most. Where there are too few
groups to tell what others are like, it is the distance that 99 % of the training rows keep, each
measured from the others: features depend on each other, and those of surfaces of another generator
do so in other ways.
"""

from dataclasses import dataclass

import numpy as np

from learn.arrays import Indices, Values
from learn.surrogate.conformal import quantile_over_groups

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
    centre : ndarray, shape (d,)
        Mean of the training's features.
    whitening : ndarray, shape (d, d)
        Matrix after which differences from the mean are uncorrelated.
    limit : float
        Largest distance that is not flagged.
    """

    centre: Values
    whitening: Values
    limit: float

    def of(self, inputs: Values) -> Values:
        """Return the distance of each row, (n,), from its features, (n, d)."""
        with np.errstate(over="ignore", invalid="ignore"):
            apart = (inputs - self.centre) @ self.whitening
            return np.asarray(np.sqrt(np.mean(apart**2, axis=1)))

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
    return Distance(whole.centre, whole.whitening, limit)


def _limited(inputs: Values, found: Values, groups: Indices) -> Distance:
    whole = _unlimited(inputs)
    _, place = np.unique(groups, return_inverse=True)
    scores = tuple(np.sort(found[place == each]) for each in range(int(place.max()) + 1))
    return Distance(whole.centre, whole.whitening, quantile_over_groups(scores, SHARE))


def _unlimited(inputs: Values) -> Distance:
    """Return the distances from some rows without a limit."""
    centre, deviation = inputs.mean(axis=0), inputs.std(axis=0)
    # A new value of a feature that is constant is flagged by its range.
    varying = deviation > CONSTANT * np.abs(inputs).max(axis=0)
    scale = np.where(varying, deviation, np.inf)
    unit = (inputs - centre) / scale
    covariance = unit.T @ unit / len(unit) + RIDGE * np.eye(unit.shape[1])
    lower = np.linalg.cholesky(np.linalg.inv(covariance))
    return Distance(centre, lower / scale[:, None], np.inf)
