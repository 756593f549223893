"""Signals: those that ask a run to stop in order, and the alarm that bounds a calculation's time.

Python handles signals between two of its own steps. If compiled code takes minutes for one step,
as a fit may, a thread answers requests to stop: it prints that the run is stopping, and a second
signal ends the process. An alarm waits for the end of the step.
"""

import os
import select
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any, Self

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGUSR1)
"""Signals of Ctrl-C, of the end of a batch job, and of Slurm's warning before that end."""

PATIENCE = 2.0  # time that Python has to handle a signal before the thread answers it [s]
LONGEST = 1e8  # longest bound [s], three years; the system's timer ends at 9.2e9 s

REPEATED = 1.0
"""Interval of further alarms [s], since code that catches all exceptions may swallow the first."""


class Interruption:
    """A context manager that records the first signal; the second one has its usual effect.

    The master is listening and stops the run in order; a worker ignores the signals and works until
    the master has no more tasks. `signal` is the number of the first signal, 0 before it.
    """

    def __init__(self, *, listening: bool) -> None:
        self.signal = 0
        self._listening = listening
        self._previous: dict[int, Any] = {}
        self._heard = threading.Event()

    def __enter__(self) -> Self:
        """Install our handlers."""
        for number in SIGNALS:
            handler = self._note if self._listening else signal.SIG_IGN
            self._previous[number] = signal.signal(number, handler)
        if self._listening:
            read, write = os.pipe()
            os.set_blocking(write, False)
            self._wakeup = signal.set_wakeup_fd(write, warn_on_full_buffer=False), write
            threading.Thread(target=self._watch, args=(read,), daemon=True).start()
        return self

    def __exit__(self, *error: object) -> None:
        """Restore the previous handlers."""
        self._release()
        if self._listening:
            previous, write = self._wakeup
            signal.set_wakeup_fd(previous)
            os.close(write)

    def requested(self) -> bool:
        """Tell whether a signal has come."""
        return self.signal != 0

    def _note(self, number: int, frame: FrameType | None) -> None:
        """Record a signal and restore the previous handlers, so that the next one ends the run."""
        self.signal = number
        self._heard.set()
        self._release()

    def _watch(self, read: int) -> None:
        """Answer signals while Python is inside compiled code, until the pipe is closed.

        Signals that arrive together, as Ctrl-C does from a terminal and from mpiexec, count as one.
        """
        said = False
        while numbers := os.read(read, 1024):
            if not set(numbers) & set(SIGNALS):
                continue
            if not said:
                time.sleep(PATIENCE)
            if self._heard.is_set():
                continue
            if said:  # finished work is on disk already
                os._exit(128 + numbers[-1])
            with suppress(OSError, ValueError):
                sys.stderr.write("stopping after the step under way; again, to stop now\n")
            said = True
            if select.select([read], [], [], 0)[0]:
                os.read(read, 1024)
        os.close(read)

    def _release(self) -> None:
        """Restore the previous handlers."""
        for number, handler in self._previous.items():
            signal.signal(number, handler)
        self._previous.clear()


class Overtime(Exception):
    """A calculation has taken longer than its bound.

    Times differ between machines and between runs: such a calculation is pending, not failed.
    """


@contextmanager
def at_most(seconds: float | None) -> Iterator[None]:
    """Bound the wall-clock time [s] of a block, if there is a bound, on the main thread.

    Python handles the alarm between two of its steps, so a long call of compiled code runs to its
    end. Raise Overtime once the block has taken longer. A bound is above 0, at most `LONGEST`.
    """
    if seconds is None:
        yield
        return
    previous = signal.signal(signal.SIGALRM, _end)
    try:
        signal.setitimer(signal.ITIMER_REAL, seconds, REPEATED)
        try:
            yield
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
    finally:  # an alarm during the first `finally` is overtime too
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, previous)


def _end(number: int, frame: FrameType | None) -> None:
    """Handle the alarm."""
    raise Overtime
