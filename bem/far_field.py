"""The compliant far field: the body behind the patch gives way under the patch's own force.

Delta is replaced by Delta + F / K, K = L E* / alpha being the stiffness of a flat punch that fills
the patch (what MIRCO does). F is linear in the pressure: H - 1 1^T / s with s = 1^T H^-1 1 takes
it into the operator, and one solve gives the equilibrium.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from bem.active_set import solve_complementarity
from bem.half_space import HalfSpace
from bem.influence import Kernel

FLAT_PUNCH_RTOL = 1e-13


@lru_cache(maxsize=8)
def flat_punch(shape: tuple[int, int], kernel: Kernel, aspect: float = 1.0) -> NDArray[np.float64]:
    """Pressure that moves every node of the patch by the same unit displacement.

    Parameters
    ----------
    shape : (nx, ny) nodes
    kernel : see `bem.influence.influence_coefficients`
    aspect : second side of a cell over its first [1]

    Returns
    -------
    (nx, ny) pressure [E* / first side of a cell], read-only

    Raises
    ------
    ArithmeticError
        if the iteration does not reach `FLAT_PUNCH_RTOL`
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
    """MIRCO's alpha = L E* Delta / F of the flat punch, with its spacing L / n [1]."""
    return float(shape[0] / flat_punch(shape, kernel).sum())


def critical_delta(heights: NDArray[np.float64], kernel: Kernel, aspect: float = 1.0) -> float:
    """Delta*, from which on a compliant far field lets the force grow without bound [um].

    The flat punch's pressure is the null vector of H - 1 1^T / s. The gap is not negative, so its
    product with that pressure bounds Delta by the pressure-weighted mean of z_max - z.

    Parameters
    ----------
    heights : (nx, ny) [um]
    kernel, aspect : as in `flat_punch`
    """
    pressure = flat_punch(heights.shape, kernel, aspect)
    return float((pressure * (heights.max() - heights)).sum() / pressure.sum())
