"""The loop of a growth: look, generate the rows of the next size, and look again.

The processes of the run compute the rows, as many as the time allows, and the master writes them.
"""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from gen import database
from gen.arrays import Columns
from gen.database import Reader, Writer
from gen.generation.run import Block, blocks_of
from gen.generation.sample import completed, compute_rows
from gen.runtime import farm
from gen.runtime.errors import InputError
from gen.runtime.terminal import RunProgress, to_type
from gen.scene import Scene, differences
from gen.schema import Status
from learn.dataset import TARGETS, results, short_name
from learn.executor import Executor
from learn.grow.accuracy import EXPONENTS, Accuracy, Look, Order, look, size, size_with

GROWTH = 2.0
"""Exponent with which the time of a look grows with the rows."""

WORTH = 0.05
"""Rows of a round over those that there are, at least, if the budget is to be spent on them."""

EARLIEST = 7
"""Number of the smallest size at which a growth gives up by its learning curve."""

PATIENT = 4
"""Number of the size from which on rows that are too few for a fit are an error."""

Ending = Literal["met", "budget", "rows", "hopeless", "interrupted"]
"""Why a growth ends: the mark is met, the budget or the allowed rows are used up, the learning
curve does not come to the mark, or a signal has come."""


class Growth(NamedTuple):
    """The end of a growth."""

    ending: Ending
    last: Look | None  # the last surrogate with its errors


@dataclass
class Pace:
    """The clock of a growth with a budget or without."""

    limit: float | None  # wall-clock time of the budget [s]; None for no budget
    workers: int  # processes that compute
    row: float = 0.0  # time in which all workers together make one row, 0 if not known [s]
    look: tuple[int, float] = (1, 0.0)  # rows of the last look, and its time [s]

    def __post_init__(self) -> None:
        """Start the clock."""
        self._end = time.monotonic() + (math.inf if self.limit is None else self.limit)

    @property
    def left(self) -> float:
        """Time left of the budget, infinite without one [s]."""
        return self._end - time.monotonic()

    def after(self, rows: int) -> float:
        """Return the time left once a number of rows has been looked at [s]."""
        seen, seconds = self.look
        return float(self.left - seconds * max(rows / seen, 1.0) ** GROWTH)

    def affords(self, rows: int) -> bool:
        """Tell whether the budget allows another round that is worth its look."""
        new = max(WORTH * rows, 1.0)
        return self.left > 0 and self.after(int(rows + new)) >= new * self.row

    def is_over(self, rows: int) -> bool:
        """Tell whether another row would end after the budget.

        Rows in the hands of the workers are finished first.
        """
        hands = farm.IN_FLIGHT if self.workers > 1 else 1
        return self.after(rows) < hands * self.row * self.workers


class Stock(NamedTuple):
    """The rows and times of a database."""

    rows: int  # before the first one that is pending
    length: int  # all rows
    seconds: float  # that the finished rows took, surfaces included


def grow(
    order: Order,
    scene: Scene,
    executor: Executor,
    pace: Pace,
    say: Callable[[str], None],
    stopping: Callable[[], bool],
) -> Growth:
    """Grow a database and its surrogate until the surrogate is as accurate as asked for.

    The executor computes rows and features, `say` is called with lines for the user, and `stopping`
    is asked between rows. The state is the database: the same call goes on after a stop or a kill.
    InputError is raised if the input cannot be used, or the budget is too small for a first
    surrogate.
    """
    path, per_surface = order.request.databases[0], scene.samples_per_surface
    whole = completed(scene, path.parent, rehearsed=True)
    with database.lock(path):
        _refuse_others(order, whole)
        wanted = max(stock(path).length, min(size(0, per_surface), order.most))
        last, errors = None, dict[int, dict[str, Accuracy]]()
        while True:
            rows = generate(path, whole, wanted, executor, pace, stopping)
            began, found, fault = time.monotonic(), None, "no fit has ended"
            if last is not None and rows == last.rows and not stopping():
                return Growth("budget", last)  # it does not suffice for another row
            try:
                if not stopping():
                    until = time.time() + pace.left
                    found = look(order, rows, errors, executor, say, stopping, until)
            except InputError as error:
                if last is not None or rows >= order.most or rows >= size(PATIENT, per_surface):
                    raise
                fault = str(error)
            last, pace.look = found or last, (max(rows, 1), time.monotonic() - began)
            ending = "interrupted" if stopping() else _ending(order, rows, last, pace)
            if last is None and ending == "budget":
                raise InputError(
                    f"the budget sufficed for {rows} rows, but for no surrogate ({fault}); the same"
                    " command goes on"
                )
            if ending is not None:
                return Growth(ending, last)
            if last is None:
                say(f"{rows} rows are too few: {fault}")
            wanted = min(size(size_with(rows + 1, per_surface), per_surface), order.most)


def _refuse_others(order: Order, scene: Scene) -> None:
    """Refuse targets that the scene does not store, and a database of another scene."""
    path, known = order.request.databases[0], results(scene, order.request.load or "delta")
    for target in order.request.targets:
        if TARGETS.get(target, target) not in known:
            names = ", ".join(short_name(column) for column in known)
            raise InputError(f"--target {target!r}: the scene stores {names}")
    if path.exists():  # also where it has rows enough
        with Reader(path) as reader:
            different = differences(reader.scene, scene)
        if different:
            raise InputError(
                f"{path} holds another scene ({'; '.join(different)}); give another --output,"
                " or the file's own scene"
            )


def _ending(order: Order, rows: int, last: Look | None, pace: Pace) -> Ending | None:
    """Return why a growth ends after a look, None if it goes on."""
    if last is not None and last.met:
        return "met"
    if last is not None and rows >= order.most:
        return "rows"
    if last is not None and last.advice is not None and math.isinf(last.advice):
        # The mark is out of reach for the curve; at first only if it is for the steepest one.
        error = last.judged[last.worst].accuracy.nmae
        steepest = error * (rows / order.most) ** EXPONENTS[1]
        if steepest > order.mark or last.number >= EARLIEST:
            return "hopeless"
    return None if pace.affords(rows) else "budget"


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
) -> int:
    """Give a database a number of rows at least, or make it; return how many have been finished.

    The caller holds `gen.database.lock(path)`. The scene is one from
    `gen.generation.sample.completed`, whose number of samples does not count. The clock learns the
    time of a row. A stop, or a kill, leaves a database that the same call goes on with. InputError
    is raised if the file is of another scene, or cannot be written.
    """
    there = stock(path)
    before, wider = there.rows, scene.model_copy(update={"samples": rows})
    if before and not pace.row:
        pace.row = there.seconds / before / pace.workers
    if before >= rows:
        return before
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
                writer.write_block(*block, columns)
                made += block[1] - block[0]
                pace.row = (time.monotonic() - began) / made
                failed = int(np.count_nonzero(columns["status"] == Status.FAILED))
                progress.advance(block[1] - block[0], failed)

            blocks = blocks_of(writer.scene, pending, executor.workers)
            if pace.limit is not None:  # a stop waits for the tasks under way
                blocks = ((row, row + 1) for start, stop in blocks for row in range(start, stop))
            executor.run(
                _compute,
                (writer.scene, path.parent),
                blocks,
                take,
                stopping=lambda: stopping() or pace.is_over(before + made),
            )
        writer.confirm()
    return stock(path).rows


def _compute(shared: tuple[Scene, Path], block: Block) -> Columns:
    """Compute a block of the rows of a scene, whose database lies in a folder."""
    scene, folder = shared
    scene.surface.make_ready(folder, verify=False)
    return compute_rows(scene, *block, rank=farm.this_world().rank)
