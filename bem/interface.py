"""The influence matrix of a patch without edges, as the solver applies it."""

from typing import Self

import numpy as np

from bem.arrays import Nodes
from bem.convolution import FieldFilter, Selection, kept_filter
from bem.factor import ContactFactor
from bem.half_space import HalfSpace
from bem.preconditioner import BLOCK, LevelPreconditioner, block_means, whole_blocks
from bem.spacing import Boundary
from bem.spectrum import even_filter, inverse_filter, spectral_filter


class Interface(HalfSpace):
    """The influence matrix H of m nodes of a patch that repeats itself or is mirrored without end.

    A uniform pressure displaces nothing, so that H is positive definite on all sets of nodes but
    that of the whole patch.

    Parameters
    ----------
    shape : tuple of int
        Nodes (nx, ny) of the grid.
    boundary : str
        "periodic" or "mirror".
    aspect : float
        Second side of a cell over its first [1].
    nodes : ndarray, shape (m,), optional
        Flat indices of the nodes; all of them by default.
    keep_field : bool
        Whether `displace` keeps the displacement of the whole grid as `field`.
    """

    edgeless = True

    def __init__(
        self,
        shape: tuple[int, int],
        boundary: Boundary,
        aspect: float,
        nodes: Nodes | None = None,
        *,
        keep_field: bool = False,
    ) -> None:
        self.softening = 0.0
        self.load = None
        self.field = None
        self.few_nodes = 0
        self._patch = shape, boundary, aspect
        self._keep_field = keep_field
        self._nodes = np.arange(shape[0] * shape[1]) if nodes is None else nodes
        double = spectral_filter(shape, boundary, aspect)
        self.norm = double.largest
        self._double = Selection(double, nodes)
        self._working = Selection(spectral_filter(shape, boundary, aspect, "float32"), nodes)
        self._preconditioner = interface_preconditioner(shape, boundary, aspect, self._nodes)

    def among(self, some: Nodes) -> Self:
        """Return the same patch restricted to some of its nodes."""
        return type(self)(*self._patch, self._nodes[some])

    def factor(self, nodes: Nodes) -> ContactFactor:
        """Refuse to factorise H: transforms of a patch without edges take less time."""
        raise np.linalg.LinAlgError(f"H of {len(nodes)} nodes is left to iterations")


def interface_preconditioner(
    shape: tuple[int, int], boundary: Boundary, aspect: float, nodes: Nodes
) -> LevelPreconditioner:
    """Return the approximate inverse of H on any subset of a list of nodes.

    It is the inverse of the symbol itself where both sides are whole blocks, else that of the next
    larger patch.
    """
    patch = whole_blocks(shape[0]), whole_blocks(shape[1])
    inverse = inverse_filter(patch, boundary, aspect, "float32")
    means = kept_filter(make_means, patch, boundary, aspect)
    return LevelPreconditioner(shape, nodes, inverse, means)


def make_means(patch: tuple[int, int], boundary: Boundary, aspect: float) -> FieldFilter:
    """Tabulate the spectrum of weighted means over blocks of a patch without edges."""
    blocks = patch[0] // BLOCK, patch[1] // BLOCK
    if boundary == "periodic":
        return even_filter(blocks, boundary, block_means(blocks, aspect), "float32")
    mirrored = block_means((2 * blocks[0], 2 * blocks[1]), aspect)[: blocks[0], : blocks[1]]
    return even_filter(blocks, boundary, mirrored, "float32")
