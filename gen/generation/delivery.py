"""Two ways of computed rows into the file: through the master, or from every worker itself."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Literal, NamedTuple, Self

import numpy as np

from gen.arrays import Columns
from gen.generation.sample import finished_parts
from gen.runtime import farm
from gen.runtime.errors import InputError
from gen.scene import Scene
from gen.schema import Status

if TYPE_CHECKING:  # a worker that writes nothing needs no HDF5
    from gen.database import Writer

Block = tuple[int, int]
"""First row of a task, and one past the last."""

Choice = Literal["auto", "single", "parallel"]
"""Writers that a user can ask for."""


class Target(NamedTuple):
    """The file to write and its writer: the master's decision, the same on every process.

    Attributes
    ----------
    path : Path
        The database, from `gen.database.open_or_create`.
    scene : Scene
        Scene of the file.
    parallel : bool
        Whether every worker writes its own rows.
    force : bool
        Whether rows may be added to those of another physics number.
    """

    path: Path
    scene: Scene
    parallel: bool
    force: bool = False


class Tally(NamedTuple):
    """Counts of the rows of a block by their fate.

    Attributes
    ----------
    failed : int
        Number of failed rows.
    overdue : int
        Number of rows that took longer than the limit and are still pending.
    trouble : str
        Reason why the rows could not be written; "" if they were.
    """

    failed: int
    overdue: int
    trouble: str = ""


class ThroughMaster:
    """The single writer: rows travel to the master, which writes them.

    Parameters
    ----------
    target : Target
        The file to write.
    world : farm.World
        The processes, of which the master writes.
    compute : callable
        Function that computes every column of a block's rows; pending rows are not written.
    """

    def __init__(
        self, target: Target, world: farm.World, compute: Callable[[Block], Columns]
    ) -> None:
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
        """Refuse, on the master, a file that has been replaced since it was opened."""
        if self._writer is not None:
            self._writer.confirm()

    def take(self, block: Block, rows: Columns) -> Tally:
        """Write the rows that `work` has computed, on the master."""
        if self._writer is None:
            raise ValueError("rows are taken on the master only")
        return _write(self._writer, block, rows)


class FromWorkers:
    """The parallel writer: every worker writes its own rows, and the master receives the counts.

    All processes make one of these and leave its block together, because they open and close the
    file together.

    Parameters
    ----------
    target, world, compute
        As for `ThroughMaster`.
    """

    def __init__(
        self, target: Target, world: farm.World, compute: Callable[[Block], Columns]
    ) -> None:
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
        """Refuse, on any process, a file that has been replaced since it was opened."""
        self._writer.confirm()

    def work(self, block: Block) -> Tally:
        """Compute and write the rows of a block, on a worker."""
        rows = self._compute(block)
        try:
            return _write(self._writer, block, rows)
        except InputError as error:
            return Tally(0, 0, str(error))

    def take(self, block: Block, tally: Tally) -> Tally:
        """Return a worker's counts on the master; raise the worker's InputError here."""
        if tally.trouble:
            raise InputError(tally.trouble)
        return tally


def _write(writer: Writer, block: Block, rows: Columns) -> Tally:
    """Write the finished rows of a block, and count its rows."""
    finished = 0
    for start, stop, part in finished_parts(block[0], rows):
        writer.write_block(start, stop, part)
        finished += stop - start
    failed = int(np.count_nonzero(rows["status"] == Status.FAILED))
    return Tally(failed, block[1] - block[0] - finished)


def delivery(
    target: Target, world: farm.World, compute: Callable[[Block], Columns]
) -> ThroughMaster | FromWorkers:
    """Open the database for the target's writer; every process of the world has to call it.

    Raises
    ------
    InputError
        If the file cannot be opened: on the master, or on every process that writes.
    """
    return (FromWorkers if target.parallel else ThroughMaster)(target, world, compute)


def in_parallel(choice: Choice, path: Path, world: farm.World) -> bool:
    """Decide whether workers write; `auto` means the parallel writer wherever it is safe.

    Raises
    ------
    InputError
        If the parallel writer is asked for and not available.
    """
    from gen import database

    if choice == "parallel":
        if not database.parallel_hdf5():
            raise InputError(
                "--writer parallel: this h5py has no MPI; build one as"
                " docs/how-to/parallel-hdf5.md says, or leave the option out"
            )
        if world.size == 1:
            raise InputError(
                "--writer parallel: there is one process only; start it as"
                " mpiexec -n 9 python -m mpi4py -m gen run ..."
            )
    if choice == "single" or world.size == 1:
        return False
    return choice == "parallel" or (database.parallel_hdf5() and database.coherent(path))
