"""Threads of a solve and of others: shared passes, sections on one BLAS thread, safe forks.

Threads share a pass over a long array piece by piece. Pieces do not depend on the number of
threads, and no sum runs over more than one, so that results are the same bits on any number.

For the small matrices here, a pool of BLAS threads takes longer than a single thread, and the order
of its sums depends on the number of threads. BLAS, FFTW's planner and the Fourier transforms of
scipy hold locks: a child that is forked while another thread holds one would wait for it forever.
"""

import os
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import contextmanager
from contextvars import copy_context
from functools import lru_cache
from typing import Any, Generic, Self, TypeVar, overload

import numpy as np

Piece = TypeVar("Piece")
Value = TypeVar("Value")

# The controller of a BLAS library and its number of threads.
BlasThreads = tuple[Any, int]

# The variable by which programs that compute on several threads are told how many.
THREADS_VARIABLE = "OMP_NUM_THREADS"

# Block that is freed once, so that the process keeps what solves free [bytes].
BLOCK = 16 * 2**20


# Threads that share passes


class _Current(threading.local):
    """The threads of the solve that runs on this thread: their number, and the other ones."""

    threads = 1
    helpers: ThreadPoolExecutor | None = None


_CURRENT = _Current()


def threads_here() -> int:
    """Return the number of threads that share passes of this one, which counts as one."""
    return _CURRENT.threads


def share(work: Callable[[int, Piece], None], pieces: Sequence[Piece]) -> None:
    """Do some work on each of the pieces, in any order, and return when all are done.

    Parameters
    ----------
    work : callable
        Called with the number of a thread, from 0 for this one, and one piece; no two pieces may
        write to the same place.
    pieces : sequence
        The pieces. A single piece stays on this thread.
    """
    left = deque(pieces)

    def draw(thread: int) -> None:
        while left:
            try:
                piece = left.popleft()
            except IndexError:  # another thread was faster
                return
            work(thread, piece)

    jobs = []
    try:
        if _CURRENT.helpers is not None:
            for thread in range(1, min(_CURRENT.threads, len(left))):
                jobs.append(_CURRENT.helpers.submit(copy_context().run, draw, thread))  # noqa: PERF401  known on Ctrl-C
        draw(0)
    finally:  # on Ctrl-C too: nobody may still write when the caller goes on
        left.clear()
        wait([job for job in jobs if not job.cancel()])
    for job in jobs:
        if not job.cancelled():
            job.result()


@contextmanager
def on_threads(threads: int | None) -> Iterator[None]:
    """Let solves on this thread use helpers until the end of the block.

    Parameters
    ----------
    threads : int or None
        Number of threads, this one included, of which no more are used than there are processors;
        None for those of an outer block, or for as many as `OMP_NUM_THREADS` says, or for one.
    """
    before = _CURRENT.threads, _CURRENT.helpers
    if threads is None:
        threads = before[0] if before[0] > 1 else default_threads(1)
    if threads > before[0]:
        threads = min(threads, max(cores(), before[0]))
    if threads == before[0]:
        yield
        return
    helpers = ThreadPoolExecutor(threads - 1, "bem") if threads > 1 else None
    try:
        _CURRENT.threads, _CURRENT.helpers = threads, helpers
        yield
    finally:
        _CURRENT.threads, _CURRENT.helpers = before
        if helpers is not None:
            helpers.shutdown()


def cores() -> int:
    """Return the number of processors that this process may run on."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def default_threads(otherwise: int) -> int:
    """Return the number of threads that `OMP_NUM_THREADS` asks for, or another one if it is unset.

    Lists of numbers, one for each level of nested threads, count by their first; what is no number
    above 0 counts as unset.
    """
    said = os.environ.get(THREADS_VARIABLE, "").split(",")[0].strip()
    return int(said) if said.isdecimal() and int(said) > 0 else otherwise


def keep_freed_memory() -> None:
    """Let glibc keep what a solve frees, up to twice `BLOCK`; other C libraries ignore this.

    By default glibc returns the end of its heap to the system as soon as little of it is free, and
    the next solve waits for the same pages to be cleared again: up to a fifth of its time on 256
    nodes a side. Both thresholds rise with the largest block that was freed (mallopt(3)); no page
    of this one is ever touched.
    """
    np.empty(BLOCK, np.uint8)


# Sections of compiled code


class computed_once(Generic[Value]):  # noqa: N801  used as a decorator, as `property` is
    """A property that is computed when it is first read, and then kept.

    Unlike `functools.cached_property` of Python 3.11 it holds no lock meanwhile, which a child that
    is forked then would wait for. Two threads may both compute it; all see what is kept first.
    """

    def __init__(self, compute: Callable[[Any], Value]) -> None:
        self._compute, self.__doc__ = compute, compute.__doc__

    def __set_name__(self, owner: type, name: str) -> None:
        """Take the name under which objects keep the value."""
        self._name = name

    @overload
    def __get__(self, instance: None, owner: type) -> Self: ...
    @overload
    def __get__(self, instance: object, owner: type) -> Value: ...
    def __get__(self, instance: object | None, owner: type) -> Self | Value:
        """Compute the value; the object's own entry takes the place of this property from then."""
        if instance is None:
            return self
        value: Value = instance.__dict__.setdefault(self._name, self._compute(instance))
        return value


