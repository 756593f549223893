"""Open databases, refuse other files, and read columns, attributes, counts and ranges.

Databases come from anywhere. HDF5 lets data lie in other files, behind filters, or on top of the
data of another dataset: a run could write into a file that nobody named, or need memory without
bound. Columns therefore have to be hard links to contiguous datasets of the schema's type and
shape.

A row has a number in the plan of its scene, and a position in the columns of a file. Both are equal
in a whole database; in a part, which holds consecutive rows only, positions begin at its first row.
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

from gen.arrays import Columns, Indices
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

LARGEST_ATTRIBUTE = 2**22
"""Most bytes of an attribute: more than the text of any scene has."""

PART_NUMBERS = ("first_row", "rows")
"""Attributes of a part: number of its first row, and how many rows it holds."""

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


class _Extent(NamedTuple):
    """The bytes of a file that a column takes."""

    start: int  # offset of the first byte
    stop: int  # offset behind the last byte
    name: str  # of the column in the file


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


def rows_of(attributes: Mapping[str, str | int]) -> range:
    """Return the rows of a file, by their numbers in the plan of its scene.

    Parameters
    ----------
    attributes : mapping of str to str or int
        Attributes of the file, as `read_attributes` returns them.

    Returns
    -------
    range
        Numbers of the rows: all rows of the scene, or consecutive ones in a part.

    Raises
    ------
    ValueError
        If a part claims rows that its scene does not have.
    """
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
    """Find the path of a column inside a file, which may be older than the column's name.

    Parameters
    ----------
    file : h5py.File
        An open database.
    column : Column
        One of its columns.

    Returns
    -------
    str
        `column.path`; in files made before 1.0.0, columns of drawn parameters have the names of the
        parameters.
    """
    parameters = {name: parameter for parameter, name in DRAWN_NAMES.items()}
    parameter = parameters.get(column.name)
    if parameter is None or column.path in file:
        return column.path
    return parameter


def has_checksums(file: h5py.File, scene: Scene) -> bool:
    """Tell whether a database has a checksum for each row; older databases have none.

    Parameters
    ----------
    file : h5py.File
        An open database.
    scene : Scene
        Its scene. An output of a user's function may be called "checksum" in an older database, and
        is none.

    Returns
    -------
    bool
        Whether the file has the column `CHECKSUM`.
    """
    names = [column.name for column in columns_for(scene)]
    return CHECKSUM.name in file and CHECKSUM.name not in names


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


def open_file(path: Path, writing: bool = False, communicator: Any = None) -> h5py.File:
    """Open an existing HDF5 file; its content is not checked, which is what `read_scene` does.

    HDF5 takes no lock, and its buffer for small writes is off, so that a failed write leaves
    nothing behind that would fail again as the file closes.

    Parameters
    ----------
    path : Path
        File.
    writing : bool
        Whether rows are going to be written.
    communicator : mpi4py.MPI.Comm, optional
        Processes that open the file together, by MPI-IO; the call is collective then.

    Returns
    -------
    h5py.File
        The open file, which the caller closes.

    Raises
    ------
    InputError
        If the file is missing, empty, cannot be read, or is no HDF5 file.
    """
    # HDF5 would take an empty file for a new one.
    if require_file(path).is_file() and not path.stat().st_size:
        raise InputError(
            f"{path} is empty, not a database; give another name or remove it"
        )
    access = h5py.h5p.create(h5py.h5p.FILE_ACCESS)
    access.set_fclose_degree(h5py.h5f.CLOSE_STRONG)
    # No locks, and no error if the environment disables them.
    access.set_file_locking(False, True)
    access.set_sieve_buf_size(0)
    if communicator is not None:
        hints = communicator.Get_info()
        access.set_fapl_mpio(communicator, hints)
        hints.Free()
    mode = h5py.h5f.ACC_RDWR if writing else h5py.h5f.ACC_RDONLY
    try:
        return h5py.File(h5py.h5f.open(os.fsencode(path), mode, access))
    except OSError as error:
        raise _not_opened(path, error) from None


def _not_opened(path: Path, error: OSError) -> InputError:
    """Return the error of one line for a file that HDF5 does not open."""
    number = errno_of(error)
    if number == errno.ENOENT:
        return InputError(f"{path} does not exist; check the name")
    if number:
        return _not_read(path, number)
    kind = kind_of(path)
    if kind != "database":
        return InputError(f"{path} is no database but {kind}; give another name")
    return InputError(
        f"{path} cannot be read as a database ({first_line(error)}); give another name, or"
        " restore it"
    )


def first_line(error: Exception) -> str:
    """Return the first line of an error's text, for messages of one line.

    Parameters
    ----------
    error : Exception
        Any error; those of HDF5 have many lines.

    Returns
    -------
    str
        The text up to its first line break.
    """
    return str(error).partition("\n")[0]


def _not_read(path: Path, number: int) -> InputError:
    """Return the error for a file that the system cannot read, by the number of the system's error.

    The file itself may be sound.
    """
    return InputError(
        f"{path} cannot be read: {os.strerror(number)}; nothing was changed"
    )


@contextmanager
def _damage(path: Path) -> Iterator[None]:
    """Turn the errors that a damaged file causes, in h5py and here, into an InputError."""
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
        # A damaged address inside the file is an invalid argument (EINVAL) to the system.
        if number not in {0, errno.EINVAL}:
            raise _not_read(path, number) from None
        raise InputError(
            f"{path} is damaged, or gen has not written it ({first_line(error)}); restore it from a"
            " copy or remove it"
        ) from None


def read_attributes(file: h5py.File) -> dict[str, str | int]:
    """Read the attributes of a file.

    Parameters
    ----------
    file : h5py.File
        An open HDF5 file.

    Returns
    -------
    dict of str to str or int
        Texts and integers by the names of the attributes.

    Raises
    ------
    ValueError
        If an attribute is anything else than one text of fixed length or one integer.
    """
    for name in file.attrs:
        if not _is_readable(file, name):
            kind = "integer" if name in NUMBERS else "text of fixed length"
            raise ValueError(f"attribute {name!r} is not one {kind}")
    attributes: dict[str, str | int] = {}
    for name, value in file.attrs.items():
        attributes[name] = value.decode() if isinstance(value, bytes) else int(value)
    return attributes


def _is_readable(file: h5py.File, name: str) -> bool:
    """Tell whether an attribute is one text of fixed length or one integer, as it has to be."""
    attribute = h5py.h5a.open(file.id, name.encode("utf-8", "surrogateescape"))
    kind = attribute.get_type()
    is_text = isinstance(kind, h5py.h5t.TypeStringID) and not kind.is_variable_str()
    is_number = isinstance(kind, h5py.h5t.TypeIntegerID)
    if name in TEXTS:
        has_type = is_text
    elif name in NUMBERS:
        has_type = is_number
    else:
        has_type = is_text or is_number
    is_single = attribute.get_space().get_simple_extent_type() == h5py.h5s.SCALAR
    return has_type and is_single and attribute.get_storage_size() <= LARGEST_ATTRIBUTE


def _check_columns(file: h5py.File, path: Path, scene: Scene, rows: int) -> None:
    """Raise ValueError for a column that `gen` cannot have laid out in a file of so many rows.

    Only headers are read, so that no size that a file declares costs time or memory.
    """
    grid = scene.grid.shape
    file_bytes = path.stat().st_size
    extents = []
    for column in stored_columns(scene, checksums=has_checksums(file, scene)):
        name = stored_path(file, column)
        _require_hard_links(file, column, name)
        dataset = file[name]
        _require_contiguous(dataset, column, name, column.shape(rows, grid))
        start = dataset.id.get_offset()
        length = rows * column.row_bytes(grid)
        if start is None or start + length > file_bytes:
            raise ValueError(
                f"{rows} rows of column {name!r} do not fit into its {file_bytes} bytes"
            )
        extents.append(_Extent(start, start + length, name))
    for before, after in pairwise(sorted(extents)):
        if after.start < before.stop:
            raise ValueError(
                f"column {after.name!r} lies on top of column {before.name!r}"
            )


def _require_hard_links(file: h5py.File, column: Column, name: str) -> None:
    """Raise ValueError if a column or its group is missing, or is a link to somewhere else."""
    paths = [column.group, name] if column.group else [name]
    for path in paths:
        link = file.get(path, getclass=True, getlink=True)
        if link is None:
            raise ValueError(f"column {name!r} is missing")
        if link is not h5py.HardLink:
            raise ValueError(f"column {name!r} is a link to somewhere else")


def _require_contiguous(
    dataset: Any, column: Column, name: str, shape: tuple[int, ...]
) -> None:
    """Raise ValueError unless a dataset lies in the file in one piece of the column's type."""
    if (
        not isinstance(dataset, h5py.Dataset)
        or dataset.shape != shape
        or dataset.dtype != np.dtype(column.dtype)
        or dataset.id.get_type().committed()
    ):
        raise ValueError(
            f"column {name!r} is not of type {column.dtype} and shape {shape}"
        )
    if dataset.external or dataset.is_virtual or dataset.chunks is not None:
        raise ValueError(f"column {name!r} is in another file, virtual, or in chunks")


