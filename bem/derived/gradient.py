"""Derivatives of the answers of a contact by the heights of its surface.

A small change of the heights changes the pressure of the nodes in contact, as long as the contact
set stays. With the influence matrix H, the nodes A that are in contact and below the hardness, the
heights z, the height z_0 at which Delta is zero, and the approach d of the far field,

    H_AA dp_A = dz_A + (dd - dz_0) 1,

because nodes in contact have no gap, while yielded nodes keep their pressure. The flat punch of A,
the solution of H_AA q = 1, gives the derivatives of force and Delta; it also gives the stiffness.
The derivatives of the mean gap need one more solve with the same matrix, which is symmetric: the
adjoint solve H_AA y = (H m)_A. Here m is one over the number of nodes wherever the gap is open, and
zero elsewhere.

Nodes enter or leave the contact set where pressure or gap is zero, so that they change the answers
to second order only.
"""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from bem.arrays import Field, Mask, Values
from bem.checks import shown
from bem.derived.stiffness import Punch, patch_stiffness, pressed_on, without_patch
from bem.operators.displacement import displacement_filter
from bem.operators.filters import filtered
from bem.problem import Problem

# Largest accepted departure of displacements in the adjoint solve, over the largest one [1].
ADJOINT_RTOL = 1e-7

Differentiable = Literal["force", "delta", "mean_gap"]
DIFFERENTIABLE: tuple[Differentiable, ...] = get_args(Differentiable)

# Answers of a contact that change in steps, and why they are refused.
WITHOUT_GRADIENT = {
    "area_percent": "a count of nodes changes in steps",
    "area": "a count of nodes changes in steps",
    "contact_nodes": "a count of nodes changes in steps",
    "continuum_area_percent": "its border is placed from node to node, and changes in steps",
}


@dataclass(frozen=True, eq=False)
class LinearContact:
    """A contact whose sets of nodes stay as they are.

    Attributes
    ----------
    problem : Problem
        The problem that was solved.
    elastic : ndarray of bool, shape (nx, ny)
        Mask of the nodes in contact that are below the hardness.
    is_open : ndarray of bool, shape (nx, ny)
        Mask of the nodes that are not in contact.
    punch : Punch
        The flat punch of the elastic nodes.
    """

    problem: Problem
    elastic: Mask
    is_open: Mask
    punch: Punch

    @property
    def load_shares(self) -> Field:
        """Share of each node in the force of the punch, (nx, ny), of sum 1 [1].

        A full contact without edges, whose punch is infinitely stiff, carries a change of load
        uniformly.
        """
        shares = np.zeros(self.elastic.shape)
        if np.isinf(self.punch.stiffness):
            shares[self.elastic] = 1 / np.count_nonzero(self.elastic)
        else:
            shares[self.elastic] = self.punch.pressure / self.punch.pressure.sum()
        return shares


def gradient_of(contact: LinearContact, of: str) -> Field:
    """Differentiate an answer of a contact by the heights of its surface.

    Parameters
    ----------
    contact : LinearContact
        The contact.
    of : str
        "force", at a given Delta; "delta", at a given force; or "mean_gap", at the given load of
        the problem.

    Returns
    -------
    ndarray, shape (nx, ny)
        Derivatives: of the force [uN / um], of Delta and of the mean gap [1].

    Raises
    ------
    ValueError
        If the answer has no gradient, or this contact has none, see `Contact.gradient`.
    ArithmeticError
        If a linear solve does not converge.
    """
    if of not in DIFFERENTIABLE:
        raise ValueError(_refusal(of))
    problem = contact.problem
    if problem.datum is not None:
        raise ValueError(
            "the heights of this contact were made from another grid, whose highest node is the"
            " datum of Delta: solve on the grid itself with bem.solve for a gradient"
        )
    if of == "force":
        return _force_gradient(contact)
    if of == "delta":
        return _approach_at_load(contact) + _datum_gradient(problem)
    return _mean_gap_gradient(contact)


def mean_gap_slope_of(contact: LinearContact) -> float:
    """Differentiate the mean gap of a contact by Delta.

    Parameters
    ----------
    contact : LinearContact
        The contact.

    Returns
    -------
    float
        Derivative, at most 0; it is -1 for elastic half-spaces on a patch without edges [1].

    Raises
    ------
    ArithmeticError
        If a linear solve does not converge.
    """
    problem = contact.problem
    of_approach = float(_at_given_approach(contact).sum())
    if problem.far_field == "rigid" or not contact.elastic.any():
        return of_approach
    # Delta is the approach less F / K, so that dd / dDelta = 1 + (dF / dDelta) / K.
    patch = patch_stiffness(problem)
    return of_approach * (1 + without_patch(contact.punch.stiffness, patch) / patch)


