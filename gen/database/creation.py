"""Make databases: create, extend and merge them, and give new files their names when whole."""

import os
import re
import shutil
import stat
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any, Literal, NamedTuple

import h5py
import numpy as np
from numpy.typing import NDArray

from gen.database.layout import (
    SIGNATURE,
    chunks,
    identity,
    lay_out,
    provenance,
    read_attributes,
    rows_of,
    stored_path,
    write_rows,
)
from gen.database.reader import Counts, checked, checked_for, counts, open_file
from gen.database.writer import HeldFile, disk_trouble
from gen.runtime.errors import InputError
from gen.runtime.files import lock, place_of, unfinished
from gen.runtime.memory import size
from gen.scene import Scene, columns_for, differences, row_bytes
from gen.schema import PHYSICS, STATUS, Column, Status


class Opened(NamedTuple):
    """What `open_or_create` has done, and the number of rows of the file."""

    how: Literal["created", "resumed", "extended"]
    samples: int


def create(path: Path, scene: Scene, rows: range | None = None) -> None:
    """Create a database of some rows, all pending; the caller holds `lock(path)`."""
    rows = range(scene.samples) if rows is None else rows
    _assemble(path, scene, rows, provenance(scene))


def open_or_create(
    path: Path, scene: Scene, rows: range | None = None, *, force: bool = False
) -> Opened:
    """Create, resume or extend a database for a run; the caller holds `lock(path)`.

    A file with more rows than requested keeps them. With `force` it may have another physics
    number. Nothing is overwritten: an InputError names another scene, layout or physics number.
    """
    wanted = range(scene.samples) if rows is None else rows
    if not path.exists():
        create(path, scene, wanted)
        return Opened("created", len(wanted))
    with open_file(path) as file:
        checked_for(file, path, scene, force=force)
        there = rows_of(read_attributes(file))
        other_physics = int(file.attrs["physics"]) != PHYSICS
    if other_physics:
        with HeldFile(path), open_file(path, writing=True) as file:
            file.attrs.modify("physics_forced", PHYSICS)
    if _hull(there, wanted) == there:
        return Opened("resumed", len(there))
    return Opened("extended", len(extend(path, scene, wanted, force=force)))


def extend(path: Path, scene: Scene, rows: range | None = None, *, force: bool = False) -> range:
    """Give a database more rows of the same scene; the caller holds `lock(path)`.

    Contiguous datasets cannot grow, so the rows are copied into a new file, which then takes name,
    owner, group and mode of the old one. A kill at any moment leaves one of the two files, whole.
    Rows between those of a part and the requested ones are added as pending.
    """
    with HeldFile(path) as held, open_file(path) as old:
        present = checked_for(old, path, scene, force=force)
        attributes = read_attributes(old)
        old_rows = rows_of(attributes)
        rows = _hull(old_rows, range(scene.samples) if rows is None else rows)
        if rows == old_rows:
            raise InputError(f"{path} has {len(old_rows)} samples; to extend it ask for more")
        wider = scene if scene.samples > present.samples else present
        part = Part(path, old, old_rows)
        _assemble(path, wider, rows, attributes | identity(wider), [part], replaced=held)
    return rows


def _hull(one: range, other: range) -> range:
    """Return the smallest range that contains two ranges."""
    return range(min(one.start, other.start), max(one.stop, other.stop))


def merge(target: Path, sources: Sequence[Path]) -> Counts:
    """Merge databases of one scene whose rows were computed in different places.

    The new file holds all rows of the scene. A row is done if it is done in any source, otherwise
    failed if it failed in any; rows that are done twice have to agree. The largest number of
    samples counts; attributes are those of the first source that has it.
    """
    if not sources:
        raise InputError(f"{target}: nothing to merge; give at least one database")
    with ExitStack() as stack:
        stack.enter_context(lock(target))
        files = {path: stack.enter_context(open_file(path)) for path in sources}
        scenes = {path: checked(file, path) for path, file in files.items()}
        _refuse_unequal(files, scenes)
        largest = max(scenes, key=lambda path: scenes[path].samples)
        scene = scenes[largest]
        forced = max(int(file.attrs["physics_forced"]) for file in files.values())
        attributes = read_attributes(files[largest]) | {"physics_forced": forced}
        parts = [Part(path, file, rows_of(read_attributes(file))) for path, file in files.items()]
        return _assemble(target, scene, range(scene.samples), attributes, parts)


class Part(NamedTuple):
    """A source with the rows of the scene that it holds."""

    path: Path
    file: h5py.File
    rows: range

    def read(self, column: Column, start: int, stop: int, grid: tuple[int, int]) -> NDArray[Any]:
        """Return the rows start..stop of a column, with fill values for rows that it lacks."""
        values = np.full(column.shape(stop - start, grid), column.fill, dtype=column.dtype)
        first, last = max(start, self.rows.start), min(stop, self.rows.stop)
        stored = self.file[stored_path(self.file, column)][
            first - self.rows.start : last - self.rows.start
        ]
        values[first - start : last - start] = stored
        return values


