"""Stiffness of a set of nodes: that of the flat punch which fills it, by one linear solve.

With the influence matrix H_AA of the set, the punch's pressure per displacement is H_AA^-1 1, and
its sum the stiffness. By the analogy of Barber (2003, Proc. R. Soc. Lond. A 459), the same number
gives the conductance of the set for heat and electric current.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from bem.arrays import Nodes, Values
from bem.equilibrium import boxed
from bem.far_field import flat_punch
from bem.gradients import run_stage
from bem.half_space import HalfSpace
from bem.influence import Kernel
from bem.interface import Interface
from bem.iterate import Effort, Iterate, Operators, inner
from bem.problem import Problem

# Largest residual of the punch's unit displacement. The stiffness is right to about its square.
PUNCH_RTOL = 1e-6

# Factor by which conjugate gradients reduce the residual between looks at it.
REDUCTION = 0.1

# Renewals of the residual in double precision, each after a stage in single precision.
RENEWALS = 8

# Bound on the steps of conjugate gradients: ten times what the hardest sets of the tests need.
MAX_ITERATIONS = 2000


@dataclass(frozen=True, eq=False)
class Punch:
    """The flat punch of a set of nodes.

    Attributes
    ----------
    stiffness : float
        Force per displacement of the punch; infinite for all nodes of a patch without edges, where
        a uniform pressure displaces nothing [MPa um].
    pressure : ndarray, shape (a,)
        Pressure per displacement [MPa / um].
    residual : float
        Largest departure of the displacement from one [1].
    effort : Effort
        Iterations and applications of the influence matrix.
    """

    stiffness: float
    pressure: Values
    residual: float
    effort: Effort


def punch_of(problem: Problem, nodes: Nodes) -> Punch:
    """Press a flat punch that fills some nodes of a patch into the half-space.

    Parameters
    ----------
    problem : Problem
        Grid, boundary and modulus; its far field is taken as rigid.
    nodes : ndarray, shape (a,)
        Flat indices of the nodes.

    Raises
    ------
    ArithmeticError
        If conjugate gradients do not reach `PUNCH_RTOL`.
    """
    if not nodes.size:
        return Punch(0.0, np.zeros(0), 0.0, Effort())
    if nodes.size == problem.heights.size and problem.boundary != "free":
        return Punch(np.inf, np.full(nodes.size, np.inf), 0.0, Effort())
    iterate = _solve(_operators(problem, nodes), nodes.size)
    residual = float(np.abs(iterate.residual).max())
    if not residual <= PUNCH_RTOL:
        raise ArithmeticError(
            f"stiffness of {nodes.size} nodes in contact: residual {residual:.1e} after"
            f" {iterate.effort.iterations} iterations, asked for {PUNCH_RTOL:g}"
        )
    # The pressure is wrong in proportion to the residual r, the energy p (1 + r) in its square.
    force = float(iterate.pressure.sum()) + inner(iterate.pressure, iterate.residual)
    return Punch(
        stiffness=force * problem.modulus * problem.spacing[1],
        pressure=iterate.pressure * (problem.modulus / problem.spacing[0]),
        residual=residual,
        effort=iterate.effort,
    )


def patch_stiffness(problem: Problem) -> float:
    """Compute the stiffness of a punch that fills the patch, infinite if it has no edges [MPa um].

    Raises
    ------
    ArithmeticError
        If the punch's iteration does not converge.
    """
    if problem.boundary != "free":
        return np.inf
    reduced = _flat_punch_force(problem.heights.shape, problem.kernel, problem.aspect)
    return reduced * problem.modulus * problem.spacing[1]


def without_patch(stiffness: float, patch: float) -> float:
    """Take the compliance of the patch out of that of a contact in series with it.

    Parameters
    ----------
    stiffness, patch : float
        Stiffness of the contact and of the punch that fills the patch [MPa um].

    Returns
    -------
    float
        1 / (1 / stiffness - 1 / patch); infinite where the contact is as stiff as the patch, to
        rounding [MPa um].
    """
    if not stiffness > 0 or np.isinf(patch):
        return stiffness
    left = 1 - stiffness / patch
    return stiffness / left if left > PUNCH_RTOL**2 else np.inf


@lru_cache(maxsize=8)
def _flat_punch_force(shape: tuple[int, int], kernel: Kernel, aspect: float) -> float:
    """Sum the pressure that displaces every node of the patch by one [reduced]."""
    return float(flat_punch(shape, kernel, aspect).sum())


def _operators(problem: Problem, nodes: Nodes) -> Operators:
    """Return the influence matrix of some nodes, on the smallest box if the patch is free."""
    shape = problem.heights.shape
    if problem.boundary != "free":
        return Interface(shape, problem.boundary, problem.aspect, nodes)
    marked = np.zeros(shape, dtype=bool)
    marked.reshape(-1)[nodes] = True
    box, inside = boxed(marked)
    small = box[0].stop - box[0].start, box[1].stop - box[1].start
    return HalfSpace(small, problem.kernel, problem.aspect, inside)


def _solve(operators: Operators, size: int) -> Iterate:
    """Find the pressure that displaces all nodes by one, with its residual in double precision."""
    interference, everywhere = np.ones(size), np.arange(size)
    iterate = Iterate.from_zero(interference)
    correct = operators.approximate_inverse(everywhere)
    for _ in range(RENEWALS):
        run_stage(
            operators,
            iterate,
            everywhere,
            correct,
            lambda _pressure, _largest: False,
            (REDUCTION, PUNCH_RTOL / 2),
            MAX_ITERATIONS,
        )
        iterate.renew(operators, interference)
        if not float(np.abs(iterate.residual).max()) > PUNCH_RTOL:  # also where it is nan
            break
    return iterate
