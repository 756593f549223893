"""Inspection of a file before it is read or written: it has to be laid out as `gen` lays it out.

Databases come from anywhere. HDF5 lets the data of a dataset lie in other files (external storage,
external links, virtual datasets), behind filters, or on top of another dataset's data, and lets a
header declare more rows than the file has. With such a file, a run could write into a file that
nobody named, or a reader could need memory without bound. Columns therefore have to be hard links
to contiguous datasets of the schema's type and shape, and their data must not overlap.
"""

from itertools import pairwise
from pathlib import Path

import h5py
import numpy as np

from gen.runtime.errors import InputError
from gen.scene import Scene
from gen.scene.columns import columns_for
from gen.schema import DRAWN_NAMES, Column

TEXTS = ("title", "scene", "scene_hash", "versions", "git_commit", "created")
NUMBERS = ("samples", "schema", "physics", "physics_forced")
LARGEST_ATTRIBUTE = 2**22
"""Most bytes of an attribute, more than the text of any scene has."""


def check_attributes(file: h5py.File) -> None:
    """Refuse attributes other than texts of fixed length and single integers.

    Parameters
    ----------
    file : h5py.File
        Database whose attributes have not been read yet.

    Raises
    ------
    ValueError
        If an attribute is of another kind; the message names it.
    """
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


def check_columns(file: h5py.File, path: Path, scene: Scene, rows: int) -> None:
    """Refuse columns that `gen` cannot have laid out.

    Time and memory do not depend on the number of rows that the file declares.

    Parameters
    ----------
    file : h5py.File
        Database whose columns have not been read yet.
    path : Path
        Name of the database.
    scene : Scene
        Its scene, which decides columns and shapes.
    rows : int
        Number of its rows.

    Raises
    ------
    InputError
        If a column is missing or laid out otherwise; the message names it.
    """
    size = path.stat().st_size
    places = []
    for column in columns_for(scene):
        dataset = _dataset(file, path, column)
        shape = column.shape(rows, scene.shape)
        _check_kind(dataset, path, column, shape)
        if fault := _foreign(dataset):
            raise _refusal(path, column, fault)
        first, length = dataset.get_offset(), rows * column.row_bytes(scene.shape)
        if first is None or first + length > size:
            raise InputError(
                f"{path} is damaged: {rows} rows of column {column.path!r} do not fit"
                f" into its {size} bytes; restore it from a copy or remove it"
            )
        places.append((first, first + length, column))
    places.sort(key=lambda place: place[0])
    for (_, end, column), (first, _, other) in pairwise(places):
        if first < end:
            raise _refusal(path, other, f"lies on top of column {column.path!r}")


def stored_path(file: h5py.File, column: Column) -> str:
    """Return the name of a column in a file: in older ones, some have those of the parameters.

    Parameters
    ----------
    file : h5py.File
        Open database.
    column : Column
        Column of its scene.
    """
    older = {name: parameter for parameter, name in DRAWN_NAMES.items()}.get(column.name)
    if older is None or column.path.encode() in h5py.h5g.open(file.id, b"/"):
        return column.path
    return older


def _dataset(file: h5py.File, path: Path, column: Column) -> h5py.h5d.DatasetID:
    """Open the dataset of a column; refuse links other than hard links."""
    node = h5py.h5g.open(file.id, b"/")
    *groups, name = stored_path(file, column).split("/")
    for part in (*groups, name):
        wanted = h5py.h5d.DatasetID if part == name else h5py.h5g.GroupID
        if part.encode() not in node:
            raise _missing(path, column)
        if node.links.get_info(part.encode()).type != h5py.h5l.TYPE_HARD:
            raise _refusal(path, column, "is a link to somewhere else")
        node = h5py.h5o.open(node, part.encode())
        if not isinstance(node, wanted):
            raise _missing(path, column)
    return node


def _check_kind(
    dataset: h5py.h5d.DatasetID, path: Path, column: Column, shape: tuple[int, ...]
) -> None:
    """Refuse a dataset whose type, shape or rank differs from the schema's."""
    space = dataset.get_space()
    simple = space.get_simple_extent_type() == h5py.h5s.SIMPLE
    if not simple or space.shape != shape or space.get_simple_extent_dims(maxdims=True) != shape:
        raise _missing(path, column, shape)
    kind = dataset.get_type()
    if kind.committed() or not kind.equal(h5py.h5t.py_create(np.dtype(column.dtype))):
        raise _missing(path, column, shape)


def _foreign(dataset: h5py.h5d.DatasetID) -> str:
    """Return why a dataset's data are not one contiguous piece of its file, or "" if they are."""
    properties = dataset.get_create_plist()
    layout = properties.get_layout()
    if properties.get_external_count():
        return "keeps its data in another file (external storage)"
    if layout == h5py.h5d.VIRTUAL:
        return "is put together from other datasets (virtual)"
    if layout != h5py.h5d.CONTIGUOUS or properties.get_nfilters():
        return "is stored in chunks or compressed, as copies by other programs are"
    return ""


def _refusal(path: Path, column: Column, fault: str) -> InputError:
    """Return the error for a column that is laid out in another way."""
    return InputError(
        f"{path}: column {column.path!r} {fault}: gen writes no such file and uses none; give the"
        " file that gen wrote"
    )


def _missing(path: Path, column: Column, shape: tuple[int, ...] = ()) -> InputError:
    """Return the error for a column that is missing or of another type."""
    wanted = f" of type {column.dtype} and shape {shape}" if shape else ""
    return InputError(
        f"{path} is damaged (no column {column.path!r}{wanted}); restore it from a copy or remove"
        " it"
    )
