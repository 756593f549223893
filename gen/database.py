"""Databases: HDF5 files, readable as netCDF-4, in which a killed run resumes.

One contiguous dataset per column of `gen.schema`, allocated and filled when the file is created,
so that writing rows changes no metadata: whatever the moment at which a writer is killed, the
file opens again, and a row whose status says done is whole. (The order of writes that guarantees
it holds for killed processes, not for a machine that loses power.) HDF5's own file locks are not
used: they fail on network file systems and would shut out readers; `lock` keeps writers apart.
"""

import errno
import fcntl
import importlib.metadata
import json
import math
import os
import platform
import re
import shutil
import socket
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal, NamedTuple, Self

import h5py
import numpy as np
from numpy.typing import ArrayLike, NDArray

from gen.errors import InputError
from gen.scene import Scene, differences
from gen.schema import (
    PHYSICS,
    REASON,
    REASONS,
    RUNTIME,
    SCHEMA,
    STATUS,
    Column,
    Status,
    columns_for,
)

CHUNK_BYTES = 8 * 2**20
"""Bytes of a column that are held in memory at once."""

FULL = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG})
"""System errors that mean: no room left, be it the disk's, the quota's or the file's."""

FLAGS: dict[Column, dict[int, str]] = {
    STATUS: {status: status.name.lower() for status in Status},
    REASON: REASONS,
}
"""Meanings of the columns that hold codes."""

KINDS = {"f": "fiu", "i": "iu", "u": "iu", "S": "S"}
"""Kinds of arrays that a column of each kind takes."""


class Counts(NamedTuple):
    """How many rows are pending, done and failed."""

    pending: int
    done: int
    failed: int


class Opened(NamedTuple):
    """What `open_or_create` did, and how many rows the file has."""

    how: Literal["created", "resumed", "extended"]
    samples: int


# --- one writer at a time -----------------------------------------------------------------------


@contextmanager
def lock(path: Path) -> Iterator[None]:
    """Hold the right to write a database; hold it around all that creates, opens and writes it.

    The kernel holds the lock, on the file `<path>.lock`, and drops it with its process; the file
    says who holds it. With `HDF5_USE_FILE_LOCKING=FALSE`, the usual setting where a file system
    has no locks, the lack of locks is accepted and the user sees to it that one run writes.

    Parameters
    ----------
    path : the database, which need not exist yet

    Raises
    ------
    InputError
        If another process writes the database, the folder cannot be written, or its file system
        has no locks.
    """
    lock_path = _beside(path, ".lock")
    descriptor = _locked(path, lock_path)
    try:
        with suppress(OSError):  # a full disk: the text is missing, the lock holds
            os.ftruncate(descriptor, 0)
            os.write(descriptor, _this_process().encode())
        yield
    finally:
        # Unlinked while the lock is held: nobody can lock a name that is about to vanish,
        # because `_locked` checks that the name still leads to what it has locked.
        lock_path.unlink(missing_ok=True)
        os.close(descriptor)


def _locked(path: Path, lock_path: Path) -> int:
    """Descriptor of the locked lock file."""
    while True:
        try:
            descriptor = os.open(lock_path, os.O_RDWR | os.O_CREAT, 0o666)
        except OSError as error:
            raise InputError(
                f"{path} cannot be written: {error.strerror}: {lock_path.parent}; "
                "give a folder that exists and is yours to write"
            ) from None
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            holder = os.read(descriptor, 500).decode(errors="replace").strip()
            os.close(descriptor)
            raise InputError(
                f"{path} is being written by {holder or 'another process'}; wait until it ends"
            ) from None
        except OSError as error:
            if os.environ.get("HDF5_USE_FILE_LOCKING", "").upper() not in {"FALSE", "0"}:
                os.close(descriptor)
                raise InputError(
                    f"{path}: its file system has no locks ({error.strerror}); set "
                    "HDF5_USE_FILE_LOCKING=FALSE and let only one run write it"
                ) from None
            return descriptor
        # The holder before us may have unlinked the file between our open and our lock.
        with suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(descriptor), lock_path.stat()):
                return descriptor
        os.close(descriptor)


