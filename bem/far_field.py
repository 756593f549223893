"""The compliant far field of MIRCO: it gives way by F / K under the force F.

K is the stiffness of a flat punch that fills the patch. The influence matrix less 1 / K has the
punch's pressure for its null vector, so that the force grows without bound towards a displacement
Delta* of the far field.
"""

from functools import lru_cache

import numpy as np

from bem.active_set import ActiveSet
from bem.arrays import Field
from bem.influence import Kernel
from bem.iterate import Iterate
from bem.operators.patch import Patch
from bem.problem import NoSolution, Problem

# Tolerance of a flat punch, close to rounding because every compliant solve uses it.
FLAT_PUNCH_RTOL, FLAT_PUNCH_ITERATIONS = 1e-13, 10_000


class BeyondCriticalDelta(NoSolution):
    """A compliant far field at or beyond Delta*, where the force has no bound.

    Attributes
    ----------
    delta : float
        The far-field displacement asked for [um].
    critical_delta : float
        Delta* of the surface [um].
    """

    def __init__(self, delta: float, critical: float) -> None:
        self.delta = delta
        self.critical_delta = critical
        super().__init__(
            f"delta = {delta:g} um has no equilibrium on a compliant far field: on this surface"
            f" it must stay below Delta* = {critical:.10g} um"
        )


def give_of(problem: Problem) -> float:
    """Return how far a compliant far field gives way under a unit reduced load [1].

    Parameters
    ----------
    problem : Problem
        A problem on a compliant far field.

    Raises
    ------
    BeyondCriticalDelta
        If a displacement is given that it has no equilibrium at.
    """
    if problem.delta is not None:
        critical = critical_delta(problem.heights, problem.kernel, problem.aspect)
        if problem.delta >= critical:
            raise BeyondCriticalDelta(problem.delta, critical)
    return 1 / float(
        flat_punch(problem.heights.shape, problem.kernel, problem.aspect).sum()
    )


@lru_cache(maxsize=8)
def flat_punch(shape: tuple[int, int], kernel: Kernel, aspect: float = 1.0) -> Field:
    """Compute the pressure that displaces every node of a free patch by one.

    As in MIRCO, a compliant far field gives way by F / K under the force F, where K is the
    stiffness of a flat punch that fills the patch.

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
    patch = Patch(shape, "free", kernel, aspect)
    iterate = Iterate(
        patch,
        np.zeros(shape),
        shift=1.0,
        rtol=FLAT_PUNCH_RTOL,
        max_iterations=FLAT_PUNCH_ITERATIONS,
    )
    if not ActiveSet(iterate).run():
        raise ArithmeticError(
            f"flat punch on {shape[0]} x {shape[1]} nodes, kernel {kernel}: residual"
            f" {iterate.violation().largest:.1e} after {iterate.iterations} iterations"
        )
    pressure = iterate.pressure
    pressure.setflags(write=False)
    return pressure


def critical_delta(heights: Field, kernel: Kernel, aspect: float = 1.0) -> float:
    """Compute Delta*, at which the force on a compliant far field grows without bound [um].

    The flat punch's pressure is the null vector of H - 1 1^T / K. The gap is not negative, so that
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
