"""New files, which take their names only when they are whole."""

import os
import re
import secrets
import shutil
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from gen.database.disk import disk_trouble
from gen.database.held import HeldFile
from gen.runtime.errors import InputError
from gen.runtime.files import hand_on, place_of
from gen.runtime.memory import size
from gen.scene import Scene
from gen.scene.columns import row_bytes

SIGNATURE = b"\x89HDF\r\n\x1a\n"
"""First bytes of HDF5 files."""


@contextmanager
def new_file(
    path: Path, scene: Scene, rows: range, *, replaced: HeldFile | None = None
) -> Iterator[Path]:
    """Make an empty file beside a database, and rename it to the database if the block succeeds.

    Its name, `X.h5.0123456789abcdef.part`, is drawn at random. The next attempt, which holds the
    same lock, removes the remains of a killed one.

    Parameters
    ----------
    path : Path
        Database.
    scene : Scene
        Scene of the rows, which decides the size.
    rows : range
        Rows that the file will hold.
    replaced : HeldFile, optional
        Existing file of this name to replace; None if there must be none.

    Yields
    ------
    Path
        Name of the new file.

    Raises
    ------
    InputError
        If the folder cannot be written, there is no room, or an existing file may not be replaced:
        it is not `replaced`, or this user cannot pass on its owner and group.
    """
    real = place_of(path)
    if replaced is None and real.exists():
        raise InputError(f"{path} exists; give another name")
    unfinished = real.with_name(f"{real.name}.{secrets.token_hex(8)}.part")
    try:
        _remove_leftovers(real)
        _require_room(path, scene, len(rows))
        _make(unfinished, path, replaced)
        yield unfinished
        with unfinished.open("rb") as file:
            os.fsync(file.fileno())
        if replaced is None:
            _put_in_place(unfinished, real)
        else:
            replaced.check()
            unfinished.replace(real)
    except (OSError, RuntimeError, ValueError) as error:
        trouble = disk_trouble(error)
        if trouble is None:
            raise
        raise InputError(f"{path}: {trouble}; nothing was changed") from None
    finally:
        unfinished.unlink(missing_ok=True)


def _make(unfinished: Path, path: Path, replaced: HeldFile | None) -> None:
    """Create the file with owner, group and mode of the file that it replaces."""
    mode = 0o666 if replaced is None else 0o600
    descriptor = os.open(unfinished, os.O_RDWR | os.O_CREAT | os.O_EXCL, mode)
    try:
        if replaced is None:
            return
        old = replaced.stat()
        hand_on(old, descriptor)
        new = os.fstat(descriptor)
    finally:
        os.close(descriptor)
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


def _put_in_place(temporary: Path, path: Path) -> None:
    """Rename the new file, but refuse to replace a file that has appeared meanwhile."""
    try:
        path.hardlink_to(temporary)
    except FileExistsError:
        raise InputError(f"{path} has appeared meanwhile; give another name") from None
    except OSError:  # no hard links on this file system
        temporary.rename(path)
