"""The main job: generate the rows that a database lacks, on one process or on many."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gen.arrays import Columns
from gen.generation import plan
from gen.generation.completion import completed, functions, rehearse
from gen.generation.delivery import (
    Block,
    Choice,
    FromWorkers,
    Target,
    ThroughMaster,
    delivery,
    in_parallel,
)
from gen.generation.sample import compute_rows
from gen.runtime import farm
from gen.runtime.errors import InputError
from gen.runtime.signals import Interruption
from gen.scene import Scene, load
from gen.scene.columns import row_bytes

if TYPE_CHECKING:  # a worker that writes nothing needs neither HDF5 nor a progress bar
    from gen.database import Counts

BLOCK_ROWS = 64
"""Largest number of rows of a block, for few workers: contiguous rows are written together, and a
stop waits for them."""

BLOCK_NODES = 64 * 129**2
"""Largest number of nodes of a block, unless one row has more: a stop waits for blocks at work."""

ANSWER_NODES = 129**2 / 10
"""Number of nodes whose contact a worker solves in the time that the master takes to hand out,
receive and write one block."""

MASTER_SHARE = 1.5
"""Smallest ratio of a block's compute time to the master's time to serve every worker once."""

BLOCK_BYTES = 8 * 2**20
"""Largest size of a block [bytes], unless one row has more: fields make blocks small."""


@dataclass(frozen=True)
class RunResult:
    """State in which a run left its database, the same on every process.

    Attributes
    ----------
    counts : Counts
        Numbers of pending, done and failed rows in the file.
    signal : int
        Number of the signal that interrupted the run; 0 if none did.
    overdue : int
        Number of rows left pending because they took longer than the limit.
    """

    counts: Counts
    signal: int
    overdue: int = 0


@dataclass(frozen=True)
class Request:
    """Request to generate rows of a scene into a file.

    Attributes
    ----------
    scene : str
        Name of a shipped scene, or path of a TOML file.
    path : Path
        The database.
    rows : tuple of int or None
        First row to compute and one past the last, as for a share of a job array; None for all.
    retry_failed : bool
        Whether failed rows are computed again.
    force : bool
        Whether a file of another physics number may be continued.
    sample_limit : float or None
        Wall-clock time allowed for a surface, and for each contact on it [s]; a sample that takes
        longer is left pending. None for no limit.
    writer : str
        Writer of the rows: the master ("single"), every worker its own rows ("parallel"), or the
        latter if this h5py and the file system allow it ("auto").
    """

    scene: str
    path: Path
    rows: tuple[int, int] | None = None
    retry_failed: bool = False
    force: bool = False
    sample_limit: float | None = None
    writer: Choice = "auto"


def generate_database(request: Request, world: farm.World) -> RunResult:
    """Create or continue a database; every process of the world has to call it.

    Parameters
    ----------
    request : Request
        Scene, file and options.
    world : farm.World
        The processes: the master reads, checks and hands out work, the workers compute.

    Returns
    -------
    RunResult
        State of the file at the end of the run.

    Raises
    ------
    InputError
        On the master, for a scene or a file that cannot be used, or a full disk.
    gen.runtime.farm.MasterLeft
        On the workers in these cases.
    """
    with ExitStack() as stack:
        # From here on a signal is noted; it takes effect between two blocks, not in a broadcast.
        interruption = stack.enter_context(Interruption(listening=world.is_master))
        job = stack.enter_context(_Job(request, world)) if world.is_master else None
        target: Target = world.broadcast(job and job.target)
        compute = partial(_compute_block, target, world.rank, request.sample_limit)
        blocks = job.blocks(world) if job is not None else iter(())
        delivered = delivery(target, world, compute)
        return _work_off(job, blocks, delivered, world, interruption)


class _Job:
    """The master's side of a run: the locked file, ready for writing, and its pending rows."""

    def __init__(self, request: Request, world: farm.World) -> None:
        from gen import database

        with ExitStack() as stack:
            asked_for = completed(load(request.scene), request.path.parent)
            first, last = request.rows or (0, asked_for.samples)
            if not 0 <= first < last <= asked_for.samples:
                raise InputError(
                    f"--rows {first}:{last}: give first and last + 1 of the rows 0 to"
                    f" {asked_for.samples}, as 0:{asked_for.samples}"
                )
            parallel = in_parallel(request.writer, request.path, world)
            stack.enter_context(database.lock(request.path))
            if not request.path.exists():
                rehearse(asked_for)
            self.opened = database.open_or_create(
                request.path, asked_for, range(first, last), force=request.force
            )
            with database.Writer(request.path, asked_for, force=request.force) as writer:
                scene = writer.scene
                self.retried = writer.retry_failed(first, last) if request.retry_failed else 0
                self.pending = writer.pending(first, last)
            scene.surface.make_ready(request.path.parent)
            self.target = Target(request.path, scene, parallel, request.force)
            self._stack = stack.pop_all()

    def __enter__(self) -> _Job:
        return self

    def __exit__(self, *error: object) -> None:
        self._stack.close()

    def blocks(self, world: farm.World) -> Iterator[Block]:
        """Cut the pending rows into tasks."""
        return blocks_of(self.target.scene, self.pending, world.workers)


