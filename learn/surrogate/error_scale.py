"""The usual size of a model's errors at a place of its inputs.

Errors differ between kinds of surfaces: on windows of turned surfaces they are two to three times
as large as on isotropic ones. Scores that are divided by their usual size make intervals as wide as
the errors are at that place (normalised conformal prediction: J. Lei et al. (2018), J. Am. Stat.
Assoc. 113, 1094, section 5.2).
"""

from dataclasses import dataclass

import numpy as np

from learn.arrays import Indices, Values

SHRINKAGE = 1.0
"""Weight of the penalty on the slopes, for features of deviation 1 and a mean squared error. On the
made maps of `bench scans`, 0.3 to 3 give the same widths of the intervals within 3 %."""

SMALLEST = 1e-3
"""Smallest error that counts, over the median: logarithms of errors near 0 would weigh most."""

ENDS = (0.02, 0.98)
"""Quantiles of the sizes at known places, beyond which no size is extrapolated."""

CONSTANT = 1e-9
"""Deviation of a constant feature over its largest size, at most."""


@dataclass(frozen=True, eq=False)
class ErrorScale:
    """Usual errors, whose logarithm is linear in the features.

    Attributes
    ----------
    slopes : ndarray, shape (d,)
        Change of the logarithm with each feature.
    offset : float
        Logarithm where all features are 0.
    low, high : float
        Ends of the logarithm.
    """

    slopes: Values
    offset: float
    low: float
    high: float

    def at(self, inputs: Values) -> Values:
        """Return the usual errors, (n,), at the features, (n, d)."""
        with np.errstate(over="ignore", invalid="ignore"):
            logarithm = inputs @ self.slopes + self.offset
        logarithm[np.isnan(logarithm)] = self.high
        return np.asarray(np.exp(np.clip(logarithm, self.low, self.high)))


def fit_scale(inputs: Values, errors: Values, groups: Indices) -> ErrorScale:
    """Fit the usual errors by ridge regression of their logarithms; all groups weigh the same.

    Parameters
    ----------
    inputs : ndarray, shape (n, d)
        Features.
    errors : ndarray, shape (n,)
        Absolute errors of predictions by models that have not seen these rows.
    groups : ndarray of int, shape (n,)
        Group of each row.
    """
    _, place, sizes = np.unique(groups, return_inverse=True, return_counts=True)
    weights = 1.0 / (sizes[place] * sizes.size)
    logarithms = floored_logarithm(errors)
    centre, mean = weights @ inputs, float(weights @ logarithms)
    offset = inputs - centre
    deviation = np.sqrt(weights @ offset**2)
    varying = deviation > CONSTANT * np.abs(inputs).max(axis=0)
    unit = offset[:, varying] / deviation[varying]
    weighted = unit * weights[:, None]
    matrix = weighted.T @ unit + SHRINKAGE * np.eye(unit.shape[1])
    found = np.linalg.solve(matrix, weighted.T @ (logarithms - mean))
    slopes = np.zeros(inputs.shape[1])
    slopes[varying] = found / deviation[varying]
    low, high = np.quantile(mean + unit @ found, ENDS)
    return ErrorScale(slopes, mean - float(centre @ slopes), float(low), float(high))


def floored_logarithm(errors: Values) -> Values:
    """Return the logarithms of absolute errors, each of them `SMALLEST` at least."""
    least = max(SMALLEST * float(np.median(errors)), np.finfo(float).tiny)
    return np.asarray(np.log(np.maximum(errors, least)))
