"""A case of surfaces or models as data, and what comes out of running it."""

import warnings
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from bench.stability.finding import Finding, Refusal, worst_of
from bench.stability.sheet import Sheet, nothing_more, verdict


@dataclass(frozen=True)
class Answer:
    """What a case has to tell.

    Attributes
    ----------
    out : what came out, in words
    findings : is it right?
    """

    out: str
    findings: Iterable[Finding]


@dataclass(frozen=True)
class Case:
    """A row of a table.

    Attributes
    ----------
    family : what kind of extreme it is
    name : of the case, unique in its family
    asked : what is given, in words
    examine : asks and judges; what it raises is a failure, unless it was to be refused
    refusal : how it has to be refused, for input that has no answer
    slow : whether only the full table has it
    """

    family: str
    name: str
    asked: str
    examine: Callable[[], Answer]
    refusal: Refusal | None = None
    slow: bool = False


def refused(
    family: str, name: str, asked: str, call: Callable[[], object], refusal: Refusal
) -> Case:
    """A case that has to be refused; without an error it has nothing to show."""

    def examine() -> Answer:
        call()
        return Answer("an answer", ())

    return Case(family, name, asked, examine, refusal)


@dataclass(frozen=True)
class Result:
    """What came out of a case.

    Attributes
    ----------
    case : what was run
    out : what came out, or the message of the error that was raised
    findings : is it right, or was it refused as it should? Warnings are findings too.
    """

    case: Case
    out: str
    findings: tuple[Finding, ...] = field(default=())

    @property
    def passed(self) -> bool:
        """Whether all that was found is within its bounds, and anything was looked for."""
        return bool(self.findings) and all(finding.passed for finding in self.findings)

    @property
    def worst(self) -> Finding:
        """The finding that is nearest to its bound, or furthest beyond."""
        return worst_of(self.findings)


def run_case(case: Case) -> Result:
    """Ask and judge; raises ModuleNotFoundError where an extra is missing."""
    out, findings, raised = "", [], None
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        try:
            answer = case.examine()
            out, findings = answer.out, list(answer.findings)
        except ModuleNotFoundError:  # of an extra: nothing that the case is about
            raise
        except Exception as error:  # whatever else it is, the table is to show it
            raised = error
            out = " ".join(str(error).split())
    if case.refusal is not None:
        findings = list(case.refusal.judge(raised))
    elif raised is not None:
        findings.append(Finding(f"{type(raised).__name__} instead of an answer", 1, 0))
    for text in dict.fromkeys(" ".join(str(warning.message).split()) for warning in warned):
        findings.append(Finding(f"warning {text[:200]}", 1, 0))
    return Result(case, out, (*findings,))


HEADER = (
    "family",
    "case",
    "input",
    "what_came_out",
    "check",
    "error",
    "allowed",
    "all_checks",
    "verdict",
)


def row(result: Result) -> tuple[object, ...]:
    """Of the file: the worst check as numbers, then all of them."""
    worst = result.worst
    return (
        result.case.family,
        result.case.name,
        result.case.asked,
        result.out,
        worst.what,
        float(worst.error),
        float(worst.allowed),
        "; ".join(str(finding) for finding in result.findings),
        verdict(result),
    )


def cells(result: Result) -> tuple[str, ...]:
    """Of the printed table."""
    shown = [f for f in result.findings if not f.passed or result.case.refusal is None]
    checks = "; ".join(str(finding) for finding in shown)
    return result.case.asked, result.out, checks or "refused as it should be"


def sheet(title: str, file: str, cases: Iterable[Case]) -> Sheet:
    """A table of such cases."""
    titles = ("case", "input", "what came out", "checks: error ≤ allowed")
    return Sheet(title, file, (*cases,), run_case, HEADER, row, titles, cells, nothing_more)
