"""Threads of a solve and of other programs: shared passes, one BLAS thread, safe forks.

Threads share a pass over a long array piece by piece. Pieces do not depend on the number of
threads, and no sum runs over more than one piece, so that any number of threads computes the same
bits.

For the small matrices of this package, a pool of BLAS threads takes longer than a single thread,
and the order of its sums depends on the number of threads. BLAS, FFTW's planner and the Fourier
transforms of scipy hold locks: a child that is forked while another thread holds a lock would wait
for it forever. Code that holds such locks therefore runs in sections, for whose end a fork waits.
"""

import os
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import contextmanager
from contextvars import copy_context
from functools import lru_cache
from typing import Any, Generic, NamedTuple, Self, TypeVar, overload

import numpy as np

Piece = TypeVar("Piece")
Value = TypeVar("Value")

# The environment variable that sets the number of threads of programs that compute on several.
THREADS_VARIABLE = "OMP_NUM_THREADS"

# Size of the block that `keep_freed_memory` frees once, so that the process keeps the memory that
# solves free [bytes].
BLOCK = 16 * 2**20


class BlasThreads(NamedTuple):
    """A BLAS library and its number of threads.

    Attributes
    ----------
    pool : object
        Controller of the library, from threadpoolctl.
    threads : int
        Number of threads.
    """

    pool: Any
    threads: int


# Threads that share passes


class _Current(threading.local):
    """The threads of the solve that runs on this thread; every thread has its own values."""

    threads = 1  # their number, this thread included
    helpers: ThreadPoolExecutor | None = None  # the other ones, None if there are none


_CURRENT = _Current()


def threads_here() -> int:
    """Return the number of threads that share passes of this thread, itself included."""
    return _CURRENT.threads


def share(work: Callable[[int, Piece], None], pieces: Sequence[Piece]) -> None:
    """Do some work on each of several pieces, in any order, and return when all are done.

    An error of the work is raised again when all threads have stopped.

    Parameters
    ----------
    work : callable
        Function of a thread's number, 0 for this thread, and of a piece. No two pieces may write to
        the same place.
    pieces : sequence
        The pieces. A single piece stays on this thread.
    """
    pending = deque(pieces)

    def work_on_pending(thread: int) -> None:
        """Work on pieces until none is left."""
        while pending:
            try:
                piece = pending.popleft()
            except IndexError:  # another thread was faster
                return
            work(thread, piece)

    jobs = []
    try:
        if _CURRENT.helpers is not None:
            for thread in range(1, min(_CURRENT.threads, len(pending))):
                run = copy_context().run
                job = _CURRENT.helpers.submit(run, work_on_pending, thread)
                # Jobs are noted one by one, so that Ctrl-C finds all that were submitted.
                jobs.append(job)
        work_on_pending(0)
    finally:  # also on Ctrl-C: no thread may still write when the caller goes on
        pending.clear()
        wait([job for job in jobs if not job.cancel()])
    for job in jobs:
        if not job.cancelled():
            job.result()


@contextmanager
def on_threads(threads: int | None) -> Iterator[None]:
    """Let solves on this thread share their work with helper threads until the end of the block.

    Parameters
    ----------
    threads : int or None
        Number of threads, this one included. It is cut off at the number of processors, unless an
        outer block already uses more. None takes the number of an outer block if that is above one,
        else the number that `OMP_NUM_THREADS` sets, else one.

    Yields
    ------
    None
        Once, when the helper threads are ready.
    """
    threads_before = _CURRENT.threads
    helpers_before = _CURRENT.helpers
    if threads is None:
        threads = threads_before
        if threads == 1:
            threads = default_threads(1)
    if threads > threads_before:
        threads = min(threads, max(cores(), threads_before))
    if threads == threads_before:
        yield
        return
    helpers = None
    if threads > 1:
        helpers = ThreadPoolExecutor(threads - 1, "bem")
    try:
        _CURRENT.threads = threads
        _CURRENT.helpers = helpers
        yield
    finally:
        _CURRENT.threads = threads_before
        _CURRENT.helpers = helpers_before
        if helpers is not None:
            helpers.shutdown()


