"""How a database is laid out: dimensions, columns, attributes; and the refusal of other layouts.

Databases come from anywhere. HDF5 lets the data of a dataset lie in other files (external storage,
external links, virtual datasets), behind filters, or on top of another dataset's data, and lets a
header declare more rows than the file has. With such a file, a run could write into a file that
nobody named, or a reader could need memory without bound. Columns therefore have to be hard links
to contiguous datasets of the schema's type and shape, and their data must not overlap.
"""

import json
import re
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from gen.runtime.errors import InputError
from gen.runtime.installation import git_commit, versions
from gen.scene import Scene, columns_for
from gen.schema import (
    DRAWN_NAMES,
    PART,
    PHYSICS,
    REASON,
    REASONS,
    RUNTIME,
    SCHEMA,
    STATUS,
    Column,
    Status,
)

SIGNATURE = b"\x89HDF\r\n\x1a\n"  # first bytes of HDF5 files
CHUNK_BYTES = 8 * 2**20  # most bytes of a column that are in memory at once

TEXTS = ("title", "scene", "scene_hash", "versions", "git_commit", "created")
NUMBERS = ("samples", "schema", "physics", "physics_forced")
LARGEST_ATTRIBUTE = 2**22  # most bytes of an attribute, more than the text of any scene has

PART_NUMBERS = ("first_row", "rows")
"""Attributes of a part: its first row in the scene's plan, and its number of rows."""

FLAGS: dict[Column, dict[int, str]] = {
    STATUS: {status: status.name.lower() for status in Status},
    REASON: REASONS,
}
"""Meaning of each code, for the columns with codes."""


