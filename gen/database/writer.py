"""Write databases: finished rows, by one process or by all processes of an MPI run together.

A row counts as finished by its status, which is written once the row's data are on the disk: a kill
or a power cut leaves rows that are whole, or pending. As a disk takes milliseconds for that, the
statuses of the rows of some seconds wait for one such sync.
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

from gen.arrays import Indices
from gen.database.reader import (
    Reader,
    checksums_of,
    chunks,
    first_line,
    open_file,
    stored_path,
)
from gen.runtime.errors import InputError, errno_of
from gen.runtime.files import require_writable
from gen.scene import Scene
from gen.schema import CHECKSUM, STATUS, Status

T = TypeVar("T")

SYNC_SECONDS = (
    5.0  # least time between two syncs of a writer: what a kill or a power cut can cost
)

FULL = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG})  # a full disk, quota, or file

MOUNTS = Path("/proc/self/mountinfo")  # Linux's list of mounted file systems

INCOHERENT = frozenset({"nfs", "nfs4", "cifs", "smb3"})
"""File systems whose machines write back whole pages, with outdated bytes of neighbouring rows."""


class HeldFile(ExitStack):
    """A file to be written, held by device and inode; a lock keeps writers apart, by name."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.path = path
        self.parts: tuple[tuple[int, int], ...] = ()  # bytes that no writer changes
        self._metadata: list[bytes] = []
        require_writable(path)
        self._descriptor = os.open(path, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)
        self.callback(os.close, self._descriptor)

    def check(self) -> None:
        """Refuse to continue if the file has been replaced, moved, deleted or overwritten."""
        try:
            same = os.path.samestat(self.path.stat(), os.fstat(self._descriptor))
            fate = "" if same else "replaced by another file"
        except (FileNotFoundError, NotADirectoryError):
            fate = "moved or deleted"
        if not fate and not self.intact():
            fate = "overwritten with something else"
        if fate:
            raise InputError(
                f"{self.path} was {fate} while it was being written; nothing more is written, and"
                " what this run has computed is in the old file, if that is anywhere"
            )

    def intact(self) -> bool:
        """Tell whether the file, wherever it is now, has the bytes that no writer changes."""
        seen = [
            os.pread(self._descriptor, stop - start, start) for start, stop in self.parts
        ]
        self._metadata = self._metadata or seen
        return seen == self._metadata

    def sync(self) -> None:
        """Wait until all that this machine has written into the file is on the disk."""
        # Not HDF5's and MPI's own ways, which are collective. The descriptor is as old as the
        # writer: the kernel tells it of every error since then.
        os.fsync(self._descriptor)


class Finished(NamedTuple):
    """Consecutive rows whose data are written, and whose status waits for the next sync."""

    place: int  # of the first row in the columns
    status: NDArray[np.uint8]  # (rows,)


def write_rows(dataset: h5py.Dataset, start: int, values: NDArray[Any]) -> None:
    """Do what `dataset[start:stop] = values` does, without h5py's 0.1 ms for the slice."""
    rows = dataset.id.get_space()
    rows.select_hyperslab((start,) + (0,) * (values.ndim - 1), values.shape)
    dataset.id.write(h5py.h5s.create_simple(values.shape), rows, values)


