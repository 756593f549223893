"""How errors grow with the distance from the training, where all rows are of one population.

Intervals that are calibrated on rows drawn at random are as wide as errors are in the midst of the
training, where most of these rows lie. Surfaces of another kind lie further out, within the limit
of the flag, and their errors are larger. How much larger is learnt from the training itself: it is
cut into clusters, and each is predicted by a model of the others, from which it lies as far away as
surfaces of another kind do. The logarithm of the errors is taken to be linear in the squared
distance, which is the leverage of a row. Scores over this growth make intervals that widen with the
distance (normalised conformal prediction: J. Lei et al. (2018), J. Am. Stat. Assoc. 113, 1094,
section 5.2).
"""

from dataclasses import dataclass

import numpy as np

from learn.arrays import Indices, Values
from learn.dataset import Dataset
from learn.surrogate.distance import Distance
from learn.surrogate.error_scale import floored_logarithm

CLUSTERS = 10
"""Number of clusters of surfaces. Fewer and larger ones reach beyond the limit of the flag, where
no row counts; many and small ones lie in the midst of the others."""

FEWEST = 200
"""Smallest number of surfaces, or tiles, of a training that is cut into clusters."""

SPREAD = 1.0
"""Deviation that is expected of the logarithm's growth from the centre to the limit, before any
error is seen: few rows, which cannot tell, then leave the growth near 0."""


@dataclass(frozen=True, eq=False)
class Growth:
    """Errors that grow with the distance from the training.

    Attributes
    ----------
    distance : Distance
        Distances from the training.
    rate : float
        Change of the logarithm of the errors with the squared distance, 0 or more.
    """

    distance: Distance
    rate: float

    def at(self, inputs: Values) -> Values:
        """Return the errors' size, (n,), at the features, (n, d), over that at the distance 1.

        The root mean square of the training's distances is about 1. Beyond the limit of the flag
        errors are taken for no larger than at the limit: no row there counts for the rate.
        """
        return self.of_squares(np.square(self.distance.of(inputs)))

    def of_squares(self, squares: Values) -> Values:
        """Return the errors' size, (n,), at squared distances, (n,); see `at`."""
        return np.asarray(np.exp(self.rate * (np.fmin(squares, self.distance.limit**2) - 1.0)))


def clusters_of(rows: Dataset) -> Indices | None:
    """Return the cluster of each row, (n,), by k-means; None if there are too few surfaces.

    Rows of one surface, or tile, are of one cluster: that of their mean features.
    """
    _, place, sizes = np.unique(rows.groups, return_inverse=True, return_counts=True)
    if sizes.size < FEWEST:
        return None
    from sklearn.cluster import KMeans

    deviation = rows.inputs.std(axis=0)
    scaled = (rows.inputs - rows.inputs.mean(axis=0)) / np.where(deviation > 0, deviation, 1.0)
    means = np.zeros((sizes.size, scaled.shape[1]))
    np.add.at(means, place, scaled)
    found = KMeans(CLUSTERS, n_init=3, random_state=0).fit_predict(means / sizes[:, None])
    return np.asarray(found[place], dtype=np.int64)


def fit_growth(distance: Distance, squares: Values, errors: Values, kinds: Indices) -> Growth:
    """Fit the rate at which errors grow, by the rows within the limit of the flag.

    Parameters
    ----------
    distance : Distance
        Distances from the training.
    squares : ndarray, shape (n,)
        Squared distances of rows from those that their model was fitted to.
    errors : ndarray, shape (n,)
        Absolute errors of these rows.
    kinds : ndarray of int, shape (n,)
        Kind of each row, by its group and the range of its prediction: errors differ between these
        at the same distance, so that rows are compared with those of the same kind.
    """
    inside = squares <= distance.limit**2
    logarithms, place = floored_logarithm(errors)[inside], kinds[inside]
    if np.unique(place).size == place.size:  # none is of the same kind as another
        return Growth(distance, 0.0)
    offset, grown = _centred(squares[inside], place), _centred(logarithms, place)
    penalty = float(np.var(logarithms)) * (distance.limit**2 / SPREAD) ** 2
    rate = float(offset @ grown) / max(float(offset @ offset) + penalty, np.finfo(float).tiny)
    return Growth(distance, max(rate, 0.0))


def _centred(values: Values, place: Indices) -> Values:
    """Subtract from each value the mean of its kind."""
    sums, sizes = np.bincount(place, values), np.bincount(place)
    return np.asarray(values - (sums / np.maximum(sizes, 1))[place])
