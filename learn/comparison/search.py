"""The search of a grid, whose candidates are scored by fits on the workers; no fit is done twice.

The score of a candidate is its mean R2 over the folds of all training rows. The candidate with the
largest score is the best one, and the first of these in the order of ParameterGrid if several have
equal scores. A candidate with a failed fold has no score. The baseline, which is not a point of the
grid, wins if no candidate is better.

If the time or the number of candidates is limited, successive halving on the number of training
rows chooses the candidates that are judged, as in scikit-learn's HalvingGridSearchCV: candidates
are fitted to few rows, the best third of them to three times as many rows, and so on.
scikit-learn's own halving is limited by rows and not by time, shares no fits, and can be neither
spread over machines nor resumed. `GridSearch.halve` is limited by a time, and `GridSearch.choose`
by a number of candidates, so that a busy machine judges as many of them as one at rest.

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

STEP_FOLDS = 2  # number of folds on which a step of halving ranks its candidates
JUDGED = 0.75  # share of the time for judging; the rest is for the last fit of the winner
# A step of halving keeps one of `FACTOR` candidates for the next step, which has `FACTOR` times as
# many rows.
FACTOR = 3
LEAST_ROWS = 300  # smallest number of training rows of the first step
# Largest processor time of a candidate in a step of `choose` [s]. Of the candidates that take
# longer, only the optimum and the best other one take part.
LONGEST = 300.0

Family = tuple[str, ...]
"""Names of all candidates that one fit serves. The baseline is a family by itself."""


@dataclass
class GridSearch:
    """A search of a model's grid: its data, its finished fits, and the winner by these fits.

    The finished fits are kept in the file of `trials`: a search with trials of an earlier, equal
    search goes on where that one was stopped.
    """

    model: Model
    grid: Grid  # replaced by a larger one if the search goes on beyond its ends
    training: Training  # training rows, and the options of all fits
    trials: Trials  # finished fits
    executor: Executor  # workers that do the fits
    # called before a fit; True ends the search
    stopping: Callable[[], bool] = lambda: False
    source: str = grids.TABLE_2  # name of the grid in results and tables
    # settings of the baseline, which is judged besides the candidates; None for no baseline
    baseline: SettingValues | None = None
    # name of the candidate that is judged first: the paper's optimum, or the default of another
    # grid; "" without one
    optimum: str = ""
    how: str = "whole grid"  # steps of the search in words
    searches: int = 1  # number of searches that share the budget, this one included
    # times after which fits to all rows were stopped [s]
    ended: list[float] = field(default_factory=list)
    enough: int = LEAST_JUDGED  # number of judged candidates that a winner needs

    @property
    def baseline_family(self) -> Family:
        """The baseline as a family of one name; empty without a baseline."""
        if self.baseline is None:
            return ()
        return (grids.key(self.baseline, baseline=True),)

    @property
    def baseline_name(self) -> str:
        """Name of the baseline; "" without one."""
        return "".join(self.baseline_family)

    def tasks(
        self, families: Iterable[Family], rows: int, folds: int = FOLDS
    ) -> list[Task]:
        """List the fits of families that are not finished.

        Parameters
        ----------
        families : iterable of tuple of str
            Families of the grid, or that of the baseline. Empty families need no fits.
        rows : int
            Largest number of training rows of a fit.
        folds : int
            Number of folds; the first ones are used.

        Returns
        -------
        list of Task
            One fit for each family and fold, with the candidates that have no trial yet. Families
            and folds without such candidates are left out.
        """
        settings = dict(self.grid.differing)
        if self.baseline is not None:
            settings[self.baseline_name] = self.baseline
        tasks = []
        for family, fold in product(families, range(folds)):
            candidates = {
                name: settings[name]
                for name in family
                if Place(name, fold, rows) not in self.trials.finished
            }
            if candidates:
                task = Task(
                    model=self.model.name,
                    candidates=candidates,
                    fold=fold,
                    rows=rows,
                    baseline=family == self.baseline_family,
                )
                tasks.append(task)
        return tasks

    def run(self, tasks: list[Task], title: str, until: float = inf) -> None:
        """Do fits on the workers, and add their trials to `trials`.

        A line with the title and a progress bar are shown. Nothing is done or shown if there are no
        tasks, if `stopping` ends the search, or if the time is over.

        Parameters
        ----------
        tasks : list of Task
            Fits, in the order in which they are begun.
        title : str
            Description of the fits for the user.
        until : float
            Time of `time.time` after which no fit is begun, and at which fits are stopped [s].

        Raises
        ------
        InputError
            If the file of trials cannot be written, or a machine lacks the memory for a fit.
        """

        def is_over() -> bool:
            """Return whether no further fit may begin."""
            return self.stopping() or time.time() > until

        if not tasks or is_over():
            return
        work = sum(map(expected_work, tasks))
        with RunProgress(len(tasks), "fits", work) as progress:
            progress.say(f"{self.model.title}: {title}")

            def on_result(task: Task, result: list[Trial] | Ended) -> None:
                """Keep the result of a fit, and count the fit in the progress bar."""
                has_failed = self._keep(task, result)
                work_done = expected_work(task)
                progress.advance(rows=1, failed=int(has_failed), work=work_done)

            self.executor.run(
                fit, self.training, tasks, on_result, stopping=is_over, until=until
            )

    def _keep(self, task: Task, result: list[Trial] | Ended) -> bool:
        """Keep the trials of a fit, and return whether all of them have failed.

        A fit that was stopped has failed, too, and has no trials. Its time is added to `ended` if
        the fit was to all rows.
        """
        if isinstance(result, Ended):
            # A fit that was stopped before it began has no time.
            if result.seconds and task.rows == self.training.rows:
                self.ended.append(result.seconds)
            return True
        self.trials.add(result)
        return all(trial.r2 is None for trial in result)

    def exhaust(self) -> None:
        """Search the whole grid, and go on beyond an end that the winner is at; see `run`."""
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

        If not all candidates were judged, `how` becomes a description of the steps.

        The steps on fewer rows and the judgement on all rows share the part `JUDGED` of the time
        equally. A fit that does not end within the time of its step is stopped. The rest of the
        time is for the last fit of the winner. The optimum takes part in every step that has any
        candidates and is judged first, even if it is not among the best on few rows.

        Parameters
        ----------
        until : float
            Time of `time.time` by which also the last fit of the winner has to end [s].
        """
        total = self.training.rows
        began = time.time()
        seconds_of_step = JUDGED * (until - began) / len(self._sizes)
        end_of_judging = began + len(self._sizes) * seconds_of_step
        baseline = self.tasks([self.baseline_family], total)
        self.run(baseline, f"the baseline on {total} rows", end_of_judging)
        order = self._with_optimum_first(self._drawn_families())
        remaining = order  # families that take part in the next step
        steps = []
        for number, rows in enumerate(self._sizes[:-1], start=1):
            on_rows = f"on {rows} rows, {STEP_FOLDS} folds"
            tasks = self.tasks(remaining, rows, STEP_FOLDS)
            end_of_step = began + number * seconds_of_step
            self.run(tasks, f"candidates {on_rows}", end_of_step)
            scored = len(self.means(self.grid.differing, rows, STEP_FOLDS))
            if scored:
                steps.append(f"{_counted(scored)} {on_rows}")
            ranked = self._ranked(order, rows)
            # Families without a score on this step stay behind the ranked ones. If no family has a
            # score, nothing is left for the next steps, and the judgement takes the old order.
            order = self._with_optimum_first([*ranked, *order])
            remaining = order[: math.ceil(len(ranked) / FACTOR)]
        on_rows = f"on {total} rows, {FOLDS} folds"
        tasks = self.tasks(order, total)
        self.run(tasks, f"the best candidates first, {on_rows}", end_of_judging)
        self._go_beyond(end_of_judging)
        if self.judged < len(self.grid.differing):
            steps.append(f"{_counted(self.judged)} {on_rows}")
            self.how = f"successive halving: {', '.join(steps)}"

    def choose(self, number: int) -> None:
        """Judge a number of candidates of the grid, which successive halving chooses; see `run`.

        No fit is stopped. Times decide only which candidates are too long (`LONGEST`), so that
        another call with equal trials makes the same choice. Each step on fewer rows has `FACTOR`
        times as many candidates as the next one. All candidates of a family take part together.

        `how` becomes a description of the steps. `enough` becomes smaller if too few candidates are
        judged because the fits of others are long. A winner at an end of the grid, for which
        `report` names the end, is followed beyond it unless its own fits are long.

        Parameters
        ----------
        number : int
            Smallest number of candidates that are judged, besides the family of the optimum.
        """
        total = self.training.rows
        baseline = self.tasks([self.baseline_family], total)
        self.run(baseline, f"the baseline on {total} rows")
        order = self._drawn_families()
        # number of candidates of the first step
        number_of_step = number * FACTOR ** (len(self._sizes) - 1)
        steps = []
        for rows in self._sizes[:-1]:
            families = self._families_of_step(order, number_of_step, rows, STEP_FOLDS)
            on_rows = f"on {rows} rows, {STEP_FOLDS} folds"
            self.run(self.tasks(families, rows, STEP_FOLDS), f"candidates {on_rows}")
            steps.append(f"{_counted(_size(families))} {on_rows}")
            # If no candidate has a score, the next step takes the old order.
            order = self._ranked(families, rows) or families
            number_of_step //= FACTOR
        families = self._families_of_step(order, number_of_step, total, FOLDS)
        self.enough = min(LEAST_JUDGED, _size(families))
        on_rows = f"on {total} rows, {FOLDS} folds"
        self.run(self.tasks(families, total), f"the best candidates {on_rows}")
        if self._winner_seconds() <= LONGEST:
            self._go_beyond()
        if self.judged < len(self.grid.differing):
            steps.append(f"{_counted(self.judged)} {on_rows}")
            self.how = f"successive halving: {', '.join(steps)}"

    def _families_of_step(
        self, order: list[Family], number: int, rows: int, folds: int
    ) -> list[Family]:
        """Return the families that take part in a step of `choose`.

        They are the family of the optimum, the first other one in `order`, and the next ones whose
        fits are not long, until there are `number` candidates besides the optimum's family.
        """
        families = [family for family in self.grid.families if self.optimum in family]
        others = [family for family in order if family not in families]
        families += others[:1]
        counted = _size(others[:1])
        for family in others[1:]:
            if counted >= number:
                break
            if self._expected_seconds(family, rows, folds) <= LONGEST:
                families.append(family)
                counted += len(family)
        return families

    def _expected_seconds(self, family: Family, rows: int, folds: int) -> float:
        """Estimate the processor time of a candidate of a family in a step of `choose` [s].

        `rows` and `folds` are the training rows and folds of the step. The estimate is from the
        fits of the step before; it is 0 without such fits.
        """
        sizes_before = [size for size in self._sizes if size < rows]
        if not sizes_before:
            return 0.0
        before = sizes_before[-1]
        shares = self._seconds_of(family, before, range(STEP_FOLDS))
        if not shares:
            return 0.0
        growth = float((rows / before) ** self.model.growth)
        return folds * growth * sum(shares) / len(shares)

    def _winner_seconds(self) -> float:
        """Return the processor time of all fits to all rows of the winner's family [s].

        It is 0 without a winner, and if the baseline is the winner.
        """
        seconds = 0.0
        for family in self.grid.families:
            if self.winner in family:
                seconds += sum(self._seconds_of(family, self.training.rows, range(FOLDS)))
        return seconds

    def _seconds_of(self, family: Family, rows: int, folds: Iterable[int]) -> list[float]:
        """Return the processor times of the finished trials of a family on some folds [s].

        Each candidate of a family has an equal share of the time of their fit.
        """
        places = (Place(name, fold, rows) for name, fold in product(family, folds))
        trials = self.trials.finished
        return [trials[place].seconds for place in places if place in trials]

    @property
    def _sizes(self) -> list[int]:
        """Numbers of training rows of the steps of halving, ascending; all rows come last."""
        sizes = [self.training.rows]
        while sizes[0] // FACTOR >= LEAST_ROWS:
            sizes.insert(0, sizes[0] // FACTOR)
        return sizes

    def _with_optimum_first(self, families: list[Family]) -> list[Family]:
        """Return families without repetition, the family of the optimum first."""
        first = [family for family in self.grid.families if self.optimum in family]
        # A dictionary keeps the first of equal keys.
        return list(dict.fromkeys([*first, *families]))

    def _drawn_families(self) -> list[Family]:
        """Return all families in a random order, in which families of quick fits tend to be first.

        The order is drawn with the seed of the training. The probability that a family comes next
        is in inverse proportion to the expected work of its fit.
        """
        work = []
        for family in self.grid.families:
            candidates = {name: self.grid.differing[name] for name in family}
            # Families are compared by the work of one fit; any fold and number of rows will do.
            task = Task(self.model.name, candidates, fold=0, rows=1)
            work.append(expected_work(task))
        # Each family gets a random waiting time from an exponential distribution whose mean is its
        # work. The probability that its time is the smallest is in inverse proportion to this mean.
        waiting_times = np.random.default_rng(self.training.seed).exponential(work)
        order = np.argsort(waiting_times, kind="stable")
        return [self.grid.families[place] for place in order]

    def _ranked(self, families: list[Family], rows: int) -> list[Family]:
        """Return the families with a score on a step of halving, from the best to the worst.

        The score of a family is that of its best candidate on `rows` training rows.
        """
        means = self.means(self.grid.differing, rows, STEP_FOLDS)
        best = {}
        for family in families:
            scores = [means[name] for name in family if name in means]
            if scores:
                best[family] = max(scores)
        return sorted(best, key=best.__getitem__, reverse=True)

    def _go_beyond(self, until: float = inf) -> None:
        """Replace the grid by larger ones and search them, while the winner is at an end.

        This ends when no additional candidate of a larger grid was judged; the last grid with a
        judged additional candidate is kept, or the first grid. Fits are stopped at the time `until`
        of `time.time` [s].
        """
        while not self.stopping() and self.winner in self.grid.differing:
            smaller_grid = self.grid
            judged = self.judged
            self.grid = smaller_grid.extended(smaller_grid.first[self.winner])
            added = self.grid.differing.keys() - smaller_grid.differing.keys()
            families = [
                family for family in self.grid.families if not added.isdisjoint(family)
            ]
            tasks = self.tasks(families, self.training.rows)
            title = f"the winner is at an end of the grid: {len(tasks)} fits beyond it"
            self.run(tasks, title, until)
            if self.judged == judged:
                # There was no candidate to add, or no time for it.
                self.grid = smaller_grid
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
            Largest number of training rows of the fits; all rows by default.
        folds : int
            Number of folds; the first ones are used.

        Returns
        -------
        list of float
            R2 on each fold; NaN on a fold without a finished fit, or with one that failed.
        """
        if rows is None:
            rows = self.training.rows
        scores = []
        for fold in range(folds):
            trial = self.trials.finished.get(Place(name, fold, rows))
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
            Largest number of training rows of the fits; all rows by default.
        folds : int
            Number of folds; the first ones are used.

        Returns
        -------
        dict of str to float
            Mean R2 over the folds by name. Names without a score on every fold are left out.
        """
        means = {name: float(np.mean(self.folds(name, rows, folds))) for name in names}
        return {name: mean for name, mean in means.items() if not math.isnan(mean)}

    @property
    def best(self) -> str:
        """Name of the best candidate of the grid; "" if none has a score on all folds."""
        means = self.means(self.grid.differing)
        return max(means, key=means.__getitem__, default="")

    @property
    def winner(self) -> str:
        """Name of the best candidate, or of the baseline if no candidate is better.

        It is "" if neither has a score on all folds.
        """
        names = [name for name in (self.baseline_name, self.best) if name]
        # The baseline is first: `max` takes it if scores are equal.
        means = self.means(names)
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
        """Number of missing scores of candidates on all rows, by the reason of the failure."""
        return Counter(trial.failure for trial in self._of_all_rows() if trial.failure)

    @property
    def remarks(self) -> Counter[str]:
        """Number of scores of candidates on all rows whose fits had a warning, by its text."""
        return Counter(trial.remark for trial in self._of_all_rows() if trial.remark)

    def _of_all_rows(self) -> list[Trial]:
        """Return the finished trials of candidates on all rows, in the order of the candidates."""
        trials = []
        for name, fold in product(self.grid.differing, range(FOLDS)):
            trial = self.trials.finished.get(Place(name, fold, self.training.rows))
            if trial is not None:
                trials.append(trial)
        return trials

    @property
    def seconds(self) -> float:
        """Sum of the times of all finished fits, those of the baseline included [s]."""
        return sum(trial.seconds for trial in self.trials.finished.values())

    @property
    def fault(self) -> str:
        """Reason why the search has no winner; "" if it has one."""
        # The winner has to be compared with the baseline.
        if self.tasks([self.baseline_family], self.training.rows):
            return (
                f"not searched: the baseline was not finished on {FOLDS} folds within the time:"
                f" {self.advice}"
            )
        failures = self.failures
        if failures and not self.best:
            return "; ".join(failures)
        # Too few candidates are no search; with more time, enough would be judged.
        if self.judged < self._least_judged:
            return (
                f"not searched: {self.judged} of {len(self.grid.differing)} candidates were judged"
                f" over {FOLDS} folds of all rows, {self._least_judged} are needed: {self.advice}"
            )
        # The winner has to be compared with the optimum as well, unless there are failures: the fit
        # of the optimum may have failed, and more time would not give it a score.
        if self.optimum and not failures and not self.means([self.optimum]):
            return f"not searched: the optimum of the grid was not judged: {self.advice}"
        return ""

    @property
    def _least_judged(self) -> int:
        """Number of candidates that have to be judged for a winner."""
        return min(self.enough, len(self.grid.differing))

    @property
    def advice(self) -> str:
        """Advice for the user: a budget within which enough candidates would be judged.

        It is estimated from the times of fits to all rows, if there are some.
        """
        # The median time of the finished fits, and the longest time of a stopped fit. Each is 0
        # without such fits.
        finished = 0.0
        times = self._seconds_of_fits()
        if times:
            finished = median(times)
        stopped = max(self.ended, default=0.0)
        seconds = max(stopped, finished)
        if not seconds:
            return "give a larger --budget"
        budget = budget_of(self._needed_seconds(seconds))
        fit_to_all = f"a fit to {self.training.rows} rows"
        if stopped >= finished:
            # The time of a fit that was stopped is a lower bound only.
            return (
                f"{fit_to_all} was not finished in {seconds:.3g} s, so that {self._least_judged}"
                f" candidates need --budget {budget} or more"
            )
        return (
            f"{fit_to_all} takes {seconds:.3g} s, so that {self._least_judged} candidates need"
            f" --budget {budget}"
        )

    def _needed_seconds(self, of_fit: float) -> float:
        """Return the budget of all searches [s] that is needed for enough judged candidates.

        `of_fit` is the time of a fit to all rows [s]. The time for judging is one of
        `len(self._sizes)` equal shares of `JUDGED` of the budget (see `halve`). The rest of the
        budget is for the last fit of the winner, and has to be twice the time of a fit.
        """
        candidates = max(len(self.grid.differing), 1)
        families = math.ceil(self._least_judged * len(self.grid.families) / candidates)
        fits = FOLDS * families
        if self.baseline_family:
            fits += FOLDS
        judging = fits * of_fit / self.executor.world.workers * len(self._sizes) / JUDGED
        last_fit = 2 * of_fit / (1 - JUDGED)
        return self.searches * max(judging, last_fit)

    def _seconds_of_fits(self) -> list[float]:
        """Return the times of finished fits to all rows [s], one for each family and fold."""
        families = [self.baseline_family, *self.grid.families]
        times = []
        for family, fold in product(families, range(FOLDS)):
            shares = self._seconds_of(family, self.training.rows, [fold])
            if shares:
                times.append(sum(shares))
        return times

    def _fits_done(self) -> int:
        """Return the number of finished fits of candidates to all rows."""
        rows = self.training.rows
        number = 0
        for family, fold in product(self.grid.families, range(FOLDS)):
            places = (Place(name, fold, rows) for name in family)
            if any(place in self.trials.finished for place in places):
                number += 1
        return number

    def report(self) -> SearchReport:
        """Return the report of the search, for the result of its winner.

        Returns
        -------
        SearchReport
            The report. The search must have a winner (`fault` is "").
        """
        grid = self.grid
        # The best candidate, or the first one if none has a score on all folds.
        best = grid.first.get(self.best, grid.candidates[0])
        baseline_fits = int(np.isfinite(self.folds(self.baseline_name)).sum())
        return SearchReport(
            how=self.how,
            grid=self.source,
            rows=self.training.rows,
            candidates=len(grid.candidates),
            candidates_differing=len(grid.differing),
            candidates_scored=len(self.means(grid.differing)),
            fits_nominal=FOLDS * len(grid.candidates),
            fits=self._fits_done(),
            baseline_fits=baseline_fits,
            enough=self._least_judged,
            winner=self._place_of_winner(),
            ends=list(grid.ends(best)),
            r2_folds=self._percent_of_folds(self.winner),
            grid_r2_folds=self._percent_of_folds(self.best),
            optimum_r2_folds=self._percent_of_folds(self.optimum),
            baseline_r2_folds=self._percent_of_folds(self.baseline_name),
            failures=dict(self.failures),
            remarks=dict(self.remarks),
        )

    def _place_of_winner(self) -> Literal["grid", "optimum", "baseline"]:
        """Return "baseline", "optimum" or, if another candidate has won, "grid"."""
        if self.winner == self.baseline_name:
            return "baseline"
        if self.best == self.optimum:
            return "optimum"
        return "grid"

    def _percent_of_folds(self, name: str) -> list[float]:
        """Return R2 of a candidate or the baseline on the folds of all rows [%].

        It is empty unless there is a score on every fold.
        """
        scores = self.folds(name)
        if any(map(math.isnan, scores)):
            return []
        return [100 * r2 for r2 in scores]


def _size(families: Iterable[Family]) -> int:
    """Return the number of candidates of families."""
    return sum(len(family) for family in families)


def _counted(number: int) -> str:
    """Write a number of candidates, as "1 candidate" or "3 candidates"."""
    if number == 1:
        return "1 candidate"
    return f"{number} candidates"
