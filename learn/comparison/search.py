"""The search of a grid: exact scores of its candidates, each distinct fit done once on a worker.

The score of a candidate is the mean R2 over the folds. Ties go to the first in the order of
ParameterGrid; candidates with a failed fold come last. The baseline, which is no point of the grid,
wins where no candidate is better. A killed search resumes where it was: the master keeps every
finished fit on disk (`learn.comparison.trials`).
"""

import math
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from math import inf

import numpy as np

from gen.runtime.terminal import RunProgress
from learn import bounded
from learn.arrays import Values
from learn.comparison.fits import fit
from learn.comparison.grid import (
    TABLE_2,
    WHOLE,
    Grid,
    Settings,
    Task,
    baseline_key,
    expected_work,
    key,
)
from learn.comparison.training import Training
from learn.comparison.trials import Trial, Trials
from learn.executor import Executor
from learn.models import Model
from learn.split import FOLDS


@dataclass(frozen=True)
class GridScores:
    """Scores of all candidates of a grid.

    Attributes
    ----------
    folds : ndarray, shape (candidates, folds that count)
        R2 of every differing candidate on every fold, NaN where a fit failed or was not done.
    baseline : ndarray, shape (folds that count,)
        R2 of the baseline, NaN where its fit failed or was not done; empty if there is none.
    fits : int
        Number of finished fits of the grid, those of earlier runs included.
    seconds : float
        Sum of these fits' times and of the baseline's [s].
    failures, remarks : dict
        Number of scores that each reason has cost, and that each warning concerns.
    collapsed : frozenset of int
        Numbers of the candidates of which a fit found nothing in its rows.
    """

    folds: Values
    baseline: Values
    fits: int
    seconds: float
    failures: dict[str, int]
    remarks: dict[str, int]
    collapsed: frozenset[int]

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


@dataclass(frozen=True)
class SearchResult:
    """The result of a search, and how far it went.

    Attributes
    ----------
    scores : GridScores
        Scores on all training rows and folds, which decide.
    how : str
        The steps of the search in words.
    seconds : float
        Sum of the times of all fits, of all steps and earlier runs [s].
    """

    scores: GridScores
    how: str
    seconds: float


