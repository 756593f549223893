"""Cases of stiff and extreme input as data, their verdicts, and the tables that they make."""

import math
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pkgutil import resolve_name
from typing import NamedTuple

from bench.files import Row
from bench.report import Report, remark
from gen.quantities import AREA, FORCE
from gen.runtime.errors import InputError


class Finding(NamedTuple):
    """One number of a check, and the largest that passes; NaN counts as failed."""

    what: str
    error: float
    allowed: float

    @property
    def passed(self) -> bool:
        """Whether the deviation is small enough."""
        return self.error <= self.allowed

    @property
    def rank(self) -> tuple[bool, float]:
        """Order of findings: failed ones are the largest, then the share of the bound."""
        share = self.error / (self.allowed or 1.0)
        return not self.passed, math.inf if math.isnan(share) else share

    def __str__(self) -> str:
        """Both numbers, and which one is the larger."""
        return f"{self.what} {self.error:.2g} {'≤' if self.passed else '>'} {self.allowed:.2g}"


class Refusal(NamedTuple):
    """How input has to be refused: by exactly this error, in one line with these words."""

    error: type[Exception]
    words: tuple[str, ...]

    def judge(self, raised: Exception | None) -> Iterator[Finding]:
        """Compare an error with the wanted one."""
        message = str(raised)
        missing = [word for word in self.words if word not in message]
        yield Finding(
            f"other than {self.error.__name__}", int(type(raised) is not self.error), 0
        )
        yield Finding("lines", len(message.splitlines()), 1)
        yield Finding(", ".join(["words missing", *missing]), len(missing), 0)


@dataclass(frozen=True)
class Answer:
    """The answer to a case, judged.

    `run_case` adds whether the case was refused as it should be, warnings, and its input in words.
    """

    out: str  # the answer in words, or the message of the error
    findings: Sequence[Finding] = ()  # whether it is right
    asked: str = ""  # the input in words
    numbers: Mapping[str, object] = field(
        default_factory=dict
    )  # further columns of the table
    raised: Exception | None = None  # the error, if there was no answer

    @property
    def passed(self) -> bool:
        """Whether there are findings, all within their bounds."""
        return bool(self.findings) and all(finding.passed for finding in self.findings)

    @property
    def failed(self) -> str:
        """The findings beyond their bounds."""
        return "; ".join(str(finding) for finding in self.findings if not finding.passed)

    @property
    def worst(self) -> Finding:
        """The finding that is nearest to its bound, or furthest beyond."""
        nothing = Finding("nothing was looked for", 1, 0)
        return max(self.findings, key=lambda finding: finding.rank, default=nothing)


@dataclass(frozen=True)
class Case:
    """A row of a table: the kind of extreme, a name, the input in words, and how it is examined.

    `examine` returns an `Answer`, unless `refusal` says how the input has to be refused. Only the
    full table has cases that are slow.
    """

    family: str
    name: str
    asked: str
    examine: Callable[[], object]
    refusal: Refusal | None = None
    slow: bool = False


def run_case(case: Case) -> Answer:
    """Ask and judge; raises ModuleNotFoundError where an extra is missing."""
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        try:
            found = case.examine()
            answer = found if isinstance(found, Answer) else Answer("an answer")
        except ModuleNotFoundError:  # of an extra: nothing that the case is about
            raise
        except Exception as error:  # whatever else it is, the table is to show it
            answer = Answer(one_line(error), raised=error)
    conduct: list[Finding] = []
    if case.refusal is not None:
        conduct += case.refusal.judge(answer.raised)
    elif answer.raised is not None:
        conduct.append(
            Finding(f"{type(answer.raised).__name__} instead of an answer", 1, 0)
        )
    texts = dict.fromkeys(one_line(warning.message) for warning in warned)
    warnings_too = [Finding(f"warning {text[:200]}", 1, 0) for text in texts]
    findings = (*conduct, *answer.findings, *warnings_too)
    return replace(answer, asked=answer.asked or case.asked, findings=findings)


def one_line(message: object) -> str:
    """Return the words of an error or a warning in one line."""
    return " ".join(str(message).split())


TABLES = {
    "surfaces": ("surfaces", "Generators and statistics", "surfaces:cases"),
    "solver": ("stability", "The contact solver", "solver:cases"),
    "hardness": ("hardness", "Random contacts that yield", "random_contacts:yielding"),
    "edgeless": ("edgeless", "Random contacts without edges", "random_contacts:edgeless"),
    "models": ("models", "The nine models", "models:cases"),
}
"""Files, titles and functions that yield the cases of tables, in the order of the work."""

NUMBERS = (AREA.name, FORCE.in_tables, "residual", "iterations", "ordinary_iterations")
"""Further columns of the solver's table."""


def cases_of(table: str) -> list[Case]:
    """Return the cases of a table, family after family; imports only what this table needs."""
    return list(resolve_name(f"bench.stability.{TABLES[table][2]}")())


def row_of(table: str, case: Case, answer: Answer) -> Row:
    """Return a row of a table: the answer, its worst check, and all checks."""
    worst = answer.worst
    row = {
        "family": case.family,
        "case": case.name,
        "input": answer.asked,
        "what_came_out": answer.out,
        "check": worst.what,
        "error": float(worst.error),
        "allowed": float(worst.allowed),
        "all_checks": "; ".join(map(str, answer.findings)),
        "verdict": "passed" if answer.passed else "failed",
    }
    if table == "solver":
        row |= {"message": answer.out if answer.raised else "", "worst": str(worst)}
        row |= {name: answer.numbers.get(name, "") for name in NUMBERS}
    return row


def report(full: bool, of: Sequence[str]) -> Report:
    """Run the cases of some tables, of all unless named; only `full` tables have the slow ones.

    An InputError is raised if there is no such table, before anything is run.
    """
    unknown = [table for table in of if table not in TABLES]
    if unknown:
        raise InputError(f"--of {unknown[0]!r}: give one of {', '.join(TABLES)}")
    tables, said = {}, []
    for table in of or TABLES:
        cases = [case for case in cases_of(table) if full or not case.slow]
        file, title, _ = TABLES[table]
        remark(f"{title}: {len(cases)} cases")
        judged = [(case, run_case(case)) for case in cases]
        tables[file] = [row_of(table, *each) for each in judged]
        failed = [(case, answer) for case, answer in judged if not answer.passed]
        said.append(f"{title}: {len(judged)} cases, {len(failed)} failed")
        said += [
            f"  {case.family}, {case.name}: {answer.failed}" for case, answer in failed
        ]
    return Report(tables, text="\n".join(said))
