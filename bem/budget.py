"""The parts of the errors of a contact's answers, and the grids that were tried to reach them."""

from __future__ import annotations  # short signatures in help()

import math
from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class ErrorParts:
    """Bound of the relative error of one answer at 95 %, by the causes of the error.

    Attributes
    ----------
    asked_error : float
        Largest relative error that was asked for [1].
    grid : float
        Part for the grid and the waves that it keeps, infinite where no bar holds [1].
    waves : float
        Part for the waves of the given map that the grid drops [1].
    solver : float
        Part for the tolerance of the solver [1].
    """

    asked_error: float
    grid: float
    waves: float
    solver: float

    @property
    def total(self) -> float:
        """Root of the sum of the squares of all parts [1]."""
        return math.hypot(self.grid, self.waves, self.solver)

    @property
    def is_met(self) -> bool:
        """Whether the error is at most the one that was asked for."""
        return self.total <= self.asked_error


@dataclass(frozen=True)
class Trial:
    """A grid that was tried.

    Attributes
    ----------
    nodes : tuple of int
        Nodes (mx, my) of the grid.
    waves_dropped : float
        Share of the given map's mean square slope that the grid lacks [1].
    errors : mapping of str to ErrorParts
        Errors of the answers that were asked for, by their names; empty without a contact.
    reason : str
        Reason why the answers hold or do not hold, without a full stop.
    convolutions : float
        Cost of the contact, and of the coarser contact if it was solved only to judge this one, in
        convolutions on this grid [1].
    work : float
        The same cost, in convolutions on the given map [1].
    """

    nodes: tuple[int, int]
    waves_dropped: float
    errors: Mapping[str, ErrorParts]
    reason: str
    convolutions: float
    work: float

    @property
    def meets_errors(self) -> bool:
        """Whether all answers have the errors that were asked for."""
        return bool(self.errors) and all(parts.is_met for parts in self.errors.values())

    @property
    def error_ratio(self) -> float:
        """Largest ratio of an error to the one asked for [1].

        It is at most 1 if all are met, and infinite where no bar holds or there is no contact.
        """
        ratios = [parts.total / parts.asked_error for parts in self.errors.values()]
        return max(ratios, default=math.inf)


@dataclass(frozen=True)
class Budget:
    """The errors of a contact's answers, and the grids that were tried.

    Attributes
    ----------
    map_nodes : tuple of int
        Nodes (nx, ny) of the given map.
    tolerance : float
        Tolerance of the solver [Delta].
    trials : tuple of Trial
        The grids that were tried, in this order. The last one is that of the contact; in
        `NotReachable`, any of them may be the best. There are none without a load: nothing touches,
        which is exact on any grid.
    """

    map_nodes: tuple[int, int]
    tolerance: float
    trials: tuple[Trial, ...]

    @property
    def errors(self) -> Mapping[str, ErrorParts]:
        """Errors of the answers on the last grid that was tried, by their names."""
        return self.trials[-1].errors if self.trials else {}

    @property
    def nodes(self) -> tuple[int, int]:
        """Nodes of the last grid that was tried, which is that of the contact."""
        return self.trials[-1].nodes if self.trials else self.map_nodes

    @property
    def work(self) -> float:
        """Work of all trials, in convolutions on the given map [1]."""
        return sum(trial.work for trial in self.trials)
