"""Which tolerance finds every node in contact: the reason for the solver's default.

`python -m bench solver --default-tolerance` solves the first samples of a scene at falling
tolerances and counts how often the number of contact nodes, and so the area, is exactly that of a
far tighter solution. The default is the cheapest tolerance that is right in `WANTED_SHARE` of the
paper preset's samples.
"""

import time
from collections.abc import Sequence
from itertools import takewhile
from typing import Any

import numpy as np

import bem
from bench.table import formatted
from gen.arrays import Heights
from gen.generation.plan import parameters
from gen.generation.sample import solve_contact, surface_of
from gen.runtime.errors import InputError
from gen.scene import Scene, load

RTOLS = (1e-3, 1e-4, 1e-5, 3e-6, 1e-6, 5e-7, 2e-7, 1e-7, 1e-8)
EXACT_RTOL = 1e-12
WANTED_SHARE = 0.999
COLUMNS = {
    "rtol": "{rtol}",
    "right counts": "{right_percent:.2f} %",
    "wrong samples": "{wrong} of {samples}",
    "largest miss": "{largest_miss} nodes",
    "largest force error": "{force_error:.1e}",
    "convolutions": "{convolutions:.1f}",
    "time": "{relative_time:.2f}",
}

# How well one tolerance found the nodes in contact, beside solves to `EXACT_RTOL`.
Row = dict[str, Any]


def right_counts(
    scene: str = "paper", samples: int = 1000, rtols: Sequence[float] = RTOLS
) -> list[Row]:
    """Solve the first samples of a scene at each tolerance and at `EXACT_RTOL`.

    Samples without a solution at `EXACT_RTOL` are left out; the scene's own tolerance does not
    count.

    Raises
    ------
    InputError
        For a scene that cannot be used, or that has no sample with a solution.
    """
    settings = load(scene)
    plan = parameters(settings, 0, samples)
    measured = []
    for row in range(samples):
        heights, delta = surface_of(settings, plan, row), float(plan.delta[row])
        order = (EXACT_RTOL, *rtols)[:: (-1) ** row]  # no tolerance always finds a warm cache
        try:
            solves = [_solve(settings, heights, delta, rtol) for rtol in order]
        except (bem.NoSolution, bem.NotConverged):
            continue
        measured.append(solves[:: (-1) ** row])
    if not measured:
        raise InputError(f"none of the first {samples} samples of {scene} has a solution")
    nodes, forces, convolutions, seconds = np.array(measured).T
    loaded = forces[0] != 0
    misses = np.abs(nodes - nodes[0])
    errors = np.abs(forces[:, loaded] / forces[0, loaded] - 1)
    right = (misses == 0).sum(axis=1)
    return [
        {
            "rtol": _power_of_ten(rtol),
            "right_percent": 100 * right[place] / len(measured),
            "wrong": len(measured) - right[place],
            "samples": len(measured),
            "largest_miss": int(misses[place].max()),
            "force_error": errors[place].max(initial=0.0),
            "convolutions": convolutions[place].mean(),
            "relative_time": seconds[place].sum() / seconds[0].sum(),
        }
        for place, rtol in enumerate(rtols, 1)
    ]


def cheapest_right(rows: Sequence[Row]) -> str:
    """Name the loosest tolerance from which on all are right in the wanted share of samples."""
    tightest_first = sorted(rows, key=lambda row: float(row["rtol"]))
    good = takewhile(lambda row: row["right_percent"] >= 100 * WANTED_SHARE, tightest_first)
    return str(["none of these", *(row["rtol"] for row in good)][-1])


def markdown_table(rows: Sequence[Row]) -> str:
    """Return lines of Markdown: a row per tolerance, and the verdict."""
    return (
        f"{formatted(COLUMNS, rows)}\n\n"
        f"Time is relative to rtol {_power_of_ten(EXACT_RTOL)}, which also says what is right.\n"
        f"Cheapest with {100 * WANTED_SHARE:g} % right: {cheapest_right(rows)}."
    )


def _power_of_ten(rtol: float) -> str:
    """Write a tolerance as people do: 1e-6, 1.5e-7."""
    return np.format_float_scientific(rtol, trim="-", exp_digits=1)


def _solve(scene: Scene, heights: Heights, delta: float, rtol: float) -> tuple[float, ...]:
    """Return contact nodes, force, convolutions and seconds of one sample to a tolerance."""
    settings = scene.contact.model_copy(update={"rtol": rtol})
    asked = scene.model_copy(update={"contact": settings})
    began = time.perf_counter()
    contact = solve_contact(asked, heights, delta)
    seconds = time.perf_counter() - began
    return contact.contact_nodes, contact.force, contact.convolutions, seconds
