"""ASPHER (Yastrebov, BSD) with its exact FFT convolution.

Controls force only. A source distribution: building it takes a C++17 compiler, CMake and the
headers of Eigen, which it tries to download where it does not find them. Its nested grids need
nodes = coarsest x 2^k a side, which 2^k + 1 are not: they run with a margin.
"""

import importlib
from functools import partial
from typing import Any

import numpy as np

from bench.peers.peer import MAX_ITERATIONS, Field, Load, Peer
from bench.work_precision.solvers import Failure

COARSEST = 32
"""Nodes a side that the coarsest of the nested grids has at least."""


def levels(nodes: int) -> int:
    """How often a grid may be halved."""
    return max((nodes // COARSEST).bit_length() - 1, 0)


def nested_grid(nodes: int) -> int:
    """Smallest number of nodes a side that can be halved that often."""
    step: int = 2 ** levels(nodes)
    return -(-nodes // step) * step


class SingleGrid:
    """Polonsky and Keer's method with its |q| preconditioner as a stencil, in double precision.

    The tolerance is on Frank and Wolfe's duality gap over the force, and on the largest
    penetration, both over the range of heights.
    """

    def __init__(self, nodes: int, spacing: float) -> None:
        package = importlib.import_module("aspher")
        self._solver = package.ContactSolver(
            grid_size=nodes, domain_size=nodes * spacing, E_star=1.0, backend="fft"
        )

    def press(self, load: Load, tolerance: float) -> tuple[Field, int | None]:
        """Solve for a force."""
        result = self._solver.solve(
            -load.heights.ravel(),
            p_nominal=load.mean_pressure,
            tol=tolerance,
            max_iter=MAX_ITERATIONS,
            precond="fourier",
        )
        return _pressure(result, load)


class NestedGrids:
    """The same from coarse to fine grids, in single and then double precision.

    Every call sets up every grid: that is in the time of the solve.
    """

    def __init__(self, nodes: int, spacing: float, engine: str) -> None:
        self._solve = partial(
            importlib.import_module("aspher").solve_nested,
            grid_size=nodes,
            domain_size=nodes * spacing,
            coarsest=nodes // 2 ** levels(nodes),
            E_star=1.0,
            backend="fft",
            precision="float_then_double",
            precond_engine=engine,
            max_iter=MAX_ITERATIONS,
        )

    def press(self, load: Load, tolerance: float) -> tuple[Field, int | None]:
        """Solve for a force."""
        gap = -load.heights.ravel()
        result = self._solve(gap=gap, p_nominal=load.mean_pressure, tol=tolerance)
        return _pressure(result, load)


def nested_by_stencil(nodes: int, spacing: float) -> NestedGrids:
    """Nested grids, the preconditioner as a stencil on the nodes in contact."""
    return NestedGrids(nodes, spacing, "stencil")


def nested_by_transform(nodes: int, spacing: float) -> NestedGrids:
    """Nested grids, the preconditioner by transforms of the whole grid."""
    return NestedGrids(nodes, spacing, "fft")


def _pressure(result: Any, load: Load) -> tuple[Field, int | None]:
    if not result.converged:
        raise Failure(f"{result.status} {result.status_reason}".strip())
    return np.array(result.pressure).reshape(load.heights.shape), int(result.iterations)


_peer = partial(
    Peer,
    package="aspher",
    install="pip install aspher, which builds with C++17, CMake 3.18 and Eigen"
    " (Debian: apt-get install g++ cmake libeigen3-dev)",
    control="force",
)
_nested = partial(_peer, grid=nested_grid, precision="mixed")

PEERS = (
    _peer("ASPHER", open_session=SingleGrid),
    _nested("ASPHER nested, stencil, margin", open_session=nested_by_stencil),
    _nested("ASPHER nested, FFT, margin", open_session=nested_by_transform),
)
