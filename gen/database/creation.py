"""Create, extend and merge databases.

Each of these makes a new file under a temporary name, and gives it its final name when it is whole.
"""

import shutil
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal

import h5py
import numpy as np
from numpy.typing import NDArray

from gen.arrays import Indices
from gen.database.disk import HeldFile, disk_trouble
from gen.database.layout import FILE_SETTINGS, Attributes, lay_out, new_attributes
from gen.database.opening import (
    SIGNATURE,
    has_checksums,
    open_file,
    read_attributes,
    read_scene,
    require_scene,
    rows_of,
    stored_path,
)
from gen.database.reader import Counts, Reader, chunks
from gen.database.writer import write_rows
from gen.runtime.errors import InputError
from gen.runtime.files import Present, lock, place_of, unfinished
from gen.runtime.memory import format_bytes
from gen.runtime.terminal import command_to_type
from gen.scene import Scene, differences, stored_columns
from gen.scene.faults import shown
from gen.schema import CHECKSUM, PHYSICS, STATUS, Column, Status


@dataclass(frozen=True, eq=False)
class Source:
    """An open database whose rows are copied into a new file."""

    path: Path
    file: h5py.File
    scene: Scene  # the scene that the database has recorded
    rows: range  # numbers of the rows that the file holds

    @classmethod
    def of(cls, path: Path, file: h5py.File) -> "Source":
        """Check an open database, and read its scene and its rows.

        Parameters
        ----------
        path : Path
            Path of the database.
        file : h5py.File
            The open file, which the caller closes.

        Returns
        -------
        Source
            The source.

        Raises
        ------
        InputError
            If the file is no database of this layout.
        """
        return cls(
            path=path,
            file=file,
            scene=read_scene(file, path),
            rows=rows_of(read_attributes(file)),
        )

    @property
    def physics(self) -> int:
        """Physics number of the database, see `gen.schema.PHYSICS`."""
        return int(self.file.attrs["physics"])

    def read(self, column: Column, rows: range) -> NDArray[Any]:
        """Read the values of a column in some rows.

        Parameters
        ----------
        column : Column
            A column of the source.
        rows : range
            Numbers of the rows, at least one of which the source holds.

        Returns
        -------
        ndarray, shape (rows,) or (rows, nx, ny)
            Values of the rows. Rows that the source does not hold have the column's fill value.
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
    """The sources of a chunk of rows: which rows they have finished, and whose values are taken."""

    sources: Sequence[Source]  # the sources that hold at least one row of the chunk
    rows: range  # numbers of the rows of the chunk
    done: NDArray[np.bool_]  # whether a row is done in a source, shape (sources, rows)
    # Whether a row is done or failed in a source, shape (sources, rows).
    finished: NDArray[np.bool_]
    # Index of the source whose values of a row are taken, shape (rows,). It has no meaning for rows
    # that no source has finished.
    owner: Indices


def create(path: Path, scene: Scene, rows: range | None = None) -> None:
    """Create a database whose rows are all pending.

    Parameters
    ----------
    path : Path
        The new file. The caller holds its `gen.database.lock`.
    scene : Scene
        The completed scene.
    rows : range, optional
        Numbers of the rows that the file holds; all rows of the scene by default. A file with fewer
        rows is a part.

    Raises
    ------
    InputError
        If the file exists, or the disk has no room for it.
    """
    if rows is None:
        rows = range(scene.samples)
    _assemble(path, scene, rows, stored_columns(scene), new_attributes())


def file_bytes(scene: Scene, rows: int) -> int:
    """Compute the size that the file of a new database is going to have.

    A temporary file with one row is written to measure the size of everything else, such as names,
    units and the scene.

    Parameters
    ----------
    scene : Scene
        The completed scene.
    rows : int
        Number of rows of the file.

    Returns
    -------
    int
        Size [bytes]. The real file may be a few bytes larger, because HDF5 aligns columns.
    """
    columns = stored_columns(scene)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "one-row.h5"
        with h5py.File(path, "w", locking=False, **FILE_SETTINGS) as file:
            lay_out(file, scene, range(1), columns, new_attributes())
        size_with_one_row = path.stat().st_size
    row_bytes = sum(column.row_bytes(scene.grid.shape) for column in columns)
    return size_with_one_row + (rows - 1) * row_bytes


def open_or_create(
    path: Path, scene: Scene, rows: range | None = None, *, force: bool = False
) -> Literal["created", "resumed", "extended"]:
    """Create a database, or extend it if it lacks some of the wanted rows.

    An extended file has its old rows, the wanted rows, and all rows between them; the new rows are
    pending. Contiguous datasets cannot grow. The old rows are therefore copied into a new file,
    which replaces the old one. If the process is killed, the path has the old file or the new one.

    Parameters
    ----------
    path : Path
        The database, which need not exist. The caller holds its `gen.database.lock`.
    scene : Scene
        The completed scene.
    rows : range, optional
        Numbers of the rows that the file has to hold; all rows of the scene by default. A file with
        further rows keeps them.
    force : bool
        Whether the file may have another physics number than this version. The attribute
        "physics_forced" of such a file is set to the physics number of this version, because the
        file is going to hold rows of this version too.

    Returns
    -------
    str
        "created" for a new file, "extended" for a file with new rows, or "resumed" if the file has
        all rows already.

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
        require_scene(file, path, stored=source.scene, scene=scene, force=force)
        attributes = read_attributes(file)
        # `require_scene` allows another physics number only with `force`.
        if attributes["physics"] != PHYSICS:
            file.attrs.modify("physics_forced", PHYSICS)
            attributes["physics_forced"] = PHYSICS
        extended = range(
            min(source.rows.start, rows.start), max(source.rows.stop, rows.stop)
        )
        if extended == source.rows:
            return "resumed"
        # The new file records the scene with more samples. If that is the new scene, it takes over
        # the powers of the user's outputs (exponents of heights, lengths and E*, see
        # `gen.quantities.Powers`), because they were measured when the old file was made.
        recorded = source.scene
        if scene.samples > recorded.samples:
            recorded = scene.with_powers_of(recorded)
        checksums = has_checksums(file, source.scene)
        columns = stored_columns(recorded, checksums=checksums)
        _assemble(path, recorded, extended, columns, attributes, [source], replaced=held)
    return "extended"


