"""Random forces and mean pressures: surface, cells, kernel and load of a seed, at all tolerances.

A tolerance is a row of the table, of thousands of solves in all.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np

import bem
from bem.problem import RTOL
from bench.references import surfaces
from bench.references.half_space import Field
from bench.references.surfaces import Random, Shape
from bench.stability.case import Answer, Case, Finding
from bench.stability.solver.checks import honesty
from bench.stability.solver.setup import Setup
from bench.stability.tally import Tally

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


SURFACES: tuple[Callable[[Random, Shape], Field], ...] = (
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
    surface = SURFACES[random.integers(len(SURFACES))]
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
