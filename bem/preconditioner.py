"""An approximate inverse of the influence matrix of any set of nodes: a circulant, extended.

With C a circulant near H on the whole grid, the inverse of C_AA on a set A is the least of
v^T C^-1 v over all fields v that equal the residual on A. To take zero outside of A, as is
usual, overestimates it the more the more broken up A is, with a condition number that grows like
the number of nodes a side. Here v continues the residual by weighted means of its values near by,
and M = E^T C^-1 E with that extension E keeps it near 4 on rough surfaces of any size
(`tests/bem/test_preconditioner.py` measures it).
"""

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from bem.convolution import Filter, Real, kept_filter
from bem.influence import Kernel, influence_coefficients

Values = NDArray[np.float64]
Nodes = NDArray[np.intp]

# Means are taken of blocks of this many nodes a side, weighted by distance^-DECAY between blocks,
# by OWN_BLOCK times that of a neighbour within, and by VACANT for all nodes that are not in the
# set: far from the set the extension falls to zero. Chosen by the conjugate gradients' iterations
# on the paper's surfaces, k = 7 to 9, at 1, 10 and 50 % contact; none of them matters much.
BLOCK = 4
DECAY = 2.5
OWN_BLOCK = 10.0
VACANT = 0.05


class Preconditioner:
    """The approximate inverse for sets of nodes out of a list.

    Parameters
    ----------
    shape : (nx, ny) nodes of the grid
    kernel, aspect : see `bem.influence.influence_coefficients`
    nodes : (m,) flat indices of the nodes of the list
    dtype : "float32", or "float64" to see what single precision does
    """

    def __init__(
        self,
        shape: tuple[int, int],
        kernel: Kernel,
        aspect: float,
        nodes: Nodes,
        dtype: str = "float32",
    ) -> None:
        widened = -(-shape[0] // BLOCK) * BLOCK, shape[1]
        self._inverse = circulant_inverse(widened, kernel, aspect, dtype)
        self._means = kept_filter(_make_block_means, widened, aspect, dtype)
        self._places = self._inverse.places(nodes)
        self._blocks = _block_of_places(self._inverse.field.shape)[self._places]

    def restricted_to(self, some: Nodes) -> Callable[[Values], Values]:
        """The approximate inverse on nodes[some], (a,) -> (a,): symmetric, positive definite."""
        places, blocks = self._places[some], self._blocks[some]
        weights = 1 / (self._mean(blocks, np.ones(len(blocks))) + VACANT)
        inverse, means = self._inverse, self._means
        field = inverse.field.reshape(-1)

        def precondition(residual: Values) -> Values:
            _fill_blocks(inverse.field, weights * self._mean(blocks, residual))
            field[places] = residual
            inverse.transform()
            correction: Values = field[places].astype(np.float64)
            field[places] = 0
            np.multiply(weights, _block_sums(inverse.field), out=means.field)
            means.transform()
            correction += means.field.reshape(-1)[blocks]
            return correction

        return precondition

    def _mean(self, blocks: Nodes, values: Values) -> Real:
        """Weighted means of values in some blocks, nothing elsewhere, at all blocks."""
        means = self._means
        sums = np.bincount(blocks, weights=values, minlength=means.field.size)
        means.field[:] = sums.reshape(means.shape)
        means.transform()
        found: Real = means.field
        return found


def circulant_inverse(
    shape: tuple[int, int], kernel: Kernel, aspect: float = 1.0, dtype: str = "float32"
) -> Filter:
    """Inverse of the circulant matrix next to H in the Frobenius norm (T. Chan 1988).

    Works on a grid hardly wider than (nx, ny), about a quarter of what H needs.

    Parameters
    ----------
    shape : (nx, ny) nodes
    kernel, aspect : see `bem.influence.influence_coefficients`
    dtype : "float32" or "float64"

    Returns
    -------
    Filter of (nx, ny) displacement into (nx, ny) pressure [E* / first side of a cell]; shared
    between its callers on one thread
    """
    return kept_filter(_make_circulant_inverse, shape, kernel, aspect, dtype)


@lru_cache(maxsize=8)
def _block_of_places(shape: tuple[int, int]) -> Nodes:
    """The flat block that each entry of a flat field lies in."""
    blocks = np.arange(shape[0] * shape[1] // BLOCK**2).reshape(-1, shape[1] // BLOCK)
    return blocks.repeat(BLOCK, axis=0).repeat(BLOCK, axis=1).reshape(-1)


def _fill_blocks(field: Real, values: Real) -> None:
    """Set every node of a block to the block's value."""
    rows = field.reshape(len(values), BLOCK, -1)
    rows[:] = np.repeat(values, BLOCK, axis=1)[:, np.newaxis]


def _block_sums(field: Real) -> Real:
    """Sums over blocks, by whole rows and columns at a time: the axes of a block are short."""
    rows = np.array(field[::BLOCK])
    for node in range(1, BLOCK):
        rows += field[node::BLOCK]
    sums = np.array(rows[:, ::BLOCK])
    for node in range(1, BLOCK):
        sums += rows[:, node::BLOCK]
    return sums


def _periods(shape: tuple[int, int]) -> tuple[int, int]:
    """Periods of at least (nx, ny) that FFTW transforms fast: whole blocks, and even."""
    return _fast_length(shape[0]), _fast_length(shape[1])


def _fast_length(nodes: int) -> int:
    """Multiples of 16; the longer ones without a factor of 3, which saves FFTW no time."""
    if nodes <= 256:
        return 16 * int(fft.next_fast_len(-(-nodes // 16), real=True))
    return min(odd << (-(-nodes // odd) - 1).bit_length() for odd in (1, 5, 25))


def _make_circulant_inverse(
    shape: tuple[int, int], kernel: Kernel, aspect: float, dtype: str
) -> Filter:
    periods = _periods(shape)
    table = influence_coefficients(periods, kernel, aspect)
    for axis, period in enumerate(periods):
        # Per axis c_k = ((m - k) t_k + k t_(m - k)) / m: the mean over each wrapped diagonal.
        steps = np.arange(period)
        share = (steps / period).reshape([-1 if a == axis else 1 for a in (0, 1)])
        table = (1 - share) * table + share * np.take(table, -steps % period, axis=axis)
    return Filter(shape, 1 / fft.rfft2(table).real, dtype)


def _make_block_means(shape: tuple[int, int], aspect: float, dtype: str) -> Filter:
    """Means over blocks of a field whose rows are whole blocks, as long as the circulant's."""
    rows, columns = (period // BLOCK for period in _periods(shape))
    steps = (
        np.minimum(np.arange(blocks), -np.arange(blocks) % blocks) for blocks in (rows, columns)
    )
    along, across = next(steps), next(steps)
    distance = np.hypot(along[:, np.newaxis], aspect * across)
    distance[0, 0] = 1
    weights = distance**-DECAY
    weights[0, 0] = OWN_BLOCK * min(aspect, 1.0) ** -DECAY
    weights /= weights.sum() * BLOCK**2
    return Filter((shape[0] // BLOCK, columns), fft.rfft2(weights).real, dtype)
