"""What a surrogate is asked and what it answers: rows of features, and values with intervals."""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Values = NDArray[np.float64]


class Rows(NamedTuple):
    """Rows to predict, ready for the models.

    Attributes
    ----------
    inputs : (n, d) features
    statistics : (n, 22)
    delta : (n,) [um]
    length : scan length L, one or (n,) [um]
    notes : what is odd about all rows, or about each
    """

    inputs: Values
    statistics: Values
    delta: Values
    length: Values | float
    notes: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Prediction:
    """What a surrogate says about n rows.

    Attributes
    ----------
    delta : (n,) far-field displacement [um]
    values : (n,) predictions by target: "area" [%], "force" [uN], "mean_gap" [um] ...
    low, high : (n,) ends of the intervals by target; empty if none were asked for. They hold where
        a row is inside the training only: tables leave them out elsewhere
    std : (n,) standard deviations by target, of Gaussian processes, if asked for
    reasons : n texts: what lies outside the training, "" if nothing does
    """

    delta: Values
    values: dict[str, Values]
    low: dict[str, Values] = field(default_factory=dict)
    high: dict[str, Values] = field(default_factory=dict)
    std: dict[str, Values] = field(default_factory=dict)
    reasons: tuple[str, ...] = ()

    @property
    def area(self) -> Values:
        """(n,) effective contact area [%]."""
        return self.values["area"]

    @property
    def force(self) -> Values:
        """(n,) normal force [uN]."""
        return self.values["force"]

    @property
    def inside(self) -> NDArray[np.bool_]:
        """(n,) whether a row lies inside the training ranges."""
        return np.array([not reason for reason in self.reasons], dtype=np.bool_)
