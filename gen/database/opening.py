"""Files that are opened, and refused unless they are databases of this layout."""

import errno
import json
import os
from pathlib import Path
from typing import Any, NamedTuple, Self

import h5py
import numpy as np

from gen.database.disk import chunks, first_line
from gen.database.inspection import NUMBERS, TEXTS, check_columns
from gen.database.layout import read_attributes, rows_of
from gen.runtime.errors import InputError
from gen.runtime.input_file import require_file
from gen.runtime.output import require_writable
from gen.scene import Scene, differences
from gen.schema import PART, PHYSICS, SCHEMA, STATUS, Column, Status, columns_for


class Counts(NamedTuple):
    """How many rows are pending, done and failed."""

    pending: int
    done: int
    failed: int


class OpenDatabase:
    """What readers and writers share: the open file, its scene, its rows, their status.

    Rows have the numbers of the scene's plan everywhere, also in a part that holds only some.
    """

    def __init__(self, path: Path, scene: Scene, file: h5py.File) -> None:
        self.path = path
        self.scene = scene
        self.rows = rows_of(read_attributes(file))
        self._file = file

    def _places(self, first: int, last: int | None) -> tuple[int, int]:
        """Where the rows first..last stand in the columns, as far as this file has them."""
        start, stop = self.rows.start, self.rows.stop
        last = stop if last is None else min(max(last, start), stop)
        return min(max(first, start), last) - start, last - start

    def __enter__(self) -> Self:
        """Leave the block to close the file."""
        return self

    def __exit__(self, *error: object) -> None:
        """Close the file, whatever has happened."""
        self.close()

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def columns(self) -> tuple[Column, ...]:
        """List the file's columns, in the schema's order."""
        return columns_for(self.scene)

    def counts(self) -> Counts:
        """Count the rows by status."""
        return counts(self._file[STATUS.path])


def counts(status: h5py.Dataset) -> Counts:
    """Count the rows by status."""
    done = failed = 0
    for start, stop in chunks(len(status), 1):
        chunk = status[start:stop]
        done += int(np.count_nonzero(chunk == Status.DONE))
        failed += int(np.count_nonzero(chunk == Status.FAILED))
    return Counts(len(status) - done - failed, done, failed)


def open_file(path: Path, *, writing: bool = False, communicator: Any = None) -> h5py.File:
    """Open an HDF5 file of any content; with an MPI communicator, by all its processes together.

    Without HDF5's buffer for small writes: data reach the kernel in the order of the calls, and a
    failed write leaves nothing behind on which closing would fail as well.
    """
    if path.is_dir():
        raise InputError(f"{path} is a folder; give the name of a database")
    require_file(path)
    if path.is_file() and not path.stat().st_size:  # HDF5 would make it a file of its own
        raise InputError(f"{path} is empty, not a database; give another name or remove it")
    if writing and path.is_file():
        require_writable(path)
    access = h5py.h5p.create(h5py.h5p.FILE_ACCESS)
    access.set_fclose_degree(h5py.h5f.CLOSE_STRONG)
    access.set_file_locking(False, True)  # none, and no complaint where they are disabled
    access.set_sieve_buf_size(0)
    if communicator is not None:
        hints = communicator.Get_info()
        access.set_fapl_mpio(communicator, hints)
        hints.Free()
    mode = h5py.h5f.ACC_RDWR if writing else h5py.h5f.ACC_RDONLY
    try:
        return h5py.File(h5py.h5f.open(os.fsencode(path), mode, access))
    except OSError as error:
        raise InputError(f"{path} {_unreadable(path, error)}") from None


def _unreadable(path: Path, error: OSError) -> str:
    """Why HDF5 could not open a file, and what to do."""
    if error.errno == errno.ENOENT:
        return "does not exist; check the name"
    if error.errno is not None:
        return f"cannot be opened: {os.strerror(error.errno)}"
    if "truncated" in str(error):
        return "is cut off: its end is missing; restore it from a copy or remove it"
    if "signature" in str(error):
        return "is not a database, nor HDF5 at all; give another name or remove it"
    return f"is damaged ({first_line(error)}); restore it from a copy or remove it"


def checked(file: h5py.File, path: Path) -> Scene:
    """Scene of a database of this layout; refuses all else."""
    try:
        return _scene_of(file, path)
    except InputError:
        raise
    except (OSError, RuntimeError, KeyError, TypeError, ValueError) as error:  # all h5py's
        raise InputError(
            f"{path} is damaged ({first_line(error)}); restore it from a copy or remove it"
        ) from None


def _scene_of(file: h5py.File, path: Path) -> Scene:
    """Scene of a whole file; what is not whole may raise anything."""
    if not all(name in file.attrs for name in ("schema", "physics", "scene", "samples")):
        raise InputError(f"{path} is HDF5 but not a database of Asperity; give another name")
    attributes = read_attributes(file)
    schema = attributes["schema"]
    if schema not in {SCHEMA, PART}:
        raise InputError(
            f"{path} has layout {schema}, this version reads layout {SCHEMA}; "
            f"use the version that made it ({attributes.get('versions', 'unknown')})"
        )
    if missing := [name for name in (*TEXTS, *NUMBERS) if name not in attributes]:
        raise InputError(f"{path} is damaged: it lacks the attribute {missing[0]!r}")
    scene = Scene.from_text(str(attributes["scene"]), str(path))
    own = (attributes["scene_hash"], attributes["samples"])
    if own != (scene.fingerprint(), scene.samples):
        raise InputError(f"{path} is damaged: its scene is not the one that it was made with")
    if not isinstance(json.loads(str(attributes["versions"])), dict):
        raise InputError(f"{path} is damaged: its attribute 'versions' names no versions")
    check_columns(file, path, scene, len(rows_of(attributes)))
    return scene


def checked_for(file: h5py.File, path: Path, scene: Scene, *, force: bool) -> Scene:
    """Scene of a database that can take rows of `scene`; refuses all else."""
    found = checked(file, path)
    if different := differences(found, scene):
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
    return found
