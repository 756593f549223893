"""The run: compute the rows that a database lacks, by one process or many, and write them.

The rows are cut into blocks. The master hands out blocks to the workers, which compute them; a sink
(`gen.generation.sinks`) brings the results into the file. Without MPI one process is the master and
its only worker.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from gen.arrays import Columns
from gen.generation.completion import completed, load_scene, recorded_scene
from gen.generation.sample import compute_rows
from gen.generation.sinks import Sink, WriterOption, in_parallel, open_sink
from gen.generation.trial import doubts_after, doubts_before
from gen.runtime import farm
from gen.runtime.errors import InputError
from gen.runtime.farm import Interruption
from gen.runtime.files import lock
from gen.runtime.terminal import RunProgress, echo
from gen.runtime.user_code import source_of
from gen.scene import Scene, row_bytes
from gen.schema import Status

if TYPE_CHECKING:  # a worker that writes nothing needs no HDF5
    from gen.database import Counts

BLOCK_ROWS = 64
"""Usual largest number of rows of a block: they are written together, and a run that is stopped
finishes them first. Blocks of small grids with many workers may have more, see `_block_sizes`."""

BLOCK_NODES = 64 * 129**2
"""Usual largest number of nodes of the surfaces of all rows of a block; a row with more nodes is a
block of its own."""

ANSWER_NODES = 129**2 / 10
"""Number of nodes that a worker solves in the time that the master takes to hand out a block and to
write its rows."""

MASTER_SHARE = 1.5
"""Smallest ratio of the time in which a worker computes a block to the time in which the master
serves every worker once."""

BLOCK_BYTES = 8 * 2**20
"""Largest size of a block [bytes]; a larger row is a block of its own. Fields make rows large."""

PATIENCE = 2.0
"""Time after which the user is told that a function is still being tried [s]."""


class RunResult(NamedTuple):
    """State of the database at the end of a run; every process gets the same result."""

    counts: Counts  # numbers of pending, done and failed rows of the whole file
    signal: int  # number of the signal that stopped the run; 0 if none did
    overdue: int = 0  # number of rows that stay pending: they took longer than the limit


@dataclass(frozen=True)
class _Request:
    """The arguments of a run, equal on all processes."""

    path: Path  # path of the database
    rows: range | None  # numbers of the wanted rows; None for all rows of the scene
    retry_failed: bool  # whether failed rows among these are computed again
    force: bool  # whether the database may have another physics number
    # Largest time for a surface, and for each contact [s]; None for no limit.
    limit: float | None
    writer: WriterOption  # which processes write rows, as the user asks for it


@dataclass(frozen=True)
class _Job:
    """Facts that workers need in addition to the request; the master sends them to all workers."""

    scene: Scene  # the scene that the database has recorded
    parallel: bool  # whether every process writes its own rows


@dataclass(frozen=True)
class _Preparation:
    """Facts that the master knows before it hands out the first block."""

    job: _Job
    # Numbers of the rows that are to be computed, in ascending order.
    pending: list[range]
    remarks: list[str]  # lines for the user, printed when the run begins


@dataclass(frozen=True, eq=False)
class _Worker:
    """A process that computes blocks of rows. Without MPI it is the master too."""

    scene: Scene  # the scene that the database has recorded
    folder: Path  # folder of the database, with prepared maps that all processes share
    sink: Sink
    rank: int  # MPI rank of this process
    # Largest time for a surface, and for each contact [s]; None for no limit.
    limit: float | None

    def compute(self, block: range) -> Columns:
        """Compute a block of rows, give it to the sink, and return the columns for the master.

        `block` has the numbers of the rows. The result has all columns of the rows by their names
        if the master writes the rows, or the column "status" alone if this process has written
        them.
        """
        # The master has checked the prepared maps for damage.
        self.scene.surface.make_ready(self.folder, verify=False)
        rows = compute_rows(
            self.scene, block.start, block.stop, rank=self.rank, limit=self.limit
        )
        return self.sink.deliver(block, rows)


class _Receiver:
    """Take blocks of computed rows on the master, and count overdue rows.

    Parameters
    ----------
    sink : Sink
        The master's sink.
    progress : RunProgress
        Display of the number of rows.

    Attributes
    ----------
    overdue : int
        Number of rows until now that took longer than the limit and stay pending.
    """

    def __init__(self, sink: Sink, progress: RunProgress) -> None:
        self._sink = sink
        self._progress = progress
        self.overdue = 0

    def take(self, block: range, rows: Columns) -> None:
        """Pass a block of rows to the sink, count its overdue rows, and show the progress.

        `block` has the numbers of the rows, and `rows` are the columns that `_Worker.compute` has
        returned. The sink writes them unless the worker has done so.
        """
        self._sink.receive(block, rows)
        # A computed row is pending only if it took longer than the limit.
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
    """Create or continue a database; a collective call, with equal arguments on all processes.

    The master holds the lock of the database during the run, and prints remarks and progress on
    standard error. After the first signal, the blocks that are being computed are finished and
    written, and the run ends. The second signal ends the process at once.

    Parameters
    ----------
    scene : str
        Name of a preset, or path of a scene's file or of a database with its scene.
    path : Path
        Database. It is created if it does not exist, and extended if it lacks some of the rows.
    world : World
        The processes of the run.
    rows : range, optional
        Numbers of the rows that are to be computed unless they are finished; all rows of the scene
        by default. A new database holds these rows only.
    retry_failed : bool
        Whether failed rows among these are computed again.
    force : bool
        Whether the database may have another physics number.
    limit : float, optional
        Largest time for a surface, and for each contact [s]; no limit by default. Rows that take
        longer stay pending.
    writer : {"auto", "single", "parallel"}
        Which processes write rows: with "single" the master writes all rows, with "parallel" each
        process its own ones. "auto" decides by `gen.generation.sinks.in_parallel`.

    Returns
    -------
    RunResult
        Counts of the database, the signal that stopped the run, and the number of overdue rows.

    Raises
    ------
    InputError
        On the master, if the scene, the rows or the database are refused, the user's function
        fails, or the disk fails.
    MasterLeft
        On a worker, if the master has ended the command, as after an InputError.
    """
    request = _Request(
        path=path,
        rows=rows,
        retry_failed=retry_failed,
        force=force,
        limit=limit,
        writer=writer,
    )
    if not world.is_master:
        return _serve(request, world)
    # Signals are not recorded yet while a user's function is tried: the first one ends the trial.
    complete = _completed(scene, request)
    # Signals are recorded now. They take effect between two blocks, never in a broadcast.
    with (
        Interruption(listening=True) as interruption,
        _prepared(complete, request, world) as preparation,
    ):
        world.broadcast(preparation.job)
        overdue = _farm_out(preparation, request, world, interruption)
        # Every writer has closed the file, so its rows can be counted now.
        from gen.database import Reader

        with Reader(path) as reader:
            counts = reader.counts()
        result = RunResult(counts=counts, signal=interruption.signal, overdue=overdue)
        world.broadcast(result)
        return result


def _serve(request: _Request, world: farm.World) -> RunResult:
    """Compute blocks of rows on a worker until the run ends, and return the master's result.

    The calls of `broadcast` and `farm.run` meet those of the master in `generate_database`. Raises
    MasterLeft if the master has ended the command.
    """
    with Interruption(listening=False):
        job: _Job = world.broadcast(None)  # receives; only the master's argument is sent
        with _sink_of(job, request, world) as sink:
            worker = _worker_of(job, request, sink, world)
            # Only the master uses the tasks and `on_result`.
            farm.run(worker.compute, tasks=iter(()), on_result=sink.receive, world=world)
        result: RunResult = world.broadcast(None)
        return result


def _farm_out(
    preparation: _Preparation,
    request: _Request,
    world: farm.World,
    interruption: Interruption,
) -> int:
    """Let the workers compute the pending rows and the sinks write them, on the master.

    Return the number of overdue rows. With the parallel writer, all processes open and close the
    file together. Nothing may fail between the opening of the master's sink and `farm.run`, because
    the workers would then wait for the master in `farm.run`.
    """
    job = preparation.job
    todo = sum(map(len, preparation.pending))
    with _sink_of(job, request, world) as sink, RunProgress(todo) as progress:
        for remark in preparation.remarks:
            progress.say(remark)
        worker = _worker_of(job, request, sink, world)
        receiver = _Receiver(sink, progress)
        farm.run(
            worker.compute,
            tasks=blocks_of(job.scene, preparation.pending, world.workers),
            on_result=receiver.take,
            world=world,
            stopping=interruption.requested,
            when_quiet=sink.sync_when_due,
        )
        sink.confirm()  # raises InputError if the file was replaced during the run
    return receiver.overdue


def _sink_of(
    job: _Job, request: _Request, world: farm.World
) -> AbstractContextManager[Sink]:
    """Return a context manager that opens the sink of this process when it is entered."""
    return open_sink(
        request.path, job.scene, world, parallel=job.parallel, force=request.force
    )


def _worker_of(job: _Job, request: _Request, sink: Sink, world: farm.World) -> _Worker:
    """Return the worker of this process, which gives its rows to the open sink."""
    return _Worker(
        scene=job.scene,
        folder=request.path.parent,
        sink=sink,
        rank=world.rank,
        limit=request.limit,
    )


def _completed(name: str, request: _Request) -> Scene:
    """Read the scene of a name or path, and complete it as its database records it.

    If a user's function is tried for longer than `PATIENCE`, a line on standard error says so. The
    progress of the trial for an accuracy is printed there too.
    """
    path = request.path
    scene = load_scene(name)
    _rows_of(request, scene)  # refused before a trial
    line = f"{path}: tries {scene.store.function} on contacts of the scene first"
    announcement = threading.Timer(PATIENCE, echo, args=[line], kwargs={"err": True})
    announcement.daemon = True
    is_new = not path.exists()
    if scene.store.function is not None:
        announcement.start()
    # A trial for an accuracy may be long: nobody else makes the same file in the meantime.
    has_trial = is_new and scene.needs_trial
    try:
        with lock(path) if has_trial else nullcontext():
            # Functions are tried before a new file is made. For an old file this was done then.
            return completed(
                scene,
                path.parent,
                rehearsed=is_new,
                limit=request.limit,
                recorded=recorded_scene(path, scene),
                watched=True,
            )
    finally:
        announcement.cancel()


@contextmanager
def _prepared(
    complete: Scene, request: _Request, world: farm.World
) -> Iterator[_Preparation]:
    """Create, extend or check the database on the master, and yield the first facts of the run.

    The lock of the database is held until this context manager ends. Failed rows are made pending
    if the request says so. If rows are pending, the warnings follow from a trial of a few rows,
    which are not written; otherwise they follow from the done rows.
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
            rows_in_file = len(writer.rows)
            damage = writer.damage()
            if request.retry_failed:
                retried = writer.retry_failed(rows.start, rows.stop)
            pending = writer.pending(rows.start, rows.stop)
        scene.surface.make_ready(path.parent)
        todo = sum(map(len, pending))
        if todo:
            warnings = doubts_before(scene, todo)
        else:
            with database.Reader(path) as reader:
                warnings = doubts_after(reader)
        if damage:
            warnings = [*warnings, damage]
        beginning = f"{path}: {origin}, {rows_in_file} rows, {todo} to do"
        if retried:
            beginning += f", {retried} failed ones among them"
        workers = "1 worker" if world.workers == 1 else f"{world.workers} workers"
        writer_kind = "parallel" if parallel else "single"
        yield _Preparation(
            job=_Job(scene=scene, parallel=parallel),
            pending=pending,
            remarks=[
                f"{beginning}; {workers}, {writer_kind} writer",
                *_remarks_on_functions(scene),
                *(f"  {line}" for line in scene.report_of_accuracy()[:1]),
                *(f"  warning: {warning}" for warning in warnings),
                *(f"  {remark}" for remark in _remarks_on_maps(scene)),
            ],
        )


