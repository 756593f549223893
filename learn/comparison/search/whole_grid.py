"""An estimate of the time that a whole grid takes, from fits that are drawn at random.

Families of candidates are drawn without regard to their scores: the winners of a search would bias
the estimate, since their fits are shorter or longer than others. Some fits take hours, and one
cannot know beforehand which. All drawn fits are therefore done on few rows; as many of them as the
time allows are done again on three times the rows, and so on up to all rows.

Times on few rows are compared with the fits' expected work (`learn.comparison.search.task`): the
sum of the times over the sum of the work drawn, times the work of the whole grid, is a ratio
estimate. The cost of more rows is the ratio of the times of the fits that were done on both numbers
of rows: double sampling (W. G. Cochran, Sampling Techniques, chapters 6 and 12). The fits on all
rows are trials like all others, which a later search need not repeat. The five fits of the
baseline, which every search judges beside the grid, are done first and counted as they are.
"""

import time
from dataclasses import dataclass, replace
from itertools import takewhile
from math import hypot, sqrt

import numpy as np

from learn.comparison.search import budget
from learn.comparison.search.grid_search import GridSearch
from learn.comparison.search.pruning import Grid, key
from learn.comparison.search.task import Task, expected_work
from learn.comparison.search.trials import Finished
from learn.models import Model
from learn.split import FOLDS

Place = tuple[int, int]
"""Family and fold of a fit."""

DrawnTimes = dict[Place, float]
"""Times of the drawn fits that are finished, in the order of the draw [s]."""

DRAWN = 40
"""Families that are drawn at most: the error is then about a sixth of their times' scatter."""

LEAST_ROWS = 100
"""Training rows of the first fits at least."""

FIRST_SHARE = 0.4
"""Share of the time kept for the first size, whose fits tell how cheap and expensive ones mix; it
gets an equal part of the rest too."""


