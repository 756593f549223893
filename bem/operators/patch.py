"""The influence matrix H of all nodes of a grid, and an approximate inverse on any set of them.

Lengths are in units of the cell's first side and E* = 1. The nodes of a free patch displace one
another by `bem.influence.influence_coefficients`. A patch without edges repeats itself or its
mirror images without end: a wave of pressure p with the wave number q displaces it by 2 p / (E*
|q|) (Johnson 1985, section 13.2), and the mean pressure displaces nothing. What the mean does to
the far field depends on the body behind, so that displacements count from the mean of the deformed
surface.

The approximate inverse. Let C be near H on the whole grid and easily inverted. The inverse of C_AA
on a set A is the minimum of v^T C^-1 v over all fields v that equal the residual on A. The usual
choice of zero outside A overestimates this minimum, the more so the more fragmented A is, and the
condition number then grows like the number of nodes a side. Here v continues the residual by
weighted means of its values nearby, block by block. With this extension E, the condition number of
M = E^T C^-1 E stays near 4 on rough surfaces of any size
(`tests/bem/operators/test_patch.py` measures it).
"""

import math
from functools import lru_cache
from typing import Any

import numpy as np
from scipy import fft

from bem.arrays import Field, Mask, Nodes, Real
from bem.influence import InfluenceMatrix, Kernel, influence_coefficients
from bem.operators.filters import (
    LARGE,
    CosineFilter,
    FieldFilter,
    filtered,
    kept,
    spectral_filter,
)
from bem.problem import Boundary
from bem.threads import threads_here

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
VACANT = np.float32(0.05)

# Penalty for the distance of both pressures of a splitting, over the geometric mean of the stiffest
# and the softest wave's compliance. Shares from 0.3 to 1 take about as many passes, 3 three times
# as many.
PENALTY = 0.5

# Largest contact set worth factorising, as a factor and a power of the number of nodes: the cost of
# a factor grows with the cube of the set, that of iterations with the grid (`pytest bench -k
# few_in_contact`). The least of several counts.
FEW_FREE, FEW_EDGELESS = ((27.0, 1 / 3),), ((0.105, 5 / 6), (9.0, 0.4))

# Share of all nodes up to which vectors of a contact set hold its nodes alone: reading listed nodes
# takes about as long as ten passes over as many whole values.
LISTED = 0.12

# Rows of blocks that are corrected at a time.
BAND = 32

# Rows of a dense matrix that are tabulated at a time: they fit into the cache.
ROWS = 64


