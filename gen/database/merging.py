"""The union of databases whose rows were computed in different places."""

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from gen.database.disk import chunks, write_rows
from gen.database.layout import fill, lay_out, read_attributes, rows_of
from gen.database.making import new_file
from gen.database.opening import Counts, checked, counts, open_file
from gen.runtime.errors import InputError
from gen.runtime.lock import lock
from gen.scene import Scene, differences
from gen.schema import STATUS, Column, Status, columns_for


def merge(target: Path, sources: Sequence[Path]) -> Counts:
    """Join databases of one scene whose rows were computed in different places.

    Parts say which rows they hold; the new file holds all rows of the scene. A row that is done
    anywhere is done in it, else failed if it failed anywhere. The largest number of samples counts;
    attributes are those of the first file that has it.

    Parameters
    ----------
    target : the file to create, locked meanwhile
    sources : the databases

    Returns
    -------
    How many rows are pending, done and failed in the new file

    Raises
    ------
    InputError
        If the target exists, there are no sources, one cannot be read or is of another scene or
        physics, a row that is done in two files differs in a deterministic column, or the disk is
        full.
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
        rows = range(scene.samples)
        with new_file(target, scene, rows) as temporary:
            lay_out(temporary, scene, rows, attributes)
            with open_file(temporary, writing=True) as file:
                widest = max(column.row_bytes(scene.surface.nodes) for column in columns_for(scene))
                held = {path: rows_of(read_attributes(each)) for path, each in files.items()}
                for start, stop in chunks(scene.samples, widest):
                    here = {
                        path: (files[path], own)
                        for path, own in held.items()
                        if own.start < stop and start < own.stop
                    }
                    if here:
                        _merge_rows(file, here, scene, start, stop)
                    else:
                        fill(file, scene, start, stop)
                return counts(file[STATUS.path])


def _refuse_unequal(files: Mapping[Path, h5py.File], scenes: Mapping[Path, Scene]) -> None:
    """Raise InputError unless all files are of one scene and physics."""
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
    target: h5py.File,
    sources: Mapping[Path, tuple[h5py.File, range]],
    scene: Scene,
    start: int,
    stop: int,
) -> None:
    """Write the rows start..stop of the target, each from the first source that has it best.

    Parameters
    ----------
    target : the file to write
    sources : open files with some of these rows, and the rows that each holds
    scene : of all of them
    start, stop : first row, and one past the last
    """
    paths = list(sources)
    nodes = scene.surface.nodes
    status = np.stack([_stored(STATUS, *source, start, stop, nodes) for source in sources.values()])
    done = status == Status.DONE
    merit = 2 * done + (status == Status.FAILED)
    owner = merit.argmax(axis=0)
    for column in columns_for(scene):
        merged = np.full(column.shape(stop - start, nodes), column.fill, dtype=column.dtype)
        for index, path in enumerate(paths):
            known = np.flatnonzero(merit[index])
            if not known.size:
                continue
            values = _stored(column, *sources[path], start, stop, nodes)
            own = known[owner[known] == index]
            merged[own] = values[own]
            # An owner comes before all other files in which the row is done: it is in place.
            shared = np.flatnonzero(done[index] & (owner != index))
            if column.deterministic and shared.size:
                unequal = shared[_unequal_rows(merged[shared], values[shared])]
                if unequal.size:
                    other = paths[owner[unequal[0]]]
                    raise InputError(
                        f"row {start + unequal[0]}: {column.name} differs between {other} and "
                        f"{path}, which other code or another machine must have made: not merged"
                    )
        write_rows(target[column.path], start, merged)


def _stored(
    column: Column, file: h5py.File, own: range, start: int, stop: int, nodes: int
) -> NDArray[Any]:
    """Rows start..stop of a column; filled as pending rows are where the file has none of them."""
    values = np.full(column.shape(stop - start, nodes), column.fill, dtype=column.dtype)
    first, last = max(start, own.start), min(stop, own.stop)
    values[first - start : last - start] = file[column.path][first - own.start : last - own.start]
    return values


def _unequal_rows(left: NDArray[Any], right: NDArray[Any]) -> NDArray[np.bool_]:
    """Tell which rows differ in any bit; equal NaNs are equal."""
    unequal = left.view(np.uint8) != right.view(np.uint8)
    rows: NDArray[np.bool_] = unequal.reshape(len(left), -1).any(axis=1)
    return rows