class _Sections:
    """The threads inside sections, and the numbers of BLAS threads before the first dense one.

    A handler of a signal may raise between any two steps of Python. So the lock itself is entered,
    in one step each way; a condition is entered in Python, and would stay locked now and then. No
    loop stands in the block that holds the lock, only in what it calls: an error raised where such
    a loop begins again would skip the end of the block (a fault of Python 3.12 and 3.13).
    """

    def __init__(self) -> None:
        self.lock = threading.RLock()
        self.changed = threading.Condition(self.lock)
        self.inside: dict[int, int] = {}
        self.dense: dict[int, int] = {}
        self.threads_before: list[BlasThreads] = []

    def put(self, depth: int) -> None:
        """Count the current thread as inside some sections; at 0, wake a fork that waits for it."""
        with self.lock:
            if depth:
                self.inside[threading.get_ident()] = depth
            else:
                self.inside.pop(threading.get_ident(), None)
                self.changed.notify_all()

    def put_dense(self, depth: int) -> None:
        """Count the current thread as inside dense sections: BLAS has one thread meanwhile.

        The first dense section notes the numbers that it finds, and the last one restores them.
        """
        pools = _blas_pools()
        with self.lock:
            self._count_dense(depth, pools)

    def _count_dense(self, depth: int, pools: list[Any]) -> None:
        more = [
            (pool, threads) for pool in pools if (threads := pool.get_num_threads()) != 1
        ]
        if depth and not self.dense:
            self.threads_before = more
        if depth:
            self.dense[threading.get_ident()] = depth
        else:
            self.dense.pop(threading.get_ident(), None)
        wanted = [(pool, 1) for pool, _ in more] if self.dense else self.threads_before
        for pool, threads in wanted:
            # OpenBLAS obeys a single thread of Python until that thread ends or lets go.
            let_go = getattr(pool, "clear_controlling_thread", lambda force: None)
            let_go(force=True)
            pool.set_num_threads(threads)
            let_go(force=True)
        if not self.dense:
            self.threads_before = []

    def hold(self) -> None:
        """Wait until no other thread is inside, and let none in before `resume`."""
        self.changed.acquire()
        while set(self.inside) - {threading.get_ident()}:
            self.changed.wait()

    def resume(self) -> None:
        """Let other threads in again."""
        self.changed.release()


_SECTIONS = _Sections()
if hasattr(os, "register_at_fork"):  # on every system that has fork
    os.register_at_fork(
        before=_SECTIONS.hold,
        after_in_parent=_SECTIONS.resume,
        after_in_child=_SECTIONS.resume,
    )


@contextmanager
def _at_depth(put: Callable[[int], None], depths: dict[int, int]) -> Iterator[None]:
    """Go one section deeper than this thread is, and back."""
    depth = depths.get(threading.get_ident(), 0)
    try:
        put(depth + 1)
        yield
    finally:  # on Ctrl-C or a row's end of time, before or after `put` has counted, too
        try:
            put(depth)
        except BaseException:  # or meanwhile
            put(depth)
            raise


@contextmanager
def unforked() -> Iterator[None]:
    """Run compiled code that holds locks; a fork waits until it has ended."""
    with _at_depth(_SECTIONS.put, _SECTIONS.inside):
        yield


@contextmanager
def on_one_blas_thread() -> Iterator[None]:
    """Run dense linear algebra on one BLAS thread; a fork waits until it has ended.

    The number of BLAS threads is a setting of the whole process. BLAS that other threads call in
    the meantime runs on one thread too, and a number that they set may be lost.
    """
    with unforked(), _at_depth(_SECTIONS.put_dense, _SECTIONS.dense):
        yield


@lru_cache(maxsize=1)
def _blas_pools() -> list[Any]:
    """Return the controllers of the BLAS libraries of numpy and scipy."""
    import scipy.linalg  # noqa: F401  loads its BLAS, so that threadpoolctl sees it
    from threadpoolctl import ThreadpoolController

    pools: list[Any] = ThreadpoolController().select(user_api="blas").lib_controllers
    return pools