class Patch:
    """The influence matrix of a grid: it displaces, and corrects pressures on a contact set.

    Search directions go through single precision, because the next direction corrects their last
    digits. Displacements that decide on convergence go through double precision.

    Parameters
    ----------
    shape : tuple of int
        Nodes (nx, ny) of the grid.
    boundary : str
        "free", "periodic" or "mirror".
    kernel : str
        Influence coefficients of a free patch, see `bem.influence.influence_coefficients`.
    aspect : float
        Second side of a cell over its first [1].
    give : float
        How far a compliant far field gives way under a unit load, 0 if it is rigid: one term of
        the matrix, H - give.

    Attributes
    ----------
    norm : float
        Upper bound of the matrix's largest eigenvalue.
    few : int
        Largest contact set worth factorising.
    soft : bool
        Whether a displacement may barely fix the load: on a compliant far field near Delta*, or
        without edges near full contact.
    convolutions : int
        Applications of the matrix so far.
    contact : ndarray of bool, shape (nx, ny)
        The contact set that was taken last.
    count : int
        Number of its nodes.
    within : ndarray, shape (nx, ny)
        The set as factors 1 and 0 of fields, unless it is small: of small fields in their own
        precision, which takes a third of the time, of large ones in as little memory as can be.
    singular : bool
        Whether it is all of a patch without edges.
    """

    contact: Mask
    within: Real | Mask

    def __init__(
        self,
        shape: tuple[int, int],
        boundary: Boundary,
        kernel: Kernel,
        aspect: float,
        give: float = 0.0,
    ) -> None:
        self.shape, self.boundary, self.give = shape, boundary, give
        self._cells = shape, kernel, aspect
        self._exact, self._rough = (
            displacement_filter(shape, boundary, kernel, aspect, dtype)
            for dtype in ("float64", "float32")
        )
        self._inverse = _inverse_filter(shape, boundary, kernel, aspect)
        self._means = _means_filter(shape, boundary, aspect)
        self.norm = self._exact.largest
        limits = FEW_FREE if boundary == "free" else FEW_EDGELESS
        self.few = min(
            int(factor * (shape[0] * shape[1]) ** power) for factor, power in limits
        )
        self.soft = give != 0 or boundary != "free"
        self.convolutions, self.count, self.singular = 0, 0, False
        self._outside = np.zeros((0, 0), np.float32)
        self._listed: tuple[Nodes, Nodes] | None = None

    def displace(self, pressure: Real, *, exactly: bool = False) -> Real:
        """Compute the (nx, ny) displacement by a field or by values of `in_contact`.

        It is right to 1e-7, or in double precision; the next call overwrites it.
        """
        self.convolutions += 1
        by = self._exact if exactly else self._rough
        displacement = self._put(pressure, by.field)
        by.transform()
        if self.give:
            given_way = self.give * float(pressure.sum(dtype=np.float64))
            displacement -= displacement.dtype.type(given_way)
        return displacement

    def _put(self, values: Real, buffer: Real) -> Real:
        """Write a field, or values of `in_contact`, among zeros, and return the field's part."""
        rows, columns = self.shape
        buffer[rows:], buffer[:, columns:] = 0, 0
        inside: Real = buffer[:rows, :columns]
        if values.ndim == 1:
            inside.fill(0)
            inside[self._listed] = values
        else:
            inside[:] = values
        return inside

    def take_contact(self, nodes: Mask) -> None:
        """Take a set of nodes, an (nx, ny) mask, for `in_contact` and `correct`."""
        self.contact, self.count = nodes, int(np.count_nonzero(nodes))
        self.singular = self.boundary != "free" and self.count == nodes.size
        means, self._listed = self._means, None
        if self.count <= LISTED * nodes.size:
            rows, columns = self._listed = np.divmod(np.flatnonzero(nodes), self.shape[1])
            self._blocks = rows // BLOCK * means.shape[1] + columns // BLOCK
            self._sum_listed(None)
        else:
            if not self._outside.size:
                self._outside = np.ones(self._inverse.field.shape, np.float32)
            np.logical_not(nodes, out=self._outside[: self.shape[0], : self.shape[1]])
            self.within = nodes.astype(np.float32) if nodes.size < LARGE else nodes
            means.field[:] = BLOCK**2 - _block_sums(self._outside)
        means.transform()
        self._weights = 1 / (means.field + VACANT)

    def _sum_listed(self, values: Real | None) -> None:
        """Sum values of listed nodes over blocks, or count the nodes."""
        size = self._means.field.size
        self._means.field.reshape(-1)[:] = np.bincount(
            self._blocks, values, minlength=size
        )

    def in_contact(self, field: Real) -> Real:
        """Return the values of an (nx, ny) field on the contact set, as `correct` takes them.

        Returns
        -------
        ndarray of float32, shape (n,) or (nx, ny)
            The values of the n nodes of a small set, else the field with zeros outside.
        """
        if self._listed is not None:
            values: Real = field[self._listed].astype(np.float32, copy=False)
            return values
        return np.multiply(field, self.within, dtype=np.float32, casting="same_kind")

    def add_to(self, field: Real, values: Real) -> None:
        """Add values of `in_contact` to an (nx, ny) field."""
        if self._listed is None:
            field += values
        else:
            field[self._listed] += values

    def correct(self, residual: Real) -> Real:
        """Apply the approximate inverse to a residual in contact, as `in_contact` returns it.

        Returns
        -------
        ndarray of float32, shape (n,) or (nx, ny)
            Correction of the pressure, zero outside; the next call overwrites it.
        """
        field, means, outside = self._inverse.field, self._means, self._outside
        listed, width = self._listed, self._inverse.field.shape[1]
        blocks = field.reshape(-1, BLOCK, width)
        if listed is None:
            inside = self._put(residual, field)
            means.field[:] = _block_sums(field)
        else:
            self._sum_listed(residual)
        means.transform()
        means.field[:] *= self._weights
        columns = means.field.repeat(BLOCK, axis=1)[:, np.newaxis]
        if listed is None:
            vacant = outside.reshape(-1, BLOCK, width)
            for first in range(
                0, len(blocks), BAND
            ):  # so that what is added stays in the cache
                some = slice(first, first + BAND)
                blocks[some] += vacant[some] * columns[some]
        else:
            blocks[:] = columns
            field[listed] = residual
        self._inverse.transform()
        if listed is None:
            means.field[:] = self._weights * _block_sums(field, outside)
            means.transform()
            blocks += means.field.repeat(BLOCK, axis=1)[:, np.newaxis]
            inside *= self.within
            return inside
        corrected: Real = field[listed]
        everywhere = _block_sums(field)
        self._sum_listed(corrected)
        means.field[:] = self._weights * (everywhere - means.field)
        means.transform()
        corrected += means.field.reshape(-1)[self._blocks]
        return corrected

    def unbalanced(self, displacement: Field) -> Field:
        """Compute the zero-mean pressure whose displacement equals the given one but for a mean."""
        inverse = edgeless_filter(
            self.shape, self.boundary, self._cells[2], "float64", True
        )
        pressure: Field = filtered(inverse, displacement).copy()
        return pressure

    def splitting(self) -> tuple[FieldFilter, float] | None:
        """Return (H + c)^-1 of a patch without edges as a filter, and c; None for a free patch.

        The penalty c is a share of the geometric mean of the largest and the least compliance.
        """
        if self.boundary == "free":
            return None
        grid = self.shape, self.boundary, self._cells[2]
        return _splitting_filter(*grid), _penalty(*grid)

    def entries(self, nodes: Nodes, dtype: str) -> Real:
        """Return the lower triangle of the (n, n) matrix of (n,) nodes, in Fortran's order."""
        if self.boundary == "free":
            return InfluenceMatrix(*self._cells, dtype).among(nodes, self.give)
        (nx, ny), mirrored, count = self.shape, self.boundary == "mirror", len(nodes)
        periods = (2 * nx, 2 * ny) if mirrored else (nx, ny)
        table, width = (
            _edgeless_coefficients(periods, self._cells[2], dtype),
            2 * periods[1],
        )
        rows, columns = np.divmod(nodes, ny)
        here = rows * width + columns + (periods[0] * width + periods[1])
        images = [(rows, columns)]
        if mirrored:
            images = [
                (along, across)
                for along in (rows, -1 - rows)
                for across in (columns, -1 - columns)
            ]
        matrix = np.zeros((count, count), dtype)
        for first in range(0, count, ROWS):
            some = slice(first, first + ROWS)
            for along, across in images:
                offsets = np.subtract.outer(here[some], (along * width + across)[first:])
                matrix[some, first:] += table.take(offsets, mode="clip")
        return matrix.T


