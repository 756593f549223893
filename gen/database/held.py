"""The file under a writer: locked by what it is, not by its name, and told from any other."""

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
"""Far behind the end of any database: HDF5 and its readers lock nothing there."""


class HeldFile:
    """A file that is going to be written, held by device and inode; a context manager.

    `gen.runtime.lock` keeps writers apart by name. A hard link is another name of the same file: so
    one byte of the file itself is locked too, by Linux's locks of open files. They do not shut out
    readers whose HDF5 locks whole files by `flock`, and go with their process. On NFS and SMB both
    kinds are one, and elsewhere they may be missing: a file with several hard links is refused.

    Parameters
    ----------
    path : the database
    locking : True to lock it; False on processes that write together with one that does

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
        """Leave the block to let go of the file."""
        return self

    def __exit__(self, *error: object) -> None:
        """Let go of the file."""
        self.close()

    def close(self) -> None:
        """Let go of the file: the lock ends with it."""
        os.close(self._descriptor)

    def remember(self, columns: Iterable[h5py.Dataset]) -> None:
        """Remember all that stands before and behind the rows, where no writer writes.

        Parameters
        ----------
        columns : all columns of the same file, as HDF5 has opened it
        """
        places = [(column.id.get_offset(), column.id.get_storage_size()) for column in columns]
        first = min(offset for offset, _ in places)
        last = max(offset + size for offset, size in places)
        size = os.fstat(self._descriptor).st_size
        self._parts = ((0, first), (last, size + 1))  # a file that has grown is another one too
        self._metadata = self._read()
        self.check()

    def check(self) -> None:
        """Refuse to go on if the name has come to lead to another file, or the content is another.

        Raises
        ------
        InputError
            It says what has become of the file.
        """
        try:
            there = os.path.samestat(self.path.stat(), os.fstat(self._descriptor))
            fate = "" if there else "replaced by another file"
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
        """Owner, mode and size of the file."""
        return os.fstat(self._descriptor)

    def _read(self) -> list[bytes]:
        """All that stands before and behind the rows, as it is now."""
        return [os.pread(self._descriptor, stop - start, start) for start, stop in self._parts]

    def _lock(self) -> None:
        """Lock the one byte, or refuse several names where that is not possible."""
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
