"""A search within a given time: successive halving on the number of training rows.

All candidates are fitted to few rows and scored on one fold, the best third on three times as many,
and so on; only the last step, on all rows, takes all folds. Every step gets an equal share of the
time. The first step draws its candidates with odds inverse to their expected work: it spends as
much of its time on cheap ones as on expensive ones, and sees more of them. A step whose time ends
before the best candidate so far is finished is dropped. Where the first step shows that the whole
grid fits into the time, the whole grid is searched instead. scikit-learn's own halving serves
neither purpose: it knows rows, not hours, shares no fits, and can be neither spread over machines
nor resumed.

The result depends on the speed of the machine: it says which part of the grid was searched.
"""

import time

import numpy as np

from gen.runtime.errors import InputError
from learn.comparison.search.grid_search import GridSearch, SearchResult
from learn.comparison.search.scores import GridScores
from learn.comparison.search.spaces import WHOLE
from learn.comparison.search.task import Task, expected_work
from learn.models import Model
from learn.split import FOLDS

FACTOR = 3
"""Of three candidates one goes on, with three times the rows."""

LEAST_ROWS = 300
"""Training rows of the first step at least."""

GROWTH = {"gaussian-process": 3.0, "kernel-ridge": 3.0, "svm": 2.5}
"""Exponents with which a fit's time grows with the rows, on the safe side."""

USUAL_GROWTH = 1.5
"""The exponent of the other models."""

UNITS = {"s": 1.0, "min": 60.0, "m": 60.0, "h": 3600.0, "d": 86400.0}
"""Seconds of the units in which a time may be given."""


def seconds(text: str) -> float:
    """Read a time such as 90s, 30min, 2h or 1.5d.

    Raises
    ------
    InputError
        If the text is not a time, or the time is not above zero.
    """
    number = text.rstrip("abcdefghijklmnopqrstuvwxyz").strip()
    unit = text[len(number) :].strip() or "s"
    try:
        value = float(number) * UNITS[unit]
    except (ValueError, KeyError):
        value = 0.0
    if not 0 < value < float("inf"):
        raise InputError(f"--budget {text!r}: give a time above zero, as 90s, 30min, 2h or 1.5d")
    return value


def steps(total: int, least: int | None = None) -> list[int]:
    """Return the number of training rows of each step, ascending.

    Parameters
    ----------
    total : int
        Number of all training rows, those of the last step.
    least : int, optional
        Smallest number of rows of the first step, `LEAST_ROWS` if left out.
    """
    sizes = [total]
    while sizes[0] // FACTOR >= (least or LEAST_ROWS):
        sizes.insert(0, sizes[0] // FACTOR)
    return sizes


def growth(model: Model, factor: float) -> float:
    """Return the factor by which a fit takes longer on `factor` times the rows, at most."""
    return float(factor ** GROWTH.get(model.name, USUAL_GROWTH))


def drawn_order(grid_search: GridSearch, rows: int) -> list[int]:
    """Draw all families one after the other, with odds inverse to their expected work.

    Parameters
    ----------
    grid_search : GridSearch
        The grid, and the seed of the draw.
    rows : int
        Number of training rows of a fit.

    Returns
    -------
    list of int
        Numbers of the families, the first drawn first.
    """
    grid = grid_search.grid
    work = [
        expected_work(Task(grid_search.model.name, grid.served_by(family), 0, rows))
        for family in range(len(grid.families))
    ]
    waiting = np.random.default_rng(grid_search.training.seed).exponential(work)
    return [int(family) for family in np.argsort(waiting, kind="stable")]


def search(grid_search: GridSearch, limit: float) -> SearchResult | None:
    """Search a grid within a time.

    Parameters
    ----------
    grid_search : GridSearch
        The grid to search.
    limit : float
        The time [s]. A fit that is under way at its end is finished.

    Returns
    -------
    SearchResult or None
        None if no candidate was finished.
    """
    halving = _Halving(grid_search, limit)
    halving.run()
    scores = grid_search.scores(halving.total)
    spent = sum(trial.seconds for trial in grid_search.trials.finished.values())
    if scores.winner >= 0 and scores.fits == grid_search.fits:
        return SearchResult(scores, halving.total, WHOLE, spent)
    if not halving.told:
        return None
    how = f"successive halving: {', '.join(halving.told)}"
    return SearchResult(halving.best, halving.rows, how, spent)


class _Halving:
    """The steps of one search.

    Attributes
    ----------
    told : list of str
        The steps that count, in words; none if no candidate was finished.
    best, rows : GridScores, int
        Scores of the last of these steps, and its number of training rows.
    """

    best: GridScores
    rows: int

    def __init__(self, grid_search: GridSearch, limit: float) -> None:
        self.grid_search, self.limit = grid_search, limit
        self.began = time.monotonic()
        self.total = grid_search.training.rows
        self.told: list[str] = []

    def run(self) -> None:
        """Do one step after the other, or the whole grid as soon as it fits into the time."""
        sizes = steps(self.total)
        families = drawn_order(self.grid_search, sizes[0])
        numbers = [n for family in families for n in self.grid_search.grid.families[family]]
        for place, rows in enumerate(sizes):
            folds = FOLDS if rows == self.total else 1
            self._fit(numbers, rows, folds, share=(place + 1) / len(sizes))
            scores = self.grid_search.scores(rows, folds)
            scored = [number for number in numbers if not np.isnan(scores.means[number])]
            if self.told and self.grid_search.tasks(numbers[:1], rows, folds):
                return  # the best candidate so far is not finished: this step does not count
            if scored:
                self.told.append(f"{len(scored)} candidates on {_extent(rows, folds)}")
                self.best, self.rows = scores, rows
            if len(scored) == len(scores.means) and self._whole_grid_fits(scores, rows, folds):
                self._fit_whole_grid()
                return
            scored.sort(key=lambda number: (-scores.means[number], number))
            numbers = scored[: max(1, -(-len(scored) // FACTOR))]

    def _fit(self, numbers: list[int], rows: int, folds: int, share: float) -> None:
        """Do the fits of one step until its share of the time has passed."""
        self.grid_search.run(
            self.grid_search.tasks(numbers, rows, folds),
            until=self.began + share * self.limit,
            title=(
                f"{self.grid_search.model.title}: {len(numbers)} candidates on"
                f" {_extent(rows, folds)}"
            ),
        )

    def _whole_grid_fits(self, scores: GridScores, rows: int, folds: int) -> bool:
        """Whether the time left suffices for the whole grid, after a step with all candidates."""
        left = self.limit - (time.monotonic() - self.began)
        longer = growth(self.grid_search.model, self.total / rows) * FOLDS / folds
        due = scores.seconds * longer / self.grid_search.executor.workers
        return rows < self.total and due < left

    def _fit_whole_grid(self) -> None:
        everything = range(len(self.grid_search.grid.differing))
        self.grid_search.run(
            self.grid_search.tasks(everything, self.total),
            until=self.began + self.limit,
            title=f"{self.grid_search.model.title}: the whole grid fits into the time",
        )


def _extent(rows: int, folds: int) -> str:
    return f"{rows} rows" if folds == FOLDS else f"{rows} rows, {folds} fold"