def fast_period(nodes: int) -> int:
    """Return the smallest even period with small prime factors that a grid's kernel allows.

    The kernel is even, so that 2 nodes - 2 is exact, a power of two for 2^k + 1 nodes.
    """
    return 2 * int(fft.next_fast_len(max(nodes - 1, 1), real=True))


def wave_numbers(shape: tuple[int, int], boundary: Boundary, aspect: float) -> Field:
    """Return |q| of the waves that a patch without edges holds [1 / first side of a cell].

    Returns
    -------
    ndarray, shape (nx, ny // 2 + 1) or (nx, ny)
        In the order of a real Fourier transform if the patch repeats itself, of a cosine transform
        if its mirror images continue it.
    """
    if boundary == "periodic":
        along, across = fft.fftfreq(shape[0]), fft.rfftfreq(shape[1])
    else:
        along, across = (np.arange(cells) / (2 * cells) for cells in shape)
    length: Field = 2 * math.pi * np.hypot(along[:, np.newaxis], across / aspect)
    return length


@kept
def displacement_filter(
    shape: tuple[int, int], boundary: Boundary, kernel: Kernel, aspect: float, dtype: str
) -> FieldFilter:
    """Return H as a filter: of a free patch, a real transform of its even table.

    Parameters
    ----------
    shape, boundary, kernel, aspect
        See `Patch`.
    dtype : str
        Precision, "float64" or "float32".
    """
    if boundary != "free":
        return edgeless_filter(shape, boundary, aspect, dtype, False)
    if dtype == "float32":
        double: Any = displacement_filter(shape, "free", kernel, aspect, "float64")
        single: FieldFilter = double.in_single_precision()
        return single
    periods = fast_period(shape[0]), fast_period(shape[1])
    # Offsets beyond the grid never connect two nodes, so that any value will do there.
    along, across = (
        np.minimum(np.arange(period // 2 + 1), nodes - 1)
        for nodes, period in zip(shape, periods, strict=True)
    )
    table = influence_coefficients(shape, kernel, aspect)[along[:, np.newaxis], across]
    return spectral_filter(shape, _even_spectrum(table), dtype, periods)


def _even_spectrum(quarter: Field) -> Field:
    """Transform a table that is even along both axes, from the entries up to half its periods."""
    spectrum: Field = fft.dctn(quarter, type=1, overwrite_x=True, workers=threads_here())
    return spectrum


@kept
def edgeless_filter(
    shape: tuple[int, int], boundary: Boundary, aspect: float, dtype: str, inverse: bool
) -> FieldFilter:
    """Return H of a patch without edges, or its inverse on fields of zero mean, as a filter.

    It is 2 / |q|, and zero for the mean; or |q| / 2.
    """
    if inverse:
        spectrum = wave_numbers(shape, boundary, aspect) / 2
    else:
        spectrum = _compliances(shape, boundary, aspect)
    return _even_filter(shape, boundary, spectrum, dtype)


def _compliances(shape: tuple[int, int], boundary: Boundary, aspect: float) -> Field:
    """Return 2 / |q| of the waves of a patch without edges, and zero for the mean."""
    numbers = wave_numbers(shape, boundary, aspect)
    numbers[0, 0] = math.inf
    compliances: Field = 2 / numbers
    return compliances


def _penalty(shape: tuple[int, int], boundary: Boundary, aspect: float) -> float:
    """Return the penalty of `Patch.splitting`."""
    waves = _compliances(shape, boundary, aspect)
    waves = waves[waves > 0]
    return PENALTY * math.sqrt(waves.min() * waves.max()) if waves.size else 1.0


@kept
def _splitting_filter(
    shape: tuple[int, int], boundary: Boundary, aspect: float
) -> FieldFilter:
    """Tabulate 1 / (2 / |q| + c)."""
    waves = _compliances(shape, boundary, aspect) + _penalty(shape, boundary, aspect)
    return _even_filter(shape, boundary, 1 / waves, "float64")


def _even_filter(
    shape: tuple[int, int], boundary: Boundary, spectrum: Field, dtype: str
) -> FieldFilter:
    """Return the filter of a patch without edges that has a spectrum."""
    if boundary == "mirror":
        return CosineFilter(spectrum, dtype)
    return spectral_filter(shape, spectrum[: shape[0] // 2 + 1], dtype, shape)


@kept
def _inverse_filter(
    shape: tuple[int, int], boundary: Boundary, kernel: Kernel, aspect: float
) -> FieldFilter:
    """Tabulate the inverse of a matrix near H.

    For a free patch it is the circulant nearest to H in the Frobenius norm (T. Chan 1988), on a
    grid hardly wider than the patch, a quarter of the grid that H needs. Without edges it is H
    itself where both sides are whole blocks, else that of the next larger patch.
    """
    rows, columns = map(_whole_blocks, shape)
    if boundary != "free":
        return edgeless_filter((rows, columns), boundary, aspect, "float32", True)
    periods = _fast_length(rows), _fast_length(shape[1])
    table = influence_coefficients(periods, kernel, aspect)
    for period in periods:
        # Along an axis c_k = ((m - k) t_k + k t_(m - k)) / m, the mean over a wrapped diagonal.
        half = period // 2 + 1
        share = (np.arange(half) / period)[:, np.newaxis]
        folded = (1 - share) * table[:half]
        folded[1:] += share[1:] * table[: period - half : -1]
        table = folded.T  # the other axis next
    return spectral_filter(
        (rows, periods[1]), 1 / _even_spectrum(table), "float32", periods
    )


@kept
def _means_filter(
    shape: tuple[int, int], boundary: Boundary, aspect: float
) -> FieldFilter:
    """Tabulate the spectrum of weighted means over the blocks of the approximate inverse."""
    rows, columns = _whole_blocks(shape[0]) // BLOCK, _whole_blocks(shape[1]) // BLOCK
    if boundary == "free":
        repeating = _fast_length(BLOCK * rows) // BLOCK, _fast_length(shape[1]) // BLOCK
        spectrum = _block_means(repeating, aspect)[: repeating[0] // 2 + 1]
        return spectral_filter((rows, repeating[1]), spectrum, "float32", repeating)
    spectrum = _block_means((rows, columns), aspect)
    if boundary == "mirror":
        spectrum = _block_means((2 * rows, 2 * columns), aspect)[:rows, :columns]
    return _even_filter((rows, columns), boundary, spectrum, "float32")


def _block_means(blocks: tuple[int, int], aspect: float) -> Field:
    """Compute the spectrum of weighted means over blocks that repeat themselves.

    The weights add up to one for a mean. Its shape is (rows, columns // 2 + 1).
    """
    along, across = (
        np.minimum(np.arange(many), -np.arange(many) % many) for many in blocks
    )
    distance = np.hypot(along[:, np.newaxis], aspect * across)
    distance[0, 0] = 1
    weights = distance**-DECAY
    weights[0, 0] = OWN_BLOCK * min(aspect, 1.0) ** -DECAY
    weights /= weights.sum() * BLOCK**2
    spectrum: Field = fft.rfft2(weights).real
    return spectrum


def _whole_blocks(nodes: int) -> int:
    """Return the nodes of whole blocks that hold some nodes along an axis."""
    return -(-nodes // BLOCK) * BLOCK


def _fast_length(nodes: int) -> int:
    """Return a multiple of 16; long ones have no factor of 3, which would save FFTW no time."""
    if nodes <= 256:
        return 16 * int(fft.next_fast_len(-(-nodes // 16), real=True))
    return min(odd << (-(-nodes // odd) - 1).bit_length() for odd in (1, 5, 25))


def _block_sums(field: Real, factors: Real | None = None) -> Real:
    """Sum a field, times factors, by whole rows and columns because a block's axes are short."""
    blocks = field.reshape(-1, BLOCK, field.shape[1])
    if factors is None:
        rows = np.add.reduce(blocks, axis=1)
    else:
        rows = np.einsum("ijk,ijk->ik", blocks, factors.reshape(blocks.shape))
    sums: Real = rows[:, ::BLOCK] + rows[:, 1::BLOCK]
    for node in range(2, BLOCK):
        sums += rows[:, node::BLOCK]
    return sums


@lru_cache(maxsize=4)
def _edgeless_coefficients(periods: tuple[int, int], aspect: float, dtype: str) -> Real:
    """Tabulate the displacement by a unit pressure that repeats itself, for offsets either way."""
    symbol = wave_numbers(periods, "periodic", aspect) / 2
    symbol[0, 0] = math.inf
    table = fft.irfft2(1 / symbol, s=periods).astype(dtype)
    twice = np.tile(table, (2, 2)).reshape(-1)
    twice.setflags(write=False)
    return twice
