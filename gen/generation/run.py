"""The run: generate the rows that a database lacks, by one process or many."""

from __future__ import annotations

import math
import threading
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from gen.arrays import Columns
from gen.generation.completion import completed
from gen.generation.sample import compute_rows
from gen.generation.sinks import Sink, WriterOption, in_parallel, open_sink
from gen.generation.trial import doubts_after, doubts_before
from gen.runtime import farm
from gen.runtime.errors import InputError
from gen.runtime.farm import Interruption
from gen.runtime.terminal import RunProgress, echo
from gen.runtime.user_code import source_of
from gen.scene import Scene, load, row_bytes
from gen.schema import Status

if TYPE_CHECKING:  # a worker that writes nothing needs no HDF5
    from gen.database import Counts

BLOCK_ROWS = 64
"""Most rows of a block: they are written together, and a stop of the run waits for them."""

BLOCK_NODES = 64 * 129**2  # most nodes of a block, unless one row has more
ANSWER_NODES = 129**2 / 10  # nodes solved while the master hands out and writes a block

MASTER_SHARE = 1.5
"""Least ratio of the time of a block to the master's time to serve every worker once."""

BLOCK_BYTES = 8 * 2**20
"""Most bytes of a block, unless one row has more: fields make it small."""

PATIENCE = 2.0  # time after which a trial of a user's function is announced [s]


class RunResult(NamedTuple):
    """State in which a run left its database, the same on every process."""

    counts: Counts
    signal: int  # number of the signal that interrupted the run; 0 if none did
    overdue: int = 0  # rows left pending because they took longer than the limit


@dataclass(frozen=True)
class _Request:
    """What a run is to do, the same on every process."""

    path: Path  # of the database
    rows: range | None  # numbers of the rows; None for all rows of the scene
    retry_failed: bool  # whether failed rows are computed again
    force: bool  # whether the database may have another physics number
    limit: float | None  # largest time for a surface, and for each contact [s]
    writer: WriterOption


@dataclass(frozen=True)
class _Job:
    """What a process has to know to compute rows of a run; the master sends it to all workers."""

    scene: Scene  # as the database records it
    parallel: bool  # whether every process writes its own rows


@dataclass(frozen=True)
class _Preparation:
    """What the master knows of a run before the first block: its job, its rows, its remarks."""

    job: _Job
    pending: list[range]  # numbers of the rows that are to be computed
    remarks: list[str]  # lines for the user


@dataclass(frozen=True, eq=False)
class _Worker:
    """A process that computes blocks of rows; without MPI it is the master too."""

    scene: Scene
    folder: Path  # of the database, with what is prepared once for all processes
    sink: Sink
    rank: int
    limit: float | None  # largest time for a surface, and for each contact [s]

    def compute(self, block: range) -> Columns:
        """Compute a block of rows, and return the columns of them that the master needs."""
        self.scene.surface.make_ready(self.folder, verify=False)
        rows = compute_rows(
            self.scene, block.start, block.stop, rank=self.rank, limit=self.limit
        )
        return self.sink.deliver(block, rows)


class _Receiver:
    """What the master does with the blocks that workers have computed.

    Parameters
    ----------
    sink : Sink
        The master's sink.
    progress : RunProgress
        Shows the number of rows.

    Attributes
    ----------
    overdue : int
        Number of rows so far that took longer than the limit.
    """

    def __init__(self, sink: Sink, progress: RunProgress) -> None:
        self._sink = sink
        self._progress = progress
        self.overdue = 0

    def take(self, block: range, rows: Columns) -> None:
        """Write a block of rows if its worker has not, count its rows, and show the progress."""
        self._sink.receive(block, rows)
        pending = int(np.count_nonzero(rows["status"] == Status.PENDING))
        failed = int(np.count_nonzero(rows["status"] == Status.FAILED))
        self.overdue += pending
        self._progress.advance(len(block) - pending, failed=failed)


