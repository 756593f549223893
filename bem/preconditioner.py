"""An approximate inverse of the influence matrix of any set of nodes, from an extended circulant.

Let C be a circulant near H on the whole grid. The inverse of C_AA on a set A is the minimum of
v^T C^-1 v over all fields v that equal the residual on A. The usual choice of zero outside A
overestimates this minimum, the more so the more fragmented A is, and the condition number then
grows like the number of nodes a side. Here v continues the residual by weighted means of its values
nearby. With this extension E, the condition number of M = E^T C^-1 E stays near 4 on rough surfaces
of any size (`tests/bem/test_preconditioner.py` measures it).
"""

from bisect import bisect_left
from collections.abc import Callable
from functools import lru_cache

import numpy as np
from scipy import fft

from bem.arrays import Field, Nodes, Real, Values
from bem.convolution import FieldFilter, Filter, kept_filter
from bem.influence import Kernel, influence_coefficients
from bem.iterate import inner
from bem.places import is_whole, node_places, places_and_blocks
from bem.vectors import (
    SHORT,
    add_taken,
    each_row,
    is_short,
    piece_length,
    put,
    take,
    take_out,
)
from bem.workers import workers

# The following four were chosen by the iterations of conjugate gradients on the paper's surfaces,
# k = 7 to 9, at 1, 10 and 50 % contact; none of them matters much.

# Nodes a side of the blocks whose means extend the residual.
BLOCK = 4

# Power of the distance between blocks by which the weight of a block falls.
DECAY = 2.5

# Weight of a node's own block, over that of a neighbouring block.
OWN_BLOCK = 10.0

# Weight of the value zero for the nodes outside the set: far from the set the extension falls to
# zero.
VACANT = 0.05


class Preconditioner:
    """The approximate inverse of H on any subset of a list of nodes.

    Parameters
    ----------
    shape : tuple of int
        Nodes (nx, ny) of the grid.
    nodes : ndarray, shape (m,), or None
        Flat indices of the nodes in the list; None for all of them in their order.
    inverse : FieldFilter
        Inverse of the circulant, on whole blocks that hold the grid.
    means : FieldFilter
        Weighted means over its blocks.
    """

    def __init__(
        self,
        shape: tuple[int, int],
        nodes: Nodes | None,
        inverse: FieldFilter,
        means: FieldFilter,
    ) -> None:
        self._inverse, self._means = inverse, means
        self._shape = shape
        self._field, self._sums = inverse.field.reshape(-1), means.field.reshape(-1)
        self._known: tuple[Nodes, Nodes] | None = None
        self._nodes = None if nodes is None or is_whole(shape, nodes) else nodes
        if nodes is not None and inverse.field.size < SHORT:  # long lists take too much memory
            places = node_places(shape, inverse.field.shape[1], nodes)
            self._known = places, _all_blocks(inverse.field.shape).take(places, mode="clip")

    def _extension(self, some: Nodes) -> tuple[Nodes, Nodes, Real]:
        """Return the places of nodes[some] in the field of the inverse, their blocks and weights.

        The weights belong to all blocks: they make means of the weighted sums of values.
        """
        field = self._inverse.field
        columns = field.shape[1]
        if self._known is not None:
            places, blocks = (known.take(some, mode="clip") for known in self._known)
        elif self._nodes is None and self._shape == field.shape and field.size < SHORT:
            places, blocks = some, _all_blocks(field.shape)[some]
        else:
            nodes = some if self._nodes is None else take(self._nodes, some)
            places, blocks = places_and_blocks(self._shape, columns, nodes, BLOCK)
        weights = self._mean(blocks) + VACANT
        return places, blocks, np.divide(1, weights, out=weights)

    def restricted_to(self, some: Nodes) -> Callable[[Values], Values]:
        """Return the approximate inverse on nodes[some], which is symmetric positive definite."""
        places, blocks, weights = self._extension(some)
        inverse = self._inverse

        def precondition(residual: Values) -> Values:
            _fill_blocks(inverse.field, weights * self._mean(blocks, residual))
            put(residual, places, self._field)
            inverse.transform()
            return self._gather(places, blocks, weights)

        return precondition

    def _gather(self, places: Nodes, blocks: Nodes, weights: Real) -> Values:
        """Apply the transpose of the extension to the field of the inverse, which it spoils."""
        inverse, means = self._inverse, self._means
        gathered = np.empty(places.size)
        take_out(self._field, places, gathered)
        np.multiply(weights, block_sums(inverse.field), out=means.field)
        means.transform()
        add_taken(gathered, self._sums, blocks)
        return gathered

    def _mean(self, blocks: Nodes, values: Values | None = None) -> Real:
        """Compute the weighted means at all blocks of values, or of ones, in some blocks."""
        means = self._means
        if is_short(blocks.size):
            self._sums[:] = np.bincount(blocks, values, self._sums.size)
        else:
            _sum_by_rows(means.field, blocks, values)
        means.transform()
        weighted: Real = means.field
        return weighted


