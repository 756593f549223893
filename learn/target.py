"""The scale on which models see their target."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from learn.dataset import Dataset, Indices
from learn.features import chosen

Values = NDArray[np.float64]


@dataclass(frozen=True)
class Scaling:
    """What models are trained on is (target - mean) / deviation.

    Attributes
    ----------
    mean, deviation : of the training rows where the features are free of units, else 0 and 1: the
        paper trains on areas as they are
    """

    mean: float = 0.0
    deviation: float = 1.0

    def scaled(self, target: Values) -> Values:
        """(n,) what a model is trained on."""
        return (target - self.mean) / self.deviation

    def restored(self, predicted: Values) -> Values:
        """(n,) targets from what a model predicts."""
        return self.mean + self.deviation * np.asarray(predicted, dtype=np.float64)


UNSCALED = Scaling()


def scaling_of(dataset: Dataset, train: Indices) -> Scaling:
    """Find the scaling of the target.

    Parameters
    ----------
    dataset : the usable rows
    train : positions of the training rows
    """
    if not chosen(dataset.features).scaled:
        return UNSCALED
    target = dataset.target[train]
    return Scaling(float(target.mean()), float(target.std()) or 1.0)