def generate_database(
    scene: str,
    path: Path,
    world: farm.World,
    *,
    rows: range | None = None,
    retry_failed: bool = False,
    force: bool = False,
    limit: float | None = None,
    writer: WriterOption = "auto",
) -> RunResult:
    """Create or continue a database; a collective call, with the same arguments on all processes.

    The master holds the lock of the database during the run, and prints remarks and progress on
    standard error. Signals stop the run between two blocks, and a second signal at once.

    Parameters
    ----------
    scene : str
        Name of a shipped scene, or path of a scene.
    path : Path
        Database, which need not exist.
    world : World
        The processes of the run.
    rows : range, optional
        Numbers of the rows that are wanted, all rows of the scene by default. A new database holds
        these rows only.
    retry_failed : bool
        Whether failed rows among these are computed again.
    force : bool
        Whether the database may have another physics number.
    limit : float, optional
        Largest time for a surface, and for each contact [s]. Rows that take longer stay pending.
    writer : {"auto", "single", "parallel"}
        Which processes write rows: "single" the master for all, "parallel" each process its own.

    Returns
    -------
    RunResult
        Counts of the database, and what kept the run from finishing it.

    Raises
    ------
    InputError
        On the master, if scene, rows or database are refused, or the disk fails.
    MasterLeft
        On the workers, once the master has ended the command instead.
    """
    request = _Request(path, rows, retry_failed, force, limit, writer)
    if not world.is_master:
        return _serve(request, world)
    # A user's function is tried before signals are noted, so that the first one ends the trial.
    complete = _completed(scene, request)
    # From here on a signal is noted. It takes effect between two blocks, never in a broadcast.
    with (
        Interruption(listening=True) as interruption,
        _prepared(complete, request, world) as preparation,
    ):
        world.broadcast(preparation.job)
        overdue = _farm_out(preparation, request, world, interruption)
        # Every writer has closed the file: its rows can be counted now.
        from gen.database import Reader

        with Reader(path) as reader:
            counts = reader.counts()
        result = RunResult(counts, interruption.signal, overdue)
        world.broadcast(result)
        return result


def _serve(request: _Request, world: farm.World) -> RunResult:
    """Compute blocks of rows for the master until the run ends, and return the master's result."""
    with Interruption(listening=False):
        job: _Job = world.broadcast(None)
        with _sink_of(job, request, world) as sink:
            worker = _Worker(
                job.scene, request.path.parent, sink, world.rank, request.limit
            )
            farm.run(worker.compute, iter(()), sink.receive, world)
        result: RunResult = world.broadcast(None)
        return result


def _farm_out(
    preparation: _Preparation,
    request: _Request,
    world: farm.World,
    interruption: Interruption,
) -> int:
    """Have the pending rows computed and written; return the number of overdue rows.

    With the parallel writer all processes open and close the file together. An error of the master
    between opening its sink and `farm.run` would leave the workers waiting: nothing there may fail.
    """
    job = preparation.job
    todo = sum(map(len, preparation.pending))
    with _sink_of(job, request, world) as sink, RunProgress(todo) as progress:
        for remark in preparation.remarks:
            progress.say(remark)
        worker = _Worker(job.scene, request.path.parent, sink, world.rank, request.limit)
        receiver = _Receiver(sink, progress)
        farm.run(
            worker.compute,
            blocks_of(job.scene, preparation.pending, world.workers),
            receiver.take,
            world,
            stopping=interruption.requested,
            when_quiet=sink.sync_when_due,
        )
        sink.confirm()  # refuses a file that was replaced meanwhile
    return receiver.overdue


def _sink_of(
    job: _Job, request: _Request, world: farm.World
) -> AbstractContextManager[Sink]:
    """Return the sink of this process in a run, a context manager that is not open yet."""
    return open_sink(
        request.path, job.scene, world, parallel=job.parallel, force=request.force
    )


def _completed(name: str, request: _Request) -> Scene:
    """Read and complete a scene; announce the trial of a user's function if it takes long."""
    path = request.path
    scene = load(name)
    line = f"{path}: tries {scene.store.function} on contacts of the scene first"
    announcement = threading.Timer(PATIENCE, echo, [line], {"err": True})
    announcement.daemon = True
    is_new = not path.exists()
    if scene.store.function is not None:
        announcement.start()
    try:
        return completed(scene, path.parent, rehearsed=is_new, limit=request.limit)
    finally:
        announcement.cancel()


