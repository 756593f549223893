"""The interface of all solvers, the contacts that they solve, and exact solutions of these."""

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

import bem
from bem.bodies import KERNELS, REDUCED, Kernel
from bem.operators.displacement import displacement_filter
from bem.operators.filters import filtered
from bem.problem import Boundary, node_spacing
from bench.references import dense, half_space
from bench.references.half_space import Field
from gen.runtime.installation import versions

EXACT_RTOL = 1e-14
"""Tolerance of the exact solutions of free patches [Delta].

It is a hundredth of the tightest tolerance that is measured, and near rounding.
"""

PERIODIC_RTOL = 1e-13
"""Tolerance of the exact solutions of periodic patches [Delta]."""

PROVED = 1e-10
"""Largest violation of the conditions of contact by an exact solution [Delta].

It is the rounding by which two convolutions of one pressure may differ.
"""

YIELDED = 1 - 1e-9
"""Smallest pressure over the hardness at which a node is taken as yielded [1].

It is below 1 because solvers scale the pressure that they return, which rounds it.
"""


@dataclass(frozen=True, eq=False)
class Case:
    """A contact with E* = 1 MPa: a free patch on a rigid far field, or a periodic patch."""

    name: str  # name in tables: the surface and its load
    heights: Field  # heights of the surface, (n, n) [um]
    side: float  # scan length [um]
    delta: float  # displacement of the far field from first touch [um]
    kernel: Kernel = "uniform-pressure"
    hardness: float | None = None  # bound of the pressure [MPa]; None for elastic bodies
    hurst: float | None = None  # Hurst exponent [1]; None if no table has it
    # Mean pressure on a periodic patch, whose displacement is `delta` [MPa]; None for a free patch.
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

    @property
    def known_force(self) -> float | None:
        """Force that follows from `load` [uN]; None for a free patch, whose force is an answer."""
        if self.load is None:
            return None
        return self.load * self.spacing**2 * self.heights.size

    def mean_pressure(self, force: float) -> float:
        """Return the mean pressure over all cells under a force.

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
        """Return the case on a larger grid, with a margin of new nodes that do not touch.

        The new nodes follow the others along both axes. They are two Delta below the highest node.

        Parameters
        ----------
        nodes : int
            Nodes a side, at least as many as the case has.

        Returns
        -------
        Case
            The case with this number of nodes a side, at its own spacing.
        """
        if nodes == self.nodes:
            return self
        below = self.heights.max() - 2 * self.delta
        heights = np.full((nodes, nodes), below)
        heights[: self.nodes, : self.nodes] = self.heights
        return replace(self, heights=heights, side=self.spacing * (nodes - 1))

    def yielded(self, pressure: Field) -> NDArray[np.bool_]:
        """Return which nodes have yielded under a pressure.

        Parameters
        ----------
        pressure : ndarray, shape (n, n)
            Contact pressure [MPa].

        Returns
        -------
        ndarray of bool, shape (n, n)
            Whether the pressure is at least `YIELDED` times the hardness; False everywhere for
            elastic bodies.
        """
        return pressure >= YIELDED * (self.hardness or math.inf)

    @property
    def interference(self) -> Field:
        """Overlap of the undeformed bodies, negative where they are apart, (n, n) [Delta]."""
        below = self.heights - self.heights.max()
        overlap: Field = (below + self.delta) / self.delta
        return overlap

    def displacement(self, pressure: Field) -> Field:
        """Compute the displacement under a pressure.

        Parameters
        ----------
        pressure : ndarray, shape (n, n)
            Contact pressure [MPa].

        Returns
        -------
        ndarray, shape (n, n)
            Displacement [um]. On a periodic patch its mean is 0.
        """
        if self.load is None:
            shape = (self.nodes, self.nodes)
            operator = displacement_filter(
                shape, "free", REDUCED[self.kernel], 1.0, "float64"
            )
            return filtered(operator, pressure) * self.spacing
        along = np.fft.fftfreq(self.nodes, self.spacing)
        across = np.abs(along[: self.nodes // 2 + 1])
        orders = np.hypot.outer(along, across)
        orders[0, 0] = np.inf  # so that the mean is 0
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
            The contact, at `delta` or, on a periodic patch, under `load`.

        Raises
        ------
        bem.NotConverged
            If the solver does not reach the tolerance.
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
    """The solution of a case, exact to rounding, with which answers are compared."""

    pressure: Field  # contact pressure, (n, n) [MPa]
    force: float  # normal force [uN]
    contact_share: float  # share of the nodes under pressure [1]
    rtol: float  # tolerance of the solve [Delta]


@lru_cache(maxsize=64)
def find_exact(case: Case) -> Exact:
    """Solve a case to rounding, and prove the solution by a convolution that is not `bem`'s.

    The proof is that the pressure is within its bounds, and the gap is 0 under pressure and not
    negative elsewhere; yielded nodes may penetrate. Only the exact solution fulfils this. A second
    call for a case returns the first result.

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
        If the gap violates these conditions by more than `PROVED`.
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
    return Exact(pressure=pressure, force=force, contact_share=contact_share, rtol=rtol)


