"""The scale on which models see their target."""

import math
from dataclasses import dataclass

import numpy as np

from learn.arrays import Indices, Values
from learn.dataset import Dataset
from learn.features import chosen


@dataclass(frozen=True)
class Scaling:
    """A linear map of the target: models are trained on (target - mean) / deviation.

    Where the features are free of units, mean and deviation are those of the training rows.
    Elsewhere they are 0 and 1: the paper trains on areas as they are. Targets of another size are
    brought to an area's by a power of two, since splits of trees, tubes of support vectors and
    steps of perceptrons have absolute thresholds.

    Attributes
    ----------
    mean, deviation : float
        Zero and unit of the scale, in the target's unit.
    """

    mean: float = 0.0
    deviation: float = 1.0

    def scaled(self, target: Values) -> Values:
        """Return the values that a model is trained on.

        Parameters
        ----------
        target : ndarray, shape (n,)
            Targets.
        """
        return (target - self.mean) / self.deviation

    def restored(self, predicted: Values) -> Values:
        """Return targets from a model's predictions.

        Parameters
        ----------
        predicted : ndarray, shape (n,)
            Predictions on the scale of the training.
        """
        return self.mean + self.deviation * np.asarray(predicted, dtype=np.float64)


UNSCALED = Scaling()
"""The identity."""

USUAL = (1e-3, 1e3)
"""Range of the medians of targets that are not scaled: areas in percent lie in it."""

SIZE = 3
"""Exponent of the other targets' scaled median: 2^2 to 2^3, that of the paper's areas, whose
hyperparameters these targets are fitted with."""


def scaling_of(dataset: Dataset, train: Indices) -> Scaling:
    """Return the scaling of a dataset's target.

    Parameters
    ----------
    dataset : Dataset
        The usable rows.
    train : ndarray, shape (m,)
        Positions of the training rows.
    """
    target = dataset.target[train]
    if not chosen(dataset.features).scaled:
        median = float(np.median(np.abs(target)))  # unlike the mean, outliers do not move it
        if median == 0 or USUAL[0] <= median <= USUAL[1]:
            return UNSCALED
        return Scaling(0.0, 2.0 ** (math.frexp(median)[1] - SIZE))
    return Scaling(float(target.mean()), float(target.std()) or 1.0)
