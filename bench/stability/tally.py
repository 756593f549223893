"""Many random contacts as one case: the largest of each deviation, and what was raised."""

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

import bem
from bench.stability.case import Answer, Finding
from bench.stability.solver.setup import Setup
from gen.runtime.overtime import Overtime, at_most


@dataclass
class Tally:
    """What came of many solves of at most `seconds` each: more counts as a loop.

    `iterations` are of every solve that has an answer, `astray` the errors that were raised and
    where, `largest` the worst finding of each name.
    """

    seconds: float
    iterations: list[int] = field(default_factory=list)
    astray: list[tuple[Exception, str]] = field(default_factory=list)
    largest: dict[str, Finding] = field(default_factory=dict)

    def solve(self, asked: Setup, where: str) -> bem.Contact | None:
        """Solve; return None where that raises an error, and keep it."""
        try:
            with at_most(self.seconds):
                contact = asked.solve()
        except (Overtime, Exception) as error:
            self.astray.append((error, where))
            return None
        self.iterations.append(contact.iterations)
        return contact

    def note(self, findings: Iterable[Finding]) -> None:
        """Keep findings that are the worst of their name so far."""
        for finding in findings:
            worst = self.largest.get(finding.what, finding)
            self.largest[finding.what] = max(worst, finding, key=lambda each: each.rank)

    def raised(self, what: str, *expected: type[Exception]) -> Finding:
        """Count errors, apart from those of expected types, and name the first three."""
        others = [each for each in self.astray if not isinstance(each[0], expected)]
        names = [f"{type(error).__name__} at {where}" for error, where in others[:3]]
        return Finding(", ".join([what, *names]), len(others), 0)

    def answer(self, problems: int, said: str, *first: Finding) -> Answer:
        """Judge all solves, by these findings and by the worst of each name."""
        middle, most = np.percentile(np.array(self.iterations or [0]), (50, 100))
        out = f"{problems} solves, {middle:.0f} iterations in the middle, {most:.0f} at most{said}"
        return Answer(out, [*first, *self.largest.values()])
