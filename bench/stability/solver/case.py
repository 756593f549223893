"""A case of the table as data, and what comes out of running it."""

import math
import warnings
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from functools import lru_cache

import bem
from bench.stability.finding import Finding, Refusal
from bench.stability.solver.checks import Check, complementarity, honesty
from bench.stability.solver.setup import Setup
from bench.stability.solver.topographies import cropped_paper

MOST_TIMES_ORDINARY = 3.0
"""Iterations over those of the ordinary contact on the same grid that need no reason."""


@dataclass(frozen=True)
class Case:
    """A row of the table.

    Attributes
    ----------
    family : what kind of extreme it is
    name : of the case, unique
    setup : makes what is asked of the solver
    checks : of the answer, besides the complementarity that every answer has to have
    refusal : how it has to be refused, for input that has no answer
    reason : why it may take more than `MOST_TIMES_ORDINARY` times the ordinary iterations
    slow : whether only the full table has it
    ordinary : whether this is the ordinary contact itself that iterations are compared with
    """

    family: str
    name: str
    setup: Callable[[], Setup]
    checks: tuple[Check, ...] = ()
    refusal: Refusal | None = None
    reason: str = ""
    slow: bool = False
    ordinary: bool = False


@dataclass(frozen=True)
class Result:
    """What came out of a case.

    Attributes
    ----------
    case : what was run
    asked : its input, in one line
    message : of the error that was raised; empty where there was an answer
    area_percent, force, residual, iterations : of the answer, or of the best that was reached when
        iterations ran out [%, uN, Delta, 1]; nan or 0 without any
    ordinary_iterations : of the paper's surface at Delta = 25 um on the same grid; 0 without answer
    findings : is the answer right, or was it refused as it should?
    conduct : did the solver say what it did: warnings, iterations, the numbers that it states?
    """

    case: Case
    asked: str
    message: str
    area_percent: float = math.nan
    force: float = math.nan
    residual: float = math.nan
    iterations: int = 0
    ordinary_iterations: int = 0
    findings: tuple[Finding, ...] = field(default=())
    conduct: tuple[Finding, ...] = field(default=())

    @property
    def passed(self) -> bool:
        """Whether all that was found is within its bounds, and anything was looked for."""
        return bool(self.findings) and all(
            finding.passed for finding in (*self.findings, *self.conduct)
        )

    @property
    def answered(self) -> bool:
        """Whether there are numbers, be it of an answer that was not finished."""
        return self.ordinary_iterations > 0

    @property
    def times_ordinary(self) -> float:
        """Iterations over the ordinary ones [1]."""
        return self.iterations / max(self.ordinary_iterations, 1)

    @property
    def reason(self) -> str:
        """Why it took so many iterations; empty where it did not."""
        return self.case.reason if self.times_ordinary > MOST_TIMES_ORDINARY else ""


def run(cases: Iterable[Case]) -> list[Result]:
    """Run one case after the other; what goes wrong is a result too."""
    return [run_case(case) for case in cases]


def run_case(case: Case) -> Result:
    """Solve and judge."""
    asked = case.setup()
    contact, raised = None, None
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        try:
            contact = asked.solve()
        except Exception as error:  # whatever it is, the table is to show it
            raised = error
    texts = "; ".join(dict.fromkeys(str(warning.message) for warning in warned))
    return judge(
        case, asked, contact, raised, [Finding(f"warnings {texts}".rstrip(), len(warned), 0)]
    )


def judge(
    case: Case,
    asked: Setup,
    contact: bem.Contact | None,
    raised: Exception | None = None,
    conduct: Iterable[Finding] = (),
) -> Result:
    """The result of a case from what the solver returned or raised.

    Parameters
    ----------
    case, asked : what was run
    contact : the answer, None if there was none
    raised : the error, None if there was none
    conduct : what is already known of how the solver behaved
    """
    findings: list[Finding] = []
    if case.refusal is not None:
        findings += case.refusal.judge(raised)
    elif raised is not None:
        findings.append(Finding(f"{type(raised).__name__} instead of an answer", 1, 0))
    if contact is not None:
        for check in (*case.checks, complementarity):
            findings += check(asked, contact)
    elif isinstance(raised, bem.NotConverged):
        contact = raised.contact
        findings.append(Finding("rtol over residual", asked.rtol / contact.residual, 1))
    message = " ".join(str(raised).split()) if raised else ""
    if contact is None:
        return Result(case, asked.describe(), message, findings=(*findings,), conduct=(*conduct,))
    ordinary = max(contact.iterations, 1)
    if not case.ordinary:
        ordinary = ordinary_iterations(contact.pressure.shape)
    return Result(
        case=case,
        asked=asked.describe(),
        message=message,
        area_percent=contact.area_percent,
        force=contact.force,
        residual=contact.residual,
        iterations=contact.iterations,
        ordinary_iterations=ordinary,
        findings=(*findings,),
        conduct=(*conduct, *_effort(case, asked, contact, ordinary), *honesty(asked, contact)),
    )


def _effort(case: Case, asked: Setup, contact: bem.Contact, ordinary: int) -> Iterator[Finding]:
    """The bound on iterations was kept, and many have their reason."""
    allowed = math.inf if case.reason else MOST_TIMES_ORDINARY
    yield Finding("iterations", contact.iterations, asked.max_iterations)
    yield Finding("times ordinary", contact.iterations / ordinary, allowed)


@lru_cache(maxsize=64)
def ordinary_iterations(shape: tuple[int, int]) -> int:
    """Iterations for the paper's surface, cropped to this grid, at Delta = 25 um; at least 1."""
    return max(Setup(cropped_paper(shape), spacing=1.0).solve().iterations, 1)
