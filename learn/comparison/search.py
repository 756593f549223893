"""The search of a grid: exact scores of its candidates, each distinct fit done once on a worker.

The score of a candidate is the mean R2 over the folds of all rows. Of equal candidates the first
one in the order of ParameterGrid is the best; candidates with a failed fold come last. The
baseline, which is no point of the grid, wins where no candidate is better.

Within a given time, successive halving on the number of training rows decides which candidates are
judged, as in scikit-learn's HalvingGridSearchCV: all candidates are fitted to few rows, the best
third to three times as many, and so on. scikit-learn's own halving knows rows, not hours, shares no
fits, and can be neither spread over machines nor resumed.

The search of Table 2's grids gives the numbers of the paper's Table 3: `GridSearch.report` the
winners, and `GridSearch.seconds` the times.
"""

import math
import time
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from itertools import product
from math import inf
from statistics import median
from typing import Literal

import numpy as np

from gen.runtime.terminal import RunProgress
from learn.comparison import grid as grids
from learn.comparison.fits import Place, Training, Trial, Trials, fit
from learn.comparison.folder import SearchReport
from learn.comparison.grid import (
    LEAST_JUDGED,
    Grid,
    SettingValues,
    Task,
    expected_work,
)
from learn.executor import Ended, Executor, budget_of
from learn.models import Model
from learn.split import FOLDS

STEP_FOLDS = 2  # folds on which a step ranks its candidates
JUDGED = 0.75  # share of the time after which no candidate is judged any more
FACTOR = 3  # of three candidates one goes on, with three times the rows
LEAST_ROWS = 300  # training rows of the first step at least

Family = tuple[str, ...]
"""Names of the candidates that one fit serves; the baseline is served alone."""


