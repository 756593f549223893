"""Make databases: create, extend and merge them, and give new files their names when whole."""

import json
import re
import shutil
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal

import h5py
import numpy as np
from numpy.typing import NDArray

from gen.arrays import Indices
from gen.database.opening import (
    PART_NUMBERS,
    SIGNATURE,
    has_checksums,
    open_file,
    read_attributes,
    read_scene,
    require_scene,
    rows_of,
    stored_path,
)
from gen.database.reader import FLAGS, Counts, Reader, chunks
from gen.database.writer import HeldFile, disk_trouble, write_rows
from gen.runtime.errors import InputError
from gen.runtime.files import Present, lock, place_of, unfinished
from gen.runtime.installation import git_commit, versions
from gen.runtime.memory import format_bytes
from gen.runtime.terminal import command_to_type
from gen.scene import Scene, differences, stored_columns
from gen.scene.faults import shown
from gen.schema import CHECKSUM, PART, PHYSICS, RUNTIME, SCHEMA, STATUS, Column, Status

LAYOUT: dict[str, Any] = {"libver": ("v108", "v110"), "track_order": True}
"""Settings of new HDF5 files.

Version 2 of the superblock: later ones mark a file as open, and a killed writer would leave the
mark. Creation order is tracked so that readers list columns in the schema's order.
"""

Attributes = Mapping[str, str | int]
"""Attributes of a file by their names, as `gen.database.opening.read_attributes` returns them."""


@dataclass(frozen=True, eq=False)
class Source:
    """An open database whose rows are copied into a new file."""

    path: Path
    file: h5py.File
    scene: Scene
    rows: range  # numbers of the rows that it holds

    @classmethod
    def of(cls, path: Path, file: h5py.File) -> "Source":
        """Check an open database, and read its scene and its rows."""
        return cls(path, file, read_scene(file, path), rows_of(read_attributes(file)))

    @property
    def physics(self) -> int:
        """Number of its results."""
        return int(self.file.attrs["physics"])

    def read(self, column: Column, rows: range) -> NDArray[Any]:
        """Read rows of a column, some of which the source holds; fill values stand for the others.

        Parameters
        ----------
        column : Column
            A column of the source.
        rows : range
            Numbers of the rows.

        Returns
        -------
        ndarray, shape (rows,) or (rows, nx, ny)
            Values of the rows.
        """
        values = _unwritten(column, len(rows), self.scene)
        first = max(rows.start, self.rows.start)
        last = min(rows.stop, self.rows.stop)
        dataset = self.file[stored_path(self.file, column)]
        stored = dataset[first - self.rows.start : last - self.rows.start]
        values[first - rows.start : last - rows.start] = stored
        return values


@dataclass(frozen=True, eq=False)
class _Claims:
    """Which of the sources have finished which rows of a chunk, and whose values are taken."""

    sources: Sequence[Source]  # those that hold some of the rows
    rows: range  # numbers of the rows of the chunk
    done: NDArray[np.bool_]  # (sources, rows), whether a source has solved a row
    finished: NDArray[np.bool_]  # (sources, rows), solved or failed
    owner: Indices  # (rows,), index of the source whose values are taken


def create(path: Path, scene: Scene, rows: range | None = None) -> None:
    """Create a database whose rows are pending.

    Parameters
    ----------
    path : Path
        The new file, whose `gen.database.lock` the caller holds.
    scene : Scene
        The completed scene.
    rows : range, optional
        Numbers of the rows that the file holds, all rows of the scene by default; fewer rows make
        a part.

    Raises
    ------
    InputError
        If the file exists, or the disk has no room for it.
    """
    if rows is None:
        rows = range(scene.samples)
    _assemble(path, scene, rows, stored_columns(scene), _new_attributes())


