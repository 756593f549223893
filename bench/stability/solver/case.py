"""Contacts as cases: a problem is solved, and its answer judged."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

import bem
from bench.references.half_space import Field
from bench.stability.case import Answer, Case, Finding, Refusal, attempt, one_line
from bench.stability.solver.checks import Check, complementarity, honesty
from bench.stability.solver.setup import DELTA, Setup
from bench.stability.solver.topographies import cropped_paper

# Iterations over those of the ordinary contact on the same grid that need no reason.
MOST_TIMES_ORDINARY = 3.0


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

    The surface may be a function that makes it when the case is run [um], and `delta` one of its
    heights [um]. `checks`, `reason` and `ordinary` are those of `judge`; further arguments are
    fields of `Setup`.
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

    `checks` come besides complementarity, which every answer has to fulfil, and `conduct` is how
    the solver behaved otherwise. With a `reason` a contact may take more than `MOST_TIMES_ORDINARY`
    times the iterations of the ordinary one on its grid, if it is not `ordinary` itself.
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
        return Answer(one_line(found), conduct, asked.describe(), raised=raised)
    first = max(contact.iterations, 1) if ordinary else ordinary_iterations(contact.pressure.shape)
    times = contact.iterations / first
    findings += [
        *conduct,
        Finding("iterations", contact.iterations, asked.max_iterations),
        Finding("times ordinary", times, math.inf if reason else MOST_TIMES_ORDINARY),
        *honesty(asked, contact),
    ]
    numbers = {
        **_numbers(contact),
        "ordinary_iterations": first,
        "times_ordinary": times,
        "reason": reason if times > MOST_TIMES_ORDINARY else "",
    }
    out = one_line(raised) if raised else _in_words(contact)
    return Answer(out, findings, asked.describe(), numbers, raised)


def _numbers(contact: bem.Contact) -> dict[str, object]:
    return {
        "area_percent": contact.area_percent,
        "force_uN": contact.force,
        "residual": contact.residual,
        "iterations": contact.iterations,
    }


def _in_words(contact: bem.Contact) -> str:
    numbers = f"{contact.area_percent:.4g} %, {contact.force:.6g} µN"
    return f"{numbers}, residual {contact.residual:.1e}, {contact.iterations} iterations"


@lru_cache(maxsize=64)
def ordinary_iterations(shape: tuple[int, int]) -> int:
    """Count iterations for the paper's surface, cropped to this grid, at Delta = 25 um."""
    return max(Setup(cropped_paper(shape), spacing=1.0).solve().iterations, 1)
