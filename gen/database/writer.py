"""Write databases: finished rows, by one process or by all processes of an MPI run together.

A row counts as finished by its status, which is written once the row's data are on the disk: a kill
or a power cut leaves rows that are whole, or pending. As a disk takes milliseconds for that, the
statuses of the rows of some seconds wait for one sync.
"""

import errno
import math
import os
import re
import socket
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple, TypeVar, cast

import h5py
import numpy as np
from numpy.typing import ArrayLike, NDArray

from gen.arrays import Columns, Indices
from gen.database.opening import first_line, open_file, require_scene, stored_path
from gen.database.reader import Reader, checksums_of, chunks
from gen.runtime.errors import InputError, errno_of
from gen.runtime.files import require_writable
from gen.scene import Scene
from gen.schema import CHECKSUM, STATUS, Status

T = TypeVar("T")

SYNC_SECONDS = 5.0
"""Least time between two syncs of a writer [s]: the work that a kill or a power cut can cost."""

FULL = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG})  # a full disk, quota, or file

MOUNTS = Path("/proc/self/mountinfo")  # Linux's list of mounted file systems

INCOHERENT = frozenset({"nfs", "nfs4", "cifs", "smb3"})
"""File systems whose machines write back whole pages, with outdated bytes of neighbouring rows."""


class HeldFile(ExitStack):
    """A file that is kept open, to notice if its path leads to something else; a context manager.

    The open descriptor knows the file by device and inode, whatever happens to its name. A lock
    (`gen.database.lock`), which goes by the name, keeps other writers away.

    Parameters
    ----------
    path : Path
        An existing file.

    Raises
    ------
    InputError
        If the file may not be written.
    """

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.path = path
        self._fixed: tuple[range, ...] = ()  # offsets of bytes that no writer changes
        self._content: list[bytes] = []  # of these bytes
        require_writable(path)
        self._descriptor = os.open(path, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)
        self.callback(os.close, self._descriptor)

    def remember(self, *fixed: range) -> None:
        """Read the bytes that no writer changes; `intact` compares them with later ones.

        Parameters
        ----------
        *fixed : range
            Offsets of bytes in the file; they may lie behind its end.
        """
        self._fixed = fixed
        self._content = self._read_fixed()

    def _read_fixed(self) -> list[bytes]:
        """Read the present bytes of each range that no writer changes."""
        return [
            os.pread(self._descriptor, len(offsets), offsets.start)
            for offsets in self._fixed
        ]

    def check(self) -> None:
        """Refuse to continue if the file has been replaced, moved, deleted or overwritten.

        Raises
        ------
        InputError
            If its path leads to another file or to none, or its fixed bytes have changed.
        """
        fate = self._fate()
        if fate:
            raise InputError(
                f"{self.path} was {fate} while it was being written; nothing more is written, and"
                " what this run has computed is in the old file, if that still exists"
            )

    def _fate(self) -> str:
        """Say what has happened to the file; return an empty text if nothing has."""
        try:
            same = os.path.samestat(self.path.stat(), os.fstat(self._descriptor))
        except (FileNotFoundError, NotADirectoryError):
            return "moved or deleted"
        if not same:
            return "replaced by another file"
        return "" if self.intact() else "overwritten with something else"

    def intact(self) -> bool:
        """Tell whether the file, wherever it is now, has the bytes that no writer changes.

        Returns
        -------
        bool
            False if another program has overwritten the file.
        """
        return self._read_fixed() == self._content

    def sync(self) -> None:
        """Wait until all that this machine has written into the file is on the disk.

        Raises
        ------
        OSError
            If the disk is full or fails.
        """
        # HDF5 and MPI sync in ways of their own, but these are collective. The descriptor is as old
        # as the writer, so the kernel reports every error since the writer has opened the file.
        os.fsync(self._descriptor)


class Unsynced(NamedTuple):
    """Consecutive rows whose data are written, and whose statuses wait for the next sync."""

    position: int  # of the first of these rows in the columns
    status: NDArray[np.uint8]  # (rows,)