Control = Literal["displacement", "force"]
"""The quantity that a solver is given."""

Item = TypeVar("Item")
"""Type of the items of `back_and_forth`."""

MAX_ITERATIONS = 1000
"""Largest number of steps of a solver; a solve that needs more has failed."""

LADDER = tuple(10.0 ** (-half_decades / 2) for half_decades in range(2, 25))
"""Tolerances that are tried, falling from 0.1 to 1e-12 by half decades [1]."""


class Failure(ArithmeticError):
    """A solver cannot solve a case, or did not reach the tolerance."""


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

Its arguments are the case, the exact force [uN], and a tolerance as the solver defines it. The
force is NaN if the solver is given the displacement of the case. The result is an `Answer`.
"""


@dataclass(frozen=True)
class Solver:
    """A solver of contacts, of which nothing is imported or set up before the first solve."""

    name: str  # name in tables: package, method and whether it has a margin
    # Takes nodes a side and their spacing [um]; sets the solver up for this grid.
    open: Callable[[int, float], Press]
    package: str = "asperity"  # name of its distribution
    install: str = ""  # how to install the package; empty for our own solvers
    control: Control = "displacement"  # the quantity that it is given
    kernels: tuple[Kernel, ...] = ("uniform-pressure",)  # kernels that it has
    plastic: bool = False  # whether it solves contacts of bodies that yield
    # Takes the nodes a side of a case; returns those of the solver's grid. More nodes are a margin.
    grid: Callable[[int], int] = int
    ladder: tuple[float, ...] = LADDER  # tolerances that are tried, falling
    # Largest number of nodes in contact with which it is tried.
    largest_contact: float = math.inf

    @property
    def version(self) -> str:
        """Version of the package, empty if it is not installed. The package is not imported."""
        return versions([self.package]).get(self.package, "")

    def solve(self, case: Case, rtol: float) -> Answer:
        """Solve a case.

        The first case on a grid sets the solver up, outside of the time. Further cases on the grid
        use this set-up.

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
            of a solve by another program is a Failure too.
        ArithmeticError
            If the solver is given the force, and the exact solution that has it is not found.
        """
        if case.kernel not in self.kernels:
            raise Failure(f"{self.name} has no kernel {case.kernel!r}")
        if case.hardness is not None and not self.plastic:
            raise Failure(f"{self.name} has no hardness")
        press = _set_up(self, case.nodes, case.spacing)
        on_its_grid = case.with_margin(self.grid(case.nodes))
        force = math.nan
        if self.control == "force":
            force = case.known_force or find_exact(case).force
        began = time.perf_counter()
        try:
            answer = press(on_its_grid, force, rtol)
        except Failure:
            raise
        except Exception as fault:
            if not self.install:  # an error of our own code is a bug
                raise
            raise Failure(f"{type(fault).__name__}: {fault}") from fault
        seconds = time.perf_counter() - began
        pressure = answer.pressure[: case.nodes, : case.nodes]  # without the margin
        return replace(answer, pressure=pressure, seconds=seconds)


@lru_cache(maxsize=64)
def _set_up(solver: Solver, nodes: int, spacing: float) -> Press:
    """Set a solver up for cases of `nodes` nodes a side at a spacing [um]; once for each grid."""
    return solver.open(solver.grid(nodes), spacing)


def back_and_forth(items: Sequence[Item], rounds: int) -> Iterator[Item]:
    """Yield all items in every round, in every second round in the reverse order (A B B A).

    No item then has an advantage on a machine that becomes slower or faster.

    Parameters
    ----------
    items : sequence
        The items.
    rounds : int
        Number of rounds.

    Yields
    ------
    object
        One of the items; each is yielded `rounds` times.
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
        Not used: the case states its load.
    tolerance : float
        Largest violation of the conditions of contact [Delta].

    Returns
    -------
    Answer
        The pressure and the number of convolutions.

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
        Not used: the case states its load.
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
"""Our solver, `bem.solve`, which needs no set-up."""

PAPERS = Solver(
    "paper's NNLS",
    lambda *_: press_by_nnls,
    ladder=(1e-8,),  # the tolerance that MIRCO has built in
    largest_contact=1200.0,  # the time grows with the fourth power of this
)
"""The paper's algorithm, which needs no set-up."""
