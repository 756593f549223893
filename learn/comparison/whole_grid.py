"""What a whole grid takes: measured where it was searched, estimated from what was timed elsewhere.

Where no family of candidates was fitted to all rows, or not all of them, times are scaled by the
fits' expected work (`learn.comparison.search.expected_work`) to families that were not tried, and
by the growth of times per unit of that work, as measured on the families that were fitted to more
than one number of rows.
"""

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from math import log
from statistics import median

from learn.comparison.pruning import Grid, key
from learn.comparison.search import Task, expected_work
from learn.comparison.trials import Trial
from learn.models import Model
from learn.split import FOLDS


@dataclass(frozen=True)
class WholeGrid:
    """The time of all fits of a grid, one after the other on one thread.

    Attributes
    ----------
    seconds : sum of the fits' times [s]
    measured : all of them were done; else the sum is an estimate, good to a factor of two or so
    """

    seconds: float
    measured: bool


@dataclass
class Timed:
    """Fits of one family with one number of rows: their seconds [s] and their expected work."""

    seconds: float = 0.0
    work: float = 0.0
    whole_fits: int = 0


def whole_grid(model: Model, grid: Grid, finished: Iterable[Trial], total: int) -> WholeGrid:
    """Measure or estimate what the whole grid takes.

    Parameters
    ----------
    model, grid : what is searched
    finished : the trials so far, on whatever numbers of rows; at least one
    total : training rows of a whole search

    Returns
    -------
    WholeGrid
    """
    timed = _timed(model, grid, finished)
    done = {family: fits for (family, rows), fits in timed.items() if rows == total}
    if sum(fits.whole_fits for fits in done.values()) == FOLDS * len(grid.families):
        return WholeGrid(sum(fits.seconds for fits in done.values()), measured=True)
    sizes = sorted({rows for _, rows in timed})
    families = {rows: {f for f, r in timed if r == rows} for rows in sizes}
    base = max(sizes, key=lambda rows: (len(families[rows]), rows))
    rates = {f: timed[f, base].seconds / timed[f, base].work for f in families[base]}
    each = [timed[f, base] for f in families[base]]
    usual = sum(fits.seconds for fits in each) / sum(fits.work for fits in each)
    growth = _growth(timed, sizes, base, total)
    seconds = 0.0
    for family, numbers in enumerate(grid.families):
        settings = tuple(grid.differing[number] for number in numbers)
        work = expected_work(Task(model.name, settings, 0, total))
        seconds += FOLDS * work * rates.get(family, usual) * growth
    return WholeGrid(seconds, measured=False)


def _timed(model: Model, grid: Grid, finished: Iterable[Trial]) -> dict[tuple[int, int], Timed]:
    """Sum up the fits by family and rows."""
    number_of = {key(settings): number for number, settings in enumerate(grid.differing)}
    family_of = {number: place for place, family in enumerate(grid.families) for number in family}
    fits: dict[tuple[int, int, int], list[Trial]] = defaultdict(list)
    for trial in finished:
        if trial.candidate in number_of:
            family = family_of[number_of[trial.candidate]]
            fits[family, trial.fold, trial.rows].append(trial)
    found: dict[tuple[int, int], Timed] = defaultdict(Timed)
    for (family, fold, rows), trials in fits.items():
        settings = tuple(grid.differing[number_of[trial.candidate]] for trial in trials)
        sums = found[family, rows]
        sums.seconds += sum(trial.seconds for trial in trials)
        sums.work += expected_work(Task(model.name, settings, fold, rows))
        sums.whole_fits += len(trials) == len(grid.families[family])
    return found


def _growth(timed: dict[tuple[int, int], Timed], sizes: list[int], base: int, total: int) -> float:
    """How many times as long a unit of work takes with all rows as with those of the base."""
    growth, power = 1.0, 0.0
    reached = base
    for few, many in pairwise(rows for rows in sizes if rows >= base):
        ratios = [
            _rate(timed[family, many]) / _rate(timed[family, few])
            for family, rows in timed
            if rows == many and (family, few) in timed
        ]
        if not ratios:
            break
        factor = median(ratios)
        growth, power, reached = growth * factor, log(factor) / log(many / few), many
    return growth * float((total / reached) ** power)


def _rate(fits: Timed) -> float:
    return fits.seconds / fits.work
