"""Make databases: create, extend and merge them, and give new files their names when whole."""

import json
import re
import shutil
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from datetime import UTC, datetime
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal, NamedTuple

import h5py
import numpy as np
from numpy.typing import NDArray

from gen.database.reader import (
    FLAGS,
    PART_NUMBERS,
    SIGNATURE,
    Counts,
    Reader,
    checked,
    chunks,
    has_checksums,
    open_file,
    read_attributes,
    rows_of,
    stored_path,
)
from gen.database.writer import HeldFile, disk_trouble, write_rows
from gen.runtime.errors import InputError
from gen.runtime.files import lock, place_of, unfinished
from gen.runtime.installation import git_commit, versions
from gen.runtime.memory import format_bytes
from gen.runtime.terminal import command_to_type
from gen.scene import Scene, differences, stored_columns
from gen.scene.faults import shown
from gen.schema import CHECKSUM, PART, PHYSICS, RUNTIME, SCHEMA, STATUS, Column, Status

# Version 2 of the superblock: later ones mark a file as open, and a killed writer would leave the
# mark. Creation order is tracked so that readers list columns in the schema's order.
LAYOUT: dict[str, Any] = {"libver": ("v108", "v110"), "track_order": True}


def create(path: Path, scene: Scene, rows: range | None = None) -> None:
    """Create a database of some rows, all pending; the caller holds `lock(path)`."""
    wanted = range(scene.samples) if rows is None else rows
    _assemble(path, scene, wanted, stored_columns(scene), _new_attributes())


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
        Rows of the file.

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
    row = sum(column.row_bytes(scene.grid.shape) for column in columns)
    return of_one_row + (rows - 1) * row


def open_or_create(
    path: Path, scene: Scene, rows: range | None = None, *, force: bool = False
) -> Literal["created", "resumed", "extended"]:
    """Create, resume or extend a database for a run; the caller holds `lock(path)`.

    A file with more rows keeps them; rows between those of a part and the wanted ones become
    pending. With `force` it may have another physics number. To extend it, its rows are copied into
    a new file, as contiguous datasets cannot grow: a kill leaves one of the two, whole.
    """
    wanted = range(scene.samples) if rows is None else rows
    if not path.exists():
        create(path, scene, wanted)
        return "created"
    with HeldFile(path) as held, open_file(path, writing=force) as old:
        present = checked(old, path, scene, force=force)
        attributes = read_attributes(old)
        there = rows_of(attributes)
        if attributes["physics"] != PHYSICS:
            old.attrs.modify("physics_forced", PHYSICS)
            attributes["physics_forced"] = PHYSICS
        rows = range(min(there.start, wanted.start), max(there.stop, wanted.stop))
        if rows == there:
            return "resumed"
        wider = present
        if scene.samples > present.samples:
            wider = scene.with_powers_of(present)
        columns = stored_columns(wider, checksums=has_checksums(old, present))
        part = Part(path, old, there)
        _assemble(path, wider, rows, columns, attributes, [part], replaced=held)
    return "extended"


def merge(target: Path, sources: Sequence[Path]) -> Counts:
    """Merge databases of one scene whose rows were computed in different places.

    A row is done if it is done in any source, otherwise failed if it failed in any; rows that are
    done twice have to agree. Attributes are those of the first source with the most samples.
    Checksums are copied, never computed anew, as they would then vouch for damaged rows: the merged
    database has them if all sources do.
    """
    if not sources:
        raise InputError(f"{target}: nothing to merge; give at least one database")
    with ExitStack() as stack:
        stack.enter_context(lock(target))
        files = {path: stack.enter_context(open_file(path)) for path in sources}
        scenes = {path: checked(file, path) for path, file in files.items()}
        first, *others = files
        for other in others:
            words = f"in {first}", f"in {other}"
            different = differences(scenes[first], scenes[other], words)
            one, two = (int(files[path].attrs["physics"]) for path in (first, other))
            if not different and (
                fault := _differing_powers(scenes[first], scenes[other])
            ):
                different = [fault]
            if not different and one != two:
                different = [f"results of physics {one} and of physics {two}"]
            if different:
                raise InputError(
                    f"{first} and {other} hold different scenes, and are not merged:",
                    different,
                )
        largest = max(scenes, key=lambda path: scenes[path].samples)
        scene = scenes[largest]
        forced = max(int(file.attrs["physics_forced"]) for file in files.values())
        attributes = read_attributes(files[largest]) | {"physics_forced": forced}
        parts = [
            Part(path, file, rows_of(read_attributes(file)))
            for path, file in files.items()
        ]
        checksums = all(has_checksums(file, scenes[path]) for path, file in files.items())
        columns = stored_columns(scene, checksums=checksums)
        _assemble(target, scene, range(scene.samples), columns, attributes, parts)
        with Reader(target) as merged:
            return merged.counts()