@contextmanager
def _prepared(
    complete: Scene, request: _Request, world: farm.World
) -> Iterator[_Preparation]:
    """Create or check the database on the master, and hold its lock during the block.

    Failed rows are made pending if the request says so.
    """
    from gen import database

    path = request.path
    parallel = in_parallel(request.writer, path, world)
    rows = _rows_of(request, complete)
    with database.lock(path):
        origin = database.open_or_create(path, complete, rows, force=request.force)
        retried = 0
        with database.Writer(path, complete, force=request.force) as writer:
            scene = writer.scene
            held = len(writer.rows)
            damage = writer.damage()
            if request.retry_failed:
                retried = writer.retry_failed(rows.start, rows.stop)
            pending = writer.pending(rows.start, rows.stop)
        scene.surface.make_ready(path.parent)
        todo = sum(map(len, pending))
        with database.Reader(path) as reader:
            doubts = doubts_before(scene, todo) if todo else doubts_after(reader)
        begun = f"{path}: {origin}, {held} rows, {todo} to do"
        if retried:
            begun += f", {retried} failed ones among them"
        workers = "1 worker" if world.workers == 1 else f"{world.workers} workers"
        kind = "parallel" if parallel else "single"
        warnings = [*doubts, damage] if damage else doubts
        yield _Preparation(
            job=_Job(scene, parallel),
            pending=pending,
            remarks=[
                f"{begun}; {workers}, {kind} writer",
                *_remarks_on_functions(scene),
                *(f"  warning: {warning}" for warning in warnings),
                *(f"  {remark}" for remark in _remarks_on_maps(scene)),
            ],
        )


def _rows_of(request: _Request, scene: Scene) -> range:
    """Return the rows that a run is to make; refuse rows that the scene does not have."""
    rows = request.rows
    if rows is None:
        return range(scene.samples)
    if not 0 <= rows.start < rows.stop <= scene.samples:
        raise InputError(
            f"--rows {rows.start}:{rows.stop}: give first and last + 1 of the rows 0 to"
            f" {scene.samples}, as 0:{scene.samples}"
        )
    return rows


def _remarks_on_functions(scene: Scene) -> list[str]:
    """Return one line for each function of the user's that a run calls, with its file."""
    functions = {getattr(scene.surface, "function", None), scene.store.function}
    names = sorted(str(function) for function in functions if function is not None)
    return [f"runs {name} of {source_of(name)}" for name in names]


def _remarks_on_maps(scene: Scene) -> list[str]:
    """Return what a generator that cuts windows out of maps tells of them before a run."""
    return scene.surface.remarks() if scene.surface.PLACES else []


def blocks_of(scene: Scene, pending: Sequence[range], workers: int) -> Iterator[range]:
    """Cut pending rows into blocks, the tasks of workers, which become smaller towards the end.

    Guided self-scheduling (Polychronopoulos and Kuck, 1987): a block has a third of the share of
    one worker in the remaining rows, within the bounds of `_block_sizes`. It ends with a surface if
    possible.

    Parameters
    ----------
    scene : Scene
        The scene of the rows.
    pending : sequence of range
        Numbers of the rows, in ascending order.
    workers : int
        Number of processes that compute.

    Yields
    ------
    range
        Numbers of the rows of a block; every pending row is in one block.
    """
    remaining = sum(map(len, pending))
    sizes = _block_sizes(scene, remaining, workers)
    for rows in pending:
        start = rows.start
        while start < rows.stop:
            share = remaining // (3 * workers)
            count = min(max(sizes.smallest, share), sizes.largest)
            border = _border_of_surface(scene, start, count, sizes.largest)
            block = range(start, min(border, rows.stop))
            yield block
            remaining -= len(block)
            start = block.stop


class _BlockSizes(NamedTuple):
    """Smallest and largest number of rows of a block, where borders of surfaces allow it."""

    smallest: int
    largest: int


def _block_sizes(scene: Scene, rows: int, workers: int) -> _BlockSizes:
    """Bound the size of blocks, by the size of a row and by the time that one master needs.

    In the time of a block the master has to be able to answer all workers. With few rows it is
    enough that it deals with all blocks in that time.
    """
    nodes = math.prod(scene.grid.shape)
    answer = ANSWER_NODES / nodes  # the master's time for a block, in solves
    answered = int(min(MASTER_SHARE * workers * answer, math.sqrt(rows * answer)))
    fitting = max(1, BLOCK_BYTES // row_bytes(scene))
    smallest = max(1, min(fitting, answered))
    usual = max(1, min(BLOCK_ROWS, BLOCK_NODES // nodes))
    return _BlockSizes(smallest, min(fitting, max(usual, 2 * smallest - 1)))


def _border_of_surface(scene: Scene, start: int, count: int, largest: int) -> int:
    """Return the row behind a block that begins at `start` and is to have `count` rows.

    The block ends with the last surface that fits into `count` rows. If none does, it takes the
    rest of the surface at `start`, or `count` of its rows if the rest has more than `largest`.
    """
    per_surface = scene.samples_per_surface
    border = (start + count) // per_surface * per_surface
    if border > start:
        return border
    end_of_surface = border + per_surface
    return end_of_surface if end_of_surface - start <= largest else start + count
