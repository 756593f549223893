"""Sections of compiled code: on one BLAS thread, and never in the middle of a fork.

A pool of BLAS threads spins longer than the small matrices here take on one thread, and sums in
another order for every number of threads. BLAS, FFTW's planner and the Fourier transforms of scipy
hold locks of their own: a child that is forked while another thread holds one waits for it forever.
"""

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from typing import Any

BlasThreads = tuple[Any, int]  # a library's controller, and how many threads it has


class _Sections:
    """The threads that are inside of a section, and what BLAS was set to before."""

    def __init__(self) -> None:
        self.changed = threading.Condition()
        self.depths: dict[int, int] = {}
        self.dense = 0
        self.threads_before: list[BlasThreads] = []

    def enter(self) -> None:
        with self.changed:
            thread = threading.get_ident()
            self.depths[thread] = self.depths.get(thread, 0) + 1

    def leave(self) -> None:
        with self.changed:
            thread = threading.get_ident()
            self.depths[thread] -= 1
            if not self.depths[thread]:
                del self.depths[thread]
                self.changed.notify_all()

    def limit(self) -> None:
        """Set BLAS to one thread, unless another thread of ours has done so already."""
        pools = _blas_pools()
        with self.changed:
            self.dense += 1
            if self.dense == 1:
                found = [(pool, pool.get_num_threads()) for pool in pools]
                self.threads_before = [each for each in found if each[1] != 1]
                _set_threads([(pool, 1) for pool, _ in self.threads_before])

    def restore(self) -> None:
        """Give BLAS its threads back once nobody is inside any more."""
        with self.changed:
            self.dense -= 1
            if not self.dense:
                _set_threads(self.threads_before)

    def hold(self) -> None:
        """Wait until no other thread is inside, and let none in before `resume`."""
        self.changed.acquire()
        while set(self.depths) - {threading.get_ident()}:
            self.changed.wait()

    def resume(self) -> None:
        """Let other threads in again."""
        self.changed.release()


_SECTIONS = _Sections()
if hasattr(os, "register_at_fork"):  # every system that forks
    os.register_at_fork(
        before=_SECTIONS.hold,
        after_in_parent=_SECTIONS.resume,
        after_in_child=_SECTIONS.resume,
    )


@contextmanager
def unforked() -> Iterator[None]:
    """Run compiled code that holds locks; a fork waits until it has ended."""
    _SECTIONS.enter()
    try:
        yield
    finally:
        _SECTIONS.leave()


@contextmanager
def on_one_blas_thread() -> Iterator[None]:
    """Run dense linear algebra on one thread of BLAS; a fork waits until it has ended.

    The number of BLAS threads belongs to the whole process: BLAS that other threads call meanwhile
    is on one thread too, and a number that they set meanwhile may be lost.
    """
    with unforked():
        _SECTIONS.limit()
        try:
            yield
        finally:
            _SECTIONS.restore()


def _set_threads(wanted: list[BlasThreads]) -> None:
    """Set numbers of threads, from whichever thread the last one was set."""
    for pool, threads in wanted:
        # OpenBLAS hears one thread of Python until that ends or is told to let go.
        let_go = getattr(pool, "clear_controlling_thread", lambda force: None)
        let_go(force=True)
        pool.set_num_threads(threads)
        let_go(force=True)


@lru_cache(maxsize=1)
def _blas_pools() -> list[Any]:
    """The BLAS libraries of numpy and scipy, to be asked for and given numbers of threads."""
    import scipy.linalg  # noqa: F401  loads its BLAS, which only then can be found
    from threadpoolctl import ThreadpoolController

    pools: list[Any] = ThreadpoolController().select(user_api="blas").lib_controllers
    return pools
