"""The writer of databases: write finished rows, find pending ones."""

import os
import tempfile
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import ArrayLike, NDArray

from gen.database.disk import chunks, disk_trouble, write_rows
from gen.database.held import HeldFile
from gen.database.inspection import stored_path
from gen.database.opening import OpenDatabase, checked_for, counts, open_file
from gen.runtime.errors import InputError
from gen.scene import Scene
from gen.schema import STATUS, Status

KINDS = {"f": "fiu", "i": "iu", "u": "iu", "S": "S"}
"""Accepted kinds of arrays for each kind of column."""


class Writer(OpenDatabase):
    """A database open for writing rows; a context manager; the caller holds `lock(path)`.

    No call changes metadata, so that `ParallelWriter` can write rows from many processes at once.

    Parameters
    ----------
    path : Path
        Database, from `open_or_create`.
    scene : Scene
        Scene of the rows to be written.
    force : bool
        Accept another physics number.

    Attributes
    ----------
    path : Path
        Database.
    scene : Scene
        Scene of the file, which may have more samples than the requested one.
    rows : range
        Rows of the scene that the file holds.

    Raises
    ------
    InputError
        If the file cannot be opened or written, or is not of this scene, layout and physics.
    """

    def __init__(self, path: Path, scene: Scene, *, force: bool = False) -> None:
        with ExitStack() as stack:
            self._held = stack.enter_context(self._hold(path))
            file = stack.enter_context(self._open(path))
            super().__init__(path, checked_for(file, path, scene, force=force), file)
            self._datasets = {
                column.name: file[stored_path(file, column)] for column in self.columns()
            }
            self._status = self._datasets[STATUS.name]
            self._held.remember(self._datasets.values())
            stack.pop_all()

    def close(self) -> None:
        """Close and release the file; if it has been replaced, write nothing more into it."""
        if not self._file:
            return
        try:
            self._held.check()
        except InputError:
            self._abandon()
        super().close()
        self._held.close()

    def _abandon(self) -> None:
        """Redirect the bytes that HDF5 writes when it closes a file into a temporary file."""
        with tempfile.TemporaryFile() as nothing:
            os.dup2(nothing.fileno(), self._file.id.get_vfd_handle())

    def confirm(self) -> None:
        """Refuse a file that has been replaced, see `HeldFile.check`."""
        self._held.check()

    def _hold(self, path: Path) -> HeldFile:
        """Hold the file by device and inode."""
        return HeldFile(path)

    def _open(self, path: Path) -> h5py.File:
        """Open the file for this process alone."""
        return open_file(path, writing=True)

    def write_block(self, start: int, stop: int, columns: Mapping[str, ArrayLike]) -> None:
        """Write finished rows: first all other columns, then the status.

        Parameters
        ----------
        start, stop : int
            First row, and one past the last.
        columns : mapping of array_like, shape (stop - start,) or (stop - start, nx, ny)
            All columns of the file by name, in the units of `gen.schema`; every status is done or
            failed.

        Raises
        ------
        ValueError
            If a column is missing, unknown, or of another shape or kind, a status is neither done
            nor failed, or the file has no such rows; nothing is written then.
        InputError
            If the disk is full or fails, with the number of rows that are safe, or if the file has
            been replaced.
        """
        arrays = self._checked_block(start, stop, columns)
        self.confirm()
        status = arrays.pop(STATUS.name)
        try:
            place = start - self.rows.start
            for name, values in arrays.items():
                write_rows(self._datasets[name], place, values)
            self._flush()
            write_rows(self._status, place, status)
            self._flush()
        except (OSError, RuntimeError, ValueError) as error:
            trouble = disk_trouble(error)
            if trouble is None:
                raise
            raise InputError(
                f"{self.path}: {trouble}; {counts(self._status).done} rows are done and safe: "
                "make room and run the same command again"
            ) from None

    def _checked_block(
        self, start: int, stop: int, columns: Mapping[str, ArrayLike]
    ) -> dict[str, NDArray[Any]]:
        """Return a block's arrays in the columns' types; refuse wrong names, shapes and kinds."""
        if not self.rows.start <= start < stop <= self.rows.stop:
            raise ValueError(f"rows {start} to {stop} of {self.rows.start} to {self.rows.stop}")
        if wrong := columns.keys() ^ self._datasets.keys():
            raise ValueError(f"columns missing or unknown: {', '.join(sorted(wrong))}")
        arrays = {}
        for column in self.columns():
            values = np.asarray(columns[column.name])
            shape = column.shape(stop - start, self.scene.shape)
            if values.shape != shape or values.dtype.kind not in KINDS[column.dtype[0]]:
                raise ValueError(
                    f"column {column.name}: wanted {column.dtype} of shape {shape}, "
                    f"got {values.dtype} of shape {values.shape}"
                )
            arrays[column.name] = np.ascontiguousarray(values, dtype=column.dtype)
        if not np.isin(arrays[STATUS.name], (Status.DONE, Status.FAILED)).all():
            raise ValueError("a finished row is done or failed, nothing else")
        return arrays

    def _flush(self) -> None:
        """Pass all data to the kernel, which keeps them if this process is killed."""
        self._file.flush()

    def pending(self, first: int = 0, last: int | None = None) -> list[tuple[int, int]]:
        """Find the rows that are neither done nor failed.

        Parameters
        ----------
        first, last : int, optional
            First row of the search and one past the last, all rows by default.

        Returns
        -------
        list of (int, int)
            First row and one past the last of every longest run of pending rows, in order.
        """
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
        """Make failed rows pending again.

        Parameters
        ----------
        first, last : int, optional
            First row and one past the last, all rows by default.

        Returns
        -------
        int
            Number of rows that were failed.
        """
        self.confirm()
        retried = 0
        begin, end = self._places(first, last)
        for start, stop in chunks(end, 1, begin):
            chunk = self._status[start:stop]
            failed = chunk == Status.FAILED
            if failed.any():
                retried += int(np.count_nonzero(failed))
                chunk[failed] = Status.PENDING
                write_rows(self._status, start, chunk)
        self._flush()
        return retried
