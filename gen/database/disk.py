"""Notice if the file of a database is replaced, the disk fails, or machines cannot share it."""

import errno
import os
import re
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from gen.database.opening import first_line
from gen.runtime.errors import InputError, errno_of
from gen.runtime.files import require_writable

FULL = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG})
"""Errors of the system that mean a full disk, a used quota, or a file of the largest size."""

MOUNTS = Path("/proc/self/mountinfo")
"""File with Linux's list of mounted file systems."""

INCOHERENT = frozenset({"nfs", "nfs4", "cifs", "smb3"})
"""Types of file systems with which two machines cannot write neighbouring rows at the same time.

Each machine writes whole pages of a file, with old bytes of the rows that the other one has
written.
"""


class HeldFile(ExitStack):
    """A context manager that keeps a file open, to notice if it is replaced or overwritten.

    The open descriptor belongs to the file itself, whatever happens to its path. The lock
    `gen.database.lock`, by contrast, belongs to the path, and keeps other writers away.

    Parameters
    ----------
    path : Path
        An existing file.

    Raises
    ------
    InputError
        If the file may not be written.
    """

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.path = path
        self._fixed: tuple[range, ...] = ()  # offsets of the bytes that no writer changes
        self._content: list[bytes] = []  # the bytes of each of these ranges
        require_writable(path)
        # The call does not wait, for example for the other end of a pipe, and programs that this
        # process starts do not inherit the descriptor.
        self._descriptor = os.open(path, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)
        self.callback(os.close, self._descriptor)

    def remember(self, *fixed: range) -> None:
        """Read and keep the bytes that no writer changes; `intact` compares them with later ones.

        Parameters
        ----------
        *fixed : range
            Offsets of bytes in the file. Offsets beyond the end of the file are allowed.
        """
        self._fixed = fixed
        self._content = self._read_fixed()

    def _read_fixed(self) -> list[bytes]:
        """Read the present bytes of each fixed range, as far as the file reaches."""
        return [
            os.pread(self._descriptor, len(offsets), offsets.start)
            for offsets in self._fixed
        ]

    def check(self) -> None:
        """Refuse to continue if the file has been replaced, moved, deleted or overwritten.

        Raises
        ------
        InputError
            If the path leads to another file or to no file, or if bytes that no writer changes have
            changed since `remember`.
        """
        fate = self._fate()
        if fate:
            raise InputError(
                f"{self.path} was {fate} while it was being written; nothing more is written, and"
                " what this run has computed is in the old file, if that still exists"
            )

    def _fate(self) -> str:
        """Return the fate of the file as words that follow "was"; "" if it is as it was."""
        try:
            is_same = os.path.samestat(self.path.stat(), os.fstat(self._descriptor))
        except (FileNotFoundError, NotADirectoryError):
            return "moved or deleted"
        if not is_same:
            return "replaced by another file"
        if not self.intact():
            return "overwritten with something else"
        return ""

    def intact(self) -> bool:
        """Tell whether the bytes that no writer changes are as they were when `remember` read them.

        The path does not matter: the file may have been moved or deleted.

        Returns
        -------
        bool
            False if another program has overwritten the file.
        """
        return self._read_fixed() == self._content

    def sync(self) -> None:
        """Wait until all data that this machine has written into the file are on the disk.

        Raises
        ------
        OSError
            If the disk is full or fails.
        """
        # The syncs of HDF5 and MPI are collective, this one is not. The kernel reports each error
        # since the descriptor was opened, which was before the writer opened the file.
        os.fsync(self._descriptor)


def coherent(path: Path) -> bool:
    """Tell whether several machines can write neighbouring rows of a file at the same time.

    Parameters
    ----------
    path : Path
        File, which need not exist.

    Returns
    -------
    bool
        False on network file systems that do not allow it (NFS and SMB). True on all other file
        systems, and if the type of the file system is unknown.
    """
    return _file_system_of(path) not in INCOHERENT


def _file_system_of(path: Path) -> str:
    """Return the type of the file system of a path from Linux's list of mounts, such as "nfs4".

    Return "" if there is no such list.
    """
    # Unlike `Path.resolve`, this raises no error for a loop of links.
    real = Path(os.path.realpath(path))
    try:
        mounts = MOUNTS.read_text(errors="surrogateescape").splitlines()
    except OSError:
        return ""
    file_system = ""
    # The file is in the file system whose mount point is the longest one above it. Of two equal
    # mount points, the later one hides the earlier one.
    longest = 0  # letters of the longest mount point until now
    for line in mounts:
        # The fifth field is the mount point, in which blanks and backslashes are octal codes. The
        # type of the file system follows a lone hyphen (`man 5 proc_pid_mountinfo`).
        fields = line.split(" ")
        mount_point = re.sub(
            r"\\([0-7]{3})", lambda code: chr(int(code[1], 8)), fields[4]
        )
        if real.is_relative_to(mount_point) and len(mount_point) >= longest:
            file_system = fields[fields.index("-") + 1]
            longest = len(mount_point)
    return file_system


@contextmanager
def disk_trouble(path: Path, consequence: Callable[[], str]) -> Iterator[None]:
    """Turn an error of the disk in the code under this context manager into an InputError.

    Parameters
    ----------
    path : Path
        File that this code writes.
    consequence : callable
        Function without arguments that is called after an error. It returns the end of the message:
        what the file holds now, or how to continue.

    Yields
    ------
    None

    Raises
    ------
    InputError
        If the disk is full or fails, or if a new file cannot be given its name because another file
        has got this name in the meantime. The message has one line.
    """
    try:
        yield
    except FileExistsError:
        raise InputError(f"{path} has appeared meanwhile; give another name") from None
    except (OSError, RuntimeError, ValueError, KeyError) as error:
        # h5py raises errors of several types for an error of the system.
        number = errno_of(error)
        if not number and not isinstance(error, OSError):
            raise  # no error of the disk
        reason = os.strerror(number) if number else first_line(error)
        fault = f"cannot be written: {reason}"
        if number in FULL:
            fault = f"the disk is full ({reason})"
        raise InputError(f"{path}: {fault}; {consequence()}") from None