def merge(target: Path, sources: Sequence[Path]) -> Counts:
    """Merge databases of one scene whose rows were computed in different places.

    A row is done if it is done in a source, otherwise failed if it failed in a source, otherwise
    pending. A row that is done in several sources must have equal values in them, apart from times,
    ranks and hosts. The scene and the attributes are taken from the source with the largest number
    of samples, or from the first such source; "physics_forced" is the largest one of all sources.
    The merged database has checksums if all sources have them. They are copied, because new ones
    would hide damage of the sources.

    Parameters
    ----------
    target : Path
        The new database. Its lock is held during the call.
    sources : sequence of Path
        Databases, at least one. Parts of a database may overlap, and rows may be missing.

    Returns
    -------
    Counts
        Numbers of pending, done and failed rows of the merged database.

    Raises
    ------
    InputError
        If the sources have different scenes or physics numbers, if they differ in a row that is
        done in several of them, if the target exists, or if the disk has no room for it.
    """
    if not sources:
        raise InputError(f"{target}: nothing to merge; give at least one database")
    with ExitStack() as stack:
        stack.enter_context(lock(target))
        files = {path: stack.enter_context(open_file(path)) for path in sources}
        opened = [Source.of(path, file) for path, file in files.items()]
        for source in opened[1:]:
            _require_mergeable(opened[0], source)
        # Of several sources with the largest number, `max` returns the first one.
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
    """Raise InputError if scenes, measured powers or physics numbers of two databases differ."""
    places = (f"in {first.path}", f"in {second.path}")
    different = differences(first.scene, second.scene, places)
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
    """Return a line about the first output whose measured powers differ in two scenes.

    Powers are exponents of heights, lengths and E*, see `gen.quantities.Powers`. The outputs of the
    user's function are compared in the order of their names. The list is empty if all powers are
    equal.
    """
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
    """Write all columns of some rows of a new file, with the values of the sources.

    `first` is the number of the first row of the file. The values of a row are those of the first
    source in which it is done, otherwise those of the first source in which it failed, otherwise
    fill values. Raises InputError if a row is done in two sources with different values.
    """
    claims = _claims_on(rows, sources)
    # Different values in a column also give different checksums. The checksum comes last, so that
    # an error names the column with the different values.
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
        # A done row has the rank 2, a failed one 1, and a pending one 0.
        rank = 2 * done + failed
        owner = rank.argmax(axis=0)  # the first source with the highest rank
    return _Claims(
        sources=overlapping, rows=rows, done=done, finished=done | failed, owner=owner
    )


