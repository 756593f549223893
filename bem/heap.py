"""Memory that stays with the process from one solve to the next."""

import numpy as np

# Block that is freed once [bytes].
BLOCK = 16 * 2**20


def keep_freed_memory() -> None:
    """Let glibc keep what a solve frees, up to twice `BLOCK`; other C libraries ignore this.

    By default glibc returns the end of its heap to the system as soon as little of it is free, and
    the next solve waits for the same pages to be cleared again: up to a fifth of its time on 256
    nodes a side. Both thresholds rise with the largest block that was freed (mallopt(3)); no page
    of this one is ever touched.
    """
    np.empty(BLOCK, np.uint8)
