"""Memory: the need of a fit, and the supply of this machine.

The needs were measured (`bench memory`, at commit 10684ff): bytes per pair of rows for the kernel
methods, per row for the others, on top of a process with its libraries and data.
"""

from gen.runtime.errors import InputError
from gen.runtime.memory import MIB, allowed, free

USABLE = 0.85
"""Share of the free memory that a fit may take; the rest is the system's."""

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
    """Estimate the peak memory of one process that fits a model to some rows [bytes].

    A baseline needs less than the largest candidate of the search.
    """
    pairs = PAIR_BYTES.get(model, 0.0)
    if baseline:
        pairs = BASELINE_PAIR_BYTES.get(model, pairs)
    flat = 0 if baseline else FLAT.get(model, 256 * MIB)
    return int(PROCESS + pairs * rows**2 + flat * max(1.0, rows / FLAT_ROWS))


def available() -> int:
    """Return the memory that a fit may take on this machine now [bytes]."""
    return int(USABLE * min(allowed(), free()))


def check(model: str, rows: int, *, baseline: bool = False) -> None:
    """Refuse a model that this machine cannot hold; see `needed`.

    InputError tells the need, the supply, and a number of rows that would fit.
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
