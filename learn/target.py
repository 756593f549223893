"""The scale on which models see their target."""

import math
from dataclasses import dataclass

import numpy as np

from learn.arrays import Indices, Values
from learn.dataset import Dataset
from learn.features import chosen
from learn.metrics import usual_size


@dataclass(frozen=True)
class Scaling:
    """A map of the target: models are trained on (target - mean) / deviation, or on its root's.

    Where the features are free of units, and for Gaussian processes of surrogates, mean and
    deviation are those of the training rows. Elsewhere they are 0 and 1: the paper trains on areas
    as they are. Targets of another size are brought to an area's by a power of two, since splits of
    trees, tubes of support vectors and steps of perceptrons have absolute thresholds.

    Attributes
    ----------
    mean, deviation : float
        Zero and unit of the scale, in the target's unit or that of its square root.
    root : bool
        True if models are trained on (sqrt(target) - mean) / deviation.
    """

    mean: float = 0.0
    deviation: float = 1.0
    root: bool = False

    def scaled(self, target: Values) -> Values:
        """Return the values that a model is trained on.

        Parameters
        ----------
        target : ndarray, shape (n,)
            Targets.
        """
        values = np.sqrt(target) if self.root else target
        return (values - self.mean) / self.deviation

    def restored(self, predicted: Values) -> Values:
        """Return targets from a model's predictions.

        Parameters
        ----------
        predicted : ndarray, shape (n,)
            Predictions on the scale of the training.
        """
        values = self.mean + self.deviation * np.asarray(predicted, dtype=np.float64)
        return np.maximum(values, 0.0) ** 2 if self.root else values


UNSCALED = Scaling()
"""The identity."""

USUAL = (1e-3, 1e3)
"""Range of the medians of targets that are not scaled: areas in percent lie in it."""

FAR = 10.0
"""Mean over the deviation, beyond which models learn the distance from the mean: areas vary as much
as they are large."""

SIZE = 3
"""Exponent of the other targets' scaled median: 2^2 to 2^3, that of the paper's areas, whose
hyperparameters these targets are fitted with."""

ROOTED_TARGETS = frozenset({"area_percent", "contact_nodes"})
"""Targets whose square roots surrogates learn: the nodes in contact, which are never below 0. The
error of the force, over its scale, grew by a third when its root was learnt."""


def scaling_of(
    dataset: Dataset, train: Indices, *, roots: bool = False, standard: bool = False
) -> Scaling:
    """Return the scaling of a dataset's target.

    Parameters
    ----------
    dataset : Dataset
        The usable rows.
    train : ndarray, shape (m,)
        Positions of the training rows.
    roots : bool
        True for the square root of a target of `ROOTED_TARGETS`.
    standard : bool
        True for mean 0 and deviation 1 whatever the features, as a Gaussian process needs it, whose
        predictions are the mean where it knows nothing.
    """
    target = dataset.target[train]
    root = roots and dataset.target_name in ROOTED_TARGETS
    if not (standard or chosen(dataset.features).scaled):
        mean, deviation = float(target.mean()), float(target.std())
        mean = mean if abs(mean) > FAR * deviation else 0.0
        size = usual_size(target - mean)
        if size == 0 or USUAL[0] <= size <= USUAL[1]:
            return Scaling(mean)
        return Scaling(mean, 2.0 ** (math.frexp(size)[1] - SIZE))
    target = np.sqrt(target) if root else target
    return Scaling(float(target.mean()), float(target.std()) or 1.0, root)
