"""Many random contacts as one case, and random forces and mean pressures at all tolerances.

A tolerance is a row of the table of loads, of thousands of solves in all.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

import bem
from bem.problem import RTOL
from bench.references import surfaces
from bench.references.half_space import Field
from bench.references.surfaces import Random, Shape
from bench.stability.case import Answer, Case, Finding
from bench.stability.checks import honesty
from bench.stability.setup import Setup
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
    heights = surfaces.SURFACES[list(surfaces.SURFACES)[random.integers(len(surfaces.SURFACES))]](
        random, (rows, columns)
    )
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


SECONDS = 20.0  # wall-clock time after which a solve on at most 1,600 nodes counts as a loop
# What two convolutions of the same pressure may differ by [displacement of the far field].
ROUNDING = 1e-10
NOT_CONVERGED = 1e-3  # share of solves that may end without an answer [1]
# Tolerances and how often each is asked for, 5,000 solves in all.
SOLVES = {RTOL: 2000, **{10.0**-decade: 250 for decade in range(2, 14)}}
QUICK_SHARE = 10  # one solve of this number is in the quick table too
NODES = (2, 40)  # fewest and most nodes a side
LARGEST_ASPECT = 1000.0  # largest ratio of a cell's sides, either way [1]


def _ridges(random: Random, shape: Shape) -> Field:
    """One row, and often one column, above all the rest: ties without end."""
    heights = np.zeros(shape)
    heights[random.integers(shape[0])] = 1
    if random.random() < 0.5:
        heights[:, random.integers(shape[1])] = 1
    return heights


def _waves(random: Random, shape: Shape) -> Field:
    x, y = np.ogrid[: shape[0], : shape[1]]
    along, across = random.uniform(0, np.pi, 2)
    return np.asarray(np.cos(along * x) + np.cos(across * y))


KINDS: tuple[Callable[[Random, Shape], Field], ...] = (
    surfaces.SURFACES["white noise"],
    surfaces.random_walk,
    surfaces.SURFACES["integer ties"],
    lambda random, shape: np.zeros(shape),
    _ridges,
    lambda random, shape: np.indices(shape).sum(0) % 2.0,
    surfaces.spikes,
    surfaces.pits,
    _waves,
    surfaces.paraboloid,
)
"""Kinds of heights; made to range over 1 um."""


def cases() -> Iterator[Case]:
    """One case a tolerance, each in two parts."""
    asked = "forces and mean pressures, 2 to 40 nodes a side, cells of 1:1 to 1:1,000"
    for slow in (False, True):
        family = "the other solves" if slow else "one solve of ten"
        first = 0
        for rtol, solves in SOLVES.items():
            quick = first + solves // QUICK_SHARE
            seeds = range(quick, first + solves) if slow else range(first, quick)
            yield Case(family, f"rtol = {rtol:g}", asked, partial(examine, rtol, seeds), slow=slow)
            first += solves


def problem(seed: int, rtol: float) -> Setup:
    """Draw a problem; three of five have oblong cells."""
    random = np.random.default_rng(seed)
    surface = KINDS[random.integers(len(KINDS))]
    rows, columns = (int(nodes) for nodes in random.integers(NODES[0], NODES[1] + 1, 2))
    heights = surface(random, (rows, columns))
    oblong = random.random() < 0.6
    aspect = float(LARGEST_ASPECT ** random.uniform(-1, 1)) if oblong else 1.0
    concentrated = not oblong and random.random() < 0.3
    pressure = float(10 ** random.uniform(-5, 1))
    by_force = random.random() < 0.5
    return Setup(
        heights / (np.ptp(heights) or 1.0),
        spacing=(1.0, aspect),
        kernel="concentrated-force" if concentrated else "uniform-pressure",
        rtol=rtol,
        force=pressure * (rows * columns * aspect) if by_force else None,
        pressure=None if by_force else pressure,
    )


def examine(rtol: float, seeds: range) -> Answer:
    """Solve the problems of some seeds, and judge the answers."""
    tally, untrue = Tally(SECONDS), 0
    for seed in seeds:
        asked = problem(seed, rtol)
        contact = tally.solve(asked, f"seed {seed}")
        if contact is not None:
            tally.note(judge(asked, contact))
        elif isinstance(error := tally.astray[-1][0], bem.NotConverged):
            untrue += error.contact.residual <= rtol
            tally.note(stated(asked, error.contact))
    unanswered = sum(isinstance(error, bem.NotConverged) for error, _ in tally.astray)
    return tally.answer(
        len(seeds),
        "",
        tally.raised("ended otherwise", bem.NotConverged),
        Finding("share without an answer", unanswered / len(seeds), NOT_CONVERGED),
        Finding("messages that are not true", untrue, 0),
    )


def judge(asked: Setup, contact: bem.Contact) -> Iterator[Finding]:
    """Residual and force are those of the pressure, and the force is the one given."""
    findings = stated(asked, contact)
    yield from findings
    excess = contact.residual + findings[0].error - asked.rtol
    yield Finding("residual above rtol", max(excess, 0.0), ROUNDING)
    yield Finding("force off", abs(contact.force / asked.given_force - 1), 1e-12)


def stated(asked: Setup, contact: bem.Contact) -> list[Finding]:
    """Judge the numbers of a contact by its pressure, the residual first and by a tighter bound."""
    residual, *others = honesty(replace(asked, delta=contact.approach), contact)
    return [residual._replace(allowed=ROUNDING), *others]
