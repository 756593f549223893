"""Lay out the file of a new database: its attributes, its dimensions, and columns without values.

The file follows the conventions of netCDF-4 and CF, so that other programs can read it.
"""

import json
import re
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

import h5py
import numpy as np

from gen.database.opening import PART_NUMBERS
from gen.database.reader import FLAGS
from gen.runtime.installation import git_commit, versions
from gen.scene import Scene
from gen.schema import PART, PHYSICS, RUNTIME, SCHEMA, Column

FILE_SETTINGS: dict[str, Any] = {"libver": ("v108", "v110"), "track_order": True}
"""Arguments of `h5py.File` for new files.

The range of library versions gives the file's superblock version 2. Version 3 would mark a file
that is open for writing, and a killed writer would leave the mark. The order of creation is stored
so that other programs list the columns in the order of the schema.
"""

Attributes = Mapping[str, str | int]
"""Attributes of a file by their names, as `gen.database.opening.read_attributes` returns them."""


def new_attributes() -> dict[str, str | int]:
    """Return the attributes of a new file that do not depend on its scene and rows.

    Returns
    -------
    dict of str to str or int
        By the names of the attributes: "schema", the number of the layout; "physics", the number of
        the results; "physics_forced", the other physics number that was forced onto the file, here
        0 for none; "versions", a JSON text with the version of each library; "git_commit", the
        commit of this program; "created", the present time in UTC.
    """
    library_versions = versions(("asperity", "numpy", "scipy", "pyfftw", "h5py"))
    return {
        "schema": SCHEMA,
        "physics": PHYSICS,
        "physics_forced": 0,  # no rows of another physics number are in the file
        "versions": json.dumps(library_versions | {"hdf5": h5py.version.hdf5_version}),
        "git_commit": git_commit(),
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def lay_out(
    file: h5py.File,
    scene: Scene,
    rows: range,
    columns: Sequence[Column],
    attributes: Attributes,
) -> None:
    """Write the attributes, the dimensions and the columns of a new file.

    The columns get disk space and descriptions, but no values: the caller has to write every row.

    Parameters
    ----------
    file : h5py.File
        The new file, which is empty and open for writing.
    scene : Scene
        The completed scene.
    rows : range
        Numbers of the rows that the file is going to hold.
    columns : sequence of Column
        Columns of the file, in their order.
    attributes : mapping of str to str or int
        Attributes of the file that do not follow from the scene and the rows, by their names.
    """
    for name, value in _attributes_of(scene, rows, attributes).items():
        _set(file, name, value)
    axes = {"sample": len(rows)}  # length of each dimension by its name
    if any(column.shape_of for column in columns):
        axes["x"], axes["y"] = scene.grid.shape
    scales = [_add_dimension(file, name, length) for name, length in axes.items()]
    file.create_group(RUNTIME, track_order=True)
    for column in columns:
        shape = column.shape(len(rows), scene.grid.shape)
        dataset = _add_column(file, column, shape)
        # A column of one value a row has only the first dimension.
        for axis, scale in enumerate(scales[: len(shape)]):
            dataset.dims[axis].attach_scale(scale)
        _describe(dataset, column)


def _attributes_of(scene: Scene, rows: range, attributes: Attributes) -> Attributes:
    """Return all attributes of a file that holds some rows of a scene, in the order of the file.

    Some of them follow from the scene and the rows. The other ones are taken from `attributes`, for
    example the versions of libraries, the physics number and the time.
    """
    is_part = rows != range(scene.samples)
    decided: dict[str, str | int] = {
        "Conventions": "CF-1.11",
        "title": scene.title or "Contact of rough surfaces",
    }
    # Names of the Attribute Convention for Data Discovery (ACDD), which spells "license" so.
    if scene.creator:
        decided["creator_name"] = scene.creator
    if scene.licence:
        decided["license"] = scene.licence
    decided["scene"] = scene.text()
    decided["scene_hash"] = scene.fingerprint()
    decided["samples"] = scene.samples
    for name, value in attributes.items():
        # Attributes of an old part are left out: the new file may be whole or have other rows.
        if name not in decided and name not in PART_NUMBERS:
            decided[name] = value
    decided["schema"] = PART if is_part else SCHEMA
    if is_part:
        first_row, number_of_rows = PART_NUMBERS
        decided[first_row] = rows.start
        decided[number_of_rows] = len(rows)
    return decided


def _add_dimension(file: h5py.File, name: str, length: int) -> h5py.Dataset:
    """Add a dimension as netCDF-4 stores it, and return its dataset.

    HDF5 calls this dataset a dimension scale. It has no values, and takes no disk space.
    """
    scale = file.create_dataset(name, shape=(length,), dtype=">f4")
    # By this text, netCDF recognises a dimension without coordinates.
    scale.make_scale(f"This is a netCDF dimension but not a netCDF variable.{length:10d}")
    return scale


def _add_column(file: h5py.File, column: Column, shape: tuple[int, ...]) -> h5py.Dataset:
    """Add the dataset of a column and return it; it has disk space for all rows, but no values."""
    properties = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    properties.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    # HDF5 does not write the fill values itself, because it would crash on a full disk.
    properties.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
    return file.create_dataset(
        column.path,
        shape=shape,
        dtype=column.dtype,
        fillvalue=column.fill,
        dcpl=properties,
    )


def _describe(dataset: h5py.Dataset, column: Column) -> None:
    """Add the attributes of a column to its dataset.

    These are its meaning, its unit, and for a column of codes the meaning of each code. An output
    of a user's function also has its measured powers, see `gen.quantities.Powers`. The attributes
    have the names of the CF conventions, apart from "powers".
    """
    _set(dataset, "long_name", column.long_name)
    if column.unit:
        _set(dataset, "units", column.unit)
    if column.measured and column.powers is not None:
        # Exponents of heights, lengths and E*, in this order, with which the output scales.
        dataset.attrs["powers"] = np.array(column.powers, dtype="i1")
    flags = FLAGS.get(column)  # meaning of each code; None for a column without codes
    if flags:
        dataset.attrs["flag_values"] = np.array(list(flags), dtype=column.dtype)
        # Blanks separate the meanings, so each of them has to be one word.
        words = [_one_word(text) for text in flags.values()]
        _set(dataset, "flag_meanings", " ".join(words))


def _one_word(text: str) -> str:
    """Return a text with its blanks and other signs replaced by underscores.

    Only letters and digits of ASCII are kept. The result is "none" if there are none.
    """
    return re.sub(r"[^A-Za-z0-9]+", "_", text).strip("_") or "none"


def _set(node: h5py.Dataset | h5py.File, name: str, value: str | int) -> None:
    """Add an attribute to a file or to the dataset of a column."""
    # A text gets a fixed length. HDF5 keeps texts of variable length in a heap, and may read
    # endlessly if the heap is damaged.
    if isinstance(value, str):
        text = value.encode()
        # HDF5 has no type of length 0.
        kind = h5py.string_dtype("utf-8", length=max(1, len(text)))
        node.attrs.create(name, text, dtype=kind)
    else:
        node.attrs[name] = value
