"""Contact whose pressure is bounded by a hardness, by two methods with the dense matrix.

With A = L L^T, the pressure 0 <= p <= H that minimises p A p / 2 - u p is the least-squares
solution of L^T p = L^-1 u within these bounds, which SciPy finds. On large sets that takes minutes;
there the set of yielded nodes grows until no pressure is above H. The sets are solved once more by
Cholesky's factors, and the result is accepted only if it fulfils all conditions of contact, which a
single pressure does.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, cholesky, solve_triangular
from scipy.optimize import lsq_linear

from bem.influence import Kernel
from bench.references import dense

Field = NDArray[np.float64]
Sides = NDArray[np.intp]
Method = Callable[[Field, Field, float], Sides]

ROUNDING = 1e-11  # pressures and gaps below, over the largest interference, count as zero
EXCHANGES = 50  # of nodes that bounded least squares leaves on the wrong side, by its tolerance


def press(
    heights: Field,
    delta: float,
    hardness: float,
    kernel: Kernel,
    aspect: float = 1.0,
    method: Method | None = None,
) -> tuple[Field, Field]:
    """Solve contact on a rigid far field with bounded pressure.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights [um].
    delta : float
        Displacement of the far field, above 0 [um].
    hardness : float
        Largest pressure [E* um / first side of a cell].
    kernel, aspect
        See `half_space.influence_coefficients`.
    method : callable, optional
        `by_least_squares` unless given, or `by_growth`.

    Returns
    -------
    pressure : ndarray, shape (nx, ny)
        Pressure [E* um / first side of a cell].
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
    pressure[nodes] = solve(
        dense.influence_matrix(heights.shape, kernel, aspect, nodes),
        interference[nodes],
        hardness,
        method or by_least_squares,
    )
    field = pressure.reshape(heights.shape)
    return field, dense.displace(field, kernel, aspect) - interference.reshape(heights.shape)


def solve(matrix: Field, interference: Field, hardness: float, method: Method) -> Field:
    """Find the pressure 0 <= p <= H with gap w = A p - u >= 0 where p = 0 and <= 0 where p = H.

    Parameters
    ----------
    matrix : ndarray, shape (m, m)
        Positive definite A.
    interference : ndarray, shape (m,)
        u.
    hardness : float
        H.
    method : callable
        Finds the side of the bounds of each node.

    Raises
    ------
    ArithmeticError
        If the conditions of contact are not fulfilled.
    """
    accepted = ROUNDING * float(np.abs(interference).max())
    side = method(matrix, interference, hardness)
    for _ in range(EXCHANGES):
        pressure = balance(matrix, interference, hardness, side)
        gap = matrix @ pressure - interference
        wrong = misplaced(pressure, gap, hardness, side, accepted)
        if not wrong.any():
            return np.clip(pressure, 0.0, hardness)
        side = np.where(wrong, np.where(side == 0, np.where(pressure > 0, 1, -1), 0), side)
    raise ArithmeticError(f"bounded least squares: {np.count_nonzero(wrong)} nodes are wrong")


def by_least_squares(matrix: Field, interference: Field, hardness: float) -> Sides:
    """(m,) sides by bounded least squares: -1 without pressure, 1 at yielded nodes, 0 between."""
    factor = cholesky(matrix, lower=True)
    target = solve_triangular(factor, interference, lower=True)
    found = lsq_linear(factor.T, target, bounds=(0.0, hardness), method="bvls", tol=1e-15)
    return np.asarray(found.active_mask)


def by_growth(matrix: Field, interference: Field, hardness: float) -> Sides:
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


def balance(matrix: Field, interference: Field, hardness: float, side: Sides) -> Field:
    """(m,) pressure that closes the gap between the bounds, where side is 0; at a bound elsewhere.

    `side` is -1 at nodes without pressure and 1 at yielded nodes.
    """
    pressure = np.where(side > 0, hardness, 0.0)
    free = side == 0
    if free.any():
        load = interference[free] - matrix[np.ix_(free, side > 0)].sum(axis=1) * hardness
        pressure[free] = cho_solve(cho_factor(matrix[np.ix_(free, free)]), load)
    return pressure


def misplaced(
    pressure: Field, gap: Field, hardness: float, side: Sides, accepted: float
) -> NDArray[np.bool_]:
    """(m,) nodes whose pressure or gap has the wrong sign for their side of the bounds."""
    beyond = (pressure < -accepted) | (pressure > hardness + accepted)
    return np.where(side == 0, beyond, side * gap > accepted)
