"""Skewness and kurtosis beyond the training's: models see the nearest value of the training.

Moments of third and fourth order have heavy tails. A window of a honed map with a groove at its
border may have a kurtosis of its peaks forty deviations from the mean. A radial basis function of
long reach extrapolates like a polynomial there, and a few rows of this kind have had most of the
squared error of all rows (`bench scans`). How large a moment is beyond those of the training
decides little about the contact, so that the end of its range is a better input. The other features
are left as they are: areas and forces of the coarse solve tell most where they are extrapolated.

Flags see the moments as they are, and predictions for other rows do not change.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from learn.arrays import Values
from learn.features.sets import PURE

MOMENTS = frozenset(name for name in PURE if "skewness" in name or "kurtosis" in name)
"""The features that are clipped to their training ranges."""


@dataclass(frozen=True, eq=False)
class Clipped:
    """Ranges that features are clipped to.

    Attributes
    ----------
    low, high : ndarray, shape (d,)
        Ends of the ranges, infinite for features that are not clipped.
    """

    low: Values
    high: Values

    def of(self, inputs: Values) -> Values:
        """Return the features that a model sees, (n, d), of the features of n rows."""
        return np.clip(inputs, self.low, self.high)


def clipped(columns: Sequence[str], low: Values, high: Values) -> Clipped:
    """Clip the moments among some features to their training ranges.

    Parameters
    ----------
    columns : sequence of str
        Names of the d features.
    low, high : ndarray, shape (d,)
        Training ranges of the features.
    """
    moment = np.array([name in MOMENTS for name in columns])
    return Clipped(np.where(moment, low, -np.inf), np.where(moment, high, np.inf))