def _this_process() -> str:
    """Host, process, Slurm job if any, and time, in one line."""
    job = os.environ.get("SLURM_JOB_ID")
    parts = [f"host {socket.gethostname()}", f"process {os.getpid()}"]
    parts += [f"job {job}"] if job else []
    return ", ".join([*parts, f"since {_now()}"]) + "\n"


def _beside(path: Path, ending: str) -> Path:
    """Name in the folder where the file really is: scratch folders are often reached by links."""
    real = path.resolve()
    return real.with_name(real.name + ending)


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")


# --- creation -----------------------------------------------------------------------------------


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
    with _new_file(path, scene) as temporary:
        _lay_out(temporary, scene, _provenance(scene))
        with _open(temporary, writing=True) as file:
            _fill(file, scene, first=0)


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
    with _open(path) as file:
        rows = _checked_for(file, path, scene, force=force).samples
        other_physics = int(file.attrs["physics"]) != PHYSICS
    if other_physics:
        with _open(path, writing=True) as file:
            file.attrs.modify("physics_forced", PHYSICS)
    if scene.samples <= rows:
        return Opened("resumed", rows)
    extend(path, scene, force=force)
    return Opened("extended", scene.samples)


def extend(path: Path, scene: Scene, *, force: bool = False) -> None:
    """Give a database more rows of the same scene; the caller holds `lock(path)`.

    Contiguous datasets cannot grow: the rows are copied into a new file, which then takes the
    name of the old one. A kill at any moment leaves one of the two, whole.

    Parameters
    ----------
    path : the database
    scene : its scene, with more samples
    force : see `open_or_create`

    Raises
    ------
    InputError
        If the database is not of this scene, has as many rows already, or the disk is full.
    """
    with _open(path) as old:
        found = _checked_for(old, path, scene, force=force)
        rows = found.samples
        if scene.samples <= rows:
            raise InputError(f"{path} has {rows} samples; to extend it ask for more")
        attributes = _attributes(old) | _identity(scene)
        with _new_file(path, scene, replace=True) as temporary:
            _lay_out(temporary, scene, attributes)
            with _open(temporary, writing=True) as new:
                for column in columns_for(scene.store):
                    for start, stop in _chunks(rows, _row_bytes(column, scene)):
                        _write(new[column.path], start, old[column.path][start:stop])
                _fill(new, scene, first=rows)


@contextmanager
def _new_file(path: Path, scene: Scene, *, replace: bool = False) -> Iterator[Path]:
    """Name for a file in the making, which takes its place when the block has succeeded.

    What is left of a killed attempt is removed by the next.
    """
    temporary = _beside(path, ".part")
    if not replace and os.path.lexists(path):
        raise InputError(f"{path} exists; give another name or remove it")
    if not temporary.parent.is_dir():
        raise InputError(f"{path}: the folder {temporary.parent} does not exist; create it first")
    try:
        temporary.unlink(missing_ok=True)
        _require_room(path, scene)
        yield temporary
        with temporary.open("rb") as file:
            os.fsync(file.fileno())
        if replace:
            temporary.replace(path.resolve())
        else:
            _put_in_place(temporary, path)
    except (OSError, RuntimeError, ValueError) as error:
        trouble = _trouble(error)
        if trouble is None:
            raise
        raise InputError(f"{path}: {trouble}; nothing was changed") from None
    finally:
        temporary.unlink(missing_ok=True)


def _require_room(path: Path, scene: Scene) -> None:
    """Refuse a file that cannot fit before it fills the disk; quotas show only on writing."""
    needed = scene.samples * sum(_row_bytes(column, scene) for column in columns_for(scene.store))
    free = shutil.disk_usage(path.resolve().parent).free
    if needed > free:
        raise InputError(
            f"{path}: {scene.samples} samples need {needed / 1e9:,.1f} GB, "
            f"{free / 1e9:,.1f} GB are free; make room, or ask for less"
        )


def _put_in_place(temporary: Path, path: Path) -> None:
    """Rename, but never over a file that has appeared meanwhile."""
    try:
        path.hardlink_to(temporary)
    except FileExistsError:
        raise InputError(f"{path} has appeared meanwhile; give another name") from None
    except OSError:  # no hard links on this file system
        temporary.rename(path)


