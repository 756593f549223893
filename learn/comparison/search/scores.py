"""The scores of a grid's candidates, and the winner.

The score of a candidate is the mean R2 over the folds. Ties go to the first in the order of
ParameterGrid; candidates with a failed fold come last. The baseline, which is no point of the grid,
wins where no candidate is better.
"""

import math
from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from learn.arrays import Values
from learn.comparison.search.pruning import Grid, key
from learn.comparison.search.trials import Finished
from learn.split import FOLDS


@dataclass(frozen=True)
class GridScores:
    """Scores of all candidates of a grid.

    Attributes
    ----------
    folds : ndarray, shape (candidates, folds that count)
        R2 of every differing candidate on every fold, NaN where a fit failed or was not done.
    means : ndarray, shape (candidates,)
        Mean over the folds.
    winner : int
        Number of the best differing candidate, -1 if all failed.
    fits : int
        Number of finished fits of the grid, those of earlier runs included.
    seconds : float
        Sum of these fits' times and of the baseline's [s].
    failures : dict
        Number of scores that each reason has cost.
    remarks : dict
        Number of scores that each warning concerns.
    collapsed : frozenset of int
        Numbers of the candidates of which a fit found nothing in its rows.
    baseline : ndarray, shape (folds that count,)
        R2 of the baseline, NaN where its fit failed or was not done; empty if there is none.
    """

    folds: Values
    means: Values
    winner: int
    fits: int
    seconds: float
    failures: dict[str, int]
    remarks: dict[str, int]
    collapsed: frozenset[int] = frozenset()
    baseline: Values = field(default_factory=lambda: np.empty(0))

    @property
    def scored(self) -> int:
        """Number of candidates that have a score."""
        return int(np.count_nonzero(~np.isnan(self.means)))

    @property
    def baseline_fits(self) -> int:
        """Number of the baseline's fits that have a score."""
        return int(np.count_nonzero(~np.isnan(self.baseline)))

    @property
    def baseline_wins(self) -> bool:
        """Whether the baseline has a score, and no candidate of the grid has a better one."""
        if not self.baseline.size or np.isnan(self.baseline).any():
            return False
        return self.winner < 0 or float(self.means[self.winner]) <= float(self.baseline.mean())

    @property
    def decided(self) -> bool:
        """Whether there is a winner: a candidate of the grid, or the baseline."""
        return self.winner >= 0 or self.baseline_wins

    def of(self, number: int | None) -> list[float]:
        """Return R2 of a candidate on every fold, nothing if a fold or the candidate lacks."""
        if number is None or number < 0 or np.isnan(self.means[number]):
            return []
        return [float(score) for score in self.folds[number]]


def rank(
    grid: Grid, finished: Finished, rows: int, folds: int = FOLDS, baseline: str = ""
) -> GridScores:
    """Collect the scores of all candidates and find the best.

    Parameters
    ----------
    grid : Grid
        The candidates.
    finished : mapping
        The finished trials; candidates that lack a fold count as failed.
    rows : int
        Number of training rows of the trials that count.
    folds : int
        Number of folds that count, from the first on.
    baseline : str
        Name of the baseline in its trials, "" if there is none.
    """
    scores = np.full((len(grid.differing), folds), math.nan)
    failures: Counter[str] = Counter()
    remarks: Counter[str] = Counter()
    seconds = 0.0
    fits, collapsed = set(), set()
    for number, settings in enumerate(grid.differing):
        for fold in range(folds):
            trial = finished.get((key(settings), fold, rows))
            if trial is None:
                continue
            scores[number, fold] = math.nan if trial.r2 is None else trial.r2
            seconds += trial.seconds
            fits.add((grid.family_of[number], fold))
            if trial.collapsed:
                collapsed.add(number)
            failures.update(filter(None, [trial.failure]))
            remarks.update(filter(None, [trial.remark]))
    means = scores.mean(axis=1)
    winner = -1 if np.isnan(means).all() else int(np.nanargmax(means))
    own = [finished.get((baseline, fold, rows)) for fold in range(folds if baseline else 0)]
    seconds += sum(trial.seconds for trial in own if trial)
    reached = [math.nan if trial is None or trial.r2 is None else trial.r2 for trial in own]
    counts = dict(failures), dict(remarks)
    extra = frozenset(collapsed), np.array(reached)
    return GridScores(scores, means, winner, len(fits), seconds, *counts, *extra)
