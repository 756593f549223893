"""The paper's algorithm for contact: non-negative least squares, its active set grown node by node.

A. Bemporad and M. Paggi (2015), Int. J. Solids Struct. 69-70, algorithm 3, after Lawson and Hanson
(1974): a dense influence matrix of all nodes that may touch, and one dense solve for each node
that comes into contact. It is what MIRCO runs, and here only to be compared with.

Two things are done better than in MIRCO, so that the comparison does not flatter ours: dense
systems go to LAPACK's Cholesky instead of its LU, half the work, and influence coefficients are
looked up in a table that is kept.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dposv

from bem.influence import Kernel
from bench.references.dense import influence_matrix
from bench.references.half_space import Field

Nodes = NDArray[np.intp]


def press(
    heights: Field, delta: float, *, kernel: Kernel = "uniform-pressure", rtol: float = 1e-8
) -> tuple[Field, int]:
    """Press a surface on square cells as `dense.press` does, up to a penetration rtol over Delta.

    Returns
    -------
    pressure : ndarray, shape (nx, ny)
        Pressure [E* Delta / spacing].
    solves : int
        Dense systems solved.
    """
    interference = ((heights - heights.max()) + delta) / delta
    nodes = np.flatnonzero(interference > 0)
    matrix = influence_matrix(heights.shape, kernel, nodes=nodes)
    pressure = np.zeros(heights.size)
    pressure[nodes], solves = solve(matrix, interference.reshape(-1)[nodes], rtol)
    return pressure.reshape(heights.shape), solves


def solve(matrix: Field, interference: Field, rtol: float = 1e-8) -> tuple[Field, int]:
    """Find (m,) p >= 0 with gap w = H p - u >= -rtol and p w = 0, for a positive definite H.

    Return p and the number of dense systems solved; raise ArithmeticError if rounding keeps the
    method from ending, which no contact has been seen to do.
    """
    candidates = interference.size
    active = np.empty(candidates, np.intp)  # the first `count` are in contact
    rows = np.empty_like(matrix)  # those of H that belong to them
    pressure, gap = np.zeros(candidates), -interference
    count = solves = 0
    while count < candidates and gap.min() < -rtol:
        active[count] = gap.argmin()
        rows[count] = matrix[active[count]]
        count += 1
        while True:
            inside = active[:count]
            values = _balance(rows[:count, inside], interference[inside])
            solves += 1
            if values.min() > 0:
                break
            count = _release(pressure, values, active, rows, count)
            if solves > 10 * candidates:
                raise ArithmeticError(f"no end after {solves} solves for {candidates} nodes")
        pressure[inside] = values
        gap = values @ rows[:count] - interference
        gap[inside] = 0
    return pressure, solves


def _balance(matrix: Field, interference: Field) -> Field:
    """Pressure of either sign that closes the gap on all nodes of a small matrix."""
    _, values, failed = dposv(matrix.T, interference, overwrite_a=True)
    if failed:
        raise ArithmeticError("the influence matrix is not positive definite")
    return np.asarray(values)


def _release(pressure: Field, values: Field, active: Nodes, rows: Field, count: int) -> int:
    """Go towards the balance as far as pressures stay positive; release the node that stops it.

    The last of the active nodes takes the place of the one released.

    Returns
    -------
    The number of nodes still in contact
    """
    inside = active[:count]
    here = pressure[inside]
    falling = np.flatnonzero(values <= 0)
    shares = here[falling] / (here[falling] - values[falling] + np.finfo(float).tiny)
    pressure[inside] = here + shares.min() * (values - here)
    stopping = falling[shares.argmin()]
    pressure[active[stopping]] = 0
    active[stopping] = active[count - 1]
    rows[stopping] = rows[count - 1]
    return count - 1
