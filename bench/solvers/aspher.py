"""ASPHER (Yastrebov, BSD) with its exact FFT convolution, or with its periodic operator.

Controls force only. A source distribution: building it takes a C++17 compiler, CMake and the
headers of Eigen, which it tries to download where it does not find them. Its nested grids need
nodes = coarsest x 2^k a side, which 2^k + 1 are not: they run with a margin.
"""

import importlib
from functools import partial
from typing import Any

import numpy as np

from bench.solvers.case import Case
from bench.solvers.solver import MAX_ITERATIONS, Answer, Failure, Press, Solver

COARSEST = 32  # nodes a side that the coarsest of the nested grids has at least


def levels(nodes: int) -> int:
    """How often a grid may be halved."""
    return max((nodes // COARSEST).bit_length() - 1, 0)


def nested_grid(nodes: int) -> int:
    """Smallest number of nodes a side that can be halved that often."""
    step: int = 2 ** levels(nodes)
    return -(-nodes // step) * step


def single_grid(
    nodes: int, spacing: float, precond: str = "fourier", backend: str = "fft"
) -> Press:
    """Open Polonsky and Keer's method with its |q| preconditioner, a stencil or "fourier-fft".

    In double precision. The tolerance is on Frank and Wolfe's duality gap over the force, and on
    the largest penetration, both over the range of heights.
    """
    solver = importlib.import_module("aspher").ContactSolver(
        grid_size=nodes, domain_size=nodes * spacing, E_star=1.0, backend=backend
    )
    return partial(_press, partial(solver.solve, precond=precond))


def nested_grids(nodes: int, spacing: float, engine: str, backend: str = "fft") -> Press:
    """Open the same from coarse to fine grids, in single and then double precision.

    Every call sets up every grid: that is in the time of the solve. The engine of the
    preconditioner is "stencil", on the nodes in contact, or "fft", by transforms of the grid.
    """
    solve = partial(
        importlib.import_module("aspher").solve_nested,
        grid_size=nodes,
        domain_size=nodes * spacing,
        coarsest=nodes // 2 ** levels(nodes),
        E_star=1.0,
        backend=backend,
        precision="float_then_double",
        precond_engine=engine,
    )
    return partial(_press, lambda gap, **settings: solve(gap=gap, **settings))


def _press(solve: Any, case: Case, force: float, tolerance: float) -> Answer:
    result = solve(
        -case.heights.ravel(),
        p_nominal=case.mean_pressure(force),
        tol=tolerance,
        max_iter=MAX_ITERATIONS,
    )
    if not result.converged:
        raise Failure(f"{result.status} {result.status_reason}".strip())
    pressure = np.array(result.pressure).reshape(case.heights.shape)
    return Answer(pressure, int(result.iterations))


_solver = partial(
    Solver,
    package="aspher",
    install="pip install aspher, which builds with C++17, CMake 3.18 and Eigen"
    " (Debian: apt-get install g++ cmake libeigen3-dev)",
    control="force",
)
_nested = partial(_solver, grid=nested_grid, precision="mixed")

SOLVERS = (
    _solver("ASPHER", single_grid),
    _nested("ASPHER nested, stencil, margin", partial(nested_grids, engine="stencil")),
    _nested("ASPHER nested, FFT, margin", partial(nested_grids, engine="fft")),
)
