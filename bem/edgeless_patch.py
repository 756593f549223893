"""A problem on a patch without edges in reduced units."""

from dataclasses import dataclass

import numpy as np

from bem.arrays import Values
from bem.interface import Interface
from bem.problem import Problem
from bem.sections import computed_once

# Unit of length under the smallest loads, over the displacement of one cell that carries all of the
# load. Nodes deeper than the unit stay open whatever the surface, if that cell does not yield, and
# count as this deep: single precision holds pressures and depths at once only where they are not
# too far apart.
REACH = 1e8


@dataclass(frozen=True, eq=False)
class Patch:
    """A problem in reduced units.

    Attributes
    ----------
    problem : Problem
        The problem.
    length : float
        Unit of displacements [um].
    below : ndarray, shape (m,)
        Heights less the highest [length]; nodes out of reach of a given load at -1, see `REACH`.
    hardness : float
        Largest pressure [reduced].
    keep_displacement : bool
        Whether the displacement of the half-space is wanted too.
    """

    problem: Problem
    length: float
    below: Values
    hardness: float
    keep_displacement: bool

    @classmethod
    def of(cls, problem: Problem, length: float, *, keep_displacement: bool) -> "Patch":
        """Return a problem in units of a length [um]."""
        below = (problem.heights - problem.heights.max()).reshape(-1)
        if cannot_yield(problem) and length == REACH * reduced_load(problem):
            below = np.maximum(below, -length)
        return cls(
            problem=problem,
            length=length,
            below=below / length,
            hardness=problem.reduced_hardness(length),
            keep_displacement=keep_displacement,
        )

    @computed_once
    def operators(self) -> Interface:
        """The influence matrix of all nodes, for solves on lists of nodes."""
        problem = self.problem
        return Interface(
            problem.heights.shape,
            problem.boundary,
            problem.aspect,
            keep_field=self.keep_displacement,
        )

    @computed_once
    def depth(self) -> float:
        """Displacement at which the contact is full, if the bodies stay elastic [length]."""
        return -float(self.below.mean())


def cannot_yield(problem: Problem) -> bool:
    """Return whether a load is given that a single cell carries without yielding."""
    if problem.delta is not None:
        return False
    return problem.hardness is None or reduced_load(problem) <= problem.reduced_hardness(1.0)


def reduced_load(problem: Problem) -> float:
    """Return the force over E* and the second side of a cell [um]."""
    assert problem.force is not None
    return problem.force / problem.modulus / problem.spacing[1]