def _differing_powers(first: Scene, other: Scene) -> str:
    """Say which output of a user's function was measured to scale differently; "" if none was."""
    one, two = first.store.powers or {}, other.store.powers or {}
    for name in sorted({*one, *two}):
        if one.get(name) != two.get(name):
            return (
                f"store.powers.{name}: {shown(one.get(name))} and {shown(two.get(name))}"
            )
    return ""


class Part(NamedTuple):
    """A source with the rows of the scene that it holds."""

    path: Path
    file: h5py.File
    rows: range

    def read(
        self, column: Column, start: int, stop: int, grid: tuple[int, int]
    ) -> NDArray[Any]:
        """Return the rows start..stop of a column, with fill values for rows that it lacks."""
        values = np.full(
            column.shape(stop - start, grid), column.fill, dtype=column.dtype
        )
        first, last = max(start, self.rows.start), min(stop, self.rows.stop)
        stored = self.file[stored_path(self.file, column)][
            first - self.rows.start : last - self.rows.start
        ]
        values[first - start : last - start] = stored
        return values


def _merge_rows(
    target: h5py.File,
    first: int,
    parts: Sequence[Part],
    columns: Sequence[Column],
    grid: tuple[int, int],
    start: int,
    stop: int,
) -> None:
    """Write the rows start..stop, each from the first part where it is done, or else failed."""
    parts = [part for part in parts if part.rows.start < stop and start < part.rows.stop]
    status = np.array([part.read(STATUS, start, stop, grid) for part in parts])
    done = status == Status.DONE
    merit = 2 * done + (status == Status.FAILED)
    owner = merit.argmax(axis=0) if parts else merit
    for column in sorted(
        columns, key=lambda column: column == CHECKSUM
    ):  # its cause comes first
        merged = np.full(
            column.shape(stop - start, grid), column.fill, dtype=column.dtype
        )
        for index, part in enumerate(parts):
            known = np.flatnonzero(merit[index])
            if not known.size:
                continue
            values = part.read(column, start, stop, grid)
            own = known[owner[known] == index]
            merged[own] = values[own]
            # The owner of a row precedes all other parts in which the row is done.
            shared = np.flatnonzero(done[index] & (owner != index))
            if not column.deterministic or not shared.size:
                continue
            bits = [
                each[shared].view("u1").reshape(shared.size, -1)
                for each in (merged, values)
            ]
            unequal = shared[(bits[0] != bits[1]).any(axis=1)]  # equal NaNs are equal
            if unequal.size:
                other = parts[owner[unequal[0]]].path
                raise _conflict(start + int(unequal[0]), column, other, part.path)
        write_rows(target[column.path], start - first, merged)


