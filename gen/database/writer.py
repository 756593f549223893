"""Write rows into databases, by one process or by all processes of an MPI run together.

A row is finished if its status says so. The status is written only after the row's other data are
on the disk, so that every row is whole or pending after a kill or a power cut. To sync a file, that
is to wait until its data are on the disk, takes milliseconds. Therefore one sync serves all rows
that were written within `SYNC_SECONDS`, and their statuses wait for it.
"""

import math
import os
import socket
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any, NamedTuple, TypeVar, cast

import h5py
import numpy as np
from numpy.typing import ArrayLike, NDArray

from gen.arrays import Columns, Indices
from gen.database.disk import HeldFile, disk_trouble
from gen.database.opening import open_file, require_scene, stored_path
from gen.database.reader import Reader, checksums_of, chunks
from gen.runtime.errors import InputError
from gen.scene import Scene
from gen.schema import CHECKSUM, STATUS, Status

T = TypeVar("T")

SYNC_SECONDS = 5.0
"""Smallest time between two syncs of a writer [s].

At most about this much work of a process is lost by a kill or a power cut."""


class Unsynced(NamedTuple):
    """Consecutive rows whose statuses wait for the next sync; their other data are written."""

    position: int  # position of the first of these rows in the file
    status: NDArray[np.uint8]  # statuses of the rows, shape (rows,)


def write_rows(dataset: h5py.Dataset, start: int, values: NDArray[Any]) -> None:
    """Write consecutive rows of a column.

    The result is that of `dataset[start:stop] = values`, in which h5py takes 0.1 ms for the slice
    alone.

    Parameters
    ----------
    dataset : h5py.Dataset
        The column, open for writing.
    start : int
        Position of the first row.
    values : ndarray, shape (rows,) or (rows, nx, ny)
        Contiguous values of the column's type.
    """
    rows = dataset.id.get_space()
    origin = (start,) + (0,) * (values.ndim - 1)  # (start,), or (start, 0, 0) for a field
    rows.select_hyperslab(origin, values.shape)
    dataset.id.write(h5py.h5s.create_simple(values.shape), rows, values)


