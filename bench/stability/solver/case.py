"""Contacts as cases: a problem is solved, and its answer judged."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

import bem
from bench.stability.case import Answer, Case, Finding, Refusal, attempt, one_line
from bench.stability.solver.checks import Check, complementarity, honesty
from bench.stability.solver.setup import DELTA, Setup
from bench.stability.solver.topographies import Field, cropped_paper

MOST_TIMES_ORDINARY = 3.0
"""Iterations over those of the ordinary contact on the same grid that need no reason."""

NUMBERS = (
    *("area_percent", "force_uN", "residual"),
    *("iterations", "ordinary_iterations", "times_ordinary"),
)
"""Columns of the solver's table."""


def contact_case(
    family: str,
    name: str,
    surface: ArrayLike | Callable[[], ArrayLike],
    delta: float | Callable[[Field], float] = DELTA,
    *,
    checks: Sequence[Check] = (),
    reason: str = "",
    ordinary: bool = False,
    refusal: Refusal | None = None,
    slow: bool = False,
    **arguments: Any,
) -> Case:
    """Make a case that solves a contact.

    Parameters
    ----------
    family, name, refusal, slow
        See `bench.stability.case.Case`.
    surface : array_like or callable
        Heights, or a function that makes them when the case is run [um].
    delta : float or callable
        Displacement of the far field, or a function of the heights that computes it [um].
    checks, reason, ordinary
        See `judge`.
    **arguments
        Other fields of `Setup`.
    """

    def examine() -> Answer:
        heights = surface() if callable(surface) else surface
        wanted = delta(np.asarray(heights, np.float64)) if callable(delta) else delta
        return solve(Setup(heights, wanted, **arguments), checks, reason, ordinary=ordinary)

    return Case(family, name, "", examine, refusal, slow)


def solve(
    asked: Setup, checks: Sequence[Check] = (), reason: str = "", *, ordinary: bool = False
) -> Answer:
    """Solve a problem and judge the answer; parameters as for `judge`."""
    found, warned = attempt(asked.solve)
    if isinstance(found, bem.Contact) and asked.pressure is not None:
        asked = replace(asked, delta=found.approach)
    conduct = Finding(f"warnings {'; '.join(dict.fromkeys(warned))}".rstrip(), len(warned), 0)
    return judge(asked, found, checks, reason, ordinary=ordinary, conduct=[conduct])


def judge(
    asked: Setup,
    found: object,
    checks: Sequence[Check] = (),
    reason: str = "",
    *,
    ordinary: bool = False,
    conduct: Sequence[Finding] = (),
) -> Answer:
    """Judge the contact that the solver has returned, or the error that it has raised.

    Parameters
    ----------
    asked : Setup
        The problem.
    found : bem.Contact or Exception
        What came of it.
    checks : sequence of Check
        Checks of the answer besides complementarity, which every answer has to fulfil.
    reason : str
        Why it may take more than `MOST_TIMES_ORDINARY` times the ordinary iterations.
    ordinary : bool
        Whether this is the ordinary contact itself, which iterations are compared with.
    conduct : sequence of Finding
        How the solver behaved, besides its effort and the numbers that it states.
    """
    raised = found if isinstance(found, Exception) else None
    findings: list[Finding] = []
    if isinstance(found, bem.Contact):
        contact = found
        for check in (*checks, complementarity):
            findings += check(asked, contact)
    elif isinstance(found, bem.NotConverged):
        contact = found.contact
        findings.append(Finding("rtol over residual", asked.rtol / contact.residual, 1))
    else:
        numbers = dict.fromkeys(NUMBERS, "")
        return Answer(one_line(found), conduct, asked.describe(), numbers, raised)
    first = max(contact.iterations, 1) if ordinary else ordinary_iterations(contact.pressure.shape)
    times = contact.iterations / first
    findings += [
        *conduct,
        Finding("iterations", contact.iterations, asked.max_iterations),
        Finding("times ordinary", times, math.inf if reason else MOST_TIMES_ORDINARY),
        *honesty(asked, contact),
    ]
    values = contact.area_percent, contact.force, contact.residual, contact.iterations, first, times
    needed = reason if times > MOST_TIMES_ORDINARY else ""
    out = f"{contact.area_percent:.4g} %, {contact.force:.6g} µN, residual {contact.residual:.1e}"
    return Answer(
        one_line(raised) if raised else f"{out}, {contact.iterations} iterations",
        findings,
        asked.describe(),
        {**dict(zip(NUMBERS, values, strict=True)), "reason": needed},
        raised,
    )


@lru_cache(maxsize=64)
def ordinary_iterations(shape: tuple[int, int]) -> int:
    """Count iterations for the paper's surface, cropped to this grid, at Delta = 25 um."""
    return max(Setup(cropped_paper(shape), spacing=1.0).solve().iterations, 1)
