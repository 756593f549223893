"""Merge databases whose rows were computed in different places."""

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np
from numpy.typing import NDArray

from gen.database.disk import chunks, write_rows
from gen.database.inspection import stored_path
from gen.database.layout import fill, lay_out, read_attributes, rows_of
from gen.database.making import new_file
from gen.database.opening import Counts, checked, counts, open_file
from gen.runtime.errors import InputError
from gen.runtime.lock import lock
from gen.scene import Scene, differences
from gen.scene.columns import columns_for
from gen.schema import STATUS, Column, Status


def merge(target: Path, sources: Sequence[Path]) -> Counts:
    """Merge databases of one scene whose rows were computed in different places.

    The new file holds all rows of the scene. A row is done if it is done in any source, otherwise
    failed if it failed in any. The largest number of samples counts; attributes are those of the
    first source that has it.

    Parameters
    ----------
    target : Path
        File to create, which is locked meanwhile.
    sources : sequence of Path
        Databases to merge, whole ones or parts.

    Returns
    -------
    Counts
        Numbers of pending, done and failed rows of the new file.

    Raises
    ------
    InputError
        If the target exists, there are no sources, one cannot be read or is of another scene or
        physics number, a row that is done in two sources differs in a deterministic column, or the
        disk is full.
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
        with new_file(target, scene, range(scene.samples)) as temporary:
            lay_out(temporary, scene, range(scene.samples), attributes)
            with open_file(temporary, writing=True) as merged:
                _merge_parts(merged, parts, scene)
                return counts(merged[STATUS.path])


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


def _merge_parts(target: h5py.File, parts: Sequence[Part], scene: Scene) -> None:
    """Write all rows of the scene into the target, a chunk of rows after the other."""
    widest = max(column.row_bytes(scene.shape) for column in columns_for(scene))
    for start, stop in chunks(scene.samples, widest):
        overlapping = [part for part in parts if part.rows.start < stop and start < part.rows.stop]
        if overlapping:
            _merge_rows(target, overlapping, scene, start, stop)
        else:
            fill(target, scene, start, stop)


def _merge_rows(
    target: h5py.File, parts: Sequence[Part], scene: Scene, start: int, stop: int
) -> None:
    """Write the rows start..stop, each from the first part in which it is done, or else failed."""
    grid = scene.shape
    status = np.stack([part.read(STATUS, start, stop, grid) for part in parts])
    done = status == Status.DONE
    merit = 2 * done + (status == Status.FAILED)
    owner = merit.argmax(axis=0)
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
            unequal = shared[_unequal_rows(merged[shared], values[shared])]
            if unequal.size:
                other = parts[owner[unequal[0]]].path
                raise InputError(
                    f"row {start + unequal[0]}: {column.name} differs between {other} and "
                    f"{part.path}, which other code or another machine must have made: not merged"
                )
        write_rows(target[column.path], start, merged)


def _unequal_rows(left: NDArray[Any], right: NDArray[Any]) -> NDArray[np.bool_]:
    """Tell which rows differ in any bit; equal NaNs are equal."""
    unequal = left.view(np.uint8) != right.view(np.uint8)
    rows: NDArray[np.bool_] = unequal.reshape(len(left), -1).any(axis=1)
    return rows