def _conflict(row: int, column: Column, one: Path, other: Path) -> InputError:
    """Say why two databases cannot be merged that have other values of a finished row."""
    differs = f"row {row}: {column.name} differs between {one} and {other}"
    for path in (one, other):
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
    attributes: Mapping[str, str | int],
    parts: Sequence[Part] = (),
    *,
    replaced: HeldFile | None = None,
) -> None:
    """Make a file of some rows, pending but for those of parts; rename it when it is whole."""
    real = place_of(path)
    if replaced is None and real.exists():
        raise InputError(f"{path} exists; give another name")
    sizes = [column.row_bytes(scene.grid.shape) for column in columns]
    needed, free = len(rows) * sum(sizes), shutil.disk_usage(real.parent).free
    if needed > free:  # quotas show only on writing
        raise InputError(
            f"{path}: {len(rows)} samples need {format_bytes(needed)}, {format_bytes(free)} are"
            " free; make room, or ask for less"
        )
    trouble = disk_trouble(path, lambda: "nothing was changed")
    with (
        trouble,
        unfinished(real, "replace" if replaced else "refuse", SIGNATURE) as made,
    ):
        old, new = (each.stat() for each in (real if replaced else made, made))
        if (new.st_uid, new.st_gid) != (old.st_uid, old.st_gid):
            raise InputError(
                f"{path} belongs to user {old.st_uid} and group {old.st_gid}: to extend it"
                " would make it yours; let its owner do that, or copy it"
            )
        with h5py.File(made, "w", locking=False, **LAYOUT) as file:
            _lay_out(file, scene, rows, columns, attributes)
        with open_file(made, True) as file:
            for start, stop in chunks(rows.stop, max(sizes), rows.start):
                _merge_rows(
                    file, rows.start, parts, columns, scene.grid.shape, start, stop
                )
        if replaced is not None:
            replaced.check()


def _lay_out(
    file: h5py.File,
    scene: Scene,
    rows: range,
    columns: Sequence[Column],
    attributes: Mapping[str, str | int],
) -> None:
    """Fill a new file with dimensions, attributes, and columns whose rows who calls fills."""
    part = rows != range(scene.samples)
    persons = {"creator_name": scene.creator, "license": scene.licence}  # ACDD's names
    own: dict[str, str | int] = {
        "Conventions": "CF-1.11",
        "title": scene.title or "Contact of rough surfaces",
        **{name: text for name, text in persons.items() if text},
        "scene": scene.text(),
        "scene_hash": scene.fingerprint(),
        "samples": scene.samples,
    }
    own = own | {
        n: each for n, each in attributes.items() if n not in (*own, *PART_NUMBERS)
    }
    own |= {"schema": PART if part else SCHEMA}
    own |= dict(zip(PART_NUMBERS, (rows.start, len(rows)), strict=True)) if part else {}
    for name, value in own.items():
        _set(file, name, value)
    axes = {"sample": len(rows)}
    if any(column.shape_of for column in columns):
        axes |= dict(zip("xy", scene.grid.shape, strict=True))
    dimensions = []
    for name, length in axes.items():  # netCDF-4: a scale without data or disk space
        scale = file.create_dataset(name, shape=(length,), dtype=">f4")
        scale.make_scale(
            f"This is a netCDF dimension but not a netCDF variable.{length:10d}"
        )
        dimensions.append(scale)
    file.create_group(RUNTIME, track_order=True)
    for column in columns:
        properties = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        properties.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
        properties.set_fill_time(
            h5py.h5d.FILL_TIME_NEVER
        )  # it would crash on a full disk
        shape, fill = column.shape(len(rows), scene.grid.shape), column.fill
        dataset = file.create_dataset(
            column.path, shape=shape, dtype=column.dtype, fillvalue=fill, dcpl=properties
        )
        for axis, scale in enumerate(dimensions[: len(shape)]):
            dataset.dims[axis].attach_scale(scale)
        _set(dataset, "long_name", column.long_name)
        if column.unit:
            _set(dataset, "units", column.unit)
        if column.measured and column.powers is not None:
            # of heights, lengths and E*, beside the unit
            dataset.attrs["powers"] = np.array(column.powers, dtype="i1")
        if flags := FLAGS.get(column):
            dataset.attrs["flag_values"] = np.array(list(flags), dtype=column.dtype)
            # CF's list of meanings is separated by blanks: each text has to be one word.
            words = (
                re.sub(r"[^A-Za-z0-9]+", "_", text).strip("_") for text in flags.values()
            )
            _set(dataset, "flag_meanings", " ".join(word or "none" for word in words))


def _set(node: h5py.Dataset | h5py.File, name: str, value: str | int) -> None:
    """Add an attribute; a text has a fixed length."""
    # HDF5 keeps texts of variable length in a heap, and may read for ever if that is damaged.
    if isinstance(value, str):
        data = value.encode()
        node.attrs.create(name, data, dtype=h5py.string_dtype("utf-8", max(1, len(data))))
    else:
        node.attrs[name] = value