def _merged(column: Column, claims: _Claims, scene: Scene) -> NDArray[Any]:
    """Return the values of a column in the rows of `claims`, each from the row's owner.

    The shape is (rows,), or (rows, nx, ny) for a field. Rows that no source has finished have the
    fill value. Raises InputError if a row is done in two sources with different values, unless the
    column differs from run to run.
    """
    merged = _unwritten(column, len(claims.rows), scene)
    for index, source in enumerate(claims.sources):
        if not claims.finished[index].any():
            continue
        values = source.read(column, claims.rows)
        is_owner = claims.owner == index
        owned = np.flatnonzero(claims.finished[index] & is_owner)
        merged[owned] = values[owned]
        # Rows that are done here and in an earlier source, which owns them: `merged` already has
        # its values.
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
    """Return the values of a column in a number of rows that have not been written: fill values.

    The shape is (rows,), or (rows, nx, ny) for a field.
    """
    return np.full(column.shape(rows, scene.grid.shape), column.fill, dtype=column.dtype)


def _differ(first: NDArray[Any], second: NDArray[Any]) -> NDArray[np.bool_]:
    """Tell for each row whether two arrays have different bytes in it; shape (rows,).

    The arrays have the same type and shape, (rows,) or (rows, nx, ny). Two NaN with the same bytes
    are equal.
    """
    rows = len(first)
    bytes_of_first = first.view("u1").reshape(rows, -1)
    bytes_of_second = second.view("u1").reshape(rows, -1)
    unequal: NDArray[np.bool_] = (bytes_of_first != bytes_of_second).any(axis=1)
    return unequal


def _conflict(row: int, column: Column, first: Path, second: Path) -> InputError:
    """Return the error for a row that has different values of a column in two databases.

    If the checksum of the row is wrong in one of them, the message says so, and how to repair it.
    """
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
    """Make a file that holds some rows of a scene, and give it its name when it is whole.

    The values of the rows come from the sources; rows that no source has finished are pending. The
    new file replaces the file `replaced`, which has this path and is held open. Without it, the
    path must be free. Raises InputError if the path is not free, the disk has no room, the file
    cannot be written, or sources differ in a done row. An old file is unchanged then.
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
        with h5py.File(temporary, "w", locking=False, **FILE_SETTINGS) as file:
            lay_out(file, scene, rows, columns, attributes)
        # `lay_out` does not write values. Every row is written here, if only with fill values.
        with open_file(temporary, writing=True) as file:
            for start, stop in chunks(rows, row_bytes=max(row_bytes)):
                chunk = range(start, stop)  # numbers of rows
                _merge_rows(file, rows.start, chunk, sources, columns, scene)
        if replaced is not None:
            replaced.check()  # the path must still lead to the file that is to be replaced


def _require_room(path: Path, folder: Path, rows: int, row_bytes: int) -> None:
    """Raise InputError if the disk of a folder has no room for a number of rows.

    `row_bytes` is the size of a row [bytes]. `path` is that of the new file, for messages. A quota
    is noticed only when the file is written.
    """
    needed = rows * row_bytes  # [bytes]
    free = shutil.disk_usage(folder).free
    if needed > free:
        raise InputError(
            f"{path}: {rows} samples need {format_bytes(needed)}, {format_bytes(free)} are"
            " free; make room, or ask for less"
        )


def _require_owner(path: Path, target: Path, temporary: Path) -> None:
    """Raise InputError if a new file could not get the owner and the group of the file it replaces.

    `target` is the old file, and `temporary` the new one, which has got the owner and the group as
    far as this user may give them. `path` is the path of the old file for messages.
    """
    old = target.stat()
    new = temporary.stat()
    if (new.st_uid, new.st_gid) != (old.st_uid, old.st_gid):
        raise InputError(
            f"{path} belongs to user {old.st_uid} and group {old.st_gid}: to extend it"
            " would make it yours; let its owner do that, or copy it"
        )
