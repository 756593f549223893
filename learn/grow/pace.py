"""The pace of a growth: times of a row, its features and a fit, and the rows still affordable."""

import math
import time
from collections.abc import Iterator

from gen.runtime.farm import IN_FLIGHT

Block = tuple[int, int]
"""First row of a task, and one past the last."""

PART = 8
"""A task takes at most this part of the time that is left."""

GROWTH = 2.0
"""Exponent with which the time of a fit grows with the rows."""


class Pace:
    """The clock of a growth with a budget or without.

    Parameters
    ----------
    limit : float or None
        Wall-clock time of the budget [s]; None for no budget.
    workers : int
        Number of processes that compute.

    Attributes
    ----------
    row : float
        Wall-clock time in which all workers together make one row, 0 if it is not known [s].
    features : float
        Wall-clock time of the features of one new row [s].
    """

    def __init__(self, limit: float | None, workers: int) -> None:
        self.limit = limit
        self.workers = workers
        self.row = self.features = 0.0
        self._end = time.monotonic() + (math.inf if limit is None else limit)
        self._fitted = (1, 0.0)

    @property
    def left(self) -> float:
        """Time left of the budget, infinite without one [s]."""
        return self._end - time.monotonic()

    def note_fit(self, rows: int, seconds: float) -> None:
        """Record what the fit to a number of rows has taken, with its judgement [s]."""
        self._fitted = rows, seconds

    def fit_seconds(self, rows: int) -> float:
        """Estimate the time of the fit to a number of rows from that of the last one [s]."""
        known, seconds = self._fitted
        return float(seconds * max(rows / known, 1.0) ** GROWTH)

    def after(self, old: int, new: int) -> float:
        """Return the time left once new rows have their features and a fit, and old ones too [s].

        Parameters
        ----------
        old : int
            Rows before this round.
        new : int
            Rows that this round has made, or is making.
        """
        return self.left - new * self.features - self.fit_seconds(old + new)

    def affordable(self, old: int, most: int) -> int:
        """Return how many new rows, and the fit to them, the budget allows; `most` without one."""
        if self.limit is None:
            return most
        low, high = 0, most
        while low < high:  # the time that is left falls with the rows
            middle = (low + high + 1) // 2
            if self.after(old, middle) >= middle * self.row:
                low = middle
            else:
                high = middle - 1
        return low

    def is_over(self, old: int, new: int) -> bool:
        """Tell whether another row would end after the budget.

        Rows in the hands of the workers are finished first.
        """
        if self.limit is None:
            return False
        hands = IN_FLIGHT if self.workers > 1 else 1
        return self.after(old, new) < hands * self.row * self.workers

    def paced(self, blocks: Iterator[Block]) -> Iterator[Block]:
        """Cut tasks into smaller ones the nearer the end of the budget is.

        A stop waits for the tasks under way, so that the last ones have a single row.

        Parameters
        ----------
        blocks : iterator of (int, int)
            The tasks of a run without a budget.
        """
        for start, stop in blocks:
            first = start
            while first < stop:
                rows = stop - first if self.limit is None else self._largest()
                yield first, min(first + rows, stop)
                first += rows

    def _largest(self) -> int:
        """Return the largest number of rows of a task at this moment."""
        if self.row == 0.0:
            return 1
        return max(1, int(self.left / (PART * self.row * self.workers)))
