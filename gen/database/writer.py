"""Write databases: finished rows, by one process or by all processes of an MPI run together."""

import errno
import os
import re
import socket
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, TypeVar

import h5py
import numpy as np
from numpy.typing import ArrayLike, NDArray

from gen.database.reader import Reader, chunks, first_line, open_file, stored_path
from gen.runtime.errors import InputError, errno_of
from gen.runtime.files import require_writable
from gen.scene import Scene
from gen.schema import STATUS, Status

T = TypeVar("T")

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
        seen = [os.pread(self._descriptor, stop - start, start) for start, stop in self.parts]
        self._metadata = self._metadata or seen
        if not fate and seen != self._metadata:
            fate = "overwritten with something else"
        if fate:
            raise InputError(
                f"{self.path} was {fate} while it was being written; nothing more is written, and"
                " what this run has computed is in the old file, if that is anywhere"
            )


def write_rows(dataset: h5py.Dataset, start: int, values: NDArray[Any]) -> None:
    """Do what `dataset[start:stop] = values` does, without h5py's 0.1 ms for the slice."""
    rows = dataset.id.get_space()
    rows.select_hyperslab((start,) + (0,) * (values.ndim - 1), values.shape)
    dataset.id.write(h5py.h5s.create_simple(values.shape), rows, values)


class Writer(Reader):
    """A database open for writing rows; a context manager; the caller holds `lock(path)`.

    With a communicator all its processes open and close the file together, and what one of them
    refuses is refused on all; in between each writes rows of its own, and no metadata changes.
    """

    def __init__(
        self, path: Path, scene: Scene, communicator: Any = None, *, force: bool = False
    ) -> None:
        ExitStack.__init__(self)
        self.path, self._communicator = path, communicator
        with ExitStack() as opened:
            if communicator is None:
                held = opened.enter_context(HeldFile(path))
                file = opened.enter_context(open_file(path, True))
            else:
                status = path.stat() if path.exists() else None  # a rank may see another folder
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
            self._datasets = {each.name: file[stored_path(file, each)] for each in self._columns}
            self._status = self._datasets[STATUS.name]
            ids = [each.id for each in self._datasets.values()]
            ends = [
                (each.get_offset(), each.get_offset() + each.get_storage_size()) for each in ids
            ]
            # A file that has grown has one more byte behind its columns.
            behind = max(end for _, end in ends), path.stat().st_size + 1
            held.parts = (0, min(ends)[0]), behind
            self.confirm = held.check
            self.confirm()  # the first look, which later ones are compared with
            self.push(opened.pop_all())
        self.callback(self._spare_another)

    def _spare_another(self) -> None:
        """Before a file closes that another has replaced, send HDF5's last bytes elsewhere."""
        try:
            self.confirm()
        except InputError:
            if self._communicator is None:  # closing together is collective
                with tempfile.TemporaryFile() as nothing:
                    os.dup2(nothing.fileno(), self._file.id.get_vfd_handle())

    def write_block(self, start: int, stop: int, columns: Mapping[str, ArrayLike]) -> None:
        """Write the finished rows of a block, all columns by name; the status of rows comes last.

        A ValueError says that columns or rows are not the file's, an InputError that the disk is
        full or fails, or that the file has been replaced.
        """
        if not self.rows.start <= start < stop <= self.rows.stop:
            raise ValueError(f"rows {start} to {stop} of {self.rows.start} to {self.rows.stop}")
        if wrong := columns.keys() ^ self._datasets.keys():
            raise ValueError(f"columns missing or unknown: {', '.join(sorted(wrong))}")
        arrays = {}
        for column in self._columns:
            values = np.ascontiguousarray(columns[column.name], dtype=column.dtype)
            if values.shape != column.shape(stop - start, self.scene.grid.shape):
                raise ValueError(f"column {column.name} is of shape {values.shape}")
            arrays[column.name] = values
        self.confirm()
        status = arrays.pop(STATUS.name)
        edges = np.flatnonzero(np.diff(status != Status.PENDING, prepend=False, append=False))
        safe = "rows are done and safe: make room and run the same command again"
        with disk_trouble(self.path, lambda: f"{self.counts().done} {safe}"):
            for first, last in edges.reshape(-1, 2).tolist():
                place = start + first - self.rows.start
                for name, values in arrays.items():
                    write_rows(self._datasets[name], place, values[first:last])
                self._flush()
                write_rows(self._status, place, status[first:last])
                self._flush()

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
        self.confirm()
        retried = 0
        begin, end = self._places(first, last)
        for start, stop in chunks(end, 1, begin):
            chunk = self._status[start:stop]
            failed = chunk == Status.FAILED
            retried += int(np.count_nonzero(failed))
            chunk[failed] = Status.PENDING
            write_rows(self._status, start, chunk)
        self._flush()
        return retried


def _on_all(communicator: Any, opening: Callable[[], T]) -> T:
    """Open something on all processes; what one of them refuses is refused on all."""
    opened, refusal = None, ""
    try:
        opened = opening()
    except InputError as error:
        refusal = str(error)
    refusals = [each for each in communicator.allgather(refusal) if each]
    if refusals and isinstance(opened, h5py.File):  # it would wait for the others as it closes
        raise RuntimeError("; ".join(refusals))
    if refusals or opened is None:
        raise InputError(refusals[0])
    return opened


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
        fault = f"the disk is full ({reason})" if number in FULL else f"cannot be written: {reason}"
        raise InputError(f"{path}: {fault}; {left()}") from None
