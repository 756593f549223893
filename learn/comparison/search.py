"""The search of a grid: exact scores of its candidates, each distinct fit done once on a worker.

The score of a candidate is the mean R2 over the folds. Ties go to the first in the order of
ParameterGrid; candidates with a failed fold come last. The baseline, which is no point of the grid,
wins where no candidate is better. A killed search resumes where it was: the master keeps every
finished fit on disk.
"""

import math
import time
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from itertools import product
from math import inf
from typing import NamedTuple

import numpy as np

from gen.arrays import Values
from gen.runtime.terminal import RunProgress
from learn import bounded
from learn.comparison import grid as grids
from learn.comparison.fits import Training, Trial, Trials, fit
from learn.comparison.grid import Grid, Settings, Task, expected_work
from learn.executor import Executor
from learn.models import AT_BOUND, Model
from learn.split import FOLDS


@dataclass(frozen=True)
class GridScores:
    """Scores of all candidates of a grid, NaN where a fit failed or was not done."""

    folds: Values  # R2 of every differing candidate on the folds that count, (candidates, folds)
    baseline: Values  # R2 of the baseline on them, (folds,); empty if there is none
    fits: int  # finished ones of the grid, those of earlier runs included
    seconds: float  # sum of their times and of the baseline's
    failures: dict[str, int]  # number of scores that each reason has cost
    remarks: dict[str, int]  # and that each warning concerns
    collapsed: frozenset[int]  # families in which a likelihood was largest at its range's end

    @property
    def means(self) -> Values:
        """Mean over the folds of every candidate, NaN where a fold lacks; shape (candidates,)."""
        return np.asarray(self.folds.mean(axis=1))

    @property
    def winner(self) -> int:
        """Number of the best differing candidate, -1 if all failed."""
        means = self.means
        return -1 if np.isnan(means).all() else int(np.nanargmax(means))

    @property
    def scored(self) -> int:
        """Number of candidates that have a score."""
        return int(np.count_nonzero(~np.isnan(self.means)))

    @property
    def baseline_wins(self) -> bool:
        """Whether the baseline has a score, and no candidate of the grid has a better one."""
        if not self.baseline.size or np.isnan(self.baseline).any():
            return False
        return self.winner < 0 or float(self.means[self.winner]) <= float(self.baseline.mean())

    @property
    def decided(self) -> bool:
        """Whether there is a winner: a candidate of the grid, or the baseline."""
        return self.winner >= 0 or self.baseline_wins

    def of(self, number: int | None) -> list[float]:
        """Return R2 of a candidate on every fold, nothing if a fold or the candidate lacks."""
        if number is None or number < 0 or np.isnan(self.folds[number]).any():
            return []
        return [float(score) for score in self.folds[number]]


class SearchResult(NamedTuple):
    """Scores on all rows and folds, which decide; the steps in words, and all fits' times [s]."""

    scores: GridScores
    how: str
    seconds: float


