"""The threads and the memory of solves. Threads share passes over long arrays, piece by piece.

Pieces do not depend on the number of threads, and no sum runs over more than one piece, so that
results are the same to the last bit on any number of threads.
"""

import os
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import copy_context
from queue import SimpleQueue
from typing import Any, TypeVar

import numpy as np

from bem.sections import unforked

Piece = TypeVar("Piece")

# The variable by which programs that compute on several threads are told how many.
THREADS_VARIABLE = "OMP_NUM_THREADS"

# Block that is freed once, so that the process keeps what solves free [bytes].
BLOCK = 16 * 2**20


class Workers:
    """The threads of a solve: the one that called it, and helpers.

    Parameters
    ----------
    threads : int
        Number of threads, the calling one included.
    helpers : Helpers, optional
        The other threads; None for a single thread.
    """

    def __init__(self, threads: int = 1, helpers: "Helpers | None" = None) -> None:
        self.threads = threads
        self._helpers = helpers

    def share(self, work: Callable[[Piece], None], pieces: Sequence[Piece]) -> None:
        """Do some work on each of the pieces, in any order, and return when all are done.

        Parameters
        ----------
        work : callable
            Called with one piece at a time; no two pieces may write to the same place.
        pieces : sequence
            The pieces. A single piece stays on the calling thread.
        """
        if self._helpers is None or len(pieces) < 2:
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

        jobs: list[_Job] = []
        errors: list[BaseException | None] = []
        try:
            for _ in pieces[1 : self.threads]:
                jobs.append(_Job(draw))  # before a helper begins it: known on Ctrl-C too
                self._helpers.give(jobs[-1])
            draw()
        finally:  # on Ctrl-C too: nobody may still write when the caller goes on
            left.clear()
            errors += [job.ended() for job in jobs]
        for error in errors:
            if error is not None:
                raise error


class _Job:
    """Work that a helper begins, unless the thread that gave it asks for its end before."""

    def __init__(self, work: Callable[[], None]) -> None:
        self._context, self._work = copy_context(), work
        self._claim = threading.Lock()
        self._end: SimpleQueue[BaseException | None] = SimpleQueue()

    def begin(self) -> None:
        """Do the work, unless it is no longer wanted."""
        if not self._claim.acquire(blocking=False):
            return
        error = None
        try:
            self._context.run(self._work)
        except BaseException as raised:  # raised again on the thread that waits
            error = raised
        self._end.put(error)

    def ended(self) -> BaseException | None:
        """Return the error of the work, None if there was none, when nobody is at it any more."""
        return None if self._claim.acquire(blocking=False) else self._end.get()


class Helpers:
    """Threads that wait for work: they start on it sooner than those of an executor.

    Parameters
    ----------
    many : int
        Number of threads.
    """

    def __init__(self, many: int) -> None:
        self._jobs: SimpleQueue[_Job | None] = SimpleQueue()
        self._threads = [
            threading.Thread(target=self._help, name=f"bem_{number}", daemon=True)
            for number in range(many)
        ]
        for thread in self._threads:
            thread.start()

    def give(self, job: _Job) -> None:
        """Let the next thread that is free begin a job."""
        self._jobs.put(job)

    def dismiss(self) -> None:
        """Let the threads end, and wait until they have."""
        for _ in self._threads:
            self._jobs.put(None)
        for thread in self._threads:
            thread.join()

    def _help(self) -> None:
        """Do one piece of work after another."""
        while (job := self._jobs.get()) is not None:
            job.begin()


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
        Number of threads, this one included, of which no more are used than there are processors;
        None for those of an outer block, or for as many as `OMP_NUM_THREADS` says, or for one.
    """
    before = _CURRENT.workers
    if threads is None:
        threads = before.threads if before.threads > 1 else default_threads(1)
    threads = min(threads, max(cores(), before.threads))
    if threads == before.threads:
        yield
    elif threads == 1:
        with led_by(Workers()):
            yield
    else:
        with unforked():
            helpers = Helpers(threads - 1)
        try:
            with led_by(Workers(threads, helpers)):
                yield
        finally:
            helpers.dismiss()


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


def keep_freed_memory() -> None:
    """Let glibc keep what a solve frees, up to twice `BLOCK`; other C libraries ignore this.

    By default glibc returns the end of its heap to the system as soon as little of it is free, and
    the next solve waits for the same pages to be cleared again: up to a fifth of its time on 256
    nodes a side. Both thresholds rise with the largest block that was freed (mallopt(3)); no page
    of this one is ever touched.
    """
    np.empty(BLOCK, np.uint8)
