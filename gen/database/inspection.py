"""What a file may hold before anything of it is read or written: what gen itself lays out.

Databases come from anywhere. HDF5 lets the data of a dataset lie in other files (external storage,
external links, virtual datasets), behind filters, or on top of another dataset's, and lets a header
promise more rows than the file has. Each of these would have a run write into a file that nobody
named, or a reader ask for memory without bound. So the columns have to be plain: hard links to
contiguous datasets of the schema's type and shape, each in a place of its own within the file.
"""

from itertools import pairwise
from pathlib import Path

import h5py
import numpy as np

from gen.runtime.errors import InputError
from gen.scene import Scene
from gen.schema import Column, columns_for

TEXTS = ("title", "scene", "scene_hash", "versions", "git_commit", "created")
NUMBERS = ("samples", "schema", "physics", "physics_forced")
LARGEST_ATTRIBUTE = 2**22
"""Bytes of an attribute at most: more than any scene's text has."""


def check_attributes(file: h5py.File) -> None:
    """Refuse attributes of another kind, before one of them is read.

    Parameters
    ----------
    file : a database; its attributes have to be texts of fixed length and single integers

    Raises
    ------
    ValueError
        It names the attribute.
    """
    for name in file.attrs:
        attribute = h5py.h5a.open(file.id, name.encode("utf-8", "surrogateescape"))
        kind = attribute.get_type()
        text = isinstance(kind, h5py.h5t.TypeStringID) and not kind.is_variable_str()
        number = isinstance(kind, h5py.h5t.TypeIntegerID)
        wanted = text if name in TEXTS else number if name in NUMBERS else text or number
        single = attribute.get_space().get_simple_extent_type() == h5py.h5s.SCALAR
        if not wanted or not single or attribute.get_storage_size() > LARGEST_ATTRIBUTE:
            what = "integer" if name in NUMBERS else "text of fixed length"
            raise ValueError(f"attribute {name!r} is not one {what}")


def check_columns(file: h5py.File, path: Path, scene: Scene, rows: int) -> None:
    """Refuse columns that gen cannot have laid out, before one of them is read.

    Takes constant time and memory, whatever number of rows the file declares.

    Parameters
    ----------
    file, path : the database, open, and its name
    scene : its scene, which decides columns and shapes
    rows : number of rows that it holds

    Raises
    ------
    InputError
        It names the column.
    """
    size = path.stat().st_size
    places = []
    for column in columns_for(scene):
        dataset = _dataset(file, path, column)
        shape = column.shape(rows, scene.surface.nodes)
        _check_kind(dataset, path, column, shape)
        if fault := _foreign(dataset):
            raise _refusal(path, column, fault)
        first, length = dataset.get_offset(), rows * column.row_bytes(scene.surface.nodes)
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


def _dataset(file: h5py.File, path: Path, column: Column) -> h5py.h5d.DatasetID:
    """Dataset of a column, reached through hard links alone."""
    node = h5py.h5g.open(file.id, b"/")
    *groups, name = column.path.split("/")
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
    """Refuse another type, shape or rank than the schema's."""
    space = dataset.get_space()
    simple = space.get_simple_extent_type() == h5py.h5s.SIMPLE
    if not simple or space.shape != shape or space.get_simple_extent_dims(maxdims=True) != shape:
        raise _missing(path, column, shape)
    kind = dataset.get_type()
    if kind.committed() or not kind.equal(h5py.h5t.py_create(np.dtype(column.dtype))):
        raise _missing(path, column, shape)


def _foreign(dataset: h5py.h5d.DatasetID) -> str:
    """Say what keeps a dataset's data from lying plainly in its own file, "" if nothing does."""
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
    return InputError(
        f"{path}: column {column.path!r} {fault}: gen writes no such file and uses none; give the"
        " file that gen wrote"
    )


def _missing(path: Path, column: Column, shape: tuple[int, ...] = ()) -> InputError:
    wanted = f" of type {column.dtype} and shape {shape}" if shape else ""
    return InputError(
        f"{path} is damaged (no column {column.path!r}{wanted}); restore it from a copy or remove"
        " it"
    )