class LevelPreconditioner(Preconditioner):
    """The approximate inverse of an H whose displacements have no mean, on any subset of nodes.

    The inverse gives a mean infinite energy, so that the extension E must have none: off the set,
    a constant is added that brings the sum over the patch to zero. With the indicator 1 of the set,
    k nodes outside, e = E^T 1, h = E^T C^-1 1 and g = 1^T C^-1 1, this adds
    (h e^T + e h^T) / k + g e e^T / k^2 to E^T C^-1 E. Where both sides are whole blocks, all
    eigenvalues of M H then lie between 1 and 2 on rough surfaces, whatever the share in contact;
    without it one of them goes to zero as the contact fills the patch. With other sides C belongs
    to a larger patch, whose mean is another one, so that one eigenvalue still falls, to a few
    hundredths at 98 % (`tests/bem/test_interface.py`).
    """

    def restricted_to(self, some: Nodes) -> Callable[[Values], Values]:
        """Return the approximate inverse on nodes[some], which is symmetric positive definite."""
        plain = super().restricted_to(some)
        outside = self._inverse.field.size - len(some)
        if not len(some) or not outside:
            return lambda residual: plain(residual) + float(residual.mean() if len(some) else 0)
        places, blocks, weights = self._extension(some)
        field = self._inverse.field.reshape(-1)
        field.fill(1)
        summed = self._gather(places, blocks, weights)
        field.fill(0)
        field[places] = 1
        self._inverse.transform()
        stiffness = float(field[places].sum(dtype=np.float64))
        pressed = self._gather(places, blocks, weights)
        pressed += 0.5 * stiffness / outside * summed

        def precondition(residual: Values) -> Values:
            correction = plain(residual)
            correction += inner(summed, residual) / outside * pressed
            correction += inner(pressed, residual) / outside * summed
            return correction

        return precondition


def half_space_preconditioner(
    shape: tuple[int, int],
    kernel: Kernel,
    aspect: float,
    nodes: Nodes,
    dtype: str = "float32",
) -> Preconditioner:
    """Return the approximate inverse of H of a free patch on any subset of a list of nodes.

    Parameters
    ----------
    shape : tuple of int
        Nodes (nx, ny) of the grid.
    kernel : str
        Influence coefficients, see `bem.influence.influence_coefficients`.
    aspect : float
        Second side of a cell over its first [1].
    nodes : ndarray, shape (m,)
        Flat indices of the nodes in the list.
    dtype : str
        Precision, "float32", or "float64" to measure the difference.
    """
    widened = whole_blocks(shape[0]), shape[1]
    inverse = circulant_inverse(widened, kernel, aspect, dtype)
    means = kept_filter(_make_block_means, widened, aspect, dtype)
    return Preconditioner(shape, nodes, inverse, means)


