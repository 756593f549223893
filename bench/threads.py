"""How much faster a large solve is on several threads, and how much faster it could be.

The machine itself sets the bound: copies of the transforms alone, one on each thread, against one
copy. Threads share the memory's bandwidth, so that two copies take longer than one. Surfaces are
those of `bench.growth`. All times are wall-clock times. The ratios of times are taken within a
turn, and their median counts, so that a machine that is slower for some seconds spoils one turn
only.
"""

import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import product
from statistics import median
from threading import Barrier

import numpy as np

import bem
from bem.bodies import HALF_SPACE
from bem.operators.displacement import displacement_filter
from bem.threads import cores
from bench.files import Row
from bench.growth import RTOL, SIDE, displacement_at, require_nested, surface
from bench.report import remark
from gen.arrays import Heights
from gen.runtime.errors import InputError

ENTRIES = 2.5e7
"""Entries of padded fields that each copy transforms in a turn, so that its time is measurable."""

FEWEST_TRANSFORMS = 2
"""Smallest number of transforms of a copy in a turn."""


def threads(
    nodes: Sequence[int], percents: Sequence[float], threads: int, rounds: int
) -> list[Row]:
    """Time solves at shares of contact on one and on several threads.

    Progress is printed on standard error.

    Parameters
    ----------
    nodes : sequence of int
        Nodes a side of the grids, 2^k + 1 each.
    percents : sequence of float
        Shares of the nodes in contact [%].
    threads : int
        Number of threads that are compared with one thread.
    rounds : int
        Number of turns.

    Returns
    -------
    list of Row
        One row for each grid and share. It has the median times of a solve on one and on all
        threads (`seconds_one`, `seconds`) [s]; the median over the turns of their ratio (`gain`);
        the gain of copies of the transforms alone (`copies`); and the first gain over the second
        (`gain_over_copies`).

    Raises
    ------
    InputError
        If a number of nodes is not 2^k + 1, or this machine has fewer processors than threads.
    ArithmeticError
        If the number of threads changes a bit of a pressure.
    """
    require_nested(nodes)
    if threads > cores():
        raise InputError(f"--threads {threads}: this machine has {cores()} processors")
    rows = []
    for size, percent in product(nodes, percents):
        heights = surface(size, 0)
        delta = displacement_at(size, 0, percent)
        copies = _gain_of_copies(size, threads, rounds)
        row = _timed(heights, delta, threads, rounds)
        row["copies"] = copies
        row["gain_over_copies"] = row["gain"] / copies
        remark(f"{size} nodes, {percent:g} %: {row['gain']:.2f} times as fast")
        rows.append({"nodes": size, "threads": threads, "percent": percent, **row})
    return rows


def _gain_of_copies(nodes: int, threads: int, rounds: int) -> float:
    """Return how many transforms several threads do in the time in which one thread does one."""
    transforms = max(round(ENTRIES / (2 * nodes) ** 2), FEWEST_TRANSFORMS)
    ratios = []
    for _ in range(rounds):
        alone = _time_of_copies(nodes, 1, transforms)
        together = _time_of_copies(nodes, threads, transforms)
        ratios.append(alone / together)
    return threads * median(ratios)


def _time_of_copies(nodes: int, threads: int, transforms: int) -> float:
    """Return the time in which each thread does some transforms with a filter of its own [s]."""
    ready = Barrier(threads)

    def transform() -> tuple[float, float]:
        """Transform a field of zeros, and return the times of the beginning and of the end [s]."""
        operator = displacement_filter((nodes, nodes), "free", HALF_SPACE, 1.0, "float32")
        operator.field.fill(0)
        operator.transform()  # makes plans and buffers
        ready.wait()
        began = time.perf_counter()
        for _ in range(transforms):
            operator.transform()
        return began, time.perf_counter()

    with ThreadPoolExecutor(threads) as pool:
        jobs = [pool.submit(transform) for _ in range(threads)]
        times = [job.result() for job in jobs]
    first_began = min(began for began, _ in times)
    last_ended = max(ended for _, ended in times)
    return last_ended - first_began


def _timed(heights: Heights, delta: float, threads: int, rounds: int) -> Row:
    """Solve a contact on one and on several threads in turn; return median times and the gain."""
    # The first solve makes tables and plans.
    first = bem.solve(heights, SIDE, delta, rtol=RTOL, threads=threads)
    seconds: dict[int, list[float]] = {1: [], threads: []}
    for turn in range(rounds):
        order = (1, threads) if turn % 2 else (threads, 1)
        for number in order:
            began = time.perf_counter()
            contact = bem.solve(heights, SIDE, delta, rtol=RTOL, threads=number)
            seconds[number].append(time.perf_counter() - began)
            if not np.array_equal(contact.pressure, first.pressure):
                raise ArithmeticError(
                    f"{threads} threads change the pressure of {len(heights)} nodes a side"
                )
    ratios = np.divide(seconds[1], seconds[threads])
    return {
        "area_percent": first.area_percent,
        "convolutions": first.convolutions,
        "seconds_one": median(seconds[1]),
        "seconds": median(seconds[threads]),
        "gain": float(np.median(ratios)),
    }
