"""Times of calls that take micro- to milliseconds: of the processor, whoever else uses it."""

from collections.abc import Callable, Iterable
from statistics import fmean, median
from time import process_time

ENOUGH = 0.3
"""Seconds of calls that a median is over."""

ROUNDS = (3, 300)
"""Calls that a median is over, at least and at most."""


def median_seconds(call: Callable[[], object]) -> float:
    """Time a call that is the same each time; the first is a warm-up."""
    call()
    taken: list[float] = []
    fewest, most = ROUNDS
    while len(taken) < fewest or (sum(taken) < ENOUGH and len(taken) < most):
        taken.append(_seconds(call))
    return median(taken)


def mean_seconds(calls: Iterable[Callable[[], object]]) -> float:
    """Time calls that differ: the mean is what many of them cost. The first is done twice."""
    taken: list[float] = []
    for call in calls:
        if not taken:
            call()
        taken.append(_seconds(call))
    return fmean(taken)


def _seconds(call: Callable[[], object]) -> float:
    began = process_time()
    call()
    return process_time() - began


def time_of(seconds: float) -> str:
    """Write a time in a unit that suits it."""
    if seconds < 1e-3:
        return f"{1e6 * seconds:.3g} us"
    if seconds < 1:
        return f"{1e3 * seconds:.3g} ms"
    if seconds < 600:
        return f"{seconds:.3g} s"
    return f"{seconds / 3600:.3g} h" if seconds < 1e6 else f"{seconds / 86400:.3g} d"
