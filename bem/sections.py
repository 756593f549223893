"""Sections of compiled code that run on one BLAS thread and that no fork interrupts.

For the small matrices here, a pool of BLAS threads takes longer than a single thread, and the order
of its sums depends on the number of threads. BLAS, FFTW's planner and the Fourier transforms of
scipy hold locks: a child that is forked while another thread holds one would wait for it forever.
"""

import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import lru_cache
from typing import Any, Generic, Self, TypeVar, overload

Value = TypeVar("Value")

# The controller of a BLAS library and its number of threads.
BlasThreads = tuple[Any, int]


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
    in one step each way; a condition is entered in Python, and would stay locked now and then.
    """

    def __init__(self) -> None:
        self.lock = threading.RLock()
        self.changed = threading.Condition(self.lock)
        self.depths: dict[int, int] = {}
        self.dense: dict[int, int] = {}
        self.threads_before: list[BlasThreads] = []

    def enter(self) -> None:
        """Count the current thread as inside."""
        with self.lock:
            thread = threading.get_ident()
            self.depths[thread] = self.depths.get(thread, 0) + 1

    def depth(self) -> int:
        """Return the number of sections that the current thread is inside."""
        return self.depths.get(threading.get_ident(), 0)

    def leave(self, depth: int) -> None:
        """Return the current thread to a depth; at 0, wake a fork that waits for it."""
        with self.lock:
            thread = threading.get_ident()
            if depth:
                self.depths[thread] = depth
            else:
                self.depths.pop(thread, None)
                self.changed.notify_all()

    def dense_depth(self) -> int:
        """Return the number of dense sections that the current thread is inside."""
        return self.dense.get(threading.get_ident(), 0)

    def limit(self) -> None:
        """Set BLAS to one thread; the first dense section notes the numbers that it finds."""
        pools = _blas_pools()
        with self.lock:
            more = [(pool, threads) for pool in pools if (threads := pool.get_num_threads()) != 1]
            if not self.dense:
                self.threads_before = more
            thread = threading.get_ident()
            self.dense[thread] = self.dense.get(thread, 0) + 1
            _set_threads([(pool, 1) for pool, _ in more])

    def restore(self, depth: int) -> None:
        """Return the current thread to a depth; after the last, restore the numbers of threads."""
        with self.lock:
            thread = threading.get_ident()
            if depth:
                self.dense[thread] = depth
            else:
                self.dense.pop(thread, None)
            if not self.dense:
                _set_threads(self.threads_before)
                self.threads_before = []

    def hold(self) -> None:
        """Wait until no other thread is inside, and let none in before `resume`."""
        self.changed.acquire()
        while set(self.depths) - {threading.get_ident()}:
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
def unforked() -> Iterator[None]:
    """Run compiled code that holds locks; a fork waits until it has ended."""
    depth = _SECTIONS.depth()
    try:
        _SECTIONS.enter()
        yield
    finally:  # on Ctrl-C before or after `enter` has counted too
        try:
            _SECTIONS.leave(depth)
        except BaseException:  # or meanwhile
            _SECTIONS.leave(depth)
            raise


@contextmanager
def on_one_blas_thread() -> Iterator[None]:
    """Run dense linear algebra on one BLAS thread; a fork waits until it has ended.

    The number of BLAS threads is a setting of the whole process. BLAS that other threads call in
    the meantime runs on one thread too, and a number that they set may be lost.
    """
    with unforked():
        depth = _SECTIONS.dense_depth()
        try:
            _SECTIONS.limit()
            yield
        finally:  # on Ctrl-C or a row's end of time, before or after `limit` counted, too
            try:
                _SECTIONS.restore(depth)
            except BaseException:  # or meanwhile
                _SECTIONS.restore(depth)
                raise


def _set_threads(wanted: list[BlasThreads]) -> None:
    """Set the numbers of BLAS threads from any thread of Python."""
    for pool, threads in wanted:
        # OpenBLAS obeys a single thread of Python until that thread ends or lets go.
        let_go = getattr(pool, "clear_controlling_thread", lambda force: None)
        let_go(force=True)
        pool.set_num_threads(threads)
        let_go(force=True)


@lru_cache(maxsize=1)
def _blas_pools() -> list[Any]:
    """Return the controllers of the BLAS libraries of numpy and scipy."""
    import scipy.linalg  # noqa: F401  loads its BLAS, so that threadpoolctl sees it
    from threadpoolctl import ThreadpoolController

    pools: list[Any] = ThreadpoolController().select(user_api="blas").lib_controllers
    return pools
