"""A pressure on its way to equilibrium, and the operators that the solver applies to it.

All arrays live on a list of m nodes that may touch, in reduced units: displacements are divided by
Delta, and pressures are scaled so that H maps a pressure to a displacement. Nodes outside the list
never carry pressure.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from bem.arrays import Nodes, Values
from bem.factor import ContactFactor


class Operators(Protocol):
    """The influence matrix of the m nodes and its approximate inverse.

    Attributes
    ----------
    norm : float
        Upper bound of the matrix's largest eigenvalue.
    few_nodes : int
        Largest contact set whose matrix is worth factorising.
    softening : float
        Compliance of the far field: 0 where it is rigid, near the matrix's own stiffness where
        contacts are nearly singular.
    load : float or None
        Sum of the pressure if it is given, so that the displacement of the far field follows.
    """

    norm: float
    softening: float
    few_nodes: int
    load: float | None

    def displace(self, pressure: Values) -> Values:
        """Compute the (m,) displacement in double precision; it decides on convergence."""

    def displace_some(self, nodes: Nodes, pressure: Values) -> Values:
        """Compute the (m,) displacement by (a,) pressure on some nodes, to 1e-7 or better."""

    def approximate_inverse(self, nodes: Nodes) -> Callable[[Values], Values]:
        """Return a symmetric map (a,) -> (a,) near the inverse of the matrix on these nodes."""

    def factor(self, nodes: Nodes) -> ContactFactor:
        """Factorise the matrix of these nodes on a rigid far field.

        Raises
        ------
        numpy.linalg.LinAlgError
            If the matrix is not positive definite in the precision chosen.
        """


@dataclass(frozen=True)
class Effort:
    """The work that a solve has taken; efforts add up.

    Attributes
    ----------
    iterations : int
        Steps of conjugate gradients, and contact sets of dense algebra.
    convolutions : int
        Applications of the influence matrix.
    """

    iterations: int = 0
    convolutions: int = 0

    def __add__(self, other: "Effort") -> "Effort":
        """Return the sum of both efforts."""
        return Effort(self.iterations + other.iterations, self.convolutions + other.convolutions)


ITERATION = Effort(iterations=1)
CONVOLUTION = Effort(convolutions=1)
STEP = ITERATION + CONVOLUTION


@dataclass
class Iterate:
    """A pressure on the nodes that may touch, and its distance from equilibrium.

    Attributes
    ----------
    pressure : ndarray, shape (m,)
        Reduced pressure, not negative between the steps.
    residual : ndarray, shape (m,)
        Interference plus `shift` less displacement: zero in contact, negative where a gap is open.
    effort : Effort
        Work so far.
    exact : bool
        Whether the residual has been recomputed in double precision from this pressure, rather
        than updated in working precision.
    shift : float
        Displacement of the far field in addition to the interference; 0 unless the load is given.
    stalled : bool
        Whether rounding leaves no step that would come nearer to equilibrium.
    """

    pressure: Values
    residual: Values
    effort: Effort = Effort()
    exact: bool = False
    shift: float = 0.0
    stalled: bool = False

    @staticmethod
    def from_zero(interference: Values) -> "Iterate":
        """Return the iterate without any pressure, whose residual is the interference."""
        return Iterate(np.zeros_like(interference), interference.copy())

    def contact(self) -> Nodes:
        """Return the nodes under pressure and the nodes that would penetrate."""
        return np.flatnonzero((self.pressure > 0) | (self.residual > 0))

    def energy(self, interference: Values) -> float:
        """Compute p H p / 2 - p u in reduced units.

        The solution has the least energy of all p >= 0, or of all that carry a given load.
        """
        energy = -inner(self.pressure, interference + self.residual) / 2
        return energy + self.shift * float(self.pressure.sum()) / 2 if self.shift else energy

    def violation(self) -> float:
        """Return the largest |w| in contact or -w outside; it is zero for the exact solution."""
        in_contact = self.residual * (self.pressure > 0)
        return max(float(self.residual.max(initial=0.0)), -float(in_contact.min(initial=0.0)))

    def renew(self, operators: Operators, interference: Values) -> None:
        """Scale the pressure to the load if one is given, then recompute the residual."""
        carried = float(self.pressure.sum())
        if operators.load is not None and carried > 0:
            self.pressure *= operators.load / carried
        self.residual = interference - operators.displace(self.pressure)
        self.shift = 0.0
        self.effort += CONVOLUTION
        self.exact = True
        if operators.load is not None and carried > 0:
            self.level(self.pressure, self.residual)

    def level(self, weights: Values, residual: Values) -> None:
        """Shift the far field so that the weighted mean of the residual is zero.

        With the pressure as weights, this is the displacement that leaves the least error in the
        energy for the present pressure.

        Parameters
        ----------
        weights, residual : ndarray, shape (a,)
            Weights and residual of the nodes in contact.
        """
        mean = inner(weights, residual) / float(weights.sum())
        self.residual -= mean
        self.shift -= mean


def rescale(operators: Operators, interference: Values, iterate: Iterate) -> None:
    """Multiply the pressure by the factor that gives the least energy, or the given load."""
    image = interference - iterate.residual
    if operators.load is None:
        stiffness = inner(iterate.pressure, image)
        if stiffness > 0:
            factor = inner(iterate.pressure, interference) / stiffness
            iterate.pressure *= factor
            iterate.residual = interference - factor * image
        return
    factor = operators.load / float(iterate.pressure.sum())
    iterate.pressure *= factor
    iterate.residual = interference - factor * (image + iterate.shift)
    iterate.shift = 0.0
    iterate.level(iterate.pressure, iterate.residual)


def inner(a: Values, b: Values) -> float:
    """Compute an inner product without BLAS, whose threads would change its last bits."""
    return float(np.einsum("i,i->", a, b))
