"""A case of a table as data, its verdict, and how it is run."""

import math
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

EXACT_FACTORS = {"2^-40": 2.0**-40, "2^40": 2.0**40}  # changes of units that round nothing
FACTORS = EXACT_FACTORS | {"1e-12": 1e-12, "1e12": 1e12}


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
        yield Finding(f"other than {self.error.__name__}", int(type(raised) is not self.error), 0)
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
    numbers: Mapping[str, object] = field(default_factory=dict)  # further columns of the table
    raised: Exception | None = None  # the error, if there was no answer

    @property
    def passed(self) -> bool:
        """Whether there are findings, all within their bounds."""
        return bool(self.findings) and all(finding.passed for finding in self.findings)

    @property
    def verdict(self) -> str:
        """The same in one word."""
        return "passed" if self.passed else "failed"

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
    found, warned = attempt(case.examine)
    answer = found if isinstance(found, Answer) else Answer("an answer")
    if isinstance(found, Exception):
        answer = Answer(one_line(found), raised=found)
    conduct: list[Finding] = []
    if case.refusal is not None:
        conduct += case.refusal.judge(answer.raised)
    elif answer.raised is not None:
        conduct.append(Finding(f"{type(answer.raised).__name__} instead of an answer", 1, 0))
    warnings_too = [Finding(f"warning {text[:200]}", 1, 0) for text in dict.fromkeys(warned)]
    findings = (*conduct, *answer.findings, *warnings_too)
    return replace(answer, asked=answer.asked or case.asked, findings=findings)


def attempt(call: Callable[[], object]) -> tuple[object, list[str]]:
    """Return the result or the exception of a call, and its warnings."""
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        try:
            found = call()
        except ModuleNotFoundError:  # of an extra: nothing that the case is about
            raise
        except Exception as error:  # whatever else it is, the table is to show it
            found = error
    return found, [one_line(warning.message) for warning in warned]


def one_line(message: object) -> str:
    """Return the words of an error or a warning in one line."""
    return " ".join(str(message).split())
