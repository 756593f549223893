"""A bound on the wall-clock time of a calculation, for users who ask for one.

Seconds differ from machine to machine and from run to run: what takes too long has not failed, it
is not done yet.
"""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

LONGEST = 1e8
"""Longest time that can be allowed [s], three years: the system's timer ends at 9.2e9 s."""

REPEATED = 1.0
"""Time after which the alarm rings again [s]: code that swallows exceptions may swallow one."""


class Overtime(Exception):
    """A calculation took longer than it was allowed to."""


@contextmanager
def at_most(seconds: float | None) -> Iterator[None]:
    """Let a block take some seconds; on a process's main thread only.

    The alarm is heard between two steps of Python: one long call of compiled code is not cut off.

    Parameters
    ----------
    seconds : wall-clock time that the block may take [s], above 0, at most `LONGEST`; None
        for any

    Raises
    ------
    ValueError
        For another number of seconds.
    Overtime
        Once the block has taken longer.
    """
    if seconds is None:
        yield
        return
    if not 0 < seconds <= LONGEST:
        raise ValueError(f"{seconds} s: wanted more than 0, at most {LONGEST:g}")
    previous = signal.signal(signal.SIGALRM, _end)
    try:
        signal.setitimer(signal.ITIMER_REAL, seconds, REPEATED)
        try:
            yield
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
    finally:  # the alarm may ring on the way out, which is late enough to be overtime too
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, previous)


def _end(number: int, frame: FrameType | None) -> None:
    raise Overtime
