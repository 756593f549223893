"""The error of a surrogate on test rows, its standard error, and a bound on it."""

import math
from typing import NamedTuple

import numpy as np

from learn.arrays import Indices, Values


class Accuracy(NamedTuple):
    """Error of a surrogate, estimated on test rows.

    Attributes
    ----------
    nmae : float
        Mean absolute error over the mean magnitude of the truth [%].
    error : float
        Standard error of that estimate, infinite if there is a single group [%].
    groups : int
        Number of surfaces, or tiles of maps, that the rows are of.
    """

    nmae: float
    error: float
    groups: int

    def bound(self, risk: float) -> float:
        """Return a number that the surrogate's error exceeds with a small probability only [%].

        It is nMAE exp(t SE / nMAE) with Student's t. On the logarithm's scale the skewness of
        absolute errors matters little: nMAE + t SE fails several times as often as it may.

        Parameters
        ----------
        risk : float
            That probability.
        """
        if self.nmae == 0.0:
            return 0.0
        if self.groups < 2:
            return math.inf
        relative = quantile(risk, self.groups) * self.error / self.nmae
        return self.nmae * math.exp(min(relative, 700.0))


def quantile(risk: float, groups: int) -> float:
    """Return the value that Student's t of `groups` - 1 degrees exceeds with a probability."""
    from scipy.stats import t

    return float(t.ppf(1.0 - risk, groups - 1))


def accuracy(errors: Values, truth: Values, groups: Indices) -> Accuracy:
    """Estimate a surrogate's error from test rows.

    Parameters
    ----------
    errors : ndarray, shape (n,)
        Absolute errors.
    truth : ndarray, shape (n,)
        Solved values, not all of them 0.
    groups : ndarray of int, shape (n,)
        Surface or tile of each row; rows of one group are not independent.

    Returns
    -------
    Accuracy
        The ratio of both means; its standard error is linearised, and that of whole groups.

    Source: W. G. Cochran (1977), Sampling Techniques, sections 2.11 and 9A.
    """
    wrong, true = summed(errors, groups), summed(np.abs(truth), groups)
    ratio, number = float(wrong.sum() / true.sum()), wrong.size
    if number < 2:
        return Accuracy(100 * ratio, math.inf, number)
    squares = float(np.sum((wrong - ratio * true) ** 2))
    error = math.sqrt(number / (number - 1) * squares) / float(true.sum())
    return Accuracy(100 * ratio, 100 * error, number)


def summed(values: Values, groups: Indices) -> Values:
    """Add up the values of each group, in the order of their numbers; shape (groups,)."""
    _, place = np.unique(groups, return_inverse=True)
    return np.asarray(np.bincount(place.ravel(), weights=values), dtype=np.float64)