def write_rows(dataset: h5py.Dataset, start: int, values: NDArray[Any]) -> None:
    """Write rows of a column: `dataset[start:stop] = values` without h5py's 0.1 ms for the slice.

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
    origin = (start,) + (0,) * (values.ndim - 1)
    rows.select_hyperslab(origin, values.shape)
    dataset.id.write(h5py.h5s.create_simple(values.shape), rows, values)


class Writer(Reader):
    """A database open for writing rows; a context manager.

    The caller holds `gen.database.lock` of the path. With a communicator all its processes open
    and close the file together, and an error on one of them is raised on all. In between each
    process writes rows of its own; no metadata of the file changes. Each process syncs the rows
    that it has written itself, `SYNC_SECONDS` apart, and as the file closes.

    Parameters
    ----------
    path : Path
        An existing database.
    scene : Scene
        The scene whose rows are going to be written.
    communicator : mpi4py.MPI.Comm, optional
        Processes that write the file together.
    force : bool
        Whether the database may have another physics number.

    Raises
    ------
    InputError
        If the file is no database of the scene, or cannot be written; with a communicator also if
        the processes see different files.
    """

    def __init__(
        self, path: Path, scene: Scene, communicator: Any = None, *, force: bool = False
    ) -> None:
        ExitStack.__init__(self)
        self.path = path
        self._communicator = communicator
        self._unsynced: list[Unsynced] = []
        self._last_sync = -math.inf  # by `time.monotonic` [s]
        with ExitStack() as opened:
            file = self._open(opened)
            self._take(file)
            require_scene(file, path, self.scene, scene, force=force)
            self._datasets = {
                column.name: file[stored_path(file, column)] for column in self._columns
            }
            self._status = self._datasets[STATUS.name]
            self._held.remember(*self._outside_of_columns())
            self.confirm()
            self.push(opened.pop_all())
        self.callback(self._spare_newcomer)
        if communicator is None:
            self.callback(self._finish)
        else:
            self.callback(_on_all, communicator, self._finish)

    def _open(self, opened: ExitStack) -> h5py.File:
        """Hold and open the file, on all processes together if there are several; return it.

        Closing `opened` closes both.
        """
        path = self.path
        communicator = self._communicator
        if communicator is None:
            self._held = opened.enter_context(HeldFile(path))
            return opened.enter_context(open_file(path, writing=True))
        _require_one_file(path, communicator)
        held = _on_all(communicator, lambda: HeldFile(path))
        self._held = opened.enter_context(held)
        file = _on_all(communicator, lambda: open_file(path, True, communicator))
        return opened.enter_context(file)

    def _outside_of_columns(self) -> tuple[range, range]:
        """Return the offsets of the file's bytes before and behind its columns.

        The second range ends one byte behind the file: a file that has grown has that byte.
        """
        starts = []
        stops = []
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
            If the path leads to another file or to none, or bytes outside of the columns have
            changed.
        """
        self._held.check()

    def _spare_newcomer(self) -> None:
        """Keep the last bytes, which HDF5 writes as a file closes, away from a replaced file.

        They go into a temporary file then. A file that processes have opened together takes them,
        as closing is collective.
        """
        try:
            self.confirm()
        except InputError:
            if self._communicator is None:
                with tempfile.TemporaryFile() as nothing:
                    os.dup2(nothing.fileno(), self._file.id.get_vfd_handle())

    def write_block(
        self, start: int, stop: int, columns: Mapping[str, ArrayLike]
    ) -> None:
        """Write the finished rows of a block; their statuses follow once the data are on the disk.

        Rows that are pending in `columns` stay as they are in the file.

        Parameters
        ----------
        start, stop : int
            Numbers of the first row and of the row behind the last one.
        columns : mapping of str to array_like, shape (stop - start,) or (stop - start, nx, ny)
            All columns of `gen.scene.columns_for` by name. The checksums are computed here.

        Raises
        ------
        ValueError
            If columns or rows are not the file's.
        InputError
            If the disk is full or fails, or the file has been replaced.
        """
        if not self.rows.start <= start < stop <= self.rows.stop:
            raise ValueError(
                f"rows {start} to {stop} of {self.rows.start} to {self.rows.stop}"
            )
        arrays = self._arrays_of(columns, stop - start)
        if self.has_checksums:
            guarded = {
                column.name: arrays[column.name]
                for column in self._columns
                if column.deterministic and column != CHECKSUM
            }
            arrays[CHECKSUM.name] = checksums_of(guarded)
        self.confirm()
        status = arrays.pop(STATUS.name)
        with disk_trouble(self.path, self._save):
            for run in _runs(status != Status.PENDING):
                position = start - self.rows.start + run.start
                for name, values in arrays.items():
                    dataset = self._datasets[name]
                    write_rows(dataset, position, values[run.start : run.stop])
                self._unsynced.append(Unsynced(position, status[run.start : run.stop]))
        self.sync_when_due()

    def _arrays_of(self, columns: Mapping[str, ArrayLike], rows: int) -> Columns:
        """Return contiguous arrays of the file's types for all columns but the checksum.

        ValueError is raised if a column is missing, unknown, or of another shape.
        """
        wrong = (columns.keys() ^ self._datasets.keys()) - {CHECKSUM.name}
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
        """Finish the rows that wait, unless the last sync was less than `SYNC_SECONDS` ago.

        Raises
        ------
        InputError
            If the disk is full or fails.
        """
        if self._unsynced and time.monotonic() >= self._last_sync + SYNC_SECONDS:
            with disk_trouble(self.path, self._save):
                self._sync()

    def _sync(self) -> None:
        """Have the data of the rows that wait on the disk, then write their statuses."""
        # A sync that fails may have lost data, and the next one would not report it: these rows are
        # forgotten before it, and stay pending.
        unsynced = self._unsynced
        self._unsynced = []
        self._flush()
        self._held.sync()
        for rows in unsynced:
            write_rows(self._status, rows.position, rows.status)
        self._flush()
        self._last_sync = time.monotonic()

    def _finish(self) -> None:
        """Write the statuses that wait, and have them on the disk too, before the file closes."""
        nothing_written = (
            self._last_sync == -math.inf
        )  # the first block is synced at once
        # A file that was moved or deleted takes the statuses; one that was overwritten does not.
        if nothing_written or not self._held.intact():
            return
        with disk_trouble(self.path, self._save):
            self._sync()
            self._held.sync()

    def _save(self) -> str:
        """Save the rows that were written before an error of the disk; say how many are done."""
        with suppress(OSError, RuntimeError, ValueError):  # the same error, perhaps
            self._sync()
        done = self.counts().done
        return f"{done} rows are done and safe: make room and run the same command again"

    def _flush(self) -> None:
        """Pass all data to the kernel, which keeps them if this process is killed."""
        # With MPI-IO, contiguous pieces reach the kernel before each call returns.
        if self._communicator is None:
            self._file.flush()

    def pending(self, first: int = 0, last: int | None = None) -> list[range]:
        """Find the pending rows of the file.

        Parameters
        ----------
        first, last : int, optional
            Numbers of the first row and of the row behind the last one; all rows by default.

        Returns
        -------
        list of range
            Numbers of the pending rows in ascending order, in ranges that are as long as possible.
            A part of a database has only the rows that it holds.
        """
        pending: list[range] = []
        for start, stop in chunks(self._positions(first, last), row_bytes=1):
            status = self._status[start:stop]
            finished = (status == Status.DONE) | (status == Status.FAILED)
            first_row = self.rows.start + start
            for run in _runs(~finished):
                begin = first_row + run.start
                if pending and pending[-1].stop == begin:  # goes on from the last chunk
                    begin = pending.pop().start
                pending.append(range(begin, first_row + run.stop))
        return pending

    def retry_failed(self, first: int = 0, last: int | None = None) -> int:
        """Make failed rows pending again, on the disk too.

        Parameters
        ----------
        first, last : int, optional
            Numbers of the first row and of the row behind the last one; all rows by default.

        Returns
        -------
        int
            Number of these rows.

        Raises
        ------
        InputError
            If the disk fails, or the file has been replaced.
        """
        failed = [np.empty(0, dtype=np.int64)]
        for start, stop in chunks(self._positions(first, last), 1):
            status = self._status[start:stop]
            positions = start + np.flatnonzero(status == Status.FAILED)
            failed.append(self.rows.start + positions)
        rows = np.concatenate(failed)
        self.make_pending(rows)
        return rows.size

    def make_pending(self, rows: Indices) -> None:
        """Make rows pending, on the disk too before a run may write other data into them.

        Parameters
        ----------
        rows : ndarray, shape (k,)
            Numbers of the rows.

        Raises
        ------
        InputError
            If the disk fails, or the file has been replaced.
        """
        self.confirm()
        positions = rows - self.rows.start
        with disk_trouble(self.path, lambda: "the same command goes on"):
            for start, stop in chunks(self._all_positions, 1):
                inside = positions[(positions >= start) & (positions < stop)]
                if inside.size:
                    status = self._status[start:stop]
                    status[inside - start] = Status.PENDING
                    write_rows(self._status, start, status)
            self._flush()
            self._held.sync()


