"""Read the columns, attributes, counts and ranges of databases.

A row has a number in the plan of its scene, and a position in the columns of a file. Both are equal
in a whole database; in a part, which holds consecutive rows only, positions begin at its first row.
"""

import math
import zlib
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np
from numpy.typing import NDArray

from gen.arrays import Columns, Indices
from gen.database.opening import (
    has_checksums,
    open_file,
    read_attributes,
    read_scene,
    rows_of,
    stored_path,
)
from gen.runtime.errors import InputError
from gen.runtime.terminal import command_to_type
from gen.scene import stored_columns
from gen.schema import (
    CHECKSUM,
    DRAWN_NAMES,
    REASON,
    REASONS,
    STATUS,
    Column,
    Reason,
    Status,
    made_by_other_solver,
)

CHUNK_BYTES = 8 * 2**20  # most bytes of a column that are in memory at once

FLAGS: dict[Column, dict[int, str]] = {
    STATUS: {status: status.name.lower() for status in Status},
    REASON: REASONS,
}
"""Meaning of each code, for the columns with codes."""

NO_QUANTITIES = (*FLAGS, CHECKSUM)  # columns of numbers that have no range

CODES = 256  # different values of a column of codes, which are bytes


class Counts(NamedTuple):
    """Numbers of pending, done and failed rows."""

    pending: int
    done: int
    failed: int


class Range(NamedTuple):
    """Smallest and largest value of a column, in its unit; NaN if no row has a value."""

    smallest: float
    largest: float


