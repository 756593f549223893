"""The scores of a grid's candidates, and the winner.

The score of a candidate is the mean R2 over the folds. Ties go to the first in the order of
ParameterGrid; candidates with a failed fold come last.
"""

import math
from collections import Counter
from dataclasses import dataclass

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
        Number of finished fits, those of earlier runs included.
    seconds : float
        Sum of the fits' times [s].
    failures : dict
        Number of scores that each reason has cost.
    remarks : dict
        Number of scores that each warning concerns.
    """

    folds: Values
    means: Values
    winner: int
    fits: int
    seconds: float
    failures: dict[str, int]
    remarks: dict[str, int]

    @property
    def scored(self) -> int:
        """Number of candidates that have a score."""
        return int(np.count_nonzero(~np.isnan(self.means)))


def rank(grid: Grid, finished: Finished, rows: int, folds: int = FOLDS) -> GridScores:
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
    """
    scores = np.full((len(grid.differing), folds), math.nan)
    failures: Counter[str] = Counter()
    remarks: Counter[str] = Counter()
    seconds = 0.0
    fits = set()
    for number, settings in enumerate(grid.differing):
        for fold in range(folds):
            trial = finished.get((key(settings), fold, rows))
            if trial is None:
                continue
            scores[number, fold] = math.nan if trial.r2 is None else trial.r2
            seconds += trial.seconds
            fits.add((grid.family_of[number], fold))
            failures.update(filter(None, [trial.failure]))
            remarks.update(filter(None, [trial.remark]))
    means = scores.mean(axis=1)
    winner = -1 if np.isnan(means).all() else int(np.nanargmax(means))
    return GridScores(scores, means, winner, len(fits), seconds, dict(failures), dict(remarks))
