"""An estimate of the time that a whole grid takes, from fits that are drawn at random.

Families of candidates are drawn without regard to their scores: the winners of a search would bias
the estimate, since their fits are shorter or longer than others. Some fits take hours, and one
cannot know beforehand which. All drawn fits are therefore done on few rows; as many of them as the
time allows are done again on three times the rows, and so on up to all rows.

Times on few rows are compared with the fits' expected work (`learn.comparison.grid`): the sum of
the times over the sum of the work drawn, times the work of the whole grid, is a ratio estimate. The
cost of more rows is the ratio of the times of the fits that were done on both numbers of rows:
double sampling (W. G. Cochran, Sampling Techniques, chapters 6 and 12). The fits on all rows are
trials like all others, which a later search need not repeat. The five fits of the baseline, which
every search judges beside the grid, are done first and counted as they are.
"""

import math
import time
from dataclasses import dataclass, replace

import numpy as np

from learn.arrays import Values
from learn.comparison import halving
from learn.comparison.grid import Grid, Task, expected_work, key
from learn.comparison.search import GridSearch
from learn.comparison.trials import Finished
from learn.models import Model
from learn.split import FOLDS

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


def drawn(grid: Grid, seed: int) -> list[tuple[int, int]]:
    """Draw the fits to do, as family and fold, in the order in which they are to be done."""
    families = np.random.default_rng([seed, len(grid.families)]).permutation(len(grid.families))
    return [(int(family), place % FOLDS) for place, family in enumerate(families[:DRAWN])]


def estimate(search: GridSearch, until: float) -> Cost | None:
    """Do the drawn fits that the time allows, and estimate the time of the whole grid.

    Parameters
    ----------
    search : GridSearch
        The grid.
    until : float
        Time of `time.time` at which the estimate ends: about half of the time is for the first
        number of rows, equal shares are for the others. Fits that are under way are stopped; one
        that is expected to last longer is not begun [s].

    Returns
    -------
    Cost or None
        The time of the grid and of the baseline; None if a fit of the baseline, or all drawn fits,
        were not finished.
    """
    training, model, grid, began = search.training, search.model, search.grid, time.time()
    sizes = halving.steps(training.rows, LEAST_ROWS)
    if own := search.baseline_tasks(training.rows):
        search.run(own, f"{model.title}: baseline", until=until)
    if search.baseline_tasks(training.rows):
        return None
    places = drawn(grid, training.seed)
    fewer = np.zeros(len(places))
    whole = not search.tasks(range(len(grid.differing)), training.rows)
    for place, rows in enumerate([] if whole else sizes, start=1):
        times = _times(grid, places, rows, search.trials.finished)
        due = halving.growth(model, halving.FACTOR) * fewer <= until - time.time()
        tasks = [
            Task(model.name, grid.served_by(family), fold, rows)
            for (family, fold), wanted in zip(places, due & np.isnan(times), strict=True)
            if wanted
        ]
        part = FIRST_SHARE + (1 - FIRST_SHARE) * place / len(sizes)
        title = f"{model.title}: {search.fits} fits, {len(tasks)} drawn to be timed on {rows} rows"
        search.run(tasks, title, until=began + part * (until - began))
        fewer = _times(grid, places, rows, search.trials.finished)
    found = cost(model, grid, search.trials.finished, training.rows, training.seed)
    own_seconds = [trial.seconds for trial in search.baseline_trials(training.rows) if trial]
    if found is None:
        return None
    return replace(
        found,
        seconds=found.seconds + sum(own_seconds),
        fits=found.fits + len(own_seconds),
        of=found.of + len(own_seconds),
    )


def cost(model: Model, grid: Grid, finished: Finished, rows: int, seed: int) -> Cost | None:
    """Estimate the time of a grid's fits, or add their times up if all of them were done.

    Parameters
    ----------
    model, grid : Model, Grid
        The model and its candidates.
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
    families = range(len(grid.families))
    fits = FOLDS * len(families)
    all_times = _times(grid, [(f, fold) for f in families for fold in range(FOLDS)], rows, finished)
    if not np.isnan(all_times).any():
        return Cost(float(all_times.sum()), 0.0, fits, fits, rows)
    places, sizes = drawn(grid, seed), halving.steps(rows, LEAST_ROWS)
    times = np.stack([_times(grid, places, size, finished) for size in sizes])
    # Only the times before the first gap: later ones a search may have picked by their score.
    leading = np.cumprod(~np.isnan(times), axis=1).sum(axis=1)
    base = max(range(len(sizes)), key=lambda place: (leading[place], place))
    if not leading[base]:
        return None
    works = np.array(
        [expected_work(Task(model.name, grid.served_by(f), 0, sizes[base])) for f in families]
    )
    fair = works[[family for family, _ in places[: leading[base]]]]
    per_work, error = _ratio(times[base, : leading[base]], fair)
    factor, its_error, largest = _grown(times, base, halving.growth(model, halving.FACTOR))
    seconds = FOLDS * float(works.sum()) * per_work * factor
    both = [each for each in (error, its_error) if each is not None]
    known = seconds * math.hypot(*both) if len(both) == 2 else None
    timed = int(np.count_nonzero(~np.isnan(times[-1])))
    return Cost(seconds, known, timed, fits, sizes[largest])


def _grown(times: Values, base: int, growth: float) -> tuple[float, float | None, int]:
    """Return the factor by which fits take longer on all rows than on the base's.

    Parameters
    ----------
    times : ndarray, shape (sizes, fits)
        Times of the drawn fits, NaN where one was not done [s].
    base : int
        One of the sizes.
    growth : float
        Factor of each step up, until one has been measured.

    Returns
    -------
    factor : float
        The factor. Above the largest rows that were measured, the growth is carried on.
    error : float or None
        Relative error of the factor, None if it is not known.
    last : int
        The largest size that was measured.
    """
    factor, last = 1.0, 0
    errors: list[float | None] = []
    for place in range(1, len(times)):
        step, step_error = _ratio(times[place], times[last])
        if step:
            growth = step ** (1 / (place - last))
        if step and place > base:
            factor *= step
            errors.append(step_error)
        if step or place == base:
            last = place
    left = len(times) - 1 - last
    known = [step_error for step_error in errors if step_error is not None]
    error = None if left or len(known) < len(errors) else math.hypot(*known)
    return factor * growth**left, error, last


def _ratio(above: Values, below: Values) -> tuple[float, float | None]:
    """Return the ratio of the sums of two times of the same fits (0 for none), and its error."""
    both = ~np.isnan(above) & ~np.isnan(below)
    above, below = above[both], below[both]
    if not above.size:
        return 0.0, None
    ratio = float(above.sum() / below.sum())
    if above.size == 1:
        return ratio, None
    residuals = above - ratio * below
    error = math.sqrt(residuals @ residuals / (above.size - 1) / above.size)
    return ratio, float(error / above.mean())


def _times(grid: Grid, places: list[tuple[int, int]], rows: int, finished: Finished) -> Values:
    """Return the time of each fit for all its candidates [s]; NaN if a candidate lacks it."""
    found = np.zeros(len(places))
    for number, (family, fold) in enumerate(places):
        for settings in grid.served_by(family):
            trial = finished.get((key(settings), fold, rows))
            found[number] += math.nan if trial is None else trial.seconds
    return found
