"""The loop of a growth: look, ask the learning curve, generate rows, and look again.

The processes of the run compute the rows, as many as the time allows, and the master writes them.
"""

import math
import time
from bisect import bisect
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from gen import database
from gen.arrays import Columns
from gen.database import Reader, Writer
from gen.generation.run import blocks_of
from gen.generation.sample import completed, compute_rows
from gen.runtime import farm
from gen.runtime.errors import InputError
from gen.runtime.terminal import RunProgress, to_type
from gen.scene import Scene, differences
from gen.schema import Status
from learn.dataset import TARGETS, Request, results, short_name
from learn.executor import Executor, within
from learn.grow.accuracy import EXPONENTS, Appraisal, Curve, Sizes, advise, appraise, learning_curve

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
                seconds, rows = PART * self.row * self.workers, stop - first
                if self.limit is not None:
                    rows = max(1, int(self.left / seconds)) if seconds else 1
                yield first, min(first + rows, stop)
                first += rows


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

    The scene is one from `gen.generation.sample.completed`, whose number of samples does not
    count. The clock learns the time of a row. A stop, or a kill, leaves a database that the same
    call goes on with. InputError is raised if the file is of another scene, or cannot be written.
    """
    wider = scene.model_copy(update={"samples": rows})
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
                writer.write_block(*block, columns)
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


FURTHEST = 4
"""Sizes that one round goes on at most: the first curves are uncertain."""

WORTH = 0.05
"""Rows of a round over those that there are, at least, if the budget is to be spent on them."""

EARLIEST = 7
"""Number of the smallest size at which a growth gives up by its learning curve."""

PATIENT = 4
"""Number of the smallest size at which rows that are too few for a fit are an error."""

Ending = Literal["met", "budget", "rows", "hopeless", "interrupted"]
"""Why a growth ends: the mark is met, the budget or the allowed rows are used up, the learning
curve does not come to the mark, or a signal has come."""


@dataclass(frozen=True)
class Order:
    """A request for a surrogate, with the largest nMAE of every target [%], and the most rows."""

    request: Request
    mark: float
    most: int


@dataclass(eq=False)
class Growth:
    """A growth under way, and its end."""

    order: Order
    scene: Scene
    executor: Executor  # computes rows and features
    pace: Pace  # the clock of the budget
    say: Callable[[str], None]  # called with lines for the user
    stopping: Callable[[], bool]  # asked between rows; True ends the growth
    ending: Ending | None = None  # None while it goes on
    last: Appraisal | None = None  # the last surrogate with its errors
    curve: Curve | None = None  # the last learning curve
    advice: float | None = None  # rows that the last curve asks for, infinite if none suffice

    @property
    def sizes(self) -> Sizes:
        """The sizes of the database at which it is looked at."""
        return Sizes(self.scene.samples_per_surface)

    def run(self) -> None:
        """Go on until there is a reason to end."""
        path = self.order.request.databases[0]
        wanted = max(stock(path).length, min(self.sizes.rows(0), self.order.most))
        while self.ending is None:
            there = stock(path)
            if there.rows and not self.pace.row:
                self.pace.row = there.seconds / there.rows / self.pace.workers
            if there.rows < wanted:
                generate(path, self.scene, wanted, self.executor, self.pace, self.stopping)
            rows = stock(path).rows
            if self.last is not None and rows == self.last.rows:
                self.ending = "budget"  # it does not suffice for another row
            elif not self.stopping():
                self._look(rows)
                self.ending = self._reason(rows)
            if self.stopping():
                self.ending = "interrupted"
            wanted = self._next(rows)

    def _look(self, rows: int) -> None:
        """Fit and judge, unless there are too few rows yet."""
        before = 0 if self.last is None else self.last.rows
        began = time.monotonic()
        found = self._fitted(rows)
        if found is None:
            return
        self.last = found
        self.curve = within(learning_curve, self.order.request, found, self.pace.until)
        self.advice = None
        if self.curve is not None and not found.met:
            self.advice = advise(found, self.curve, self.sizes, self.order.most)
        self.say(in_words(found, self.advice))
        spent = time.monotonic() - began - found.reading
        self.pace.fit = rows, spent
        if rows > before:
            self.pace.features = found.reading / (rows - before)

    def _fitted(self, rows: int) -> Appraisal | None:
        """Return a look; None after a stop, and where a database has too few rows for one yet."""
        order, number = self.order, self.sizes.number(rows)
        try:
            found = appraise(
                *(order.request, rows, number, order.mark, self.executor, self.say),
                *(self.stopping, self.pace.until),
            )
            if found is not None or self.last is not None or self.stopping():
                return found
            fault = "no fit has ended"
        except InputError as error:
            if self.last is not None or number >= PATIENT or rows >= order.most:
                raise
            fault = str(error)
        if not self._affords(rows):
            raise InputError(
                f"the budget sufficed for {rows} rows, but for no surrogate ({fault}); the same"
                " command goes on"
            )
        self.say(f"{rows} rows are too few: {fault}")
        return None

    def _reason(self, rows: int) -> Ending | None:
        """Return why the growth ends after a look, None if it goes on."""
        if self.last is not None and self.last.met:
            return "met"
        if rows >= self.order.most:
            return "rows"
        if self.last is not None and self.advice is not None and math.isinf(self.advice):
            # The mark is out of reach for the curve; at first only if it is for the steepest one.
            error = self.last.judged[self.last.worst].accuracy.nmae
            steepest = error * (rows / self.order.most) ** EXPONENTS[1]
            if steepest > self.order.mark or self.last.number >= EARLIEST:
                return "hopeless"
        return None if self._affords(rows) else "budget"

    def _affords(self, rows: int) -> bool:
        """Tell whether the budget allows another round that is worth its fit."""
        least = max(self.sizes.samples_per_surface, int(WORTH * rows))
        return self.pace.left > 0 and self.pace.affordable(rows, least) >= least

    def _next(self, rows: int) -> int:
        """Return the rows of the next look: as advised, but not far, and within the budget."""
        number = self.sizes.number(rows + 1)
        if self.advice is not None and math.isinf(self.advice):
            number += 1
        elif self.advice is not None:
            asked = min(self.advice, self.sizes.rows(number + FURTHEST - 1))
            number = max(number, self.sizes.number(int(asked)))
        wanted = min(self.sizes.rows(number), self.order.most)
        affordable = self.pace.affordable(rows, wanted - rows)
        return min(wanted, self.sizes.rounded_up(rows + affordable))


def grow(
    order: Order,
    scene: Scene,
    executor: Executor,
    pace: Pace,
    say: Callable[[str], None],
    stopping: Callable[[], bool],
) -> Growth:
    """Grow a database and its surrogate until the surrogate is as accurate as asked for.

    The arguments are those of `Growth`. The state is the database: the same call goes on after a
    stop or a kill. InputError is raised if the input cannot be used, or the budget is too small for
    a first surrogate.
    """
    path = order.request.databases[0]
    whole = completed(scene, path.parent, rehearsed=True)
    known = results(whole)
    for target in order.request.targets:
        if TARGETS.get(target, target) not in known:
            names = ", ".join(short_name(column) for column in known)
            raise InputError(f"--target {target!r}: the scene stores {names}")
    with database.lock(path):
        if path.exists():  # refuse another scene, also where the database has rows enough
            with Reader(path) as reader:
                different = differences(reader.scene, whole)
            if different:
                raise InputError(
                    f"{path} holds another scene ({'; '.join(different)}); give another --output,"
                    " or the file's own scene"
                )
        growth = Growth(order, whole, executor, pace, say, stopping)
        growth.run()
        return growth


def in_words(found: Appraisal, advice: float | None) -> str:
    """Say how accurate a surrogate is, and how many rows the mark needs."""
    errors = ", ".join(
        f"{name} {each.accuracy.nmae:.2f} +- {each.accuracy.error:.2f} %"
        f" (at most {found.bound(name):.2f} %)"
        for name, each in found.judged.items()
    )
    said = f"{found.rows} rows: nMAE of {errors}; asked: {found.mark:g} %"
    if found.met:
        return f"{said}: met"
    return said if advice is None else f"{said}; {asked_for(found, advice)}"


def asked_for(found: Appraisal, advice: float) -> str:
    """Say how many more rows the learning curve asks for."""
    if math.isinf(advice):
        return "the learning curve does not come to it"
    return f"the learning curve asks for {advice:,.0f} rows, {advice - found.rows:,.0f} more"