def chunks(rows: int, bytes_per_row: int, first: int = 0) -> Iterator[tuple[int, int]]:
    """Split the rows from `first` on into chunks of `CHUNK_BYTES` at most, or one row."""
    step = max(1, CHUNK_BYTES // bytes_per_row)
    for start in range(first, rows, step):
        yield start, min(start + step, rows)


def write_rows(dataset: h5py.Dataset, start: int, values: NDArray[Any]) -> None:
    """Write contiguous rows of the column's own type and shape, from row `start` of the file on.

    This does the same as `dataset[start:stop] = values` without h5py's 0.1 ms for the slice; a
    block has forty columns, and one process may write for hundreds.
    """
    rows = dataset.id.get_space()
    rows.select_hyperslab((start,) + (0,) * (values.ndim - 1), values.shape)
    dataset.id.write(h5py.h5s.create_simple(values.shape), rows, values)


def lay_out(path: Path, scene: Scene, rows: range, attributes: Mapping[str, str | int]) -> None:
    """Create a file for some rows of a scene: dimensions, attributes and empty columns.

    HDF5 allocates the columns; who calls fills them, because HDF5 crashes if the disk runs full
    during its own filling.
    """
    columns = columns_for(scene)
    # Version 2 of the superblock: later ones mark a file as open, and a killed writer would leave
    # the mark. Creation order is tracked so that readers list columns in the schema's order.
    with h5py.File(path, "w", libver=("v108", "v110"), track_order=True, locking=False) as file:
        part = rows != range(scene.samples)
        own = {name: value for name, value in attributes.items() if name not in PART_NUMBERS}
        own |= {"schema": PART if part else SCHEMA}
        own |= dict(zip(PART_NUMBERS, (rows.start, len(rows)), strict=True)) if part else {}
        for name, value in own.items():
            _set(file, name, value)
        axes = {"sample": len(rows)}
        if any(column.shape_of for column in columns):
            axes |= dict(zip("xy", scene.shape, strict=True))
        dimensions = []
        for name, size in axes.items():  # netCDF-4: a scale without data or disk space
            scale = file.create_dataset(name, shape=(size,), dtype=">f4")
            scale.make_scale(f"This is a netCDF dimension but not a netCDF variable.{size:10d}")
            dimensions.append(scale)
        file.create_group(RUNTIME, track_order=True)
        for column in columns:
            _add(file, column, column.shape(len(rows), scene.shape), dimensions)


def rows_of(attributes: Mapping[str, str | int]) -> range:
    """Return the rows of a file in the numbers of its scene's plan."""
    samples = int(attributes["samples"])
    if attributes["schema"] != PART:
        return range(samples)
    first, count = (int(attributes[name]) for name in PART_NUMBERS)
    if not (0 <= first < samples and 1 <= count <= samples - first):
        raise ValueError(f"it is said to hold {count} rows from row {first} on, of {samples}")
    return range(first, first + count)


def _add(
    file: h5py.File, column: Column, shape: tuple[int, ...], dimensions: list[h5py.Dataset]
) -> None:
    """Add a column that is allocated but not filled, with its attributes and dimensions."""
    properties = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    properties.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    properties.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
    dataset = file.create_dataset(
        column.path, shape=shape, dtype=column.dtype, fillvalue=column.fill, dcpl=properties
    )
    for axis, scale in enumerate(dimensions[: len(shape)]):
        dataset.dims[axis].attach_scale(scale)
    _set(dataset, "long_name", column.long_name)
    if column.unit:
        _set(dataset, "units", column.unit)
    if flags := FLAGS.get(column):
        dataset.attrs["flag_values"] = np.array(list(flags), dtype=column.dtype)
        # CF's list of meanings is separated by blanks: each text has to be one word.
        words = (re.sub(r"[^A-Za-z0-9]+", "_", text).strip("_") for text in flags.values())
        _set(dataset, "flag_meanings", " ".join(word or "none" for word in words))


def _set(node: h5py.Dataset | h5py.File, name: str, value: str | int) -> None:
    """Add an attribute, a text with a fixed length.

    HDF5 keeps texts of variable length in a heap without checksums, and may read for ever if that
    is damaged.
    """
    if isinstance(value, str):
        data = value.encode()
        node.attrs.create(name, data, dtype=h5py.string_dtype("utf-8", max(1, len(data))))
    else:
        node.attrs[name] = value


def identity(scene: Scene) -> dict[str, str | int]:
    """Return the attributes that identify a scene."""
    persons = {"creator_name": scene.creator, "license": scene.licence}  # ACDD's names
    return {
        "title": scene.title or "Contact of rough surfaces",
        **{name: text for name, text in persons.items() if text},
        "scene": scene.text(),
        "scene_hash": scene.fingerprint(),
        "samples": scene.samples,
    }


def provenance(scene: Scene) -> dict[str, str | int]:
    """Return all attributes of a new file for a scene."""
    numerics = versions(("asperity", "numpy", "scipy", "pyfftw", "h5py"))
    return {
        "Conventions": "CF-1.11",
        **identity(scene),
        "schema": SCHEMA,
        "physics": PHYSICS,
        "physics_forced": 0,
        "versions": json.dumps(numerics | {"hdf5": h5py.version.hdf5_version}),
        "git_commit": git_commit(),
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
    }


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


def check_columns(file: h5py.File, path: Path, scene: Scene, rows: int) -> None:
    """Refuse a file whose columns `gen` cannot have laid out; no declared size costs time."""
    size = path.stat().st_size
    places = []
    for column in columns_for(scene):
        name = stored_path(file, column)
        fault = _fault(file, name, column.dtype, column.shape(rows, scene.shape))
        if not fault:
            first, length = file[name].id.get_offset(), rows * column.row_bytes(scene.shape)
            if first is None or first + length > size:
                fault = f"has {rows} rows that do not fit into its {size} bytes"
            else:
                places.append((first, first + length, name))
        if fault:
            raise _refusal(path, name, fault)
    places.sort()
    for (_, end, name), (first, _, other) in pairwise(places):
        if first < end:
            raise _refusal(path, other, f"lies on top of column {name!r}")


def stored_path(file: h5py.File, column: Column) -> str:
    """Return the name of a column in a file: in older ones, some have those of the parameters."""
    older = {name: parameter for parameter, name in DRAWN_NAMES.items()}.get(column.name)
    return column.path if older is None or column.path in file else older


def _fault(file: h5py.File, name: str, dtype: str, shape: tuple[int, ...]) -> str:
    """Say how a column is not one contiguous piece of its file; an empty text if it is."""
    group = name.rpartition("/")[0]
    for part in filter(None, (group, name)):
        link = file.get(part, getclass=True, getlink=True)
        if link is not h5py.HardLink:
            return "is missing" if link is None else "is a link to somewhere else"
    column = file[name]
    if (
        not isinstance(column, h5py.Dataset)
        or (column.shape, column.dtype) != (shape, np.dtype(dtype))
        or column.id.get_type().committed()
    ):
        return f"is not of type {dtype} and shape {shape}"
    if column.external:
        return "keeps its data in another file (external storage)"
    if column.is_virtual:
        return "is put together from other datasets (virtual)"
    copied = column.chunks is not None
    return "is stored in chunks or compressed, as copies by other programs are" if copied else ""


def _refusal(path: Path, name: str, fault: str) -> InputError:
    """Return the error for a column that is laid out in another way."""
    return InputError(
        f"{path} is damaged, or gen has not written it: column {name!r} {fault}; restore it from a"
        " copy or remove it"
    )
