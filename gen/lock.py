"""The right to write: one process at a time writes a database."""

import fcntl
import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path

from gen.errors import InputError


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
    lock_path = beside(path, ".lock")
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
    now = datetime.now(UTC).isoformat(timespec="seconds")
    return ", ".join([*parts, f"since {now}"]) + "\n"


def beside(path: Path, ending: str) -> Path:
    """Name in the folder where the file really is: scratch folders are often reached by links."""
    real = path.resolve()
    return real.with_name(real.name + ending)
