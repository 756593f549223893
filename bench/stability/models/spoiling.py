"""What may be the matter with rows: changes of inputs, targets and whole rows."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from bench.stability.models.samples import SEEN, Values
from learn.dataset import Dataset


def constant_column(inputs: Values) -> Values:
    """One input says nothing."""
    inputs[:, 5] = 0.25
    return inputs


def collinear(inputs: Values) -> Values:
    """One input is twice another, one the sum of two."""
    inputs[:, 1], inputs[:, 2] = 2 * inputs[:, 3], inputs[:, 3] + inputs[:, 0]
    return inputs


def zero_row(inputs: Values) -> Values:
    """A row to train on and one to test have no length."""
    inputs[[3, SEEN + 15]] = 0.0
    return inputs


def outlier(inputs: Values) -> Values:
    """One row is far from all others."""
    inputs[3] *= 1e9
    return inputs


def dominant(inputs: Values) -> Values:
    """One input is all that a row's length is made of."""
    inputs[:, 20] *= 1e12
    return inputs


def doubled(rows: Dataset) -> Dataset:
    """The first half of the training rows twice."""
    order = np.concatenate([np.arange(SEEN // 2), np.arange(SEEN // 2), np.arange(SEEN, rows.size)])
    return rows.at(order)


def contradicting(rows: Dataset) -> Dataset:
    """The first half twice, with targets that are 10 % apart."""
    twice = doubled(rows)
    target = twice.target.copy()
    target[: SEEN // 2] *= 1.1
    return replace(twice, target=target)


def spike(target: Values) -> Values:
    """One target is far from all others."""
    target[3] = 1e12
    return target


def times(factor: float) -> Callable[[Values], Values]:
    """Other units."""
    return lambda values: values * factor