def _rows_of(request: _Request, scene: Scene) -> range:
    """Return the numbers of the rows that a run is asked for: by default all rows of the scene.

    Raises InputError if the scene does not have these rows.
    """
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
    """Return a line for each user's function that a run calls: its name and its source file.

    The list is empty if the scene names no function.
    """
    generator = getattr(scene.surface, "function", None)  # only a user's generator has it
    functions = {generator, scene.store.function}
    names = sorted(str(function) for function in functions if function is not None)
    return [f"runs {name} of {source_of(name)}" for name in names]


def _remarks_on_maps(scene: Scene) -> list[str]:
    """Return the generator's lines about its maps, or an empty list if it uses no maps."""
    if not scene.surface.FOLLOWS_MAPS:
        return []  # the generator uses no maps
    return scene.surface.remarks()


def blocks_of(scene: Scene, pending: Sequence[range], workers: int) -> Iterator[range]:
    """Cut pending rows into blocks, the tasks of workers, which become smaller towards the end.

    This is guided self-scheduling (Polychronopoulos and Kuck, 1987): a block gets the remaining
    rows divided by three times the number of workers, within the bounds of `_block_sizes`. If
    possible, it ends where the rows of a surface end, so that no other block makes this surface
    again.

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
        Numbers of the rows of a block. Every pending row is in one block, and no other row is.
    """
    remaining = sum(map(len, pending))
    sizes = _block_sizes(scene, remaining, workers)
    for rows in pending:
        start = rows.start
        while start < rows.stop:
            share = remaining // (3 * workers)
            count = min(max(sizes.smallest, share), sizes.largest)
            end = _end_of_block(scene, start, count, sizes.largest)
            block = range(start, min(end, rows.stop))
            yield block
            remaining -= len(block)
            start = block.stop


