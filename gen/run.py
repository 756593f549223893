"""The main job: generate what a database lacks, on one process or on many."""

from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from gen import database, farm, plan
from gen.errors import InputError
from gen.interruption import Interruption
from gen.progress import RunProgress
from gen.sample import Rows, compute_rows
from gen.scene import Scene, load
from gen.schema import Status, row_bytes

BLOCK_ROWS = 64
"""Rows of a block at most: contiguous rows are written together, and a stop waits for them."""

BLOCK_NODES = 64 * 129**2
"""Nodes of a block at most, unless one row has more: a stop waits for what is in flight."""

BLOCK_BYTES = 8 * 2**20
"""Bytes of a block at most, unless one row has more: fields make blocks small."""


@dataclass(frozen=True)
class Outcome:
    """How a run ended, the same on every process.

    Attributes
    ----------
    counts : rows pending, done and failed in the file
    signal : number of the signal that interrupted the run, 0 if none did
    message : what went wrong with the input or the disk, "" if nothing did
    """

    counts: database.Counts
    signal: int
    message: str


@dataclass(frozen=True)
class Request:
    """What to generate and where.

    Attributes
    ----------
    scene : a shipped scene's name, or the path of a TOML file
    path : the database
    rows : first row and one past the last of those to compute, None for all; a job array's share
    retry_failed : True to compute failed rows again
    force : True to continue a file of another physics number
    """

    scene: str
    path: Path
    rows: tuple[int, int] | None = None
    retry_failed: bool = False
    force: bool = False


def generate_database(request: Request, world: farm.World) -> Outcome:
    """Create or continue a database; every process of the world has to call it.

    Parameters
    ----------
    request : what to generate and where
    world : the processes; the master reads, checks and writes, the others compute

    Raises
    ------
    InputError
        On every process alike, for a scene or a file that cannot be used, or a full disk.
    """
    with ExitStack() as stack:
        # From here on a signal is noted; it takes effect between two blocks, not in a broadcast.
        interruption = stack.enter_context(Interruption(listening=world.is_master))
        job: _Job | None = None
        scene: Scene | None = None
        refusal = ""
        if world.is_master:
            try:
                job = stack.enter_context(_Job(request))
                scene = job.scene
            except InputError as error:
                refusal = str(error)
        scene, refusal = world.broadcast((scene, refusal))
        if scene is None:
            raise InputError(refusal)
        outcome = _work_off(job, scene, world, interruption)
    if outcome.message:
        raise InputError(outcome.message)
    return outcome


class _Job:
    """The master's side of a run: the locked, open file and what it lacks."""

    def __init__(self, request: Request) -> None:
        with ExitStack() as stack:
            asked_for = load(request.scene)
            first, last = request.rows or (0, asked_for.samples)
            if not 0 <= first < last <= asked_for.samples:
                raise InputError(
                    f"--rows {first}:{last}: give first and last + 1 of the rows 0 to"
                    f" {asked_for.samples}, as 0:{asked_for.samples}"
                )
            stack.enter_context(database.lock(request.path))
            self.opened = database.open_or_create(request.path, asked_for, force=request.force)
            self.writer = stack.enter_context(
                database.Writer(request.path, asked_for, force=request.force)
            )
            self.scene = self.writer.scene
            self._rows = (first, last)
            self.retried = self.writer.retry_failed(first, last) if request.retry_failed else 0
            self._stack = stack.pop_all()

    def __enter__(self) -> "_Job":
        return self

    def __exit__(self, *error: object) -> None:
        self._stack.close()

    def pending(self) -> list[tuple[int, int]]:
        """Ranges of the rows that this run is to finish."""
        return self.writer.pending(*self._rows)

    def blocks(self, workers: int) -> Iterator[tuple[int, int]]:
        """Ranges of rows to compute, for the farm."""
        nodes = self.scene.surface.nodes
        block_rows = BLOCK_BYTES // row_bytes(self.scene.store, nodes)
        return plan.blocks(
            self.pending(),
            samples=self.scene.samples,
            samples_per_surface=self.scene.samples_per_surface,
            workers=workers,
            largest=max(1, min(BLOCK_ROWS, BLOCK_NODES // nodes**2, block_rows)),
        )


def _work_off(
    job: _Job | None, scene: Scene, world: farm.World, interruption: Interruption
) -> Outcome:
    """Run the farm; the outcome of the master is everybody's."""
    work = partial(_compute_block, scene)
    if job is None:
        farm.run(work, iter(()), _ignore, world)
    ended = None if job is None else _supervise(job, work, world, interruption)
    outcome: Outcome = world.broadcast(ended)
    return outcome


def _supervise(
    job: _Job, work: "partial[Rows]", world: farm.World, interruption: Interruption
) -> Outcome:
    """The master's part: hand out blocks, write what comes back, say how it ended."""
    message = ""
    todo = sum(stop - start for start, stop in job.pending())
    total = sum(job.writer.counts())
    with RunProgress(todo) as progress:
        again = f", {job.retried} failed ones among them" if job.retried else ""
        workers = "worker" if world.workers == 1 else "workers"
        progress.say(
            f"{job.writer.path}: {job.opened.how}, {total} rows, {todo} to do{again};"
            f" {world.workers} {workers}"
        )

        def write(block: tuple[int, int], rows: Rows) -> None:
            job.writer.write_block(*block, rows)
            failed = int(np.count_nonzero(rows["status"] == Status.FAILED))
            progress.advance(block[1] - block[0], failed)

        try:
            farm.run(work, job.blocks(world.workers), write, world, stopping=interruption.requested)
        except InputError as error:
            message = str(error)
    return Outcome(job.writer.counts(), interruption.signal, message)


def _compute_block(scene: Scene, block: tuple[int, int]) -> Rows:
    """Do a worker's task."""
    return compute_rows(scene, *block, rank=farm.this_world().rank)


def _ignore(block: tuple[int, int], rows: Rows) -> None:
    """Drop results: only the master has any."""
