"""Contact whose pressure is bounded by a hardness, by SciPy's bounded least squares.

With A = L L^T, the pressure 0 <= p <= H that minimises p A p / 2 - u p is the least-squares
solution of L^T p = L^-1 u within these bounds. The sets that SciPy's method finds are solved once
more by Cholesky's factors, and the result is accepted only if it fulfils all conditions of contact.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, cholesky, solve_triangular
from scipy.optimize import lsq_linear

from bem.influence import Kernel
from bench.references.dense import displace, influence_matrix

Field = NDArray[np.float64]

ROUNDING = 1e-11  # pressures and gaps below, over the largest interference, count as zero
EXCHANGES = 50  # of nodes that bounded least squares leaves on the wrong side, by its tolerance


def press(
    heights: Field, delta: float, hardness: float, kernel: Kernel, aspect: float = 1.0
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
        influence_matrix(heights.shape, kernel, aspect, nodes), interference[nodes], hardness
    )
    field = pressure.reshape(heights.shape)
    return field, displace(field, kernel, aspect) - interference.reshape(heights.shape)


def solve(matrix: Field, interference: Field, hardness: float) -> Field:
    """Find the pressure 0 <= p <= H with gap w = A p - u >= 0 where p = 0 and <= 0 where p = H.

    Parameters
    ----------
    matrix : ndarray, shape (m, m)
        Positive definite A.
    interference : ndarray, shape (m,)
        u.
    hardness : float
        H.

    Raises
    ------
    ArithmeticError
        If the conditions of contact are not fulfilled.
    """
    factor = cholesky(matrix, lower=True)
    target = solve_triangular(factor, interference, lower=True)
    found = lsq_linear(factor.T, target, bounds=(0.0, hardness), method="bvls", tol=1e-15)
    accepted = ROUNDING * float(np.abs(interference).max())
    side = np.asarray(found.active_mask)
    for _ in range(EXCHANGES):
        pressure = balance(matrix, interference, hardness, side)
        gap = matrix @ pressure - interference
        wrong = misplaced(pressure, gap, hardness, side, accepted)
        if not wrong.any():
            return np.clip(pressure, 0.0, hardness)
        side = np.where(wrong, np.where(side == 0, np.where(pressure > 0, 1, -1), 0), side)
    raise ArithmeticError(f"bounded least squares: {np.count_nonzero(wrong)} nodes are wrong")


def balance(matrix: Field, interference: Field, hardness: float, side: NDArray[np.intp]) -> Field:
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
    pressure: Field, gap: Field, hardness: float, side: NDArray[np.intp], accepted: float
) -> NDArray[np.bool_]:
    """(m,) nodes whose pressure or gap has the wrong sign for their side of the bounds."""
    beyond = (pressure < -accepted) | (pressure > hardness + accepted)
    return np.where(side == 0, beyond, side * gap > accepted)
