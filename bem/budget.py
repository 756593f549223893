"""What an answer's error is made of, and what was tried to get it: the record beside a contact."""

from __future__ import annotations  # short signatures in help()

import math
from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class ErrorParts:
    """Relative error of one answer at 95 %, by its causes.

    Attributes
    ----------
    asked : float
        Largest relative error that was asked for [1].
    grid : float
        Error of a grid for the waves that it has, infinite where no bar holds [1].
    waves : float
        Error for the waves of the given map that the grid has dropped [1].
    solver : float
        Error for the tolerance of the solver [1].
    """

    asked: float
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
        return self.total <= self.asked


@dataclass(frozen=True)
class Trial:
    """A grid that was tried.

    Attributes
    ----------
    nodes : tuple of int
        Nodes (mx, my) of the grid.
    waves_dropped : float
        Share of the given map's mean square slope that the grid has not [1].
    answers : mapping of str to ErrorParts
        Errors of the answers that were asked for, by their names; empty without a contact.
    reason : str
        Reason why the answers hold or do not hold, without a full stop.
    convolutions : float
        Convolutions of the contact and of the coarser ones that judge it and are no trials
        themselves, in convolutions on the grid that was tried [1].
    work : float
        The same, in convolutions on the given map [1].
    """

    nodes: tuple[int, int]
    waves_dropped: float
    answers: Mapping[str, ErrorParts]
    reason: str
    convolutions: float
    work: float

    @property
    def is_met(self) -> bool:
        """Whether all answers have the errors that were asked for."""
        return bool(self.answers) and all(parts.is_met for parts in self.answers.values())

    @property
    def excess(self) -> float:
        """Largest error over the one that was asked for, infinite where no bar holds [1]."""
        ratios = [parts.total / parts.asked for parts in self.answers.values()]
        return max(ratios, default=math.inf)


@dataclass(frozen=True)
class Budget:
    """The errors of a contact's answers, and the grids that were tried.

    Attributes
    ----------
    given : tuple of int
        Nodes (nx, ny) of the given map.
    tolerance : float
        Tolerance of the solver [Delta].
    trials : tuple of Trial
        The grids that were tried, the last one is that of the contact. Without a load no grid is
        tried: nothing touches, which is exact.
    """

    given: tuple[int, int]
    tolerance: float
    trials: tuple[Trial, ...]

    @property
    def answers(self) -> Mapping[str, ErrorParts]:
        """Errors of the answers that were asked for, by their names."""
        return self.trials[-1].answers if self.trials else {}

    @property
    def nodes(self) -> tuple[int, int]:
        """Nodes of the contact's grid."""
        return self.trials[-1].nodes if self.trials else self.given

    @property
    def work(self) -> float:
        """Work of all trials, in convolutions on the given map [1]."""
        return sum(trial.work for trial in self.trials)
