"""The table of contacts that yield: 1,000 beside least squares, 1,000 of the paper's surfaces."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial
from unittest import mock

import numpy as np

import bem
from bem import half_space
from bench.references.dense import displace
from bench.stability.case import Answer, Case, Finding
from bench.stability.hardness.problems import RTOL, YieldingProblem, problem
from gen.generation.plan import parameters
from gen.generation.sample import surface_of
from gen.runtime.overtime import Overtime, at_most
from gen.scene import load

PROBLEMS = 1000
BLOCK = 100
"""Problems of a case; the first block is in the quick table."""

SECONDS = 60.0
"""Wall-clock time after which a solve counts as a loop."""

ROUNDING = 1e-11
"""What two products of the matrix and a pressure may differ by [displacement of the far field]."""

UNDECIDED = 1e-8
"""Pressures, over the hardness, and gaps, over the displacement, that may be either [1]."""

FORCE = 1e-8
"""Deviation of the force [1]."""

PAPER_HARDNESS = (1e-3, 1.0)
"""Least and largest hardness of the paper's surfaces [E*]."""


def cases() -> Iterator[Case]:
    """Ten blocks beside least squares, then ten blocks of the paper preset."""
    for first in range(0, PROBLEMS, BLOCK):
        seeds = range(first, first + BLOCK)
        name = f"problems {first} to {first + BLOCK - 1}"
        asked = "2 to 33 nodes a side, cells to 1:100, H from 1e-4 to 10 E*, rtol = 1e-10"
        examine = partial(_beside_least_squares, seeds)
        yield Case("least squares", name, asked, examine, slow=first > 0)
    for first in range(0, PROBLEMS, BLOCK):
        rows = range(first, first + BLOCK)
        name = f"rows {first} to {first + BLOCK - 1}"
        asked = "129 x 129 nodes, H from 1e-3 to 1 E*, default tolerance"
        yield Case("the paper's surfaces", name, asked, partial(_paper, rows), slow=first > 0)


@dataclass
class Tally:
    """Deviations of many solves, the largest of each kind.

    Attributes
    ----------
    iterations : list of int
        Iterations of every solve that has an answer.
    astray : list of str
        Errors that were raised, with their seeds.
    largest : dict of str to float
        Largest deviation by its name.
    """

    iterations: list[int] = field(default_factory=list)
    astray: list[str] = field(default_factory=list)
    largest: dict[str, float] = field(default_factory=dict)

    def note(self, **deviations: float) -> None:
        """Keep deviations if they are the largest so far; NaN is larger than any number."""
        for name, value in deviations.items():
            size = np.inf if np.isnan(value) else float(value)
            self.largest[name] = max(self.largest.get(name, 0.0), size)

    def examine(self, seed: int, asked: YieldingProblem) -> None:
        """Solve, and compare with bounded least squares and with the conditions of contact."""
        for few_per_root in (half_space.FEW_PER_ROOT, 0.0):  # as it comes, then iterations alone
            try:
                with mock.patch.object(half_space, "FEW_PER_ROOT", few_per_root), at_most(SECONDS):
                    contact = asked.solve()
            except (Overtime, Exception) as error:
                self.astray.append(f"{type(error).__name__} at seed {seed}")
                continue
            self.iterations.append(contact.iterations)
            pressure, gap = asked.expected
            self.note(
                force=abs(contact.force / (float(pressure.sum()) * asked.aspect) - 1),
                nodes=unlike_nodes(asked, contact, pressure, gap),
                **conditions(asked, contact),
            )

    def findings(self) -> Iterator[Finding]:
        """Judge all solves."""
        yield Finding(", ".join(["without an answer", *self.astray[:3]]), len(self.astray), 0)
        bounds = {"force": FORCE, "nodes": 0.0, "beyond": 0.0, "shrunk": 0.0, "stated": 1e-12}
        for name, value in self.largest.items():
            yield Finding(WORDS[name], value, bounds.get(name, RTOL + ROUNDING))


