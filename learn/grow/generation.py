"""New rows of a growing database, computed by the processes of the run, written by the master."""

import time
from collections.abc import Callable
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
from learn.grow.pace import Block, Pace


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
