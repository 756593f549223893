"""Open databases, refuse other files, and read columns, attributes, counts and ranges.

Databases come from anywhere, and HDF5 lets data lie in other files, behind filters, or on top of
another dataset's: a run could write into a file that nobody named, or need memory without bound.
Columns therefore have to be hard links to contiguous datasets of the schema's type and shape.
"""

import errno
import json
import math
import os
import zlib
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np
from numpy.typing import NDArray

from gen.arrays import Indices
from gen.runtime.errors import InputError, errno_of
from gen.runtime.files import kind_of, require_file
from gen.runtime.terminal import command_to_type
from gen.scene import Scene, columns_for, differences, stored_columns
from gen.schema import (
    CHECKSUM,
    DRAWN_NAMES,
    PART,
    PHYSICS,
    REASON,
    REASONS,
    SCHEMA,
    STATUS,
    Column,
    Reason,
    Status,
    made_by_another,
)

SIGNATURE = b"\x89HDF\r\n\x1a\n"  # first bytes of HDF5 files
CHUNK_BYTES = 8 * 2**20  # most bytes of a column that are in memory at once

TEXTS = ("title", "scene", "scene_hash", "versions", "git_commit", "created")
NUMBERS = ("samples", "schema", "physics", "physics_forced")
LARGEST_ATTRIBUTE = (
    2**22
)  # most bytes of an attribute, more than the text of any scene has

PART_NUMBERS = (
    "first_row",
    "rows",
)  # attributes of a part: its first row, and its number of rows

FLAGS: dict[Column, dict[int, str]] = {
    STATUS: {status: status.name.lower() for status in Status},
    REASON: REASONS,
}
"""Meaning of each code, for the columns with codes."""

NO_QUANTITIES = (*FLAGS, CHECKSUM)  # columns of numbers that have no range


class Counts(NamedTuple):
    """Numbers of pending, done and failed rows."""

    pending: int
    done: int
    failed: int


