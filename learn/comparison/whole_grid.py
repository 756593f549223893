"""What a whole grid takes, from fits that are drawn at random.

Families of candidates are drawn without regard to their worth: the winners of a search would not
do, whose fits are shorter or longer than others'. Some fits take hours, and one cannot know
beforehand which. All drawn ones are therefore done on few rows; as many of them as the time allows
are done again on three times the rows, and so on up to all rows.

Times on few rows are compared with the fits' expected work (`learn.comparison.task`): sum of the
times over sum of the work drawn, times the work of the whole grid, a ratio estimate. What more rows
cost is the ratio of the times of the fits that were done on both: double sampling (W. G. Cochran,
Sampling Techniques, chapters 6 and 12). The fits on all rows are trials like all others, which a
later search need not do again.
"""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import takewhile
from math import hypot, sqrt

import numpy as np

from gen.runtime import farm
from learn.comparison import budget, pruning
from learn.comparison.pruning import Grid
from learn.comparison.search import work_off
from learn.comparison.task import Task, expected_work
from learn.comparison.training_data import held
from learn.comparison.trials import Trial, Trials
from learn.models import Model
from learn.split import FOLDS

Finished = Mapping[tuple[str, int, int], Trial]
Times = dict[tuple[int, int], float]
"""Seconds of the drawn fits by family and fold, those that are finished, in their order."""

DRAWN = 40
"""Families that are drawn at most: the error is then about a sixth of their times' scatter."""

LEAST_ROWS = 100
"""Training rows of the first fits at least."""

FIRST_SHARE = 0.4
"""Share of the time kept for the first size, whose fits tell how cheap and dear ones mix; it gets
an equal part of the rest too."""


