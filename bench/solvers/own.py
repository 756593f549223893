"""Our own solvers: `bem.solve`, its active set in two precisions, and the paper's algorithm."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np
from numpy.typing import NDArray

import bem
from bem import influence
from bem.active_set import solve_complementarity
from bem.half_space import HalfSpace
from bem.influence import KERNELS, Kernel
from bem.iterate import Operators
from bench.references import half_space, nnls
from bench.solvers.case import Case
from bench.solvers.solver import MAX_ITERATIONS, Answer, Failure, Solver

Nodes = NDArray[np.intp]


class BoundaryElements:
    """`bem.solve` as its users call it.

    The tolerance is the largest violation of complementarity over Delta. Set-up tabulates,
    transforms and plans for the whole grid; most contacts need a part of it.
    """

    def __init__(self, nodes: int, spacing: float) -> None:
        influence._table.cache_clear()
        shape, everywhere = (nodes, nodes), np.arange(nodes * nodes)
        with ThreadPoolExecutor(1) as pool:  # plans belong to a thread: a new one has none
            pool.submit(HalfSpace, shape, "uniform-pressure", 1.0, everywhere).result()

    def press(self, case: Case, force: float, tolerance: float) -> Answer:
        """Solve for a displacement."""
        try:
            contact = bem.solve(
                case.heights,
                case.side,
                case.delta,
                kernel=case.kernel,
                rtol=tolerance,
                hardness=case.hardness,
            )
        except bem.NotConverged as failure:
            raise Failure(str(failure)) from None
        return Answer(contact.pressure, contact.iterations, contact.convolutions)


class ActiveSet:
    """The iteration of `bem` with operators of one's choice, on every node that overlaps.

    Apart from the operators there is no difference between two of these: no cropping of the grid,
    and no dense algebra where few nodes may touch or are in contact.
    """

    def __init__(
        self,
        nodes: int,
        spacing: float,
        operators: Callable[[tuple[int, int], Kernel, float, Nodes], Operators],
    ) -> None:
        self._operators = operators

    def press(self, case: Case, force: float, tolerance: float) -> Answer:
        """Solve for a displacement; the tolerance is that of `bem.solve`."""
        interference = case.interference
        nodes = np.flatnonzero(interference > 0)
        iterate, converged = solve_complementarity(
            self._operators(interference.shape, case.kernel, 1.0, nodes),
            interference.reshape(-1)[nodes],
            rtol=tolerance,
            max_iterations=MAX_ITERATIONS,
        )
        if not converged:
            raise Failure(f"residual {iterate.violation():.1e} where {tolerance:.0e} was asked for")
        pressure = np.zeros(interference.size)
        pressure[nodes] = iterate.pressure * (case.delta / case.spacing)
        return Answer(
            pressure.reshape(interference.shape),
            iterate.effort.iterations,
            iterate.effort.convolutions,
        )


class PapersAlgorithm:
    """Bemporad and Paggi's active set, `nnls`; its iterations are dense solves."""

    def __init__(self, nodes: int, spacing: float) -> None:
        half_space.influence_coefficients.cache_clear()
        half_space.influence_coefficients((nodes, nodes), "uniform-pressure")

    def press(self, case: Case, force: float, tolerance: float) -> Answer:
        """Solve for a displacement."""
        pressure, solves = nnls.press(case.heights, case.delta, kernel=case.kernel, rtol=tolerance)
        return Answer(pressure * (case.delta / case.spacing), solves)


BEM = Solver("bem", BoundaryElements, precision="mixed", kernels=KERNELS, plastic=True)
PAPERS = Solver(
    "paper's NNLS",
    PapersAlgorithm,
    ladder=(1e-8,),  # the tolerance that MIRCO has built in
    largest_contact=1200.0,  # the time grows with the fourth power of this
)

_active_set = partial(Solver, "active set", kernels=KERNELS)
MIXED = _active_set(
    partial(ActiveSet, operators=partial(HalfSpace, few_per_root=0.0)), precision="mixed"
)
DOUBLE = _active_set(
    partial(ActiveSet, operators=partial(HalfSpace, working="float64", few_per_root=0.0))
)
