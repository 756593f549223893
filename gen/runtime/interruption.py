"""Signals that ask a run to stop: what is in flight is finished, nothing new is begun.

Python hears signals between two of its own steps. Where compiled code takes minutes for one, as
a fit may, a thread hears them: it says what is waited for, and the second signal ends the process.
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
"""Ctrl-C, the end of a batch job, and the warning that Slurm can send before it."""

PATIENCE = 2.0
"""Time after which a signal that Python has not heard is answered by the thread [s]."""


class Interruption:
    """Note the first signal; let the second one do what it always does.

    Parameters
    ----------
    listening : True on the master, which stops the run in order; False on a worker, which ignores
        the signals and works until the master has no more tasks

    Attributes
    ----------
    signal : number of the signal that came, 0 if none did
    """

    def __init__(self, *, listening: bool) -> None:
        self.signal = 0
        self._listening = listening
        self._previous: dict[int, Any] = {}
        self._heard = threading.Event()

    def __enter__(self) -> Self:
        """Take the signals over."""
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
        """Give the signals back."""
        self._release()
        if self._listening:
            previous, write = self._wakeup
            signal.set_wakeup_fd(previous)
            os.close(write)

    def requested(self) -> bool:
        """Whether a signal has come."""
        return self.signal != 0

    def _note(self, number: int, frame: FrameType | None) -> None:
        self.signal = number
        self._heard.set()
        self._release()

    def _watch(self, read: int) -> None:
        """Answer signals while Python is busy elsewhere; ends when the other end is closed.

        Signals that come together, as Ctrl-C does from a terminal and from mpiexec, are one.
        """
        said = False
        while numbers := os.read(read, 1024):
            if not set(numbers) & set(SIGNALS):
                continue
            if not said:
                time.sleep(PATIENCE)
            if self._heard.is_set():
                continue
            if said:  # whatever was finished is on disk
                os._exit(128 + numbers[-1])
            with suppress(OSError, ValueError):
                sys.stderr.write("stopping after the step under way; again, to stop now\n")
            said = True
            if select.select([read], [], [], 0)[0]:
                os.read(read, 1024)
        os.close(read)

    def _release(self) -> None:
        for number, handler in self._previous.items():
            signal.signal(number, handler)
        self._previous.clear()
