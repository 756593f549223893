"""The farm: generate the rows that a database lacks, by one process or many, or forecast it."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from gen.arrays import Columns
from gen.generation import plan
from gen.generation.completion import completed
from gen.generation.sample import compute_rows
from gen.generation.trial import doubts_after, doubts_before
from gen.runtime import farm
from gen.runtime.errors import InputError
from gen.runtime.farm import Interruption
from gen.runtime.terminal import RunProgress, echo
from gen.runtime.user_code import source_of
from gen.scene import Scene, load, row_bytes
from gen.schema import Status

if TYPE_CHECKING:  # a worker that writes nothing needs no HDF5
    from gen.database import Counts, Writer

BLOCK_ROWS = (
    64  # most rows of a block: they are written together, and a stop waits for them
)
BLOCK_NODES = 64 * 129**2  # most nodes of a block, unless one row has more
ANSWER_NODES = 129**2 / 10  # nodes solved while the master hands out and writes a block
MASTER_SHARE = (
    1.5  # least ratio of a block's time to the master's to serve every worker once
)
BLOCK_BYTES = (
    8 * 2**20
)  # most bytes of a block, unless one row has more: fields make it small
MEASURED_SURFACES, MEASURED_LOADS = 16, 4  # of an estimate, and on each surface at most
PATIENCE = 2.0  # seconds after which a trial of a user's function is announced
COUNTED_ROWS = 1_000_000  # most planned rows whose loads are summarised

Block = tuple[int, int]  # first row of a task, and one past the last
Choice = Literal["auto", "single", "parallel"]  # writers that a user can ask for


class RunResult(NamedTuple):
    """State in which a run left its database, the same on every process."""

    counts: Counts
    signal: int  # that interrupted the run; 0 if none did
    overdue: int = 0  # rows left pending because they took longer than the limit


def opened(
    path: Path, scene: Scene, world: farm.World, *, parallel: bool, force: bool = False
) -> AbstractContextManager[Writer | None]:
    """Open the file of a run where rows are written: on the master, or in parallel everywhere."""
    if not (parallel or world.is_master):  # other workers need no HDF5
        return nullcontext()
    from gen.database import Writer

    return Writer(path, scene, world.communicator if parallel else None, force=force)


def in_parallel(choice: Choice, path: Path, world: farm.World) -> bool:
    """Decide whether several processes write; `auto` means all of them wherever it is safe."""
    from gen import database

    if choice == "parallel" and (world.size == 1 or not database.parallel_hdf5()):
        raise InputError(
            "--writer parallel: needs an h5py with MPI, see docs/how-to/parallel-hdf5.md, and"
            " processes: mpiexec -n 9 python -m mpi4py -m gen run ..."
        )
    if choice == "auto":
        return database.parallel_hdf5() and database.coherent(path)
    return choice == "parallel"


def generate_database(
    scene: str,
    path: Path,
    world: farm.World,
    *,
    rows: tuple[int, int] | None = None,
    retry_failed: bool = False,
    force: bool = False,
    limit: float | None = None,
    choice: Choice = "auto",
) -> RunResult:
    """Create or continue a database; every process of the world has to call it.

    `scene` is a name or a path; `rows` are the first one and one past the last; `limit` is the time
    for a surface, and for each contact [s]. The master raises InputError, and the workers
    MasterLeft then.
    """
    # A function of the user's is tried before signals are noted, so that the first ends the trial.
    complete = _completed_by_the_master(scene, path, world, limit)
    with ExitStack() as stack:
        # From here on a signal is noted; it takes effect between two blocks, not in a broadcast.
        interruption = stack.enter_context(Interruption(listening=world.is_master))
        job, overdue = None, 0
        if complete is not None:
            settings = _prepared(
                complete,
                path,
                world,
                choice,
                rows,
                retry_failed=retry_failed,
                force=force,
            )
            job, pending, said = stack.enter_context(settings)
        own, parallel = world.broadcast(
            job
        )  # the file's scene, and whether every worker writes

        # If all processes have opened the file, all of them have to close it: between here and the
        # farm the master does nothing that can fail.
        with ExitStack() as inner:
            writer = inner.enter_context(
                opened(path, own, world, parallel=parallel, force=force)
            )

            def work(block: Block) -> Columns:
                own.surface.make_ready(path.parent, verify=False)
                made = compute_rows(own, *block, rank=world.rank, limit=limit)
                if not parallel or writer is None:
                    return made
                writer.write_block(*block, made)
                return {"status": made["status"]}

            def take(block: Block, made: Columns) -> None:
                nonlocal overdue
                if not parallel and writer is not None:
                    writer.write_block(*block, made)
                late = int(np.count_nonzero(made["status"] == Status.PENDING))
                failed = int(np.count_nonzero(made["status"] == Status.FAILED))
                overdue += late
                progress.advance(len(made["status"]) - late, failed)

            blocks: Iterator[Block] = iter(())
            if job is not None:
                progress = inner.enter_context(
                    RunProgress(sum(b - a for a, b in pending))
                )
                for line in said:
                    progress.say(line)
                blocks = blocks_of(own, pending, world.workers)
            stopping = interruption.requested
            farm.run(
                work,
                blocks,
                take,
                world,
                stopping=stopping,
                when_quiet=_finishing(writer),
            )
            if job is not None and writer is not None:
                writer.confirm()
        # Every writer has closed the file: its rows can be counted now.
        ended = None
        if job is not None:
            from gen.database import Reader

            with Reader(path) as reader:
                ended = RunResult(reader.counts(), interruption.signal, overdue)
        return world.broadcast(ended)  # type: ignore[no-any-return]


def _completed_by_the_master(
    name: str, path: Path, world: farm.World, limit: float | None
) -> Scene | None:
    """Read and complete a scene on the master; return None on the other processes."""
    if not world.is_master:
        return None
    scene = load(name)
    new = not path.exists()
    line = f"{path}: tries {scene.store.function} on contacts of the scene first"
    waiting = threading.Timer(PATIENCE, echo, [line], {"err": True})
    waiting.daemon = True
    if scene.store.function is not None:
        waiting.start()
    try:
        return completed(scene, path.parent, rehearsed=new, limit=limit)
    finally:
        waiting.cancel()


def _finishing(writer: Writer | None) -> Callable[[], None]:
    """Return what a master does while it waits for workers: sync and finish the rows it has."""
    if writer is None:
        return lambda: None
    return writer.sync_when_due


@contextmanager
def _prepared(
    asked_for: Scene,
    path: Path,
    world: farm.World,
    choice: Choice,
    rows: tuple[int, int] | None,
    *,
    retry_failed: bool,
    force: bool,
) -> Iterator[tuple[tuple[Scene, bool], list[Block], list[str]]]:
    """Lock the file, create or check it, and find its pending rows and what there is to say."""
    from gen import database

    parallel = (choice == "parallel" or world.size > 1) and in_parallel(
        choice, path, world
    )
    first, last = rows or (0, asked_for.samples)
    if not 0 <= first < last <= asked_for.samples:
        raise InputError(
            f"--rows {first}:{last}: give first and last + 1 of the rows 0 to"
            f" {asked_for.samples}, as 0:{asked_for.samples}"
        )
    with database.lock(path):
        how = database.open_or_create(path, asked_for, range(first, last), force=force)
        with database.Writer(path, asked_for, force=force) as writer:
            scene, held = writer.scene, len(writer.rows)
            damage = writer.damage()
            retried = writer.retry_failed(first, last) if retry_failed else 0
            pending = writer.pending(first, last)
        scene.surface.make_ready(path.parent)
        todo = sum(stop - start for start, stop in pending)
        with database.Reader(path) as reader:
            doubts = doubts_before(scene, todo) if todo else doubts_after(reader)
        again = f", {retried} failed ones among them" if retried else ""
        workers = "1 worker" if world.workers == 1 else f"{world.workers} workers"
        functions = {getattr(scene.surface, "function", None), scene.store.function} - {
            None
        }
        begun = f"{path}: {how}, {held} rows, {todo} to do{again}"
        remarks = [
            f"{begun}; {workers}, {'parallel' if parallel else 'single'} writer",
            *(
                f"runs {each} of {source_of(each)}"
                for each in sorted(map(str, functions))
            ),
            *(f"  warning: {doubt}" for doubt in doubts),
        ]
        if damage:
            remarks.append(f"  warning: {damage}")
        if scene.surface.PLACES:
            remarks += [f"  {line}" for line in scene.surface.remarks()]
        yield (scene, parallel), pending, remarks


def blocks_of(scene: Scene, pending: Sequence[Block], workers: int) -> Iterator[Block]:
    """Cut pending rows into blocks, the tasks of workers, which become smaller towards the end.

    Guided self-scheduling (Polychronopoulos and Kuck, 1987): a third of one worker's share of the
    remaining rows, as large as the size of a row allows, and large enough for one master to answer
    all workers, or to deal with all blocks, in the time of a block. It ends with a surface if
    possible.
    """
    nodes, m = math.prod(scene.grid.shape), scene.samples_per_surface
    remaining = sum(stop - start for start, stop in pending)
    answer = ANSWER_NODES / nodes  # the master's time for a block, in solves
    answered = int(min(MASTER_SHARE * workers * answer, math.sqrt(remaining * answer)))
    most = max(1, BLOCK_BYTES // row_bytes(scene))
    least = max(1, min(most, answered))
    largest = min(most, max(1, min(BLOCK_ROWS, BLOCK_NODES // nodes), 2 * least - 1))
    for start, stop in pending:
        position = start
        while position < stop:
            rows = min(max(least, remaining // (3 * workers)), largest)
            border = (position + rows) // m * m
            if (
                border <= position
            ):  # one surface has more rows: all of them, if a block may
                border += m
                border = border if border - position <= largest else position + rows
            border = min(border, stop)
            yield position, border
            remaining -= border - position
            position = border


def planned_loads(scene: Scene) -> tuple[float, float, float]:
    """Return smallest, mean and largest load of the first `COUNTED_ROWS` planned rows."""
    loads = plan.parameters(scene, 0, min(scene.samples, COUNTED_ROWS)).load
    return float(loads.min()), float(loads.mean()), float(loads.max())


def measured_time(scene: Scene) -> tuple[float, int]:
    """Measure the mean time of a few samples on this machine [s], and return their number too."""
    m = scene.samples_per_surface
    surfaces = np.unique(
        np.linspace(0, scene.surfaces - 1, MEASURED_SURFACES).astype(int)
    ).tolist()
    compute_rows(scene, 0, 1)  # plans are made once a run, not once a sample
    began, measured = time.perf_counter(), 0
    for surface in surfaces:
        stop = min(surface * m + min(m, MEASURED_LOADS), scene.samples)
        compute_rows(scene, surface * m, stop)
        measured += stop - surface * m
    return (time.perf_counter() - began) / measured, measured
