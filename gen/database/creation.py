"""Create a database, resume it, or give it more rows."""

from pathlib import Path
from typing import Literal, NamedTuple

from gen.database.disk import chunks, write_rows
from gen.database.held import HeldFile
from gen.database.inspection import stored_path
from gen.database.layout import fill, identity, lay_out, provenance, read_attributes, rows_of
from gen.database.making import new_file
from gen.database.opening import checked_for, open_file
from gen.runtime.errors import InputError
from gen.scene import Scene
from gen.scene.columns import columns_for, physics_of


class Opened(NamedTuple):
    """The outcome of `open_or_create`.

    Attributes
    ----------
    how : {"created", "resumed", "extended"}
        Action that was taken.
    samples : int
        Number of rows of the file.
    """

    how: Literal["created", "resumed", "extended"]
    samples: int


def create(path: Path, scene: Scene, rows: range | None = None) -> None:
    """Create a database with all rows pending; the caller holds `lock(path)`.

    Parameters
    ----------
    path : Path
        File to create.
    scene : Scene
        Scene of its rows.
    rows : range, optional
        Rows of the scene that the file holds, all by default; fewer make a part.

    Raises
    ------
    InputError
        If the file exists, its folder is missing or cannot be written, or the disk is full.
    """
    rows = range(scene.samples) if rows is None else rows
    with new_file(path, scene, rows) as temporary:
        lay_out(temporary, scene, rows, provenance(scene))
        with open_file(temporary, writing=True) as file:
            fill(file, scene, 0, len(rows))


def open_or_create(
    path: Path, scene: Scene, rows: range | None = None, *, force: bool = False
) -> Opened:
    """Create, resume or extend a database for a run; the caller holds `lock(path)`.

    A file with more rows than requested keeps them.

    Parameters
    ----------
    path : Path
        Database.
    scene : Scene
        Scene to generate.
    rows : range, optional
        Rows of the scene that the file has to hold, all by default.
    force : bool
        Accept a file with another physics number, whose rows were computed by other code.

    Returns
    -------
    Opened
        Action that was taken, and number of rows.

    Raises
    ------
    InputError
        If the path cannot be written, or is not a database of this scene, layout and physics
        number. Nothing is overwritten.
    """
    wanted = range(scene.samples) if rows is None else rows
    if not path.exists():
        create(path, scene, wanted)
        return Opened("created", len(wanted))
    with open_file(path) as file:
        checked_for(file, path, scene, force=force)
        there = rows_of(read_attributes(file))
        other_physics = int(file.attrs["physics"]) != physics_of(scene)
    if other_physics:
        with open_file(path, writing=True) as file:
            file.attrs.modify("physics_forced", physics_of(scene))
    if _hull(there, wanted) == there:
        return Opened("resumed", len(there))
    return Opened("extended", len(extend(path, scene, wanted, force=force)))


def extend(path: Path, scene: Scene, rows: range | None = None, *, force: bool = False) -> range:
    """Give a database more rows of the same scene; the caller holds `lock(path)`.

    Contiguous datasets cannot grow, so the rows are copied into a new file, which then takes name,
    owner, group and mode of the old one. A kill at any moment leaves one of the two files, whole.
    Rows between those of a part and the requested ones are added as pending.

    Parameters
    ----------
    path : Path
        Database.
    scene : Scene
        Its scene, perhaps with more samples.
    rows : range, optional
        Rows that it has to hold too, all of the scene by default.
    force : bool
        See `open_or_create`.

    Returns
    -------
    range
        Rows that it holds now.

    Raises
    ------
    InputError
        If the database is not of this scene, has these rows already, may not be written or
        replaced, or is being written; if the disk is full.
    """
    with HeldFile(path) as held, open_file(path) as old:
        present = checked_for(old, path, scene, force=force)
        attributes = read_attributes(old)
        old_rows = rows_of(attributes)
        rows = _hull(old_rows, range(scene.samples) if rows is None else rows)
        if rows == old_rows:
            raise InputError(f"{path} has {len(old_rows)} samples; to extend it ask for more")
        wider = scene if scene.samples > present.samples else present
        place = old_rows.start - rows.start
        with new_file(path, wider, rows, replaced=held) as temporary:
            lay_out(temporary, wider, rows, attributes | identity(wider))
            with open_file(temporary, writing=True) as new:
                for column in columns_for(wider):
                    kept = old[stored_path(old, column)]
                    for start, stop in chunks(len(old_rows), column.row_bytes(wider.shape)):
                        write_rows(new[column.path], place + start, kept[start:stop])
                fill(new, wider, 0, place)
                fill(new, wider, place + len(old_rows), len(rows))
    return rows


def _hull(one: range, other: range) -> range:
    """Return the smallest range that contains two ranges."""
    return range(min(one.start, other.start), max(one.stop, other.stop))