def cores() -> int:
    """Return the number of processors that this process may run on."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def default_threads(otherwise: int) -> int:
    """Return the number of threads that the environment variable `OMP_NUM_THREADS` sets.

    Of a list of numbers, one for each level of nested threads, the first one is taken.

    Parameters
    ----------
    otherwise : int
        Number to return if the variable is unset, or holds no whole number above 0.

    Returns
    -------
    int
        Number of threads.
    """
    text = os.environ.get(THREADS_VARIABLE, "").split(",")[0].strip()
    if text.isdecimal() and int(text) > 0:
        return int(text)
    return otherwise


def keep_freed_memory() -> None:
    """Let glibc keep the memory that solves free, up to twice `BLOCK`.

    This changes thresholds of the whole process; other C libraries ignore it. By default glibc
    returns the end of its heap to the system as soon as a little of it is free, and the next solve
    waits for the same pages to be cleared again: up to a fifth of its time on 256 nodes a side.
    glibc raises both thresholds to the size of the largest block that was freed (mallopt(3)), and a
    block of which no page is touched costs nothing.
    """
    np.empty(BLOCK, np.uint8)


# Sections of compiled code


class computed_once(Generic[Value]):  # noqa: N801  used as a decorator, as `property` is
    """A property that is computed when it is first read, and then kept.

    Unlike `functools.cached_property` of Python 3.11 it holds no lock while it computes, for which
    a child that is forked in the meantime would wait. If two threads compute it at once, all
    readers get the value that was kept first.

    Parameters
    ----------
    compute : callable
        Method that computes the value; its docstring becomes that of the property.
    """

    def __init__(self, compute: Callable[[Any], Value]) -> None:
        self._compute = compute
        self.__doc__ = compute.__doc__

    def __set_name__(self, owner: type, name: str) -> None:
        """Note the name under which objects keep the value."""
        self._name = name

    @overload
    def __get__(self, instance: None, owner: type) -> Self: ...
    @overload
    def __get__(self, instance: object, owner: type) -> Value: ...
    def __get__(self, instance: object | None, owner: type) -> Self | Value:
        """Compute the value and keep it in the object, where it replaces this property."""
        if instance is None:
            return self
        value: Value = instance.__dict__.setdefault(self._name, self._compute(instance))
        return value


class _Sections:
    """The threads inside sections, and the numbers of BLAS threads before the first dense section.

    A handler of a signal may raise between any two steps of Python. Therefore blocks enter the lock
    itself, in one step each way: a condition is entered by several steps in Python, and would
    sometimes stay locked. The block that holds the lock contains no loop, only calls of functions
    with loops: an error that is raised where a loop begins again would skip the end of the block
    (a fault of Python 3.12 and 3.13).

    Attributes
    ----------
    lock : RLock
        Lock of all other attributes.
    changed : Condition
        Condition that tells a fork when a thread has left its last section.
    inside, dense : dict
        Depths of nested sections, and of nested dense sections, by the identifiers of the threads
        that are inside any.
    threads_before : list of BlasThreads
        Numbers of threads to restore after the last dense section.
    """

    def __init__(self) -> None:
        self.lock = threading.RLock()
        self.changed = threading.Condition(self.lock)
        self.inside: dict[int, int] = {}
        self.dense: dict[int, int] = {}
        self.threads_before: list[BlasThreads] = []

    def put(self, depth: int) -> None:
        """Note at which depth of sections the current thread is; at 0, wake a fork that waits."""
        with self.lock:
            if depth:
                self.inside[threading.get_ident()] = depth
            else:
                self.inside.pop(threading.get_ident(), None)
                self.changed.notify_all()

    def put_dense(self, depth: int) -> None:
        """Note at which depth of dense sections the current thread is.

        The first dense section of all threads notes the numbers of BLAS threads and sets them to
        one; the end of the last section restores them.
        """
        pools = _blas_pools()
        with self.lock:
            self._count_dense(depth, pools)

    def _count_dense(self, depth: int, pools: list[Any]) -> None:
        """Do the work of `put_dense`, with the controllers of all BLAS libraries."""
        numbers = [BlasThreads(pool, pool.get_num_threads()) for pool in pools]
        several = [number for number in numbers if number.threads != 1]
        if depth and not self.dense:
            self.threads_before = several
        if depth:
            self.dense[threading.get_ident()] = depth
        else:
            self.dense.pop(threading.get_ident(), None)
        if self.dense:
            for number in several:
                _set_blas_threads(number.pool, 1)
        else:
            for number in self.threads_before:
                _set_blas_threads(number.pool, number.threads)
            self.threads_before = []

    def hold(self) -> None:
        """Wait until no other thread is inside a section, and let none enter before `resume`."""
        self.changed.acquire()
        while set(self.inside) - {threading.get_ident()}:
            self.changed.wait()

    def resume(self) -> None:
        """Let other threads enter sections again."""
        self.changed.release()


def _set_blas_threads(pool: Any, threads: int) -> None:
    """Set the number of threads of a BLAS library, by its controller."""
    # OpenBLAS obeys a single thread of Python until that thread ends or lets go.
    let_go = getattr(pool, "clear_controlling_thread", lambda force: None)
    let_go(force=True)
    pool.set_num_threads(threads)
    let_go(force=True)


_SECTIONS = _Sections()
if hasattr(os, "register_at_fork"):  # on every system that has fork
    os.register_at_fork(
        before=_SECTIONS.hold,
        after_in_parent=_SECTIONS.resume,
        after_in_child=_SECTIONS.resume,
    )


@contextmanager
def _at_depth(put: Callable[[int], None], depths: dict[int, int]) -> Iterator[None]:
    """Go one section deeper than this thread is, and back at the end of the block.

    `put` notes a depth of this thread in `depths`.
    """
    depth = depths.get(threading.get_ident(), 0)
    try:
        put(depth + 1)
        yield
    finally:  # also if Ctrl-C or a row's time limit interrupts the first `put`
        try:
            put(depth)
        except BaseException:  # an interruption during this `put`
            put(depth)
            raise


@contextmanager
def unforked() -> Iterator[None]:
    """Run a block of compiled code that holds locks; a fork waits until the block has ended."""
    with _at_depth(_SECTIONS.put, _SECTIONS.inside):
        yield


@contextmanager
def on_one_blas_thread() -> Iterator[None]:
    """Run a block of dense linear algebra on one BLAS thread; a fork waits until it has ended.

    The number of BLAS threads is a setting of the whole process. BLAS that other threads call in
    the meantime also runs on one thread, and a number that they set may be lost.
    """
    with unforked(), _at_depth(_SECTIONS.put_dense, _SECTIONS.dense):
        yield


@lru_cache(maxsize=1)
def _blas_pools() -> list[Any]:
    """Return the controllers of the BLAS libraries of numpy and scipy, from threadpoolctl."""
    import scipy.linalg  # noqa: F401  loads its BLAS, so that threadpoolctl sees it
    from threadpoolctl import ThreadpoolController

    pools: list[Any] = ThreadpoolController().select(user_api="blas").lib_controllers
    return pools
