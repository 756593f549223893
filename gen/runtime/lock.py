"""The right to write: one process at a time writes a database."""

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
from gen.runtime.output import place_of

OURS = re.compile(rb"host .+, process [0-9]+(, job .+)?, since .+\n?")
"""What a lock file of ours says: who holds it, in one line."""

LONGEST = 500
"""Bytes of that line at most."""


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
        If another process writes the database, the folder cannot be written, its file system has
        no locks, or a file of the user's has the lock's name.
    """
    lock_path = beside(path, ".lock")
    descriptor, ours = _locked(path, lock_path)
    try:
        if ours:
            with suppress(OSError):  # a full disk: the text is missing, the lock holds
                os.ftruncate(descriptor, 0)
                os.write(descriptor, _this_process().encode())
        yield
    finally:
        # Unlinked while the lock is held: nobody can lock a name that is about to vanish,
        # because `_locked` checks that the name still leads to what it has locked.
        if ours and _leads_to(lock_path, descriptor):
            lock_path.unlink(missing_ok=True)
        os.close(descriptor)


def _locked(path: Path, lock_path: Path) -> tuple[int, bool]:
    """Descriptor of the locked lock file, and whether it may be written and removed."""
    while True:
        descriptor, ours = _opened(path, lock_path)
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
            return descriptor, ours
        # The holder before us may have unlinked the file between our open and our lock.
        if _leads_to(lock_path, descriptor):
            return descriptor, ours
        os.close(descriptor)


def _opened(path: Path, lock_path: Path) -> tuple[int, bool]:
    """Descriptor of the lock file, and whether it is one of ours: made here, or by its content.

    A link is not followed and a file of the user's is refused. An empty one is nobody's: it can be
    locked, but is left as it is.
    """
    flags = os.O_RDWR | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
    while True:
        try:
            with suppress(FileExistsError):
                return os.open(lock_path, flags | os.O_CREAT | os.O_EXCL, 0o666), True
            with suppress(FileNotFoundError):  # removed meanwhile
                descriptor = os.open(lock_path, flags)
                break
        except OSError as error:
            if os.path.lexists(lock_path):
                raise _foreign(path, lock_path) from None
            raise InputError(
                f"{path} cannot be written: {error.strerror}: {lock_path.parent}; "
                "give a folder that exists and is yours to write"
            ) from None
    if stat.S_ISREG(os.fstat(descriptor).st_mode):
        content = os.pread(descriptor, LONGEST + 1, 0)
        if not content or (len(content) <= LONGEST and OURS.fullmatch(content)):
            return descriptor, bool(content)
    os.close(descriptor)
    raise _foreign(path, lock_path)


def _foreign(path: Path, lock_path: Path) -> InputError:
    return InputError(
        f"{path} cannot be written: {lock_path} is there and not a lock that can be taken; move it"
        " away"
    )


def _leads_to(path: Path, descriptor: int) -> bool:
    """Whether a name leads to an open file."""
    with suppress(OSError):
        return os.path.samestat(os.fstat(descriptor), path.lstat())
    return False


def _this_process() -> str:
    """Host, process, Slurm job if any, and time, in one line."""
    job = os.environ.get("SLURM_JOB_ID")
    parts = [f"host {socket.gethostname()}", f"process {os.getpid()}"]
    parts += [f"job {job}"] if job else []
    now = datetime.now(UTC).isoformat(timespec="seconds")
    return ", ".join([*parts, f"since {now}"]) + "\n"


def beside(path: Path, ending: str) -> Path:
    """Name in the folder where the file really is: scratch folders are often reached by links."""
    real = place_of(path)
    return real.with_name(real.name + ending)
