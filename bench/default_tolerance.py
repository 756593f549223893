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
    """How well one tolerance found the nodes in contact.

    Attributes
    ----------
    rtol : the solver's tolerance [Delta]
    samples : samples solved
    right : samples with exactly as many nodes in contact as at `EXACT_RTOL`
    largest_miss : largest difference in that number [nodes]
    force_error : largest relative difference in force [1]
    convolutions : mean applications of the influence matrix
    relative_time : time of all solves over that of all solves at `EXACT_RTOL` [1]
    """

    rtol: float
    samples: int
    right: int
    largest_miss: int
    force_error: float
    convolutions: float
    relative_time: float

    @property
    def share(self) -> float:
        """Share of the samples with the right number of contact nodes [1]."""
        return self.right / self.samples


@dataclass(frozen=True)
class _Solve:
    contact_nodes: int
    force: float
    convolutions: int
    seconds: float


def right_counts(
    scene: str = "paper", samples: int = 1000, rtols: Sequence[float] = RTOLS
) -> list[Count]:
    """Solve the first samples of a scene at each tolerance and at `EXACT_RTOL`.

    Parameters
    ----------
    scene : name or path of a scene; its own tolerance does not count
    samples : rows, of which those without a solution at `EXACT_RTOL` are left out
    rtols : tolerances to try [Delta]

    Returns
    -------
    One count per tolerance, in their order

    Raises
    ------
    InputError
        For a scene that cannot be used, or that has no sample with a solution
    """
    settings = load(scene)
    plan = parameters(settings, 0, samples)
    exact: list[_Solve] = []
    found: list[list[_Solve]] = []
    for row in range(samples):
        heights, delta = surface_of(settings, plan, row), float(plan.delta[row])
        order = [EXACT_RTOL, *rtols]
        if row % 2:  # back and forth, so that no tolerance always runs on a warm cache
            order.reverse()
        try:
            solves = [_solve(settings, heights, delta, rtol) for rtol in order]
        except (bem.NoSolution, bem.NotConverged):
            continue
        if row % 2:
            solves.reverse()
        exact.append(solves[0])
        found.append(solves[1:])
    if not exact:
        raise InputError(f"none of the first {samples} samples of {scene} has a solution")
    columns = zip(*found, strict=True)
    return [_count(rtol, column, exact) for rtol, column in zip(rtols, columns, strict=True)]


def cheapest_right(counts: Sequence[Count], wanted: float = WANTED_SHARE) -> Count | None:
    """The loosest tolerance from which on all are right in the wanted share of samples."""
    cheapest = None
    for count in sorted(counts, key=lambda count: count.rtol):
        if count.share < wanted:
            break
        cheapest = count
    return cheapest


def markdown_table(counts: Sequence[Count]) -> str:
    """Lines of Markdown: a row per tolerance, and the verdict."""
    lines = []
    for count in counts:
        right, wrong = (
            f"{100 * count.share:.2f} %",
            f"{count.samples - count.right} of {count.samples}",
        )
        worst = f"{count.largest_miss} nodes", f"{count.force_error:.1e}"
        cost = f"{count.convolutions:.1f}", f"{count.relative_time:.2f}"
        lines.append((_power_of_ten(count.rtol), right, wrong, *worst, *cost))
    table = markdown(HEADER, lines)
    cheapest = cheapest_right(counts)
    verdict = _power_of_ten(cheapest.rtol) if cheapest else "none of these"
    return (
        f"{table}\n\nTime is relative to rtol {_power_of_ten(EXACT_RTOL)}, which also says what is"
        f" right.\nCheapest with {100 * WANTED_SHARE:g} % right: {verdict}."
    )


def _power_of_ten(rtol: float) -> str:
    """As people write tolerances: 1e-6, 1.5e-7."""
    return np.format_float_scientific(rtol, trim="-", exp_digits=1)


def _solve(scene: Scene, heights: Heights, delta: float, rtol: float) -> _Solve:
    """Solve one sample as the scene says, but to another tolerance; time it."""
    contact_settings = scene.contact.model_copy(update={"rtol": rtol})
    asked = scene.model_copy(update={"contact": contact_settings})
    began = time.perf_counter()
    contact = solve_contact(asked, heights, delta)
    seconds = time.perf_counter() - began
    return _Solve(contact.contact_nodes, contact.force, contact.convolutions, seconds)


def _count(rtol: float, solves: Sequence[_Solve], exact: Sequence[_Solve]) -> Count:
    pairs = list(zip(solves, exact, strict=True))
    misses = [abs(solve.contact_nodes - right.contact_nodes) for solve, right in pairs]
    forces = [abs(solve.force / right.force - 1) for solve, right in pairs if right.force]
    return Count(
        rtol=rtol,
        samples=len(pairs),
        right=misses.count(0),
        largest_miss=max(misses),
        force_error=max(forces, default=0.0),
        convolutions=float(np.mean([solve.convolutions for solve in solves])),
        relative_time=sum(solve.seconds for solve in solves)
        / sum(right.seconds for right in exact),
    )
