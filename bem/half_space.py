"""The influence matrix of the nodes that may touch, as the solver applies it."""

from collections.abc import Callable
from copy import copy
from typing import Self

import numpy as np

from bem.arrays import Field, Nodes, Values
from bem.convolution import displacement_filter
from bem.factor import ContactFactor
from bem.influence import InfluenceMatrix, Kernel
from bem.preconditioner import half_space_preconditioner
from bem.selection import Image, PlainImage, Selection

# Largest contact set worth factorising, over the third root of the grid's nodes: the cost of a
# factor grows with the cube of the set, that of a convolution with the grid
# (`pytest bench -k few_in_contact`).
FEW_PER_ROOT = 27.0

# Share of that set up to which the factor is in double precision, which saves a convolution at the
# end (`pytest bench -k few_in_contact`).
DOUBLE_SHARE = 0.5


class HalfSpace:
    """The influence matrix H of m nodes, less the compliance of the far field if it has one.

    Search directions go through single precision, because the next direction corrects their last
    digits. Displacements that decide on convergence go through double precision.

    Parameters
    ----------
    shape : tuple of int
        Nodes (nx, ny) of the grid.
    kernel : str
        Influence coefficients, see `bem.influence.influence_coefficients`.
    aspect : float
        Second side of a cell over its first [1].
    nodes : ndarray, shape (m,)
        Flat indices of the nodes.
    working : str
        Precision of search directions: "float32", or "float64" to measure the difference.
    few_per_root : float, optional
        Replaces `FEW_PER_ROOT`; 0 leaves every solve to iterations.
    keep_field : bool
        Whether `displace` keeps the displacement of the whole grid as `field`.

    Attributes
    ----------
    norm : float
        Upper bound of the largest eigenvalue.
    few_nodes : int
        Largest contact set whose matrix is worth factorising.
    softening : float
        Compliance of the far field; 0 unless made by `through`.
    load : float or None
        Given sum of the pressure; None unless made by `under`.
    field : ndarray, shape (nx, ny), or None
        Displacement of every node of the grid by the last pressure given to `displace`, on a
        rigid far field; None before that and where `keep_field` is False.
    edgeless : bool
        Whether a uniform pressure displaces nothing; a free patch has edges.
    """

    edgeless = False

    def __init__(
        self,
        shape: tuple[int, int],
        kernel: Kernel,
        aspect: float,
        nodes: Nodes,
        *,
        working: str = "float32",
        few_per_root: float | None = None,
        keep_field: bool = False,
    ) -> None:
        self.softening = 0.0
        self.load: float | None = None
        self.field: Field | None = None
        per_root = FEW_PER_ROOT if few_per_root is None else few_per_root
        self.few_nodes = int(per_root * np.cbrt(shape[0] * shape[1]))
        self._grid = shape, kernel, aspect
        self._nodes = nodes
        self._keep_field = keep_field
        double = displacement_filter(shape, kernel, aspect)
        self.norm = double.largest
        self._double = Selection(double, nodes)
        self._working = self._double.through(displacement_filter(shape, kernel, aspect, working))
        self._preconditioner = half_space_preconditioner(shape, kernel, aspect, nodes, working)

    def through(self, softening: float) -> Self:
        """Return a view of the same nodes and tables with a compliant far field.

        Parameters
        ----------
        softening : float
            Compliance 1 / s of the far field: the matrix becomes H - 1 1^T / s.
        """
        other = copy(self)
        other.softening = softening
        return other

    def under(self, load: float) -> Self:
        """Return a view of the same nodes and tables whose load is given.

        Parameters
        ----------
        load : float
            Sum of the pressure, above 0; the displacement of the far field follows from it.
        """
        other = copy(self)
        other.load = load
        return other

    def among(self, some: Nodes) -> Self:
        """Return the same half-space restricted to some of its nodes, on a rigid far field."""
        shape, kernel, aspect = self._grid
        return type(self)(shape, kernel, aspect, self._nodes[some])

    def displace(self, pressure: Values) -> Values:
        """Compute the (m,) displacement by an (m,) pressure in double precision."""
        if self._keep_field:
            self.field = self._double.everywhere(pressure)
            return self._soften(self.field.reshape(-1)[self._nodes], pressure)
        return self._soften(self._double(pressure), pressure)

    def displace_some(self, nodes: Nodes | slice, pressure: Values) -> Values:
        """Compute the (m,) displacement by (a,) pressure on some nodes, in working precision.

        The next call may overwrite the result.
        """
        return self._soften(self._working.spread(nodes, pressure), pressure)

    def image_of(self, nodes: Nodes | slice, pressure: Values) -> Image | PlainImage:
        """Apply H to (a,) pressure on some nodes, in working precision, and gather nothing yet.

        The next call overwrites the image.
        """
        if self.softening:
            return PlainImage(self.displace_some(nodes, pressure), nodes)
        return self._working.image(nodes, pressure)

    def approximate_inverse(self, nodes: Nodes) -> Callable[[Values], Values]:
        """Return an approximate inverse (a,) -> (a,) of H on some nodes, in working precision.

        It leaves out the compliance of the far field, which would spoil its definiteness, and a
        given load, which the solver keeps.
        """
        return self._preconditioner.restricted_to(nodes)

    def factor(self, nodes: Nodes) -> ContactFactor:
        """Factorise H on some of the nodes.

        Raises
        ------
        numpy.linalg.LinAlgError
            If it is not positive definite in the precision that the number of nodes asks for.
        """
        dtype = "float64" if len(nodes) <= DOUBLE_SHARE * self.few_nodes else "float32"
        return ContactFactor(InfluenceMatrix(*self._grid, dtype), self._nodes[nodes])

    def _soften(self, displacement: Values, pressure: Values) -> Values:
        """Subtract the displacement of a compliant far field, in place."""
        if self.softening:
            displacement -= self.softening * float(pressure.sum())
        return displacement
