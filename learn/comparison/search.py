"""The search of a grid: exact scores of its candidates, each distinct fit done once on a worker.

The score of a candidate is the mean R2 over the folds of all rows. Ties go to the first in the
order of ParameterGrid; candidates with a failed fold come last. The baseline, which is no point of
the grid, wins where no candidate is better. Where the winner lies at an end of the grid, the search
goes on beyond it. A killed search resumes where it was: the master keeps every finished fit.

Within a given time, successive halving on the number of training rows says who is judged: all
candidates are fitted to few rows and scored on two folds, the best third on three times as many,
and so on. Then candidates are judged over five folds of all rows, the best ones first, until the
time is over. A model of which fewer than `LEAST_JUDGED` candidates were judged, or not the paper's,
counts as not searched. scikit-learn's own halving knows rows, not hours, shares no fits, and can
be neither spread over machines nor resumed.
"""

import math
import time
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from itertools import product
from math import inf

import numpy as np

from gen.arrays import Values
from gen.runtime.terminal import RunProgress
from learn.comparison import grid as grids
from learn.comparison.fits import Training, Trial, Trials, fit
from learn.comparison.grid import LEAST_JUDGED, Grid, Settings, Task, expected_work
from learn.executor import Executor
from learn.models import Model
from learn.split import FOLDS

RUNG_FOLDS = 2
"""Folds on which a rung ranks its candidates."""

RUNGS_SHARE = 0.4
"""Share of the time after which all rungs have ended, in equal parts."""

DECISION_SHARE = 0.75
"""Share of the time after which the decision has ended; the winner's fit to all rows gets the rest.

A fit of the decision is stopped once a fit to all rows would need more than that.
"""

ALWAYS = 5.0
"""Seconds that a fit may take in any case: the first one of a process loads its library."""

FACTOR = 3
"""Of three candidates one goes on, with three times the rows."""

LEAST_ROWS = 300
"""Training rows of the first step at least."""

GROWTH = {"gaussian-process": 3.0, "kernel-ridge": 3.0, "svm": 2.5}
"""Exponents with which a fit's time grows with the rows, on the safe side; 1.5 of other models."""


