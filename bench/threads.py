"""How much faster a large solve is on several threads, and how much faster it could be.

The bound is what the machine itself allows: as many copies of the transforms alone, each on a
thread of its own, against one copy. Surfaces are those of `bench.growth`. All times are wall-clock
times of one process, in turn: gains are taken within a turn, and their median counts, so that a
machine that is slower for some seconds spoils one turn only. Every contact on
several threads is the same to the last bit as the one on a single thread, or the command fails.
"""

import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from itertools import product
from statistics import median
from typing import Any

import numpy as np

import bem
from bem.contact import Contact
from bem.convolution import displacement_filter
from bem.workers import Workers, led_by
from bench.files import Row
from bench.growth import RTOL, SIDE, displacement_at, require_nested, surface
from bench.report import Report, remark
from gen.arrays import Heights

# Share of the transforms' own gain that a solve is to reach.
WANTED_SHARE = 0.9

# Entries of padded fields that are transformed in one turn of the copies.
TRANSFORMED = 2.5e7

# Nodes a side from which on a solve takes minutes: one round.
LONG_FROM = 4097

# Threads for which the gain is reckoned from the shared part of a solve.
RECKONED = (4, 8)


def threads(nodes: Sequence[int], percents: Sequence[float], threads: int, rounds: int) -> Report:
    """Measure the gains; the arguments are those of `measure`."""
    rows = measure(nodes, percents, threads, rounds)
    return Report({"threads": rows}, text=verdict(rows))


def measure(
    nodes: Sequence[int], percents: Sequence[float], threads: int, rounds: int
) -> list[Row]:
    """Time solves at shares of contact [%] on one and on several threads.

    Grids of `LONG_FROM` nodes a side or more are timed in a single round.

    Raises
    ------
    ArithmeticError
        If the number of threads changes a bit of a pressure.
    InputError
        For nodes a side that are not 2^k + 1, or too few, and for shares of contact out of reach.
    """
    require_nested(nodes)
    rows = []
    for size, percent in product(nodes, percents):
        copies = gain_of_copies(size, threads, rounds)
        heights, delta = surface(size, 0), displacement_at(size, 0, percent)
        row = {"nodes": size, "threads": threads, "copies": copies}
        row |= _timed(heights, delta, threads, rounds if size < LONG_FROM else 1)
        rows.append(row | {"gain_over_copies": row["gain"] / copies})
        remark(f"{size} nodes, {percent:g} %: {rows[-1]['gain']:.2f} times as fast")
    return rows


def gain_of_copies(nodes: int, threads: int, rounds: int) -> float:
    """Return how many transforms several threads do in the time in which one thread does one."""
    turns = max(round(TRANSFORMED / (2 * nodes * nodes)), 2)
    seconds: dict[int, list[float]] = {1: [], threads: []}
    for _, many in product(range(rounds), seconds):
        seconds[many].append(_transform_copies(nodes, many, turns))
    return threads * gain(seconds[1], seconds[threads])


def _transform_copies(nodes: int, threads: int, turns: int) -> float:
    """Return the time that threads take for some transforms each, with filters of their own [s]."""
    ready = threading.Barrier(threads)

    def transform() -> tuple[float, float]:
        try:
            operator = displacement_filter((nodes, nodes), "uniform-pressure", dtype="float32")
            operator.field.fill(0)
            operator.transform()
        except BaseException:  # raised again below; the other threads do not wait for this one
            ready.abort()
            raise
        with suppress(threading.BrokenBarrierError):
            ready.wait()
        began = time.perf_counter()
        for _ in range(turns):
            operator.transform()
        return began, time.perf_counter()

    with ThreadPoolExecutor(threads) as pool:
        running = [pool.submit(transform) for _ in range(threads)]
        began, ended = zip(*(each.result() for each in running), strict=True)
    return float(max(ended) - min(began))


def gain(slow: Sequence[float], fast: Sequence[float]) -> float:
    """Return how many times as long the slow one of a turn takes, the median over the turns."""
    return median(one / other for one, other in zip(slow, fast, strict=True))


def _timed(heights: Heights, delta: float, threads: int, rounds: int) -> Row:
    """Solve on one and on several threads in turn, and once with a look at what is shared."""

    def solve(many: int) -> Contact:
        return bem.solve(heights, SIDE, delta, rtol=RTOL, threads=many)

    pressure = solve(threads).pressure  # tables and plans are made
    seconds: dict[int, list[float]] = {1: [], threads: []}
    for turn in range(rounds):
        for many in (1, threads) if turn % 2 else (threads, 1):
            began = time.perf_counter()
            contact = solve(many)
            seconds[many].append(time.perf_counter() - began)
            if not np.array_equal(contact.pressure, pressure):
                raise ArithmeticError(
                    f"{threads} threads change the pressure of {len(heights)} nodes a side"
                )
    shared = _shared(lambda: solve(threads), threads)
    return {
        "area_percent": contact.area_percent,
        "convolutions": contact.convolutions,
        "seconds_one": median(seconds[1]),
        "seconds": median(seconds[threads]),
        "gain": gain(seconds[1], seconds[threads]),
        "shared_percent": 100 * shared,
        **{f"reckoned_{many}": 1 / (1 - shared + shared / many) for many in RECKONED},
    }


class _Watched(Workers):
    """A single thread that cuts work as for several, and adds up the time of what they could share.

    Attributes
    ----------
    seconds : float
        That time.
    """

    seconds = 0.0

    def share(self, work: Callable[[Any], None], pieces: Sequence[Any]) -> None:
        """Do the work, and count its time if it comes in several pieces."""
        began = time.perf_counter()
        super().share(work, pieces)
        if len(pieces) > 1:
            self.seconds += time.perf_counter() - began


def _shared(solve: Callable[[], Contact], threads: int) -> float:
    """Return the share of a solve's time on one thread that several could share [1]."""
    watched = _Watched(threads)
    with led_by(watched):
        began = time.perf_counter()
        solve()
        return watched.seconds / (time.perf_counter() - began)


def verdict(rows: Sequence[Row]) -> str:
    """Say in how many rows solves keep to their mark, and what is an estimate."""
    kept = sum(row["gain_over_copies"] >= WANTED_SHARE for row in rows)
    shares = [row["gain_over_copies"] for row in rows]
    return (
        f"Gain over that of copies: {min(shares):.2f} to {max(shares):.2f},"
        f" {WANTED_SHARE:g} or more (the mark) in {kept} of {len(rows)} rows. Every contact has the"
        " same bits on any number of threads. Gains on 4 and 8 threads are estimates, not measured:"
        " Amdahl's law, 1 / (1 - s + s / threads), with the measured share s of the time on one"
        " thread that is spent in work that threads share; memory that all threads wait for is not"
        " in them."
    )
