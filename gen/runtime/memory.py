"""Tell how much memory this process may take, and how much the solution of a contact needs."""

import errno
import mmap
import os
import re
import resource
import signal
from contextlib import suppress
from pathlib import Path
from typing import NoReturn

from gen.runtime.errors import InputError

MIB = 2**20

SOLVE_BYTES = 400
"""Peak memory of a solution [bytes / node]; 360 were measured on 513 to 2,049 nodes a side."""

BLAS_NODES = 200
"""Rows and columns of the matrices of a trial; BLAS multiplies smaller ones without a buffer."""

BLAS_PATIENCE = 5.0
"""CPU time after which a trial of BLAS counts as hanging [s]; its imports take 0.3 s."""

HEADROOM = 64 * MIB
"""Memory that the other libraries of a command need [bytes]; some abort if there is none."""

SHORTAGE = re.compile(
    "failed to map segment|cannot allocate memory|can't start new thread", re.I
)
"""Messages of errors by which libraries report that memory is short without a MemoryError."""


def allowed() -> int:
    """Return the memory that machine, container, batch job and shell allow this process [bytes].

    This is the smallest of the four limits. Unknown limits are ignored.
    """
    machine_memory = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    limits = [machine_memory]
    container_limits = (
        "/sys/fs/cgroup/memory.max",
        "/sys/fs/cgroup/memory/memory.limit_in_bytes",
    )
    for name in container_limits:
        # There is no such file, or it has the word "max" for no limit.
        with suppress(OSError, ValueError):
            limits.append(int(Path(name).read_text(encoding="ascii")))
    with suppress(KeyError, ValueError):  # set by Slurm, in MiB
        limits.append(int(os.environ["SLURM_MEM_PER_NODE"]) * MIB)
    shell_limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    if shell_limit != resource.RLIM_INFINITY:
        limits.append(shell_limit)
    return max(min(limits), 0)


def free() -> int:
    """Return the memory that the system can give now [bytes]; if that is unknown, `allowed()`."""
    with suppress(OSError, ValueError, IndexError):
        table = Path("/proc/meminfo").read_text(encoding="ascii")
        kibibytes = table.partition("MemAvailable:")[2].split()[0]
        return int(kibibytes) * 1024
    return allowed()


def is_shortage(error: BaseException) -> bool:
    """Tell whether the cause of an error is that the system gives no more memory.

    Parameters
    ----------
    error : BaseException
        Any error.

    Returns
    -------
    bool
        True for a MemoryError, for an OSError with the number ENOMEM, and for an error of a library
        with one of the messages `SHORTAGE`.
    """
    if isinstance(error, OSError) and error.errno == errno.ENOMEM:
        return True
    if isinstance(error, ImportError | OSError | RuntimeError):
        return SHORTAGE.search(str(error)) is not None
    return isinstance(error, MemoryError)


def require_blas() -> None:
    """Let BLAS allocate its buffers before any work, if the shell limits the address space.

    Without such a limit, nothing is done. OpenBLAS allocates a buffer at its first large product,
    one in NumPy and one in SciPy, and keeps it. If there is no room for the buffer, OpenBLAS ends
    the process or tries forever. A child process therefore tries first. It needs `HEADROOM` beside
    the buffers, since this process may need a little more than its child.

    Raises
    ------
    MemoryError
        If there is no room for the buffers and `HEADROOM` beside them.
    """
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    if limit == resource.RLIM_INFINITY:
        return
    child = os.fork()
    if child == 0:
        _try_blas()
    _, status = os.waitpid(child, 0)
    if status:  # the child has failed, or a signal has ended it
        needed = format_bytes(HEADROOM)
        raise MemoryError(
            "no room for NumPy, SciPy and their buffers for products of matrices,"
            f" with {needed} beside them"
        )
    _use_blas()


def _try_blas() -> NoReturn:
    """Use BLAS in a child process, and end the process.

    The exit code is 0 only if BLAS has its buffers and there is `HEADROOM` beside them. A signal
    ends the process after `BLAS_PATIENCE`.
    """
    try:
        # OpenBLAS complains on standard error.
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, 2)
        signal.signal(signal.SIGPROF, signal.SIG_DFL)
        signal.setitimer(signal.ITIMER_PROF, BLAS_PATIENCE)
        _use_blas()
        mmap.mmap(-1, HEADROOM).close()
        os._exit(0)
    finally:
        os._exit(1)


def _use_blas() -> None:
    """Multiply matrices by the BLAS of NumPy and by that of SciPy, so that each has its buffer."""
    import numpy as np
    from scipy.linalg.blas import dgemm

    matrix = np.ones((BLAS_NODES, BLAS_NODES))
    np.dot(matrix, matrix)
    dgemm(1.0, matrix, matrix)


def too_little_for_solve(shape: tuple[int, ...]) -> InputError:
    """Make the error for a contact whose solution has run out of memory.

    Parameters
    ----------
    shape : (int, int)
        Number of nodes along x and y.

    Returns
    -------
    InputError
        An error to raise, which states the memory that the contact needs and what is allowed.
    """
    needed = shape[0] * shape[1] * SOLVE_BYTES
    return InputError(
        f"a contact of {shape[0]} x {shape[1]} nodes does not fit into memory: it needs"
        f" about {format_bytes(needed)}, {format_bytes(allowed())} are allowed here, shared"
        " with all else; take fewer nodes, or more memory for each process"
    )


def format_bytes(count: float) -> str:
    """Format a number of bytes with a unit.

    Parameters
    ----------
    count : float
        Number of bytes.

    Returns
    -------
    str
        Number with its unit, such as "330 bytes" or "1.5 GB". The unit is the largest one of which
        there is at least 1, among TB, GB, MB, kB (1000 bytes) and bytes.
    """
    for unit, unit_bytes in (("TB", 1e12), ("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if abs(count) >= unit_bytes:
            return f"{count / unit_bytes:,.1f} {unit}"
    return f"{count:.0f} bytes"