def read_scene(file: h5py.File, path: Path) -> Scene:
    """Check that an open file is a database that `gen` can have made, and read its scene.

    Parameters
    ----------
    file : h5py.File
        An open HDF5 file.
    path : Path
        Its path, for messages.

    Returns
    -------
    Scene
        The scene that the database was made with.

    Raises
    ------
    InputError
        If the file is no database, has another layout, or is damaged.
    """
    with _damage(path):
        attributes = _checked_attributes(file, path)
        try:
            scene = Scene.from_text(str(attributes["scene"]), str(path))
        except InputError as error:
            raise InputError(
                f"{error}: this version makes no such scene; change it, and make the database anew:"
                f" {command_to_type('gen run SCENE -o NEW.h5')}"
            ) from None
        recorded = (attributes["scene_hash"], attributes["samples"])
        if recorded != (scene.fingerprint(), scene.samples):
            raise ValueError("its scene is not the one that it was made with")
        json.loads(str(attributes["versions"])).items()  # raises unless it is a table
        _check_columns(file, path, scene, len(rows_of(attributes)))
    return scene


def _checked_attributes(file: h5py.File, path: Path) -> dict[str, str | int]:
    """Return the attributes of a file that has all of them, and this version's layout."""
    for name in ("schema", "physics", "scene", "samples"):
        if name not in file.attrs:
            raise InputError(
                f"{path} is HDF5 but not a database of Asperity; give another name"
            )
    attributes = read_attributes(file)
    schema = attributes["schema"]
    if schema not in {SCHEMA, PART}:
        raise InputError(
            f"{path} has layout {schema}, this version reads layout {SCHEMA}; "
            f"use the version that made it ({attributes.get('versions', 'unknown')})"
        )
    for name in (*TEXTS, *NUMBERS):
        if name not in attributes:
            raise ValueError(f"it lacks the attribute {name!r}")
    return attributes


