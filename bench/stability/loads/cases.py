"""The table of random loads: a tolerance a row, thousands of solves in all."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial

import numpy as np

import bem
from bem.problem import RTOL
from bench.references.half_space import displacement
from bench.stability.case import Answer, Case, Finding
from bench.stability.loads.problems import LoadProblem, problem
from gen.runtime.overtime import Overtime, at_most

SECONDS = 20.0
"""Wall-clock time after which a solve on at most 1,600 nodes counts as a loop."""

ROUNDING = 1e-10
"""What two convolutions of the same pressure may differ by [displacement of the far field]."""

NOT_CONVERGED = 1e-3
"""Share of solves that may end without an answer [1]."""

SOLVES = {RTOL: 2000, **{10.0**-decade: 250 for decade in range(2, 14)}}
"""Tolerances and how often each is asked for, 5,000 solves in all."""

QUICK_SHARE = 10
"""One of so many solves is in the quick table too."""


@dataclass
class Tally:
    """What came of the solves of one tolerance.

    Attributes
    ----------
    iterations : of each solve that has an answer
    unanswered : how many ended with `bem.NotConverged`
    astray : what else was raised, with the seed
    untrue : solves without an answer whose message is not true
    force_off, residual_off, excess : the largest deviation of the force from the one given [1], of
        the residual from one that is computed apart from `bem`, and of the latter above the
        tolerance [displacement of the far field]
    """

    iterations: list[int] = field(default_factory=list)
    unanswered: int = 0
    astray: list[str] = field(default_factory=list)
    untrue: int = 0
    force_off: float = 0.0
    residual_off: float = 0.0
    excess: float = 0.0

    def solve(self, seed: int, asked: LoadProblem) -> None:
        """Solve and take note."""
        try:
            with at_most(SECONDS):
                contact = asked.solve()
        except bem.NotConverged as error:
            self.unanswered += 1
            self.untrue += error.contact.residual <= asked.rtol
            self.residual_off = max(self.residual_off, _residual_off(asked, error.contact))
            return
        except (Overtime, Exception) as error:
            self.astray.append(f"{type(error).__name__} at seed {seed}")
            return
        self.iterations.append(contact.iterations)
        off = _residual_off(asked, contact)
        self.residual_off = max(self.residual_off, off)
        self.excess = max(self.excess, contact.residual + off - asked.rtol)
        self.force_off = max(self.force_off, abs(contact.force / asked.force - 1))

    def findings(self) -> Iterator[Finding]:
        """Judge them."""
        solves = len(self.iterations) + self.unanswered + len(self.astray)
        yield Finding(", ".join(["ended otherwise", *self.astray[:3]]), len(self.astray), 0)
        yield Finding("share without an answer", self.unanswered / solves, NOT_CONVERGED)
        yield Finding("messages that are not true", self.untrue, 0)
        yield Finding("residual off", self.residual_off, ROUNDING)
        yield Finding("residual above rtol", self.excess, ROUNDING)
        yield Finding("force off", self.force_off, 1e-12)


def _residual_off(asked: LoadProblem, contact: bem.Contact) -> float:
    """The residual that is said, less that by a convolution written apart from `bem`."""
    aspect = asked.spacing[1] / asked.spacing[0]
    moved = displacement(contact.pressure * asked.spacing[0], asked.kernel, aspect)
    gap = moved - (asked.heights - asked.heights.max()) - contact.approach
    worst = float(np.where(contact.pressure > 0, np.abs(gap), -gap).max())
    return abs(max(worst, 0.0) / contact.approach - contact.residual)


def _examine(rtol: float, first: int, last: int) -> Answer:
    tally = Tally()
    for seed in range(first, last):
        tally.solve(seed, problem(seed, rtol))
    middle, most = np.percentile(np.array(tally.iterations or [0]), (50, 100))
    out = f"{last - first} solves, {middle:.0f} iterations in the middle, {most:.0f} at most"
    return Answer(out, tally.findings())


def cases() -> Iterator[Case]:
    """One case a tolerance, each in two parts."""
    asked = "forces and mean pressures, 2 to 40 nodes a side, cells of 1:1 to 1:1,000"
    for slow in (False, True):
        family = "the other solves" if slow else "one solve of ten"
        first = 0
        for rtol, solves in SOLVES.items():
            quick = first + solves // QUICK_SHARE
            begin, end = (quick, first + solves) if slow else (first, quick)
            examine = partial(_examine, rtol, begin, end)
            yield Case(family, f"rtol = {rtol:g}", asked, examine, slow=slow)
            first += solves