def chunks(rows: int, bytes_per_row: int, first: int = 0) -> Iterator[tuple[int, int]]:
    """Split the rows from `first` on into chunks of `CHUNK_BYTES` at most, or one row."""
    step = max(1, CHUNK_BYTES // bytes_per_row)
    for start in range(first, rows, step):
        yield start, min(start + step, rows)


def rows_of(attributes: Mapping[str, str | int]) -> range:
    """Return the rows of a file in the numbers of its scene's plan."""
    samples = int(attributes["samples"])
    if attributes["schema"] != PART:
        return range(samples)
    first, count = (int(attributes[name]) for name in PART_NUMBERS)
    if not (0 <= first < samples and 1 <= count <= samples - first):
        raise ValueError(
            f"it is said to hold {count} rows from row {first} on, of {samples}"
        )
    return range(first, first + count)


def stored_path(file: h5py.File, column: Column) -> str:
    """Return the name of a column in a file: in older ones, some have those of the parameters."""
    older = {name: parameter for parameter, name in DRAWN_NAMES.items()}.get(column.name)
    return column.path if older is None or column.path in file else older


def has_checksums(file: h5py.File, scene: Scene) -> bool:
    """Tell whether a database has a checksum for each row; older ones have none."""
    names = [column.name for column in columns_for(scene)]
    return CHECKSUM.name in file and CHECKSUM.name not in names  # a user's own output


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
    parts = []
    for name in sorted(columns):
        values = np.ascontiguousarray(columns[name])
        parts.append(values.view(np.uint8).reshape(len(values), -1))
    rows = np.concatenate(parts, axis=1)
    return np.array([zlib.crc32(row) for row in rows], dtype=np.uint32)


def open_file(path: Path, writing: bool = False, communicator: Any = None) -> h5py.File:
    """Open an HDF5 file unchecked; all processes of a communicator open it together.

    HDF5's buffer for small writes is off: a failed write leaves nothing that would fail at the end.
    """
    if (
        require_file(path).is_file() and not path.stat().st_size
    ):  # HDF5 would make it its own
        raise InputError(
            f"{path} is empty, not a database; give another name or remove it"
        )
    access = h5py.h5p.create(h5py.h5p.FILE_ACCESS)
    access.set_fclose_degree(h5py.h5f.CLOSE_STRONG)
    access.set_file_locking(
        False, True
    )  # no locks, and no error if the environment disables them
    access.set_sieve_buf_size(0)
    if communicator is not None:
        hints = communicator.Get_info()
        access.set_fapl_mpio(communicator, hints)
        hints.Free()
    mode = h5py.h5f.ACC_RDWR if writing else h5py.h5f.ACC_RDONLY
    try:
        return h5py.File(h5py.h5f.open(os.fsencode(path), mode, access))
    except OSError as error:
        number = errno_of(error)
        if number == errno.ENOENT:
            raise InputError(f"{path} does not exist; check the name") from None
        if number:
            raise _unread(path, number) from None
        if (kind := kind_of(path)) != "database":
            raise InputError(
                f"{path} is no database but {kind}; give another name"
            ) from None
        raise InputError(
            f"{path} cannot be read as a database ({first_line(error)}); give another name, or"
            " restore it"
        ) from None


def first_line(error: Exception) -> str:
    """Return the first line of an error's text, for messages of one line."""
    return str(error).partition("\n")[0]


def _unread(path: Path, number: int) -> InputError:
    """Return the error for a file that the system cannot read; the file itself may be whole."""
    return InputError(
        f"{path} cannot be read: {os.strerror(number)}; nothing was changed"
    )


@contextmanager
def _damage(path: Path) -> Iterator[None]:
    """Turn what h5py and ours raise of a damaged file into an InputError of one line."""
    try:
        yield
    except InputError:
        raise
    except (
        OSError,
        RuntimeError,
        KeyError,
        TypeError,
        AttributeError,
        ValueError,
    ) as error:
        number = errno_of(error)
        if number not in {
            0,
            errno.EINVAL,
        }:  # that is what the system says of a damaged address
            raise _unread(path, number) from None
        raise InputError(
            f"{path} is damaged, or gen has not written it ({first_line(error)}); restore it from a"
            " copy or remove it"
        ) from None


def read_attributes(file: h5py.File) -> dict[str, str | int]:
    """Read a file's attributes: texts of fixed length and single integers, nothing else."""
    for name in file.attrs:
        attribute = h5py.h5a.open(file.id, name.encode("utf-8", "surrogateescape"))
        kind = attribute.get_type()
        text = isinstance(kind, h5py.h5t.TypeStringID) and not kind.is_variable_str()
        number = isinstance(kind, h5py.h5t.TypeIntegerID)
        wanted = text if name in TEXTS else number if name in NUMBERS else text or number
        single = attribute.get_space().get_simple_extent_type() == h5py.h5s.SCALAR
        if not wanted or not single or attribute.get_storage_size() > LARGEST_ATTRIBUTE:
            kind_wanted = "integer" if name in NUMBERS else "text of fixed length"
            raise ValueError(f"attribute {name!r} is not one {kind_wanted}")
    return {
        name: value.decode() if isinstance(value, bytes) else int(value)
        for name, value in file.attrs.items()
    }


def _check_columns(file: h5py.File, path: Path, scene: Scene, rows: int) -> None:
    """Refuse a file whose columns `gen` cannot have laid out; no declared size costs time."""
    size, places = path.stat().st_size, []
    for column in stored_columns(scene, checksums=has_checksums(file, scene)):
        name = stored_path(file, column)
        for part in filter(None, (column.group, name)):
            link = file.get(part, getclass=True, getlink=True)
            if link is not h5py.HardLink:
                fault = "is missing" if link is None else "is a link to somewhere else"
                raise ValueError(f"column {name!r} {fault}")
        dataset, shape = file[name], column.shape(rows, scene.grid.shape)
        if (
            not isinstance(dataset, h5py.Dataset)
            or (dataset.shape, dataset.dtype) != (shape, np.dtype(column.dtype))
            or dataset.id.get_type().committed()
        ):
            raise ValueError(
                f"column {name!r} is not of type {column.dtype} and shape {shape}"
            )
        if dataset.external or dataset.is_virtual or dataset.chunks is not None:
            raise ValueError(f"column {name!r} is in another file, virtual, or in chunks")
        first, length = dataset.id.get_offset(), rows * column.row_bytes(scene.grid.shape)
        if first is None or first + length > size:
            raise ValueError(
                f"{rows} rows of column {name!r} do not fit into its {size} bytes"
            )
        places.append((first, first + length, name))
    for (_, end, name), (first, _, other) in pairwise(sorted(places)):
        if first < end:
            raise ValueError(f"column {other!r} lies on top of column {name!r}")


def checked(
    file: h5py.File, path: Path, wanted: Scene | None = None, *, force: bool = False
) -> Scene:
    """Check that an open file is a database of this layout, into which a wanted scene may write."""
    with _damage(path):
        if not all(
            name in file.attrs for name in ("schema", "physics", "scene", "samples")
        ):
            raise InputError(
                f"{path} is HDF5 but not a database of Asperity; give another name"
            )
        attributes = read_attributes(file)
        if (schema := attributes["schema"]) not in {SCHEMA, PART}:
            raise InputError(
                f"{path} has layout {schema}, this version reads layout {SCHEMA}; "
                f"use the version that made it ({attributes.get('versions', 'unknown')})"
            )
        if missing := [name for name in (*TEXTS, *NUMBERS) if name not in attributes]:
            raise ValueError(f"it lacks the attribute {missing[0]!r}")
        try:
            scene = Scene.from_text(str(attributes["scene"]), str(path))
        except InputError as error:
            raise InputError(
                f"{error}: this version makes no such scene; change it, and make the database anew:"
                f" {command_to_type('gen run SCENE -o NEW.h5')}"
            ) from None
        own = (attributes["scene_hash"], attributes["samples"])
        if own != (scene.fingerprint(), scene.samples):
            raise ValueError("its scene is not the one that it was made with")
        json.loads(str(attributes["versions"])).items()
        _check_columns(file, path, scene, len(rows_of(attributes)))
    if wanted is None:
        return scene
    if attributes["scene_hash"] != wanted.fingerprint():
        raise InputError(
            f"{path} holds another scene; give another name, or the file's own scene:",
            differences(scene, wanted),
        )
    physics = int(attributes["physics"])
    if physics != PHYSICS and not force:
        raise InputError(
            f"{path} holds results of physics {physics}, this version computes physics {PHYSICS}; "
            f"give another name to make it anew, or have rows of both in one file by"
            f" {command_to_type('gen run')} --force"
        )
    return scene


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
        Rows of the scene that it holds; fewer than all in a part.

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

    def _take(
        self, file: h5py.File, wanted: Scene | None = None, *, force: bool = False
    ) -> None:
        """Check an open file, and read what it holds."""
        self._file = file
        self.scene = checked(file, self.path, wanted, force=force)
        self.rows = rows_of(read_attributes(file))
        self._columns = stored_columns(
            self.scene, checksums=has_checksums(file, self.scene)
        )

    def _places(self, first: int, last: int | None) -> tuple[int, int]:
        """Return first and last position in the columns of those rows that the file has."""
        start, stop = self.rows.start, self.rows.stop
        last = stop if last is None else min(max(last, start), stop)
        return min(max(first, start), last) - start, last - start

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
        total = np.zeros(256, dtype=np.int64)
        for start, stop in chunks(len(self.rows), 1):
            total += np.bincount(
                self._file[STATUS.path][start:stop], minlength=total.size
            )
        done, failed = int(total[Status.DONE]), int(total[Status.FAILED])
        return Counts(len(self.rows) - done - failed, done, failed)

    @property
    def attributes(self) -> dict[str, str | int]:
        """Attributes of the file: scene, versions, commit, layout number, physics number."""
        return read_attributes(self._file)

    def column(self, name: str, start: int = 0, stop: int | None = None) -> NDArray[Any]:
        """Read one column.

        Parameters
        ----------
        name : str
            Name of the column.
        start, stop : int, optional
            First row and one past the last, all rows by default; a part returns those it has.

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
                dataset = self._file[stored_path(self._file, column)]
                values: NDArray[Any] = dataset[slice(*self._places(start, stop))]
                return values
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
        dict of int
            Number of rows by the code of their reason, a key of `gen.schema.REASONS`.
        """
        total = np.zeros(256, dtype=np.int64)
        for start, stop in chunks(len(self.rows), 1):
            chosen = self._file[STATUS.path][start:stop] == status
            codes = self._file[REASON.path][start:stop][chosen]
            total += np.bincount(codes, minlength=total.size)
        if status == Status.DONE:
            total[Reason.NONE] = 0
        return {int(code): int(total[code]) for code in np.flatnonzero(total)}

    def ranges(self) -> dict[str, tuple[float, float]]:
        """Find the range of every column of numbers over the done rows.

        Returns
        -------
        dict of (float, float)
            Smallest and largest value by the column's name and in its unit, NaN without done rows;
            fields, codes and texts are omitted.
        """
        wanted = [
            column
            for column in self._columns
            if not column.shape_of
            and column.dtype[0] != "S"
            and column not in NO_QUANTITIES
        ]
        ranges = {column.name: (math.nan, math.nan) for column in wanted}
        for start, stop in chunks(len(self.rows), 8):
            done = self._file[STATUS.path][start:stop] == Status.DONE
            if not done.any():
                continue
            for column in wanted:
                values = self._file[stored_path(self._file, column)][start:stop][done]
                low, high = ranges[column.name]
                ranges[column.name] = (
                    float(np.fmin(low, np.fmin.reduce(values))),
                    float(np.fmax(high, np.fmax.reduce(values))),
                )
        return ranges

    @property
    def has_checksums(self) -> bool:
        """Whether the file has a checksum for each row; older ones have none."""
        return CHECKSUM in self._columns

    def damaged_rows(self, start: int = 0, stop: int | None = None) -> Indices:
        """Find the finished rows that have other bytes than those they were written with.

        Parameters
        ----------
        start, stop : int, optional
            First row and one past the last, all rows by default.

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
            each for each in self._columns if each.deterministic and each != CHECKSUM
        ]
        row_bytes = sum(column.row_bytes(self.scene.grid.shape) for column in guarded)
        begin, end = self._places(start, stop)
        for first, last in chunks(end, row_bytes, begin):
            # The status is the first column: while a run writes, rows finished by then are whole.
            columns = {
                column.name: self._file[stored_path(self._file, column)][first:last]
                for column in guarded
            }
            unequal = checksums_of(columns) != self._file[CHECKSUM.path][first:last]
            finished = np.isin(columns[STATUS.name], (Status.DONE, Status.FAILED))
            damaged.append(self.rows.start + first + np.flatnonzero(unequal & finished))
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
        if made_by_another(int(self.attributes["physics"])):
            remedy = (
                f"{command_to_type('gen run SCENE -o NEW.h5')} makes the database anew"
            )
        return f"{which} other bytes than were written: {remedy}"