def _lay_out(path: Path, scene: Scene, attributes: Mapping[str, str | int]) -> None:
    """Write dimensions, attributes and empty columns.

    HDF5 allocates the columns but does not fill them: when the disk runs full inside HDF5's own
    filling, it can neither close the file nor leave without a crash. `_fill` does it instead.
    """
    columns = columns_for(scene.store)
    # A superblock of version 2: the next one marks files as open and a killed writer would leave
    # the mark. Creation order is kept: readers then list the columns in the schema's order.
    with h5py.File(path, "w", libver=("v108", "v110"), track_order=True, locking=False) as file:
        for name, value in attributes.items():
            _set(file, name, value)
        axes = {"sample": scene.samples}
        if any(column.shape_of for column in columns):
            axes |= dict(zip("xy", scene.shape, strict=True))
        dimensions = [_dimension(file, name, size) for name, size in axes.items()]
        file.create_group(RUNTIME, track_order=True)
        for column in columns:
            _add(file, column, column.shape(scene.samples, scene.surface.nodes), dimensions)


def _dimension(file: h5py.File, name: str, size: int) -> h5py.Dataset:
    """Add a netCDF-4 dimension without coordinates: a scale that never gets data or disk space."""
    scale = file.create_dataset(name, shape=(size,), dtype=">f4")
    scale.make_scale(f"This is a netCDF dimension but not a netCDF variable.{size:10d}")
    return scale


def _add(
    file: h5py.File, column: Column, shape: tuple[int, ...], dimensions: list[h5py.Dataset]
) -> None:
    """Add a column: allocated, not filled, described, attached to its dimensions."""
    properties = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    properties.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    properties.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
    dataset = file.create_dataset(
        column.path, shape=shape, dtype=column.dtype, fillvalue=column.fill, dcpl=properties
    )
    for axis, scale in enumerate(dimensions[: len(shape)]):
        dataset.dims[axis].attach_scale(scale)
    _set(dataset, "long_name", column.long_name)
    if column.unit:
        _set(dataset, "units", column.unit)
    if flags := FLAGS.get(column):
        dataset.attrs["flag_values"] = np.array(list(flags), dtype=column.dtype)
        _set(dataset, "flag_meanings", " ".join(_word(text) for text in flags.values()))


def _set(node: h5py.Dataset | h5py.File, name: str, value: str | int) -> None:
    """Add an attribute; texts of fixed length.

    HDF5 keeps texts of variable length in a heap without checksums: where that is damaged it may
    read forever.
    """
    if isinstance(value, str):
        data = value.encode()
        node.attrs.create(name, data, dtype=h5py.string_dtype("utf-8", max(1, len(data))))
    else:
        node.attrs[name] = value


def _attributes(file: h5py.File) -> dict[str, str | int]:
    """Read the file's texts and numbers."""
    return {
        name: value.decode() if isinstance(value, bytes) else int(value)
        for name, value in file.attrs.items()
    }


def _word(text: str) -> str:
    """One word of CF's `flag_meanings`, which is a list separated by blanks."""
    return re.sub(r"[^A-Za-z0-9]+", "_", text).strip("_") or "none"


def _fill(file: h5py.File, scene: Scene, first: int) -> None:
    """Write NaN, 0 and empty texts from row `first` on, which also takes the disk space."""
    for column in columns_for(scene.store):
        dataset = file[column.path]
        for start, stop in _chunks(scene.samples, _row_bytes(column, scene), first):
            shape = column.shape(stop - start, scene.surface.nodes)
            _write(dataset, start, np.full(shape, column.fill, dtype=column.dtype))


def _identity(scene: Scene) -> dict[str, str | int]:
    """Attributes that say which rows a file is made for."""
    return {
        "title": scene.title or "Contact of rough surfaces",
        "scene": scene.text(),
        "scene_hash": scene.fingerprint(),
        "samples": scene.samples,
    }


def _provenance(scene: Scene) -> dict[str, str | int]:
    """All attributes of a new file."""
    return {
        "Conventions": "CF-1.11",
        **_identity(scene),
        "schema": SCHEMA,
        "physics": PHYSICS,
        "physics_forced": 0,
        "versions": json.dumps(_versions()),
        "git_commit": _git_commit(),
        "created": _now(),
    }