@dataclass
class GridSearch:
    """A search of a model's grid: its data, its finished fits, and its winner by these fits.

    The finished fits, `trials`, are the whole state of a search but for the candidates beyond the
    grid: the same search with the same trials goes on where an earlier one was stopped.
    """

    model: Model
    grid: Grid  # replaced by a larger one where the search goes on beyond its ends
    training: Training
    trials: Trials
    executor: Executor
    # Called before a fit; True ends the search.
    stopping: Callable[[], bool] = lambda: False
    source: str = grids.TABLE_2  # name of the grid in results and tables
    # Settings of the baseline, which is judged beside the grid; None for the grid alone.
    baseline: SettingValues | None = None
    # Name of the paper's optimum in the grid, or of the default of another grid; "" without one.
    optimum: str = ""
    how: str = "whole grid"  # the steps of the search in words
    searches: int = 1  # searches that share the budget, this one included
    # Times after which fits to all rows were stopped [s].
    ended: list[float] = field(default_factory=list)

    @property
    def baseline_family(self) -> Family:
        """Name of the baseline as a family; empty if the grid is searched alone."""
        if self.baseline is None:
            return ()
        return (grids.key(self.baseline, baseline=True),)

    @property
    def baseline_name(self) -> str:
        """Name of the baseline, "" if the grid is searched alone."""
        return "".join(self.baseline_family)

    def tasks(
        self, families: Iterable[Family], rows: int, folds: int = FOLDS
    ) -> list[Task]:
        """List the fits that families still lack.

        Parameters
        ----------
        families : iterable of tuple of str
            Families of the grid, or that of the baseline. Empty ones are skipped.
        rows : int
            Training rows of each fit at most.
        folds : int
            Number of folds, from the first one.

        Returns
        -------
        list of Task
            One task for each family and fold of which at least one candidate has no trial.
        """
        settings = dict(self.grid.differing)
        if self.baseline is not None:
            settings[self.baseline_name] = self.baseline
        tasks = []
        for names, fold in product(families, range(folds)):
            lacking = {
                name: settings[name]
                for name in names
                if Place(name, fold, rows) not in self.trials.finished
            }
            if lacking:
                is_baseline = names == self.baseline_family
                tasks.append(Task(self.model.name, lacking, fold, rows, is_baseline))
        return tasks

    def run(self, tasks: list[Task], title: str, until: float = inf) -> None:
        """Do fits on the workers, and add their trials to the file of trials.

        A progress bar is shown below a line with the title. Nothing is shown and done without
        tasks, or if the search has been stopped or its time is over.

        Parameters
        ----------
        tasks : list of Task
            Fits, in the order in which they are begun.
        title : str
            Description of the fits for the user.
        until : float
            Time of `time.time` from which on no fit is begun, and at which fits are stopped [s].

        Raises
        ------
        InputError
            If the disk is full, or a machine lacks the memory for a fit.
        """

        def is_over() -> bool:
            return self.stopping() or time.time() > until

        if not tasks or is_over():
            return
        work = sum(map(expected_work, tasks))
        with RunProgress(len(tasks), "fits", work) as progress:
            progress.say(f"{self.model.title}: {title}")

            def on_result(task: Task, result: list[Trial] | Ended) -> None:
                has_failed = self._keep(task, result)
                progress.advance(1, failed=int(has_failed), work=expected_work(task))

            self.executor.run(
                fit, self.training, tasks, on_result, stopping=is_over, until=until
            )

    def _keep(self, task: Task, result: list[Trial] | Ended) -> bool:
        """Keep the trials or the time of a fit; return whether it has failed or was stopped."""
        if isinstance(result, Ended):
            if result.seconds and task.rows == self.training.rows:
                self.ended.append(result.seconds)
            return True
        self.trials.add(result)
        return all(trial.r2 is None for trial in result)

    def exhaust(self) -> None:
        """Search the whole grid, and beyond an end at which the winner lies; see `run`."""
        self.fit_all()
        self._go_beyond()

    def fit_all(self) -> None:
        """Do all fits of the grid and of the baseline; see `run`."""
        grid = self.grid
        of_grid = self.tasks(grid.families, self.training.rows)
        of_baseline = self.tasks([self.baseline_family], self.training.rows)
        title = (
            f"{len(grid.candidates)} candidates, {len(grid.differing)} differ,"
            f" {FOLDS * len(grid.families)} fits, {len(of_grid)} to do, {len(of_baseline)} of the"
            " baseline"
        )
        # The longest fits come first: no process then waits long for the last ones.
        tasks = sorted([*of_grid, *of_baseline], key=expected_work, reverse=True)
        self.run(tasks, title)

    def halve(self, until: float) -> None:
        """Search the grid within a time, by successive halving; see `run`.

        The steps, and the judgement over five folds of all rows, have equal shares of three
        quarters of the time; fits that do not end within their share are left out. The rest of the
        time is for the winner's last fit. The paper's optimum is on every step, and the first to be
        judged, because few rows must not hide it.

        Parameters
        ----------
        until : float
            Time of `time.time` at which the winner's last fit is to end too [s].
        """
        total = self.training.rows
        began = time.time()
        share = JUDGED * (until - began) / len(self._sizes)
        end = began + len(self._sizes) * share
        baseline = self.tasks([self.baseline_family], total)
        self.run(baseline, f"the baseline on {total} rows", end)
        order = self._with_optimum_first(self._drawn())
        climbing = order
        steps = []
        for number, rows in enumerate(self._sizes[:-1], start=1):
            on_rows = f"on {rows} rows, {STEP_FOLDS} folds"
            tasks = self.tasks(climbing, rows, STEP_FOLDS)
            self.run(tasks, f"candidates {on_rows}", began + number * share)
            scored = len(self.means(self.grid.differing, rows, STEP_FOLDS))
            if scored:
                steps.append(f"{_counted(scored)} {on_rows}")
            ranked = self._ranked(order, rows)
            order = self._with_optimum_first([*ranked, *order])
            climbing = order[: math.ceil(len(ranked) / FACTOR)]
        on_rows = f"on {total} rows, {FOLDS} folds"
        tasks = self.tasks(order, total)
        self.run(tasks, f"the best candidates first, {on_rows}", end)
        self._go_beyond(end)
        if self.judged < len(self.grid.differing):
            steps.append(f"{_counted(self.judged)} {on_rows}")
            self.how = f"successive halving: {', '.join(steps)}"

    @property
    def _sizes(self) -> list[int]:
        """Numbers of training rows of the steps of `halve`, ascending; all rows come last."""
        sizes = [self.training.rows]
        while sizes[0] // FACTOR >= LEAST_ROWS:
            sizes.insert(0, sizes[0] // FACTOR)
        return sizes

    def _with_optimum_first(self, families: list[Family]) -> list[Family]:
        """Return families without repetition, and before them that of the paper's optimum."""
        first = [family for family in self.grid.families if self.optimum in family]
        return [*dict.fromkeys([*first, *families])]

    def _drawn(self) -> list[Family]:
        """Draw the order of all families, with odds inverse to the work of their fits."""
        work = []
        for family in self.grid.families:
            served = {name: self.grid.differing[name] for name in family}
            work.append(expected_work(Task(self.model.name, served, 0, 1)))
        waiting = np.random.default_rng(self.training.seed).exponential(work)
        order = np.argsort(waiting, kind="stable")
        return [self.grid.families[place] for place in order]

    def _ranked(self, families: list[Family], rows: int) -> list[Family]:
        """Return the families with a score on the folds of a step, that of the best one first."""
        means = self.means(self.grid.differing, rows, STEP_FOLDS)
        best = {}
        for family in families:
            scores = [means[name] for name in family if name in means]
            if scores:
                best[family] = max(scores)
        return sorted(best, key=best.__getitem__, reverse=True)

    def _go_beyond(self, until: float = inf) -> None:
        """Extend the grid and search it as long as the winner lies at an end, until a time [s].

        The grid of before is kept where no fit of the extended one has ended.
        """
        while not self.stopping() and self.winner in self.grid.differing:
            before = self.grid
            judged = self.judged
            self.grid = before.extended(before.first[self.winner])
            added = self.grid.differing.keys() - before.differing.keys()
            families = [f for f in self.grid.families if not added.isdisjoint(f)]
            tasks = self.tasks(families, self.training.rows)
            title = f"the winner is at an end of the grid: {len(tasks)} fits beyond it"
            self.run(tasks, title, until)
            if self.judged == judged:
                self.grid = before
                return

    def folds(
        self, name: str, rows: int | None = None, folds: int = FOLDS
    ) -> list[float]:
        """Return the scores of a candidate on single folds.

        Parameters
        ----------
        name : str
            Name of the candidate, or of the baseline.
        rows : int, optional
            Training rows of the fits; all rows if None.
        folds : int
            Number of folds, from the first one.

        Returns
        -------
        list of float
            R2 on each fold; NaN where it has no score.
        """
        scores = []
        for fold in range(folds):
            trial = self.trials.finished.get(
                Place(name, fold, self.training.rows if rows is None else rows)
            )
            if trial is None or trial.r2 is None:
                scores.append(math.nan)
            else:
                scores.append(trial.r2)
        return scores

    def means(
        self, names: Iterable[str], rows: int | None = None, folds: int = FOLDS
    ) -> dict[str, float]:
        """Return the mean scores of candidates.

        Parameters
        ----------
        names : iterable of str
            Names of candidates, or of the baseline.
        rows : int, optional
            Training rows of the fits; all rows if None.
        folds : int
            Number of folds, from the first one.

        Returns
        -------
        dict
            Mean R2 over the folds by name, of those that have a score on each of these folds.
        """
        means = {name: float(np.mean(self.folds(name, rows, folds))) for name in names}
        return {name: mean for name, mean in means.items() if not math.isnan(mean)}

    @property
    def best(self) -> str:
        """Name of the best candidate of the grid, "" if none has a score on all folds."""
        means = self.means(self.grid.differing)
        return max(means, key=means.__getitem__, default="")

    @property
    def winner(self) -> str:
        """Name of the best candidate, or of the baseline where none is better; "" for no score."""
        best = (self.best,) if self.best else ()
        means = self.means([*self.baseline_family, *best])
        return max(means, key=means.__getitem__, default="")

    @property
    def judged(self) -> int:
        """Number of candidates whose fits to all rows are finished, failed ones included."""
        return sum(self._is_judged(name) for name in self.grid.differing)

    def _is_judged(self, name: str) -> bool:
        """Return whether the fits of a candidate to all rows are finished on every fold."""
        rows = self.training.rows
        places = (Place(name, fold, rows) for fold in range(FOLDS))
        return all(place in self.trials.finished for place in places)

    @property
    def failures(self) -> Counter[str]:
        """Numbers of scores on all rows that each failure has cost, by its reason."""
        return Counter(trial.failure for trial in self._of_all_rows() if trial.failure)

    @property
    def remarks(self) -> Counter[str]:
        """Numbers of scores on all rows that each warning concerns, by its text."""
        return Counter(trial.remark for trial in self._of_all_rows() if trial.remark)

    def _of_all_rows(self) -> list[Trial]:
        """Return the finished trials of the grid on all rows, in the order of its candidates."""
        trials = []
        for name, fold in product(self.grid.differing, range(FOLDS)):
            trial = self.trials.finished.get(Place(name, fold, self.training.rows))
            if trial is not None:
                trials.append(trial)
        return trials

    @property
    def seconds(self) -> float:
        """Sum of the times of all fits [s]."""
        return sum(trial.seconds for trial in self.trials.finished.values())

    @property
    def fault(self) -> str:
        """Why the search has no winner, "" if it has one."""
        if self.tasks([self.baseline_family], self.training.rows):
            return (
                f"not searched: the baseline was not finished on {FOLDS} folds within the time:"
                f" {self.advice}"
            )
        failures = self.failures
        if failures and not self.best:
            return "; ".join(failures)
        if self.judged < self._least_judged:
            return (
                f"not searched: {self.judged} of {len(self.grid.differing)} candidates were judged"
                f" over {FOLDS} folds of all rows, {self._least_judged} are needed: {self.advice}"
            )
        if self.optimum and not failures and not self.means([self.optimum]):
            return f"not searched: the paper's optimum was not judged: {self.advice}"
        return ""

    @property
    def _least_judged(self) -> int:
        """Number of candidates that have to be judged before there is a winner."""
        return min(LEAST_JUDGED, len(self.grid.differing))

    @property
    def advice(self) -> str:
        """The budget within which enough candidates would be judged, by the times of the fits."""
        stopped = max(self.ended, default=0.0)
        finished = self._seconds_of_fits()
        seconds = max(stopped, median(finished) if finished else 0.0)
        if not seconds:
            return "give a larger --budget"
        budget = budget_of(self._needed_seconds(seconds))
        fit_to_all = f"a fit to {self.training.rows} rows"
        if stopped >= seconds:
            return (
                f"{fit_to_all} was not finished in {seconds:.3g} s, so that {self._least_judged}"
                f" candidates need --budget {budget} or more"
            )
        return (
            f"{fit_to_all} takes {seconds:.3g} s, so that {self._least_judged} candidates need"
            f" --budget {budget}"
        )

    def _needed_seconds(self, of_fit: float) -> float:
        """Return the budget [s] of all searches if a fit to all rows takes some time [s].

        Fits to all rows have the share of one step; the winner's fit has what judging leaves.
        """
        candidates = max(len(self.grid.differing), 1)
        families = math.ceil(self._least_judged * len(self.grid.families) / candidates)
        fits = FOLDS * families
        if self.baseline_family:
            fits += FOLDS
        judging = fits * of_fit / self.executor.world.workers * len(self._sizes) / JUDGED
        return self.searches * max(judging, 2 * of_fit / (1 - JUDGED))

    def _seconds_of_fits(self) -> list[float]:
        """Return the times of finished fits to all rows [s], one for each family and fold."""
        families = [self.baseline_family, *self.grid.families]
        times = []
        for names, fold in product(families, range(FOLDS)):
            places = (Place(name, fold, self.training.rows) for name in names)
            trials = self.trials.finished
            # The candidates of a family share the time of one fit evenly.
            shares = [trials[place].seconds for place in places if place in trials]
            if shares:
                times.append(sum(shares))
        return times

    def _fits_done(self) -> int:
        """Return the number of fits of the grid to all rows that are finished."""
        rows = self.training.rows
        number = 0
        for family, fold in product(self.grid.families, range(FOLDS)):
            places = (Place(name, fold, rows) for name in family)
            if any(place in self.trials.finished for place in places):
                number += 1
        return number

    def report(self) -> SearchReport:
        """Return the description of the search for the result of its winner."""
        grid = self.grid
        return SearchReport(
            how=self.how,
            grid=self.source,
            rows=self.training.rows,
            candidates=len(grid.candidates),
            candidates_differing=len(grid.differing),
            candidates_scored=len(self.means(grid.differing)),
            fits_nominal=FOLDS * len(grid.candidates),
            fits=self._fits_done(),
            baseline_fits=int(np.isfinite(self.folds(self.baseline_name)).sum()),
            winner=self._place_of_winner(),
            ends=[*grid.ends(grid.first.get(self.best, grid.candidates[0]))],
            r2_folds=self._percent_of_folds(self.winner),
            grid_r2_folds=self._percent_of_folds(self.best),
            optimum_r2_folds=self._percent_of_folds(self.optimum),
            baseline_r2_folds=self._percent_of_folds(self.baseline_name),
            failures=dict(self.failures),
            remarks=dict(self.remarks),
        )

    def _place_of_winner(self) -> Literal["grid", "optimum", "baseline"]:
        """Return whether the baseline, the paper's optimum or another candidate has won."""
        if self.winner == self.baseline_name:
            return "baseline"
        if self.best == self.optimum:
            return "optimum"
        return "grid"

    def _percent_of_folds(self, name: str) -> list[float]:
        """Return R2 on the folds of all rows [%]; empty unless there is a score on all of them."""
        scores = self.folds(name)
        if any(map(math.isnan, scores)):
            return []
        return [100 * r2 for r2 in scores]


def _counted(number: int) -> str:
    """Return a number of candidates in words."""
    return "1 candidate" if number == 1 else f"{number} candidates"
