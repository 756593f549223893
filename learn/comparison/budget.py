"""A search that fits into a time: successive halving on the training size.

All candidates are fitted to few rows and scored on one fold, the best third on three times as many,
and so on; only the last step, on all rows, takes all folds. Every step gets an equal share of the
time. The first step draws its candidates with odds inverse to their expected work: it gives as much
of its time to cheap ones as to dear ones, and sees more of them. A step whose time ends before the
best candidate so far is done is dropped. Where the first step shows that the whole grid fits into
the time, it is searched in full instead. scikit-learn's own halving serves neither purpose: it
knows rows, not hours, shares no fits, and can be neither spread over machines nor resumed.

What is found depends on the machine's speed: results say which part was searched.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gen.runtime import farm
from gen.runtime.errors import InputError
from learn.comparison.pruning import Grid
from learn.comparison.search import Found, rank, tasks, work_off
from learn.comparison.task import Task, expected_work
from learn.comparison.training_data import held
from learn.comparison.trials import Trials
from learn.models import Model
from learn.split import FOLDS

WHOLE = "whole grid"
"""How a search went that left nothing out."""

FACTOR = 3
"""Of three candidates one goes on, with three times the rows."""

LEAST_ROWS = 300
"""Training rows of the first step at least."""

GROWTH = {"gaussian-process": 3.0, "kernel-ridge": 3.0, "svm": 2.5}
"""Power of the rows with which a fit's time grows, on the safe side; of the others, 1.5."""

UNITS = {"s": 1.0, "min": 60.0, "m": 60.0, "h": 3600.0, "d": 86400.0}


@dataclass(frozen=True)
class Searched:
    """What a search has found, and how far it went.

    Attributes
    ----------
    found : the scores on the largest number of rows that any candidate was finished with
    rows : that number
    how : the steps in words
    seconds : sum of the times of all fits so far, of all steps and earlier runs [s]
    """

    found: Found
    rows: int
    how: str
    seconds: float


def seconds(text: str) -> float:
    """Read a time: 90s, 30min, 2h, 1.5d.

    Raises
    ------
    InputError
        If it is none, or not above zero.
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
    """Return the training rows of each step, the last of them all, the first so many at least."""
    sizes = [total]
    while sizes[0] // FACTOR >= (least or LEAST_ROWS):
        sizes.insert(0, sizes[0] // FACTOR)
    return sizes


def growth(model: Model, times_more: float) -> float:
    """Factor by which so many times more rows lengthen a fit, on the safe side."""
    return float(times_more ** GROWTH.get(model.name, 1.5))


def drawn_order(model: Model, grid: Grid, rows: int) -> list[int]:
    """Draw all families, each next one with odds inverse to its expected work.

    Parameters
    ----------
    model, grid : what to search
    rows : training rows of a fit

    Returns
    -------
    Numbers of the families, the first drawn first
    """
    work = [
        expected_work(Task(model.name, grid.served_by(family), 0, rows))
        for family in range(len(grid.families))
    ]
    waiting = np.random.default_rng(held().seed).exponential(work)
    return [int(family) for family in np.argsort(waiting, kind="stable")]


def search(
    model: Model,
    grid: Grid,
    trials: Trials | None,
    world: farm.World,
    limit: float,
    stopping: Callable[[], bool],
) -> Searched | None:
    """Search a grid within a time; every process of the world has to call it.

    Parameters
    ----------
    model, grid : what to search
    trials : where results are kept, on the master; None elsewhere
    world : from `gen.runtime.farm`
    limit : time to take [s]; a fit under way when it ends is finished
    stopping : asked on the master before a fit

    Returns
    -------
    Searched, on the master; None elsewhere, and on the master if no candidate was finished
    """
    began = time.monotonic()
    total = held().target.size
    sizes = steps(total)
    numbers = [n for family in drawn_order(model, grid, sizes[0]) for n in grid.families[family]]
    best: tuple[Found, int] | None = None
    told: list[str] = []
    for place, rows in enumerate(sizes):
        share = limit * (place + 1) / len(sizes)
        folds = FOLDS if rows == total else 1
        todo = [] if trials is None else tasks(model, grid, numbers, rows, trials, folds)
        work_off(
            todo,
            trials,
            world,
            stopping=lambda share=share: stopping() or time.monotonic() > began + share,  # type: ignore[misc]
            title=f"{model.title}: {len(numbers)} candidates on {_extent(rows, folds)}",
        )
        whole, dropped = False, False
        if trials is not None:
            found = rank(grid, trials, rows, folds)
            scored = [number for number in numbers if not np.isnan(found.means[number])]
            unfinished = tasks(model, grid, numbers[:1], rows, trials, folds)
            dropped = best is not None and bool(unfinished)
            if scored and not dropped:
                told.append(f"{len(scored)} candidates on {_extent(rows, folds)}")
                best = found, rows
            left = limit - (time.monotonic() - began)
            due = found.seconds * growth(model, total / rows) * FOLDS / folds / world.workers
            whole = len(scored) == len(grid.differing) and rows < total and due < left
            scored.sort(key=lambda number: (-found.means[number], number))
            numbers = scored[: max(1, -(-len(scored) // FACTOR))]
        if world.broadcast(dropped):
            break
        if world.broadcast(whole):
            everything = range(len(grid.differing))
            todo = [] if trials is None else tasks(model, grid, everything, total, trials)
            work_off(
                todo,
                trials,
                world,
                stopping=lambda: stopping() or time.monotonic() > began + limit,
                title=f"{model.title}: the whole grid fits into the time",
            )
            break
    if trials is None or best is None:
        return None
    everywhere = rank(grid, trials, total)
    if everywhere.winner >= 0 and everywhere.fits == FOLDS * len(grid.families):
        return Searched(everywhere, total, WHOLE, _spent(trials))
    return Searched(*best, f"successive halving: {', '.join(told)}", _spent(trials))


def _spent(trials: Trials) -> float:
    return sum(trial.seconds for trial in trials.finished.values())


def _extent(rows: int, folds: int) -> str:
    return f"{rows} rows" if folds == FOLDS else f"{rows} rows, {folds} fold"
