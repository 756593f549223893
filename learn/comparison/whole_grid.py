"""What a whole grid takes, from fits that are drawn at random and done on all training rows.

Families of candidates are drawn without regard to their worth: the winners of a search would not
do, whose fits are shorter or longer than others'. Times are compared with the fits' expected work
(`learn.comparison.task.expected_work`): sum of the times over sum of the work drawn, times the
work of the whole grid, a ratio estimate (W. G. Cochran, Sampling Techniques, chapter 6). The fits
are trials like all others, which a later search need not do again.
"""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import sqrt

import numpy as np

from gen import farm
from learn.comparison import pruning
from learn.comparison.pruning import Grid, Settings
from learn.comparison.search import work_off
from learn.comparison.task import Task, expected_work
from learn.comparison.training_data import held
from learn.comparison.trials import Trial, Trials
from learn.models import Model
from learn.split import FOLDS

Finished = Mapping[tuple[str, int, int], Trial]

DRAWN = 40
"""Families that are drawn at most: the error is then about a sixth of their times' scatter."""


@dataclass(frozen=True)
class Cost:
    """The time of all fits of a grid, one after the other on one thread.

    Attributes
    ----------
    seconds : sum of the fits' times [s]
    error : standard error of the sum [s]; 0 if measured, None if one fit alone was drawn
    fits : so many of them were timed
    of : fits of the whole grid
    """

    seconds: float
    error: float | None
    fits: int
    of: int

    @property
    def measured(self) -> bool:
        """Whether all fits were done."""
        return self.fits == self.of


def drawn(grid: Grid, seed: int) -> list[tuple[int, int]]:
    """Family and fold of the fits to do, in their order."""
    families = np.random.default_rng([seed, len(grid.families)]).permutation(len(grid.families))
    return [(int(family), place % FOLDS) for place, family in enumerate(families[:DRAWN])]


def measure(
    model: Model,
    grid: Grid,
    trials: Trials | None,
    world: farm.World,
    limit: float,
    stopping: Callable[[], bool],
) -> Cost | None:
    """Do the drawn fits that fit into a time; every process of the world has to call it.

    Parameters
    ----------
    model, grid : what is to be searched
    trials : where results are kept, on the master; None elsewhere
    world : from `gen.farm`
    limit : time to take [s]; a fit under way when it ends is finished
    stopping : asked on the master before a fit

    Returns
    -------
    What is known by then, on the master; None elsewhere, and if nothing was finished
    """
    rows, seed = held().target.size, held().seed
    end = time.monotonic() + limit
    todo: list[Task] = []
    if trials is not None and not _all(grid, rows, trials.finished):
        todo = [
            Task(model.name, _settings(grid, family), fold, rows)
            for family, fold in drawn(grid, seed)
            if _seconds(grid, (family, fold), rows, trials.finished) is None
        ]
    work_off(
        todo,
        trials,
        world,
        stopping=lambda: stopping() or time.monotonic() > end,
        title=f"{model.title}: {FOLDS * len(grid.families)} fits, {len(todo)} drawn to be timed",
    )
    return None if trials is None else cost(model, grid, trials.finished, rows, seed)


def cost(model: Model, grid: Grid, finished: Finished, rows: int, seed: int) -> Cost | None:
    """Estimate what a grid takes, or add it up where all of it was done.

    Parameters
    ----------
    model, grid : what is to be searched
    finished : trials, by their places
    rows : training rows of the search
    seed : of the draw

    Returns
    -------
    None if no drawn fit is finished
    """
    fits = FOLDS * len(grid.families)
    if _all(grid, rows, finished):
        of_grid = {pruning.key(settings) for settings in grid.differing}
        each = [t.seconds for t in finished.values() if t.rows == rows and t.candidate in of_grid]
        return Cost(sum(each), 0.0, fits, fits)
    times: list[float] = []
    works: list[float] = []
    for place in drawn(grid, seed):
        taken = _seconds(grid, place, rows, finished)
        if taken is None:
            break
        times.append(taken)
        works.append(_work(model, grid, place[0], rows))
    if not times:
        return None
    whole = FOLDS * sum(_work(model, grid, family, rows) for family in range(len(grid.families)))
    error = None if len(times) == 1 else whole * _error(np.array(times), np.array(works))
    return Cost(whole * sum(times) / sum(works), error, len(times), fits)


def _error(times: np.ndarray, works: np.ndarray) -> float:
    """Standard error of the sum of times over the sum of works."""
    residuals = times - works * times.sum() / works.sum()
    return float(sqrt(residuals @ residuals / (times.size - 1) / times.size) / works.mean())


def _all(grid: Grid, rows: int, finished: Finished) -> bool:
    names = [pruning.key(settings) for settings in grid.differing]
    return all((name, fold, rows) in finished for name in names for fold in range(FOLDS))


def _seconds(grid: Grid, place: tuple[int, int], rows: int, finished: Finished) -> float | None:
    """What one fit took for all its candidates; None if some lack it."""
    family, fold = place
    names = [pruning.key(settings) for settings in _settings(grid, family)]
    found = [finished.get((name, fold, rows)) for name in names]
    done = [trial.seconds for trial in found if trial is not None]
    return sum(done) if len(done) == len(names) else None


def _work(model: Model, grid: Grid, family: int, rows: int) -> float:
    return expected_work(Task(model.name, _settings(grid, family), 0, rows))


def _settings(grid: Grid, family: int) -> tuple[Settings, ...]:
    return tuple(grid.differing[number] for number in sorted(grid.families[family]))