class Writer(Reader):
    """A context manager for a database that is open for writing rows.

    The caller holds `gen.database.lock` of the path. With a communicator, all its processes open
    and close the file together, and an error of one process in these steps is raised on all of
    them. Between these steps, each process writes its own rows, and no metadata of the file change.
    Each process syncs the rows that it has written itself, at most once in `SYNC_SECONDS`, and
    again before the file closes.

    Parameters
    ----------
    path : Path
        An existing database.
    scene : Scene
        The scene whose rows are going to be written.
    communicator : mpi4py.MPI.Comm, optional
        Processes that write the file together. By default this process writes it alone.
    force : bool
        Whether the database may have another physics number.

    Raises
    ------
    InputError
        If the file is no database of the scene, or cannot be written. With a communicator also if
        the path leads to different files on different processes.
    """

    def __init__(
        self, path: Path, scene: Scene, communicator: Any = None, *, force: bool = False
    ) -> None:
        # The constructor of Reader would open the file for reading only.
        ExitStack.__init__(self)
        self.path = path
        self._communicator = communicator
        self._unsynced: list[Unsynced] = []
        # Time of the last sync by `time.monotonic` [s]. It is -inf before the first one: the first
        # block that is written is synced at once.
        self._last_sync = -math.inf
        # If the file is refused, `opened` closes it. Otherwise this object takes over the closing.
        with ExitStack() as opened:
            file = self._open(opened)
            self._take(file)  # check the file; set scene, rows and _columns from it
            require_scene(file, path, stored=self.scene, scene=scene, force=force)
            self._datasets = {
                column.name: file[stored_path(file, column)] for column in self._columns
            }
            self._status = self._datasets[STATUS.name]
            # Remember the bytes that no writer changes. The path was opened twice, by `HeldFile`
            # and by HDF5: check that it has not been replaced in between.
            self._held.remember(*self._outside_of_columns())
            self.confirm()
            self.push(opened.pop_all())
        # At the end the callbacks are called in reverse order: `_finish` is the first one, and the
        # last one closes the file.
        self.callback(self._protect_overwritten_file)
        if communicator is None:
            self.callback(self._finish)
        else:
            self.callback(_on_all, communicator, self._finish)

    def _open(self, opened: ExitStack) -> h5py.File:
        """Open the file for writing and return it; set `_held`, which also keeps it open.

        With a communicator, this is a collective call. Both are closed when `opened` is closed.
        """
        path = self.path
        communicator = self._communicator
        if communicator is None:
            self._held = opened.enter_context(HeldFile(path))
            return opened.enter_context(open_file(path, writing=True))
        _require_one_file(path, communicator)
        held = _on_all(communicator, lambda: HeldFile(path))
        self._held = opened.enter_context(held)
        file = _on_all(
            communicator, lambda: open_file(path, writing=True, communicator=communicator)
        )
        return opened.enter_context(file)

    def _outside_of_columns(self) -> tuple[range, range]:
        """Return the offsets of the file's bytes before its first column and after its last one.

        The second range also has the first offset beyond the end of the file, so that a file that
        has grown is noticed.
        """
        starts = []  # offset of the first byte of each column
        stops = []  # offset of the byte behind the last one of each column
        for dataset in self._datasets.values():
            start = dataset.id.get_offset()
            starts.append(start)
            stops.append(start + dataset.id.get_storage_size())
        return range(min(starts)), range(max(stops), self.path.stat().st_size + 1)

    def confirm(self) -> None:
        """Refuse to continue if the file has been replaced, moved, deleted or overwritten.

        Raises
        ------
        InputError
            If the path leads to another file or to no file, or if bytes outside of the columns have
            changed.
        """
        self._held.check()

    def _protect_overwritten_file(self) -> None:
        """Keep HDF5 from writing into a file that another program has overwritten.

        HDF5 writes some bytes when it closes a file. If `confirm` fails, HDF5's descriptor is
        redirected to a temporary file, which takes these bytes. With a communicator the bytes are
        written, because files of MPI-IO have no descriptor that could be redirected.
        """
        if self._communicator is not None:
            return
        try:
            self.confirm()
        except InputError:
            with tempfile.TemporaryFile() as discarded:
                os.dup2(discarded.fileno(), self._file.id.get_vfd_handle())

    def write_block(
        self, start: int, stop: int, columns: Mapping[str, ArrayLike]
    ) -> None:
        """Write the finished rows of a block; their statuses are written after the next sync.

        Rows whose status in `columns` is pending are not written: the file keeps its bytes.

        Parameters
        ----------
        start, stop : int
            Numbers of the first row and of the row behind the last one.
        columns : mapping of str to array_like, shape (stop - start,) or (stop - start, nx, ny)
            All columns of `gen.scene.columns_for` by their names. The checksum is not among them;
            it is computed here.

        Raises
        ------
        ValueError
            If the file does not hold these rows, or a column is missing, unknown or of another
            shape.
        InputError
            If the disk is full or fails, or the file has been replaced. Before an error of the disk
            is raised, rows that were written before are finished if the disk allows it.
        """
        if not self.rows.start <= start < stop <= self.rows.stop:
            raise ValueError(
                f"rows {start} to {stop} of {self.rows.start} to {self.rows.stop}"
            )
        arrays = self._arrays_of(columns, stop - start)
        # The checksum is already that of the finished row: it includes the status.
        if self.has_checksums:
            guarded = {
                column.name: arrays[column.name]
                for column in self._columns
                if column.deterministic and column != CHECKSUM
            }
            arrays[CHECKSUM.name] = checksums_of(guarded)
        self.confirm()
        status = arrays.pop(STATUS.name)
        with disk_trouble(self.path, self._finish_after_trouble):
            for span in _true_ranges(status != Status.PENDING):
                position = start - self.rows.start + span.start
                for name, values in arrays.items():
                    dataset = self._datasets[name]
                    write_rows(dataset, position, values[span.start : span.stop])
                statuses = status[span.start : span.stop]
                self._unsynced.append(Unsynced(position=position, status=statuses))
        self.sync_when_due()

    def _arrays_of(self, columns: Mapping[str, ArrayLike], rows: int) -> Columns:
        """Return the columns of a number of rows as contiguous arrays with the types of the file.

        The checksum is left out. Raises ValueError if a column is missing, unknown, or of another
        shape.
        """
        missing_or_unknown = columns.keys() ^ self._datasets.keys()
        wrong = missing_or_unknown - {CHECKSUM.name}
        if wrong:
            raise ValueError(f"columns missing or unknown: {', '.join(sorted(wrong))}")
        arrays: Columns = {}
        for column in self._columns:
            if column == CHECKSUM:
                continue
            values = np.ascontiguousarray(columns[column.name], dtype=column.dtype)
            if values.shape != column.shape(rows, self.scene.grid.shape):
                raise ValueError(f"column {column.name} is of shape {values.shape}")
            arrays[column.name] = values
        return arrays

    def sync_when_due(self) -> None:
        """Sync the written rows and write their statuses, unless the last sync was just before.

        Nothing is done if the last sync was less than `SYNC_SECONDS` ago, or if no row waits for
        its status.

        Raises
        ------
        InputError
            If the disk is full or fails.
        """
        if self._unsynced and time.monotonic() >= self._last_sync + SYNC_SECONDS:
            with disk_trouble(self.path, self._finish_after_trouble):
                self._sync()

    def _sync(self) -> None:
        """Wait until the data of the written rows are on the disk, then write their statuses.

        The statuses themselves may not be on the disk yet when this returns.
        """
        # If the sync below fails, data may be lost, and the next sync would not report it. The list
        # is therefore emptied first: the rows then stay pending.
        unsynced = self._unsynced
        self._unsynced = []
        self._flush()
        self._held.sync()
        for rows in unsynced:
            write_rows(self._status, rows.position, rows.status)
        self._flush()
        self._last_sync = time.monotonic()

    def _finish(self) -> None:
        """Write the statuses that wait, and wait until all data are on the disk.

        This is called before the file closes. A file that another program has overwritten is left
        alone. A file that was moved or deleted still gets its statuses. InputError if the disk is
        full or fails.
        """
        # The first block that is written is synced at once, so a writer that has not synced has
        # written nothing.
        nothing_written = self._last_sync == -math.inf
        if nothing_written or not self._held.intact():
            return
        with disk_trouble(self.path, self._finish_after_trouble):
            self._sync()
            self._held.sync()  # `_sync` has not waited for the statuses that it wrote last

    def _finish_after_trouble(self) -> str:
        """Try to finish the rows that were written before an error of the disk.

        Return the end of the error's message: how many rows of the file are done, and what to do.
        Another error of the disk is ignored here; the rows that wait then stay pending.
        """
        with suppress(OSError, RuntimeError, ValueError):  # the disk may fail again
            self._sync()
        done = self.counts().done
        return f"{done} rows are done and safe: make room and run the same command again"

    def _flush(self) -> None:
        """Pass all written data to the kernel, which keeps them if this process is killed."""
        # With MPI-IO, each write has already passed its data to the kernel.
        if self._communicator is None:
            self._file.flush()

    def pending(self, first: int = 0, last: int | None = None) -> list[range]:
        """Find the pending rows of the file.

        Parameters
        ----------
        first, last : int, optional
            Numbers of the first row and of the row behind the last one; all rows by default. Rows
            that the file does not hold are left out.

        Returns
        -------
        list of range
            Numbers of the pending rows in ascending order, in ranges that are as long as possible.
            Rows with an unknown status count as pending.
        """
        pending: list[range] = []
        for start, stop in chunks(self._positions(first, last), row_bytes=1):
            status = self._status[start:stop]
            finished = (status == Status.DONE) | (status == Status.FAILED)
            first_row = self.rows.start + start  # number of the first row of the chunk
            for span in _true_ranges(~finished):
                begin = first_row + span.start
                # A range that reaches the border of two chunks is continued, not begun anew.
                if pending and pending[-1].stop == begin:
                    begin = pending.pop().start
                pending.append(range(begin, first_row + span.stop))
        return pending

    def retry_failed(self, first: int = 0, last: int | None = None) -> int:
        """Make the failed rows of a range pending, and wait until this is on the disk.

        Parameters
        ----------
        first, last : int, optional
            Numbers of the first row and of the row behind the last one; all rows by default. Rows
            that the file does not hold are left out.

        Returns
        -------
        int
            Number of the rows that were failed and are pending now.

        Raises
        ------
        InputError
            If the disk fails, or the file has been replaced.
        """
        # Numbers of the rows, an array for each chunk.
        failed = [np.empty(0, dtype=np.int64)]
        for start, stop in chunks(self._positions(first, last), row_bytes=1):
            status = self._status[start:stop]
            positions = start + np.flatnonzero(status == Status.FAILED)
            failed.append(self.rows.start + positions)
        rows = np.concatenate(failed)
        self.make_pending(rows)
        return rows.size

    def make_pending(self, rows: Indices) -> None:
        """Make rows pending, and wait until this is on the disk.

        Only then may a run write other data into the rows: after a power cut in between, a row
        could be finished and have a part of the new data.

        Parameters
        ----------
        rows : ndarray, shape (k,)
            Numbers of the rows, all of which the file holds.

        Raises
        ------
        InputError
            If the disk fails, or the file has been replaced.
        """
        self.confirm()
        positions = rows - self.rows.start
        with disk_trouble(self.path, lambda: "the same command goes on"):
            for start, stop in chunks(self._all_positions, row_bytes=1):
                inside = positions[(positions >= start) & (positions < stop)]
                if inside.size:
                    status = self._status[start:stop]
                    status[inside - start] = Status.PENDING
                    write_rows(self._status, start, status)
            self._flush()
            self._held.sync()