@dataclass(frozen=True)
class GridScores:
    """Scores of all candidates of a grid, NaN where a fit failed or was not done."""

    folds: Values  # R2 of every differing candidate on the folds that count, (candidates, folds)
    baseline: Values  # R2 of the baseline on them, (folds,); empty if there is none
    judged: int  # number of candidates whose fits are all finished, failed ones included
    fits: int  # finished ones of the grid, those of earlier runs included
    failures: dict[str, int]  # number of scores that each reason has cost
    remarks: dict[str, int]  # and that each warning concerns

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
    def baseline_wins(self) -> bool:
        """Whether the baseline has a score, and no candidate of the grid has a better one."""
        if not self.baseline.size or np.isnan(self.baseline).any():
            return False
        return self.winner < 0 or float(self.means[self.winner]) <= float(self.baseline.mean())

    def of(self, number: int | None) -> list[float]:
        """Return R2 of a candidate on every fold, nothing if a fold or the candidate lacks."""
        if number is None or number < 0 or np.isnan(self.folds[number]).any():
            return []
        return [float(score) for score in self.folds[number]]


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

    def tasks(self, families: Iterable[int], rows: int, folds: int = FOLDS) -> list[Task]:
        """List the fits on some rows and folds that some families of candidates still lack."""
        tasks, finished = [], self.trials.finished
        for family in families:
            served = [self.grid.differing[number] for number in sorted(self.grid.families[family])]
            for fold in range(folds):
                lacking = [s for s in served if (grids.key(s), fold, rows) not in finished]
                if lacking:
                    tasks.append(Task(self.model.name, tuple(lacking), fold, rows))
        return tasks

    def baseline_tasks(self) -> list[Task]:
        """List the fits to all rows that the baseline still lacks."""
        own = () if self.baseline is None else (self.baseline,)
        rows = self.training.rows
        every = [Task(self.model.name, own, fold, rows, baseline=True) for fold in range(FOLDS)]
        finished = self.trials.finished
        return [task for task in every if own and (*task.names, task.fold, rows) not in finished]

    def run(
        self, tasks: list[Task], title: str, *, until: float = inf, longest: float = inf
    ) -> None:
        """Do fits after a line that is the title, and keep their trials.

        No fit is begun after the time `until` of `time.time`, at which fits are stopped. One is
        stopped after the time `longest` too; its candidates are not tried on further folds [s].
        InputError is raised for a full disk, or a machine that lacks the memory for a fit.
        """
        if not tasks:
            return
        too_long: set[str] = set()
        with RunProgress(len(tasks), "fits", sum(map(expected_work, tasks))) as progress:
            progress.say(f"{self.model.title}: {title}")

            def keep(task: Task, trials: list[Trial] | None) -> None:
                if trials is None:
                    too_long.add(str(task.names))
                else:
                    self.trials.add(trials)
                failed = all(trial.r2 is None for trial in trials or ())
                progress.advance(1, int(failed), expected_work(task))

            self.executor.run(
                fit,
                self.training,
                (task for task in tasks if str(task.names) not in too_long),
                keep,
                stopping=lambda: self.stopping() or time.time() > until,
                until=until,
                longest=longest,
            )

    def scores(self, rows: int, folds: int = FOLDS) -> GridScores:
        """Collect the scores on some rows and folds; who lacks a fold counts as failed."""
        names = [grids.key(each) for each in self.grid.differing]
        family = {each: own for own in self.grid.families for each in own}
        scores = np.full((len(names), folds), math.nan)
        done, fits, there = [], set(), np.zeros(scores.shape, dtype=np.bool_)
        for number, fold in product(range(len(names)), range(folds)):
            trial = self.trials.finished.get((names[number], fold, rows))
            if trial is not None:
                scores[number, fold] = math.nan if trial.r2 is None else trial.r2
                there[number, fold] = True
                done.append(trial)
                fits.add((family[number], fold))
        reached = []
        if self.baseline is not None:
            places = [
                (grids.key(self.baseline, baseline=True), fold, rows) for fold in range(folds)
            ]
            own = [self.trials.finished.get(place) for place in places]
            reached = [math.nan if trial is None or trial.r2 is None else trial.r2 for trial in own]
        return GridScores(
            scores,
            np.array(reached),
            judged=int(there.all(axis=1).sum()),
            fits=len(fits),
            failures=Counter(trial.failure for trial in done if trial.failure),
            remarks=Counter(trial.remark for trial in done if trial.remark),
        )

    def exhaustive(self) -> GridScores:
        """Do all fits of the grid and of the baseline, and return the scores."""
        rows, families = self.training.rows, range(len(self.grid.families))
        tasks, own = self.tasks(families, rows), self.baseline_tasks()
        title = (
            f"{len(self.grid.candidates)} candidates, {len(self.grid.differing)} differ,"
            f" {FOLDS * len(families)} fits, {len(tasks)} to do, {len(own)} of the baseline"
        )
        # The longest first: the last ones are short, so that no process waits long at the end.
        self.run(sorted([*tasks, *own], key=expected_work, reverse=True), title)
        return self.scores(rows)


@dataclass(frozen=True)
class Found:
    """What a search has found: its grid, with what lies beyond, and the scores that decide."""

    search: GridSearch
    how: str  # the steps of the search in words
    scores: GridScores

    @property
    def seconds(self) -> float:
        """Sum of the times of all fits."""
        return sum(trial.seconds for trial in self.search.trials.finished.values())

    @property
    def fault(self) -> str:
        """Why the search has no winner, "" if it has one."""
        scores, grid, optimum = self.scores, self.search.grid, self.search.optimum
        if self.search.baseline_tasks():
            return f"not searched: the baseline was not finished on {FOLDS} folds within the time"
        if scores.winner < 0 and scores.failures:
            return "; ".join(scores.failures)
        least = min(LEAST_JUDGED, len(grid.differing))
        if scores.judged < least:
            return (
                f"not searched: {scores.judged} of {len(grid.differing)} candidates were judged"
                f" over {FOLDS} folds of all rows, {least} are needed: give a larger --budget"
            )
        if optimum is not None and not scores.of(optimum) and not scores.failures:
            return "not searched: the paper's optimum was not judged: give a larger --budget"
        return ""


def whole(search: GridSearch) -> Found:
    """Search the whole grid, and beyond an end at which the winner lies."""
    search.exhaustive()
    wider = _beyond(search)
    return Found(wider, grids.WHOLE, wider.scores(wider.training.rows))


