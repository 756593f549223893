"""The threads of one solve: they share passes over long arrays, piece by piece.

Pieces do not depend on the number of threads, and no sum runs over more than one piece, so that
results are the same to the last bit on any number of threads.
"""

import os
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from contextvars import copy_context
from typing import Any, TypeVar

from bem.sections import unforked

Piece = TypeVar("Piece")

# The variable by which programs that compute on several threads are told how many.
THREADS_VARIABLE = "OMP_NUM_THREADS"


class Workers:
    """The threads of a solve: the one that called it, and helpers.

    Parameters
    ----------
    threads : int
        Number of threads, the calling one included.
    pool : Executor, optional
        Pool of the helpers; None for a single thread.
    """

    def __init__(self, threads: int = 1, pool: ThreadPoolExecutor | None = None) -> None:
        self.threads = threads
        self._pool = pool

    def share(self, work: Callable[[Piece], None], pieces: Sequence[Piece]) -> None:
        """Do some work on each of the pieces, in any order, and return when all are done.

        Parameters
        ----------
        work : callable
            Called with one piece at a time; no two pieces may write to the same place.
        pieces : sequence
            The pieces. A single piece stays on the calling thread.
        """
        if self._pool is None or len(pieces) < 2:
            for piece in pieces:
                work(piece)
            return
        left = deque(pieces)

        def draw() -> None:
            while left:
                try:
                    piece = left.popleft()
                except IndexError:  # another thread was faster
                    return
                work(piece)

        helpers: list[Future[None]] = []
        try:
            for _ in pieces[1 : self.threads]:
                helpers += [self._pool.submit(copy_context().run, draw)]
            draw()
        finally:  # on Ctrl-C too: nobody may still write when the caller goes on
            left.clear()
            wait(helpers)
        for helper in helpers:
            helper.result()


class _Current(threading.local):
    """The workers of the solve that runs on this thread."""

    workers = Workers()


_CURRENT = _Current()


def workers() -> Workers:
    """Return the workers of the solve that runs on this thread; by default the thread alone."""
    return _CURRENT.workers


@contextmanager
def on_threads(threads: int | None) -> Iterator[None]:
    """Let solves on this thread use helpers until the end of the block.

    Parameters
    ----------
    threads : int or None
        Number of threads, this one included; None for those of an outer block, or for as many as
        `OMP_NUM_THREADS` says, or for one.
    """
    before = _CURRENT.workers
    if threads is None:
        threads = before.threads if before.threads > 1 else default_threads(1)
    if threads == before.threads:
        yield
    elif threads == 1:
        with led_by(Workers()):
            yield
    else:
        with unforked():
            pool = ThreadPoolExecutor(threads - 1, thread_name_prefix="bem")
        with pool, led_by(Workers(threads, pool)):
            yield


@contextmanager
def led_by(team: Workers) -> Iterator[None]:
    """Let solves on this thread share their work among some workers."""
    before, _CURRENT.workers = _CURRENT.workers, team
    try:
        yield
    finally:
        _CURRENT.workers = before


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


def checked_threads(threads: Any) -> int | None:
    """Return a number of threads, or refuse it.

    Raises
    ------
    ValueError
        If it is neither None nor a whole number of 1 or more.
    """
    if threads is None:
        return None
    whole = isinstance(threads, int) or hasattr(threads, "__index__")
    if not whole or isinstance(threads, bool) or int(threads) < 1:
        raise ValueError(f"threads = {threads!r}: give a whole number of 1 or more")
    return int(threads)
