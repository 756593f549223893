"""Memory: what this process may take, and what a contact problem needs."""

import os
import resource
from contextlib import suppress
from pathlib import Path

from gen.runtime.errors import InputError

MIB = 2**20

SOLVE_BYTES = 400
"""Peak bytes a node of one solve: 360 were measured on 513 to 2,049 nodes a side, where areas were
2 to 3 %."""

CONTACT_BYTES = 32
"""Bytes a node of a solution that is kept: heights, pressure, displacement, gap."""


def allowed() -> int:
    """Return what this process may take [bytes]: the machine's, less where it has been given less.

    Limits of containers, of jobs and of the shell (`ulimit -v`) count.
    """
    limits = [os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")]
    for name in ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes"):
        with suppress(OSError, ValueError):
            limits.append(int(Path(name).read_text(encoding="ascii")))
    with suppress(KeyError, ValueError):  # set by Slurm, in MiB
        limits.append(int(os.environ["SLURM_MEM_PER_NODE"]) * MIB)
    shell, _ = resource.getrlimit(resource.RLIMIT_AS)
    if shell != resource.RLIM_INFINITY:
        limits.append(shell)
    return max(min(limits), 0)


def require_for_contacts(loads: int, shape: tuple[int, ...]) -> None:
    """Refuse more contacts of one surface than memory holds, before the first is solved.

    Raises
    ------
    InputError
        With what they need, and what there is.
    """
    nodes = shape[0] * shape[1]
    needed = nodes * (SOLVE_BYTES + loads * CONTACT_BYTES)
    if loads > 1 and needed > allowed():
        raise InputError(
            f"{loads} loads on {shape[0]} x {shape[1]} nodes need about {size(needed)} of memory,"
            f" {size(allowed())} are allowed here: give fewer loads"
        )


def too_little_for_solve(shape: tuple[int, ...]) -> InputError:
    """Return the error for a solve that has run out of memory: what it needs, what there is."""
    needed = shape[0] * shape[1] * SOLVE_BYTES
    return InputError(
        f"a contact of {shape[0]} x {shape[1]} nodes does not fit into memory: it needs about"
        f" {size(needed)}, {size(allowed())} are allowed here, shared with all else; take fewer"
        " nodes, or more memory for each process"
    )


def size(count: float) -> str:
    """Return a number of bytes in words, in the unit that suits it: "330 bytes", "1.5 GB"."""
    for unit, bytes_of_one in (("TB", 1e12), ("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if abs(count) >= bytes_of_one:
            return f"{count / bytes_of_one:,.1f} {unit}"
    return f"{count:.0f} bytes"