class Writer(Reader):
    """A database open for writing rows; a context manager; the caller holds `lock(path)`.

    With a communicator all its processes open and close the file together, and what one of them
    refuses is refused on all; in between each writes rows of its own, and no metadata changes. Each
    syncs the rows that it has written itself, `SYNC_SECONDS` apart, and as the file closes.
    """

    def __init__(
        self, path: Path, scene: Scene, communicator: Any = None, *, force: bool = False
    ) -> None:
        ExitStack.__init__(self)
        self.path, self._communicator = path, communicator
        self._waiting: list[Finished] = []
        self._synced = -math.inf  # time of the last sync by `time.monotonic` [s]
        with ExitStack() as opened:
            if communicator is None:
                held = opened.enter_context(HeldFile(path))
                file = opened.enter_context(open_file(path, True))
            else:
                status = (
                    path.stat() if path.exists() else None
                )  # a rank may see another folder
                place = status and (status.st_ino, status.st_size)
                places = communicator.allgather((place, socket.gethostname()))
                for rank, (there, host) in enumerate(places):
                    if there != places[0][0]:
                        raise InputError(
                            f"{path}: rank {rank} on {host} has not the file that rank 0 has made:"
                            " give a path that all machines share, or --writer single"
                        )
                held = opened.enter_context(_on_all(communicator, lambda: HeldFile(path)))
                file = _on_all(communicator, lambda: open_file(path, True, communicator))
                opened.enter_context(file)
            self._take(file, scene, force=force)
            self._datasets = {
                each.name: file[stored_path(file, each)] for each in self._columns
            }
            self._status = self._datasets[STATUS.name]
            ids = [each.id for each in self._datasets.values()]
            ends = [
                (each.get_offset(), each.get_offset() + each.get_storage_size())
                for each in ids
            ]
            # A file that has grown has one more byte behind its columns.
            behind = max(end for _, end in ends), path.stat().st_size + 1
            held.parts = (0, min(ends)[0]), behind
            self._held, self.confirm = held, held.check
            self.confirm()  # the first look, which later ones are compared with
            self.push(opened.pop_all())
        self.callback(self._spare_another)
        if communicator is None:
            self.callback(self._finish)
        else:
            self.callback(_on_all, communicator, self._finish)

    def _spare_another(self) -> None:
        """Before a file closes that another has replaced, send HDF5's last bytes elsewhere."""
        try:
            self.confirm()
        except InputError:
            if self._communicator is None:  # closing together is collective
                with tempfile.TemporaryFile() as nothing:
                    os.dup2(nothing.fileno(), self._file.id.get_vfd_handle())

    def write_block(
        self, start: int, stop: int, columns: Mapping[str, ArrayLike]
    ) -> None:
        """Write the finished rows of a block, whose statuses follow once the data are on the disk.

        Parameters
        ----------
        start, stop : int
            First row and one past the last.
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
        if wrong := (columns.keys() ^ self._datasets.keys()) - {CHECKSUM.name}:
            raise ValueError(f"columns missing or unknown: {', '.join(sorted(wrong))}")
        arrays = {}
        for column in self._columns:
            if column == CHECKSUM:
                continue
            values = np.ascontiguousarray(columns[column.name], dtype=column.dtype)
            if values.shape != column.shape(stop - start, self.scene.grid.shape):
                raise ValueError(f"column {column.name} is of shape {values.shape}")
            arrays[column.name] = values
        if self.has_checksums:
            guarded = [column.name for column in self._columns if column.deterministic]
            arrays[CHECKSUM.name] = checksums_of(
                {name: arrays[name] for name in guarded if name != CHECKSUM.name}
            )
        self.confirm()
        status = arrays.pop(STATUS.name)
        edges = np.flatnonzero(
            np.diff(status != Status.PENDING, prepend=False, append=False)
        )
        with disk_trouble(self.path, self._what_is_safe):
            for first, last in edges.reshape(-1, 2).tolist():
                place = start + first - self.rows.start
                for name, values in arrays.items():
                    write_rows(self._datasets[name], place, values[first:last])
                self._waiting.append(Finished(place, status[first:last]))
        self.sync_when_due()

    def sync_when_due(self) -> None:
        """Finish the rows that wait, unless the last sync was less than `SYNC_SECONDS` ago.

        Raises
        ------
        InputError
            If the disk is full or fails.
        """
        if self._waiting and time.monotonic() >= self._synced + SYNC_SECONDS:
            with disk_trouble(self.path, self._what_is_safe):
                self._sync()

    def _sync(self) -> None:
        """Have the data of the rows that wait on the disk, then write their statuses."""
        # A sync that fails may have lost data, and the next one would not say so: these rows stay
        # pending.
        waiting = self._waiting
        self._waiting = []
        self._flush()
        self._held.sync()
        for rows in waiting:
            write_rows(self._status, rows.place, rows.status)
        self._flush()
        self._synced = time.monotonic()

    def _finish(self) -> None:
        """Write the statuses that wait, and have them on the disk too, before the file closes."""
        nothing_written = self._synced == -math.inf  # the first block is synced at once
        # A file that was moved or deleted takes them; one that was overwritten does not.
        if nothing_written or not self._held.intact():
            return
        with disk_trouble(self.path, self._what_is_safe):
            self._sync()
            self._held.sync()

    def _what_is_safe(self) -> str:
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

    def pending(self, first: int = 0, last: int | None = None) -> list[tuple[int, int]]:
        """Find the longest runs of pending rows, as first row and one past the last."""
        begin, end = self._places(first, last)
        runs: list[tuple[int, int]] = []
        for start, stop in chunks(end, 1, begin):
            chunk = self._status[start:stop]
            finished = (chunk == Status.DONE) | (chunk == Status.FAILED)
            edges = np.flatnonzero(np.diff(finished, prepend=True, append=True))
            edges += self.rows.start + start
            here = list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))
            if runs and here and runs[-1][1] == here[0][0]:
                here[0] = (runs.pop()[0], here[0][1])
            runs += here
        return runs

    def retry_failed(self, first: int = 0, last: int | None = None) -> int:
        """Make failed rows pending again, and return their number."""
        begin, end = self._places(first, last)
        failed = [np.empty(0, dtype=np.int64)]
        for start, stop in chunks(end, 1, begin):
            places = start + np.flatnonzero(self._status[start:stop] == Status.FAILED)
            failed.append(self.rows.start + places)
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
        places = rows - self.rows.start
        with disk_trouble(self.path, lambda: "the same command goes on"):
            for start, stop in chunks(len(self.rows), 1):
                wanted = places[(places >= start) & (places < stop)]
                if wanted.size:
                    chunk = self._status[start:stop]
                    chunk[wanted - start] = Status.PENDING
                    write_rows(self._status, start, chunk)
            self._flush()
            self._held.sync()


def _on_all(communicator: Any, action: Callable[[], T]) -> T:
    """Do something on all processes; what one of them refuses is refused on all."""
    outcome: T | None = None
    refusal = ""
    try:
        outcome = action()
    except InputError as error:
        refusal = str(error)
    refusals = [each for each in communicator.allgather(refusal) if each]
    if refusals and isinstance(
        outcome, h5py.File
    ):  # it would wait for the others as it closes
        raise RuntimeError("; ".join(refusals))
    if refusals:
        raise InputError(refusals[0])
    return cast(T, outcome)


def parallel_hdf5() -> bool:
    """Tell whether h5py and its HDF5 are built with MPI; wheels of the package index are not."""
    return bool(h5py.get_config().mpi)


def coherent(path: Path) -> bool:
    """Tell whether several machines can write neighbouring rows: NFS and SMB do not allow it."""
    real = Path(os.path.realpath(path))  # raises nothing for loops of links
    try:
        mounts = MOUNTS.read_text(errors="surrogateescape").splitlines()
    except OSError:
        return True
    kind, longest = "", 0
    for fields in (line.split(" ") for line in mounts):
        point = re.sub(r"\\([0-7]{3})", lambda code: chr(int(code[1], 8)), fields[4])
        if real.is_relative_to(point) and len(point) >= longest:
            kind, longest = fields[fields.index("-") + 1], len(point)
    return kind not in INCOHERENT


@contextmanager
def disk_trouble(path: Path, left: Callable[[], str]) -> Iterator[None]:
    """Turn an error of the disk into an InputError that says in words what is `left`."""
    try:
        yield
    except FileExistsError:
        raise InputError(f"{path} has appeared meanwhile; give another name") from None
    except (OSError, RuntimeError, ValueError, KeyError) as error:
        number = errno_of(error)
        if not number and not isinstance(error, OSError):
            raise
        reason = os.strerror(number) if number else first_line(error)
        fault = (
            f"the disk is full ({reason})"
            if number in FULL
            else f"cannot be written: {reason}"
        )
        raise InputError(f"{path}: {fault}; {left()}") from None
