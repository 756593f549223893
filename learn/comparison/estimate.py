"""An estimate of the time that a whole grid takes, from fits that are drawn at random.

The winners of a search would bias it: their fits are shorter or longer than others. The drawn fits
are done on few rows, then on three times as many, and so on up to all, as far as the time reaches.
The sum of their times over the sum of their expected work, times the work of the whole grid, is a
ratio estimate (W. G. Cochran, Sampling Techniques, chapter 6). Where the last fits were of fewer
rows, it is multiplied by the growth of a fit's time, which is on the safe side. Fits on all rows
are trials like all others, which a later search does not repeat.
"""

import math
import time
from itertools import takewhile
from typing import NamedTuple

import numpy as np

from gen.arrays import Values
from gen.runtime.terminal import print_table
from learn.comparison import paper
from learn.comparison.folder import Folder
from learn.comparison.grid import Task, expected_work, key
from learn.comparison.search import GridSearch, growth, steps
from learn.comparison.tables import new_table
from learn.models import MODELS
from learn.split import FOLDS

DRAWN = 40
"""Fits that are drawn at most: the error is then about a sixth of their times' scatter."""

FEWEST = 5
"""Fits on some rows that say more than any number of fits on fewer rows."""


class Cost(NamedTuple):
    """The time of all fits of a grid and of its baseline, one after the other on one thread."""

    model: str
    grid: str
    seconds: float
    error: float | None  # standard error [s]; None for one fit, or for fits of fewer rows
    fits: int  # that were timed on all rows
    of: int  # fits that there are
    rows: int  # largest number on which a drawn fit was timed


def estimate(search: GridSearch, until: float) -> Cost | None:
    """Do the drawn fits that end before a time of `time.time`, and estimate the whole grid's time.

    The baseline's fits are the first, and are counted as they are. None is returned if one of them,
    or the first drawn fit on the fewest rows, was not finished.
    """
    total = search.training.rows
    own = search.baseline_tasks(total)
    search.run(own, f"{len(own)} fits of the baseline", until=until)
    if search.baseline_tasks(total):
        return None
    began, sizes, drawn = time.time(), steps(total), draw(search)[:DRAWN]
    for place, rows in enumerate(sizes, start=1):
        tasks = [
            t for family, fold in drawn for t in search.tasks([family], rows) if t.fold == fold
        ]
        said = f"{search.fits} fits, {len(tasks)} drawn to be timed on {rows} rows"
        search.run(tasks, said, until=began + place / len(sizes) * (until - began))
    return cost(search)


def cost(search: GridSearch) -> Cost | None:
    """Estimate the time of a grid from its finished fits; None if those drawn first are not."""
    total, drawn, model = search.training.rows, draw(search), search.model
    times = {rows: _times(search, drawn, rows) for rows in steps(total)}
    rows = max(times, key=lambda rows: (min(times[rows].size, FEWEST), rows))
    if not (number := times[rows].size):
        return None
    families = {family: search.grid.served_by(family) for family, _ in drawn}
    tasks = (Task(model.name, families[family], 0, rows) for family, _ in drawn)
    works = np.fromiter(map(expected_work, tasks), float)
    ratio = float(times[rows].sum() / works[:number].sum())
    seconds = ratio * float(works.sum()) * growth(model, total / rows)
    error = None
    if rows == total and number > 1:
        scatter = (times[rows] - ratio * works[:number]).std(ddof=1) / times[rows].mean()
        error = seconds * float(scatter) * math.sqrt(1 / number - 1 / len(drawn))
    own = [trial.seconds for trial in search.baseline_trials(total) if trial]
    return Cost(
        *(model.name, search.source, seconds + sum(own), error),
        fits=times[total].size + len(own),
        of=len(drawn) + len(own),
        rows=rows,
    )


def draw(search: GridSearch) -> list[tuple[int, int]]:
    """Return all fits as family and fold, in the order in which they are drawn."""
    drawn = np.random.default_rng([search.training.seed, search.fits]).permutation(search.fits)
    return [divmod(int(place), FOLDS) for place in drawn]


def _times(search: GridSearch, drawn: list[tuple[int, int]], rows: int) -> Values:
    """Return the times of the first drawn fits [s], up to one that a candidate lacks."""
    found = (
        [search.trials.finished.get((key(s), fold, rows)) for s in search.grid.served_by(family)]
        for family, fold in drawn
    )
    return np.array([sum(t.seconds for t in each if t) for each in takewhile(all, found)])


def hours(seconds: float) -> str:
    """Return a time [s] in hours as text."""
    number = seconds / 3600
    return f"{number:.2g}" if number < 99.5 else f"{number:.0f}"


def report(folder: Folder, costs: list[Cost]) -> None:
    """Print the times of whole grids, and write them to whole-grids.csv."""
    rows = [[*cost, paper.TUNING_SECONDS[cost.model]] for cost in costs]
    folder.write_table("whole-grids.csv", [*Cost._fields, "paper_s"], rows)
    title = "Whole grids, one fit after the other on one thread; the paper's in brackets"
    numbers = ("time [h]", "fits", "timed on all rows", "on rows up to", "relative error")
    table = new_table(title, ("Model", "Grid"), numbers)
    for cost in costs:
        took = f"{hours(cost.seconds)} ({hours(paper.TUNING_SECONDS[cost.model])})"
        error = "" if cost.error is None else f"{100 * cost.error / cost.seconds:.0f} %"
        table.add_row(
            *(MODELS[cost.model].title, cost.grid, took),
            *(str(each) for each in (cost.of, cost.fits, cost.rows)),
            "measured" if cost.fits == cost.of else error,
        )
    print_table(table)