def _runs(mask: NDArray[np.bool_]) -> Iterator[range]:
    """Yield the ranges of positions at which a mask is True, the longest possible ones."""
    edges = np.flatnonzero(np.diff(mask, prepend=False, append=False))
    for start, stop in edges.reshape(-1, 2).tolist():
        yield range(start, stop)


def _require_one_file(path: Path, communicator: Any) -> None:
    """Refuse a path that leads some process to another file than rank 0; a collective call.

    A rank on another machine may see another folder.
    """
    identity = None
    if path.exists():
        status = path.stat()
        identity = (status.st_ino, status.st_size)
    ranks = communicator.allgather((identity, socket.gethostname()))
    identity_of_master, _ = ranks[0]
    for rank, (identity_of_rank, host) in enumerate(ranks):
        if identity_of_rank != identity_of_master:
            raise InputError(
                f"{path}: rank {rank} on {host} has not the file that rank 0 has made:"
                " give a path that all machines share, or --writer single"
            )


def _on_all(communicator: Any, action: Callable[[], T]) -> T:
    """Do something on all processes, and return its result; a collective call.

    An InputError on one process is raised on all of them.
    """
    outcome: T | None = None
    refusal = ""
    try:
        outcome = action()
    except InputError as error:
        refusal = str(error)
    refusals = [text for text in communicator.allgather(refusal) if text]
    if refusals and isinstance(outcome, h5py.File):
        # The file would wait as it closes for the processes that have not opened it.
        raise RuntimeError("; ".join(refusals))
    if refusals:
        raise InputError(refusals[0])
    return cast(T, outcome)


