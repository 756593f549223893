"""The layout of a database: dimensions, columns, and attributes with its origin."""

import json
import re
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path

import h5py
import numpy as np

from gen.database.disk import chunks, write_rows
from gen.database.inspection import check_attributes
from gen.runtime.installation import git_commit, versions
from gen.scene import Scene
from gen.scene.columns import columns_for, physics_of
from gen.schema import PART, REASON, REASONS, RUNTIME, SCHEMA, STATUS, Column, Status

PART_NUMBERS = ("first_row", "rows")
"""Attributes of a part: its first row in the scene's plan, and its number of rows."""

FLAGS: dict[Column, dict[int, str]] = {
    STATUS: {status: status.name.lower() for status in Status},
    REASON: REASONS,
}
"""Meaning of each code, for the columns with codes."""


def lay_out(path: Path, scene: Scene, rows: range, attributes: Mapping[str, str | int]) -> None:
    """Create a file with dimensions, attributes and empty columns.

    HDF5 allocates the columns; `fill` fills them, because HDF5 crashes if the disk runs full during
    its own filling.

    Parameters
    ----------
    path : Path
        File to create.
    scene : Scene
        Scene of the rows.
    rows : range
        Rows of the scene that the file holds.
    attributes : mapping
        Texts and integers from `provenance`.
    """
    columns = columns_for(scene)
    # Version 2 of the superblock: later ones mark a file as open, and a killed writer would leave
    # the mark. Creation order is tracked so that readers list columns in the schema's order.
    with h5py.File(path, "w", libver=("v108", "v110"), track_order=True, locking=False) as file:
        for name, value in _with_rows(attributes, scene, rows).items():
            _set(file, name, value)
        axes = {"sample": len(rows)}
        if any(column.shape_of for column in columns):
            axes |= dict(zip("xy", scene.shape, strict=True))
        dimensions = [_dimension(file, name, size) for name, size in axes.items()]
        file.create_group(RUNTIME, track_order=True)
        for column in columns:
            _add(file, column, column.shape(len(rows), scene.shape), dimensions)


def _with_rows(
    attributes: Mapping[str, str | int], scene: Scene, rows: range
) -> dict[str, str | int]:
    """Complete the attributes by the layout number and, for a part, its rows."""
    own = {name: value for name, value in attributes.items() if name not in PART_NUMBERS}
    if rows == range(scene.samples):
        return own | {"schema": SCHEMA}
    return own | {"schema": PART} | dict(zip(PART_NUMBERS, (rows.start, len(rows)), strict=True))


def rows_of(attributes: Mapping[str, str | int]) -> range:
    """Return the rows of a file in the numbers of its scene's plan.

    Parameters
    ----------
    attributes : mapping
        Attributes of the file.

    Returns
    -------
    range
        Rows of the file.

    Raises
    ------
    ValueError
        If the attributes name rows that the scene does not have.
    """
    samples = int(attributes["samples"])
    if attributes["schema"] != PART:
        return range(samples)
    first, count = (int(attributes[name]) for name in PART_NUMBERS)
    if not (0 <= first < samples and 1 <= count <= samples - first):
        raise ValueError(f"it is said to hold {count} rows from row {first} on, of {samples}")
    return range(first, first + count)


def _dimension(file: h5py.File, name: str, size: int) -> h5py.Dataset:
    """Add a netCDF-4 dimension without coordinates: a scale without data or disk space."""
    scale = file.create_dataset(name, shape=(size,), dtype=">f4")
    scale.make_scale(f"This is a netCDF dimension but not a netCDF variable.{size:10d}")
    return scale


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
        _set(dataset, "flag_meanings", " ".join(_word(text) for text in flags.values()))


def fill(file: h5py.File, scene: Scene, first: int, last: int) -> None:
    """Write fill values (NaN, 0 and empty texts) into rows, which takes up their disk space.

    Parameters
    ----------
    file : h5py.File
        Database, open for writing.
    scene : Scene
        Its scene.
    first, last : int
        First row in the file, and one past the last.
    """
    for column in columns_for(scene):
        dataset = file[column.path]
        for start, stop in chunks(last, column.row_bytes(scene.shape), first):
            shape = column.shape(stop - start, scene.shape)
            write_rows(dataset, start, np.full(shape, column.fill, dtype=column.dtype))


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


def read_attributes(file: h5py.File) -> dict[str, str | int]:
    """Read the attributes of a file.

    Parameters
    ----------
    file : h5py.File
        Database.

    Returns
    -------
    dict
        Texts and integers by their names.

    Raises
    ------
    ValueError
        If an attribute is neither a text of fixed length nor an integer.
    """
    check_attributes(file)
    return {
        name: value.decode() if isinstance(value, bytes) else int(value)
        for name, value in file.attrs.items()
    }


def _word(text: str) -> str:
    """Turn a text into one word, since CF's `flag_meanings` is a list separated by blanks."""
    return re.sub(r"[^A-Za-z0-9]+", "_", text).strip("_") or "none"


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
    return {
        "Conventions": "CF-1.11",
        **identity(scene),
        "schema": SCHEMA,
        "physics": physics_of(scene),
        "physics_forced": 0,
        "versions": json.dumps(_versions()),
        "git_commit": git_commit(),
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def _versions() -> dict[str, str]:
    """Return the versions of the packages that determine the numbers."""
    hdf5 = {"hdf5": h5py.version.hdf5_version}
    return versions(("asperity", "numpy", "scipy", "pyfftw", "h5py")) | hdf5
