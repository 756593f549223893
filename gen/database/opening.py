"""Open HDF5 files, and refuse files that are not databases or that `gen` cannot have made.

A database may come from a stranger. In HDF5, the data of a dataset can be in another file, can be
compressed, or can share bytes with another dataset. A run could then write into a file that the
user has not named, or need any amount of memory. Each column therefore has to be a hard link to a
contiguous dataset with the type and the shape of the schema.
"""

import errno
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from shlex import quote
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
"""Names of the attributes with a text that every database has."""

NUMBERS = ("samples", "schema", "physics", "physics_forced")
"""Names of the attributes with an integer that every database has."""

LARGEST_ATTRIBUTE = 2**22
"""Largest size of an attribute that is read [bytes]; the text of a scene is smaller."""

PART_NUMBERS = ("first_row", "rows")
"""Names of the attributes that only a part has: the number of its first row, and the number of its
rows."""


class _Extent(NamedTuple):
    """The bytes of a file that a column occupies. Extents are sorted by their first byte."""

    start: int  # offset of the first byte
    stop: int  # offset of the byte behind the last one
    name: str  # name of the column in the file


def rows_of(attributes: Mapping[str, str | int]) -> range:
    """Return the numbers of the rows that a file holds.

    Parameters
    ----------
    attributes : mapping of str to str or int
        Attributes of the file, as `read_attributes` returns them.

    Returns
    -------
    range
        Numbers of the rows in the plan of the scene: all rows of the scene, or consecutive ones if
        the file is a part.

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
    """Return the path of a column inside a file, which may have been made before 1.0.0.

    Parameters
    ----------
    file : h5py.File
        An open database.
    column : Column
        One of its columns.

    Returns
    -------
    str
        `column.path`, or the old name of the column in a file made before 1.0.0: the columns of
        `DRAWN_NAMES` then had the names of their parameters.
    """
    parameters = {name: parameter for parameter, name in DRAWN_NAMES.items()}
    old_name = parameters.get(column.name)
    if old_name is None or column.path in file:
        return column.path
    return old_name


def has_checksums(file: h5py.File, scene: Scene) -> bool:
    """Tell whether a database has a checksum for each row, as all but old databases do.

    Parameters
    ----------
    file : h5py.File
        An open database.
    scene : Scene
        Scene of the database.

    Returns
    -------
    bool
        True if the file has the column `CHECKSUM`. False also if its column "checksum" is an output
        of a user's function, as it may be in an old database.
    """
    names_of_results = [column.name for column in columns_for(scene)]
    return CHECKSUM.name in file and CHECKSUM.name not in names_of_results


def open_file(path: Path, writing: bool = False, communicator: Any = None) -> h5py.File:
    """Open an existing HDF5 file without checking its content, which `read_scene` does.

    HDF5 does not lock the file. Its buffer for small writes is off: if a write failed, the data
    would stay in the buffer, and closing the file would fail too.

    Parameters
    ----------
    path : Path
        File.
    writing : bool
        Whether the file is opened for writing too, and not only for reading.
    communicator : mpi4py.MPI.Comm, optional
        Processes that open the file together by MPI-IO. The call is then collective.

    Returns
    -------
    h5py.File
        The open file, which the caller closes.

    Raises
    ------
    InputError
        If the file is missing, empty, cannot be read, or is no HDF5 file.
    """
    # HDF5 could take an empty file for a new one.
    if require_file(path).is_file() and not path.stat().st_size:
        raise InputError(
            f"{path} is empty, not a database; give another name or remove it"
        )
    access = h5py.h5p.create(h5py.h5p.FILE_ACCESS)
    # Closing the file closes all its datasets too.
    access.set_fclose_degree(h5py.h5f.CLOSE_STRONG)
    # HDF5's locks fail on network file systems, so none is taken.
    access.set_file_locking(use_file_locking=False, ignore_when_disabled=True)
    access.set_sieve_buf_size(0)  # switches the buffer for small writes off
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
    """Return the InputError for a file that HDF5 has failed to open with an `error`."""
    # The number is 0 if the system has opened the file, and HDF5 refuses its content.
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
        Any error. The texts of HDF5's errors have many lines.

    Returns
    -------
    str
        The text up to its first line break.
    """
    return str(error).partition("\n")[0]


def _not_read(path: Path, number: int) -> InputError:
    """Return the InputError for a file that the system cannot read.

    `number` is that of the system's error, from the module `errno`. The message does not call the
    file damaged, because the disk or the file server may be at fault.
    """
    return InputError(
        f"{path} cannot be read: {os.strerror(number)}; nothing was changed"
    )


@contextmanager
def _damage(path: Path) -> Iterator[None]:
    """Turn the errors that a damaged file causes in the block into an InputError.

    h5py raises errors of many types, and this module raises ValueError. If the system could not
    read the file, the message does not call it damaged.
    """
    try:
        yield
    except InputError:  # a ValueError that is already in words for the user
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
        # Reading at a damaged address also is an error of the system: EINVAL, invalid argument.
        if number not in {0, errno.EINVAL}:
            raise _not_read(path, number) from None
        raise InputError(
            f"{path} is damaged, or gen has not written it ({first_line(error)}); restore it from a"
            " copy or remove it"
        ) from None


