"""What a solver has to offer to be compared, whoever wrote it."""

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from importlib import metadata
from typing import Literal, Protocol, TypeVar

from bem.influence import Kernel
from bench.solvers.case import Case, Field, find_exact

Control = Literal["displacement", "force"]
Item = TypeVar("Item")

MAX_ITERATIONS = 1000
"""Bound on the steps of a solver; a run that meets it counts as failed."""

REFERENCE_RTOL = 1e-12

LADDER = tuple(10.0 ** (-half_decades / 2) for half_decades in range(2, 25))
"""Tolerances that are tried, falling from 0.1 to 1e-12."""


class Failure(ArithmeticError):
    """The solver did not reach the tolerance that it was asked for."""


@dataclass(frozen=True, eq=False)
class Answer:
    """The pressure that a solver returned, and the work that it took.

    Attributes
    ----------
    pressure : ndarray, shape (n, n)
        Contact pressure [MPa].
    iterations, convolutions : int or None
        Steps, and applications of H; None where the solver does not say.
    seconds : float
        Wall time of the solve, from heights to pressure [s].
    """

    pressure: Field
    iterations: int | None = None
    convolutions: int | None = None
    seconds: float = math.nan


class Session(Protocol):
    """A solver that is set up for a grid of square cells."""

    def press(self, case: Case, force: float, tolerance: float) -> Answer:
        """Solve a case on this grid; raise `Failure` if that is not possible.

        Parameters
        ----------
        case : Case
            Surface and displacement, with E* = 1 MPa.
        force : float
            Force that the displacement takes, not a number for solvers that need not know it [uN].
        tolerance : float
            In the solver's own definition.
        """


def same_grid(nodes: int) -> int:
    """Return the number of nodes unchanged: no margin."""
    return nodes


@dataclass(frozen=True)
class Solver:
    """A solver of contacts on a rigid far field.

    Attributes
    ----------
    name : str
        Package, method and, if it has one, margin: the name in tables.
    open_session : callable
        Sets the solver up for (nodes a side, spacing [um]).
    package : str
        Name of its distribution.
    install : str
        How to get it; empty for our own.
    control : {"displacement", "force"}
        The quantity that is given to it.
    precision : {"float64", "mixed"}
        Precision of the numbers that it iterates with.
    kernels : tuple of str
        Influence coefficients that it knows.
    plastic : bool
        Whether it knows a hardness.
    grid : callable
        Maps the nodes a side of the surface to those of the grid that the solver runs on; the
        margin beyond the surface never touches.
    ladder : tuple of float
        Tolerances that are tried, falling.
    largest_contact : float
        Nodes in contact beyond which it is not tried.
    """

    name: str
    open_session: Callable[[int, float], Session]
    package: str = "asperity"
    install: str = ""
    control: Control = "displacement"
    precision: str = "float64"
    kernels: tuple[Kernel, ...] = ("uniform-pressure",)
    plastic: bool = False
    grid: Callable[[int], int] = same_grid
    ladder: tuple[float, ...] = LADDER
    largest_contact: float = math.inf

    @property
    def version(self) -> str:
        """Version of the package, empty if it is not installed; nothing is imported for it."""
        try:
            return metadata.version(self.package)
        except metadata.PackageNotFoundError:
            return ""

    def set_up(self, nodes: int, spacing: float) -> Session:
        """Set the solver up for a grid, anew."""
        return self.open_session(self.grid(nodes), spacing)

    def solve(self, case: Case, rtol: float) -> Answer:
        """Solve a case to the solver's own notion of a tolerance; raise `Failure` if it cannot.

        The session that serves all cases on a grid is opened by the first of them and kept.
        """
        if case.kernel not in self.kernels:
            raise Failure(f"{self.name} has no kernel {case.kernel!r}")
        if case.hardness is not None and not self.plastic:
            raise Failure(f"{self.name} has no hardness")
        session = _kept_session(self, case.nodes, case.spacing)
        posed = case.with_margin(self.grid(case.nodes))
        given = self.control == "force"
        force = find_exact(case, REFERENCE_RTOL).force if given else math.nan
        began = time.perf_counter()
        try:
            answer = session.press(posed, force, rtol)
        except Failure:
            raise
        except Exception as fault:
            if not self.install:  # only other people's code may fail in any way
                raise
            raise Failure(f"{type(fault).__name__}: {fault}") from fault
        seconds = time.perf_counter() - began
        pressure = answer.pressure[: case.nodes, : case.nodes]
        return replace(answer, pressure=pressure, seconds=seconds)


@lru_cache(maxsize=64)
def _kept_session(solver: Solver, nodes: int, spacing: float) -> Session:
    return solver.set_up(nodes, spacing)


def back_and_forth(items: Sequence[Item], rounds: int) -> Iterator[Item]:
    """Yield all items in every round, forth and back in turn (A B B A).

    A machine that warms up or slows down then favours none of them.
    """
    for number in range(rounds):
        yield from items if number % 2 == 0 else reversed(items)
