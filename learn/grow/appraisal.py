"""Fit a surrogate to the rows of a growing database, and judge it on the holdout."""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from learn.arrays import Values
from learn.dataset import Dataset
from learn.executor import Executor
from learn.grow.accuracy import Accuracy, accuracy
from learn.grow.holdout import parted
from learn.grow.sizes import risk
from learn.metrics import no_better
from learn.request import Request
from learn.split import Split
from learn.surrogate import fitting
from learn.surrogate.learnt import Learnt
from learn.surrogate.model import Surrogate

LEVEL = 0.9
"""Coverage of the intervals that are looked at."""


@dataclass(frozen=True, eq=False)
class Judged:
    """Predictions of one target for the test rows.

    Attributes
    ----------
    truth, prediction : ndarray, shape (n,)
        Solved and predicted values, in the target's unit.
    low, high : ndarray, shape (n,)
        Ends of the intervals of 90 %.
    accuracy : Accuracy
        The error.
    """

    truth: Values
    prediction: Values
    low: Values
    high: Values
    accuracy: Accuracy


@dataclass(frozen=True, eq=False)
class Appraisal:
    """A surrogate of the present rows, and its errors on the holdout.

    Attributes
    ----------
    rows : int
        Finished rows of the database.
    number : int
        Number of its size, from `learn.grow.sizes`.
    mark : float
        Largest nMAE that is asked for [%].
    surrogate : Surrogate
        The surrogate.
    sets : list of Dataset
        The usable rows for each target.
    parts : Split
        Their division.
    judged : dict of str to Judged
        Predictions by target.
    reading : float
        Time to read the rows, and to compute the features of new ones [s].
    """

    rows: int
    number: int
    mark: float
    surrogate: Surrogate
    sets: list[Dataset]
    parts: Split
    judged: dict[str, Judged]
    reading: float

    def bound(self, target: str) -> float:
        """Return the bound that a target's error exceeds with this size's probability only [%]."""
        return self.judged[target].accuracy.bound(risk(self.number))

    @property
    def worst(self) -> str:
        """The target with the largest bound, on which the mark depends."""
        return max(self.judged, key=self.bound)

    @property
    def met(self) -> bool:
        """Whether the errors of all targets are below the mark, and no constant does as well."""
        scored = [each["scores"]["r2"] for each in self.surrogate.card["targets"].values()]
        return self.bound(self.worst) <= self.mark and not any(map(no_better, scored))

    def record(self) -> dict[str, object]:
        """Return the entry of the surrogate's card on the growth."""
        return {
            "mark": self.mark,
            "met": self.met,
            "rows": self.rows,
            "errors": {name: each.accuracy.error for name, each in self.judged.items()},
            "bounds": {name: self.bound(name) for name in self.judged},
        }


def appraise(
    request: Request,
    rows: int,
    number: int,
    mark: float,
    executor: Executor,
    say: Callable[[str], None],
    stopping: Callable[[], bool],
) -> Appraisal | None:
    """Fit a surrogate to the finished rows, judge it and save it.

    Parameters
    ----------
    request : Request
        Database, file of the surrogate, targets, features, model.
    rows : int
        Finished rows of the database.
    number : int
        Number of its size.
    mark : float
        Largest nMAE that is asked for [%].
    executor : Executor
        Generates the surfaces for hybrid features.
    say : callable
        Called with lines for the user.
    stopping : callable
        Asked between surfaces; True ends the work.

    Returns
    -------
    Appraisal or None
        The surrogate with its errors; None after a stop.

    Raises
    ------
    InputError
        If there are too few rows to fit or to judge, or too little memory.
    """
    began = time.monotonic()
    sets = fitting.read(request, executor, stopping)
    if sets is None:
        return None
    reading = time.monotonic() - began
    sets = [each.at(np.flatnonzero(each.rows < rows)) for each in sets]
    parts = parted(sets, request.seed)
    surrogate = fitting.fit_parts(request, sets, parts, say)
    judged = {
        target: judge(surrogate.learnt[target], each.at(parts.test))
        for target, each in zip(request.targets, sets, strict=True)
    }
    found = Appraisal(rows, number, mark, surrogate, sets, parts, judged, reading)
    surrogate.card["grown"] = found.record()
    surrogate.save(request.output)
    return found


def judge(learnt: Learnt, rows: Dataset) -> Judged:
    """Compare the predictions of a target with the solver's results for some rows."""
    raw = learnt.raw(rows.inputs)
    ends = learnt.ends(rows.inputs, raw, LEVEL)
    low, high = (learnt.within(each * rows.scale) for each in ends)
    predicted = learnt.within(raw * rows.scale)
    truth = rows.target * rows.scale
    found = accuracy(np.abs(predicted - truth), truth, rows.groups)
    return Judged(truth, predicted, low, high, found)
