"""The compliant far field of MIRCO, which gives way by F / K under the force F.

K is the stiffness of a flat punch that fills the patch. The influence matrix less 1 / K is
singular, with the punch's pressure as its null vector. As the displacement of the far field
approaches a value Delta*, the force therefore grows without bound.
"""

from functools import lru_cache

import numpy as np

from bem.active_set import ActiveSet
from bem.arrays import Field
from bem.bodies import Body
from bem.iterate import Iterate
from bem.operators.patch import Patch
from bem.problem import NoSolution, Problem

# Largest departure of the flat punch's displacement from one that is accepted [1]. It is close to
# rounding, because the punch enters every solve on a compliant far field.
FLAT_PUNCH_RTOL = 1e-13

# Largest number of iterations for a flat punch, far more than any grid needs.
FLAT_PUNCH_ITERATIONS = 10_000


class BeyondCriticalDelta(NoSolution):
    """A displacement of a compliant far field at or beyond Delta*, where there is no equilibrium.

    Parameters
    ----------
    delta : float
        Requested far-field displacement [um].
    critical : float
        Delta* of the surface [um].

    Attributes
    ----------
    delta : float
        Requested far-field displacement [um].
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
    """Return the displacement of a compliant far field under a unit reduced load.

    Parameters
    ----------
    problem : Problem
        A problem on a compliant far field.

    Returns
    -------
    float
        Compliance of the far field, its displacement over the sum of the nodes' pressures
        [first side of a cell / E*].

    Raises
    ------
    BeyondCriticalDelta
        If the problem has a given displacement at or beyond Delta*.
    ArithmeticError
        As `flat_punch`.
    """
    if problem.delta is not None:
        critical = critical_delta(problem.heights, problem.reduced_body, problem.aspect)
        if problem.delta >= critical:
            raise BeyondCriticalDelta(problem.delta, critical)
    punch = flat_punch(problem.heights.shape, problem.reduced_body, problem.aspect)
    return 1 / float(punch.sum())


@lru_cache(maxsize=8)
def flat_punch(shape: tuple[int, int], body: Body, aspect: float = 1.0) -> Field:
    """Compute the pressure of a flat punch that displaces every node of a free patch by one.

    Recent results are kept for later calls with the same arguments.

    Parameters
    ----------
    shape : tuple of int
        Nodes (nx, ny) of the patch.
    body : Body
        Reduced body, see `bem.bodies.Body.reduced`.
    aspect : float
        Second side of a cell over its first [1].

    Returns
    -------
    ndarray, shape (nx, ny)
        Pressure per displacement, read-only [E* / first side of a cell].

    Raises
    ------
    ArithmeticError
        If the iteration does not reach `FLAT_PUNCH_RTOL`.
    """
    patch = Patch(shape, "free", body, aspect)
    iterate = Iterate(
        patch,
        np.zeros(shape),
        shift=1.0,
        rtol=FLAT_PUNCH_RTOL,
        max_iterations=FLAT_PUNCH_ITERATIONS,
    )
    if not ActiveSet(iterate).run():
        raise ArithmeticError(
            f"flat punch on {shape[0]} x {shape[1]} nodes, kernel {body.kernel}:"
            f" residual {iterate.violation().largest:.1e} after {iterate.iterations} iterations"
        )
    pressure = iterate.pressure
    pressure.setflags(write=False)
    return pressure


def critical_delta(heights: Field, body: Body, aspect: float = 1.0) -> float:
    """Compute Delta*, at which the force on a compliant far field grows without bound.

    Delta* is the mean of z_max - z, weighted by the pressure of the flat punch. This pressure is
    the null vector of H - 1 1^T / K. Its product with the gap contains therefore no displacement,
    and is not negative, because no gap is. It follows that Delta is below Delta*.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights of the surface [um].
    body : Body
        Reduced body, see `bem.bodies.Body.reduced`.
    aspect : float
        Second side of a cell over its first [1].

    Returns
    -------
    float
        Delta* [um].

    Raises
    ------
    ArithmeticError
        As `flat_punch`.
    """
    pressure = flat_punch(heights.shape, body, aspect)
    return float((pressure * (heights.max() - heights)).sum() / pressure.sum())