def _refusal(of: str) -> str:
    """Return the message that refuses an answer without a gradient."""
    allowed = f"allowed: {', '.join(DIFFERENTIABLE)}"
    if of in WITHOUT_GRADIENT:
        return f"of = {of!r} has no gradient, because {WITHOUT_GRADIENT[of]}: {allowed}"
    return f"of = {shown(of)}: {allowed}"


def _datum_gradient(problem: Problem) -> Field:
    """Differentiate the height z_0 at which Delta is zero: 1 at the highest node, 0 elsewhere [1].

    Raise ValueError if several nodes are the highest: which of them is the datum then depends on
    the direction of the change.
    """
    heights = problem.heights
    highest = heights == heights.max()
    ties = int(np.count_nonzero(highest))
    if ties > 1:
        raise ValueError(
            f"{ties} nodes are the highest, from which Delta counts: a gradient needs one highest"
            " node"
        )
    gradient: Field = highest.astype(float)
    return gradient


def _approach_at_load(contact: LinearContact) -> Field:
    """Differentiate the approach less z_0, (nx, ny), at a given load [1].

    Raise ValueError if no node in contact is below the hardness.
    """
    if not contact.elastic.any():
        raise ValueError(
            "no node is in contact and below the hardness: Delta at this load has no gradient"
        )
    return -contact.load_shares


def _approach_at_delta(contact: LinearContact) -> Field:
    """Differentiate the approach less z_0, (nx, ny), at a given Delta [1].

    On a compliant far field the approach is Delta + F / K with the stiffness K of the patch.
    """
    problem = contact.problem
    gradient = -_datum_gradient(problem)
    if problem.far_field == "compliant":
        gradient += _force_gradient(contact) / patch_stiffness(problem)
    return gradient


def _force_gradient(contact: LinearContact) -> Field:
    """Differentiate the force at a given Delta, (nx, ny) [uN / um]."""
    problem = contact.problem
    if not contact.elastic.any():
        return np.zeros(problem.heights.shape)
    stiffness = contact.punch.stiffness
    if problem.far_field == "compliant":
        stiffness = without_patch(stiffness, patch_stiffness(problem))
    if np.isinf(stiffness):
        raise ValueError(
            "the contact is full and infinitely stiff: its force has no gradient"
        )
    return stiffness * (contact.load_shares - _datum_gradient(problem))


def _mean_gap_gradient(contact: LinearContact) -> Field:
    """Differentiate the mean gap at the given load or Delta of the problem, (nx, ny) [1].

    The mean gap is the sum of m (H p - z + z_0 - d). The pressure changes with the heights of the
    elastic nodes and with d - z_0, which itself changes with all heights.
    """
    problem = contact.problem
    gradient = _at_given_approach(contact)
    of_approach = float(gradient.sum())
    if problem.delta is None:
        return gradient + of_approach * _approach_at_load(contact)
    return gradient + of_approach * _approach_at_delta(contact)


def _at_given_approach(contact: LinearContact) -> Field:
    """Differentiate the mean gap while d - z_0 stays, (nx, ny) [1].

    A common rise of all heights is the same as one of d - z_0, so that the sum of these derivatives
    is the derivative by d - z_0.

    An elastic patch without edges needs no solve, unless a uniform pressure displaces the body: the
    mean displacement of its pressure is zero, so that the mean gap is the mean of z_0 - d - z.
    """
    problem = contact.problem
    nodes = problem.heights.size
    has_yielded = not np.all(contact.elastic | contact.is_open)
    if problem.has_most_delta and not has_yielded:
        return np.full(problem.heights.shape, -1 / nodes)
    weights = contact.is_open / nodes
    gradient = -weights
    gradient[contact.elastic] = _adjoint(contact, weights)
    return gradient


def _adjoint(contact: LinearContact, weights: Field) -> Values:
    """Solve H_AA y = (H m)_A for the weights m, (nx, ny); return y on the a elastic nodes [1].

    Raise ArithmeticError if conjugate gradients do not reach `ADJOINT_RTOL`.
    """
    problem = contact.problem
    if not contact.elastic.any():
        return np.zeros(0)
    operator = displacement_filter(
        weights.shape, problem.boundary, problem.reduced_body, problem.aspect, "float64"
    )
    displacement = filtered(operator, weights)[contact.elastic]
    largest = float(np.abs(displacement).max())
    if largest == 0:  # no gap is open
        return np.zeros(displacement.size)
    nodes = np.flatnonzero(contact.elastic)
    solved = pressed_on(problem, nodes, displacement / largest, ADJOINT_RTOL)
    return largest * solved.pressure
