"""Ranges of the features that a training covers, and the flag of values beyond them.

Areas and pressures follow about powers of the features of a surface. A value that is a few per cent
beyond the end of its range changes them by a few per cent, however narrow the range is. Values are
therefore flagged only if they are beyond a margin that is relative to the value.
"""

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Values

MARGIN = 0.05
"""Margin within which a value beyond its range is not flagged, over the largest magnitude in the
range [1]."""


def margins(low: Values, high: Values, is_logarithm: NDArray[np.bool_]) -> Values:
    """Return how far beyond its range each feature is not flagged.

    Parameters
    ----------
    low, high : ndarray, shape (d,)
        Smallest and largest value of each feature in the training.
    is_logarithm : ndarray of bool, shape (d,)
        Whether a feature is a natural logarithm. A margin that is relative to the number itself is
        then one that is added to its logarithm.

    Returns
    -------
    ndarray, shape (d,)
        Margins, in the units of the features: `MARGIN` times the largest magnitude of the range,
        or log(1 + `MARGIN`) for a logarithm.
    """
    largest = np.maximum(np.abs(low), np.abs(high))
    return np.where(is_logarithm, np.log1p(MARGIN), MARGIN * largest)


def outside(
    values: Values, low: Values, high: Values, margin: Values
) -> NDArray[np.bool_]:
    """Tell which values are beyond their range and its margin.

    Parameters
    ----------
    values : ndarray, shape (n, d)
        Features of n rows.
    low, high : ndarray, shape (d,)
        Smallest and largest value of each feature in the training.
    margin : ndarray, shape (d,)
        Margin of each feature, from `margins`; 0 for a feature without one.

    Returns
    -------
    ndarray of bool, shape (n, d)
        True for values that are flagged. NaN is not flagged.
    """
    return np.asarray((values < low - margin) | (values > high + margin))
