"""New rows of a growing database, as many as the time allows.

The processes of the run compute the rows, the master writes them.
"""

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gen import database
from gen.arrays import Columns
from gen.database import Reader, Writer
from gen.generation.functions import rehearse
from gen.generation.run import blocks_of
from gen.generation.sample import compute_rows, finished_parts
from gen.runtime import farm
from gen.runtime.errors import InputError
from gen.runtime.terminal import RunProgress, to_type
from gen.scene import Scene
from gen.schema import Status
from learn.executor import Executor

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

    @property
    def until(self) -> float:
        """Time of `time.time` at which the budget ends, infinite without one [s]."""
        return time.time() + self.left

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
        hands = farm.IN_FLIGHT if self.workers > 1 else 1
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


@dataclass(frozen=True)
class Stock:
    """The rows and times of a database.

    Attributes
    ----------
    rows : int
        Rows before the first one that is pending.
    length : int
        All rows.
    seconds : float
        Sum of the times that the finished rows took, surfaces included [s].
    solving : float
        Mean time of a solve, NaN if there is none [s].
    """

    rows: int
    length: int
    seconds: float
    solving: float


def stock(path: Path) -> Stock:
    """Count the finished rows of a database, which may not exist yet.

    Parameters
    ----------
    path : Path
        The database.

    Raises
    ------
    InputError
        If the file is no database, or a part of one.
    """
    if not path.exists():
        return Stock(0, 0, 0.0, float("nan"))
    with Reader(path) as reader:
        if reader.rows != range(reader.scene.samples):
            raise InputError(f"{path}: is a part: {to_type('gen merge')} makes it whole")
        status = reader.column("status")
        solving = reader.column("solve_seconds")
        making = reader.column("surface_seconds")
    pending = np.flatnonzero(status == Status.PENDING)
    finished, done = status != Status.PENDING, status == Status.DONE
    return Stock(
        rows=int(pending[0]) if pending.size else len(status),
        length=len(status),
        seconds=float(np.nansum(solving[finished]) + np.nansum(making[finished])),
        solving=float(np.nanmean(solving[done])) if done.any() else float("nan"),
    )


def generate(
    path: Path,
    scene: Scene,
    rows: int,
    executor: Executor,
    pace: Pace,
    stopping: Callable[[], bool],
) -> None:
    """Give a database more rows; the caller holds `gen.database.lock(path)`.

    A stop, or a kill, leaves a database that the same call goes on with.

    Parameters
    ----------
    path : Path
        The database; it is made if it does not exist.
    scene : Scene
        Its scene, from `gen.generation.functions.completed`; its number of samples does not count.
    rows : int
        Number of rows that the database is to have.
    executor : Executor
        Computes the rows.
    pace : Pace
        The clock; it learns the time of a row.
    stopping : callable
        Asked before each task; True ends the work.

    Raises
    ------
    InputError
        If the file is of another scene, or cannot be written, or memory runs out.
    """
    wider = scene.model_copy(update={"samples": rows})
    if not path.exists():
        rehearse(wider)
    before = stock(path).rows
    database.open_or_create(path, wider)
    scene.surface.make_ready(path.parent)
    with Writer(path, wider) as writer:
        pending = writer.pending()
        todo = sum(stop - start for start, stop in pending)
        shared = writer.scene, path.parent
        with RunProgress(todo, "rows") as progress:
            progress.say(f"{path}: {todo} new rows, {before} there")
            made, began = 0, time.monotonic()

            def take(block: Block, columns: Columns) -> None:
                nonlocal made
                failed = _write(writer, block, columns)
                made += block[1] - block[0]
                pace.row = (time.monotonic() - began) / made
                progress.advance(block[1] - block[0], failed)

            executor.run(
                _compute,
                shared,
                pace.paced(blocks_of(writer.scene, pending, executor.workers)),
                take,
                stopping=lambda: stopping() or pace.is_over(before, made),
            )
        writer.confirm()


def _compute(shared: tuple[Scene, Path], block: Block) -> Columns:
    """Compute a block of the rows of a scene, whose database lies in a folder."""
    scene, folder = shared
    scene.surface.make_ready(folder, verify=False)
    return compute_rows(scene, *block, rank=farm.this_world().rank)


def _write(writer: Writer, block: Block, columns: Columns) -> int:
    """Write the rows of a block, and return the number of those that failed."""
    for start, stop, part in finished_parts(block[0], columns):
        writer.write_block(start, stop, part)
    return int(np.count_nonzero(columns["status"] == Status.FAILED))
