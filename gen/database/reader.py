"""Read the columns, attributes, counts and ranges of databases.

A row has a number in the plan of its scene, and a position in the columns of a file. The positions
in a file begin with 0. In a whole database, number and position of a row are equal. A part holds
consecutive rows only. There the position is the number less that of the part's first row.
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

CHUNK_BYTES = 8 * 2**20
"""Largest size of the piece of a column that is read into memory at once [bytes]; a larger row is
read alone."""

FLAGS: dict[Column, dict[int, str]] = {
    STATUS: {status: status.name.lower() for status in Status},
    REASON: REASONS,
}
"""Columns that hold codes, with the meaning of each code in words."""

NO_QUANTITIES = (*FLAGS, CHECKSUM)
"""Columns of whole numbers that are no quantities, and therefore have no range."""

CODES = 256
"""Number of different codes that a column of codes can hold: each is one byte."""


class Counts(NamedTuple):
    """Numbers of pending, done and failed rows of a database."""

    pending: int
    done: int
    failed: int


class Range(NamedTuple):
    """Smallest and largest value of a column, in its unit; both are NaN if no row has a value."""

    smallest: float
    largest: float


def chunks(positions: range, row_bytes: int) -> Iterator[tuple[int, int]]:
    """Split positions of rows into chunks, so that the values of one chunk fit into memory.

    Parameters
    ----------
    positions : range
        Positions of consecutive rows.
    row_bytes : int
        Size of the values of one row that are in memory together [bytes].

    Yields
    ------
    (int, int)
        First position of a chunk, and the position behind its last one. The values of a chunk take
        at most `CHUNK_BYTES`, or the chunk is one row.
    """
    step = max(1, CHUNK_BYTES // row_bytes)
    for start in positions[::step]:
        yield start, min(start + step, positions.stop)


def checksums_of(columns: Mapping[str, NDArray[Any]]) -> NDArray[np.uint32]:
    """Compute the checksum of each row: the CRC-32 of its bytes in some columns.

    Parameters
    ----------
    columns : mapping of str to ndarray, shape (rows,) or (rows, nx, ny)
        All deterministic columns but the checksum, by their names, with the types of the file.

    Returns
    -------
    ndarray, shape (rows,)
        CRC-32 of each row by `zlib.crc32`. It is computed over the bytes of the row's values as in
        the file, one column after another. The columns are taken in the order of their names, so
        that another order of the columns in the file does not change a checksum.
    """
    bytes_of_columns = []  # arrays of shape (rows, bytes of one value)
    for name in sorted(columns):
        values = np.ascontiguousarray(columns[name])
        bytes_of_columns.append(values.view(np.uint8).reshape(len(values), -1))
    bytes_of_rows = np.concatenate(bytes_of_columns, axis=1)
    return np.array([zlib.crc32(row) for row in bytes_of_rows], dtype=np.uint32)


class Reader(ExitStack):
    """A context manager for a database that is open for reading.

    A run may write the database in the meantime. In the arguments of the methods, rows are given by
    their numbers in the plan.

    Parameters
    ----------
    path : Path or str
        Database.

    Attributes
    ----------
    path : Path
        Database.
    scene : Scene
        The scene that the database has recorded.
    rows : range
        Numbers of the rows that the file holds: all rows of the scene, or fewer in a part.

    Raises
    ------
    InputError
        If the file is missing, cannot be read, or is not a database of this layout.
    """

    def __init__(self, path: Path | str) -> None:
        super().__init__()
        self.path = Path(path)
        # If the file is refused, `opened` closes it. Otherwise this object takes over the closing.
        with ExitStack() as opened:
            self._take(opened.enter_context(open_file(self.path)))
            self.push(opened.pop_all())

    def _take(self, file: h5py.File) -> None:
        """Check an open file, and set the attributes of this object from it.

        Raises InputError if the file is not a database of this layout.
        """
        self._file = file
        self.scene = read_scene(file, self.path)
        self.rows = rows_of(read_attributes(file))
        checksums = has_checksums(file, self.scene)
        self._columns = stored_columns(self.scene, checksums=checksums)

    @property
    def _all_positions(self) -> range:
        """Positions of all rows of the file."""
        return range(len(self.rows))

    def _positions(self, first: int, last: int | None) -> range:
        """Return the positions of the rows first to last - 1, as far as the file holds these rows.

        If `last` is None, the rows end with the last row of the file.
        """
        start = self.rows.start
        stop = self.rows.stop
        if last is not None:
            stop = min(max(last, start), stop)
        begin = min(max(first, start), stop)
        return range(begin - start, stop - start)

    def _read(self, column: Column, start: int, stop: int) -> NDArray[Any]:
        """Read the values of a column at the positions start to stop - 1.

        The shape is (positions,), or (positions, nx, ny) for a field.
        """
        values: NDArray[Any] = self._file[stored_path(self._file, column)][start:stop]
        return values

    def columns(self) -> tuple[Column, ...]:
        """Return descriptions of the columns of the file.

        Returns
        -------
        tuple of Column
            Name, type, unit and meaning of each column, in the order of the file.
        """
        return self._columns

    def counts(self) -> Counts:
        """Count the pending, done and failed rows of the file.

        Returns
        -------
        Counts
            Numbers of pending, done and failed rows. Rows with an unknown status count as pending.
        """
        total = np.zeros(CODES, dtype=np.int64)  # number of rows with each status
        for start, stop in chunks(self._all_positions, row_bytes=1):
            total += np.bincount(self._read(STATUS, start, stop), minlength=CODES)
        done = int(total[Status.DONE])
        failed = int(total[Status.FAILED])
        return Counts(pending=len(self.rows) - done - failed, done=done, failed=failed)

    @property
    def attributes(self) -> dict[str, str | int]:
        """Texts and integers that describe the whole file, by the names of the attributes.

        Among them are the scene, versions of libraries, the layout number and the physics number.
        """
        return read_attributes(self._file)

    def column(self, name: str, start: int = 0, stop: int | None = None) -> NDArray[Any]:
        """Read the values of one column.

        Parameters
        ----------
        name : str
            Name of the column, or of the drawn parameter that it holds.
        start, stop : int, optional
            Numbers of the first row and of the row behind the last one; all rows by default. Rows
            that the file does not hold are left out.

        Returns
        -------
        ndarray, shape (rows,) or (rows, nx, ny)
            Numbers, texts or fields in the unit of `gen.schema`. Pending and failed rows are
            included; values that were not computed are the column's fill values.

        Raises
        ------
        InputError
            If the file has no such column.
        """
        for column in self._columns:
            # A drawn parameter may have a column of another name.
            if column.name in {name, DRAWN_NAMES.get(name)}:
                positions = self._positions(start, stop)
                return self._read(column, positions.start, positions.stop)
        names = ", ".join(column.name for column in self._columns)
        raise InputError(f"{self.path} has no column {name!r}; it has {names}")

    def reasons(self, status: Status = Status.FAILED) -> dict[int, int]:
        """Count the rows with a status by their reasons.

        Parameters
        ----------
        status : Status
            `Status.FAILED` for the failed rows, or `Status.DONE` for the done rows that lack
            statistics. Done rows without a reason are not counted.

        Returns
        -------
        dict of int to int
            Numbers of rows by the codes of their reasons, which are keys of `gen.schema.REASONS`.
            Reasons without rows are left out.
        """
        total = np.zeros(CODES, dtype=np.int64)  # number of rows with each reason
        for start, stop in chunks(self._all_positions, row_bytes=1):
            has_status = self._read(STATUS, start, stop) == status
            codes = self._read(REASON, start, stop)[has_status]
            total += np.bincount(codes, minlength=CODES)
        if status == Status.DONE:
            total[Reason.NONE] = 0
        return {int(code): int(total[code]) for code in np.flatnonzero(total)}

    def ranges(self) -> dict[str, Range]:
        """Find the range of each quantity over the done rows.

        Returns
        -------
        dict of str to Range
            Smallest and largest value, in the unit of the column, by the names of the columns. Both
            are NaN if no row is done. Fields, codes, checksums and texts have no range and are left
            out.
        """
        quantities = [column for column in self._columns if _has_range(column)]
        unknown = Range(smallest=math.nan, largest=math.nan)
        ranges = {column.name: unknown for column in quantities}
        for start, stop in chunks(self._all_positions, row_bytes=8):
            done = self._read(STATUS, start, stop) == Status.DONE
            if not done.any():
                continue
            for column in quantities:
                values = self._read(column, start, stop)[done]
                before = ranges[column.name]
                # `fmin` and `fmax` ignore NaN: that of an unknown range, and that of a statistic
                # that is undefined.
                ranges[column.name] = Range(
                    smallest=float(np.fmin(before.smallest, np.fmin.reduce(values))),
                    largest=float(np.fmax(before.largest, np.fmax.reduce(values))),
                )
        return ranges

    @property
    def has_checksums(self) -> bool:
        """Whether the file has a checksum for each row; old files have none."""
        return CHECKSUM in self._columns

    def damaged_rows(self, start: int = 0, stop: int | None = None) -> Indices:
        """Find the finished rows whose bytes have changed since they were written.

        Parameters
        ----------
        start, stop : int, optional
            Numbers of the first row and of the row behind the last one; all rows by default. Rows
            that the file does not hold are left out.

        Returns
        -------
        ndarray, shape (k,)
            Numbers of the done and failed rows whose checksum is not that of their bytes, in
            ascending order. Empty also if the file has no checksums.
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
            # The status is read first, because it is the first of these columns. The other values
            # of a row that it calls finished do not change any more, even if a run is writing.
            columns: Columns = {}
            for column in guarded:
                columns[column.name] = self._read(column, begin, end)
            unequal = checksums_of(columns) != self._read(CHECKSUM, begin, end)
            finished = np.isin(columns[STATUS.name], (Status.DONE, Status.FAILED))
            positions = begin + np.flatnonzero(unequal & finished)
            damaged.append(self.rows.start + positions)
        return np.concatenate(damaged)

    def damage(self) -> str:
        """Say in one line how many finished rows are damaged, and which command is the remedy.

        Returns
        -------
        str
            The line, which a command prints as a warning; "" if no row is damaged.
        """
        rows = self.damaged_rows()
        if not rows.size:
            return ""
        damaged_rows_have = f"row {rows[0]} has"
        if rows.size > 1:
            damaged_rows_have = f"row {rows[0]} and {rows.size - 1} more rows have"
        repair = command_to_type(f"gen check {self.path} --repair")
        remedy = f"{repair} makes them pending"
        # This version cannot compute single rows of another solver's database again.
        if made_by_other_solver(int(self.attributes["physics"])):
            run = command_to_type("gen run SCENE -o NEW.h5")
            remedy = f"{run} makes the database anew"
        return f"{damaged_rows_have} other bytes than were written: {remedy}"


def _has_range(column: Column) -> bool:
    """Tell whether a column holds a quantity with one number for each row."""
    is_text = column.dtype[0] == "S"
    is_field = column.shape_of != ""
    return not is_field and not is_text and column not in NO_QUANTITIES
