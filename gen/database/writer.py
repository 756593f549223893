"""The single writer: finished rows go in, unfinished ones are found again."""

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
from gen.database.opening import OpenDatabase, checked_for, counts, open_file
from gen.runtime.errors import InputError
from gen.scene import Scene
from gen.schema import STATUS, Status

KINDS = {"f": "fiu", "i": "iu", "u": "iu", "S": "S"}
"""Kinds of arrays that a column of each kind takes."""


class Writer(OpenDatabase):
    """A database open for writing rows; a context manager; the caller holds `lock(path)`.

    No call changes metadata, so that `ParallelWriter` can write rows from many processes at once.

    Parameters
    ----------
    path : the database, from `open_or_create`
    scene : what is being generated
    force : see `open_or_create`

    Attributes
    ----------
    path : the database
    scene : the file's scene, which may have more samples than the one asked for
    rows : those of the scene that the file holds

    Raises
    ------
    InputError
        If the file cannot be opened or written, another process writes it under another name, or
        it is not of this scene, layout and physics.
    """

    def __init__(self, path: Path, scene: Scene, *, force: bool = False) -> None:
        with ExitStack() as stack:
            self._held = stack.enter_context(self._hold(path))
            file = stack.enter_context(self._open(path))
            super().__init__(path, checked_for(file, path, scene, force=force), file)
            self._datasets = {column.name: file[column.path] for column in self.columns()}
            self._status = self._datasets[STATUS.name]
            self._held.remember(self._datasets.values())
            stack.pop_all()

    def close(self) -> None:
        """Close the file, then let go of it; a file that has become another gets nothing more."""
        if not self._file:
            return
        try:
            self._held.check()
        except InputError:
            self._abandon()
        super().close()
        self._held.close()

    def _abandon(self) -> None:
        """Have HDF5 write into nothing what it writes when it closes a file, its first bytes."""
        with tempfile.TemporaryFile() as nothing:
            os.dup2(nothing.fileno(), self._file.id.get_vfd_handle())

    def confirm(self) -> None:
        """Refuse a file that is no longer what was opened: see `HeldFile.check`."""
        self._held.check()

    def _hold(self, path: Path) -> HeldFile:
        """Lock the file, whatever it is called."""
        return HeldFile(path)

    def _open(self, path: Path) -> h5py.File:
        """Open the file for this process alone."""
        return open_file(path, writing=True)

    def write_block(self, start: int, stop: int, columns: Mapping[str, ArrayLike]) -> None:
        """Write finished rows: everything else first, then their status.

        Parameters
        ----------
        start, stop : first row, and one past the last
        columns : by name, every column of the file: (stop - start,), or (stop - start, n, n) for
            fields, in the units of `gen.schema`; the status done or failed

        Raises
        ------
        ValueError
            If a column is missing, unknown, or of another shape or kind, a status is neither done
            nor failed, or there are no such rows; nothing is written then.
        InputError
            If the disk is full or fails: it says how many rows are safe; if the file is no longer
            what was opened.
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
        """Arrays of a block, of the right names, shapes and kinds."""
        if not self.rows.start <= start < stop <= self.rows.stop:
            raise ValueError(f"rows {start} to {stop} of {self.rows.start} to {self.rows.stop}")
        if wrong := columns.keys() ^ self._datasets.keys():
            raise ValueError(f"columns missing or unknown: {', '.join(sorted(wrong))}")
        arrays = {}
        for column in self.columns():
            values = np.asarray(columns[column.name])
            shape = column.shape(stop - start, self.scene.surface.nodes)
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
        """Hand all data to the kernel, which keeps them if this process is killed."""
        self._file.flush()

    def pending(self, first: int = 0, last: int | None = None) -> list[tuple[int, int]]:
        """Find the rows that are neither done nor failed.

        Parameters
        ----------
        first, last : where to look: first row, and one past the last (None: to the end)

        Returns
        -------
        (start, stop) of every run of pending rows, in order, as long as possible
        """
        begin, end = self._places(first, last)
        runs: list[tuple[int, int]] = []
        for start, stop in chunks(end, 1, begin):
            chunk = self._status[start:stop]
            finished = (chunk == Status.DONE) | (chunk == Status.FAILED)
            edges = np.flatnonzero(np.diff(finished, prepend=True, append=True))
            edges += self.rows.start + start
            found = list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))
            if runs and found and runs[-1][1] == found[0][0]:
                found[0] = (runs.pop()[0], found[0][1])
            runs += found
        return runs

    def retry_failed(self, first: int = 0, last: int | None = None) -> int:
        """Make the failed rows first..last pending again, and return how many they were."""
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