def read_attributes(file: h5py.File) -> dict[str, str | int]:
    """Read all attributes of a file.

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
        If an attribute is neither one text of fixed length nor one integer, if an attribute of
        `TEXTS` is not a text, if one of `NUMBERS` is not an integer, or if an attribute is larger
        than `LARGEST_ATTRIBUTE`.
    """
    for name in file.attrs:
        if not _is_readable(file, name):
            kind = "integer" if name in NUMBERS else "text of fixed length"
            raise ValueError(f"attribute {name!r} is not one {kind}")
    attributes: dict[str, str | int] = {}
    for name, value in file.attrs.items():
        if isinstance(value, bytes):
            attributes[name] = value.decode()
        else:
            attributes[name] = int(value)
    return attributes


def _is_readable(file: h5py.File, name: str) -> bool:
    """Tell whether an attribute meets the conditions of `read_attributes`.

    Only its description is read, not its value, which could need any amount of memory.
    """
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
    is_small = attribute.get_storage_size() <= LARGEST_ATTRIBUTE
    return has_type and is_single and is_small


def _check_columns(file: h5py.File, path: Path, scene: Scene, rows: int) -> None:
    """Check that a file has all columns of a scene as `gen` lays them out, each with its own bytes.

    `rows` is the number of rows of the file. Raises ValueError for a column that is missing, has
    another form, does not fit into the file, or shares bytes with another column. No values are
    read, because a file can claim any number of them.
    """
    grid = scene.grid.shape
    extents = []
    for column in stored_columns(scene, checksums=has_checksums(file, scene)):
        name = stored_path(file, column)
        _require_hard_links(file, column, name)
        dataset = file[name]
        _require_contiguous(dataset, column, name, column.shape(rows, grid))
        size = rows * column.row_bytes(grid)  # [bytes]
        extents.append(_extent_of(dataset, name, size, path))
    # Neighbours in the order of their first bytes: if any two columns overlap, two neighbours do.
    for lower, upper in pairwise(sorted(extents)):
        if upper.start < lower.stop:
            raise ValueError(
                f"column {upper.name!r} lies on top of column {lower.name!r}"
            )


def _extent_of(dataset: h5py.Dataset, name: str, size: int, path: Path) -> _Extent:
    """Return the bytes of the file that a column of a certain size [bytes] occupies.

    Raises ValueError if the column has no bytes in the file, or reaches beyond the end of the file.
    """
    file_bytes = path.stat().st_size
    start = dataset.id.get_offset()  # None if no bytes are allocated for the column
    if start is None or start + size > file_bytes:
        rows = len(dataset)
        raise ValueError(
            f"{rows} rows of column {name!r} do not fit into the file's {file_bytes} bytes"
        )
    return _Extent(start=start, stop=start + size, name=name)


def _require_hard_links(file: h5py.File, column: Column, name: str) -> None:
    """Raise ValueError if a column, or the group that it is in, is missing or not a hard link.

    `name` is the path of the column inside the file. Other kinds of link can lead to another file.
    """
    paths = [column.group, name] if column.group else [name]
    for path in paths:
        link = file.get(path, getclass=True, getlink=True)
        if link is None:
            raise ValueError(f"column {name!r} is missing")
        if link is not h5py.HardLink:
            raise ValueError(f"column {name!r} is a link to somewhere else")


def _require_contiguous(
    node: Any, column: Column, name: str, shape: tuple[int, ...]
) -> None:
    """Raise ValueError unless a node of a file is a contiguous dataset of a type and a shape.

    The type is that of the column. `name` is the path of the node inside the file, for messages.
    """
    # A committed type is stored elsewhere in the file under a name of its own.
    if (
        not isinstance(node, h5py.Dataset)
        or node.shape != shape
        or node.dtype != np.dtype(column.dtype)
        or node.id.get_type().committed()
    ):
        raise ValueError(
            f"column {name!r} is not of type {column.dtype} and shape {shape}"
        )
    # Only datasets in chunks can be compressed.
    if node.external or node.is_virtual or node.chunks is not None:
        raise ValueError(f"column {name!r} is in another file, virtual, or in chunks")


def read_scene(file: h5py.File, path: Path) -> Scene:
    """Check that an open file is a database that `gen` can have made, and return its scene.

    The attributes and the form of all columns are checked, but not the values in the columns.

    Parameters
    ----------
    file : h5py.File
        An open HDF5 file.
    path : Path
        Path of the file, for its size and for messages.

    Returns
    -------
    Scene
        The scene that the database has recorded.

    Raises
    ------
    InputError
        If the file is no database, has another layout, has a scene that this version does not know,
        is damaged, or cannot be read.
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
        # Raises ValueError or AttributeError, which `_damage` turns into an InputError, unless the
        # versions are a table.
        json.loads(str(attributes["versions"])).items()
        _check_columns(file, path, scene, rows=len(rows_of(attributes)))
    return scene


def _checked_attributes(file: h5py.File, path: Path) -> dict[str, str | int]:
    """Check and return the attributes of a database, by their names.

    Raises InputError if the file is no database or has another layout, and ValueError if an
    attribute is missing or of a wrong type.
    """
    # HDF5 files of other programs lack these four; a database that lacks others is damaged.
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
    """Refuse to write rows of a scene into a database of another scene or another physics number.

    Parameters
    ----------
    file : h5py.File
        An open database.
    path : Path
        Path of the database, for messages.
    stored : Scene
        The scene of the database, from `read_scene`.
    scene : Scene
        The scene whose rows are going to be written. It may have another number of samples.
    force : bool
        Whether the database may have another physics number.

    Raises
    ------
    InputError
        If the scenes differ in a key that changes results; the message lists these keys. Also if
        the database has not this version's physics number, unless `force` is True.
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
            f"make it anew: {command_to_type('gen run')} {quote(str(path))} -o NEW.h5, "
            f"or have rows of both in one file by {command_to_type('gen run')} --force"
        )
