"""The contacts that solvers are measured on, and their exact solutions."""

import math
from dataclasses import dataclass, replace
from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray

import bem
from bem.influence import Kernel
from bem.operators.filters import filtered
from bem.operators.patch import displacement_filter
from bem.problem import node_spacing
from bench.references import dense, half_space
from bench.references.dense import influence_matrix
from bench.references.half_space import Field

Nodes = NDArray[np.bool_]

# Contacts of this many nodes at most are solved by Cholesky's factors: the memory grows with the
# square of their number, the time with its cube.
DENSE_NODES = 3000
# Where that is too much: a hundredth of the tightest tolerance that is measured, near rounding.
EXACT_RTOL = 1e-14
PERIODIC_RTOL = 1e-13  # of the exact solution of a periodic patch, which is never dense
# Nodes outside of an exact contact may overlap by this, over Delta [1].
ROUNDING = 1e-13
# A pressure counts as the hardness within this share of it: solvers scale what they return.
YIELDED = 1 - 1e-9
# Nodes are added so often to a guess of the nodes that touch before it is refused.
CORRECTIONS = 20


@dataclass(frozen=True, eq=False)
class Case:
    """A contact on a rigid far field with E* = 1 MPa, of a free or, with a load, periodic patch."""

    name: str  # of the surface
    heights: Field  # (n, n) [um]
    side: float  # scan length [um]
    delta: float  # displacement of the far field from first touch on [um]
    kernel: Kernel = "uniform-pressure"
    hardness: float | None = None  # upper bound of the pressure, None for elastic bodies [MPa]
    hurst: float | None = None  # Hurst exponent of the surface, if it matters
    load: float | None = None  # mean pressure on a periodic patch, which has the given Delta [MPa]

    @property
    def nodes(self) -> int:
        """Nodes a side."""
        return len(self.heights)

    @property
    def spacing(self) -> float:
        """Of the nodes [um]."""
        return node_spacing(self.nodes, self.side, "free" if self.load is None else "periodic")

    def mean_pressure(self, force: float) -> float:
        """Return a force over the area of all cells [MPa]."""
        return force / (self.spacing**2 * self.heights.size)

    def with_margin(self, nodes: int) -> "Case":
        """Put the case on a grid of as many nodes a side or more.

        The margin lies two Delta below the highest node, so that it changes nothing but the grid.
        """
        if nodes == self.nodes:
            return self
        heights = np.full((nodes, nodes), self.heights.max() - 2 * self.delta)
        heights[: self.nodes, : self.nodes] = self.heights
        return replace(self, heights=heights, side=self.spacing * (nodes - 1))

    @property
    def reduced_hardness(self) -> float:
        """Hardness in the unit of reduced pressures [E* Delta / spacing]."""
        return math.inf if self.hardness is None else self.hardness * self.spacing / self.delta

    def yielded(self, pressure: Field) -> Nodes:
        """Return which nodes of a pressure [MPa] have yielded."""
        return pressure >= YIELDED * self.reduced_hardness * (self.delta / self.spacing)

    @property
    def interference(self) -> Field:
        """(n, n) overlap of the undeformed bodies, negative where they are apart [Delta]."""
        overlap: Field = ((self.heights - self.heights.max()) + self.delta) / self.delta
        return overlap

    def displacement(self, pressure: Field) -> Field:
        """Return the (n, n) displacement [um] under a pressure [MPa]."""
        if self.load is None:
            shape = self.nodes, self.nodes
            operator = displacement_filter(shape, "free", self.kernel, 1.0)
            return filtered(operator, pressure) * self.spacing
        along = np.fft.fftfreq(self.nodes, self.spacing)
        orders = np.hypot.outer(along, np.abs(along[: self.nodes // 2 + 1]))
        orders[0, 0] = np.inf  # of zero mean
        waves = np.fft.rfft2(pressure) / (np.pi * orders)
        return np.asarray(np.fft.irfft2(waves, s=pressure.shape))

    def solve(self, rtol: float) -> bem.Contact:
        """Solve it by `bem.solve`."""
        solve = partial(bem.solve, self.heights, self.side, rtol=rtol)
        if self.load is not None:
            return solve(pressure=self.load, boundary="periodic")
        return solve(self.delta, kernel=self.kernel, hardness=self.hardness)


@dataclass(frozen=True, eq=False)
class Exact:
    """The solution that answers are held against."""

    pressure: Field  # (n, n) [MPa]
    force: float  # [uN]
    contact_share: float  # of the nodes under pressure
    method: str  # "dense", or the tolerance


@lru_cache(maxsize=64)
def find_exact(case: Case, rtol: float = EXACT_RTOL) -> Exact:
    """Solve a case to rounding: by the dense matrix of the nodes in contact where they are few.

    Where they are many, `bem.solve` serves at the given tolerance. The dense solution shares no
    code with `bem` but the guess which nodes are in contact, and that guess is proved by the
    pressure's and the gap's signs.

    Raises
    ------
    ArithmeticError
        If the dense solution does not pass that proof.
    """
    rtol = rtol if case.load is None else min(rtol, PERIODIC_RTOL)
    pressure, method = case.solve(rtol).pressure, f"rtol {rtol:.0e}"
    if case.load is None and np.count_nonzero(pressure) <= DENSE_NODES:
        # A node may carry hardly anything: only the tightest guess is sure to know of it.
        guess = pressure if rtol <= EXACT_RTOL else case.solve(EXACT_RTOL).pressure
        reduced = proved_pressure(case, guess > 0, case.yielded(guess))
        pressure, method = reduced * (case.delta / case.spacing), "dense"
    return Exact(
        pressure=pressure,
        force=float(pressure.sum()) * case.spacing**2,
        contact_share=float((pressure > 0).mean()),
        method=method,
    )


def proved_pressure(case: Case, touching: Nodes, yielded: Nodes) -> Field:
    """Return the (n, n) pressure that is proved to solve a case [E* Delta / spacing].

    A guess of the nodes that touch, and of those that have yielded, is solved and corrected by
    `dense.solve`; nodes outside of it that would overlap are added.
    """
    shape, hardness = (case.nodes, case.nodes), case.reduced_hardness
    pressure = np.zeros(shape)
    for _ in range(CORRECTIONS):
        nodes = np.flatnonzero(touching)
        matrix = influence_matrix(shape, case.kernel, nodes=nodes)
        sides = np.where(yielded[touching], 1, 0)
        pressure[touching] = dense.solve(matrix, case.interference[touching], sides, hardness)
        gap = half_space.displacement(pressure, case.kernel) - case.interference
        overlapping = ~touching & (gap < -ROUNDING)
        if not overlapping.any():
            return pressure
        yielded = pressure >= hardness
        touching = touching | overlapping
    raise ArithmeticError(f"{case.name}, {case.kernel}: no exact solution")
