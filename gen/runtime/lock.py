"""Locks by name, so that only one process at a time writes a database, or into a folder."""

import fcntl
import os
import re
import socket
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path

from gen.runtime.errors import InputError
from gen.runtime.files import make_folder, place_of

OURS = re.compile(rb"host .+, process [0-9]+(, job .+)?, since .+\n?")
"""Content of our lock files: their holder in one line."""

LONGEST = 500  # most bytes of that line


@contextmanager
def lock(path: Path) -> Iterator[None]:
    """Hold the lock of a database, which need not exist yet, while the block creates or writes it.

    The kernel keeps the lock on the file `<path>.lock` and drops it when the process ends; the file
    names the holder. With `HDF5_USE_FILE_LOCKING=FALSE`, the usual setting on file systems without
    locks, missing locks are accepted and the user makes sure that only one run writes.

    Raise InputError if another process writes the database, the folder cannot be written, its file
    system has no locks, or a file of the user's has the lock's name.
    """
    real = place_of(path)  # one lock for all links to a file
    with _held(path, real.with_name(f"{real.name}.lock")):
        yield


@contextmanager
def lock_folder(folder: Path) -> Iterator[None]:
    """Make a folder if there is none, and hold its lock while the block reads and writes it.

    The lock is the file `.asperity.lock` in the folder, see `lock`. A folder that has been made for
    the block and is empty behind it is removed.
    """
    made = [each for each in (folder, *folder.parents) if not each.exists()]
    make_folder(folder)
    try:
        with _held(folder, folder / ".asperity.lock"):
            yield
    finally:
        with suppress(OSError):  # something is in it
            for each in made:
                each.resolve().rmdir()


@contextmanager
def _held(path: Path, lock_path: Path) -> Iterator[None]:
    """Hold the lock of a path, which is that of a file."""
    descriptor = _locked(path, lock_path)
    try:
        with suppress(OSError):  # a full disk: the text is missing, the lock holds
            os.ftruncate(descriptor, 0)
            os.write(descriptor, _this_process().encode())
        yield
    finally:
        # Unlinked while the lock is held: nobody can lock a name that is about to vanish,
        # because `_locked` checks that the name still leads to what it has locked.
        if _leads_to(lock_path, descriptor):
            lock_path.unlink(missing_ok=True)
        os.close(descriptor)


def _locked(path: Path, lock_path: Path) -> int:
    """Return the descriptor of the locked file."""
    while True:
        descriptor = _opened(path, lock_path)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            holder = os.pread(descriptor, LONGEST, 0).decode(errors="replace").strip()
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
        if _leads_to(lock_path, descriptor):
            return descriptor
        os.close(descriptor)


def _opened(path: Path, lock_path: Path) -> int:
    """Return the descriptor of a new lock file, or of one that a killed process has left.

    A link is not followed, and a file of the user's is refused.
    """
    flags = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
    try:
        descriptor = os.open(lock_path, flags, 0o666)
    except OSError as error:
        if not os.path.lexists(lock_path):
            raise InputError(
                f"{path} cannot be written: {error.strerror}: {lock_path.parent}; "
                "give a folder that exists and is yours to write"
            ) from None
    else:
        if stat.S_ISREG(os.fstat(descriptor).st_mode):
            content = os.pread(descriptor, LONGEST + 1, 0)
            if not content or (len(content) <= LONGEST and OURS.fullmatch(content)):
                return descriptor
        os.close(descriptor)
    raise InputError(
        f"{path} cannot be written: {lock_path} is there and not a lock that can be taken; move it"
        " away"
    )


def _leads_to(path: Path, descriptor: int) -> bool:
    """Tell whether a name leads to an open file."""
    with suppress(OSError):
        return os.path.samestat(os.fstat(descriptor), path.lstat())
    return False


def _this_process() -> str:
    """Return one line with host, process, Slurm job if any, and time."""
    job = os.environ.get("SLURM_JOB_ID")
    now = datetime.now(UTC).isoformat(timespec="seconds")
    place = f"host {socket.gethostname()}, process {os.getpid()}"
    return f"{place}{f', job {job}' if job else ''}, since {now}\n"
