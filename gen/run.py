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
from gen.schema import Status, columns_for

BLOCK_ROWS = 64
"""Rows of a block at most: half a second of the paper's solves, 36,500 rows/s to write."""

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


def generate_database(
    scene_name: str, path: Path, world: farm.World, *, force: bool = False
) -> Outcome:
    """Create or continue a database; every process of the world has to call it.

    Parameters
    ----------
    scene_name : a shipped scene's name, or the path of a TOML file
    path : the database
    world : the processes; the master reads, checks and writes, the others compute
    force : True to continue a file of another physics number

    Raises
    ------
    InputError
        On every process alike, for a scene or a file that cannot be used, or a full disk.
    """
    with ExitStack() as stack:
        job: _Job | None = None
        scene: Scene | None = None
        refusal = ""
        if world.is_master:
            try:
                job = stack.enter_context(_Job(scene_name, path, force=force))
                scene = job.scene
            except InputError as error:
                refusal = str(error)
        scene, refusal = world.broadcast((scene, refusal))
        if scene is None:
            raise InputError(refusal)
        outcome = _work_off(job, scene, world)
    if outcome.message:
        raise InputError(outcome.message)
    return outcome


class _Job:
    """The master's side of a run: the locked, open file and what it lacks.

    Parameters as for `generate_database`.
    """

    def __init__(self, scene_name: str, path: Path, *, force: bool) -> None:
        self._stack = ExitStack()
        with self._stack:
            asked_for = load(scene_name)
            self._stack.enter_context(database.lock(path))
            self.opened = database.open_or_create(path, asked_for, force=force)
            self.writer = self._stack.enter_context(database.Writer(path, asked_for, force=force))
            self.scene = self.writer.scene
            self._stack = self._stack.pop_all()

    def __enter__(self) -> "_Job":
        return self

    def __exit__(self, *error: object) -> None:
        self._stack.close()

    def blocks(self, workers: int) -> Iterator[tuple[int, int]]:
        """Ranges of rows to compute, for the farm."""
        nodes = self.scene.surface.nodes
        row_bytes = sum(
            np.dtype(column.dtype).itemsize * int(np.prod(column.shape(1, nodes)))
            for column in columns_for(self.scene.store)
        )
        return plan.blocks(
            self.writer.pending(),
            samples=self.scene.samples,
            samples_per_surface=self.scene.samples_per_surface,
            workers=workers,
            largest=max(1, min(BLOCK_ROWS, BLOCK_BYTES // row_bytes)),
        )


def _work_off(job: _Job | None, scene: Scene, world: farm.World) -> Outcome:
    """Run the farm; the outcome of the master is everybody's."""
    work = partial(_compute_block, scene)
    with Interruption(listening=world.is_master) as interruption:
        if job is None:
            farm.run(work, iter(()), _ignore, world)
        ended = None if job is None else _supervise(job, work, world, interruption)
        outcome: Outcome = world.broadcast(ended)
    return outcome


def _supervise(
    job: _Job, work: "partial[Rows]", world: farm.World, interruption: Interruption
) -> Outcome:
    """The master's part: hand out blocks, write what comes back, say how it ended."""
    counts = job.writer.counts()
    message = ""
    with RunProgress(counts.done + counts.failed, sum(counts)) as progress:
        progress.say(
            f"{job.writer.path}: {job.opened.how}, {counts.done + counts.failed} of {sum(counts)}"
            f" rows finished; {world.workers} worker{'s' if world.workers > 1 else ''}"
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
