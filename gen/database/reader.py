"""Open databases, refuse other files, and read columns, attributes, counts and ranges."""

import errno
import json
import math
import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, NamedTuple, Self

import h5py
import numpy as np
from numpy.typing import NDArray

from gen.database.layout import (
    FLAGS,
    NUMBERS,
    TEXTS,
    check_columns,
    chunks,
    read_attributes,
    rows_of,
    stored_path,
)
from gen.runtime.errors import InputError
from gen.runtime.files import require_file
from gen.scene import Scene, columns_for, differences
from gen.schema import DRAWN_NAMES, PART, PHYSICS, REASON, SCHEMA, STATUS, Column, Reason, Status


class Counts(NamedTuple):
    """Numbers of pending, done and failed rows."""

    pending: int
    done: int
    failed: int


def open_file(path: Path, *, writing: bool = False, communicator: Any = None) -> h5py.File:
    """Open an HDF5 file unchecked; all processes of a communicator open it together.

    HDF5's buffer for small writes is off, so that data reach the kernel in the order of the calls,
    and a failed write leaves nothing that would make closing fail as well.
    """
    if require_file(path).is_file() and not path.stat().st_size:  # HDF5 would make it its own
        raise InputError(f"{path} is empty, not a database; give another name or remove it")
    access = h5py.h5p.create(h5py.h5p.FILE_ACCESS)
    access.set_fclose_degree(h5py.h5f.CLOSE_STRONG)
    access.set_file_locking(False, True)  # no locks, and no error if the environment disables them
    access.set_sieve_buf_size(0)
    if communicator is not None:
        hints = communicator.Get_info()
        access.set_fapl_mpio(communicator, hints)
        hints.Free()
    mode = h5py.h5f.ACC_RDWR if writing else h5py.h5f.ACC_RDONLY
    try:
        return h5py.File(h5py.h5f.open(os.fsencode(path), mode, access))
    except OSError as error:
        if error.errno == errno.ENOENT:
            raise InputError(f"{path} does not exist; check the name") from None
        reason = os.strerror(error.errno) if error.errno else first_line(error)
        raise InputError(
            f"{path} cannot be read as a database ({reason}); give another name, or restore it"
        ) from None


def first_line(error: Exception) -> str:
    """Return the first line of an error's text, for messages of one line."""
    return str(error).partition("\n")[0]


@contextmanager
def _damage(path: Path) -> Iterator[None]:
    """Turn what h5py and ours raise of a damaged file into an InputError of one line."""
    try:
        yield
    except InputError:
        raise
    except (OSError, RuntimeError, KeyError, TypeError, AttributeError, ValueError) as error:
        raise InputError(
            f"{path} is damaged ({first_line(error)}); restore it from a copy or remove it"
        ) from None


def checked(file: h5py.File, path: Path) -> Scene:
    """Check that an open file is a database of this layout, and return its scene."""
    with _damage(path):
        if not all(name in file.attrs for name in ("schema", "physics", "scene", "samples")):
            raise InputError(f"{path} is HDF5 but not a database of Asperity; give another name")
        attributes = read_attributes(file)
        if (schema := attributes["schema"]) not in {SCHEMA, PART}:
            raise InputError(
                f"{path} has layout {schema}, this version reads layout {SCHEMA}; "
                f"use the version that made it ({attributes.get('versions', 'unknown')})"
            )
        if missing := [name for name in (*TEXTS, *NUMBERS) if name not in attributes]:
            raise ValueError(f"it lacks the attribute {missing[0]!r}")
        scene = Scene.from_text(str(attributes["scene"]), str(path))
        own = (attributes["scene_hash"], attributes["samples"])
        if own != (scene.fingerprint(), scene.samples):
            raise ValueError("its scene is not the one that it was made with")
        json.loads(str(attributes["versions"])).items()
        check_columns(file, path, scene, len(rows_of(attributes)))
        return scene


def checked_for(file: h5py.File, path: Path, scene: Scene, *, force: bool) -> Scene:
    """Check that rows of a scene can be written into an open file; return the file's own scene."""
    present = checked(file, path)
    if different := differences(present, scene):
        raise InputError(
            f"{path} holds another scene ({'; '.join(different)}); "
            "give another name, or the file's own scene"
        )
    physics = int(file.attrs["physics"])
    if physics != PHYSICS and not force:
        raise InputError(
            f"{path} holds results of physics {physics}, this version computes physics {PHYSICS}; "
            "give another name, or --force to have rows of both in one file"
        )
    return present


def counts(status: h5py.Dataset) -> Counts:
    """Count rows by their status, given the column of statuses."""
    done = failed = 0
    for start, stop in chunks(len(status), 1):
        chunk = status[start:stop]
        done += int(np.count_nonzero(chunk == Status.DONE))
        failed += int(np.count_nonzero(chunk == Status.FAILED))
    return Counts(len(status) - done - failed, done, failed)


class Reader:
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
        self.path = Path(path)
        with ExitStack() as stack:
            self._file = stack.enter_context(self._open())
            self.scene = self._checked()
            self.rows = rows_of(read_attributes(self._file))
            stack.pop_all()

    def _open(self) -> h5py.File:
        """Open the file."""
        return open_file(self.path)

    def _checked(self) -> Scene:
        """Check the open file, and return its scene."""
        return checked(self._file, self.path)

    def __enter__(self) -> Self:
        """Return the database, which is closed at the end of the block."""
        return self

    def __exit__(self, *error: object) -> None:
        """Close the file."""
        self.close()

    def close(self) -> None:
        """Close the file."""
        self._file.close()

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
        return columns_for(self.scene)

    def counts(self) -> Counts:
        """Count the pending, done and failed rows of the file.

        Returns
        -------
        Counts
            Numbers of pending, done and failed rows.
        """
        return counts(self._file[STATUS.path])

    @property
    def attributes(self) -> dict[str, str | int]:
        """Attributes of the file: scene, versions, commit, layout number, physics number."""
        return read_attributes(self._file)

    @property
    def size_bytes(self) -> int:
        """Size of the file [bytes]."""
        return self.path.stat().st_size

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
        for column in self.columns():
            if column.name in {name, DRAWN_NAMES.get(name)}:
                dataset = self._file[stored_path(self._file, column)]
                values: NDArray[Any] = dataset[slice(*self._places(start, stop))]
                return values
        names = ", ".join(column.name for column in self.columns())
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
            if chosen.any():
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
            for column in self.columns()
            if not column.shape_of and column.dtype[0] != "S" and column not in FLAGS
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


def is_database(path: Path) -> bool:
    """Tell whether there is a file that is a readable database."""
    try:
        with Reader(path):
            return True
    except (OSError, InputError):
        return False
