"""The contacts that solvers are measured on, their exact solutions, and the solvers' interface."""

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

import bem
from bem.influence import KERNELS, Kernel
from bem.operators.filters import filtered
from bem.operators.patch import displacement_filter
from bem.problem import node_spacing
from bench.references import dense, half_space
from bench.references.half_space import Field
from gen.runtime.installation import versions

EXACT_RTOL = (
    1e-14  # a hundredth of the tightest tolerance that is measured, near rounding
)
PERIODIC_RTOL = 1e-13  # of the exact solution of a periodic patch
PROVED = 1e-10  # what two convolutions of an exact solution may differ by [Delta]
# A pressure counts as the hardness within this share of it: solvers scale what they return.
YIELDED = 1 - 1e-9


@dataclass(frozen=True, eq=False)
class Case:
    """A contact on a rigid far field with E* = 1 MPa, of a free or, with a load, periodic patch."""

    name: str  # of the surface
    heights: Field  # (n, n) [um]
    side: float  # scan length [um]
    delta: float  # displacement of the far field from first touch on [um]
    kernel: Kernel = "uniform-pressure"
    hardness: float | None = (
        None  # upper bound of the pressure, None for elastic bodies [MPa]
    )
    hurst: float | None = None  # Hurst exponent of the surface, if it matters
    load: float | None = (
        None  # mean pressure on a periodic patch, which has the given Delta [MPa]
    )

    @property
    def nodes(self) -> int:
        """Nodes a side."""
        return len(self.heights)

    @property
    def spacing(self) -> float:
        """Of the nodes [um]."""
        return node_spacing(
            self.nodes, self.side, "free" if self.load is None else "periodic"
        )

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

    def yielded(self, pressure: Field) -> NDArray[np.bool_]:
        """Return which nodes of a pressure [MPa] have yielded."""
        return pressure >= YIELDED * (self.hardness or math.inf)

    @property
    def interference(self) -> Field:
        """(n, n) overlap of the undeformed bodies, negative where they are apart [Delta]."""
        overlap: Field = ((self.heights - self.heights.max()) + self.delta) / self.delta
        return overlap

    def displacement(self, pressure: Field) -> Field:
        """Return the (n, n) displacement [um] under a pressure [MPa]."""
        if self.load is None:
            shape = self.nodes, self.nodes
            operator = displacement_filter(shape, "free", self.kernel, 1.0, "float64")
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
    rtol: float  # of its solve


@lru_cache(maxsize=64)
def find_exact(case: Case) -> Exact:
    """Solve a case to rounding, and prove the solution by a convolution that is not `bem`'s.

    A pressure within its bounds, whose gap is zero under it and nowhere closed otherwise but where
    it yields, is the only solution.

    An ArithmeticError is raised if the pressure does not pass that proof.
    """
    rtol = EXACT_RTOL if case.load is None else PERIODIC_RTOL
    pressure = case.solve(rtol).pressure
    if case.load is None:
        moved = half_space.displacement(pressure, case.kernel) * case.spacing
    else:
        moved = case.displacement(pressure)
    gap = moved / case.delta - case.interference
    wrong = np.where(pressure > 0, np.abs(gap), -gap)
    if not np.where(case.yielded(pressure), gap, wrong).max() <= PROVED:
        raise ArithmeticError(f"{case.name}, {case.kernel}: no exact solution")
    force = float(pressure.sum()) * case.spacing**2
    return Exact(pressure, force, float((pressure > 0).mean()), rtol)


Control = Literal["displacement", "force"]
Item = TypeVar("Item")

MAX_ITERATIONS = (
    1000  # bound on the steps of a solver; a run that meets it counts as failed
)

# Tolerances that are tried, falling from 0.1 to 1e-12.
LADDER = tuple(10.0 ** (-half_decades / 2) for half_decades in range(2, 25))


class Failure(ArithmeticError):
    """The solver did not reach the tolerance that it was asked for."""