def _true_ranges(mask: NDArray[np.bool_]) -> Iterator[range]:
    """Yield the ranges of consecutive indices at which a mask is True, as long as possible."""
    # Indices at which the mask changes, in pairs: the first True, and the False behind the last.
    edges = np.flatnonzero(np.diff(mask, prepend=False, append=False))
    for start, stop in edges.reshape(-1, 2).tolist():
        yield range(start, stop)


class _FileOfRank(NamedTuple):
    """The file that one process sees under a path."""

    identity: tuple[int, int] | None  # inode and size [bytes]; None if there is no file
    host: str  # name of the machine of the process


def _require_one_file(path: Path, communicator: Any) -> None:
    """Refuse a path under which some process does not see the file of rank 0; a collective call.

    Raises InputError on all processes. The path may lead to another folder on another machine.
    """
    identity = None
    if path.exists():
        status = path.stat()
        identity = (status.st_ino, status.st_size)
    file_of_rank = _FileOfRank(identity=identity, host=socket.gethostname())
    files: list[_FileOfRank] = communicator.allgather(file_of_rank)  # by rank
    for rank, file in enumerate(files):
        if file.identity != files[0].identity:
            raise InputError(
                f"{path}: rank {rank} on {file.host} has not the file that rank 0 has made:"
                " give a path that all machines share, or --writer single"
            )


def _on_all(communicator: Any, action: Callable[[], T]) -> T:
    """Call a function on all processes, and return its result; a collective call.

    If it raises InputError on one process, InputError is raised on all of them. The error is a
    RuntimeError on a process on which the function has opened an HDF5 file.
    """
    outcome: T | None = None
    refusal = ""  # message of the error on this process; "" without an error
    try:
        outcome = action()
    except InputError as error:
        refusal = str(error)
    refusals = [text for text in communicator.allgather(refusal) if text]
    if refusals and isinstance(outcome, h5py.File):
        # Closing the file would wait for the processes that have not opened it. A command ends all
        # processes at once after a RuntimeError.
        raise RuntimeError("; ".join(refusals))
    if refusals:
        raise InputError(refusals[0])
    return cast(T, outcome)


def parallel_hdf5() -> bool:
    """Tell whether h5py and its HDF5 are built with MPI, so that processes can share a file.

    Returns
    -------
    bool
        False for the wheels of h5py on the Python package index.
    """
    return bool(h5py.get_config().mpi)
