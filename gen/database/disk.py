"""Disk access of a database: rows in chunks, kinds of file systems, messages for errors."""

import errno
import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
from numpy.typing import NDArray

CHUNK_BYTES = 8 * 2**20
"""Most bytes of a column that are in memory at once."""

FULL = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG})
"""Errors of the system for a full disk, an exhausted quota or a file that is too large."""

MOUNTS = Path("/proc/self/mountinfo")
"""Linux's list of mounted file systems."""

INCOHERENT = frozenset({"nfs", "nfs4", "cifs", "smb3"})
"""File systems whose machines write back whole pages, with outdated bytes of neighbouring rows."""


def chunks(rows: int, bytes_per_row: int, first: int = 0) -> Iterator[tuple[int, int]]:
    """Split rows into chunks of at most `CHUNK_BYTES`, and of at least one row.

    Parameters
    ----------
    rows : int
        One past the last row.
    bytes_per_row : int
        Size of a row [bytes].
    first : int
        First row.

    Yields
    ------
    tuple of int
        First row of a chunk and one past its last.
    """
    step = max(1, CHUNK_BYTES // bytes_per_row)
    for start in range(first, rows, step):
        yield start, min(start + step, rows)


def write_rows(dataset: h5py.Dataset, start: int, values: NDArray[Any]) -> None:
    """Write contiguous rows of the column's own type.

    This does the same as `dataset[start:stop] = values` without h5py's 0.1 ms for the slice; a
    block has forty columns, and one process may write for hundreds.

    Parameters
    ----------
    dataset : h5py.Dataset
        Column to write into.
    start : int
        First row in the column.
    values : ndarray
        Rows of the column's type and shape.
    """
    rows = dataset.id.get_space()
    rows.select_hyperslab((start,) + (0,) * (values.ndim - 1), values.shape)
    dataset.id.write(h5py.h5s.create_simple(values.shape), rows, values)


def coherent(path: Path) -> bool:
    """Tell whether several machines can write neighbouring rows of a file at the same time.

    Local disks and parallel file systems allow it, NFS and SMB do not. The kind of file system is
    known on Linux only; elsewhere and in doubt the answer is yes.

    Parameters
    ----------
    path : Path
        File or folder.
    """
    real = Path(os.path.realpath(path))  # raises nothing for loops of links
    try:
        mounts = MOUNTS.read_text(errors="surrogateescape").splitlines()
    except OSError:
        return True
    kind, longest = "", 0
    for fields in (line.split(" ") for line in mounts):
        point = re.sub(r"\\([0-7]{3})", lambda code: chr(int(code[1], 8)), fields[4])
        if real.is_relative_to(point) and len(point) >= longest:
            kind, longest = fields[fields.index("-") + 1], len(point)
    return kind not in INCOHERENT


def disk_trouble(error: Exception) -> str | None:
    """Describe an error of the disk in words.

    h5py raises OSError, RuntimeError or ValueError for the same error of the system, depending on
    the call; its number is part of the message.

    Parameters
    ----------
    error : Exception
        Error of h5py or of the system.

    Returns
    -------
    str, optional
        Description; None if the error is not about the disk.
    """
    match = re.search(r"errno = (\d+)", str(error))
    number = int(match[1]) if match else getattr(error, "errno", None)
    if number is not None:
        reason = os.strerror(number)
        return f"the disk is full ({reason})" if number in FULL else f"cannot be written: {reason}"
    return f"cannot be written: {first_line(error)}" if isinstance(error, OSError) else None


def first_line(error: Exception) -> str:
    """Return the first line of an error's text, for messages of one line."""
    return str(error).partition("\n")[0]