def _refuse_unequal(files: Mapping[Path, h5py.File], scenes: Mapping[Path, Scene]) -> None:
    """Refuse files of different scenes or physics numbers."""
    first, *others = files
    for other in others:
        if different := differences(scenes[first], scenes[other]):
            changes = "; ".join(different)
            raise InputError(f"{first} and {other} hold different scenes ({changes}): not merged")
        physics = [int(files[path].attrs["physics"]) for path in (first, other)]
        if physics[0] != physics[1]:
            raise InputError(
                f"{first} holds results of physics {physics[0]}, {other} of physics {physics[1]}: "
                "not merged"
            )


def _merge_rows(
    target: h5py.File, first: int, parts: Sequence[Part], scene: Scene, start: int, stop: int
) -> None:
    """Write the rows start..stop, each from the first part in which it is done, or else failed.

    `first` is the first row of the target.
    """
    grid = scene.shape
    parts = [part for part in parts if part.rows.start < stop and start < part.rows.stop]
    status = np.array([part.read(STATUS, start, stop, grid) for part in parts])
    done = status == Status.DONE
    merit = 2 * done + (status == Status.FAILED)
    owner = merit.argmax(axis=0) if parts else merit
    for column in columns_for(scene):
        merged = np.full(column.shape(stop - start, grid), column.fill, dtype=column.dtype)
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
            bits = [each[shared].view("u1").reshape(shared.size, -1) for each in (merged, values)]
            unequal = shared[(bits[0] != bits[1]).any(axis=1)]  # equal NaNs are equal
            if unequal.size:
                other = parts[owner[unequal[0]]].path
                raise InputError(
                    f"row {start + unequal[0]}: {column.name} differs between {other} and "
                    f"{part.path}, which other code or another machine must have made: not merged"
                )
        write_rows(target[column.path], start - first, merged)


def _assemble(
    path: Path,
    scene: Scene,
    rows: range,
    attributes: Mapping[str, str | int],
    parts: Sequence[Part] = (),
    *,
    replaced: HeldFile | None = None,
) -> Counts:
    """Make a file of some rows beside a database, and rename it to the database when it is whole.

    Its name, `X.h5.0123456789abcdef.part`, is drawn at random. The next attempt, which holds the
    same lock, removes the remains of a killed one. `replaced` is the file of this name that may be
    replaced; without it there must be none. Rows that no part has are pending.
    """
    real = place_of(path)
    if replaced is None and real.exists():
        raise InputError(f"{path} exists; give another name")
    try:
        _remove_leftovers(real)
        _require_room(path, scene, len(rows))
        with unfinished(real, "refuse" if replaced is None else "replace", ".part") as made:
            if replaced is not None:
                _require_owner(path, real.stat(), made.stat())
            lay_out(made, scene, rows, attributes)
            with open_file(made, writing=True) as file:
                widest = max(column.row_bytes(scene.shape) for column in columns_for(scene))
                for start, stop in chunks(rows.stop, widest, rows.start):
                    _merge_rows(file, rows.start, parts, scene, start, stop)
                counted = counts(file[STATUS.path])
            if replaced is not None:
                replaced.check()
    except FileExistsError:
        raise InputError(f"{path} has appeared meanwhile; give another name") from None
    except (OSError, RuntimeError, ValueError) as error:
        trouble = disk_trouble(error)
        if trouble is None:
            raise
        raise InputError(f"{path}: {trouble}; nothing was changed") from None
    return counted


def _require_owner(path: Path, old: os.stat_result, new: os.stat_result) -> None:
    """Refuse to replace a file whose owner and group this user cannot pass on."""
    if (new.st_uid, new.st_gid) != (old.st_uid, old.st_gid):
        raise InputError(
            f"{path} belongs to user {old.st_uid} and group {old.st_gid}: to extend it would make"
            " it yours; let its owner do that, or copy it"
        )


def _remove_leftovers(real: Path) -> None:
    """Remove the remains of killed attempts, but no user's file with a similar name."""
    own = re.compile(re.escape(real.name) + r"\.[0-9a-f]{16}\.part")
    for path in real.parent.iterdir():
        if own.fullmatch(path.name) and stat.S_ISREG(path.lstat().st_mode):
            with suppress(PermissionError), path.open("rb") as file:
                if file.read(len(SIGNATURE)) in {SIGNATURE, b""}:
                    path.unlink()


def _require_room(path: Path, scene: Scene, rows: int) -> None:
    """Refuse a file that is larger than the free disk space; quotas show only on writing."""
    needed = rows * row_bytes(scene)
    free = shutil.disk_usage(path.resolve().parent).free
    if needed > free:
        raise InputError(
            f"{path}: {rows} samples need {size(needed)}, {size(free)} are free; make"
            " room, or ask for less"
        )