def parallel_hdf5() -> bool:
    """Tell whether h5py and its HDF5 are built with MPI.

    Returns
    -------
    bool
        True if processes can write one file together. The wheels of the package index cannot.
    """
    return bool(h5py.get_config().mpi)


def coherent(path: Path) -> bool:
    """Tell whether several machines can write neighbouring rows of a file at the same time.

    Parameters
    ----------
    path : Path
        File, which need not exist.

    Returns
    -------
    bool
        False on network file systems that do not allow it (NFS and SMB); True on all other ones,
        and where the file system is unknown.
    """
    return _file_system_of(path) not in INCOHERENT


def _file_system_of(path: Path) -> str:
    """Return the type of the file system of a path, from Linux's list of mounts; "" if unknown."""
    real = Path(os.path.realpath(path))  # raises nothing for loops of links
    try:
        mounts = MOUNTS.read_text(errors="surrogateescape").splitlines()
    except OSError:
        return ""
    file_system = ""
    # The longest mount point above the file holds it; of equal ones the later hides the earlier.
    longest = 0  # letters of that mount point
    for line in mounts:
        # The fifth field is the mount point, with blanks as octal codes; the type of the file
        # system follows a lone hyphen (`man 5 proc_pid_mountinfo`).
        fields = line.split(" ")
        point = re.sub(r"\\([0-7]{3})", lambda code: chr(int(code[1], 8)), fields[4])
        if real.is_relative_to(point) and len(point) >= longest:
            file_system = fields[fields.index("-") + 1]
            longest = len(point)
    return file_system


@contextmanager
def disk_trouble(path: Path, consequence: Callable[[], str]) -> Iterator[None]:
    """Turn an error of the disk during the block into an InputError of one line.

    Parameters
    ----------
    path : Path
        File that the block writes.
    consequence : callable
        Called after an error; returns in words what the file holds now, or how to go on.

    Raises
    ------
    InputError
        If the disk is full or fails, or a file with the name has appeared.
    """
    try:
        yield
    except FileExistsError:
        raise InputError(f"{path} has appeared meanwhile; give another name") from None
    except (OSError, RuntimeError, ValueError, KeyError) as error:
        number = errno_of(error)
        if not number and not isinstance(error, OSError):
            raise
        reason = os.strerror(number) if number else first_line(error)
        fault = f"cannot be written: {reason}"
        if number in FULL:
            fault = f"the disk is full ({reason})"
        raise InputError(f"{path}: {fault}; {consequence()}") from None
