"""The influence matrix of a patch without edges, as the solver applies it."""

import math
from functools import lru_cache
from typing import Self

import numpy as np
from scipy import fft

from bem.arrays import Nodes, Real
from bem.convolution import FieldFilter, kept_filter
from bem.factor import ContactFactor
from bem.half_space import HalfSpace
from bem.influence import ROWS
from bem.preconditioner import BLOCK, LevelPreconditioner, block_means, whole_blocks
from bem.sections import computed_once
from bem.selection import Selection
from bem.spacing import Boundary
from bem.spectrum import even_filter, inverse_filter, spectral_filter, wave_numbers

# Largest contact set worth factorising, the least of these factors times powers of the number of
# nodes: the cost of a factor grows with the cube of the set, that of iterations with the grid.
FEW = (0.105, 5 / 6), (9.0, 0.4)


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

    @computed_once
    def _preconditioner(self) -> LevelPreconditioner:  # type: ignore[override]
        """The approximate inverse, which dense algebra does without."""
        return interface_preconditioner(*self._patch, self._nodes)

    def among(self, some: Nodes) -> Self:
        """Return the same patch restricted to some of its nodes."""
        return type(self)(*self._patch, self._nodes[some])

    def factor(self, nodes: Nodes) -> ContactFactor:
        """Leave sets of nodes to iterations; `bem.listed_contact` factorises under a load.

        Raises
        ------
        numpy.linalg.LinAlgError
            Always.
        """
        raise np.linalg.LinAlgError(f"H of {len(nodes)} nodes is left to iterations")


def few_nodes(nodes: int) -> int:
    """Return the largest contact set worth factorising on a grid of some nodes."""
    return min(int(factor * nodes**power) for factor, power in FEW)


class InterfaceMatrix:
    """The influence matrix between nodes of a patch without edges, entry by entry.

    Parameters
    ----------
    shape : tuple of int
        Nodes (nx, ny) of the grid.
    boundary : str
        "periodic" or "mirror".
    aspect : float
        Second side of a cell over its first [1].
    dtype : str
        Precision of the entries, "float64" or "float32".
    inverse : bool
        Whether the matrix is the inverse of that of the whole patch on fields of zero mean instead:
        its entries between these nodes.

    Attributes
    ----------
    dtype : numpy.dtype
        Precision of the entries.
    """

    def __init__(
        self,
        shape: tuple[int, int],
        boundary: Boundary,
        aspect: float,
        dtype: str = "float64",
        *,
        inverse: bool = False,
    ) -> None:
        self.dtype = np.dtype(dtype)
        self._columns, self._mirrored = shape[1], boundary == "mirror"
        periods = (2 * shape[0], 2 * shape[1]) if self._mirrored else shape
        self._periods = periods
        self._coefficients = _coefficients(periods, aspect, dtype, inverse)

    def among(self, nodes: Nodes) -> Real:
        """Return the lower triangle of the (n, n) matrix of (n,) nodes, in Fortran's order."""
        n, width = len(nodes), 2 * self._periods[1]
        rows, columns = np.divmod(nodes, self._columns)
        centre = self._periods[0] * width + self._periods[1]
        here = rows * width + columns + centre
        matrix = np.empty((n, n), self.dtype)
        for first in range(0, n, ROWS):
            some = slice(first, first + ROWS)
            for number, (along, across) in enumerate(self._images(rows[first:], columns[first:])):
                offsets = np.subtract.outer(here[some], along * width + across)
                entries = self._coefficients.take(offsets, mode="clip")
                if number:
                    matrix[some, first:] += entries
                else:
                    matrix[some, first:] = entries
        return matrix.T

    def _images(self, rows: Nodes, columns: Nodes) -> list[tuple[Nodes, Nodes]]:
        """Return the rows and columns of nodes, and of their mirror images in one period."""
        if not self._mirrored:
            return [(rows, columns)]
        return [
            (along, across) for along in (rows, -1 - rows) for across in (columns, -1 - columns)
        ]


@lru_cache(maxsize=4)
def _coefficients(
    periods: tuple[int, int], aspect: float, dtype: str, inverse: bool = False
) -> Real:
    """Tabulate the displacement by a unit pressure that repeats itself, for offsets either way.

    The inverse is the change of pressure by a unit displacement.
    """
    symbol = wave_numbers(periods, "periodic", aspect) / 2
    if not inverse:
        symbol[0, 0] = math.inf
        symbol = 1 / symbol
    table = fft.irfft2(symbol, s=periods).astype(dtype)
    twice = np.tile(table, (2, 2)).reshape(-1)
    twice.setflags(write=False)
    return twice


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
