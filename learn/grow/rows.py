"""New rows of a growing database, as many as the time allows.

The processes of the run compute the rows, the master writes them.
"""

import math
import time
from bisect import bisect
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


@dataclass
class Pace:
    """The clock of a growth with a budget or without."""

    limit: float | None  # wall-clock time of the budget [s]; None for no budget
    workers: int  # processes that compute
    row: float = 0.0  # time in which all workers together make one row, 0 if not known [s]
    features: float = 0.0  # time of the features of one new row [s]
    fit: tuple[int, float] = (1, 0.0)  # rows of the last fit, and its time with its judgement [s]

    def __post_init__(self) -> None:
        """Start the clock."""
        self._end = time.monotonic() + (math.inf if self.limit is None else self.limit)

    @property
    def left(self) -> float:
        """Time left of the budget, infinite without one [s]."""
        return self._end - time.monotonic()

    @property
    def until(self) -> float:
        """Time of `time.time` at which the budget ends, infinite without one [s]."""
        return time.time() + self.left

    def after(self, old: int, new: int) -> float:
        """Return the time left once new rows have their features, and all rows a fit [s]."""
        rows, seconds = self.fit
        fitting = seconds * max((old + new) / rows, 1.0) ** GROWTH
        return float(self.left - new * self.features - fitting)

    def affordable(self, old: int, most: int) -> int:
        """Return how many new rows, and the fit to them, the budget allows; `most` without one."""
        numbers = range(1, most + 1)  # the time that is left falls with the rows
        return bisect(numbers, 0, key=lambda new: new * self.row > self.after(old, new))

    def is_over(self, old: int, new: int) -> bool:
        """Tell whether another row would end after the budget.

        Rows in the hands of the workers are finished first.
        """
        hands = farm.IN_FLIGHT if self.workers > 1 else 1
        return self.after(old, new) < hands * self.row * self.workers

    def paced(self, blocks: Iterator[Block]) -> Iterator[Block]:
        """Cut tasks into smaller ones the nearer the end of the budget is.

        A stop waits for the tasks under way, so that the last ones have a single row.
        """
        for start, stop in blocks:
            first = start
            while first < stop:
                rows = stop - first if self.limit is None else self._largest()
                yield first, min(first + rows, stop)
                first += rows

    def _largest(self) -> int:
        """Return the largest number of rows of a task at this moment."""
        seconds = PART * self.row * self.workers
        return max(1, int(self.left / seconds)) if seconds else 1


@dataclass(frozen=True)
class Stock:
    """The rows and times of a database."""

    rows: int  # before the first one that is pending
    length: int  # all rows
    seconds: float  # that the finished rows took, surfaces included


def stock(path: Path) -> Stock:
    """Count the finished rows of a database, which may not exist yet; a part is refused."""
    if not path.exists():
        return Stock(0, 0, 0.0)
    with Reader(path) as reader:
        if reader.rows != range(reader.scene.samples):
            raise InputError(f"{path}: is a part: {to_type('gen merge')} makes it whole")
        status = reader.column("status")
        solving, making = reader.column("solve_seconds"), reader.column("surface_seconds")
    pending = np.flatnonzero(status == Status.PENDING)
    return Stock(
        rows=int(pending[0]) if pending.size else len(status),
        length=len(status),
        seconds=float(np.nansum((solving + making)[status != Status.PENDING])),
    )


def generate(
    path: Path,
    scene: Scene,
    rows: int,
    executor: Executor,
    pace: Pace,
    stopping: Callable[[], bool],
) -> None:
    """Give a database a number of rows, or make it; the caller holds `gen.database.lock(path)`.

    The scene is one from `gen.generation.functions.completed`, whose number of samples does not
    count. The clock learns the time of a row. A stop, or a kill, leaves a database that the same
    call goes on with. InputError is raised if the file is of another scene, or cannot be written.
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
        with RunProgress(todo, "rows") as progress:
            progress.say(f"{path}: {todo} new rows, {before} there")
            made, began = 0, time.monotonic()

            def take(block: Block, columns: Columns) -> None:
                nonlocal made
                for start, stop, part in finished_parts(block[0], columns):
                    writer.write_block(start, stop, part)
                made += block[1] - block[0]
                pace.row = (time.monotonic() - began) / made
                failed = int(np.count_nonzero(columns["status"] == Status.FAILED))
                progress.advance(block[1] - block[0], failed)

            executor.run(
                _compute,
                (writer.scene, path.parent),
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