WORDS = {
    "force": "force off least squares",
    "nodes": "nodes off least squares",
    "beyond": "nodes in tension or above the hardness",
    "gap": "gap",
    "depth": "yielded depth off the gap",
    "stated": "stated numbers off the pressure",
    "residual": "residual off",
    "shrunk": "nodes fewer than in the elastic contact",
}
"""Deviations in words."""


def unlike_nodes(
    asked: YieldingProblem, contact: bem.Contact, pressure: np.ndarray, gap: np.ndarray
) -> int:
    """Count nodes whose contact or yielding differs from that of a pressure and its gap."""
    little, close = UNDECIDED * asked.hardness, UNDECIDED * asked.delta
    touching = ((contact.pressure > 0) != (pressure > 0)) & ((pressure > little) | (gap > close))
    below = asked.hardness - pressure
    yielded = (contact.pressure == asked.hardness) != (below == 0)
    yielded &= (below > little) | (gap < -close)
    return int(np.count_nonzero(touching | yielded))


def conditions(asked: YieldingProblem, contact: bem.Contact) -> dict[str, float]:
    """Deviations from the conditions of contact, by the dense matrix, over the displacement."""
    pressure, hardness = contact.pressure, asked.hardness
    interference = asked.heights - asked.heights.max() + asked.delta
    gap = (displace(pressure, asked.kernel, asked.aspect) - interference) / asked.delta
    yielded = pressure == hardness
    wrong = np.where(pressure == 0, -gap, np.where(yielded, gap, np.abs(gap))).max()
    depth = np.where(yielded, np.maximum(-gap, 0.0), 0.0)
    flattened = asked.heights - contact.yielded_depth
    heights_range = float(np.ptp(asked.heights)) or 1.0
    return {
        "beyond": float(np.count_nonzero(~((pressure >= 0) & (pressure <= hardness)))),
        "gap": max(float(wrong), 0.0),
        "residual": abs(max(float(wrong), 0.0) - contact.residual),
        "depth": float(np.abs(contact.yielded_depth / asked.delta - depth).max()),
        "stated": max(
            abs(contact.yielded_percent - 100 * float(yielded.mean())),
            abs(contact.force / (float(pressure.sum()) * asked.aspect) - 1),
            float(np.abs(contact.flattened - flattened).max()) / heights_range,
        ),
    }


def _beside_least_squares(seeds: range) -> Answer:
    tally, shares = Tally(), []
    for seed in seeds:
        asked = problem(seed)
        tally.examine(seed, asked)
        shares.append(float(np.mean(asked.expected[0] == asked.hardness)))
    some = sum(0 < share < 1 for share in shares)
    out = f"{len(seeds)} solves, {_iterations(tally.iterations)}; some nodes yield in {some}"
    out += f", all in {shares.count(1.0)}"
    return Answer(out, tally.findings())


def _iterations(counts: list[int]) -> str:
    middle, most = np.percentile(np.array(counts or [0]), (50, 100))
    return f"{middle:.0f} iterations in the middle, {most:.0f} at most"


def _paper(rows: range) -> Answer:
    """Solve the paper's surfaces at the default tolerance: none fails, and areas only grow."""
    scene = load("paper")
    plan = parameters(scene, rows.start, rows.stop)
    tally = Tally()
    for number, row in enumerate(rows):
        share = np.random.default_rng((row, 1)).uniform(*np.log10(PAPER_HARDNESS))
        heights, delta = surface_of(scene, plan, number), float(plan.delta[number])
        solve = partial(bem.solve, heights, scene.surface.side, delta)
        try:
            with at_most(SECONDS):
                contact = solve(hardness=float(10**share))
        except (Overtime, Exception) as error:
            tally.astray.append(f"{type(error).__name__} at row {row}")
            continue
        tally.iterations.append(contact.iterations)
        shrunk = solve().contact_nodes - contact.contact_nodes
        tally.note(shrunk=max(float(shrunk), 0.0))
    out = f"{len(rows)} solves, {_iterations(tally.iterations)}"
    return Answer(out, tally.findings())