class _BlockSizes(NamedTuple):
    """Bounds of the number of rows that a block is planned to have.

    A block can still be smaller, if it ends with a surface or with a range of pending rows.
    """

    smallest: int  # number of rows
    largest: int  # number of rows


def _block_sizes(scene: Scene, rows: int, workers: int) -> _BlockSizes:
    """Bound the number of rows of a block by the size of rows and by the time of the master.

    While a worker computes a block, the master needs time to serve all workers. If there are only a
    few pending `rows`, it is enough that the master can serve all blocks in this time.
    """
    nodes = math.prod(scene.grid.shape)
    # Time of the master for one block, over the time of a worker for one row.
    answer_in_rows = ANSWER_NODES / nodes
    for_all_workers = MASTER_SHARE * workers * answer_in_rows
    # A worker computes a block of b rows in the time of b rows. There are rows / b blocks, and the
    # master serves all of them in rows / b * answer_in_rows. Both times are equal for this b:
    for_all_blocks = math.sqrt(rows * answer_in_rows)
    needed = int(min(for_all_workers, for_all_blocks))
    fitting = max(1, BLOCK_BYTES // row_bytes(scene))
    smallest = max(1, min(fitting, needed))
    usual = max(1, min(BLOCK_ROWS, BLOCK_NODES // nodes))
    # A surface is cut only if it has more than `largest` rows. If `largest` is at least
    # 2 * smallest - 1, such a surface has at least 2 * smallest rows, so both pieces can have
    # `smallest` rows.
    largest = min(fitting, max(usual, 2 * smallest - 1))
    return _BlockSizes(smallest=smallest, largest=largest)


def _end_of_block(scene: Scene, start: int, count: int, largest: int) -> int:
    """Return the number of the row behind a block that begins with row `start`.

    The block has `count` rows or fewer, and ends with the last row of a surface. If the surface of
    row `start` does not end within `count` rows, the block has the rest of this surface. If this
    rest exceeds `largest` rows, the block has `count` of them.
    """
    per_surface = scene.samples_per_surface
    border = (start + count) // per_surface * per_surface  # first row of a surface
    if border > start:
        return border
    end_of_surface = border + per_surface
    if end_of_surface - start <= largest:
        return end_of_surface
    return start + count