def _versions() -> dict[str, str]:
    """Versions of all that decides the numbers; read from package lists, nothing is imported."""
    versions = {"python": platform.python_version(), "hdf5": h5py.version.hdf5_version}
    for name in ("asperity", "numpy", "scipy", "pyfftw", "h5py"):
        with suppress(importlib.metadata.PackageNotFoundError):
            versions[name] = importlib.metadata.version(name)
    return versions


def _git_commit() -> str:
    """Commit of the checkout that this code runs from, "" if it is none.

    Read from git's files: starting a process from an MPI rank is unsafe on some interconnects.
    """
    git = Path(__file__).resolve().parents[1] / ".git"
    try:
        if git.is_file():  # a linked work tree
            git = (git.parent / git.read_text().removeprefix("gitdir:").strip()).resolve()
        head = (git / "HEAD").read_text().strip()
        if not head.startswith("ref: "):
            return head
        if (git / "commondir").exists():
            git = (git / (git / "commondir").read_text().strip()).resolve()
        reference = head.removeprefix("ref: ")
        if (git / reference).exists():
            return (git / reference).read_text().strip()
        packed = (line.partition(" ") for line in (git / "packed-refs").read_text().splitlines())
        return next((commit for commit, _, name in packed if name == reference), "")
    except OSError:
        return ""


# --- opening and checking -----------------------------------------------------------------------


def _open(path: Path, *, writing: bool = False) -> h5py.File:
    """Open an HDF5 file of any content.

    Without HDF5's buffer for small writes: data reach the kernel in the order of the calls, and a
    failed write leaves nothing behind on which closing would fail as well.
    """
    if path.is_dir():
        raise InputError(f"{path} is a folder; give the name of a database")
    if path.is_file() and not path.stat().st_size:  # HDF5 would make it a file of its own
        raise InputError(f"{path} is empty, not a database; give another name or remove it")
    access = h5py.h5p.create(h5py.h5p.FILE_ACCESS)
    access.set_fclose_degree(h5py.h5f.CLOSE_STRONG)
    access.set_file_locking(False, True)  # none, and no complaint where they are disabled
    access.set_sieve_buf_size(0)
    mode = h5py.h5f.ACC_RDWR if writing else h5py.h5f.ACC_RDONLY
    try:
        return h5py.File(h5py.h5f.open(os.fsencode(path), mode, access))
    except OSError as error:
        raise InputError(f"{path} {_unreadable(path, error)}") from None


def _unreadable(path: Path, error: OSError) -> str:
    """Why HDF5 could not open a file, and what to do."""
    if error.errno == errno.ENOENT:
        return "does not exist; check the name"
    if error.errno is not None:
        return f"cannot be opened: {os.strerror(error.errno)}"
    if "truncated" in str(error):
        return "is cut off: its end is missing; restore it from a copy or remove it"
    if "signature" in str(error):
        return "is not a database, nor HDF5 at all; give another name or remove it"
    return f"is damaged ({_first_line(error)}); restore it from a copy or remove it"


def _checked(file: h5py.File, path: Path) -> Scene:
    """Scene of a database of this layout; refuses all else."""
    try:
        return _scene_of(file, path)
    except InputError:
        raise
    except (OSError, RuntimeError, KeyError, TypeError, ValueError) as error:  # all h5py's
        raise InputError(
            f"{path} is damaged ({_first_line(error)}); restore it from a copy or remove it"
        ) from None


def _scene_of(file: h5py.File, path: Path) -> Scene:
    """Scene of a whole file; what is not whole may raise anything."""
    if not all(name in file.attrs for name in ("schema", "physics", "scene", "samples")):
        raise InputError(f"{path} is HDF5 but not a database of Asperity; give another name")
    attributes = _attributes(file)
    schema = attributes["schema"]
    if schema != SCHEMA:
        raise InputError(
            f"{path} has layout {schema}, this version reads layout {SCHEMA}; "
            f"use the version that made it ({attributes.get('versions', 'unknown')})"
        )
    scene = Scene.from_text(str(attributes["scene"]), str(path))
    for column in columns_for(scene.store):
        shape = column.shape(scene.samples, scene.surface.nodes)
        dataset = file.get(column.path)
        if dataset is None or dataset.shape != shape or dataset.dtype != np.dtype(column.dtype):
            raise InputError(
                f"{path} is damaged (no column {column.path!r} of type {column.dtype} and shape "
                f"{shape}); restore it from a copy or remove it"
            )
    return scene


