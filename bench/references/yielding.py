"""Contact whose pressure is bounded by a hardness, by two methods with the dense matrix.

With A = L L^T, the pressure 0 <= p <= H that minimises p A p / 2 - u p is the least-squares
solution of L^T p = L^-1 u within these bounds, which SciPy finds. On large sets that takes minutes;
there the set of yielded nodes grows until no pressure is above H. `dense.solve` begins with these
sets, and accepts a pressure only if it fulfils all conditions of contact, which a single one does.
"""

from collections.abc import Callable

import numpy as np
from scipy.linalg import cholesky, solve_triangular
from scipy.optimize import lsq_linear

from bem.influence import Kernel
from bench.references import dense
from bench.references.half_space import Field

Method = Callable[[Field, Field, float], dense.Sides]


def press(
    heights: Field,
    delta: float,
    hardness: float,
    kernel: Kernel,
    aspect: float = 1.0,
    method: Method | None = None,
) -> tuple[Field, Field]:
    """Solve contact on a rigid far field with bounded pressure.

    The parameters are those of `dense.press`; the method is `by_least_squares` unless given, or
    `by_growth`.

    Returns
    -------
    pressure : ndarray, shape (nx, ny)
        Pressure, like the hardness in [E* um / first side of a cell].
    gap : ndarray, shape (nx, ny)
        Gap; negative at yielded nodes, by the depth to which they yield [um].

    Raises
    ------
    ArithmeticError
        If the conditions of contact are not fulfilled.
    """
    interference = ((heights - heights.max()) + delta).reshape(-1)
    nodes = np.flatnonzero(interference > 0)
    pressure = np.zeros(heights.size)
    matrix = dense.influence_matrix(heights.shape, kernel, aspect, nodes)
    sides = (method or by_least_squares)(matrix, interference[nodes], hardness)
    pressure[nodes] = dense.solve(matrix, interference[nodes], sides, hardness)
    field = pressure.reshape(heights.shape)
    return field, dense.displace(field, kernel, aspect) - interference.reshape(heights.shape)


def by_least_squares(matrix: Field, interference: Field, hardness: float) -> dense.Sides:
    """(m,) sides by bounded least squares: -1 without pressure, 1 at yielded nodes, 0 between."""
    factor = cholesky(matrix, lower=True)
    target = solve_triangular(factor, interference, lower=True)
    found = lsq_linear(factor.T, target, bounds=(0.0, hardness), method="bvls", tol=1e-15)
    return np.asarray(found.active_mask)


def by_growth(matrix: Field, interference: Field, hardness: float) -> dense.Sides:
    """The same by elastic solves on fewer and fewer nodes, the others known to carry H."""
    yielded = np.zeros(interference.size, bool)
    while True:
        rest = ~yielded
        load = interference[rest] - hardness * matrix[np.ix_(rest, yielded)].sum(axis=1)
        pressure = np.full(interference.size, hardness)
        pressure[rest] = dense.solve(matrix[np.ix_(rest, rest)], load) if rest.any() else 0.0
        beyond = pressure > hardness
        if not beyond.any():
            return np.where(yielded, 1, np.where(pressure > 0, 0, -1))
        yielded |= beyond