@dataclass(frozen=True)
class Cost:
    """The time of all fits of a grid, one after the other on one thread.

    Attributes
    ----------
    seconds : float
        Sum of the fits' times [s].
    error : float or None
        Standard error of the sum [s]; 0 if all fits were done, None if a part of the estimate rests
        on one fit or none.
    fits : int
        Number of fits that were timed on all rows.
    of : int
        Number of fits of the whole grid.
    rows : int
        Largest number of rows on which a drawn fit was timed.
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


def drawn(grid: Grid, seed: int) -> list[Place]:
    """Draw the fits to do, in the order in which they are to be done.

    Parameters
    ----------
    grid : Grid
        The candidates.
    seed : int
        Seed of the draw.
    """
    families = np.random.default_rng([seed, len(grid.families)]).permutation(len(grid.families))
    return [(int(family), place % FOLDS) for place, family in enumerate(families[:DRAWN])]


def estimate(grid_search: GridSearch, share: budget.Share) -> Cost | None:
    """Do the drawn fits that the time allows, and estimate the time of the whole grid.

    Parameters
    ----------
    grid_search : GridSearch
        The grid.
    share : Share
        The time: about half for the first number of rows, equal shares for the others. A fit that
        is under way at its end is finished; one that is expected to last longer is not begun.

    Returns
    -------
    Cost or None
        The time of the grid and of the baseline; None if a fit of the baseline, or all drawn fits,
        were not finished.
    """
    training, limit = grid_search.training, share.limit
    began = time.monotonic() - share.spent
    sizes = budget.steps(training.rows, LEAST_ROWS)
    beside = grid_search.baseline_tasks(training.rows)
    if beside:
        grid_search.run(beside, until=began + limit, title=f"{grid_search.model.title}: baseline")
    known = _all_done(grid_search.grid, training.rows, grid_search.trials.finished)
    for place, rows in enumerate([] if known else sizes):
        fewer = sizes[place - 1] if place else 0
        tasks = _tasks(grid_search, fewer, rows, left=began + limit - time.monotonic())
        part = FIRST_SHARE + (1 - FIRST_SHARE) * (place + 1) / len(sizes)
        grid_search.run(
            tasks,
            until=began + part * limit,
            title=(
                f"{grid_search.model.title}: {grid_search.fits} fits, {len(tasks)} drawn to be"
                f" timed on {rows} rows"
            ),
        )
    finished = grid_search.trials.finished
    found = cost(grid_search.model, grid_search.grid, finished, training.rows, training.seed)
    if found is None or grid_search.baseline_tasks(training.rows):
        return None
    places = [(grid_search.baseline_name, fold, training.rows) for fold in range(FOLDS)]
    own = [finished[place].seconds for place in places if place in finished]
    seconds = found.seconds + sum(own)
    return replace(found, seconds=seconds, fits=found.fits + len(own), of=found.of + len(own))


def _tasks(grid_search: GridSearch, fewer: int, rows: int, left: float) -> list[Task]:
    """List the drawn fits on a number of rows that are lacking and do not take too long.

    All fits of the first size are tried (`fewer` is 0). The time of a later fit follows from the
    same fit on fewer rows.
    """
    model, grid, finished = grid_search.model, grid_search.grid, grid_search.trials.finished
    seed = grid_search.training.seed
    growth = budget.growth(model, budget.FACTOR)
    before = _times(grid, fewer, finished, seed)
    tasks = []
    for place in drawn(grid, seed):
        due = not fewer or growth * before.get(place, np.inf) <= left
        if due and _seconds(grid, place, rows, finished) is None:
            tasks.append(Task(model.name, grid.served_by(place[0]), place[1], rows))
    return tasks


def cost(model: Model, grid: Grid, finished: Finished, rows: int, seed: int) -> Cost | None:
    """Estimate the time of a grid's fits, or add their times up if all of them were done.

    Parameters
    ----------
    model : Model
        The model.
    grid : Grid
        Its candidates.
    finished : mapping
        The finished trials.
    rows : int
        Number of training rows of the search.
    seed : int
        Seed of the draw.

    Returns
    -------
    Cost or None
        None if no drawn fit is finished.
    """
    fits = FOLDS * len(grid.families)
    if _all_done(grid, rows, finished):
        of_grid = {key(settings) for settings in grid.differing}
        done = [t.seconds for t in finished.values() if t.rows == rows and t.candidate in of_grid]
        return Cost(sum(done), 0.0, fits, fits, rows)
    sizes = budget.steps(rows, LEAST_ROWS)
    times = {size: _times(grid, size, finished, seed) for size in sizes}
    fair = {size: _in_a_row(times[size], drawn(grid, seed)) for size in sizes}
    base = max(sizes, key=lambda size: (len(fair[size]), size))  # most fits show their mix best
    if not fair[base]:
        return None
    works = {place: _work(model, grid, place[0], base) for place in fair[base]}
    whole = FOLDS * sum(_work(model, grid, family, base) for family in range(len(grid.families)))
    per_work, error = _ratio(fair[base], works)
    factor, its_error, largest = _grown(times, base, budget.growth(model, budget.FACTOR))
    seconds = whole * per_work * factor
    known = error is not None and its_error is not None
    total_error = seconds * hypot(error, its_error) if known else None  # type: ignore[arg-type]
    return Cost(seconds, total_error, len(times[rows]), fits, largest)


def _grown(
    times: dict[int, DrawnTimes], base: int, growth: float
) -> tuple[float, float | None, int]:
    """Return the factor by which fits take longer on all rows than on the base's.

    Parameters
    ----------
    times : dict
        Times of the drawn fits by number of rows, ascending.
    base : int
        One of these numbers of rows.
    growth : float
        Factor of each step up, until one has been measured.

    Returns
    -------
    factor : float
        The factor. Above the largest rows that were measured, the growth is carried on.
    error : float or None
        Relative error of the factor, None if it is not known.
    rows : int
        Largest number of rows that was measured.
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
    known = [step_error for step_error in errors if step_error is not None]
    error = None if left or len(known) < len(errors) else hypot(*known)
    return factor * growth**left, error, sizes[last]


def _ratio(times: DrawnTimes, over: DrawnTimes) -> tuple[float, float | None]:
    """Return the ratio of the sums of two times of the same fits (0 for none), and its error."""
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


def _times(grid: Grid, rows: int, finished: Finished, seed: int) -> DrawnTimes:
    """Return the times of the drawn fits that were done on a number of rows."""
    times = {place: _seconds(grid, place, rows, finished) for place in drawn(grid, seed)}
    return {place: seconds for place, seconds in times.items() if seconds is not None}


def _in_a_row(times: DrawnTimes, places: list[Place]) -> DrawnTimes:
    """Return the times before the first gap: later ones a search may have picked by their score."""
    return {place: times[place] for place in takewhile(times.__contains__, places)}


def _all_done(grid: Grid, rows: int, finished: Finished) -> bool:
    """Whether all fits of a grid were done on a number of rows."""
    names = [key(settings) for settings in grid.differing]
    return all((name, fold, rows) in finished for name in names for fold in range(FOLDS))


def _seconds(grid: Grid, place: Place, rows: int, finished: Finished) -> float | None:
    """Return the time of one fit for all its candidates [s]; None if a candidate lacks it."""
    family, fold = place
    names = [key(settings) for settings in grid.served_by(family)]
    trials = [finished.get((name, fold, rows)) for name in names]
    done = [trial.seconds for trial in trials if trial is not None]
    return sum(done) if len(done) == len(names) else None


def _work(model: Model, grid: Grid, family: int, rows: int) -> float:
    return expected_work(Task(model.name, grid.served_by(family), 0, rows))
