"""The disk under a database: rows in pieces, file systems, troubles in words."""

import errno
import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
from numpy.typing import NDArray

CHUNK_BYTES = 8 * 2**20
"""Bytes of a column that are held in memory at once."""

FULL = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG})
"""System errors that mean: no room left, be it the disk's, the quota's or the file's."""

MOUNTS = Path("/proc/self/mountinfo")
"""Linux's list of what is mounted where."""

INCOHERENT = frozenset({"nfs", "nfs4", "cifs", "smb3"})
"""File systems whose machines write back whole pages, with old bytes of others' rows in them."""


def chunks(rows: int, bytes_per_row: int, first: int = 0) -> Iterator[tuple[int, int]]:
    """Split the rows first..rows so that a chunk has at most `CHUNK_BYTES`, but one row."""
    step = max(1, CHUNK_BYTES // bytes_per_row)
    for start in range(first, rows, step):
        yield start, min(start + step, rows)


def write_rows(dataset: h5py.Dataset, start: int, values: NDArray[Any]) -> None:
    """Write contiguous rows of the column's own type.

    What `dataset[start:stop] = values` does, without the 0.1 ms that h5py takes to understand
    the slice: a block has forty columns, and one process may write for hundreds.
    """
    rows = dataset.id.get_space()
    rows.select_hyperslab((start,) + (0,) * (values.ndim - 1), values.shape)
    dataset.id.write(h5py.h5s.create_simple(values.shape), rows, values)


def coherent(path: Path) -> bool:
    """Whether machines can write neighbouring rows at once, as on disks and parallel file systems.

    NFS and SMB do not see to that. What is mounted where is known on Linux only; elsewhere and in
    doubt the answer is yes.
    """
    real = Path(os.path.realpath(path))  # loops of links are for others to refuse
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
    """What went wrong with the disk, in words; None if the error is about something else.

    h5py raises OSError, RuntimeError or ValueError for one and the same system error, depending
    on the call; its number stands in the text.
    """
    match = re.search(r"errno = (\d+)", str(error))
    number = int(match[1]) if match else getattr(error, "errno", None)
    if number is not None:
        reason = os.strerror(number)
        return f"the disk is full ({reason})" if number in FULL else f"cannot be written: {reason}"
    return f"cannot be written: {first_line(error)}" if isinstance(error, OSError) else None


def first_line(error: Exception) -> str:
    """First line of an error's text: messages to users have no more."""
    return str(error).partition("\n")[0]
