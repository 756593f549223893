"""The scale on which models see their target."""

import math
from dataclasses import dataclass

import numpy as np

from learn.arrays import Indices, Values
from learn.dataset import Dataset
from learn.features import chosen


@dataclass(frozen=True)
class Scaling:
    """What models are trained on is (target - mean) / deviation.

    Attributes
    ----------
    mean, deviation : of the training rows where the features are free of units, else 0 and 1: the
        paper trains on areas as they are. Targets that are not of an area's size are brought to it
        by a power of two: splits of trees, tubes of support vectors and steps of perceptrons have
        thresholds that do not know of units.
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

USUAL = (1e-3, 1e3)
"""Medians of targets that are trained on as they are: those of areas in percent."""

SIZE = 3
"""Others get a median of 2^2 to 2^3, that of the paper's areas, whose hyperparameters they get."""


def scaling_of(dataset: Dataset, train: Indices) -> Scaling:
    """Find the scaling of the target.

    Parameters
    ----------
    dataset : the usable rows
    train : positions of the training rows
    """
    target = dataset.target[train]
    if not chosen(dataset.features).scaled:
        median = float(np.median(np.abs(target)))  # which outliers do not move
        if median == 0 or USUAL[0] <= median <= USUAL[1]:
            return UNSCALED
        return Scaling(0.0, 2.0 ** (math.frexp(median)[1] - SIZE))
    return Scaling(float(target.mean()), float(target.std()) or 1.0)