def _checked_for(file: h5py.File, path: Path, scene: Scene, *, force: bool) -> Scene:
    """Scene of a database that can take rows of `scene`; refuses all else."""
    found = _checked(file, path)
    if different := differences(found, scene):
        raise InputError(
            f"{path} holds another scene ({'; '.join(different)}); "
            "give another name, or the file's own scene"
        )
    physics = int(file.attrs["physics"])
    if physics != PHYSICS and not force:
        raise InputError(
            f"{path} holds results of physics {physics}, this version computes physics {PHYSICS}; "
            "give another name, or --force to have rows of both in one file"
        )
    return found


def _trouble(error: Exception) -> str | None:
    """What went wrong with the disk, in words; None if the error is about something else.

    h5py raises OSError, RuntimeError or ValueError for one and the same system error, depending
    on the call; its number stands in the text.
    """
    match = re.search(r"errno = (\d+)", str(error))
    number = int(match[1]) if match else getattr(error, "errno", None)
    if number is not None:
        reason = os.strerror(number)
        return f"the disk is full ({reason})" if number in FULL else f"cannot be written: {reason}"
    return f"cannot be written: {_first_line(error)}" if isinstance(error, OSError) else None


def _first_line(error: Exception) -> str:
    return str(error).partition("\n")[0]


# --- rows ---------------------------------------------------------------------------------------


def _row_bytes(column: Column, scene: Scene) -> int:
    """Bytes of one row of a column."""
    return np.dtype(column.dtype).itemsize * math.prod(column.shape(1, scene.surface.nodes))


