"""Contacts as cases: a problem is solved, and its answer judged."""

import math
import warnings
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

import bem
from bench.stability.case import Answer, Case, Finding, Refusal, one_line
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
    checks: tuple[Check, ...] = (),
    reason: str = "",
    ordinary: bool = False,
    refusal: Refusal | None = None,
    slow: bool = False,
    **arguments: Any,
) -> Case:
    """Make a case that solves a contact; surfaces are made when the case is run.

    Parameters
    ----------
    family, name, refusal, slow
        See `bench.stability.case.Case`.
    surface : array_like or callable
        Heights, or a function that makes them [um].
    delta : float or callable
        Displacement of the far field, or a function of the heights that computes it [um].
    checks : tuple of Check
        Checks of the answer besides complementarity, which every answer has to fulfil.
    reason : str
        Why it may take more than `MOST_TIMES_ORDINARY` times the ordinary iterations.
    ordinary : bool
        Whether this is the ordinary contact itself, which iterations are compared with.
    **arguments
        Other fields of `Setup`.
    """

    def setup() -> Setup:
        heights = surface() if callable(surface) else surface
        wanted = delta(np.asarray(heights, np.float64)) if callable(delta) else delta
        return Setup(heights, wanted, **arguments)

    examination = Examination(setup, checks, reason, ordinary)
    return Case(family, name, "", examination, refusal, slow)


@dataclass(frozen=True)
class Examination:
    """Solves a problem and judges the answer; the attributes are those of `contact_case`."""

    setup: Callable[[], Setup]
    checks: tuple[Check, ...] = ()
    reason: str = ""
    ordinary: bool = False

    def __call__(self) -> Answer:
        """Solve and judge."""
        asked = self.setup()
        contact, raised = None, None
        with warnings.catch_warnings(record=True) as warned:
            warnings.simplefilter("always")
            try:
                contact = asked.solve()
            except Exception as error:  # whatever it is, the table is to show it
                raised = error
        if contact is not None and asked.pressure is not None:
            asked = replace(asked, delta=contact.approach)
        texts = "; ".join(dict.fromkeys(str(warning.message) for warning in warned))
        conduct = Finding(f"warnings {texts}".rstrip(), len(warned), 0)
        return self.judge(asked, contact, raised, [conduct])

    def judge(
        self,
        asked: Setup,
        contact: bem.Contact | None,
        raised: Exception | None = None,
        conduct: Iterable[Finding] = (),
    ) -> Answer:
        """Judge the contact that the solver returned, or the error that it raised.

        Parameters
        ----------
        asked : Setup
            The problem.
        contact : bem.Contact or None
            The answer, None if there was none.
        raised : Exception or None
            The error, None if there was none.
        conduct : iterable of Finding
            Findings on how the solver behaved, besides its effort and the numbers that it states.
        """
        findings: list[Finding] = []
        if contact is not None:
            for check in (*self.checks, complementarity):
                findings += check(asked, contact)
        elif isinstance(raised, bem.NotConverged):
            contact = raised.contact
            findings.append(Finding("rtol over residual", asked.rtol / contact.residual, 1))
        findings += conduct
        answer = partial(Answer, asked=asked.describe(), raised=raised)
        if contact is None:
            return answer(one_line(raised), findings, numbers=dict.fromkeys(NUMBERS, ""))
        ordinary = max(contact.iterations, 1)
        if not self.ordinary:
            ordinary = ordinary_iterations(contact.pressure.shape)
        times = contact.iterations / ordinary
        findings += [*self._effort(asked, contact, times), *honesty(asked, contact)]
        values = contact.area_percent, contact.force, contact.residual, contact.iterations
        numbers: dict[str, object] = dict(zip(NUMBERS, (*values, ordinary, times), strict=True))
        numbers["reason"] = self.reason if times > MOST_TIMES_ORDINARY else ""
        return answer(one_line(raised) if raised else _in_words(contact), findings, numbers=numbers)

    def _effort(self, asked: Setup, contact: bem.Contact, times: float) -> Iterator[Finding]:
        """The bound on iterations was kept, and there is a reason for many iterations."""
        allowed = math.inf if self.reason else MOST_TIMES_ORDINARY
        yield Finding("iterations", contact.iterations, asked.max_iterations)
        yield Finding("times ordinary", times, allowed)


def _in_words(contact: bem.Contact) -> str:
    numbers = f"{contact.area_percent:.4g} %, {contact.force:.6g} µN"
    return f"{numbers}, residual {contact.residual:.1e}, {contact.iterations} iterations"


@lru_cache(maxsize=64)
def ordinary_iterations(shape: tuple[int, int]) -> int:
    """Count iterations for the paper's surface, cropped to this grid, at Delta = 25 um."""
    return max(Setup(cropped_paper(shape), spacing=1.0).solve().iterations, 1)