@dataclass(frozen=True, eq=False)
class Answer:
    """The pressure that a solver returned, and the work that it took."""

    pressure: Field  # (n, n), of contact [MPa]
    convolutions: int | None = (
        None  # applications of H, None where the solver does not say
    )
    seconds: float = math.nan  # of wall time, from heights to pressure


Press = Callable[[Case, float, float], Answer]
"""Solves a case on the grid that a solver is set up for, or raises `Failure`.

It is given the case, the force that its displacement takes [uN], not a number for solvers that need
not know it, and a tolerance in the solver's own definition.
"""


@dataclass(frozen=True)
class Solver:
    """A solver of contacts on a rigid far field."""

    name: str  # in tables: package, method and, if it has one, margin
    open: Callable[[int, float], Press]  # sets it up for (nodes a side, spacing [um])
    package: str = "asperity"  # its distribution
    install: str = ""  # how to get it; empty for our own
    control: Control = "displacement"  # the quantity that is given to it
    kernels: tuple[Kernel, ...] = ("uniform-pressure",)
    plastic: bool = False  # whether it knows a hardness
    grid: Callable[[int], int] = (
        int  # nodes a side that it runs on; the margin never touches
    )
    ladder: tuple[float, ...] = LADDER  # tolerances that are tried, falling
    largest_contact: float = math.inf  # nodes in contact beyond which it is not tried

    @property
    def version(self) -> str:
        """Version of the package, empty if it is not installed; nothing is imported for it."""
        return versions([self.package]).get(self.package, "")

    def solve(self, case: Case, rtol: float) -> Answer:
        """Solve a case to the solver's own notion of a tolerance; raise `Failure` if it cannot.

        It is set up by the first case on a grid, and kept for the further ones.
        """
        if case.kernel not in self.kernels:
            raise Failure(f"{self.name} has no kernel {case.kernel!r}")
        if case.hardness is not None and not self.plastic:
            raise Failure(f"{self.name} has no hardness")
        press = _kept(self, case.nodes, case.spacing)
        posed = case.with_margin(self.grid(case.nodes))
        given = self.control == "force"
        force = find_exact(case).force if given else math.nan
        began = time.perf_counter()
        try:
            answer = press(posed, force, rtol)
        except Exception as fault:
            if (
                isinstance(fault, Failure) or not self.install
            ):  # only others may fail in any way
                raise
            raise Failure(f"{type(fault).__name__}: {fault}") from fault
        seconds = time.perf_counter() - began
        pressure = answer.pressure[: case.nodes, : case.nodes]
        return replace(answer, pressure=pressure, seconds=seconds)


@lru_cache(maxsize=64)
def _kept(solver: Solver, nodes: int, spacing: float) -> Press:
    return solver.open(solver.grid(nodes), spacing)


def back_and_forth(items: Sequence[Item], rounds: int) -> Iterator[Item]:
    """Yield all items in every round, forth and back in turn (A B B A).

    A machine that warms up or slows down then favours none of them.
    """
    for number in range(rounds):
        yield from items if number % 2 == 0 else reversed(items)


def press_boundary_elements(case: Case, force: float, tolerance: float) -> Answer:
    """Press a case by `bem.solve`; the tolerance is the largest violation over Delta."""
    try:
        contact = case.solve(tolerance)
    except bem.NotConverged as failure:
        raise Failure(str(failure)) from None
    return Answer(contact.pressure, contact.convolutions)


def press_by_nnls(case: Case, force: float, tolerance: float) -> Answer:
    """Press a case by Bemporad and Paggi's active set, the paper's algorithm."""
    pressure = dense.press_by_nnls(
        case.heights, case.delta, kernel=case.kernel, rtol=tolerance
    )
    return Answer(pressure * (case.delta / case.spacing))


BEM = Solver("bem", lambda *_: press_boundary_elements, kernels=KERNELS, plastic=True)
PAPERS = Solver(
    "paper's NNLS",
    lambda *_: press_by_nnls,
    ladder=(1e-8,),  # the tolerance that MIRCO has built in
    largest_contact=1200.0,  # the time grows with the fourth power of this
)
