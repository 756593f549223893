"""An approximate inverse of the influence matrix of any set of nodes, from an extended circulant.

Let C be a circulant near H on the whole grid. The inverse of C_AA on a set A is the minimum of
v^T C^-1 v over all fields v that equal the residual on A. The usual choice of zero outside A
overestimates this minimum, the more so the more fragmented A is, and the condition number then
grows like the number of nodes a side. Here v continues the residual by weighted means of its values
nearby. With this extension E, the condition number of M = E^T C^-1 E stays near 4 on rough surfaces
of any size (`tests/bem/test_preconditioner.py` measures it).
"""

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from scipy import fft

from bem.arrays import Nodes, Real, Values
from bem.convolution import Filter, kept_filter
from bem.influence import Kernel, influence_coefficients

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
    kernel : str
        Influence coefficients, see `bem.influence.influence_coefficients`.
    aspect : float
        Second side of a cell over its first [1].
    nodes : ndarray, shape (m,)
        Flat indices of the nodes in the list.
    dtype : str
        Precision, "float32", or "float64" to measure the difference.
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
        """Return the approximate inverse on nodes[some], which is symmetric positive definite."""
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
        """Compute the weighted means at all blocks of values that lie in some blocks."""
        means = self._means
        sums = np.bincount(blocks, weights=values, minlength=means.field.size)
        means.field[:] = sums.reshape(means.shape)
        means.transform()
        weighted: Real = means.field
        return weighted


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


@lru_cache(maxsize=8)
def _block_of_places(shape: tuple[int, int]) -> Nodes:
    """Return the flat index of the block that every entry of a flat field lies in."""
    blocks = np.arange(shape[0] * shape[1] // BLOCK**2).reshape(-1, shape[1] // BLOCK)
    return blocks.repeat(BLOCK, axis=0).repeat(BLOCK, axis=1).reshape(-1)


def _fill_blocks(field: Real, values: Real) -> None:
    """Set every node of a block to the block's value."""
    rows = field.reshape(len(values), BLOCK, -1)
    rows[:] = np.repeat(values, BLOCK, axis=1)[:, np.newaxis]


def _block_sums(field: Real) -> Real:
    """Sum over blocks, by whole rows and columns at a time because a block's axes are short."""
    rows = np.array(field[::BLOCK])
    for node in range(1, BLOCK):
        rows += field[node::BLOCK]
    sums = np.array(rows[:, ::BLOCK])
    for node in range(1, BLOCK):
        sums += rows[:, node::BLOCK]
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
