"""How computed rows get into the file: through the master, or from every worker by itself."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Literal, NamedTuple, Self

import numpy as np

from gen.generation.sample import Rows, finished_parts
from gen.runtime import farm
from gen.runtime.errors import InputError
from gen.scene import Scene
from gen.schema import Status

if TYPE_CHECKING:  # a worker that writes nothing needs no HDF5
    from gen.database import Writer

Block = tuple[int, int]
"""First row, and one past the last."""

Choice = Literal["auto", "single", "parallel"]
"""What a user can ask for."""


class Target(NamedTuple):
    """What is written, and how: the master's decision, the same on every process.

    Attributes
    ----------
    path : the database, from `gen.database.open_or_create`
    scene : the file's scene
    parallel : True if every worker writes its own rows
    force : True to add rows to those of a version of the code that computes other results
    """

    path: Path
    scene: Scene
    parallel: bool
    force: bool = False


class Tally(NamedTuple):
    """What has become of the rows of a block.

    Attributes
    ----------
    failed : number of failed rows
    overdue : number of rows that took longer than they may and are pending still
    trouble : why the rows could not be written, "" if they could
    """

    failed: int
    overdue: int
    trouble: str = ""


class ThroughMaster:
    """Rows travel to the master, which writes them: the single writer.

    Parameters
    ----------
    target : what is written
    world : the processes; the master writes
    compute : every column of a block's rows; those that are pending are not written
    """

    def __init__(self, target: Target, world: farm.World, compute: Callable[[Block], Rows]) -> None:
        self.work = compute
        self._writer: Writer | None = None
        if world.is_master:
            from gen import database

            self._writer = database.Writer(target.path, target.scene, force=target.force)

    def __enter__(self) -> Self:
        """Leave the block to close the file."""
        return self

    def __exit__(self, *error: object) -> None:
        """Close the file."""
        if self._writer is not None:
            self._writer.close()

    def confirm(self) -> None:
        """Refuse a file that is no longer what was opened, on the master."""
        if self._writer is not None:
            self._writer.confirm()

    def take(self, block: Block, rows: Rows) -> Tally:
        """Write the rows that `work` has computed, on the master."""
        if self._writer is None:
            raise ValueError("rows are taken on the master only")
        return _write(self._writer, block, rows)


class FromWorkers:
    """Every worker writes what it has computed; the master hears how it went.

    Parameters
    ----------
    target, world, compute : see `ThroughMaster`; all processes make one of these and leave its
        block together, because they open and close the file together
    """

    def __init__(self, target: Target, world: farm.World, compute: Callable[[Block], Rows]) -> None:
        from gen import database

        self._compute = compute
        self._writer = database.ParallelWriter(
            target.path, target.scene, world.communicator, force=target.force
        )

    def __enter__(self) -> Self:
        """Leave the block to close the file, together with the other processes."""
        return self

    def __exit__(self, *error: object) -> None:
        """Close the file."""
        self._writer.close()

    def confirm(self) -> None:
        """Refuse a file that is no longer what was opened, on any process."""
        self._writer.confirm()

    def work(self, block: Block) -> Tally:
        """Compute and write the rows of a block, on a worker."""
        rows = self._compute(block)
        try:
            return _write(self._writer, block, rows)
        except InputError as error:
            return Tally(0, 0, str(error))

    def take(self, block: Block, tally: Tally) -> Tally:
        """Hear what a worker has written, on the master; raise its InputError here."""
        if tally.trouble:
            raise InputError(tally.trouble)
        return tally


def _write(writer: Writer, block: Block, rows: Rows) -> Tally:
    """Write the finished rows of a block."""
    finished = 0
    for start, stop, part in finished_parts(block[0], rows):
        writer.write_block(start, stop, part)
        finished += stop - start
    failed = int(np.count_nonzero(rows["status"] == Status.FAILED))
    return Tally(failed, block[1] - block[0] - finished)


def delivery(
    target: Target, world: farm.World, compute: Callable[[Block], Rows]
) -> ThroughMaster | FromWorkers:
    """Open the database as the target says; every process of the world has to call it.

    Raises
    ------
    InputError
        If the file cannot be opened: on the master, or on all that write.
    """
    return (FromWorkers if target.parallel else ThroughMaster)(target, world, compute)


def in_parallel(choice: Choice, path: Path, world: farm.World) -> bool:
    """Decide who writes; `auto` takes the parallel writer where it can and may be taken.

    Raises
    ------
    InputError
        If the parallel writer is asked for where there is none.
    """
    from gen import database

    if choice == "parallel":
        if not database.parallel_hdf5():
            raise InputError(
                "--writer parallel: this h5py has no MPI; build one as the README's section"
                " Parallel HDF5 says, or leave the option out"
            )
        if world.size == 1:
            raise InputError(
                "--writer parallel: there is one process only; start it as"
                " mpiexec -n 9 python -m mpi4py -m gen run ..."
            )
    if choice == "single" or world.size == 1:
        return False
    return choice == "parallel" or (database.parallel_hdf5() and database.coherent(path))
