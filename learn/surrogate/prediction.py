"""Input and output of a surrogate: rows of features, and predictions with intervals."""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from learn.arrays import Values


class Rows(NamedTuple):
    """Rows of features that the models can predict.

    Attributes
    ----------
    inputs : ndarray, shape (n, d)
        Features.
    statistics : ndarray, shape (n, 22)
        Statistics in the order of Table 1.
    delta : ndarray, shape (n,)
        Far-field displacement [um].
    length : ndarray or float
        Scan length L; one for all rows, or shape (n,) [um].
    notes : tuple of str
        Notes on grids that differ from the training's: one for all rows, or n.
    hardness_ratio : float, optional
        Hardness over E*; None for elastic bodies.
    """

    inputs: Values
    statistics: Values
    delta: Values
    length: Values | float
    notes: tuple[str, ...]
    hardness_ratio: float | None = None


@dataclass(frozen=True, eq=False)
class Prediction:
    """Predictions for n rows.

    Attributes
    ----------
    delta : ndarray, shape (n,)
        Far-field displacement [um].
    values : dict of str to ndarray, shape (n,)
        Predictions by target: "area" [%], "force" [uN], "mean_gap" [um] ...
    low, high : dict of str to ndarray, shape (n,)
        Ends of the intervals by target; empty if no level was given. They only hold for rows
        inside the training; tables leave them out for the other rows.
    std : dict of str to ndarray, shape (n,)
        Standard deviations by target, of Gaussian processes, on request.
    reasons : tuple of str
        For each row, the features outside the training; "" if there is none.
    """

    delta: Values
    values: dict[str, Values]
    low: dict[str, Values] = field(default_factory=dict)
    high: dict[str, Values] = field(default_factory=dict)
    std: dict[str, Values] = field(default_factory=dict)
    reasons: tuple[str, ...] = ()

    @property
    def area(self) -> Values:
        """Effective contact area, shape (n,) [%]."""
        return self.values["area"]

    @property
    def force(self) -> Values:
        """Normal force, shape (n,) [uN]."""
        return self.values["force"]

    @property
    def inside(self) -> NDArray[np.bool_]:
        """Rows inside the training ranges, True or False, shape (n,)."""
        return np.array([not reason for reason in self.reasons], dtype=np.bool_)
