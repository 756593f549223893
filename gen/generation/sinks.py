"""Sinks, which bring the rows of a run from the process that computed them into the database.

A run has one of two writers. With the single writer, the workers send their rows to the master,
which writes them. With the parallel writer, every process opens the file and writes the rows that
it has computed, and the master gets only their statuses.
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
"""Writers that a user can ask for; "auto" lets `in_parallel` choose one of the other two."""


class Sink:
    """The sink of a process that does not open the file, and the interface of all sinks.

    It writes nothing: its process sends all columns of its rows to the master.
    """

    def deliver(self, block: range, rows: Columns) -> Columns:
        """Take the rows of a block on the process that has computed them.

        With the parallel writer, this process writes them.

        Parameters
        ----------
        block : range
            Numbers of the rows.
        rows : dict of str to ndarray, shape (rows,) or (rows, nx, ny)
            All columns of these rows by their names.

        Returns
        -------
        dict of str to ndarray
            The columns that are sent to the master: all columns if it writes the rows, otherwise
            the column "status" alone.

        Raises
        ------
        InputError
            If this process has to write the rows and cannot.
        """
        return rows

    def receive(self, block: range, rows: Columns) -> None:
        """Take the rows of a block on the master.

        With the single writer, the master writes them.

        Parameters
        ----------
        block : range
            Numbers of the rows.
        rows : dict of str to ndarray, shape (rows,) or (rows, nx, ny)
            The columns that `deliver` has returned on the process that has computed the rows.

        Raises
        ------
        InputError
            If the master has to write the rows and cannot.
        """

    def sync_when_due(self) -> None:
        """Finish the rows that this process has written, unless its last sync was just before.

        Without an open file nothing is done.
        """

    def confirm(self) -> None:
        """Raise InputError if the file that this process has opened has been replaced.

        Without an open file nothing is done.
        """


class _FileSink(Sink):
    """The common part of the sinks of processes that have opened the file.

    Parameters
    ----------
    writer : Writer
        The open file.
    """

    def __init__(self, writer: Writer) -> None:
        self._writer = writer

    def sync_when_due(self) -> None:
        """Finish the rows that this process has written, unless its last sync was just before."""
        self._writer.sync_when_due()

    def confirm(self) -> None:
        """Raise InputError if the open file has been replaced."""
        self._writer.confirm()


class SingleSink(_FileSink):
    """The master's sink with the single writer: it writes the rows of all processes.

    Parameters
    ----------
    writer : Writer
        The open file.
    """

    def receive(self, block: range, rows: Columns) -> None:
        """Write the rows of a block, of which `rows` are all columns."""
        self._writer.write_block(block.start, block.stop, rows)


class ParallelSink(_FileSink):
    """The sink of each process with the parallel writer: it writes the rows of its own process.

    Parameters
    ----------
    writer : Writer
        The file, which all processes have opened together.
    """

    def deliver(self, block: range, rows: Columns) -> Columns:
        """Write the rows of a block, and return the column "status" alone, for the master."""
        self._writer.write_block(block.start, block.stop, rows)
        return {"status": rows["status"]}


@contextmanager
def open_sink(
    path: Path, scene: Scene, world: farm.World, *, parallel: bool, force: bool = False
) -> Iterator[Sink]:
    """Open the sink of this process, and close it when this context manager ends.

    With the parallel writer, opening and closing are collective.

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
    writes = parallel or world.is_master
    if not writes:
        yield Sink()  # sends the rows to the master
        return  # no file has to be closed
    from gen.database import Writer  # a worker that writes nothing needs no HDF5

    communicator = world.communicator if parallel else None
    with Writer(path, scene, communicator, force=force) as writer:
        yield ParallelSink(writer) if parallel else SingleSink(writer)


def in_parallel(option: WriterOption, path: Path, world: farm.World) -> bool:
    """Decide whether every process of a run writes its own rows.

    Parameters
    ----------
    option : {"auto", "single", "parallel"}
        The writer that the user asks for. "auto" is the parallel writer if there are several
        processes, HDF5 is built with MPI, and the file system allows it, otherwise the single one.
    path : Path
        The database, which need not exist. Only its file system matters, and only for "auto".
    world : World
        The processes of the run.

    Returns
    -------
    bool
        True for the parallel writer, False for the single one.

    Raises
    ------
    InputError
        If the user asks for the parallel writer, but there is one process or an HDF5 without MPI.
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
