"""Many random contacts as one case: the largest of each deviation, and the exceptions."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from functools import partial

import numpy as np

import bem
from bench.references.half_space import Field
from bench.references.surfaces import SURFACES, Random
from bench.stability.case import Answer, Case, Finding
from bench.stability.solver.setup import Setup
from gen.runtime.signals import Overtime, at_most

BLOCK = 100  # problems of a case; the first block is in the quick table


def blocks(
    family: str, problems: int, asked: str, examine: Callable[[range], Answer], what: str
) -> Iterator[Case]:
    """Cut many problems into cases, named by what is numbered."""
    for first in range(0, problems, BLOCK):
        name, block = f"{what} {first} to {first + BLOCK - 1}", range(first, first + BLOCK)
        yield Case(family, name, asked, partial(examine, block), slow=first > 0)


def surface_and_aspect(
    random: Random, nodes: tuple[int, int], largest_aspect: float
) -> tuple[Field, float]:
    """Draw heights with a range of 1, fewest to most nodes a side; half of the cells are oblong."""
    rows, columns = (int(each) for each in random.integers(nodes[0], nodes[1] + 1, 2))
    heights = SURFACES[list(SURFACES)[random.integers(len(SURFACES))]](random, (rows, columns))
    oblong = random.random() < 0.5
    aspect = float(largest_aspect ** random.uniform(-1, 1)) if oblong else 1.0
    return heights / (np.ptp(heights) or 1.0), aspect


@dataclass
class Tally:
    """The outcome of many solves of at most `seconds` each; a longer one counts as an endless loop.

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

    def answer(self, problems: int, said: str = "", *first: Finding) -> Answer:
        """Judge all solves, by these findings, or that there are no errors, and by the worst."""
        middle, most = np.percentile(np.array(self.iterations or [0]), (50, 100))
        out = f"{problems} solves, {middle:.0f} iterations in the middle, {most:.0f} at most{said}"
        conduct = first or (self.raised("without an answer"),)
        return Answer(out, [*conduct, *self.largest.values()])
