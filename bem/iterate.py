"""A pressure on its way to equilibrium, and the operators that it goes by.

Everything lives on a list of m nodes that may touch, in reduced units: displacements over Delta,
pressures such that H maps a pressure to a displacement. Nodes off the list never carry pressure.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from bem.factor import ContactFactor

Values = NDArray[np.float64]
Nodes = NDArray[np.intp]


class Operators(Protocol):
    """The influence matrix of the m nodes and its approximate inverse.

    Attributes
    ----------
    norm : upper bound of the matrix's largest eigenvalue
    few_nodes : contact sets of so many nodes and fewer are worth a factor of their matrix
    softening : compliance of the far field: 0 where it is rigid, near the matrix's own stiffness
        where contacts are nearly singular
    load : sum of the pressure where it is given and the far field's displacement follows, else
        None
    """

    norm: float
    softening: float
    few_nodes: int
    load: float | None

    def displace(self, pressure: Values) -> Values:
        """(m,) -> (m,) displacement to the last digits: decides what is converged."""

    def displace_some(self, nodes: Nodes, pressure: Values) -> Values:
        """(a,) pressure on some of the nodes -> (m,) displacement; may be rounded to 1e-7."""

    def approximate_inverse(self, nodes: Nodes) -> Callable[[Values], Values]:
        """(a,) -> (a,), symmetric and near the inverse of the matrix on these nodes."""

    def factor(self, nodes: Nodes) -> ContactFactor:
        """The matrix of these nodes, on a rigid far field, factorised.

        Raises
        ------
        numpy.linalg.LinAlgError
            if it is not positive definite in the precision chosen
        """


@dataclass
class Iterate:
    """A pressure on the nodes that may touch, and how far it is from equilibrium.

    Attributes
    ----------
    pressure : (m,) reduced pressure, not negative between the steps
    residual : (m,) interference and `moved` less displacement: zero in contact, negative where a
        gap is open
    moved : displacement of the far field besides the interference; 0 unless the load is given
    iterations : steps of conjugate gradients, and contact sets of dense algebra, so far
    convolutions : applications of H so far
    exact : whether the residual is that of the pressure to the last digits, not kept up in working
        precision since
    stalled : whether rounding leaves no step that would come nearer to equilibrium
    """

    pressure: Values
    residual: Values
    iterations: int = 0
    convolutions: int = 0
    exact: bool = False
    moved: float = 0.0
    stalled: bool = False

    def contact(self) -> Nodes:
        """Nodes under pressure, and nodes that would penetrate."""
        return np.flatnonzero((self.pressure > 0) | (self.residual > 0))

    def energy(self, interference: Values) -> float:
        """Half p H p less p u, in reduced units: least for the solution among all p >= 0.

        Among those that carry the load, where it is given.
        """
        energy = -inner(self.pressure, interference + self.residual) / 2
        return energy + self.moved * float(self.pressure.sum()) / 2 if self.moved else energy

    def violation(self) -> float:
        """Largest |w| in contact or -w outside, zero for the exact solution."""
        pressed = self.residual * (self.pressure > 0)
        return max(float(self.residual.max(initial=0.0)), -float(pressed.min(initial=0.0)))

    def renew(self, operators: Operators, interference: Values) -> None:
        """Recompute the residual from the pressure; a given load is carried in full before that."""
        carried = float(self.pressure.sum())
        if operators.load is not None and carried > 0:
            self.pressure *= operators.load / carried
        self.residual = interference - operators.displace(self.pressure)
        self.moved = 0.0
        self.convolutions += 1
        self.exact = True
        if operators.load is not None and carried > 0:
            self.level(self.pressure, self.residual)

    def level(self, weights: Values, residual: Values) -> None:
        """Move the far field so that the weighted mean of the residual is zero.

        With the pressure for weights this is the displacement of least error, in the energy, that
        the pressure at hand gives.

        Parameters
        ----------
        weights, residual : (a,) of the nodes in contact
        """
        mean = inner(weights, residual) / float(weights.sum())
        self.residual -= mean
        self.moved -= mean


def rescale(operators: Operators, interference: Values, iterate: Iterate) -> None:
    """Multiply the pressure by the factor of least energy, or by that which gives the load."""
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
    iterate.residual = interference - factor * (image + iterate.moved)
    iterate.moved = 0.0
    iterate.level(iterate.pressure, iterate.residual)


def inner(a: Values, b: Values) -> float:
    """Inner product without BLAS, whose threads would change its last bits."""
    return float(np.einsum("i,i->", a, b))
