"""All solvers by other people that can be compared with ours."""

from collections.abc import Iterable

from bench.solvers import aspher, contact_mechanics, tamaas
from bench.solvers.solver import Solver

OTHERS: tuple[Solver, ...] = (*contact_mechanics.SOLVERS, *tamaas.SOLVERS, *aspher.SOLVERS)


def installed(solvers: Iterable[Solver] = OTHERS) -> list[Solver]:
    """Return the solvers whose packages are installed."""
    return [solver for solver in solvers if solver.version]


def missing(solvers: Iterable[Solver] = OTHERS) -> dict[str, str]:
    """Return the packages that are not installed, each with how to get it."""
    return {solver.package: solver.install for solver in solvers if not solver.version}