@dataclass(frozen=True)
class GridSearch:
    """A model's grid, the data that it is searched on, and its finished fits.

    Attributes
    ----------
    model, grid : Model, Grid
        The model and its candidates.
    training : Training
        The data of the search.
    trials : Trials
        The finished fits, open for writing.
    executor : Executor
        Does the fits.
    stopping : callable
        Asked before a fit is begun; True ends the search.
    source : str
        Name of the grid in results and tables.
    baseline : dict or None
        Settings of the baseline, which every search judges beside the grid; None for a search of
        the grid alone.
    optimum : int or None
        Number of the paper's optimum, or of settings that are built in; None if the grid lacks it.
    """

    model: Model
    grid: Grid
    training: Training
    trials: Trials
    executor: Executor
    stopping: Callable[[], bool] = lambda: False
    source: str = TABLE_2
    baseline: Settings | None = None
    optimum: int | None = None

    @property
    def fits(self) -> int:
        """Number of fits of the whole grid."""
        return FOLDS * len(self.grid.families)

    def tasks(self, numbers: Iterable[int], rows: int, folds: int = FOLDS) -> list[Task]:
        """List the fits that some candidates still lack.

        Parameters
        ----------
        numbers : iterable of int
            Numbers of differing candidates, in the order in which they are to be fitted.
        rows : int
            Number of training rows at most.
        folds : int
            Number of folds to do, from the first on.

        Returns
        -------
        list of Task
            One task for each family and fold, the families in the order of their first candidate.
        """
        wanted: dict[int, list[int]] = {}
        for number in numbers:
            wanted.setdefault(self.grid.family_of[number], []).append(number)
        finished, tasks = self.trials.finished, []
        for family in wanted.values():
            settings = [self.grid.differing[number] for number in sorted(family)]
            for fold in range(folds):
                lacking = tuple(s for s in settings if (key(s), fold, rows) not in finished)
                if lacking:
                    tasks.append(Task(self.model.name, lacking, fold, rows))
        return tasks

    def baseline_tasks(self, rows: int, folds: int = FOLDS) -> list[Task]:
        """List the fits that the baseline still lacks; arguments as those of `tasks`."""
        if self.baseline is None:
            return []
        tasks = [Task(self.model.name, (self.baseline,), fold, rows, True) for fold in range(folds)]
        finished = self.trials.finished
        return [task for task in tasks if (*task.names, task.fold, rows) not in finished]

    def run(
        self, tasks: list[Task], title: str, *, until: float = inf, longest: float = inf
    ) -> None:
        """Do the fits of some tasks and keep their trials.

        Parameters
        ----------
        tasks : list of Task
            The fits.
        title : str
            Line to print first.
        until : float
            Time of `time.time` after which no fit is begun, and at which fits are stopped [s].
        longest : float
            Time after which a fit is stopped; the same candidates are then not tried on further
            folds [s].

        Raises
        ------
        InputError
            For a full disk, or a machine that lacks the memory for a fit.
        """
        too_long: set[tuple[str, ...]] = set()
        with RunProgress(len(tasks), "fits", sum(map(expected_work, tasks))) as progress:
            progress.say(title)

            def bounds() -> Iterator[Task]:
                for task in tasks:
                    if tuple(task.names) not in too_long:
                        yield replace(task, until=until, longest=longest)

            def keep(task: Task, trials: list[Trial] | None) -> None:
                if trials is None:
                    too_long.add(tuple(task.names))
                else:
                    self.trials.add(trials)
                failed = all(trial.r2 is None for trial in trials or ())
                progress.advance(1, int(failed), expected_work(task))

            def stopping() -> bool:
                return self.stopping() or time.time() > until

            self.executor.run(fit_in_time, self.training, bounds(), keep, stopping=stopping)

    def scores(self, rows: int, folds: int = FOLDS) -> GridScores:
        """Collect the scores of all candidates; those that lack a fold count as failed.

        Parameters
        ----------
        rows : int
            Number of training rows of the trials that count.
        folds : int
            Number of folds that count, from the first on.
        """
        finished, seconds = self.trials.finished, 0.0
        scores = np.full((len(self.grid.differing), folds), math.nan)
        failures: Counter[str] = Counter()
        remarks: Counter[str] = Counter()
        fits, collapsed = set(), set()
        for number, settings in enumerate(self.grid.differing):
            for fold in range(folds):
                trial = finished.get((key(settings), fold, rows))
                if trial is None:
                    continue
                scores[number, fold] = math.nan if trial.r2 is None else trial.r2
                seconds += trial.seconds
                fits.add((self.grid.family_of[number], fold))
                if trial.collapsed:
                    collapsed.add(number)
                failures.update(filter(None, [trial.failure]))
                remarks.update(filter(None, [trial.remark]))
        own = self.baseline_trials(rows, folds)
        seconds += sum(trial.seconds for trial in own if trial)
        reached = [math.nan if trial is None or trial.r2 is None else trial.r2 for trial in own]
        counts = len(fits), seconds, dict(failures), dict(remarks)
        return GridScores(scores, np.array(reached), *counts, frozenset(collapsed))

    def baseline_trials(self, rows: int, folds: int = FOLDS) -> list[Trial | None]:
        """Return the baseline's trials by fold, None where a fold lacks; none without baseline."""
        if self.baseline is None:
            return []
        name = baseline_key(self.baseline)
        return [self.trials.finished.get((name, fold, rows)) for fold in range(folds)]

    def exhaustive(self) -> SearchResult:
        """Search the whole grid, and judge the baseline beside it."""
        rows = self.training.rows
        tasks, own = self.tasks(range(len(self.grid.differing)), rows), self.baseline_tasks(rows)
        beside = "" if self.baseline is None else f", {len(own)} of the baseline"
        title = (
            f"{self.model.title}: {self.grid.nominal} candidates,"
            f" {len(self.grid.differing)} differ, {self.fits} fits, {len(tasks)} to do{beside}"
        )
        # The longest first: the last ones are short, so that no process waits long at the end.
        self.run(sorted([*tasks, *own], key=expected_work, reverse=True), title)
        scores = self.scores(rows)
        return SearchResult(scores, WHOLE, scores.seconds)


def fit_in_time(training: Training, task: Task) -> list[Trial] | None:
    """Do the fit of a task; None if it was stopped at its time."""
    return bounded.call(fit, training, task, task.until, task.longest)
