"""The compliant far field: the body behind the patch moves under the patch's own force.

As in MIRCO, Delta is replaced by Delta + F / K, where K = L E* / alpha is the stiffness of a flat
punch that fills the patch. F is linear in the pressure, so that the operator H - 1 1^T / s with
s = 1^T H^-1 1 includes it, and one solve gives the equilibrium.
"""

from functools import lru_cache

import numpy as np

from bem.active_set import solve_complementarity
from bem.arrays import Field
from bem.half_space import HalfSpace
from bem.influence import Kernel

# Tolerance of the flat punch's pressure, close to rounding because every compliant solve uses it.
FLAT_PUNCH_RTOL = 1e-13


@lru_cache(maxsize=8)
def flat_punch(shape: tuple[int, int], kernel: Kernel, aspect: float = 1.0) -> Field:
    """Compute the pressure that displaces every node of the patch by one.

    Parameters
    ----------
    shape : tuple of int
        Nodes (nx, ny) of the patch.
    kernel : str
        Influence coefficients, see `bem.influence.influence_coefficients`.
    aspect : float
        Second side of a cell over its first [1].

    Returns
    -------
    ndarray, shape (nx, ny)
        Pressure, read-only [E* / first side of a cell].

    Raises
    ------
    ArithmeticError
        If the iteration does not reach `FLAT_PUNCH_RTOL`.
    """
    operators = HalfSpace(shape, kernel, aspect, np.arange(shape[0] * shape[1]))
    iterate, converged = solve_complementarity(
        operators, np.ones(shape[0] * shape[1]), rtol=FLAT_PUNCH_RTOL, max_iterations=10_000
    )
    if not converged:
        raise ArithmeticError(
            f"flat punch on {shape[0]} x {shape[1]} nodes, kernel {kernel}: residual"
            f" {iterate.violation():.1e} after {iterate.effort.iterations} iterations"
        )
    pressure = iterate.pressure.reshape(shape)
    pressure.setflags(write=False)
    return pressure


def shape_factor(shape: tuple[int, int], kernel: Kernel) -> float:
    """Compute MIRCO's alpha = L E* Delta / F of the flat punch, with its spacing L / n [1].

    Parameters
    ----------
    shape : tuple of int
        Nodes (nx, ny) of the patch.
    kernel : str
        Influence coefficients, see `bem.influence.influence_coefficients`.
    """
    return float(shape[0] / flat_punch(shape, kernel).sum())


def critical_delta(heights: Field, kernel: Kernel, aspect: float = 1.0) -> float:
    """Compute Delta*, at which the force on a compliant far field grows without bound [um].

    The flat punch's pressure is the null vector of H - 1 1^T / s. The gap is not negative, so that
    its product with that pressure bounds Delta by the pressure-weighted mean of z_max - z.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights of the surface [um].
    kernel : str
        Influence coefficients, see `bem.influence.influence_coefficients`.
    aspect : float
        Second side of a cell over its first [1].
    """
    pressure = flat_punch(heights.shape, kernel, aspect)
    return float((pressure * (heights.max() - heights)).sum() / pressure.sum())