def halved(search: GridSearch, until: float) -> Found:
    """Search a grid until a time of `time.time`, at which the winner is fitted to all rows too."""
    total, began = search.training.rows, time.time()
    last = (1 - DECISION_SHARE) * (until - began) / growth(search.model, FOLDS / (FOLDS - 1))
    limits = {"until": began + DECISION_SHARE * (until - began), "longest": max(last, ALWAYS)}
    search.run(search.baseline_tasks(), f"the baseline on {total} rows", **limits)
    told: list[str] = []
    if not search.baseline_tasks():
        families, told = _ranked(search, began, until)
        title = f"the best candidates first, on {total} rows, {FOLDS} folds"
        search.run(search.tasks(families, total), title, **limits)
        search = _beyond(search, **limits)
    scores = search.scores(total)
    told.append(f"{_counted(scores.judged)} on {total} rows, {FOLDS} folds")
    is_whole = scores.judged == len(search.grid.differing)
    return Found(
        search, grids.WHOLE if is_whole else f"successive halving: {', '.join(told)}", scores
    )


def steps(total: int) -> list[int]:
    """Return the number of training rows of each step, ascending; the last has all rows."""
    sizes = [total]
    while sizes[0] // FACTOR >= LEAST_ROWS:
        sizes.insert(0, sizes[0] // FACTOR)
    return sizes


def growth(model: Model, factor: float) -> float:
    """Return the factor by which a fit takes longer on `factor` times the rows, at most."""
    return float(factor ** GROWTH.get(model.name, 1.5))


def _ranked(search: GridSearch, began: float, until: float) -> tuple[list[int], list[str]]:
    """Climb the rungs; return all families in the order to judge them, and the rungs in words.

    At first they are drawn, with odds inverse to the work of their fits: cheap ones are seen first.
    The paper's optimum is on every rung, and the first to be judged: few rows must not hide it.
    """
    sizes, grid, name = steps(search.training.rows), search.grid, search.model.name
    served = [tuple(grid.differing[number] for number in family) for family in grid.families]
    work = [expected_work(Task(name, each, 0, sizes[0])) for each in served]
    waiting = np.random.default_rng(search.training.seed).exponential(work)
    optimum = [f for f, numbers in enumerate(grid.families) if search.optimum in numbers]
    drawn = np.argsort(waiting, kind="stable").tolist()
    families = order = list(dict.fromkeys([*optimum, *drawn]))
    told = []
    for place, rows in enumerate(sizes[:-1], start=1):
        end = began + RUNGS_SHARE * place / (len(sizes) - 1) * (until - began)
        title = f"candidates on {rows} rows, {RUNG_FOLDS} folds"
        search.run(search.tasks(families, rows, RUNG_FOLDS), title, until=end)
        means = search.scores(rows, RUNG_FOLDS).means
        scored = {f: means[[*grid.families[f]]] for f in families}
        scored = {f: own[np.isfinite(own)] for f, own in scored.items() if np.isfinite(own).any()}
        if scored:
            number = sum(own.size for own in scored.values())
            told.append(f"{_counted(number)} on {rows} rows, {RUNG_FOLDS} folds")
        ranked = sorted(scored, key=lambda family: (-scored[family].max(), family))
        order = list(dict.fromkeys([*optimum, *ranked, *order]))
        families = list(dict.fromkeys([*optimum, *ranked[: -(-len(ranked) // FACTOR)]]))
    return order, told


def _beyond(search: GridSearch, *, until: float = inf, longest: float = inf) -> GridSearch:
    """Go on beyond the ends of a grid as long as the winner lies on one, and the time allows."""
    rows, scores = search.training.rows, search.scores(search.training.rows)
    while scores.winner >= 0 and not scores.baseline_wins and not search.stopping():
        grid = search.grid.extended(search.grid.first(scores.winner))
        new = range(len(search.grid.differing), len(grid.differing))
        families = [f for f, own in enumerate(grid.families) if not {*new}.isdisjoint(own)]
        further, judged = replace(search, grid=grid), scores.judged
        tasks = further.tasks(families, rows)
        title = f"the winner is at an end of the grid: {len(tasks)} fits beyond it"
        further.run(tasks, title, until=until, longest=longest)
        scores = further.scores(rows)
        if scores.judged == judged:
            break
        search = further
    return search


def _counted(number: int) -> str:
    return f"{number} candidate{'' if number == 1 else 's'}"
