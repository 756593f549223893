"""Our own solvers: `bem.solve`, and the paper's algorithm."""

from concurrent.futures import ThreadPoolExecutor

import bem
from bem import influence
from bem.influence import KERNELS
from bem.operators.patch import Patch
from bench.references import dense, half_space
from bench.solvers.case import Case
from bench.solvers.solver import Answer, Failure, Press, Solver


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
    return Answer(contact.pressure, contact.iterations, contact.convolutions)


def papers_algorithm(nodes: int, spacing: float) -> Press:
    """Open Bemporad and Paggi's active set, `press_by_nnls`; its iterations are dense solves."""
    half_space.influence_coefficients.cache_clear()
    half_space.influence_coefficients((nodes, nodes), "uniform-pressure")

    def press(case: Case, force: float, tolerance: float) -> Answer:
        pressure, solves = dense.press_by_nnls(
            case.heights, case.delta, kernel=case.kernel, rtol=tolerance
        )
        return Answer(pressure * (case.delta / case.spacing), solves)

    return press


BEM = Solver("bem", boundary_elements, precision="mixed", kernels=KERNELS, plastic=True)
PAPERS = Solver(
    "paper's NNLS",
    papers_algorithm,
    ladder=(1e-8,),  # the tolerance that MIRCO has built in
    largest_contact=1200.0,  # the time grows with the fourth power of this
)