def blocks_of(scene: Scene, pending: list[Block], workers: int) -> Iterator[Block]:
    """Cut pending rows into the blocks of a run, as large as the size of a row allows.

    Parameters
    ----------
    scene : Scene
        Description of the samples.
    pending : list of (int, int)
        Ranges (start, stop) of rows, ascending.
    workers : int
        Number of workers that share the blocks.

    Returns
    -------
    iterator of (int, int)
        The blocks, see `gen.generation.plan.blocks`.
    """
    nodes = math.prod(scene.shape)
    fitting = max(1, min(BLOCK_ROWS, BLOCK_NODES // nodes))
    most = max(1, BLOCK_BYTES // row_bytes(scene))
    least = max(1, min(most, _least_rows(nodes, sum(b - a for a, b in pending), workers)))
    return plan.blocks(
        pending,
        samples=scene.samples,
        samples_per_surface=scene.samples_per_surface,
        workers=workers,
        largest=min(most, max(fitting, 2 * least - 1)),
        smallest=least,
    )


def _least_rows(nodes: int, rows: int, workers: int) -> int:
    """Return the number of rows of a block below which many workers would wait for the master.

    The master has to answer all workers in the time of a block. If there are few rows for each
    worker, it is enough to deal with all blocks in that time: larger blocks would idle workers.
    """
    answer = ANSWER_NODES / nodes  # the master's time for a block, in solves
    return int(min(MASTER_SHARE * workers * answer, math.sqrt(rows * answer)))


def _work_off(
    job: _Job | None,
    blocks: Iterator[Block],
    delivered: ThroughMaster | FromWorkers,
    world: farm.World,
    interruption: Interruption,
) -> RunResult:
    """Run the farm, and broadcast the master's result.

    If all processes have opened the file, all of them have to close it: between here and the farm
    the master does nothing that can fail.
    """
    with delivered:
        if job is None:
            farm.run(delivered.work, blocks, _ignore, world)
        else:
            ended = _supervise(job, blocks, delivered, world, interruption)
    # Every writer has closed the file: its rows can be counted now.
    result: RunResult = world.broadcast(None if job is None else _counted(job.target.path, ended))
    return result


def _counted(path: Path, ended: RunResult) -> RunResult:
    """Count the rows of the file by status."""
    from gen import database

    with database.Reader(path) as reader:
        return replace(ended, counts=reader.counts())


def _supervise(
    job: _Job,
    blocks: Iterator[Block],
    delivered: ThroughMaster | FromWorkers,
    world: farm.World,
    interruption: Interruption,
) -> RunResult:
    """Do the master's part: hand out blocks, take the results, and note signals and late rows."""
    from gen.database import Counts
    from gen.runtime.terminal import RunProgress

    overdue = 0
    todo = sum(stop - start for start, stop in job.pending)
    with RunProgress(todo) as progress:
        progress.say(_opening_line(job, todo, world))
        for function in functions(job.target.scene):
            progress.say(f"runs {function}")
        scene = job.target.scene
        doubts = [f"warning: {line}" for line in scene.contact.doubts]
        for line in (*doubts, *scene.surface.remarks()):
            progress.say(f"  {line}")

        def take(block: Block, result: Any) -> None:
            nonlocal overdue
            tally = delivered.take(block, result)
            overdue += tally.overdue
            progress.advance(block[1] - block[0] - tally.overdue, tally.failed)

        farm.run(delivered.work, blocks, take, world, stopping=interruption.requested)
        delivered.confirm()
    return RunResult(Counts(0, 0, 0), interruption.signal, overdue)


def _opening_line(job: _Job, todo: int, world: farm.World) -> str:
    """Describe the run that is about to begin."""
    again = f", {job.retried} failed ones among them" if job.retried else ""
    workers = "worker" if world.workers == 1 else "workers"
    writer = "parallel" if job.target.parallel else "single"
    return (
        f"{job.target.path}: {job.opened.how}, {job.opened.samples} rows, {todo} to do{again};"
        f" {world.workers} {workers}, {writer} writer"
    )


def _compute_block(target: Target, rank: int, limit: float | None, block: Block) -> Columns:
    """Compute the rows of a worker's block."""
    target.scene.surface.make_ready(target.path.parent, verify=False)
    return compute_rows(target.scene, *block, rank=rank, limit=limit)


def _ignore(block: Block, result: Any) -> None:
    """Drop a result: only the master receives any."""