def whole_blocks(nodes: int) -> int:
    """Return the nodes of whole blocks that hold some nodes along an axis."""
    return -(-nodes // BLOCK) * BLOCK


def circulant_inverse(
    shape: tuple[int, int], kernel: Kernel, aspect: float = 1.0, dtype: str = "float32"
) -> Filter:
    """Return the inverse of the circulant nearest to H in the Frobenius norm (T. Chan 1988).

    Its transforms run on a grid hardly wider than (nx, ny), a quarter of the grid that H needs.

    Parameters
    ----------
    shape : tuple of int
        Nodes (nx, ny) of the grid.
    kernel : str
        Influence coefficients, see `bem.influence.influence_coefficients`.
    aspect : float
        Second side of a cell over its first [1].
    dtype : str
        Precision, "float32" or "float64".

    Returns
    -------
    Filter
        Maps an (nx, ny) displacement to an (nx, ny) pressure [E* / first side of a cell]. All
        callers on one thread share it.
    """
    return kept_filter(_make_circulant_inverse, shape, kernel, aspect, dtype)


def _sum_by_rows(field: Real, blocks: Nodes, values: Values | None) -> None:
    """Set a field to the sums of values, or to the number of them, in each of its blocks.

    Nodes that lie in the same block add up in their order. The list of nodes is cut where rows of
    blocks begin.

    Parameters
    ----------
    field : ndarray, shape (rows, columns)
        The sums.
    blocks : ndarray, shape (a,)
        Flat index of each node's block; rows of blocks must not descend.
    values : ndarray, shape (a,), or None
        A value for each node, None for ones.
    """
    rows, columns = field.shape
    many = max(piece_length(blocks.size) * rows // blocks.size, 1)
    firsts = list(range(0, rows, many))
    bounds = [
        *(bisect_left(blocks, first, key=lambda block: block // columns) for first in firsts),
        blocks.size,
    ]

    def add_up(number: int) -> None:
        first, some = firsts[number], slice(bounds[number], bounds[number + 1])
        here = field[first : first + many]
        within = blocks[some] - columns * first
        weights = None if values is None else values[some]
        sums = np.bincount(within, weights=weights, minlength=here.size)
        here[:] = sums.reshape(here.shape)

    workers().share(add_up, range(len(firsts)))


@lru_cache(maxsize=16)
def _all_blocks(shape: tuple[int, int]) -> Nodes:
    """Tabulate the blocks of all entries of a small field."""
    blocks = np.arange(shape[0] * shape[1] // BLOCK**2).reshape(-1, shape[1] // BLOCK)
    return blocks.repeat(BLOCK, axis=0).repeat(BLOCK, axis=1).reshape(-1)


@lru_cache(maxsize=8)
def _all_columns(columns: int) -> Nodes:
    """Tabulate the columns of blocks that the columns of a field lie in."""
    return np.arange(columns) // BLOCK


def _fill_blocks(field: Real, values: Real) -> None:
    """Set every node of a block to the block's value."""
    rows = field.reshape(len(values), BLOCK, -1)
    if field.size < SHORT:
        rows[:] = values.repeat(BLOCK, axis=1)[:, np.newaxis]
        return

    columns = _all_columns(field.shape[1])

    def fill(some: slice) -> None:  # `repeat` would not let other threads go on
        rows[some] = values[some].take(columns, axis=1, mode="clip")[:, np.newaxis]

    each_row(fill, len(values), BLOCK * field.shape[1])


def block_sums(field: Real, factors: Real | None = None) -> Real:
    """Sum a field, times factors, by whole rows and columns because a block's axes are short."""
    blocks = field.reshape(-1, BLOCK, field.shape[1])
    weights = None if factors is None else factors.reshape(blocks.shape)
    sums = np.empty((len(blocks), field.shape[1] // BLOCK), field.dtype)

    def add_up(some: slice) -> None:
        if weights is None:
            rows = np.add.reduce(blocks[some], axis=1)
        else:
            rows = np.einsum("ijk,ijk->ik", blocks[some], weights[some])
        np.add(rows[:, ::BLOCK], rows[:, 1::BLOCK], out=sums[some])
        for node in range(2, BLOCK):
            sums[some] += rows[:, node::BLOCK]

    each_row(add_up, len(blocks), field.shape[1])  # what is summed fits into the cache
    return sums


def _periods(shape: tuple[int, int]) -> tuple[int, int]:
    """Return even periods of whole blocks, at least (nx, ny), that FFTW transforms fast."""
    return _fast_length(shape[0]), _fast_length(shape[1])


def _fast_length(nodes: int) -> int:
    """Return a multiple of 16; long ones have no factor of 3, which would save FFTW no time."""
    if nodes <= 256:
        return 16 * int(fft.next_fast_len(-(-nodes // 16), real=True))
    return min(odd << (-(-nodes // odd) - 1).bit_length() for odd in (1, 5, 25))


def _make_circulant_inverse(
    shape: tuple[int, int], kernel: Kernel, aspect: float, dtype: str
) -> Filter:
    """Tabulate the spectrum of the circulant's inverse."""
    periods = _periods(shape)
    table = influence_coefficients(periods, kernel, aspect)
    for axis, period in enumerate(periods):
        # Along an axis c_k = ((m - k) t_k + k t_(m - k)) / m, the mean over a wrapped diagonal.
        steps = np.arange(period)
        share = (steps / period).reshape([-1 if a == axis else 1 for a in (0, 1)])
        table = (1 - share) * table + share * np.take(table, -steps % period, axis=axis)
    return Filter(shape, 1 / fft.rfft2(table).real, dtype)


def _make_block_means(shape: tuple[int, int], aspect: float, dtype: str) -> Filter:
    """Tabulate the spectrum of weighted means over blocks, with the circulant's periods."""
    rows, columns = (period // BLOCK for period in _periods(shape))
    return Filter((shape[0] // BLOCK, columns), block_means((rows, columns), aspect), dtype)


def block_means(blocks: tuple[int, int], aspect: float) -> Field:
    """Compute the spectrum of weighted means over blocks that repeat themselves.

    Parameters
    ----------
    blocks : tuple of int
        Blocks along both axes.
    aspect : float
        Second side of a cell over its first [1].

    Returns
    -------
    ndarray, shape (rows, columns // 2 + 1)
        The spectrum of the weights, which add up to one for a mean.
    """
    along, across = (np.minimum(np.arange(many), -np.arange(many) % many) for many in blocks)
    distance = np.hypot(along[:, np.newaxis], aspect * across)
    distance[0, 0] = 1
    weights = distance**-DECAY
    weights[0, 0] = OWN_BLOCK * min(aspect, 1.0) ** -DECAY
    weights /= weights.sum() * BLOCK**2
    spectrum: Field = fft.rfft2(weights).real
    return spectrum
