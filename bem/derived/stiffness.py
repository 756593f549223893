"""Stiffness of a set of nodes: the stiffness of the flat punch that fills it, by one linear solve.

With the influence matrix H_AA of the set, the punch's pressure per displacement is H_AA^-1 1, and
the sum of this pressure is the stiffness. By the analogy of Barber (2003, Proc. R. Soc. Lond. A
459), the stiffness also gives the conductance of the set for heat and electric current.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from bem.active_set import ActiveSet
from bem.arrays import Mask, Nodes, Values
from bem.bodies import Body
from bem.far_field import flat_punch
from bem.iterate import Effort, Iterate
from bem.operators.patch import Patch
from bem.problem import Problem, boxed

# Largest accepted departure of the punch's displacement from one [1]. The relative error of the
# stiffness is about the square of this departure.
PUNCH_RTOL = 1e-6

# Largest number of steps of conjugate gradients: ten times the number that the hardest sets of the
# tests need.
MAX_ITERATIONS = 2000


@dataclass(frozen=True, eq=False)
class Punch:
    """The flat punch of a set of nodes.

    Attributes
    ----------
    stiffness : float
        Force per displacement of the punch. It is infinite for all nodes of a patch without edges
        where a uniform pressure displaces nothing [MPa um].
    pressure : ndarray, shape (a,)
        Pressure per displacement at the a nodes of the punch [MPa / um].
    residual : float
        Largest departure of the computed unit displacement from one [1].
    effort : Effort
        Iterations and applications of the influence matrix.
    """

    stiffness: float
    pressure: Values
    residual: float
    effort: Effort


def punch_of(problem: Problem, nodes: Nodes) -> Punch:
    """Press a flat punch that fills some nodes of a patch into the body.

    Parameters
    ----------
    problem : Problem
        Grid, boundary and body. Its far field is taken as rigid.
    nodes : ndarray, shape (a,)
        Flat indices of the nodes, rising.

    Returns
    -------
    Punch
        The punch. Its stiffness is 0 for no nodes. Stiffness and pressure are infinite for all
        nodes of a patch without edges, unless the body has a mean compliance.

    Raises
    ------
    ArithmeticError
        If conjugate gradients do not reach `PUNCH_RTOL`.
    """
    if not nodes.size:
        return Punch(stiffness=0.0, pressure=np.zeros(0), residual=0.0, effort=Effort())
    is_edgeless = problem.boundary != "free"
    is_full = is_edgeless and nodes.size == problem.heights.size
    if is_full and not problem.body.mean_compliance > 0:
        pressure = np.full(nodes.size, np.inf)
        return Punch(stiffness=np.inf, pressure=pressure, residual=0.0, effort=Effort())
    pressed = pressed_on(problem, nodes, np.ones(nodes.size), PUNCH_RTOL)
    # The error of the sum of p is proportional to the residual r, and that of the sum of p (1 + r)
    # to r^2.
    force = float((pressed.pressure * (1 + pressed.residuals)).sum())
    return Punch(
        stiffness=force * problem.modulus * problem.spacing[1],
        pressure=pressed.pressure * (problem.modulus / problem.spacing[0]),
        residual=pressed.largest_residual,
        effort=pressed.effort,
    )


@dataclass(frozen=True, eq=False)
class Pressed:
    """A pressure on some nodes that displaces these nodes by wanted amounts.

    Attributes
    ----------
    pressure : ndarray, shape (a,)
        Pressure at the a nodes [unit of displacement times E* / first side of a cell].
    residuals : ndarray, shape (a,)
        Wanted displacements less those by the pressure [unit of displacement].
    largest_residual : float
        Largest absolute residual [unit of displacement].
    effort : Effort
        Iterations and applications of the influence matrix.
    """

    pressure: Values
    residuals: Values
    largest_residual: float
    effort: Effort


def pressed_on(
    problem: Problem, nodes: Nodes, displacement: Values, atol: float
) -> Pressed:
    """Solve for the pressure of any sign on some nodes that displaces them by wanted amounts.

    Parameters
    ----------
    problem : Problem
        Grid, boundary and body. Its far field is taken as rigid.
    nodes : ndarray, shape (a,)
        Flat indices of at least one node, rising; not all nodes of a patch without edges.
    displacement : ndarray, shape (a,)
        Wanted displacements of these nodes, of which the largest is about one
        [any unit of length].
    atol : float
        Largest absolute residual that is accepted [unit of displacement].

    Returns
    -------
    Pressed
        The pressure of the nodes, and its residuals.

    Raises
    ------
    ArithmeticError
        If conjugate gradients do not reach this residual.
    """
    marked: Mask = np.zeros(problem.heights.shape, dtype=bool)
    marked.reshape(-1)[nodes] = True
    if problem.boundary == "free":  # the rest of a free patch carries nothing
        marked = marked[boxed(marked)]
    shape = marked.shape[0], marked.shape[1]
    patch = Patch(shape, problem.boundary, problem.reduced_body, problem.aspect)
    interference = np.zeros(shape)
    interference[marked] = displacement
    iterate = Iterate(
        patch, interference, shift=0.0, rtol=atol, max_iterations=MAX_ITERATIONS
    )
    residual = ActiveSet(iterate).solve_on(marked, atol=atol)
    if not residual <= atol:
        raise ArithmeticError(
            f"stiffness of {nodes.size} nodes in contact: residual {residual:.1e} after"
            f" {iterate.iterations} iterations, asked for {atol:g}"
        )
    return Pressed(
        pressure=iterate.pressure[marked],
        residuals=iterate.residual[marked].astype(np.float64),
        largest_residual=residual,
        effort=Effort(iterate.iterations, patch.convolutions),
    )


def patch_stiffness(problem: Problem) -> float:
    """Compute the stiffness of the flat punch that fills a patch.

    Parameters
    ----------
    problem : Problem
        The problem.

    Returns
    -------
    float
        Stiffness; without edges it is infinite, unless the body has a mean compliance [MPa um].

    Raises
    ------
    ArithmeticError
        As `bem.far_field.flat_punch`.
    """
    if problem.boundary != "free":
        if not problem.body.mean_compliance > 0:
            return np.inf
        area = problem.heights.size * problem.spacing[0] * problem.spacing[1]
        return area / problem.body.mean_compliance
    reduced = _flat_punch_force(
        problem.heights.shape, problem.reduced_body, problem.aspect
    )
    return reduced * problem.modulus * problem.spacing[1]


def without_patch(stiffness: float, patch: float) -> float:
    """Remove the compliance of the patch from the compliance of a contact in series with it.

    Parameters
    ----------
    stiffness : float
        Stiffness of the contact [MPa um].
    patch : float
        Stiffness of the punch that fills the patch [MPa um].

    Returns
    -------
    float
        1 / (1 / stiffness - 1 / patch); 0 without contact, infinite where the contact is as stiff
        as the patch to rounding [MPa um].
    """
    if not stiffness > 0:  # without contact
        return stiffness
    share_of_interface = 1 - stiffness / patch  # share of the contact's compliance
    if not share_of_interface > PUNCH_RTOL**2:  # within the error of the stiffness
        return np.inf
    return stiffness / share_of_interface


@lru_cache(maxsize=8)
def _flat_punch_force(shape: tuple[int, int], body: Body, aspect: float) -> float:
    """Return the force that displaces every node of a free patch by one [E* x second side]."""
    return float(flat_punch(shape, body, aspect).sum())
