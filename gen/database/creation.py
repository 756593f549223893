"""Databases in the making: create one, resume it, or give it more rows."""

from pathlib import Path
from typing import Literal, NamedTuple

from gen.database.disk import chunks, write_rows
from gen.database.held import HeldFile
from gen.database.layout import fill, identity, lay_out, provenance, read_attributes, rows_of
from gen.database.making import new_file
from gen.database.opening import checked_for, open_file
from gen.runtime.errors import InputError
from gen.scene import Scene
from gen.schema import PHYSICS, columns_for


class Opened(NamedTuple):
    """What `open_or_create` did, and how many rows the file has."""

    how: Literal["created", "resumed", "extended"]
    samples: int


def create(path: Path, scene: Scene, rows: range | None = None) -> None:
    """Create a database with all rows pending; the caller holds `lock(path)`.

    Parameters
    ----------
    path : the file to create
    scene : what its rows are going to be
    rows : those of the scene that it holds, None for all; a job array's share makes a part

    Raises
    ------
    InputError
        If the file exists, its folder does not or cannot be written, or the disk is full.
    """
    rows = range(scene.samples) if rows is None else rows
    with new_file(path, scene, rows) as temporary:
        lay_out(temporary, scene, rows, provenance(scene))
        with open_file(temporary, writing=True) as file:
            fill(file, scene, 0, len(rows))


def open_or_create(
    path: Path, scene: Scene, rows: range | None = None, *, force: bool = False
) -> Opened:
    """Make a database ready for a run: create, resume or extend it; the caller holds `lock(path)`.

    A file with more rows than asked for keeps them.

    Parameters
    ----------
    path : the database
    scene : what to generate
    rows : those of the scene that the file has to hold, None for all
    force : True to add rows to those of a version of the code that computes other results

    Raises
    ------
    InputError
        If the path cannot be written or holds anything but a database of this scene, layout and
        physics. Nothing is overwritten.
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
        with open_file(path, writing=True) as file:
            file.attrs.modify("physics_forced", PHYSICS)
    if _hull(there, wanted) == there:
        return Opened("resumed", len(there))
    return Opened("extended", len(extend(path, scene, wanted, force=force)))


def extend(path: Path, scene: Scene, rows: range | None = None, *, force: bool = False) -> range:
    """Give a database more rows of the same scene; the caller holds `lock(path)`.

    Contiguous datasets cannot grow: the rows are copied into a new file, which then takes the
    name of the old one, its owner, group and mode. A kill at any moment leaves one of the two,
    whole. Rows between those that a part holds and those that are asked for come in as pending.

    Parameters
    ----------
    path : the database
    scene : its scene, perhaps with more samples
    rows : those that it has to hold too, None for all
    force : see `open_or_create`

    Returns
    -------
    The rows that it holds now

    Raises
    ------
    InputError
        If the database is not of this scene, has these rows already, may not be written or
        replaced, or is being written; if the disk is full.
    """
    with HeldFile(path) as held, open_file(path) as old:
        found = checked_for(old, path, scene, force=force)
        attributes = read_attributes(old)
        there = rows_of(attributes)
        rows = _hull(there, range(scene.samples) if rows is None else rows)
        if rows == there:
            raise InputError(f"{path} has {len(there)} samples; to extend it ask for more")
        wider = scene if scene.samples > found.samples else found
        place = there.start - rows.start
        with new_file(path, wider, rows, replaced=held) as temporary:
            lay_out(temporary, wider, rows, attributes | identity(wider))
            with open_file(temporary, writing=True) as new:
                for column in columns_for(wider):
                    for start, stop in chunks(len(there), column.row_bytes(wider.surface.nodes)):
                        write_rows(new[column.path], place + start, old[column.path][start:stop])
                fill(new, wider, 0, place)
                fill(new, wider, place + len(there), len(rows))
    return rows


def _hull(one: range, other: range) -> range:
    """The smallest range that holds two."""
    return range(min(one.start, other.start), max(one.stop, other.stop))
