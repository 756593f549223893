"""The memory that this process may take, and the memory that a contact problem needs."""

import errno
import mmap
import os
import re
import resource
import signal
from contextlib import suppress
from pathlib import Path

from gen.runtime.errors import InputError

MIB = 2**20

SOLVE_BYTES = (
    400  # peak memory of a solve per node: 360 were measured on 513 to 2,049 a side
)

BLAS_NODES = 200  # side of matrices whose product needs a buffer; small ones are multiplied without
BLAS_PATIENCE = (
    5.0  # CPU time after which a trial of BLAS counts as hanging; imports take 0.3 [s]
)

# What the libraries of a command take besides [bytes]; some of them abort where nothing is left.
HEADROOM = 64 * MIB

# What libraries say, in errors of other types than MemoryError, when the system gives no memory.
SHORTAGE = re.compile(
    "failed to map segment|cannot allocate memory|can't start new thread", re.I
)


def allowed() -> int:
    """Return the memory that machine, container, batch job and shell allow here [bytes]."""
    limits = [os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")]
    for name in (
        "/sys/fs/cgroup/memory.max",
        "/sys/fs/cgroup/memory/memory.limit_in_bytes",
    ):
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
        told = (
            Path("/proc/meminfo")
            .read_text(encoding="ascii")
            .partition("MemAvailable:")[2]
        )
        return int(told.split()[0]) * 1024
    return allowed()


def is_shortage(error: BaseException) -> bool:
    """Tell whether an error says that the system gives no more memory.

    Parameters
    ----------
    error : BaseException
        MemoryError, or what Python raises for a library, a thread or a process without room.

    Returns
    -------
    bool
        Whether memory is short.
    """
    if isinstance(error, OSError) and error.errno == errno.ENOMEM:
        return True
    if isinstance(error, ImportError | OSError | RuntimeError):
        return SHORTAGE.search(str(error)) is not None
    return isinstance(error, MemoryError)


def require_blas() -> None:
    """Let BLAS take its buffers before any work, where the shell limits the address space.

    OpenBLAS takes a buffer with its first large product, one in NumPy and one in SciPy, and keeps
    it. Where there is no room for it, it ends the process or asks for ever. A child tries it first.

    Raises
    ------
    MemoryError
        If there is no room for the buffers, or none is left beside them.
    """
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    if limit == resource.RLIM_INFINITY:
        return
    child = os.fork()
    if child == 0:
        try:
            os.dup2(os.open(os.devnull, os.O_WRONLY), 2)  # OpenBLAS complains there
            signal.signal(signal.SIGPROF, signal.SIG_DFL)
            signal.setitimer(signal.ITIMER_PROF, BLAS_PATIENCE)
            _use_blas()
            os._exit(0)
        finally:
            os._exit(1)
    _, status = os.waitpid(child, 0)
    if status:
        raise MemoryError(
            "no room for NumPy, SciPy and their buffers for products of matrices"
        )
    _use_blas()
    try:
        mmap.mmap(-1, HEADROOM).close()
    except OSError:
        raise MemoryError(
            f"{format_bytes(HEADROOM)} are wanted besides NumPy and SciPy"
        ) from None


def _use_blas() -> None:
    """Multiply matrices by each BLAS, which takes a buffer for it."""
    import numpy as np
    from scipy.linalg.blas import dgemm

    matrix = np.ones((BLAS_NODES, BLAS_NODES))
    np.dot(matrix, matrix)
    dgemm(1.0, matrix, matrix)


def too_little_for_solve(shape: tuple[int, ...]) -> InputError:
    """Return the error for a solve that ran out of memory, with what it needs and may take."""
    needed = shape[0] * shape[1] * SOLVE_BYTES
    return InputError(
        f"a contact of {shape[0]} x {shape[1]} nodes does not fit into memory: it needs about"
        f" {format_bytes(needed)}, {format_bytes(allowed())} are allowed here, shared with all"
        " else; take fewer nodes, or more memory for each process"
    )


def format_bytes(count: float) -> str:
    """Format a number of bytes with a suitable unit, as "330 bytes" or "1.5 GB"."""
    for unit, bytes_of_one in (("TB", 1e12), ("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if abs(count) >= bytes_of_one:
            return f"{count / bytes_of_one:,.1f} {unit}"
    return f"{count:.0f} bytes"