@dataclass(frozen=True)
class Cost:
    """The time of all fits of a grid, one after the other on one thread.

    Attributes
    ----------
    seconds : sum of the fits' times [s]
    error : standard error of the sum [s]; 0 if measured, None if a step rests on one fit or none
    fits : so many of them were timed on all rows
    of : fits of the whole grid
    rows : largest number of rows that a drawn fit was timed on
    """

    seconds: float
    error: float | None
    fits: int
    of: int
    rows: int

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
    world : from `gen.runtime.farm`
    limit : time to take [s], about half for the first number of rows, equal shares for the others;
        a fit under way when it ends is finished, one that is expected to last longer is not begun
    stopping : asked on the master before a fit

    Returns
    -------
    What is known by then, on the master; None elsewhere, and if nothing was finished
    """
    total, seed = held().target.size, held().seed
    began = time.monotonic()
    sizes = budget.steps(total, LEAST_ROWS)
    known = trials is not None and _all(grid, total, trials.finished)
    for place, rows in enumerate([] if world.broadcast(known) else sizes):
        end = began + limit * (FIRST_SHARE + (1 - FIRST_SHARE) * (place + 1) / len(sizes))
        fewer = sizes[place - 1] if place else 0
        left = began + limit - time.monotonic()
        todo = [] if trials is None else _todo(model, grid, trials.finished, (fewer, rows), left)
        work_off(
            todo,
            trials,
            world,
            stopping=lambda end=end: stopping() or time.monotonic() > end,  # type: ignore[misc]
            title=(
                f"{model.title}: {FOLDS * len(grid.families)} fits, {len(todo)} drawn to be timed"
                f" on {rows} rows"
            ),
        )
    return None if trials is None else cost(model, grid, trials.finished, total, seed)


def _todo(
    model: Model, grid: Grid, finished: Finished, sizes: tuple[int, int], left: float
) -> list[Task]:
    """The drawn fits of one size, in their order, less those that would take too long.

    After the first size, whose fits are all tried, what they take is known from the size before.
    """
    fewer, rows = sizes
    growth = budget.growth(model, budget.FACTOR)
    before = _times(grid, fewer, finished, held().seed) if fewer else None
    todo = []
    for place in drawn(grid, held().seed):
        due = before is None or growth * before.get(place, np.inf) <= left
        if due and _seconds(grid, place, rows, finished) is None:
            todo.append(Task(model.name, grid.served_by(place[0]), place[1], rows))
    return todo


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
        return Cost(sum(each), 0.0, fits, fits, rows)
    sizes = budget.steps(rows, LEAST_ROWS)
    times = {size: _times(grid, size, finished, seed) for size in sizes}
    fair = {size: _in_a_row(times[size], drawn(grid, seed)) for size in sizes}
    # On the size with most fits their mix is known best; on the largest of these, if some are even.
    base = max(sizes, key=lambda size: (len(fair[size]), size))
    if not fair[base]:
        return None
    works = {place: _work(model, grid, place[0], base) for place in fair[base]}
    whole = FOLDS * sum(_work(model, grid, family, base) for family in range(len(grid.families)))
    per_work, error = _ratio(fair[base], works)
    factor, its_error, largest = _grown(times, base, budget.growth(model, budget.FACTOR))
    seconds = whole * per_work * factor
    known = error is not None and its_error is not None
    stated = seconds * hypot(error, its_error) if known else None  # type: ignore[arg-type]
    return Cost(seconds, stated, len(times[rows]), fits, largest)


def _grown(times: dict[int, Times], base: int, growth: float) -> tuple[float, float | None, int]:
    """How much longer fits take on all rows than on those of the base.

    Parameters
    ----------
    times : of the drawn fits, by rows, ascending
    base : one of these rows
    growth : factor of each step up, until one has been measured

    Returns
    -------
    (factor, relative error, rows) : the largest rows that were measured; growth is carried on from
        there, with an error that nobody knows
    """
    sizes = list(times)
    factor, last = 1.0, 0
    errors: list[float | None] = []
    for place, size in enumerate(sizes[1:], start=1):
        step, step_error = _ratio(times[size], times[sizes[last]])
        if step:
            growth = step ** (1 / (place - last))
        if step and size > base:
            factor *= step
            errors.append(step_error)
        if step or size == base:
            last = place
    left = len(sizes) - 1 - last
    known = [each for each in errors if each is not None]
    error = None if left or len(known) < len(errors) else hypot(*known)
    return factor * growth**left, error, sizes[last]


def _ratio(times: Times, over: Times) -> tuple[float, float | None]:
    """Sum of times over that of others of the same fits, and the relative error; 0 for no fit."""
    places = [place for place in times if place in over]
    if not places:
        return 0.0, None
    above = np.array([times[place] for place in places])
    below = np.array([over[place] for place in places])
    ratio = float(above.sum() / below.sum())
    if len(places) == 1:
        return ratio, None
    residuals = above - ratio * below
    error = sqrt(residuals @ residuals / (len(places) - 1) / len(places))
    return ratio, float(error / above.mean())


def _times(grid: Grid, rows: int, finished: Finished, seed: int) -> Times:
    """The drawn fits that were done on so many rows."""
    found = {place: _seconds(grid, place, rows, finished) for place in drawn(grid, seed)}
    return {place: seconds for place, seconds in found.items() if seconds is not None}


def _in_a_row(times: Times, places: list[tuple[int, int]]) -> Times:
    """Those before the first that was not done: a search may have picked what came after."""
    return {place: times[place] for place in takewhile(times.__contains__, places)}


def _all(grid: Grid, rows: int, finished: Finished) -> bool:
    names = [pruning.key(settings) for settings in grid.differing]
    return all((name, fold, rows) in finished for name in names for fold in range(FOLDS))


def _seconds(grid: Grid, place: tuple[int, int], rows: int, finished: Finished) -> float | None:
    """What one fit took for all its candidates; None if some lack it."""
    family, fold = place
    names = [pruning.key(settings) for settings in grid.served_by(family)]
    found = [finished.get((name, fold, rows)) for name in names]
    done = [trial.seconds for trial in found if trial is not None]
    return sum(done) if len(done) == len(names) else None


def _work(model: Model, grid: Grid, family: int, rows: int) -> float:
    return expected_work(Task(model.name, grid.served_by(family), 0, rows))
