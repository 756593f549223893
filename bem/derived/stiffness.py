"""Stiffness of a set of nodes: that of the flat punch which fills it, by one linear solve.

With the influence matrix H_AA of the set, the punch's pressure per displacement is H_AA^-1 1, and
its sum the stiffness. By the analogy of Barber (2003, Proc. R. Soc. Lond. A 459), the same number
gives the conductance of the set for heat and electric current.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from bem.active_set import ActiveSet
from bem.arrays import Nodes, Values
from bem.far_field import flat_punch
from bem.influence import Kernel
from bem.iterate import Effort, Iterate
from bem.operators.patch import Patch
from bem.problem import Problem, boxed

# Largest residual of the punch's unit displacement. The stiffness is right to about its square.
PUNCH_RTOL = 1e-6

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
    marked = np.zeros(problem.heights.shape, dtype=bool)
    marked.reshape(-1)[nodes] = True
    if problem.boundary == "free":
        marked = marked[boxed(marked)]
    shape = len(marked), len(marked[0])
    patch = Patch(shape, problem.boundary, problem.kernel, problem.aspect)
    iterate = Iterate(
        patch,
        np.zeros(marked.shape),
        shift=1.0,
        rtol=PUNCH_RTOL,
        max_iterations=MAX_ITERATIONS,
    )
    residual = ActiveSet(iterate).solve_on(marked, atol=PUNCH_RTOL)
    if not residual <= PUNCH_RTOL:
        raise ArithmeticError(
            f"stiffness of {nodes.size} nodes in contact: residual {residual:.1e} after"
            f" {iterate.iterations} iterations, asked for {PUNCH_RTOL:g}"
        )
    # The pressure is wrong in proportion to the residual r, the energy p (1 + r) in its square.
    pressure = iterate.pressure[marked]
    force = float((pressure * (1 + iterate.residual[marked].astype(np.float64))).sum())
    return Punch(
        stiffness=force * problem.modulus * problem.spacing[1],
        pressure=pressure * (problem.modulus / problem.spacing[0]),
        residual=residual,
        effort=Effort(iterate.iterations, patch.convolutions),
    )


def patch_stiffness(problem: Problem) -> float:
    """Compute the stiffness of a punch that fills a free patch [MPa um].

    Raises
    ------
    ArithmeticError
        If the punch's iteration does not converge.
    """
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
    if not stiffness > 0:
        return stiffness
    left = 1 - stiffness / patch
    return stiffness / left if left > PUNCH_RTOL**2 else np.inf


@lru_cache(maxsize=8)
def _flat_punch_force(shape: tuple[int, int], kernel: Kernel, aspect: float) -> float:
    """Sum the pressure that displaces every node of the patch by one [reduced]."""
    return float(flat_punch(shape, kernel, aspect).sum())
