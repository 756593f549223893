"""A bound on the wall-clock time of a calculation, for users who set one.

Times differ between machines and between runs: a calculation over its time is pending, not failed.
"""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

LONGEST = 1e8
"""Longest bound [s], three years; the system's timer ends at 9.2e9 s."""

REPEATED = 1.0
"""Interval of further alarms [s], since code that catches all exceptions may swallow the first."""


class Overtime(Exception):
    """A calculation has taken longer than its bound."""


@contextmanager
def at_most(seconds: float | None) -> Iterator[None]:
    """Bound the wall-clock time of a block; works on a process's main thread only.

    Python handles the alarm between two of its steps, so a long call of compiled code runs to its
    end.

    Parameters
    ----------
    seconds : float, optional
        Wall-clock time of the block [s], above 0 and at most `LONGEST`; None for no bound.

    Raises
    ------
    ValueError
        If the number of seconds is out of range.
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
    finally:  # an alarm during the first `finally` is overtime too
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, previous)


def _end(number: int, frame: FrameType | None) -> None:
    """Handle the alarm."""
    raise Overtime