def chunks(positions: range, row_bytes: int) -> Iterator[tuple[int, int]]:
    """Split positions of a column into chunks that fit into memory together.

    Parameters
    ----------
    positions : range
        Positions of consecutive rows.
    row_bytes : int
        Size of one row [bytes].

    Yields
    ------
    (int, int)
        First position of a chunk, and the position behind its last one. A chunk has `CHUNK_BYTES`
        at most, or one row.
    """
    step = max(1, CHUNK_BYTES // row_bytes)
    for start in positions[::step]:
        yield start, min(start + step, positions.stop)


def checksums_of(columns: Mapping[str, NDArray[Any]]) -> NDArray[np.uint32]:
    """Compute the checksum of each row: the CRC-32 of its bytes in some columns.

    Parameters
    ----------
    columns : mapping of str to ndarray, shape (rows,) or (rows, nx, ny)
        The deterministic columns by their names, the checksum itself left out.

    Returns
    -------
    ndarray, shape (rows,)
        CRC-32, as `zlib.crc32` has it, of the row's values one after the other as they lie in the
        file. The columns are in the order of their names, so that no later order of the file's
        columns changes a checksum.
    """
    pieces = []
    for name in sorted(columns):
        values = np.ascontiguousarray(columns[name])
        pieces.append(values.view(np.uint8).reshape(len(values), -1))
    rows = np.concatenate(pieces, axis=1)
    return np.array([zlib.crc32(row) for row in rows], dtype=np.uint32)


class Reader(ExitStack):
    """A database open for reading, even while a run writes it; a context manager.

    Parameters
    ----------
    path : Path or str
        Database.

    Attributes
    ----------
    path : Path
        Database.
    scene : Scene
        Scene that it was made with.
    rows : range
        Numbers of the rows that it holds; fewer than all rows of the scene in a part.

    Raises
    ------
    InputError
        If the file is missing, cannot be read, or is not a database of this layout.
    """

    def __init__(self, path: Path | str) -> None:
        super().__init__()
        self.path = Path(path)
        with ExitStack() as opened:
            self._take(opened.enter_context(open_file(self.path)))
            self.push(opened.pop_all())

    def _take(self, file: h5py.File) -> None:
        """Check an open file, and keep it with its scene, its rows and its columns."""
        self._file = file
        self.scene = read_scene(file, self.path)
        self.rows = rows_of(read_attributes(file))
        checksums = has_checksums(file, self.scene)
        self._columns = stored_columns(self.scene, checksums=checksums)

    @property
    def _all_positions(self) -> range:
        """Positions of all rows of the file in its columns."""
        return range(len(self.rows))

    def _positions(self, first: int, last: int | None) -> range:
        """Return the positions of those rows from first to last - 1 that the file holds.

        Without `last`, all rows from `first` on are meant.
        """
        start = self.rows.start
        stop = self.rows.stop
        if last is not None:
            stop = min(max(last, start), stop)
        begin = min(max(first, start), stop)
        return range(begin - start, stop - start)

    def _read(self, column: Column, start: int, stop: int) -> NDArray[Any]:
        """Read the values of a column from one position to another, the last one excluded."""
        values: NDArray[Any] = self._file[stored_path(self._file, column)][start:stop]
        return values

    def columns(self) -> tuple[Column, ...]:
        """Return the columns of the file in the schema's order.

        Returns
        -------
        tuple of Column
            Name, type, unit and meaning of each column.
        """
        return self._columns

    def counts(self) -> Counts:
        """Count the pending, done and failed rows of the file.

        Returns
        -------
        Counts
            Numbers of pending, done and failed rows.
        """
        total = np.zeros(CODES, dtype=np.int64)
        for start, stop in chunks(self._all_positions, 1):
            total += np.bincount(self._read(STATUS, start, stop), minlength=CODES)
        done = int(total[Status.DONE])
        failed = int(total[Status.FAILED])
        return Counts(pending=len(self.rows) - done - failed, done=done, failed=failed)

    @property
    def attributes(self) -> dict[str, str | int]:
        """Attributes of the file: scene, versions, commit, layout number, physics number."""
        return read_attributes(self._file)

    def column(self, name: str, start: int = 0, stop: int | None = None) -> NDArray[Any]:
        """Read one column.

        Parameters
        ----------
        name : str
            Name of the column, or of the drawn parameter that it holds.
        start, stop : int, optional
            Numbers of the first row and of the row behind the last one; all rows by default. A part
            returns those of these rows that it holds.

        Returns
        -------
        ndarray, shape (stop - start,) or (stop - start, nx, ny)
            Numbers, texts or fields in the unit of `gen.schema`, pending and failed rows included.

        Raises
        ------
        InputError
            If the file has no such column.
        """
        for column in self._columns:
            if column.name in {name, DRAWN_NAMES.get(name)}:
                positions = self._positions(start, stop)
                return self._read(column, positions.start, positions.stop)
        names = ", ".join(column.name for column in self._columns)
        raise InputError(f"{self.path} has no column {name!r}; it has {names}")

    def reasons(self, status: Status = Status.FAILED) -> dict[int, int]:
        """Count the failed rows, or the done rows that lack statistics, by their reason.

        Parameters
        ----------
        status : Status
            `Status.FAILED` or `Status.DONE`.

        Returns
        -------
        dict of int to int
            Number of rows by the code of their reason, a key of `gen.schema.REASONS`.
        """
        total = np.zeros(CODES, dtype=np.int64)
        for start, stop in chunks(self._all_positions, 1):
            has_status = self._read(STATUS, start, stop) == status
            codes = self._read(REASON, start, stop)[has_status]
            total += np.bincount(codes, minlength=CODES)
        if status == Status.DONE:
            total[Reason.NONE] = 0
        return {int(code): int(total[code]) for code in np.flatnonzero(total)}

    def ranges(self) -> dict[str, Range]:
        """Find the range of every column of numbers over the done rows.

        Returns
        -------
        dict of str to Range
            Smallest and largest value by the column's name and in its unit, NaN without done rows;
            fields, codes and texts are omitted.
        """
        quantities = [column for column in self._columns if _has_range(column)]
        ranges = {column.name: Range(math.nan, math.nan) for column in quantities}
        for start, stop in chunks(self._all_positions, 8):
            done = self._read(STATUS, start, stop) == Status.DONE
            if not done.any():
                continue
            for column in quantities:
                values = self._read(column, start, stop)[done]
                before = ranges[column.name]
                # NaN, the range of no row and a statistic that is undefined, counts for nothing.
                ranges[column.name] = Range(
                    float(np.fmin(before.smallest, np.fmin.reduce(values))),
                    float(np.fmax(before.largest, np.fmax.reduce(values))),
                )
        return ranges

    @property
    def has_checksums(self) -> bool:
        """Whether the file has a checksum for each row; older files have none."""
        return CHECKSUM in self._columns

    def damaged_rows(self, start: int = 0, stop: int | None = None) -> Indices:
        """Find the finished rows that have other bytes than those they were written with.

        Parameters
        ----------
        start, stop : int, optional
            Numbers of the first row and of the row behind the last one; all rows by default.

        Returns
        -------
        ndarray, shape (k,)
            Numbers of the done and failed rows whose checksum is not that of their bytes; none in a
            file without checksums.
        """
        damaged = [np.empty(0, dtype=np.int64)]
        if not self.has_checksums:
            return damaged[0]
        guarded = [
            column
            for column in self._columns
            if column.deterministic and column != CHECKSUM
        ]
        row_bytes = sum(column.row_bytes(self.scene.grid.shape) for column in guarded)
        for begin, end in chunks(self._positions(start, stop), row_bytes):
            # The status is the first column. Rows that are finished when it is read are whole, also
            # if a run goes on writing.
            columns: Columns = {}
            for column in guarded:
                columns[column.name] = self._read(column, begin, end)
            unequal = checksums_of(columns) != self._read(CHECKSUM, begin, end)
            finished = np.isin(columns[STATUS.name], (Status.DONE, Status.FAILED))
            positions = begin + np.flatnonzero(unequal & finished)
            damaged.append(self.rows.start + positions)
        return np.concatenate(damaged)

    def damage(self) -> str:
        """Say in one line how many finished rows are damaged, and what mends them.

        Returns
        -------
        str
            The line, for a command that reads the rows all the same; empty if no row is damaged.
        """
        rows = self.damaged_rows()
        if not rows.size:
            return ""
        which = f"row {rows[0]} has"
        if rows.size > 1:
            which = f"row {rows[0]} and {rows.size - 1} more rows have"
        remedy = (
            f"{command_to_type(f'gen check {self.path} --repair')} makes them pending"
        )
        if made_by_other_solver(int(self.attributes["physics"])):
            remedy = (
                f"{command_to_type('gen run SCENE -o NEW.h5')} makes the database anew"
            )
        return f"{which} other bytes than were written: {remedy}"


def _has_range(column: Column) -> bool:
    """Tell whether a column has one number a row, which is a quantity and no code."""
    is_text = column.dtype[0] == "S"
    return not column.shape_of and not is_text and column not in NO_QUANTITIES
