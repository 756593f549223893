"""The influence matrix of the nodes that may touch: what the solver iterates with."""

import numpy as np
from numpy.typing import NDArray

from bem.convolution import Selection, circulant_inverse, displacement_filter
from bem.influence import Kernel

Values = NDArray[np.float64]
Nodes = NDArray[np.intp]


class HalfSpace:
    """H on m nodes of a grid, less the far field's compliance where there is one.

    Search directions go through single precision: they only have to be good to the digits that
    the next direction corrects. What decides convergence goes through double precision.

    Parameters
    ----------
    shape : (nx, ny) nodes of the grid
    kernel, aspect : see `bem.influence.influence_coefficients`
    nodes : (m,) flat indices of the nodes
    softening : 1 / s of a compliant far field, H - 1 1^T / s; 0 for a rigid one

    Attributes
    ----------
    norm : upper bound of the largest eigenvalue
    """

    def __init__(
        self,
        shape: tuple[int, int],
        kernel: Kernel,
        aspect: float,
        nodes: Nodes,
        softening: float = 0.0,
    ) -> None:
        self._softening = softening
        self.norm = displacement_filter(shape, kernel, aspect).largest
        self._double = Selection(displacement_filter(shape, kernel, aspect), nodes)
        self._single = Selection(displacement_filter(shape, kernel, aspect, "float32"), nodes)
        self._inverse = Selection(circulant_inverse(shape, kernel, aspect, "float32"), nodes)

    def displace(self, pressure: Values) -> Values:
        """(m,) -> (m,) displacement in double precision."""
        return self._give_way(self._double(pressure), pressure)

    def displace_some(self, nodes: Nodes, pressure: Values) -> Values:
        """(a,) pressure on some of the nodes -> (m,) displacement in single precision."""
        return self._give_way(self._single.spread(nodes, pressure).astype(np.float64), pressure)

    def precondition_some(self, nodes: Nodes, residual: Values) -> Values:
        """(a,) -> (a,), the circulant inverse restricted to some of the nodes."""
        return self._inverse.within(nodes, residual).astype(np.float64)

    def _give_way(self, moved: Values, pressure: Values) -> Values:
        if self._softening:
            moved -= self._softening * float(pressure.sum())
        return moved
