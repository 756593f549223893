"""The grid search: exact scores of all candidates, each distinct fit done once, on the workers.

A killed search resumes where it was: the master keeps every finished fit on disk
(`learn.comparison.search.trials`).
"""

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from math import inf

from gen.runtime.errors import InputError
from gen.runtime.terminal import RunProgress
from learn.comparison.search.fits import fit
from learn.comparison.search.pruning import Grid, Settings, baseline_key, key
from learn.comparison.search.scores import GridScores, rank
from learn.comparison.search.spaces import TABLE_2, WHOLE
from learn.comparison.search.task import Task, expected_work
from learn.comparison.search.trials import Trial, Trials
from learn.comparison.training_data import Training
from learn.executor import Executor
from learn.models import Model
from learn.split import FOLDS


@dataclass(frozen=True)
class SearchResult:
    """The result of a search, and how far it went.

    Attributes
    ----------
    scores : GridScores
        Scores on all training rows and folds, which decide.
    rows : int
        Number of training rows.
    how : str
        The steps of the search in words.
    seconds : float
        Sum of the times of all fits, of all steps and earlier runs [s].
    """

    scores: GridScores
    rows: int
    how: str
    seconds: float


@dataclass(frozen=True)
class GridSearch:
    """A model's grid, the data that it is searched on, and its finished fits.

    Attributes
    ----------
    model : Model
        The model.
    grid : Grid
        Its candidates.
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
        tasks = []
        for family in wanted.values():
            settings = [self.grid.differing[number] for number in sorted(family)]
            for fold in range(folds):
                finished = self.trials.finished
                lacking = tuple(s for s in settings if (key(s), fold, rows) not in finished)
                if lacking:
                    tasks.append(Task(self.model.name, lacking, fold, rows))
        return tasks

    def baseline_tasks(self, rows: int, folds: int = FOLDS) -> list[Task]:
        """List the fits that the baseline still lacks.

        Parameters
        ----------
        rows, folds : int
            See `tasks`.
        """
        if self.baseline is None:
            return []
        tasks = [Task(self.model.name, (self.baseline,), fold, rows, True) for fold in range(folds)]
        finished = self.trials.finished
        return [task for task in tasks if (*task.names, task.fold, rows) not in finished]

    @property
    def baseline_name(self) -> str:
        """Name of the baseline in its trials, "" if there is none."""
        return "" if self.baseline is None else baseline_key(self.baseline)

    def run(self, tasks: list[Task], *, until: float = inf, title: str = "") -> None:
        """Do the fits of some tasks and keep their trials.

        Parameters
        ----------
        tasks : list of Task
            The fits.
        until : float
            Time of `time.monotonic` after which no further fit is begun [s].
        title : str
            Line to print first.

        Raises
        ------
        InputError
            For a full disk, or a machine that lacks the memory for a fit.
        """
        work = sum(map(expected_work, tasks))
        with RunProgress(len(tasks), "fits", work) as progress:
            if title:
                progress.say(title)

            def keep(task: Task, trials: list[Trial]) -> None:
                if not trials:
                    raise InputError(
                        f"{task.model}: too little memory is free for a fit: give fewer workers, or"
                        " --train-rows"
                    )
                self.trials.add(trials)
                failed = all(trial.r2 is None for trial in trials)
                progress.advance(1, int(failed), expected_work(task))

            def stopping() -> bool:
                return self.stopping() or time.monotonic() > until

            self.executor.run(fit, self.training, tasks, keep, stopping=stopping)

    def scores(self, rows: int, folds: int = FOLDS) -> GridScores:
        """Rank the candidates by the trials that are finished; see `scores.rank`."""
        return rank(self.grid, self.trials.finished, rows, folds, self.baseline_name)

    def exhaustive(self) -> SearchResult:
        """Search the whole grid, and judge the baseline beside it."""
        rows = self.training.rows
        tasks = self.tasks(range(len(self.grid.differing)), rows)
        lacking = len(tasks)
        tasks += self.baseline_tasks(rows)
        # The longest first: the last ones are short, so that no process waits long at the end.
        tasks.sort(key=expected_work, reverse=True)
        self.run(
            tasks,
            title=(
                f"{self.model.title}: {self.grid.nominal} candidates,"
                f" {len(self.grid.differing)} differ, {self.fits} fits, {lacking} to do"
                f"{self._beside(len(tasks) - lacking)}"
            ),
        )
        scores = self.scores(rows)
        return SearchResult(scores, rows, WHOLE, scores.seconds)

    def _beside(self, fits: int) -> str:
        return "" if self.baseline is None else f", {fits} of the baseline"

    @property
    def fits(self) -> int:
        """Number of fits of the whole grid."""
        return FOLDS * len(self.grid.families)
