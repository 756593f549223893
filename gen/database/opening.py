"""Open HDF5 files, and refuse those that are no databases, or none that `gen` can have made.

Databases come from anywhere. HDF5 lets data lie in other files, behind filters, or on top of the
data of another dataset: a run could write into a file that nobody named, or need memory without
bound. Columns therefore have to be hard links to contiguous datasets of the schema's type and
shape.
"""

import errno
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np

from gen.runtime.errors import InputError, errno_of
from gen.runtime.files import kind_of, require_file
from gen.runtime.terminal import command_to_type
from gen.scene import Scene, columns_for, differences, stored_columns
from gen.schema import CHECKSUM, DRAWN_NAMES, PART, PHYSICS, SCHEMA, Column

SIGNATURE = b"\x89HDF\r\n\x1a\n"  # first bytes of HDF5 files

TEXTS = ("title", "scene", "scene_hash", "versions", "git_commit", "created")
"""Attributes of every database that are texts."""

NUMBERS = ("samples", "schema", "physics", "physics_forced")
"""Attributes of every database that are integers."""

LARGEST_ATTRIBUTE = 2**22
"""Most bytes of an attribute: more than the text of any scene has."""

PART_NUMBERS = ("first_row", "rows")
"""Attributes of a part: number of its first row, and how many rows it holds."""


class _Extent(NamedTuple):
    """The bytes of a file that a column takes."""

    start: int  # offset of the first byte
    stop: int  # offset behind the last byte
    name: str  # of the column in the file


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
            f"it claims {count} rows from row {first} on, of a scene of {samples} rows"
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
        If an attribute is anything else than one text of fixed length or one integer, is not of the
        type that its name asks for, or is larger than `LARGEST_ATTRIBUTE`.
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
        # None if the column has no bytes of its own in the file.
        start = dataset.id.get_offset()
        length = rows * column.row_bytes(grid)
        if start is None or start + length > file_bytes:
            raise ValueError(
                f"{rows} rows of column {name!r} do not fit into the file's {file_bytes} bytes"
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
