"""A search within a given time: successive halving on the number of training rows.

All candidates are fitted to few rows and scored on two folds, the best third on three times as
many, and so on. These rungs only choose who is judged: the winner is the best over five folds of
all rows, as in a search of the whole grid. Three kinds of candidates reach that decision whatever
their scores on few rows are:

- the baseline, whose five fits on all rows are the first of the search: without them there is no
  result. A candidate that is not better than the baseline does not win;
- the paper's optimum, where the grid has it (for other grids, the settings that are built in);
- candidates of which a fit collapsed (`learn.comparison.search.fits.collapsed`): on few rows a
  likelihood may be largest at an end of its range, where with more rows the same candidate is the
  best. They come after the others in the order of the fits.

The rungs get half of the time in equal shares, the decision gets the rest; what it leaves undone is
told, and done by the same command with a further budget. An interrupted search goes on with the
time that is left (`learn.comparison.clock`). The first rung draws its candidates with
odds inverse to their expected work: it spends as much of its time on cheap ones as on expensive
ones, and sees more of them. A rung whose time ends before the best candidate so far is finished is
dropped. Where the first rung shows that the whole grid fits into the time, the whole grid is
searched instead. scikit-learn's own halving serves neither purpose: it knows rows, not hours,
shares no fits, and can be neither spread over machines nor resumed.

The result depends on the speed of the machine: it says which part of the grid was searched.
"""

import time
from dataclasses import dataclass

import numpy as np

from gen.runtime.errors import InputError
from learn.comparison.search.grid_search import GridSearch, SearchResult
from learn.comparison.search.scores import GridScores
from learn.comparison.search.spaces import WHOLE
from learn.comparison.search.task import Task, expected_work
from learn.models import Model
from learn.split import FOLDS

RUNG_FOLDS = 2
"""Folds on which a rung ranks its candidates."""

RUNGS_SHARE = 0.5
"""Share of the time for all rungs; the decision gets the rest."""

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

LONGEST = 36500 * UNITS["d"]
"""Longest time that may be given, a century [s]; records of searches hold no endless ones."""


@dataclass(frozen=True)
class Share:
    """The time of one search.

    Attributes
    ----------
    limit : float
        The time in all [s].
    spent : float
        What an interrupted run of the same job has taken of it [s].
    """

    limit: float
    spent: float = 0.0


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
    if not 0 < value <= LONGEST:
        raise InputError(
            f"--budget {text!r}: give a time above zero, as 90s, 30min, 2h or 1.5d, and at most"
            f" {LONGEST / UNITS['d']:g}d"
        )
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


def search(grid_search: GridSearch, share: Share) -> SearchResult | None:
    """Search a grid within a time.

    Parameters
    ----------
    grid_search : GridSearch
        The grid to search.
    share : Share
        The time. A fit that is under way at its end is finished.

    Returns
    -------
    SearchResult or None
        None if the time sufficed neither for the baseline nor, without one, for a candidate.
    """
    halving = _Halving(grid_search, share)
    halving.run()
    scores = grid_search.scores(halving.total)
    spent = sum(trial.seconds for trial in grid_search.trials.finished.values())
    if grid_search.baseline_tasks(halving.total):
        return None
    if scores.winner >= 0 and scores.fits == grid_search.fits:
        return SearchResult(scores, halving.total, WHOLE, spent)
    if not scores.decided and not scores.failures:
        return None
    return SearchResult(scores, halving.total, halving.how(scores), spent)


