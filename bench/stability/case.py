"""A case of a table as data, what its checks say, and how it is run."""

import math
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Finding:
    """One number of a check, and its bound.

    Attributes
    ----------
    what : str
        The deviation in words.
    error : float
        Its size; NaN counts as failed.
    allowed : float
        The largest size that passes.
    """

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


@dataclass(frozen=True)
class Refusal:
    """How input has to be refused.

    Attributes
    ----------
    error : type
        The kind of error, exactly.
    words : tuple of str
        Parts of its one line, which name the given and the allowed value.
    """

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

    Attributes
    ----------
    out : str
        The answer in words, or the message of the error.
    findings : iterable of Finding
        Is it right?
    asked : str
        The input in words; empty where the case itself says it.
    numbers : mapping of str to numbers
        Further columns of the table.
    raised : Exception or None
        The error, if there was no answer.
    """

    out: str
    findings: Iterable[Finding]
    asked: str = ""
    numbers: Mapping[str, object] = field(default_factory=dict)
    raised: Exception | None = None


@dataclass(frozen=True)
class Case:
    """A row of a table.

    Attributes
    ----------
    family : str
        The kind of extreme.
    name : str
        Name of the case, unique in its family.
    asked : str
        The input in words.
    examine : callable
        Returns a judged answer. An error that it raises is a failure, unless one was wanted.
    refusal : Refusal or None
        How the input has to be refused, if it has no answer.
    slow : bool
        Whether only the full table has the case.
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
    """Make a case that has to be refused; without an error it has nothing to show."""

    def examine() -> Answer:
        call()
        return Answer("an answer", ())

    return Case(family, name, asked, examine, refusal)


@dataclass(frozen=True)
class Result:
    """The outcome of a case.

    Attributes
    ----------
    case : Case
        The case.
    answer : Answer
        Its answer; its findings are among those below.
    findings : tuple of Finding
        Is the answer right, or was the input refused as it should be? Warnings are findings too.
    """

    case: Case
    answer: Answer
    findings: tuple[Finding, ...] = ()

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

    @property
    def asked(self) -> str:
        """The input in words."""
        return self.answer.asked or self.case.asked


def run_case(case: Case) -> Result:
    """Ask and judge; raises ModuleNotFoundError where an extra is missing."""
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        try:
            answer = case.examine()
            judged = list(answer.findings)
        except ModuleNotFoundError:  # of an extra: nothing that the case is about
            raise
        except Exception as error:  # whatever else it is, the table is to show it
            answer, judged = Answer(one_line(error), (), raised=error), []
    findings: list[Finding] = []
    if case.refusal is not None:
        findings += case.refusal.judge(answer.raised)
    elif answer.raised is not None:
        kind = type(answer.raised).__name__
        findings.append(Finding(f"{kind} instead of an answer", 1, 0))
    for text in dict.fromkeys(one_line(warning.message) for warning in warned):
        judged.append(Finding(f"warning {text[:200]}", 1, 0))
    return Result(case, answer, (*findings, *judged))


def one_line(message: object) -> str:
    """Return the words of an error or a warning in one line."""
    return " ".join(str(message).split())
