"""The memory that this process may take, and the memory that a contact problem needs."""

import os
import resource
from contextlib import suppress
from pathlib import Path

from gen.runtime.errors import InputError

MIB = 2**20

SOLVE_BYTES = 400  # peak memory of a solve per node: 360 were measured on 513 to 2,049 a side


def allowed() -> int:
    """Return the memory that machine, container, batch job and shell allow here [bytes]."""
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


def free() -> int:
    """Return the memory that the system could give now [bytes]; all that is allowed if unknown."""
    with suppress(OSError, ValueError, IndexError):
        told = Path("/proc/meminfo").read_text(encoding="ascii").partition("MemAvailable:")[2]
        return int(told.split()[0]) * 1024
    return allowed()


def too_little_for_solve(shape: tuple[int, ...]) -> InputError:
    """Return the error for a solve that ran out of memory, with what it needs and may take."""
    needed = shape[0] * shape[1] * SOLVE_BYTES
    return InputError(
        f"a contact of {shape[0]} x {shape[1]} nodes does not fit into memory: it needs about"
        f" {size(needed)}, {size(allowed())} are allowed here, shared with all else; take fewer"
        " nodes, or more memory for each process"
    )


def size(count: float) -> str:
    """Format a number of bytes with a suitable unit, as "330 bytes" or "1.5 GB"."""
    for unit, bytes_of_one in (("TB", 1e12), ("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if abs(count) >= bytes_of_one:
            return f"{count / bytes_of_one:,.1f} {unit}"
    return f"{count:.0f} bytes"
