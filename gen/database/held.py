"""The file that a writer holds, known by device and inode, and checked for replacement."""

import errno
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Self

import h5py

from gen.runtime.errors import InputError
from gen.runtime.files import require_writable


class HeldFile:
    """A file to be written, held by device and inode; a context manager.

    `gen.runtime.lock` keeps writers apart, by name.

    Parameters
    ----------
    path : Path
        Database.

    Raises
    ------
    InputError
        If the file is missing or read-only.
    """

    def __init__(self, path: Path) -> None:
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

    def __enter__(self) -> Self:
        """Return the file, which is released at the end of the block."""
        return self

    def __exit__(self, *error: object) -> None:
        """Release the file."""
        self.close()

    def close(self) -> None:
        """Release the file."""
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
