"""Open files, and refuse those that are not databases of this layout."""

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
from gen.runtime.files import require_file, require_writable
from gen.scene import Scene, differences
from gen.scene.columns import columns_for, physics_of
from gen.schema import PART, SCHEMA, STATUS, Column, Status


class Counts(NamedTuple):
    """Numbers of pending, done and failed rows."""

    pending: int
    done: int
    failed: int


class OpenDatabase:
    """An open file with its scene and its rows, for readers and writers.

    Rows have the numbers of the scene's plan everywhere, also in a part.

    Parameters
    ----------
    path : Path
        Database.
    scene : Scene
        Its scene.
    file : h5py.File
        The open file.
    """

    def __init__(self, path: Path, scene: Scene, file: h5py.File) -> None:
        self.path = path
        self.scene = scene
        self.rows = rows_of(read_attributes(file))
        self._file = file

    def _places(self, first: int, last: int | None) -> tuple[int, int]:
        """Return first and last position in the columns of those rows that the file has."""
        start, stop = self.rows.start, self.rows.stop
        last = stop if last is None else min(max(last, start), stop)
        return min(max(first, start), last) - start, last - start

    def __enter__(self) -> Self:
        """Return the database, which is closed at the end of the block."""
        return self

    def __exit__(self, *error: object) -> None:
        """Close the file."""
        self.close()

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def columns(self) -> tuple[Column, ...]:
        """Return the columns of the file in the schema's order.

        Returns
        -------
        tuple of Column
            Name, type, unit and meaning of each column.
        """
        return columns_for(self.scene)

    def counts(self) -> Counts:
        """Count the rows of the file by their status.

        Returns
        -------
        Counts
            Numbers of pending, done and failed rows.
        """
        return counts(self._file[STATUS.path])


def counts(status: h5py.Dataset) -> Counts:
    """Count rows by their status.

    Parameters
    ----------
    status : h5py.Dataset
        Column of statuses.
    """
    done = failed = 0
    for start, stop in chunks(len(status), 1):
        chunk = status[start:stop]
        done += int(np.count_nonzero(chunk == Status.DONE))
        failed += int(np.count_nonzero(chunk == Status.FAILED))
    return Counts(len(status) - done - failed, done, failed)


def open_file(path: Path, *, writing: bool = False, communicator: Any = None) -> h5py.File:
    """Open an HDF5 file without checking its content.

    HDF5's buffer for small writes is off, so that data reach the kernel in the order of the calls,
    and a failed write leaves nothing that would make closing fail as well.

    Parameters
    ----------
    path : Path
        File to open.
    writing : bool
        Open the file for writing too.
    communicator : mpi4py.MPI.Comm, optional
        Processes that open the file together, a collective call.

    Returns
    -------
    h5py.File
        The open file.

    Raises
    ------
    InputError
        If the file is missing, unreadable, read-only or no HDF5.
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
        raise InputError(f"{path} {_unreadable(path, error)}") from None


def _unreadable(path: Path, error: OSError) -> str:
    """Describe why HDF5 could not open a file, with advice."""
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
    """Check that an open file is a database of this layout, and return its scene.

    Parameters
    ----------
    file : h5py.File
        File to check.
    path : Path
        Its name.

    Returns
    -------
    Scene
        Scene of the database.

    Raises
    ------
    InputError
        If the file is damaged, or not a database of this layout.
    """
    try:
        return _scene_of(file, path)
    except InputError:
        raise
    except (
        OSError,
        RuntimeError,
        KeyError,
        TypeError,
        ValueError,
    ) as error:  # h5py raises all of these
        raise InputError(
            f"{path} is damaged ({first_line(error)}); restore it from a copy or remove it"
        ) from None


def _scene_of(file: h5py.File, path: Path) -> Scene:
    """Return the scene of an intact file; a damaged one may raise any error of h5py."""
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
    """Check that rows of a scene can be written into an open file, and return the file's own scene.

    Parameters
    ----------
    file : h5py.File
        File to check.
    path : Path
        Its name.
    scene : Scene
        Scene of the rows to be written.
    force : bool
        Accept another physics number.

    Returns
    -------
    Scene
        Scene of the database, which may have another number of samples.

    Raises
    ------
    InputError
        If the file is no database of this layout, scene and physics number.
    """
    present = checked(file, path)
    if different := differences(present, scene):
        raise InputError(
            f"{path} holds another scene ({'; '.join(different)}); "
            "give another name, or the file's own scene"
        )
    physics = int(file.attrs["physics"])
    current = physics_of(scene)
    if physics != current and not force:
        raise InputError(
            f"{path} holds results of physics {physics}, this version computes physics {current}; "
            "give another name, or --force to have rows of both in one file"
        )
    return present
