"""The search of a grid: exact scores of its candidates, each distinct fit done once on a worker.

The score of a candidate is the mean R2 over the folds of all rows. Ties go to the first in the
order of ParameterGrid; candidates with a failed fold come last. The baseline, which is no point of
the grid, wins where no candidate is better.

Within a given time, successive halving on the number of training rows says who is judged, as in
scikit-learn's HalvingGridSearchCV: all candidates are fitted to few rows, the best third to three
times as many, and so on. scikit-learn's own halving knows rows, not hours, shares no fits, and can
be neither spread over machines nor resumed.
"""

import math
import time
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from itertools import product
from math import inf
from statistics import median
from typing import Any

import numpy as np

from gen.runtime.terminal import RunProgress
from learn.comparison import grid as grids
from learn.comparison.fits import Training, Trial, Trials, fit
from learn.comparison.grid import LEAST_JUDGED, Grid, Settings, Task, expected_work
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
    """A search of a model's grid: its data, its finished fits, and what they say."""

    model: Model
    grid: Grid
    training: Training
    trials: Trials
    executor: Executor
    stopping: Callable[[], bool] = lambda: (
        False
    )  # asked before a fit; True ends the search
    source: str = grids.TABLE_2  # name of the grid in results and tables
    baseline: Settings | None = None  # is judged beside the grid; None for the grid alone
    optimum: str = (
        ""  # name of the paper's candidate, or the one built in; "" if there is none
    )
    how: str = "whole grid"  # the steps of the search in words
    searches: int = 1  # that share the budget, this one among them
    ended: list[float] = field(
        default_factory=list
    )  # times after which fits to all rows ended [s]

    @property
    def own(self) -> Family:
        """The name of the baseline, as a family."""
        return () if self.baseline is None else (grids.key(self.baseline, baseline=True),)

    def tasks(
        self, families: Iterable[Family], rows: int, folds: int = FOLDS
    ) -> list[Task]:
        """List the fits on some rows and folds that families, or the baseline, still lack."""
        tasks, settings = (
            [],
            self.grid.differing | dict.fromkeys(self.own, self.baseline or {}),
        )
        for names, fold in product(families, range(folds)):
            lacking = [n for n in names if (n, fold, rows) not in self.trials.finished]
            served = {name: settings[name] for name in lacking}
            if served:
                tasks.append(
                    Task(self.model.name, served, fold, rows, baseline=names == self.own)
                )
        return tasks

    def run(self, tasks: list[Task], title: str, until: float = inf) -> None:
        """Do fits after a line that is the title, and keep their trials.

        No fit is begun after the time `until` of `time.time`, at which fits are stopped [s].
        InputError is raised for a full disk, or a machine that lacks the memory for a fit.
        """

        def over() -> bool:
            return self.stopping() or time.time() > until

        if not tasks or over():
            return
        with RunProgress(len(tasks), "fits", sum(map(expected_work, tasks))) as progress:
            progress.say(f"{self.model.title}: {title}")

            def keep(task: Task, result: list[Trial] | Ended) -> None:
                trials = [] if isinstance(result, Ended) else result
                if (
                    isinstance(result, Ended)
                    and result.seconds
                    and task.rows == self.training.rows
                ):
                    self.ended.append(result.seconds)
                self.trials.add(trials)
                failed = all(trial.r2 is None for trial in trials)
                progress.advance(1, failed=int(failed), work=expected_work(task))

            self.executor.run(fit, self.training, tasks, keep, stopping=over, until=until)

    def exhaust(self) -> None:
        """Search the whole grid, and beyond an end at which the winner lies."""
        self.fit_all()
        self._go_beyond()

    def fit_all(self) -> None:
        """Do all fits of the grid and of the baseline."""
        grid, rows = self.grid, self.training.rows
        tasks, own = self.tasks(grid.families, rows), self.tasks([self.own], rows)
        title = (
            f"{len(grid.candidates)} candidates, {len(grid.differing)} differ,"
            f" {FOLDS * len(grid.families)} fits, {len(tasks)} to do, {len(own)} of the baseline"
        )
        # The longest first: the last ones are short, so that no process waits long at the end.
        self.run(sorted([*tasks, *own], key=expected_work, reverse=True), title)

    def halve(self, until: float) -> None:
        """Search the grid until a time of `time.time`, at which the winner has its last fit too.

        The steps, and the judgement over five folds of all rows, have equal shares of three
        quarters of the time; what does not end in its share is left out. The paper's optimum is on
        every step, and the first to be judged: few rows must not hide it.
        """
        total, began, sizes = self.training.rows, time.time(), self._sizes
        share = JUDGED * (until - began) / len(sizes)
        end = began + len(sizes) * share
        self.run(self.tasks([self.own], total), f"the baseline on {total} rows", end)
        told, optimum = (
            [],
            [family for family in self.grid.families if self.optimum in family],
        )
        order = climbing = [*dict.fromkeys([*optimum, *self._drawn()])]
        for place, rows in enumerate(sizes[:-1], start=1):
            on = f"on {rows} rows, {STEP_FOLDS} folds"
            tasks = self.tasks(climbing, rows, STEP_FOLDS)
            self.run(tasks, f"candidates {on}", began + place * share)
            means = self.means(self.grid.differing, rows, STEP_FOLDS)
            told += [f"{_counted(len(means))} {on}"] if means else []
            best = {
                family: max(means.get(each, -inf) for each in family) for family in order
            }
            ranked = sorted(
                (f for f in order if best[f] > -inf), key=best.__getitem__, reverse=True
            )
            order = [*dict.fromkeys([*optimum, *ranked, *order])]
            climbing = order[: math.ceil(len(ranked) / FACTOR)]
        on = f"on {total} rows, {FOLDS} folds"
        self.run(self.tasks(order, total), f"the best candidates first, {on}", end)
        self._go_beyond(end)
        if self.judged < len(self.grid.differing):
            self.how = f"successive halving: {', '.join([*told, f'{_counted(self.judged)} {on}'])}"

    @property
    def _sizes(self) -> list[int]:
        """Numbers of training rows of the steps of `halve`, ascending; all rows come last."""
        sizes = [self.training.rows]
        while sizes[0] // FACTOR >= LEAST_ROWS:
            sizes.insert(0, sizes[0] // FACTOR)
        return sizes

    def _drawn(self) -> list[Family]:
        """Draw the order of all families, with odds inverse to the work of their fits."""
        families, settings = self.grid.families, self.grid.differing
        served = ({name: settings[name] for name in family} for family in families)
        work = [expected_work(Task(self.model.name, each, 0, 1)) for each in served]
        waiting = np.random.default_rng(self.training.seed).exponential(work)
        return [families[place] for place in np.argsort(waiting, kind="stable")]

    def _go_beyond(self, until: float = inf) -> None:
        """Go on beyond the ends of a grid as long as the winner lies on one, in time."""
        while not self.stopping() and self.winner in self.grid.differing:
            before, judged = self.grid, self.judged
            self.grid = before.extended(before.first[self.winner])
            new = self.grid.differing.keys() - before.differing.keys()
            wider = [
                family for family in self.grid.families if not new.isdisjoint(family)
            ]
            tasks = self.tasks(wider, self.training.rows)
            title = f"the winner is at an end of the grid: {len(tasks)} fits beyond it"
            self.run(tasks, title, until)
            if self.judged == judged:
                self.grid = before
                return

    def folds(self, name: str, rows: int = 0, folds: int = FOLDS) -> list[float]:
        """Return R2 of a candidate on every fold of some rows, or all; NaN where it lacks."""
        places = ((name, fold, rows or self.training.rows) for fold in range(folds))
        found = (self.trials.finished.get(place) for place in places)
        return [
            math.nan if trial is None or trial.r2 is None else trial.r2 for trial in found
        ]

    def means(
        self, names: Iterable[str], rows: int = 0, folds: int = FOLDS
    ) -> dict[str, float]:
        """Return the mean R2 of the candidates that have one on every fold, by name."""
        means = {name: float(np.mean(self.folds(name, rows, folds))) for name in names}
        return {name: mean for name, mean in means.items() if not math.isnan(mean)}

    @property
    def best(self) -> str:
        """Name of the best candidate of the grid, "" if all have failed."""
        means = self.means(self.grid.differing)
        return max(means, key=means.__getitem__, default="")

    @property
    def winner(self) -> str:
        """Name of the best candidate, or of the baseline where none is better; "" for no score."""
        means = self.means([*self.own, *filter(None, [self.best])])
        return max(means, key=means.__getitem__, default="")

    @property
    def judged(self) -> int:
        """Number of candidates whose fits to all rows are finished, failed ones included."""
        done, rows = self.trials.finished, self.training.rows
        places = (
            [(name, fold, rows) for fold in range(FOLDS)] for name in self.grid.differing
        )
        return sum(all(place in done for place in of_one) for of_one in places)

    def counted(self, what: str) -> dict[str, int]:
        """Count the scores on all rows that each "failure" has cost, or each "remark" concerns."""
        places = product(self.grid.differing, range(FOLDS), [self.training.rows])
        found = [
            self.trials.finished[place]
            for place in places
            if place in self.trials.finished
        ]
        return Counter(text for trial in found if (text := getattr(trial, what)))

    @property
    def seconds(self) -> float:
        """Sum of the times of all fits."""
        return sum(trial.seconds for trial in self.trials.finished.values())

    @property
    def fault(self) -> str:
        """Why the search has no winner, "" if it has one."""
        least, failures = (
            min(LEAST_JUDGED, len(self.grid.differing)),
            self.counted("failure"),
        )
        if self.tasks([self.own], self.training.rows):
            return (
                f"not searched: the baseline was not finished on {FOLDS} folds within the time:"
                f" {self.advice}"
            )
        if failures and not self.best:
            return "; ".join(failures)
        if self.judged < least:
            return (
                f"not searched: {self.judged} of {len(self.grid.differing)} candidates were judged"
                f" over {FOLDS} folds of all rows, {least} are needed:"
                f" {self.advice}"
            )
        if self.optimum and not failures and not self.means([self.optimum]):
            return f"not searched: the paper's optimum was not judged: {self.advice}"
        return ""

    @property
    def advice(self) -> str:
        """Which budget would judge as many candidates as have to be, by the times of its fits."""
        longest = max(self.ended, default=0.0)
        finished = self._seconds_of_fits()
        seconds = max(longest, median(finished) if finished else 0.0)
        if not seconds:
            return "give a larger --budget"
        least = min(LEAST_JUDGED, len(self.grid.differing))
        families = math.ceil(
            least * len(self.grid.families) / max(len(self.grid.differing), 1)
        )
        fits = FOLDS * (families + len([self.own] if self.own else []))
        # Fits to all rows have the share of one step; the winner's has what judging leaves.
        judging = fits * seconds / self.executor.world.workers * len(self._sizes) / JUDGED
        needed = self.searches * max(judging, 2 * seconds / (1 - JUDGED))
        fit = f"a fit to {self.training.rows} rows"
        budget = budget_of(needed)
        if longest >= seconds:
            taken = f"{fit} was not finished in {seconds:.3g} s"
            return f"{taken}, so that {least} candidates need --budget {budget} or more"
        return f"{fit} takes {seconds:.3g} s, so that {least} candidates need --budget {budget}"

    def _seconds_of_fits(self) -> list[float]:
        """Return the times of finished fits to all rows [s], each of which serves a family."""
        rows, finished = self.training.rows, self.trials.finished
        times = []
        for names, fold in product([self.own, *self.grid.families], range(FOLDS)):
            shares = [
                finished[name, fold, rows].seconds
                for name in names
                if (name, fold, rows) in finished
            ]
            if shares:
                times.append(sum(shares))
        return times

    def report(self) -> dict[str, Any]:
        """Describe the search in the result of its winner."""
        grid, own, rows = self.grid, "".join(self.own), self.training.rows
        fits, finished = product(grid.families, range(FOLDS)), self.trials.finished.keys()
        deciding = {
            "r2_folds": self.winner,
            "grid_r2_folds": self.best,
            "optimum_r2_folds": self.optimum,
            "baseline_r2_folds": own,
        }
        place = "optimum" if self.best == self.optimum else "grid"
        return {
            "how": self.how,
            "grid": self.source,
            "rows": rows,
            "candidates": len(grid.candidates),
            "candidates_differing": len(grid.differing),
            "candidates_scored": len(self.means(grid.differing)),
            "fits_nominal": FOLDS * len(grid.candidates),
            "fits": sum(
                not finished.isdisjoint((name, fold, rows) for name in f)
                for f, fold in fits
            ),
            "baseline_fits": int(np.isfinite(self.folds(own)).sum()),
            "winner": "baseline" if self.winner == own else place,
            "ends": [
                *grid.ends(grid.first[self.best] if self.best else grid.candidates[0])
            ],
            **{
                key: [100 * r2 for r2 in self.folds(name)] if self.means([name]) else []
                for key, name in deciding.items()
            },
            "failures": self.counted("failure"),
            "remarks": self.counted("remark"),
        }


def _counted(number: int) -> str:
    return f"{number} candidate{'' if number == 1 else 's'}"
