"""Signals that ask a run to stop: work in flight is finished, no new work is begun.

Python handles signals between two of its own steps. If compiled code takes minutes for one step,
as a fit may, a thread answers: it prints that the run is stopping, and a second signal ends the
process.
"""

import os
import select
import signal
import sys
import threading
import time
from contextlib import suppress
from types import FrameType
from typing import Any, Self

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGUSR1)
"""Signals of Ctrl-C, of the end of a batch job, and of Slurm's warning before that end."""

PATIENCE = 2.0
"""Time that Python has to handle a signal before the thread answers it [s]."""


class Interruption:
    """A context manager that records the first signal; the second one has its usual effect.

    Parameters
    ----------
    listening : bool
        True on the master, which stops the run in order; False on a worker, which ignores the
        signals and works until the master has no more tasks.

    Attributes
    ----------
    signal : int
        Number of the first signal, 0 before it.
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
