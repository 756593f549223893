"""Which tolerance finds every node in contact: the reason for the solver's default.

`python -m bench solver --default-tolerance` solves the first samples of a scene at falling
tolerances and counts how often the number of contact nodes, and so the area, is exactly that of a
far tighter solution. The default is the cheapest tolerance that is right in `WANTED_SHARE` of the
paper preset's samples.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

import bem
from bench.table import markdown
from gen.arrays import Heights
from gen.generation.plan import parameters
from gen.generation.sample import solve_contact, surface_of
from gen.runtime.errors import InputError
from gen.scene import Scene, load

RTOLS = (1e-3, 1e-4, 1e-5, 3e-6, 1e-6, 5e-7, 2e-7, 1e-7, 1e-8)
EXACT_RTOL = 1e-12
WANTED_SHARE = 0.999
HEADER = (
    *("rtol", "right counts", "wrong samples", "largest miss", "largest force error"),
    *("convolutions", "time"),
)


@dataclass(frozen=True)
class Count:
    """How well one tolerance found the nodes in contact, beside solves to `EXACT_RTOL`.

    Attributes
    ----------
    rtol : float
        Tolerance of the solver [Delta].
    samples, right : int
        Samples solved, and those with exactly as many nodes in contact.
    largest_miss : int
        Largest difference in that number [nodes].
    force_error : float
        Largest relative difference in force [1].
    convolutions : float
        Mean applications of the influence matrix.
    relative_time : float
        Time of all solves over that of all exact ones [1].
    """

    rtol: float
    samples: int
    right: int
    largest_miss: int
    force_error: float
    convolutions: float
    relative_time: float


def right_counts(
    scene: str = "paper", samples: int = 1000, rtols: Sequence[float] = RTOLS
) -> list[Count]:
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
    return [
        Count(
            rtol=rtol,
            samples=len(measured),
            right=int((misses[place] == 0).sum()),
            largest_miss=int(misses[place].max()),
            force_error=float(errors[place].max(initial=0.0)),
            convolutions=float(convolutions[place].mean()),
            relative_time=float(seconds[place].sum() / seconds[0].sum()),
        )
        for place, rtol in enumerate(rtols, 1)
    ]


def cheapest_right(counts: Sequence[Count], wanted: float = WANTED_SHARE) -> Count | None:
    """Return the loosest tolerance from which on all are right in the wanted share of samples."""
    cheapest = None
    for count in sorted(counts, key=lambda count: count.rtol):
        if count.right < wanted * count.samples:
            break
        cheapest = count
    return cheapest


def markdown_table(counts: Sequence[Count]) -> str:
    """Return lines of Markdown: a row per tolerance, and the verdict."""
    lines = (
        (
            _power_of_ten(count.rtol),
            f"{100 * count.right / count.samples:.2f} %",
            f"{count.samples - count.right} of {count.samples}",
            f"{count.largest_miss} nodes",
            f"{count.force_error:.1e}",
            f"{count.convolutions:.1f}",
            f"{count.relative_time:.2f}",
        )
        for count in counts
    )
    cheapest = cheapest_right(counts)
    verdict = _power_of_ten(cheapest.rtol) if cheapest else "none of these"
    return (
        f"{markdown(HEADER, lines)}\n\n"
        f"Time is relative to rtol {_power_of_ten(EXACT_RTOL)}, which also says what is right.\n"
        f"Cheapest with {100 * WANTED_SHARE:g} % right: {verdict}."
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
