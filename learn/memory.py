"""Memory: the need of a fit, the supply of this machine, and shares for fits that run side by side.

The needs were measured (`python -m bench memory`): bytes per pair of rows for the kernel methods,
per row for the others, on top of a process with its libraries and data.
"""

import fcntl
import os
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from gen.runtime.errors import InputError
from gen.runtime.memory import MIB, allowed

USABLE = 0.85
"""Share of the machine's memory that fits may take; the rest is the system's."""

PROCESS = 350 * MIB
"""Bytes of a process with its libraries, before any fit."""

PAIR_BYTES = {"gaussian-process": 62.0, "kernel-ridge": 19.0}
"""Peak bytes per pair of training rows; a matrix of double precision has 8."""

BASELINE_PAIR_BYTES = {"gaussian-process": 32.0}
"""The same for a baseline whose kernel is not fitted, where it differs."""

FLAT = {
    "random-forest": 2048 * MIB,
    "adaboost": 1536 * MIB,
    "xgboost": 2560 * MIB,
    "gradient-boost": 1792 * MIB,
    "svm": 512 * MIB,
}
"""Bytes that do not grow with the pairs of rows: up to 2,000 deep trees, a cache of kernel rows."""

FLAT_ROWS = 10_000
"""Number of rows for which `FLAT` holds: trees grow in proportion to the rows."""


def needed(model: str, rows: int, *, baseline: bool = False) -> int:
    """Estimate the peak memory of one process that fits a model [bytes].

    Parameters
    ----------
    model : str
        Name of the model.
    rows : int
        Number of training rows.
    baseline : bool
        True for the baseline, False for the largest candidate of the search.
    """
    pairs = PAIR_BYTES.get(model, 0.0)
    if baseline:
        pairs = BASELINE_PAIR_BYTES.get(model, pairs)
    flat = 0 if baseline else FLAT.get(model, 256 * MIB)
    return int(PROCESS + pairs * rows**2 + flat * max(1.0, rows / FLAT_ROWS))


def available() -> int:
    """Return the memory that fits may take on this machine [bytes]."""
    return int(USABLE * allowed())


def check(model: str, rows: int, *, baseline: bool = False) -> None:
    """Refuse a model that this machine cannot hold.

    Parameters
    ----------
    model : str
        Name of the model.
    rows : int
        Number of training rows.
    baseline : bool
        True for the baseline, False for the largest candidate of the search.

    Raises
    ------
    InputError
        With the need, the supply, and a number of rows that would fit.
    """
    need, limit = needed(model, rows, baseline=baseline), available()
    if need > limit:
        fit = rows
        while fit > 2 and needed(model, fit, baseline=baseline) > limit:
            fit = int(0.98 * fit)
        raise InputError(
            f"{model} needs about {need / 2**30:.1f} GiB for {rows} training rows, this machine has"
            f" {limit / 2**30:.1f} to give: --train-rows {fit} would fit, or leave it out with"
            " --model"
        )


@contextmanager
def reserved(size: int) -> Iterator[None]:
    """Hold memory of this machine for one fit; wait while other fits hold it.

    A fit locks a range of a file that all processes of a user on this machine share: one byte for
    each MiB that it needs. The system drops the locks of a process that dies.

    Parameters
    ----------
    size : int
        Bytes; more than `available()` is held as all of it.
    """
    limit = max(1, available() // MIB)
    length = max(1, min(-(-size // MIB), limit))
    path = Path(tempfile.gettempdir()) / f"asperity-memory-{os.getuid()}"
    with path.open("ab") as file:
        while not _lock_somewhere(file.fileno(), length, limit):
            time.sleep(0.05)
        yield  # closing the file gives the range back


def _lock_somewhere(descriptor: int, length: int, limit: int) -> bool:
    """Lock the first free range of a length below the limit, if there is one."""
    for start in range(0, limit - length + 1, max(1, min(length, limit // 64))):
        with suppress(BlockingIOError, PermissionError):
            fcntl.lockf(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB, length, start)
            return True
    return False
