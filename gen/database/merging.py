"""The union of databases whose rows were computed in different places."""

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from gen.database.disk import chunks, write_rows
from gen.database.layout import lay_out, read_attributes
from gen.database.making import new_file
from gen.database.opening import Counts, checked, counts, open_file
from gen.errors import InputError
from gen.lock import lock
from gen.scene import Scene, differences
from gen.schema import STATUS, Status, columns_for


def merge(target: Path, sources: Sequence[Path]) -> Counts:
    """Join databases of one scene whose rows were computed in different places.

    A row that is done anywhere is done in the new file, else failed if it failed anywhere. The
    largest number of samples counts; attributes are those of the first file that has it.

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
        with new_file(target, scene) as temporary:
            lay_out(temporary, scene, attributes)
            with open_file(temporary, writing=True) as file:
                widest = max(
                    column.row_bytes(scene.surface.nodes) for column in columns_for(scene.store)
                )
                for start, stop in chunks(scene.samples, widest):
                    _merge_rows(file, files, scene, start, stop)
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
    target: h5py.File, sources: Mapping[Path, h5py.File], scene: Scene, start: int, stop: int
) -> None:
    """Write the rows start..stop of the target, each from the first source that has it best."""
    paths = list(sources)
    status = np.zeros((len(paths), stop - start), dtype=STATUS.dtype)
    for found, file in zip(status, sources.values(), strict=True):
        part = file[STATUS.path][start:stop]  # a shorter file has fewer rows, or none
        found[: len(part)] = part
    done = status == Status.DONE
    merit = 2 * done + (status == Status.FAILED)
    owner = merit.argmax(axis=0)
    for column in columns_for(scene.store):
        shape = column.shape(stop - start, scene.surface.nodes)
        merged = np.full(shape, column.fill, dtype=column.dtype)
        for index, path in enumerate(paths):
            known = np.flatnonzero(merit[index])
            if not known.size:
                continue
            values = sources[path][column.path][start:stop]
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


def _unequal_rows(left: NDArray[Any], right: NDArray[Any]) -> NDArray[np.bool_]:
    """Tell which rows differ in any bit; equal NaNs are equal."""
    unequal = left.view(np.uint8) != right.view(np.uint8)
    rows: NDArray[np.bool_] = unequal.reshape(len(left), -1).any(axis=1)
    return rows
