"""A search within a given time: successive halving on the number of training rows.

All candidates are fitted to few rows and scored on two folds, the best third on three times as
many, and so on. These rungs only choose who is judged: the winner is the best over five folds of
all rows, as in a search of the whole grid. Three kinds of candidates reach that decision whatever
their scores on few rows are:

- the baseline, whose five fits on all rows are the first of the search: without them there is no
  result. A candidate that is not better than the baseline does not win;
- the paper's optimum, where the grid has it (for other grids, the settings that are built in);
- candidates whose likelihood was largest at an end of its range: on few rows it takes a function
  for noise, where with more rows the same candidate may be the best.

The first rung draws its candidates with odds inverse to their expected work: it spends as much of
its time on cheap ones as on expensive ones, and sees more of them. Where it shows that the whole
grid fits into the time, the whole grid is searched instead. scikit-learn's own halving knows rows,
not hours, shares no fits, and can be neither spread over machines nor resumed.
"""

import time
from math import inf

import numpy as np

from learn.comparison.grid import WHOLE, Task, expected_work
from learn.comparison.search import GridScores, GridSearch, SearchResult
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


def steps(total: int) -> list[int]:
    """Return the number of training rows of each step, ascending; the last has all rows."""
    sizes = [total]
    while sizes[0] // FACTOR >= LEAST_ROWS:
        sizes.insert(0, sizes[0] // FACTOR)
    return sizes


def growth(model: Model, factor: float) -> float:
    """Return the factor by which a fit takes longer on `factor` times the rows, at most."""
    return float(factor ** GROWTH.get(model.name, 1.5))


def within(search: GridSearch, until: float) -> SearchResult | None:
    """Search a grid until a time of `time.time`, at which the winner is fitted to all rows too [s].

    None is returned if the time sufficed neither for the baseline nor for a candidate.
    """
    total, began = search.training.rows, time.time()
    decided = began + DECISION_SHARE * (until - began)
    last = (1 - DECISION_SHARE) * (until - began)
    longest = max(last / growth(search.model, FOLDS / (FOLDS - 1)), ALWAYS)
    _fit(search, [], total, FOLDS, decided, longest)  # the baseline alone
    if search.baseline_tasks(total):
        return None
    families, told = _rungs(search, began, until, decided)
    _fit(search, families, total, FOLDS, decided, longest)
    scores = search.scores(total)
    spent = sum(trial.seconds for trial in search.trials.finished.values())
    if scores.winner >= 0 and scores.fits == search.fits:
        return SearchResult(scores, WHOLE, spent)
    if not scores.decided and not scores.failures:
        return None
    numbers = [number for family in families for number in search.grid.families[family]]
    left = sum(1 for number in numbers if not scores.of(number))
    beside = "" if search.baseline is None else " and the baseline"
    told.append(f"{_counted(len(numbers) - left)}{beside} on {total} rows, {FOLDS} folds")
    undone = [f"{left} more not finished"] if left else []
    return SearchResult(scores, f"successive halving: {', '.join([*told, *undone])}", spent)


def _rungs(
    search: GridSearch, began: float, until: float, decided: float
) -> tuple[list[int], list[str]]:
    """Climb the rungs; return the families to judge on all rows, and the rungs in words."""
    sizes, grid = steps(search.training.rows), search.grid
    families = _drawn_order(search, sizes[0])
    optimum = [f for f, numbers in enumerate(grid.families) if search.optimum in numbers]
    if len(sizes) == 1:
        families.sort(key=lambda family: family not in optimum)
    told: list[str] = []
    spared: set[int] = set()
    for place, rows in enumerate(sizes[:-1], start=1):
        end = began + RUNGS_SHARE * place / (len(sizes) - 1) * (until - began)
        _fit(search, families, rows, RUNG_FOLDS, end)
        scores = search.scores(rows, RUNG_FOLDS)
        means = {family: scores.means[[*grid.families[family]]] for family in families}
        scored = [family for family in families if np.isfinite(means[family]).any()]
        best = {family: float(np.nanmax(means[family])) for family in scored}
        if told and search.tasks(families[:1], rows, RUNG_FOLDS):
            break  # the best candidate so far is not finished: this rung does not count
        if scored:
            number = sum(int(np.isfinite(means[family]).sum()) for family in scored)
            told.append(f"{_counted(number)} on {rows} rows, {RUNG_FOLDS} folds")
        spared = (spared - set(scored)) | (set(scored) & scores.collapsed)
        ranked = sorted(set(scored) - spared, key=lambda family: (-best[family], family))
        promoted = ranked[: -(-len(scored) // FACTOR)]
        promoted[1:1] = [family for family in optimum if family not in promoted]
        families = [*promoted, *sorted(spared.difference(promoted))]
        if len(scored) == len(grid.families) and _whole_fits(search, scores, rows, decided):
            return [*families, *sorted(set(scored).difference(families))], told
    return families, told


def _drawn_order(search: GridSearch, rows: int) -> list[int]:
    """Draw all families, with odds inverse to the work of their fits."""
    grid, name = search.grid, search.model.name
    families = range(len(grid.families))
    work = [expected_work(Task(name, grid.served_by(family), 0, rows)) for family in families]
    waiting = np.random.default_rng(search.training.seed).exponential(work)
    return [int(family) for family in np.argsort(waiting, kind="stable")]


def _whole_fits(search: GridSearch, scores: GridScores, rows: int, until: float) -> bool:
    """Whether the time left suffices for the whole grid, after a rung with all candidates."""
    total = search.training.rows
    longer = growth(search.model, total / rows) * FOLDS / RUNG_FOLDS
    lacking = scores.seconds * longer - search.scores(total).seconds
    return lacking / search.executor.workers < until - time.time()


def _fit(
    search: GridSearch,
    families: list[int],
    rows: int,
    folds: int,
    until: float,
    longest: float = inf,
) -> None:
    """Do the fits of one step until a time, the baseline's first."""
    own = search.baseline_tasks(rows, folds)
    tasks = [*own, *search.tasks(families, rows, folds)]
    if tasks:
        number = sum(len(search.grid.families[family]) for family in families)
        named = [_counted(number) if families else "", "the baseline" if own else ""]
        who = " and ".join(filter(None, named))
        title = f"{search.model.title}: {who} on {rows} rows, {folds} folds"
        search.run(tasks, title, until=until, longest=longest)


def _counted(number: int) -> str:
    return f"{number} candidate{'' if number == 1 else 's'}"
