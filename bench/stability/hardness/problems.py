"""Random contacts with a hardness: surface, cells, kernel, displacement and hardness of a seed."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

import bem
from bem.influence import Kernel
from bench.references import dense, yielding
from bench.references.surfaces import SURFACES, Field

SALT = 24
"""Keeps these draws apart from those of other tables with the same seeds."""

MOST_NODES = {50: 33, 10: 20, 1: 12}
"""Nodes a side at most: of every 50th problem, every 10th, all others; bounded least squares takes
a time with the fourth power of the number of nodes."""

HARDNESS = (1e-4, 10.0)
"""Least and largest hardness [E*]."""

LARGEST_ASPECT = 100.0
"""Largest ratio of a cell's sides, either way [1]."""

RTOL = 1e-10
"""Tolerance of the solves [Delta]."""


@dataclass(frozen=True, eq=False)
class YieldingProblem:
    """A rigid surface and a half-space of E* = 1 MPa that yields.

    Attributes
    ----------
    heights : ndarray, shape (nx, ny)
        Heights [um].
    aspect : float
        Second side of a cell; the first is 1 um [um].
    delta : float
        Displacement of the far field [um].
    hardness : float
        Largest pressure [MPa].
    kernel : str
        See `bem.solve`.
    """

    heights: Field
    aspect: float
    delta: float
    hardness: float
    kernel: Kernel

    def solve(self, rtol: float = RTOL) -> bem.Contact:
        """Solve by `bem`."""
        return bem.solve(
            self.heights,
            1.0,
            self.delta,
            spacing=(1.0, self.aspect),
            kernel=self.kernel,
            hardness=self.hardness,
            rtol=rtol,
        )

    @cached_property
    def expected(self) -> tuple[Field, Field]:
        """(nx, ny) pressure [MPa] and gap [um] by bounded least squares."""
        return yielding.press(self.heights, self.delta, self.hardness, self.kernel, self.aspect)


def problem(seed: int) -> YieldingProblem:
    """Draw a problem.

    The displacement is log-uniform up to that of full elastic contact. The hardness is log-uniform
    over its range for even seeds; for odd ones it is a share, from 1 down to 1 %, of the largest
    elastic pressure, so that it matters and yet not all nodes yield.
    """
    random = np.random.default_rng((SALT, seed))
    most = next(nodes for every, nodes in MOST_NODES.items() if seed % every == 0)
    rows, columns = (int(nodes) for nodes in random.integers(2, most + 1, 2))
    heights = SURFACES[list(SURFACES)[random.integers(len(SURFACES))]](random, (rows, columns))
    heights = heights / (np.ptp(heights) or 1.0)
    oblong = random.random() < 0.5
    aspect = float(LARGEST_ASPECT ** random.uniform(-1, 1)) if oblong else 1.0
    concentrated = not oblong and random.random() < 0.4
    kernel: Kernel = "concentrated-force" if concentrated else "uniform-pressure"
    deepest = dense.full_contact_delta(heights, kernel, aspect) or 1.0
    delta = deepest * float(10 ** min(random.uniform(-3, 0.2), 0))
    hardness = float(np.exp(random.uniform(*np.log(HARDNESS))))
    if seed % 2:
        elastic, _ = dense.press(heights, delta, kernel, aspect)
        share = float(10 ** random.uniform(-2, 0))
        hardness = float(np.clip(share * delta * elastic.max(), *HARDNESS))
    return YieldingProblem(heights, aspect, delta, hardness, kernel)