def _chunks(rows: int, row_bytes: int, first: int = 0) -> Iterator[tuple[int, int]]:
    """Split the rows first..rows so that a chunk has at most `CHUNK_BYTES`, but one row."""
    step = max(1, CHUNK_BYTES // row_bytes)
    for start in range(first, rows, step):
        yield start, min(start + step, rows)


def _write(dataset: h5py.Dataset, start: int, values: NDArray[Any]) -> None:
    """Write contiguous rows of the column's own type.

    What `dataset[start:stop] = values` does, without the 0.1 ms that h5py takes to understand
    the slice: a block has forty columns, and one process may write for hundreds.
    """
    rows = dataset.id.get_space()
    rows.select_hyperslab((start,) + (0,) * (values.ndim - 1), values.shape)
    dataset.id.write(h5py.h5s.create_simple(values.shape), rows, values)


def _counts(status: h5py.Dataset) -> Counts:
    """Count the rows by status."""
    done = failed = 0
    for start, stop in _chunks(len(status), 1):
        chunk = status[start:stop]
        done += int(np.count_nonzero(chunk == Status.DONE))
        failed += int(np.count_nonzero(chunk == Status.FAILED))
    return Counts(len(status) - done - failed, done, failed)


class _OpenDatabase:
    """What readers and writers share: the open file, its scene, its status."""

    def __init__(self, path: Path, scene: Scene, file: h5py.File) -> None:
        self.path = path
        self.scene = scene
        self._file = file

    def __enter__(self) -> Self:
        """Leave the block to close the file."""
        return self

    def __exit__(self, *error: object) -> None:
        """Close the file, whatever has happened."""
        self.close()

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def columns(self) -> tuple[Column, ...]:
        """List the file's columns, in the schema's order."""
        return columns_for(self.scene.store)

    def counts(self) -> Counts:
        """Count the rows by status."""
        return _counts(self._file[STATUS.path])


class Writer(_OpenDatabase):
    """A database open for writing rows; a context manager; the caller holds `lock(path)`.

    No call changes metadata, so that a writer with MPI-IO can write rows independently.

    Parameters
    ----------
    path : the database, from `open_or_create`
    scene : what is being generated
    force : see `open_or_create`

    Attributes
    ----------
    path : the database
    scene : the file's scene, which may have more samples than the one asked for

    Raises
    ------
    InputError
        If the file cannot be opened or is not of this scene, layout and physics.
    """

    def __init__(self, path: Path, scene: Scene, *, force: bool = False) -> None:
        with ExitStack() as stack:
            file = stack.enter_context(_open(path, writing=True))
            super().__init__(path, _checked_for(file, path, scene, force=force), file)
            stack.pop_all()
        self._datasets = {column.name: file[column.path] for column in self.columns()}
        self._status = self._datasets[STATUS.name]

    def write_block(self, start: int, stop: int, columns: Mapping[str, ArrayLike]) -> None:
        """Write finished rows: everything else first, then their status.

        Parameters
        ----------
        start, stop : first row, and one past the last
        columns : by name, every column of the file: (stop - start,), or (stop - start, n, n) for
            fields, in the units of `gen.schema`; the status done or failed

        Raises
        ------
        ValueError
            If a column is missing, unknown, or of another shape or kind, a status is neither done
            nor failed, or there are no such rows; nothing is written then.
        InputError
            If the disk is full or fails: it says how many rows are safe.
        """
        arrays = self._checked_block(start, stop, columns)
        status = arrays.pop(STATUS.name)
        try:
            for name, values in arrays.items():
                _write(self._datasets[name], start, values)
            self._flush()
            _write(self._status, start, status)
            self._flush()
        except (OSError, RuntimeError, ValueError) as error:
            trouble = _trouble(error)
            if trouble is None:
                raise
            raise InputError(
                f"{self.path}: {trouble}; {_counts(self._status).done} rows are done and safe: "
                "make room and run the same command again"
            ) from None

    def _checked_block(
        self, start: int, stop: int, columns: Mapping[str, ArrayLike]
    ) -> dict[str, NDArray[Any]]:
        """Arrays of a block, of the right names, shapes and kinds."""
        if not 0 <= start < stop <= self.scene.samples:
            raise ValueError(f"rows {start} to {stop} of {self.scene.samples}")
        if wrong := columns.keys() ^ self._datasets.keys():
            raise ValueError(f"columns missing or unknown: {', '.join(sorted(wrong))}")
        arrays = {}
        for column in self.columns():
            values = np.asarray(columns[column.name])
            shape = column.shape(stop - start, self.scene.surface.nodes)
            if values.shape != shape or values.dtype.kind not in KINDS[column.dtype[0]]:
                raise ValueError(
                    f"column {column.name}: wanted {column.dtype} of shape {shape}, "
                    f"got {values.dtype} of shape {values.shape}"
                )
            arrays[column.name] = np.ascontiguousarray(values, dtype=column.dtype)
        if not np.isin(arrays[STATUS.name], (Status.DONE, Status.FAILED)).all():
            raise ValueError("a finished row is done or failed, nothing else")
        return arrays

    def _flush(self) -> None:
        """Hand all data to the kernel, which keeps them if this process is killed."""
        self._file.flush()

    def pending(self, first: int = 0, last: int | None = None) -> list[tuple[int, int]]:
        """Find the rows that are neither done nor failed.

        Parameters
        ----------
        first, last : where to look: first row, and one past the last (None: to the end)

        Returns
        -------
        (start, stop) of every run of pending rows, in order, as long as possible
        """
        rows = self.scene.samples
        last = rows if last is None else min(last, rows)
        runs: list[tuple[int, int]] = []
        for start, stop in _chunks(last, 1, first):
            chunk = self._status[start:stop]
            finished = (chunk == Status.DONE) | (chunk == Status.FAILED)
            edges = start + np.flatnonzero(np.diff(finished, prepend=True, append=True))
            found = list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))
            if runs and found and runs[-1][1] == found[0][0]:
                found[0] = (runs.pop()[0], found[0][1])
            runs += found
        return runs

    def retry_failed(self) -> int:
        """Make the failed rows pending again, and return how many they were."""
        retried = 0
        for start, stop in _chunks(self.scene.samples, 1):
            chunk = self._status[start:stop]
            failed = chunk == Status.FAILED
            if failed.any():
                retried += int(np.count_nonzero(failed))
                chunk[failed] = Status.PENDING
                _write(self._status, start, chunk)
        self._flush()
        return retried


