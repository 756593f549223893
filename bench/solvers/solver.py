"""The interface of all solvers that are compared, and our own two."""

import math
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal, TypeVar

import bem
from bem import influence
from bem.influence import KERNELS, Kernel
from bem.operators.patch import Patch
from bench.references import dense, half_space
from bench.references.half_space import Field
from bench.solvers.case import Case, find_exact
from gen.runtime.installation import versions

Control = Literal["displacement", "force"]
Item = TypeVar("Item")

MAX_ITERATIONS = 1000  # bound on the steps of a solver; a run that meets it counts as failed

REFERENCE_RTOL = 1e-12

# Tolerances that are tried, falling from 0.1 to 1e-12.
LADDER = tuple(10.0 ** (-half_decades / 2) for half_decades in range(2, 25))


class Failure(ArithmeticError):
    """The solver did not reach the tolerance that it was asked for."""


@dataclass(frozen=True, eq=False)
class Answer:
    """The pressure that a solver returned, and the work that it took."""

    pressure: Field  # (n, n), of contact [MPa]
    convolutions: int | None = None  # applications of H, None where the solver does not say
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
    grid: Callable[[int], int] = int  # nodes a side that it runs on; the margin never touches
    ladder: tuple[float, ...] = LADDER  # tolerances that are tried, falling
    largest_contact: float = math.inf  # nodes in contact beyond which it is not tried

    @property
    def version(self) -> str:
        """Version of the package, empty if it is not installed; nothing is imported for it."""
        return versions([self.package]).get(self.package, "")

    def set_up(self, nodes: int, spacing: float) -> Press:
        """Set the solver up for a grid, anew."""
        return self.open(self.grid(nodes), spacing)

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
        force = find_exact(case, REFERENCE_RTOL).force if given else math.nan
        began = time.perf_counter()
        try:
            answer = press(posed, force, rtol)
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
def _kept(solver: Solver, nodes: int, spacing: float) -> Press:
    return solver.set_up(nodes, spacing)


def back_and_forth(items: Sequence[Item], rounds: int) -> Iterator[Item]:
    """Yield all items in every round, forth and back in turn (A B B A).

    A machine that warms up or slows down then favours none of them.
    """
    for number in range(rounds):
        yield from items if number % 2 == 0 else reversed(items)


def boundary_elements(nodes: int, spacing: float) -> Press:
    """Open `bem.solve` as its users call it.

    The tolerance is the largest violation of complementarity over Delta. Set-up tabulates,
    transforms and plans for the whole grid; most contacts need a part of it.
    """
    influence._table.cache_clear()
    with ThreadPoolExecutor(1) as pool:  # plans belong to a thread: a new one has none
        pool.submit(Patch, (nodes, nodes), "free", "uniform-pressure", 1.0).result()
    return press_boundary_elements


def press_boundary_elements(case: Case, force: float, tolerance: float) -> Answer:
    """Press a case by `bem.solve`."""
    try:
        contact = case.solve(tolerance)
    except bem.NotConverged as failure:
        raise Failure(str(failure)) from None
    return Answer(contact.pressure, contact.convolutions)


def papers_algorithm(nodes: int, spacing: float) -> Press:
    """Open Bemporad and Paggi's active set, `press_by_nnls`."""
    half_space.influence_coefficients.cache_clear()
    half_space.influence_coefficients((nodes, nodes), "uniform-pressure")

    def press(case: Case, force: float, tolerance: float) -> Answer:
        pressure = dense.press_by_nnls(case.heights, case.delta, kernel=case.kernel, rtol=tolerance)
        return Answer(pressure * (case.delta / case.spacing))

    return press


BEM = Solver("bem", boundary_elements, kernels=KERNELS, plastic=True)
PAPERS = Solver(
    "paper's NNLS",
    papers_algorithm,
    ladder=(1e-8,),  # the tolerance that MIRCO has built in
    largest_contact=1200.0,  # the time grows with the fourth power of this
)