def require_scene(
    file: h5py.File, path: Path, stored: Scene, scene: Scene, *, force: bool = False
) -> None:
    """Refuse to write rows of a scene into a database of another scene or of other results.

    Parameters
    ----------
    file : h5py.File
        An open database.
    path : Path
        Its path, for messages.
    stored : Scene
        The scene of the database, from `read_scene`.
    scene : Scene
        The scene whose rows are going to be written. Its number of samples does not count.
    force : bool
        Whether the database may have another physics number.

    Raises
    ------
    InputError
        If the scenes differ, key by key, or the physics numbers do without `force`.
    """
    attributes = read_attributes(file)
    if attributes["scene_hash"] != scene.fingerprint():
        raise InputError(
            f"{path} holds another scene; give another name, or the file's own scene:",
            differences(stored, scene),
        )
    physics = int(attributes["physics"])
    if physics != PHYSICS and not force:
        raise InputError(
            f"{path} holds results of physics {physics}, this version computes physics {PHYSICS}; "
            f"give another name to make it anew, or have rows of both in one file by"
            f" {command_to_type('gen run')} --force"
        )


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
        if made_by_another(int(self.attributes["physics"])):
            remedy = (
                f"{command_to_type('gen run SCENE -o NEW.h5')} makes the database anew"
            )
        return f"{which} other bytes than were written: {remedy}"


def _has_range(column: Column) -> bool:
    """Tell whether a column has one number a row, which is a quantity and no code."""
    is_text = column.dtype[0] == "S"
    return not column.shape_of and not is_text and column not in NO_QUANTITIES
