"""Random contacts that yield: 1,000 beside bounded least squares, 1,000 of the paper's surfaces."""

from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache
from unittest import mock

import numpy as np

import bem
from bem.influence import Kernel
from bem.operators import patch
from bem.problem import RTOL as DEFAULT_RTOL
from bench.references import dense
from bench.references.half_space import Field
from bench.stability.case import Case, Finding
from bench.stability.checks import honesty, says_what_yields, unlike_nodes, violation
from bench.stability.setup import Setup, blocks, surface_and_aspect
from gen.generation.plan import parameters
from gen.generation.sample import surface_of
from gen.scene import load

PROBLEMS = 1000  # of each family
SALT = 24  # keeps these draws apart from those of other tables with the same seeds

MOST_NODES = {50: 33, 10: 20, 1: 12}
"""Nodes a side at most: of every 50th problem, every 10th, all others; bounded least squares takes
a time with the fourth power of the number of nodes."""

HARDNESS = (1e-4, 10.0)  # least and largest hardness [E*]
PAPER_HARDNESS = (1e-3, 1.0)  # least and largest hardness of the paper's surfaces [E*]
LARGEST_ASPECT = 100.0  # largest ratio of a cell's sides, either way [1]
RTOL = 1e-10  # tolerance of the solves beside least squares [Delta]
# What two products of the matrix and a pressure may differ by [displacement of the far field].
ROUNDING = 1e-11
# Pressures, over the hardness, and gaps, over the displacement, that may be either [1].
UNDECIDED = 1e-8
# Bounds that are tighter here than in the solver's table.
LIMITS = dict.fromkeys(("residual off", "yielded depth off"), RTOL + ROUNDING)


def cases() -> Iterator[Case]:
    """Ten blocks beside least squares, then ten blocks of the paper preset."""
    squares = "2 to 33 nodes a side, cells to 1:100, H from 1e-4 to 10 E*, rtol = 1e-10"
    paper = "129 x 129 nodes, H from 1e-3 to 1 E*, default tolerance"
    yield from blocks("least squares", PROBLEMS, squares, problem, judge_both_ways)
    yield from blocks("the paper's surfaces", PROBLEMS, paper, papers_problem, touches_more)


def problem(seed: int) -> Setup:
    """Draw a problem.

    The displacement is log-uniform up to that of full elastic contact. The hardness is log-uniform
    over its range for even seeds; for odd ones it is a share, from 1 down to 1 %, of the largest
    elastic pressure, so that it matters and yet not all nodes yield.
    """
    random = np.random.default_rng((SALT, seed))
    most = next(nodes for every, nodes in MOST_NODES.items() if seed % every == 0)
    heights, aspect = surface_and_aspect(random, (2, most), LARGEST_ASPECT)
    concentrated = aspect == 1.0 and random.random() < 0.4
    kernel: Kernel = "concentrated-force" if concentrated else "uniform-pressure"
    deepest = dense.full_contact_delta(heights, kernel, aspect) or 1.0
    delta = deepest * float(10 ** min(random.uniform(-3, 0.2), 0))
    hardness = float(np.exp(random.uniform(*np.log(HARDNESS))))
    if seed % 2:
        elastic, _ = dense.press(heights, delta, kernel, aspect)
        share = float(10 ** random.uniform(-2, 0))
        hardness = float(np.clip(share * delta * elastic.max(), *HARDNESS))
    cell = (1.0, aspect)
    return Setup(heights, delta, spacing=cell, kernel=kernel, hardness=hardness, rtol=RTOL)


@lru_cache(maxsize=128)
def expected(asked: Setup) -> tuple[Field, Field]:
    """(nx, ny) pressure [MPa] and gap [um] of a problem by bounded least squares."""
    given = asked.surface, asked.delta, asked.bound, asked.kernel, asked.aspect
    return dense.press_yielding(*given, sides=dense.by_least_squares)


def judge(asked: Setup, contact: bem.Contact) -> Iterator[Finding]:
    """Compare with least squares, and look at the conditions of contact by the dense matrix."""
    (pressure, gap), hardness = expected(asked), asked.bound
    off = abs(contact.force / (float(pressure.sum()) * asked.aspect) - 1)
    yield Finding("force off least squares", off, 1e-8)
    little, close = UNDECIDED * hardness, UNDECIDED * asked.delta
    nodes = sum(unlike_nodes(asked, contact, (pressure, gap), little, close))
    yield Finding("nodes off least squares", nodes, 0)
    beyond = int(np.count_nonzero(~((contact.pressure >= 0) & (contact.pressure <= hardness))))
    yield Finding("nodes in tension or above the hardness", beyond, 0)
    wrong = violation(asked, contact.pressure, dense.displace)
    yield Finding("gap", wrong, RTOL + ROUNDING)
    for check in (honesty, says_what_yields):
        for finding in check(asked, contact, dense.displace):
            yield finding._replace(allowed=LIMITS.get(finding.what, finding.allowed))


def judge_both_ways(asked: Setup, contact: bem.Contact) -> Iterator[Finding]:
    """Compare a contact, and the one by iterations alone, with least squares."""
    yield from judge(asked, contact)
    with mock.patch.object(patch, "FEW_FREE", ((0.0, 1.0),)):
        yield from judge(asked, asked.solve())


def papers_problem(row: int) -> Setup:
    """Draw a hardness for a row of the paper preset, at the default tolerance."""
    scene = load("paper")
    plan = parameters(scene, row, row + 1)
    share = np.random.default_rng((row, 1)).uniform(*np.log10(PAPER_HARDNESS))
    heights, delta = surface_of(scene, plan, 0), float(plan.load[0])
    hardness = float(10**share)
    return Setup(heights, delta, scene.sides[0], rtol=DEFAULT_RTOL, hardness=hardness)


def touches_more(asked: Setup, contact: bem.Contact) -> Iterator[Finding]:
    """Compare the number of nodes in contact with that of the elastic body."""
    shrunk = float(replace(asked, hardness=None).solve().contact_nodes - contact.contact_nodes)
    yield Finding("nodes fewer than in the elastic contact", max(shrunk, 0.0), 0)
