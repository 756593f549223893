"""The influence matrix of the nodes that may touch: what the solver iterates with."""

from collections.abc import Callable
from copy import copy
from typing import Self

import numpy as np
from numpy.typing import NDArray

from bem.convolution import Selection, displacement_filter
from bem.factor import ContactFactor
from bem.influence import InfluenceMatrix, Kernel
from bem.preconditioner import Preconditioner

Values = NDArray[np.float64]
Nodes = NDArray[np.intp]

# A contact set is worth factorising up to so many nodes times the third root of the grid's, since
# its cost grows with their cube and a convolution's with the grid; and in double precision, which
# spares a convolution in the end, up to this share of them (`pytest bench -k few_in_contact`).
FEW_PER_ROOT = 27.0
DOUBLE_SHARE = 0.5


class HalfSpace:
    """H on m nodes of a grid, less the far field's compliance where there is one.

    Search directions go through single precision: they only have to be good to the digits that
    the next direction corrects. What decides convergence goes through double precision.

    Parameters
    ----------
    shape : (nx, ny) nodes of the grid
    kernel, aspect : see `bem.influence.influence_coefficients`
    nodes : (m,) flat indices of the nodes
    working : precision of search directions, "float32", or "float64" to see what that saves
    few_per_root : see `FEW_PER_ROOT`; 0 to see what iterations do alone

    Attributes
    ----------
    norm : upper bound of the largest eigenvalue
    few_nodes : contact sets of so many nodes and fewer are worth a factor of their matrix
    softening : compliance of the far field; 0 unless made by `through`
    load : given sum of the pressure; None unless made by `under`
    """

    def __init__(
        self,
        shape: tuple[int, int],
        kernel: Kernel,
        aspect: float,
        nodes: Nodes,
        working: str = "float32",
        few_per_root: float | None = None,
    ) -> None:
        self.softening = 0.0
        self.load: float | None = None
        per_root = FEW_PER_ROOT if few_per_root is None else few_per_root
        self.few_nodes = int(per_root * np.cbrt(shape[0] * shape[1]))
        self._grid = shape, kernel, aspect
        self._nodes = nodes
        self.norm = displacement_filter(shape, kernel, aspect).largest
        self._double = Selection(displacement_filter(shape, kernel, aspect), nodes)
        self._working = Selection(displacement_filter(shape, kernel, aspect, working), nodes)
        self._preconditioner = Preconditioner(shape, kernel, aspect, nodes, working)

    def through(self, softening: float) -> Self:
        """The same nodes and tables with a compliant far field.

        Parameters
        ----------
        softening : 1 / s, for H - 1 1^T / s
        """
        other = copy(self)
        other.softening = softening
        return other

    def under(self, load: float) -> Self:
        """The same nodes and tables with a load that is given, for which the far field moves.

        Parameters
        ----------
        load : sum of the pressure, above 0
        """
        other = copy(self)
        other.load = load
        return other

    def displace(self, pressure: Values) -> Values:
        """(m,) -> (m,) displacement in double precision."""
        return self._give_way(self._double(pressure), pressure)

    @property
    def displaced(self) -> Values:
        """(nx, ny) displacement by what went through `displace` last; read it before the next.

        Of all nodes of the grid, on a rigid far field.
        """
        return self._double.field

    def displace_some(self, nodes: Nodes, pressure: Values) -> Values:
        """(a,) pressure on some of the nodes -> (m,) displacement in working precision."""
        return self._give_way(self._working.spread(nodes, pressure).astype(np.float64), pressure)

    def approximate_inverse(self, nodes: Nodes) -> Callable[[Values], Values]:
        """(a,) -> (a,) on some of the nodes, in working precision, of H alone.

        What a compliant far field takes away would spoil its definiteness; a given load is for the
        solver to keep.
        """
        return self._preconditioner.restricted_to(nodes)

    def factor(self, nodes: Nodes) -> ContactFactor:
        """H on some of the nodes, factorised.

        Raises
        ------
        numpy.linalg.LinAlgError
            if it is not positive definite in the precision that their number asks for
        """
        dtype = "float64" if len(nodes) <= DOUBLE_SHARE * self.few_nodes else "float32"
        return ContactFactor(InfluenceMatrix(*self._grid, dtype), self._nodes[nodes])

    def _give_way(self, moved: Values, pressure: Values) -> Values:
        if self.softening:
            moved -= self.softening * float(pressure.sum())
        return moved