def _new_attributes() -> dict[str, str | int]:
    """Return the attributes of a new file: numbers of its layout and results, versions, time."""
    numerics = versions(("asperity", "numpy", "scipy", "pyfftw", "h5py"))
    return {
        "schema": SCHEMA,
        "physics": PHYSICS,
        "physics_forced": 0,
        "versions": json.dumps(numerics | {"hdf5": h5py.version.hdf5_version}),
        "git_commit": git_commit(),
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def file_bytes(scene: Scene, rows: int) -> int:
    """Return the size of a database's file before anything of it is written.

    A temporary file of one row is laid out, for the size of names, units and the scene.

    Parameters
    ----------
    scene : Scene
        The completed scene.
    rows : int
        Number of rows of the file.

    Returns
    -------
    int
        Size of the file [bytes]. Further rows may need a few bytes more for alignment.
    """
    columns = stored_columns(scene)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "one-row.h5"
        with h5py.File(path, "w", locking=False, **LAYOUT) as file:
            _lay_out(file, scene, range(1), columns, _new_attributes())
        of_one_row = path.stat().st_size
    row_bytes = sum(column.row_bytes(scene.grid.shape) for column in columns)
    return of_one_row + (rows - 1) * row_bytes


def open_or_create(
    path: Path, scene: Scene, rows: range | None = None, *, force: bool = False
) -> Literal["created", "resumed", "extended"]:
    """Create, resume or extend a database, so that a run can write some rows.

    A file with more rows keeps them; rows between those of a part and the wanted rows become
    pending. A file is extended by a copy of its rows in a new file, as contiguous datasets cannot
    grow: a kill leaves the old file or the new one, whole.

    Parameters
    ----------
    path : Path
        The database, which need not exist. The caller holds its `gen.database.lock`.
    scene : Scene
        The completed scene.
    rows : range, optional
        Numbers of the rows that the run wants, all rows of the scene by default.
    force : bool
        Whether the file may have another physics number. It records then that rows of this
        version's number are among its rows.

    Returns
    -------
    str
        What was done: "created", "resumed" or "extended".

    Raises
    ------
    InputError
        If the file is no database of the scene, cannot be written, or the disk has no room for it.
    """
    if rows is None:
        rows = range(scene.samples)
    if not path.exists():
        create(path, scene, rows)
        return "created"
    with HeldFile(path) as held, open_file(path, writing=force) as file:
        source = Source.of(path, file)
        require_scene(file, path, source.scene, scene, force=force)
        attributes = read_attributes(file)
        if attributes["physics"] != PHYSICS:
            file.attrs.modify("physics_forced", PHYSICS)
            attributes["physics_forced"] = PHYSICS
        extended = range(
            min(source.rows.start, rows.start), max(source.rows.stop, rows.stop)
        )
        if extended == source.rows:
            return "resumed"
        recorded = source.scene
        if scene.samples > recorded.samples:
            recorded = scene.with_powers_of(recorded)
        checksums = has_checksums(file, source.scene)
        columns = stored_columns(recorded, checksums=checksums)
        _assemble(path, recorded, extended, columns, attributes, [source], replaced=held)
    return "extended"


def merge(target: Path, sources: Sequence[Path]) -> Counts:
    """Merge databases of one scene whose rows were computed in different places.

    A row is done if it is done in any source, otherwise failed if it failed in any; rows that are
    done twice have to agree. Attributes are those of the first source with the most samples.
    Checksums are copied, never computed anew, as they would then vouch for damaged rows: the merged
    database has them if all sources do.

    Parameters
    ----------
    target : Path
        The new database. Its lock is held during the call.
    sources : sequence of Path
        Databases, at least one; parts may overlap and leave gaps.

    Returns
    -------
    Counts
        Numbers of pending, done and failed rows of the merged database.

    Raises
    ------
    InputError
        If the sources are of different scenes or results, or differ in a row that is done; if the
        target exists, or the disk has no room for it.
    """
    if not sources:
        raise InputError(f"{target}: nothing to merge; give at least one database")
    with ExitStack() as stack:
        stack.enter_context(lock(target))
        files = {path: stack.enter_context(open_file(path)) for path in sources}
        opened = [Source.of(path, file) for path, file in files.items()]
        for source in opened[1:]:
            _require_mergeable(opened[0], source)
        largest = max(opened, key=lambda source: source.scene.samples)
        scene = largest.scene
        attributes = read_attributes(largest.file)
        attributes["physics_forced"] = max(
            int(source.file.attrs["physics_forced"]) for source in opened
        )
        checksums = all(has_checksums(source.file, source.scene) for source in opened)
        columns = stored_columns(scene, checksums=checksums)
        _assemble(target, scene, range(scene.samples), columns, attributes, opened)
        with Reader(target) as merged:
            return merged.counts()


def _require_mergeable(first: Source, second: Source) -> None:
    """Refuse two databases whose scenes, measured powers or physics numbers differ."""
    words = f"in {first.path}", f"in {second.path}"
    different = differences(first.scene, second.scene, words)
    if not different:
        different = _differing_powers(first.scene, second.scene)
    if not different and first.physics != second.physics:
        different = [
            f"results of physics {first.physics} and of physics {second.physics}"
        ]
    if different:
        raise InputError(
            f"{first.path} and {second.path} hold different scenes, and are not merged:",
            different,
        )


def _differing_powers(first: Scene, second: Scene) -> list[str]:
    """Name the first output of a user's function that was measured to scale differently, if any."""
    powers_of_first = first.store.powers or {}
    powers_of_second = second.store.powers or {}
    for name in sorted({*powers_of_first, *powers_of_second}):
        in_first = powers_of_first.get(name)
        in_second = powers_of_second.get(name)
        if in_first != in_second:
            return [f"store.powers.{name}: {shown(in_first)} and {shown(in_second)}"]
    return []


def _merge_rows(
    file: h5py.File,
    first: int,
    rows: range,
    sources: Sequence[Source],
    columns: Sequence[Column],
    scene: Scene,
) -> None:
    """Write rows of a new file whose first row is `first`, in all columns.

    The values of a row are those of the first source in which it is done, or else of the first one
    in which it failed; a row that no source has finished gets fill values.
    """
    claims = _claims_on(rows, sources)
    # A difference in a column also changes the checksum: the column is to be named, and is first.
    for column in sorted(columns, key=lambda column: column == CHECKSUM):
        values = _merged(column, claims, scene)
        write_rows(file[column.path], rows.start - first, values)


def _claims_on(rows: range, sources: Sequence[Source]) -> _Claims:
    """Read the statuses of some rows in all sources, and decide whose values are taken."""
    overlapping = [
        source
        for source in sources
        if source.rows.start < rows.stop and rows.start < source.rows.stop
    ]
    status = np.empty((len(overlapping), len(rows)), dtype=np.uint8)
    for index, source in enumerate(overlapping):
        status[index] = source.read(STATUS, rows)
    done = status == Status.DONE
    failed = status == Status.FAILED
    owner = np.zeros(len(rows), dtype=np.int64)
    if overlapping:
        owner = (2 * done + failed).argmax(axis=0)  # the first one with the best status
    return _Claims(overlapping, rows, done, done | failed, owner)


def _merged(column: Column, claims: _Claims, scene: Scene) -> NDArray[Any]:
    """Return the merged values of a column; refuse rows that are done twice and differ."""
    merged = _unwritten(column, len(claims.rows), scene)
    for index, source in enumerate(claims.sources):
        if not claims.finished[index].any():
            continue
        values = source.read(column, claims.rows)
        is_owner = claims.owner == index
        owned = np.flatnonzero(claims.finished[index] & is_owner)
        merged[owned] = values[owned]
        # The owner of a row precedes all other sources in which the row is done.
        repeated = np.flatnonzero(claims.done[index] & ~is_owner)
        if not column.deterministic or not repeated.size:
            continue
        unequal = repeated[_differ(merged[repeated], values[repeated])]
        if unequal.size:
            position = int(unequal[0])
            owner = claims.sources[claims.owner[position]]
            row = claims.rows.start + position
            raise _conflict(row, column, owner.path, source.path)
    return merged


def _unwritten(column: Column, rows: int, scene: Scene) -> NDArray[Any]:
    """Return an array of rows of a column that have not been written: fill values."""
    return np.full(column.shape(rows, scene.grid.shape), column.fill, dtype=column.dtype)


def _differ(first: NDArray[Any], second: NDArray[Any]) -> NDArray[np.bool_]:
    """Tell of each row whether two arrays differ in any bit; NaNs of the same bits are equal."""
    rows = len(first)
    bytes_of_first = first.view("u1").reshape(rows, -1)
    bytes_of_second = second.view("u1").reshape(rows, -1)
    unequal: NDArray[np.bool_] = (bytes_of_first != bytes_of_second).any(axis=1)
    return unequal


def _conflict(row: int, column: Column, first: Path, second: Path) -> InputError:
    """Return the error for two databases that have different values of a finished row."""
    differs = f"row {row}: {column.name} differs between {first} and {second}"
    for path in (first, second):
        with Reader(path) as reader:
            if reader.damaged_rows(row, row + 1).size:
                repair = command_to_type(f"gen check {path} --repair")
                return InputError(
                    f"{differs}, and is damaged in {path}: {repair} makes it pending"
                )
    return InputError(
        f"{differs}, which other code or another machine must have made: not merged"
    )


def _assemble(
    path: Path,
    scene: Scene,
    rows: range,
    columns: Sequence[Column],
    attributes: Attributes,
    sources: Sequence[Source] = (),
    *,
    replaced: HeldFile | None = None,
) -> None:
    """Make a file of some rows, and give it its name when it is whole.

    Rows that no source has finished are pending. The file replaces the one that is held, if there
    is one, and is refused if a file has the name otherwise.
    """
    target = place_of(path)
    present: Present = "refuse"
    if replaced is not None:
        present = "replace"
    elif target.exists():
        raise InputError(f"{path} exists; give another name")
    row_bytes = [column.row_bytes(scene.grid.shape) for column in columns]
    _require_room(path, target.parent, len(rows), sum(row_bytes))
    trouble = disk_trouble(path, lambda: "nothing was changed")
    with trouble, unfinished(target, present, SIGNATURE) as temporary:
        if replaced is not None:
            _require_owner(path, target, temporary)
        with h5py.File(temporary, "w", locking=False, **LAYOUT) as file:
            _lay_out(file, scene, rows, columns, attributes)
        with open_file(temporary, True) as file:
            for start, stop in chunks(rows, max(row_bytes)):
                chunk = range(start, stop)
                _merge_rows(file, rows.start, chunk, sources, columns, scene)
        if replaced is not None:
            replaced.check()


def _require_room(path: Path, folder: Path, rows: int, row_bytes: int) -> None:
    """Refuse a file of some rows that the disk of a folder has no room for; quotas show later."""
    needed = rows * row_bytes
    free = shutil.disk_usage(folder).free
    if needed > free:
        raise InputError(
            f"{path}: {rows} samples need {format_bytes(needed)}, {format_bytes(free)} are"
            " free; make room, or ask for less"
        )


def _require_owner(path: Path, target: Path, temporary: Path) -> None:
    """Refuse to replace a file whose owner and group a new file cannot have."""
    old = target.stat()
    new = temporary.stat()
    if (new.st_uid, new.st_gid) != (old.st_uid, old.st_gid):
        raise InputError(
            f"{path} belongs to user {old.st_uid} and group {old.st_gid}: to extend it"
            " would make it yours; let its owner do that, or copy it"
        )


def _lay_out(
    file: h5py.File,
    scene: Scene,
    rows: range,
    columns: Sequence[Column],
    attributes: Attributes,
) -> None:
    """Write the attributes, dimensions and columns of a new file, whose rows are not filled."""
    for name, value in _attributes_of(scene, rows, attributes).items():
        _set(file, name, value)
    axes = {"sample": len(rows)}
    if any(column.shape_of for column in columns):
        axes["x"], axes["y"] = scene.grid.shape
    scales = [_add_dimension(file, name, length) for name, length in axes.items()]
    file.create_group(RUNTIME, track_order=True)
    for column in columns:
        shape = column.shape(len(rows), scene.grid.shape)
        dataset = _add_column(file, column, shape)
        for axis, scale in enumerate(scales[: len(shape)]):
            dataset.dims[axis].attach_scale(scale)
        _describe(dataset, column)


def _attributes_of(scene: Scene, rows: range, attributes: Attributes) -> Attributes:
    """Return the attributes of a file that holds some rows of a scene, in the order of the file.

    Those given (versions, numbers, time) yield to what the scene and the rows decide.
    """
    is_part = rows != range(scene.samples)
    decided: dict[str, str | int] = {
        "Conventions": "CF-1.11",
        "title": scene.title or "Contact of rough surfaces",
    }
    # The names of the Attribute Convention for Data Discovery (ACDD).
    if scene.creator:
        decided["creator_name"] = scene.creator
    if scene.licence:
        decided["license"] = scene.licence
    decided["scene"] = scene.text()
    decided["scene_hash"] = scene.fingerprint()
    decided["samples"] = scene.samples
    for name, value in attributes.items():
        if name not in decided and name not in PART_NUMBERS:
            decided[name] = value
    decided["schema"] = PART if is_part else SCHEMA
    if is_part:
        decided |= dict(zip(PART_NUMBERS, (rows.start, len(rows)), strict=True))
    return decided


def _add_dimension(file: h5py.File, name: str, length: int) -> h5py.Dataset:
    """Add a dimension of netCDF-4, a scale without values or disk space, and return the scale."""
    scale = file.create_dataset(name, shape=(length,), dtype=">f4")
    scale.make_scale(f"This is a netCDF dimension but not a netCDF variable.{length:10d}")
    return scale


def _add_column(file: h5py.File, column: Column, shape: tuple[int, ...]) -> h5py.Dataset:
    """Add the dataset of a column, with disk space for all rows, and return it."""
    properties = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    properties.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    # HDF5 itself would crash on a full disk while it fills the dataset.
    properties.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
    return file.create_dataset(
        column.path,
        shape=shape,
        dtype=column.dtype,
        fillvalue=column.fill,
        dcpl=properties,
    )


def _describe(dataset: h5py.Dataset, column: Column) -> None:
    """Add the attributes of a column: its meaning and unit, measured powers, meanings of codes."""
    _set(dataset, "long_name", column.long_name)
    if column.unit:
        _set(dataset, "units", column.unit)
    if column.measured and column.powers is not None:
        # of heights, lengths and E*
        dataset.attrs["powers"] = np.array(column.powers, dtype="i1")
    flags = FLAGS.get(column)
    if flags:
        dataset.attrs["flag_values"] = np.array(list(flags), dtype=column.dtype)
        # CF's list of meanings is separated by blanks: each text has to be one word.
        words = [_one_word(text) for text in flags.values()]
        _set(dataset, "flag_meanings", " ".join(words))


def _one_word(text: str) -> str:
    """Return a text as one word of letters, digits and underscores; "none" if it has no letter."""
    return re.sub(r"[^A-Za-z0-9]+", "_", text).strip("_") or "none"


def _set(node: h5py.Dataset | h5py.File, name: str, value: str | int) -> None:
    """Add an attribute to a file or a column; a text has a fixed length."""
    # HDF5 keeps texts of variable length in a heap, and may read for ever if that is damaged.
    if isinstance(value, str):
        text = value.encode()
        kind = h5py.string_dtype("utf-8", max(1, len(text)))
        node.attrs.create(name, text, dtype=kind)
    else:
        node.attrs[name] = value
