"""Sinks: the way of a run's rows from the process that has computed them into the database.

A run has one of two writers. With a single writer the workers send their rows to the master, which
writes them. With the parallel writer every process has opened the file and writes the rows that it
has computed; the master gets to know their statuses.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from gen.arrays import Columns
from gen.runtime import farm
from gen.runtime.errors import InputError
from gen.scene import Scene

if TYPE_CHECKING:  # a worker that writes nothing needs no HDF5
    from gen.database import Writer

WriterOption = Literal["auto", "single", "parallel"]
"""Writers that a user can ask for."""


class Sink:
    """The sink of a process without the file: its rows are sent to the master."""

    def deliver(self, block: range, rows: Columns) -> Columns:
        """Pass on rows on the process that has computed them.

        Parameters
        ----------
        block : range
            Numbers of the rows.
        rows : dict of str to ndarray, shape (rows,) or (rows, nx, ny)
            All columns of these rows by name.

        Returns
        -------
        dict of str to ndarray
            The columns that the master needs: all of them if it writes the rows, otherwise the
            status alone.

        Raises
        ------
        InputError
            If this process writes the rows and cannot.
        """
        return rows

    def receive(self, block: range, rows: Columns) -> None:
        """Take rows on the master, and write them if no other process has written them.

        Parameters
        ----------
        block : range
            Numbers of the rows.
        rows : dict of str to ndarray
            Result of `deliver`, on the process that has computed the rows.

        Raises
        ------
        InputError
            If the rows cannot be written.
        """

    def sync_when_due(self) -> None:
        """Finish the rows that this process has written, if its last sync is long enough ago."""

    def confirm(self) -> None:
        """Raise InputError if the file that this process writes has been replaced."""


class _FileSink(Sink):
    """A sink that has opened the file; what it shares with others of its kind."""

    def __init__(self, writer: Writer) -> None:
        self._writer = writer

    def sync_when_due(self) -> None:
        """Finish the rows that this process has written, if its last sync is long enough ago."""
        self._writer.sync_when_due()

    def confirm(self) -> None:
        """Raise InputError if the file that this process writes has been replaced."""
        self._writer.confirm()


class SingleSink(_FileSink):
    """The sink of a master that writes the rows of all processes.

    Parameters
    ----------
    writer : Writer
        The open file.
    """

    def receive(self, block: range, rows: Columns) -> None:
        """Write the rows of a block."""
        self._writer.write_block(block.start, block.stop, rows)


class ParallelSink(_FileSink):
    """The sink of a process that writes the rows that it has computed itself.

    Parameters
    ----------
    writer : Writer
        The file, which all processes have opened together.
    """

    def deliver(self, block: range, rows: Columns) -> Columns:
        """Write the rows of a block, and return their statuses for the master."""
        self._writer.write_block(block.start, block.stop, rows)
        return {"status": rows["status"]}


@contextmanager
def open_sink(
    path: Path, scene: Scene, world: farm.World, *, parallel: bool, force: bool = False
) -> Iterator[Sink]:
    """Open the sink of this process for the duration of the block.

    With the parallel writer the call and the end of the block are collective.

    Parameters
    ----------
    path : Path
        An existing database, whose lock the master holds.
    scene : Scene
        Scene of the database.
    world : World
        The processes of the run.
    parallel : bool
        Whether every process writes its own rows.
    force : bool
        Whether the database may have another physics number.

    Yields
    ------
    Sink
        The sink of this process.

    Raises
    ------
    InputError
        If the file cannot be opened for writing.
    """
    if not (parallel or world.is_master):
        yield Sink()
        return
    from gen.database import Writer

    communicator = world.communicator if parallel else None
    with Writer(path, scene, communicator, force=force) as writer:
        yield ParallelSink(writer) if parallel else SingleSink(writer)


def in_parallel(option: WriterOption, path: Path, world: farm.World) -> bool:
    """Decide whether every process of a run writes its own rows.

    Parameters
    ----------
    option : {"auto", "single", "parallel"}
        What the user asks for; "auto" means the parallel writer wherever it works and is safe.
    path : Path
        The database, whose file system counts; it need not exist.
    world : World
        The processes of the run.

    Returns
    -------
    bool
        True for the parallel writer, False for the single one.

    Raises
    ------
    InputError
        If the user asks for the parallel writer, and it does not work here.
    """
    from gen import database

    if option == "single":
        return False
    if option == "parallel":
        if world.size == 1 or not database.parallel_hdf5():
            raise InputError(
                "--writer parallel: needs an h5py with MPI, see docs/how-to/parallel-hdf5.md, and"
                " processes: mpiexec -n 9 python -m mpi4py -m gen run ..."
            )
        return True
    return world.size > 1 and database.parallel_hdf5() and database.coherent(path)
