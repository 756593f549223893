"""The file that a writer holds: locked by device and inode, and checked for replacement."""

import errno
import fcntl
import os
import struct
from collections.abc import Iterable
from pathlib import Path
from typing import Self

import h5py

from gen.database.disk import coherent
from gen.runtime.errors import InputError
from gen.runtime.output import require_writable

LOCKED_BYTE = 2**62
"""Position of the locked byte, far behind the end of any database, where HDF5 locks nothing."""


class HeldFile:
    """A file to be written, held by device and inode; a context manager.

    `gen.runtime.lock` keeps writers apart by name, but a hard link is another name of the same
    file. One byte of the file itself is therefore locked too, by Linux's open-file locks, which do
    not shut out readers whose HDF5 locks whole files by `flock`, and which end with their process.
    NFS and SMB do not distinguish the two kinds of locks, and other systems may lack open-file
    locks: a file with several hard links is refused there.

    Parameters
    ----------
    path : Path
        Database.
    locking : bool
        Lock the file; False on processes that write together with one that has locked it.

    Raises
    ------
    InputError
        If the file is missing or read-only, or another process writes it.
    """

    def __init__(self, path: Path, *, locking: bool = True) -> None:
        self.path = path
        self._parts: tuple[tuple[int, int], ...] = ()
        self._metadata: list[bytes] = []
        if path.is_dir():
            raise InputError(f"{path} is a folder; give the name of a database")
        try:
            require_writable(path)
            self._descriptor = os.open(path, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)
        except OSError as error:
            reason = "does not exist; check the name" if error.errno == errno.ENOENT else error
            raise InputError(f"{path} {reason}") from None
        try:
            if locking:
                self._lock()
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Self:
        """Return the file, which is released at the end of the block."""
        return self

    def __exit__(self, *error: object) -> None:
        """Release the file."""
        self.close()

    def close(self) -> None:
        """Release the file and its lock."""
        os.close(self._descriptor)

    def remember(self, columns: Iterable[h5py.Dataset]) -> None:
        """Record the bytes before and behind the rows, where writers change nothing.

        Parameters
        ----------
        columns : iterable of h5py.Dataset
            All columns of the same file, opened by HDF5.
        """
        places = [(column.id.get_offset(), column.id.get_storage_size()) for column in columns]
        first = min(offset for offset, _ in places)
        last = max(offset + size for offset, size in places)
        size = os.fstat(self._descriptor).st_size
        self._parts = ((0, first), (last, size + 1))  # a file that has grown has one more byte
        self._metadata = self._read()
        self.check()

    def check(self) -> None:
        """Refuse to continue if the file has been replaced, moved, deleted or overwritten.

        Raises
        ------
        InputError
            If so; the message says which of these has happened.
        """
        try:
            same = os.path.samestat(self.path.stat(), os.fstat(self._descriptor))
            fate = "" if same else "replaced by another file"
        except OSError:
            fate = "moved or deleted"
        if not fate and self._read() != self._metadata:
            fate = "overwritten with something else"
        if fate:
            raise InputError(
                f"{self.path} was {fate} while it was being written; nothing more is written, and"
                " what this run has computed is in the old file, if that is anywhere"
            )

    def stat(self) -> os.stat_result:
        """Return owner, mode and size of the file."""
        return os.fstat(self._descriptor)

    def _read(self) -> list[bytes]:
        """Read the bytes before and behind the rows."""
        return [os.pread(self._descriptor, stop - start, start) for start, stop in self._parts]

    def _lock(self) -> None:
        """Lock one byte; if that is not possible, refuse a file with several names."""
        # struct flock: type, whence, start, length, process; padded to its full size.
        request = struct.pack("hhqqi0q", fcntl.F_WRLCK, os.SEEK_SET, LOCKED_BYTE, 1, 0)
        if hasattr(fcntl, "F_OFD_SETLK") and coherent(self.path):
            try:
                fcntl.fcntl(self._descriptor, fcntl.F_OFD_SETLK, request)
            except OSError as error:
                if error.errno in {errno.EACCES, errno.EAGAIN}:
                    raise InputError(
                        f"{self.path} is being written by another process, under another of its"
                        " names (a hard link); wait until it ends"
                    ) from None
            else:
                return
        names = os.fstat(self._descriptor).st_nlink
        if names > 1:
            raise InputError(
                f"{self.path} has {names} names (hard links), and its file system has no locks"
                " that tell writers of one from those of another; make a copy"
            )
