"""Contacts that solvers are measured on, their exact solutions, and the interface of a solver."""

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

import bem
from bem.influence import KERNELS, Kernel
from bem.operators.filters import filtered
from bem.operators.patch import displacement_filter
from bem.problem import Boundary, node_spacing
from bench.references import dense, half_space
from bench.references.half_space import Field
from gen.runtime.installation import versions

EXACT_RTOL = 1e-14
"""Tolerance of exact solutions [Delta]: a hundredth of the tightest measured one, near rounding."""

PERIODIC_RTOL = 1e-13
"""Tolerance of the exact solutions of periodic patches [Delta]."""

PROVED = 1e-10
"""Largest violation of the conditions of contact by an exact solution [Delta].

Two convolutions of one pressure may differ by as much.
"""

YIELDED = 1 - 1e-9
"""Share of the hardness from which a pressure counts as the hardness [1].

Solvers scale the pressure that they return, which rounds it.
"""


@dataclass(frozen=True, eq=False)
class Case:
    """A contact on a rigid far field with E* = 1 MPa, of a free patch or of a periodic one."""

    name: str  # name in tables: the surface and its load
    heights: Field  # heights of the surface, (n, n) [um]
    side: float  # scan length [um]
    delta: float  # displacement of the far field from first touch [um]
    kernel: Kernel = "uniform-pressure"
    hardness: float | None = None  # bound of the pressure [MPa]; None for elastic bodies
    hurst: float | None = None  # Hurst exponent [1]; None if no table has it
    # Mean pressure on a periodic patch, which takes the displacement `delta` [MPa]; None for a
    # free patch.
    load: float | None = None

    @property
    def nodes(self) -> int:
        """Nodes a side."""
        return len(self.heights)

    @property
    def spacing(self) -> float:
        """Spacing of the nodes [um]."""
        boundary: Boundary = "free" if self.load is None else "periodic"
        return node_spacing(self.nodes, self.side, boundary)

    def mean_pressure(self, force: float) -> float:
        """Return the mean pressure over all cells.

        Parameters
        ----------
        force : float
            Normal force [uN].

        Returns
        -------
        float
            Mean pressure [MPa].
        """
        return force / (self.spacing**2 * self.heights.size)

    def with_margin(self, nodes: int) -> "Case":
        """Put the case on a larger grid, of which only the margin is new.

        The margin is two Delta below the highest node, so that it never touches.

        Parameters
        ----------
        nodes : int
            Nodes a side, at least as many as the case has.

        Returns
        -------
        Case
            The case on the larger grid, with equal spacing.
        """
        if nodes == self.nodes:
            return self
        below = self.heights.max() - 2 * self.delta
        heights = np.full((nodes, nodes), below)
        heights[: self.nodes, : self.nodes] = self.heights
        return replace(self, heights=heights, side=self.spacing * (nodes - 1))

    def yielded(self, pressure: Field) -> NDArray[np.bool_]:
        """Return which nodes have yielded.

        Parameters
        ----------
        pressure : ndarray, shape (n, n)
            Contact pressure [MPa].

        Returns
        -------
        ndarray of bool, shape (n, n)
            Whether the pressure is the hardness; False everywhere for elastic bodies.
        """
        return pressure >= YIELDED * (self.hardness or math.inf)

    @property
    def interference(self) -> Field:
        """Overlap of the undeformed bodies, negative where they are apart, (n, n) [Delta]."""
        below = self.heights - self.heights.max()
        overlap: Field = (below + self.delta) / self.delta
        return overlap

    def displacement(self, pressure: Field) -> Field:
        """Compute the displacement under a pressure; of zero mean on a periodic patch.

        Parameters
        ----------
        pressure : ndarray, shape (n, n)
            Contact pressure [MPa].

        Returns
        -------
        ndarray, shape (n, n)
            Displacement [um].
        """
        if self.load is None:
            shape = (self.nodes, self.nodes)
            operator = displacement_filter(shape, "free", self.kernel, 1.0, "float64")
            return filtered(operator, pressure) * self.spacing
        along = np.fft.fftfreq(self.nodes, self.spacing)
        across = np.abs(along[: self.nodes // 2 + 1])
        orders = np.hypot.outer(along, across)
        orders[0, 0] = np.inf  # which makes the mean zero
        waves = np.fft.rfft2(pressure) / (np.pi * orders)
        return np.asarray(np.fft.irfft2(waves, s=pressure.shape))

    def solve(self, rtol: float) -> bem.Contact:
        """Solve the case by `bem.solve`.

        Parameters
        ----------
        rtol : float
            Tolerance [Delta].

        Returns
        -------
        bem.Contact
            The contact.
        """
        if self.load is not None:
            return bem.solve(
                self.heights,
                self.side,
                pressure=self.load,
                boundary="periodic",
                rtol=rtol,
            )
        return bem.solve(
            self.heights,
            self.side,
            self.delta,
            kernel=self.kernel,
            hardness=self.hardness,
            rtol=rtol,
        )


@dataclass(frozen=True, eq=False)
class Exact:
    """The exact solution of a case, with which answers are compared."""

    pressure: Field  # contact pressure, (n, n) [MPa]
    force: float  # normal force [uN]
    contact_share: float  # share of the nodes under pressure [1]
    rtol: float  # tolerance of the solve [Delta]


@lru_cache(maxsize=64)
def find_exact(case: Case) -> Exact:
    """Solve a case to rounding, and prove the solution by a convolution that is not `bem`'s.

    The solution is the only pressure within its bounds whose gap is zero under pressure and not
    negative elsewhere; yielded nodes may penetrate. A case is solved once.

    Parameters
    ----------
    case : Case
        The case.

    Returns
    -------
    Exact
        The solution.

    Raises
    ------
    ArithmeticError
        If the pressure violates these conditions by more than `PROVED`.
    """
    if case.load is None:
        rtol = EXACT_RTOL
        pressure = case.solve(rtol).pressure
        moved = half_space.displacement(pressure, case.kernel) * case.spacing
    else:
        rtol = PERIODIC_RTOL
        pressure = case.solve(rtol).pressure
        moved = case.displacement(pressure)
    gap = moved / case.delta - case.interference
    elastic = np.where(pressure > 0, np.abs(gap), -gap)
    violations = np.where(case.yielded(pressure), gap, elastic)
    if not violations.max() <= PROVED:  # also if it is NaN
        raise ArithmeticError(f"{case.name}, {case.kernel}: no exact solution")
    force = float(pressure.sum()) * case.spacing**2
    contact_share = float((pressure > 0).mean())
    return Exact(pressure, force, contact_share, rtol)


Control = Literal["displacement", "force"]
"""The quantity that a solver is given."""

Item = TypeVar("Item")
"""Type of the items of `back_and_forth`."""

MAX_ITERATIONS = 1000
"""Most steps of a solver; a run that takes them all counts as failed."""

LADDER = tuple(10.0 ** (-half_decades / 2) for half_decades in range(2, 25))
"""Tolerances that are tried, falling from 0.1 to 1e-12 by half decades [1]."""


class Failure(ArithmeticError):
    """The solver did not reach the requested tolerance."""


@dataclass(frozen=True, eq=False)
class Answer:
    """The pressure that a solver returned, and the work that it took."""

    pressure: Field  # contact pressure, (n, n) [MPa]
    # Number of applications of the influence matrix; None if the solver does not count them.
    convolutions: int | None = None
    # Wall time of the solve, without the set-up of its grid [s].
    seconds: float = math.nan


Press = Callable[[Case, float, float], Answer]
"""A function that solves a case on the grid that a solver is set up for, or raises `Failure`.

Its arguments are the case, its exact force [uN], and a tolerance as the solver defines it. The
force is NaN for solvers that control the displacement.
"""


@dataclass(frozen=True)
class Solver:
    """A solver of contacts on a rigid far field."""

    name: str  # name in tables: package, method and whether it has a margin
    # Sets the solver up for nodes a side and their spacing [um].
    open: Callable[[int, float], Press]
    package: str = "asperity"  # name of its distribution
    install: str = ""  # command that installs it; empty for our own solvers
    control: Control = "displacement"
    kernels: tuple[Kernel, ...] = ("uniform-pressure",)  # kernels that it has
    plastic: bool = False  # whether it knows a hardness
    # Returns the nodes a side of its grid for the nodes a side of a case; the rest is a margin.
    grid: Callable[[int], int] = int
    ladder: tuple[float, ...] = LADDER  # tolerances that are tried, falling
    largest_contact: float = math.inf  # most nodes in contact with which it is tried

    @property
    def version(self) -> str:
        """Version of the package, empty if it is not installed; the package is not imported."""
        return versions([self.package]).get(self.package, "")

    def solve(self, case: Case, rtol: float) -> Answer:
        """Solve a case. The first case on a grid sets the solver up, which is kept.

        Parameters
        ----------
        case : Case
            The case.
        rtol : float
            Tolerance as the solver defines it.

        Returns
        -------
        Answer
            The pressure on the nodes of the case, with its work and time.

        Raises
        ------
        Failure
            If the solver lacks the kernel or a hardness, or does not reach the tolerance. Any error
            of another program is a failure.
        """
        if case.kernel not in self.kernels:
            raise Failure(f"{self.name} has no kernel {case.kernel!r}")
        if case.hardness is not None and not self.plastic:
            raise Failure(f"{self.name} has no hardness")
        press = _set_up(self, case.nodes, case.spacing)
        with_margin = case.with_margin(self.grid(case.nodes))
        force = math.nan
        if self.control == "force":
            force = find_exact(case).force
        began = time.perf_counter()
        try:
            answer = press(with_margin, force, rtol)
        except Failure:
            raise
        except Exception as fault:
            if not self.install:  # an error of our own code is a bug
                raise
            raise Failure(f"{type(fault).__name__}: {fault}") from fault
        seconds = time.perf_counter() - began
        pressure = answer.pressure[: case.nodes, : case.nodes]
        return replace(answer, pressure=pressure, seconds=seconds)


@lru_cache(maxsize=64)
def _set_up(solver: Solver, nodes: int, spacing: float) -> Press:
    """Set a solver up for a grid of cases, of nodes a side and their spacing [um]; done once."""
    return solver.open(solver.grid(nodes), spacing)


def back_and_forth(items: Sequence[Item], rounds: int) -> Iterator[Item]:
    """Yield all items in every round, in their order and in the reverse order by turns (A B B A).

    A machine that warms up or slows down then favours none of them.

    Parameters
    ----------
    items : sequence
        The items.
    rounds : int
        Number of rounds.

    Yields
    ------
    object
        An item.
    """
    for number in range(rounds):
        yield from items if number % 2 == 0 else reversed(items)


def press_boundary_elements(case: Case, force: float, tolerance: float) -> Answer:
    """Solve a case by `bem.solve`.

    Parameters
    ----------
    case : Case
        The case.
    force : float
        Not used.
    tolerance : float
        Largest violation of the conditions of contact [Delta].

    Returns
    -------
    Answer
        The pressure, with the number of convolutions.

    Raises
    ------
    Failure
        If the solve does not converge.
    """
    try:
        contact = case.solve(tolerance)
    except bem.NotConverged as failure:
        raise Failure(str(failure)) from None
    return Answer(contact.pressure, contact.convolutions)


def press_by_nnls(case: Case, force: float, tolerance: float) -> Answer:
    """Solve a case by the paper's algorithm, Bemporad and Paggi's active set.

    Parameters
    ----------
    case : Case
        The case.
    force : float
        Not used.
    tolerance : float
        Largest penetration [Delta].

    Returns
    -------
    Answer
        The pressure.
    """
    pressure = dense.press_by_nnls(
        case.heights, case.delta, kernel=case.kernel, rtol=tolerance
    )
    return Answer(pressure * (case.delta / case.spacing))


BEM = Solver("bem", lambda *_: press_boundary_elements, kernels=KERNELS, plastic=True)
"""Our solver."""

PAPERS = Solver(
    "paper's NNLS",
    lambda *_: press_by_nnls,
    ladder=(1e-8,),  # the tolerance that MIRCO has built in
    largest_contact=1200.0,  # the time grows with the fourth power of this
)
"""The paper's algorithm."""