@dataclass(frozen=True)
class GridSearch:
    """A model's grid, the data that it is searched on, and its finished fits."""

    model: Model
    grid: Grid
    training: Training
    trials: Trials
    executor: Executor
    stopping: Callable[[], bool] = lambda: False  # asked before a fit; True ends the search
    source: str = grids.TABLE_2  # name of the grid in results and tables
    baseline: Settings | None = None  # is judged beside the grid; None for the grid alone
    optimum: int | None = None  # candidate that is the paper's, or built in; None if there is none

    @property
    def fits(self) -> int:
        """Number of fits of the whole grid."""
        return FOLDS * len(self.grid.families)

    def tasks(self, families: Iterable[int], rows: int, folds: int = FOLDS) -> list[Task]:
        """List the fits on some rows and folds that some families of candidates still lack."""
        tasks, finished = [], self.trials.finished
        for family in families:
            served = [(each, grids.key(each)) for each in self.grid.served_by(family)]
            for fold in range(folds):
                lacking = tuple(s for s, name in served if (name, fold, rows) not in finished)
                if lacking:
                    tasks.append(Task(self.model.name, lacking, fold, rows))
        return tasks

    def baseline_tasks(self, rows: int, folds: int = FOLDS) -> list[Task]:
        """List the fits that the baseline still lacks."""
        return [
            Task(self.model.name, (self.baseline or {},), fold, rows, baseline=True)
            for fold, trial in enumerate(self.baseline_trials(rows, folds))
            if trial is None
        ]

    def baseline_trials(self, rows: int, folds: int = FOLDS) -> list[Trial | None]:
        """Return the baseline's trials by fold, None where a fold lacks; none without baseline."""
        if self.baseline is None:
            return []
        name = grids.baseline_key(self.baseline)
        return [self.trials.finished.get((name, fold, rows)) for fold in range(folds)]

    def run(
        self, tasks: list[Task], title: str, *, until: float = inf, longest: float = inf
    ) -> None:
        """Do fits after a line that is the title, and keep their trials.

        No fit is begun after the time `until` of `time.time`, at which fits are stopped. One is
        stopped after the time `longest` too; its candidates are not tried on further folds [s].
        InputError is raised for a full disk, or a machine that lacks the memory for a fit.
        """
        too_long: set[str] = set()
        with RunProgress(len(tasks), "fits", sum(map(expected_work, tasks))) as progress:
            progress.say(title)

            def keep(task: Task, trials: list[Trial] | None) -> None:
                if trials is None:
                    too_long.add(str(task.names))
                else:
                    self.trials.add(trials)
                failed = all(trial.r2 is None for trial in trials or ())
                progress.advance(1, int(failed), expected_work(task))

            self.executor.run(
                fit_in_time,
                self.training,
                (
                    replace(task, until=until, longest=longest)
                    for task in tasks
                    if str(task.names) not in too_long
                ),
                keep,
                stopping=lambda: self.stopping() or time.time() > until,
            )

    def scores(self, rows: int, folds: int = FOLDS) -> GridScores:
        """Collect the scores on some rows and folds; who lacks a fold counts as failed."""
        scores = np.full((len(self.grid.differing), folds), math.nan)
        failures: Counter[str] = Counter()
        remarks: Counter[str] = Counter()
        seconds, fits, collapsed = 0.0, set(), set()
        for family, numbers in enumerate(self.grid.families):
            for number, fold in product(numbers, range(folds)):
                name = grids.key(self.grid.differing[number])
                trial = self.trials.finished.get((name, fold, rows))
                if trial is None:
                    continue
                scores[number, fold] = math.nan if trial.r2 is None else trial.r2
                seconds += trial.seconds
                fits.add((family, fold))
                if AT_BOUND in trial.remark:
                    collapsed.add(family)
                failures.update(filter(None, [trial.failure]))
                remarks.update(filter(None, [trial.remark]))
        own = self.baseline_trials(rows, folds)
        seconds += sum(trial.seconds for trial in own if trial)
        reached = [math.nan if trial is None or trial.r2 is None else trial.r2 for trial in own]
        counts = len(fits), seconds, dict(failures), dict(remarks)
        return GridScores(scores, np.array(reached), *counts, frozenset(collapsed))

    def exhaustive(self) -> SearchResult:
        """Search the whole grid, and judge the baseline beside it."""
        rows = self.training.rows
        tasks, own = self.tasks(range(len(self.grid.families)), rows), self.baseline_tasks(rows)
        beside = "" if self.baseline is None else f", {len(own)} of the baseline"
        title = (
            f"{self.model.title}: {self.grid.nominal} candidates,"
            f" {len(self.grid.differing)} differ, {self.fits} fits, {len(tasks)} to do{beside}"
        )
        # The longest first: the last ones are short, so that no process waits long at the end.
        self.run(sorted([*tasks, *own], key=expected_work, reverse=True), title)
        scores = self.scores(rows)
        return SearchResult(scores, grids.WHOLE, scores.seconds)


def fit_in_time(training: Training, task: Task) -> list[Trial] | None:
    """Do the fit of a task; None if it was stopped at its time."""
    return bounded.call(fit, training, task, task.until, task.longest)
