"""What a check finds: a number and its bound; and how input has to be refused."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass


@dataclass(frozen=True)
class Finding:
    """One number of a check, and what it may be at most.

    Attributes
    ----------
    what : the deviation, in words
    error : its size; what is not a number counts as failed
    allowed : the largest that passes
    """

    what: str
    error: float
    allowed: float

    @property
    def passed(self) -> bool:
        """Whether the deviation is small enough."""
        return self.error <= self.allowed

    def __str__(self) -> str:
        """Both numbers and which is the larger."""
        return f"{self.what} {self.error:.2g} {'≤' if self.passed else '>'} {self.allowed:.2g}"


def worst_of(findings: Iterable[Finding]) -> Finding:
    """The finding that is nearest to its bound, or furthest beyond."""
    return max(findings, key=_share, default=Finding("nothing was looked for", 1, 0))


def _share(finding: Finding) -> tuple[bool, float]:
    """Order of findings: what failed first, then the larger share of what is allowed."""
    share = finding.error / (finding.allowed or 1.0)
    return not finding.passed, math.inf if math.isnan(share) else share


@dataclass(frozen=True)
class Refusal:
    """How input has to be refused.

    Attributes
    ----------
    error : the kind of error, exactly
    words : what its one line says, of what was given and of what is allowed
    """

    error: type[Exception]
    words: tuple[str, ...]

    def judge(self, raised: Exception | None) -> Iterator[Finding]:
        """Whether it was."""
        message = str(raised)
        missing = [word for word in self.words if word not in message]
        yield Finding(f"other than {self.error.__name__}", int(type(raised) is not self.error), 0)
        yield Finding("lines", len(message.splitlines()), 1)
        yield Finding(", ".join(["words missing", *missing]), len(missing), 0)