class Reader(_OpenDatabase):
    """A database open for reading, also while a run writes it; a context manager.

    Parameters
    ----------
    path : the database

    Attributes
    ----------
    path : the database
    scene : the scene it was made with

    Raises
    ------
    InputError
        If the file is missing, cannot be read, or is not a database of this layout.
    """

    def __init__(self, path: Path) -> None:
        with ExitStack() as stack:
            file = stack.enter_context(_open(path))
            super().__init__(path, _checked(file, path), file)
            stack.pop_all()

    @property
    def attributes(self) -> dict[str, str | int]:
        """What the file says about itself: scene, versions, commit, numbers of layout, physics."""
        return _attributes(self._file)

    @property
    def size_bytes(self) -> int:
        """Size of the file [bytes]."""
        return self.path.stat().st_size

    def column(self, name: str, start: int = 0, stop: int | None = None) -> NDArray[Any]:
        """Read one column.

        Parameters
        ----------
        name : name of the column
        start, stop : first row, and one past the last (None: to the end)

        Returns
        -------
        (stop - start,), or (stop - start, n, n) for a field, in the unit of `gen.schema`; pending
        and failed rows included: see the status

        Raises
        ------
        InputError
            If the file has no such column.
        """
        for column in self.columns():
            if column.name == name:
                values: NDArray[Any] = self._file[column.path][start:stop]
                return values
        names = ", ".join(column.name for column in self.columns())
        raise InputError(f"{self.path} has no column {name!r}; it has {names}")

    def reasons(self) -> dict[int, int]:
        """Count the failed rows by the code of their reason (see `gen.schema.REASONS`)."""
        total = np.zeros(256, dtype=np.int64)
        for start, stop in _chunks(self.scene.samples, 1):
            failed = self._file[STATUS.path][start:stop] == Status.FAILED
            if failed.any():
                codes = self._file[REASON.path][start:stop][failed]
                total += np.bincount(codes, minlength=total.size)
        return {int(code): int(total[code]) for code in np.flatnonzero(total)}

    def ranges(self) -> dict[str, tuple[float, float]]:
        """Find the smallest and the largest value of every column of numbers over the done rows.

        Returns
        -------
        By name, in the column's unit, NaN without done rows; fields, codes and texts are left out
        """
        wanted = [
            column
            for column in self.columns()
            if not column.shape_of and column.dtype[0] != "S" and column not in FLAGS
        ]
        ranges = {column.name: (math.nan, math.nan) for column in wanted}
        for start, stop in _chunks(self.scene.samples, 8):
            done = self._file[STATUS.path][start:stop] == Status.DONE
            if not done.any():
                continue
            for column in wanted:
                values = self._file[column.path][start:stop][done]
                low, high = ranges[column.name]
                ranges[column.name] = (
                    float(np.fmin(low, np.fmin.reduce(values))),
                    float(np.fmax(high, np.fmax.reduce(values))),
                )
        return ranges


# --- merging ------------------------------------------------------------------------------------


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
        files = {path: stack.enter_context(_open(path)) for path in sources}
        scenes = {path: _checked(file, path) for path, file in files.items()}
        _refuse_unequal(files, scenes)
        largest = max(scenes, key=lambda path: scenes[path].samples)
        scene = scenes[largest]
        forced = max(int(file.attrs["physics_forced"]) for file in files.values())
        attributes = _attributes(files[largest]) | {"physics_forced": forced}
        with _new_file(target, scene) as temporary:
            _lay_out(temporary, scene, attributes)
            with _open(temporary, writing=True) as file:
                widest = max(_row_bytes(column, scene) for column in columns_for(scene.store))
                for start, stop in _chunks(scene.samples, widest):
                    _merge_rows(file, files, scene, start, stop)
                return _counts(file[STATUS.path])


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
        _write(target[column.path], start, merged)


def _unequal_rows(left: NDArray[Any], right: NDArray[Any]) -> NDArray[np.bool_]:
    """Tell which rows differ in any bit; equal NaNs are equal."""
    unequal = left.view(np.uint8) != right.view(np.uint8)
    rows: NDArray[np.bool_] = unequal.reshape(len(left), -1).any(axis=1)
    return rows
