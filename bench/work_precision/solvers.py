"""The solvers that are measured: `bem.solve`, and its active set in two precisions."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

import bem
from bem.active_set import solve_complementarity
from bem.half_space import HalfSpace
from bem.influence import Kernel
from bem.iterate import Operators
from bench.work_precision.case import Case, Field

Nodes = NDArray[np.intp]

MAX_ITERATIONS = 1000


class Failure(ArithmeticError):
    """The solver did not reach the tolerance that it was asked for."""


@dataclass(frozen=True, eq=False)
class Answer:
    """What a solver returned, and what it took.

    Attributes
    ----------
    pressure : (n, n) contact pressure [MPa]
    seconds : wall time, from heights to pressure [s]
    iterations, convolutions : steps, and applications of H; None where the solver does not say
    """

    pressure: Field
    seconds: float
    iterations: int | None
    convolutions: int | None


class Solver(Protocol):
    """What can be measured."""

    @property
    def name(self) -> str:
        """Of the solver."""

    @property
    def precision(self) -> str:
        """Of the numbers that it iterates with: "mixed" or "float64"."""

    @property
    def control(self) -> str:
        """What is given to it, displacement of the far field or force: "displacement", "force"."""

    def solve(self, case: Case, rtol: float) -> Answer:
        """Solve a case to the solver's own notion of a tolerance; raise `Failure` if it cannot."""


@dataclass(frozen=True)
class BoundaryElements:
    """The solver of `bem` as its users call it."""

    name: str = "bem"
    precision: str = "mixed"
    control: str = "displacement"

    def solve(self, case: Case, rtol: float) -> Answer:
        """By `bem.solve`; rtol is the largest violation of complementarity, over Delta."""
        began = time.perf_counter()
        try:
            contact = bem.solve(case.heights, case.side, case.delta, kernel=case.kernel, rtol=rtol)
        except bem.NotConverged as failure:
            raise Failure(str(failure)) from None
        seconds = time.perf_counter() - began
        return Answer(contact.pressure, seconds, contact.iterations, contact.convolutions)


@dataclass(frozen=True)
class ActiveSet:
    """The solver's iteration with operators of one's choice, on every node that overlaps.

    Apart from the operators there is no difference between two of these: no cropping of the grid,
    and no dense algebra where few nodes may touch or are in contact.
    """

    precision: str
    operators: Callable[[tuple[int, int], Kernel, float, Nodes], Operators]
    name: str = "active set"
    control: str = "displacement"

    def solve(self, case: Case, rtol: float) -> Answer:
        """By `bem.active_set.solve_complementarity`; rtol as for `bem.solve`."""
        began = time.perf_counter()
        interference = case.interference
        nodes = np.flatnonzero(interference > 0)
        iterate, converged = solve_complementarity(
            self.operators(interference.shape, case.kernel, 1.0, nodes),
            interference.reshape(-1)[nodes],
            rtol=rtol,
            max_iterations=MAX_ITERATIONS,
        )
        pressure = np.zeros(interference.size)
        pressure[nodes] = iterate.pressure * (case.delta / case.spacing)
        seconds = time.perf_counter() - began
        if not converged:
            raise Failure(f"residual {iterate.violation():.1e} where {rtol:.0e} was asked for")
        fields = pressure.reshape(interference.shape)
        return Answer(fields, seconds, iterate.iterations, iterate.convolutions)


MIXED = ActiveSet("mixed", partial(HalfSpace, few_per_root=0.0))
DOUBLE = ActiveSet("float64", partial(HalfSpace, working="float64", few_per_root=0.0))
