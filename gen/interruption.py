"""Signals that ask a run to stop: what is in flight is finished, nothing new is begun."""

import signal
from types import FrameType
from typing import Any, Self

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGUSR1)
"""Ctrl-C, the end of a batch job, and the warning that Slurm can send before it."""


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

    def __enter__(self) -> Self:
        """Take the signals over."""
        for number in SIGNALS:
            handler = self._note if self._listening else signal.SIG_IGN
            self._previous[number] = signal.signal(number, handler)
        return self

    def __exit__(self, *error: object) -> None:
        """Give the signals back."""
        self._release()

    def requested(self) -> bool:
        """Whether a signal has come."""
        return self.signal != 0

    def _note(self, number: int, frame: FrameType | None) -> None:
        self.signal = number
        self._release()

    def _release(self) -> None:
        for number, handler in self._previous.items():
            signal.signal(number, handler)
        self._previous.clear()