class _Halving:
    """The rungs of one search, and its decision.

    Attributes
    ----------
    told : list of str
        The rungs that count, in words.
    judged : list of int
        Numbers of the candidates that were to be judged on all rows and folds.
    """

    def __init__(self, grid_search: GridSearch, share: Share) -> None:
        self.grid_search, self.limit = grid_search, share.limit
        self.began = time.monotonic() - share.spent
        self.total = grid_search.training.rows
        self.told: list[str] = []
        self.judged: list[int] = []
        self._spared: set[int] = set()

    def run(self) -> None:
        """Climb the rungs and decide, or search the whole grid as soon as it fits into the time."""
        self._fit([], self.total, FOLDS, share=1.0)  # the baseline alone
        if self.grid_search.baseline_tasks(self.total):
            return
        sizes = steps(self.total)
        families = drawn_order(self.grid_search, sizes[0])
        numbers = [n for family in families for n in self.grid_search.grid.families[family]]
        rungs, optimum = sizes[:-1], self.grid_search.optimum
        if not rungs and optimum is not None:
            numbers.sort(key=lambda number: number != optimum)
        for place, rows in enumerate(rungs):
            share = RUNGS_SHARE * (place + 1) / len(rungs)
            self._fit(numbers, rows, RUNG_FOLDS, share)
            scores = self.grid_search.scores(rows, RUNG_FOLDS)
            scored = [number for number in numbers if not np.isnan(scores.means[number])]
            if self.told and self.grid_search.tasks(numbers[:1], rows, RUNG_FOLDS):
                break  # the best candidate so far is not finished: this rung does not count
            if scored:
                self.told.append(f"{_counted(len(scored))} on {_extent(rows, RUNG_FOLDS)}")
            numbers = self._promoted(scored, scores)
            if len(scored) == len(scores.means) and self._whole_grid_fits(scores, rows):
                numbers += sorted(set(scored).difference(numbers))
                break
        self.judged = numbers
        self._fit(numbers, self.total, FOLDS, share=1.0)

    def how(self, scores: GridScores) -> str:
        """Tell the steps of the search in words, once it has ended.

        Parameters
        ----------
        scores : GridScores
            Scores on all rows and folds.
        """
        left = sum(1 for number in self.judged if not scores.of(number))
        beside = "" if self.grid_search.baseline is None else " and the baseline"
        decision = f"{_counted(len(self.judged) - left)}{beside} on {_extent(self.total, FOLDS)}"
        undone = [f"{left} more not finished"] if left else []
        return f"successive halving: {', '.join([*self.told, decision, *undone])}"

    def _promoted(self, scored: list[int], scores: GridScores) -> list[int]:
        """List the candidates of the next rung, or of the decision, in the order of their fits.

        Parameters
        ----------
        scored : list of int
            Numbers of this rung's candidates that have a score.
        scores : GridScores
            Scores of this rung.
        """
        self._spared -= set(scored)  # collapsed before: judged by this rung's fits now
        self._spared |= set(scored) & scores.collapsed
        ranked = [number for number in scored if number not in self._spared]
        ranked.sort(key=lambda number: (-scores.means[number], number))
        best = ranked[: -(-len(scored) // FACTOR)]
        optimum = self.grid_search.optimum
        if optimum is not None and optimum not in best:
            best.insert(1, optimum)
        return [*best, *sorted(self._spared.difference(best))]

    def _fit(self, numbers: list[int], rows: int, folds: int, share: float) -> None:
        """Do the fits of one step, the baseline's first, until a share of the time has passed."""
        baseline = self.grid_search.baseline_tasks(rows, folds)
        tasks = [*baseline, *self.grid_search.tasks(numbers, rows, folds)]
        if not tasks:
            return
        beside = "the baseline" if baseline else ""
        named = [_counted(len(numbers)) if numbers else "", beside]
        self.grid_search.run(
            tasks,
            until=self.began + share * self.limit,
            title=(
                f"{self.grid_search.model.title}: {' and '.join(filter(None, named))} on"
                f" {_extent(rows, folds)}"
            ),
        )

    def _whole_grid_fits(self, scores: GridScores, rows: int) -> bool:
        """Whether the time left suffices for the whole grid, after a rung with all candidates."""
        left = self.limit - (time.monotonic() - self.began)
        longer = growth(self.grid_search.model, self.total / rows) * FOLDS / RUNG_FOLDS
        lacking = scores.seconds * longer - self.grid_search.scores(self.total).seconds
        return lacking / self.grid_search.executor.workers < left


def _extent(rows: int, folds: int) -> str:
    return f"{rows} rows, {folds} folds"


def _counted(number: int) -> str:
    return f"{number} candidate{'' if number == 1 else 's'}"
