"""Databases in the making: create one, resume it, or give it more rows."""

from pathlib import Path
from typing import Literal, NamedTuple

from gen.database.disk import chunks, write_rows
from gen.database.held import HeldFile
from gen.database.layout import fill, identity, lay_out, provenance, read_attributes
from gen.database.making import new_file
from gen.database.opening import checked_for, open_file
from gen.errors import InputError
from gen.scene import Scene
from gen.schema import PHYSICS, columns_for


class Opened(NamedTuple):
    """What `open_or_create` did, and how many rows the file has."""

    how: Literal["created", "resumed", "extended"]
    samples: int


def create(path: Path, scene: Scene) -> None:
    """Create a database with all rows pending; the caller holds `lock(path)`.

    Parameters
    ----------
    path : the file to create
    scene : what its rows are going to be

    Raises
    ------
    InputError
        If the file exists, its folder does not or cannot be written, or the disk is full.
    """
    with new_file(path, scene) as temporary:
        lay_out(temporary, scene, provenance(scene))
        with open_file(temporary, writing=True) as file:
            fill(file, scene, first=0)


def open_or_create(path: Path, scene: Scene, *, force: bool = False) -> Opened:
    """Make a database ready for a run: create, resume or extend it; the caller holds `lock(path)`.

    A file with more rows than asked for keeps them.

    Parameters
    ----------
    path : the database
    scene : what to generate
    force : True to add rows to those of a version of the code that computes other results

    Raises
    ------
    InputError
        If the path cannot be written or holds anything but a database of this scene, layout and
        physics. Nothing is overwritten.
    """
    if not path.exists():
        create(path, scene)
        return Opened("created", scene.samples)
    with open_file(path) as file:
        rows = checked_for(file, path, scene, force=force).samples
        other_physics = int(file.attrs["physics"]) != PHYSICS
    if other_physics:
        with open_file(path, writing=True) as file:
            file.attrs.modify("physics_forced", PHYSICS)
    if scene.samples <= rows:
        return Opened("resumed", rows)
    extend(path, scene, force=force)
    return Opened("extended", scene.samples)


def extend(path: Path, scene: Scene, *, force: bool = False) -> None:
    """Give a database more rows of the same scene; the caller holds `lock(path)`.

    Contiguous datasets cannot grow: the rows are copied into a new file, which then takes the
    name of the old one, its owner, group and mode. A kill at any moment leaves one of the two,
    whole.

    Parameters
    ----------
    path : the database
    scene : its scene, with more samples
    force : see `open_or_create`

    Raises
    ------
    InputError
        If the database is not of this scene, has as many rows already, may not be written or
        replaced, or is being written; if the disk is full.
    """
    with HeldFile(path) as held, open_file(path) as old:
        found = checked_for(old, path, scene, force=force)
        rows = found.samples
        if scene.samples <= rows:
            raise InputError(f"{path} has {rows} samples; to extend it ask for more")
        attributes = read_attributes(old) | identity(scene)
        with new_file(path, scene, replaced=held) as temporary:
            lay_out(temporary, scene, attributes)
            with open_file(temporary, writing=True) as new:
                for column in columns_for(scene.store):
                    for start, stop in chunks(rows, column.row_bytes(scene.surface.nodes)):
                        write_rows(new[column.path], start, old[column.path][start:stop])
                fill(new, scene, first=rows)
