"""The influence matrix H of all nodes of a grid, and an approximate inverse on any set of them.

Lengths are in units of the cell's first side, and E* = 1. The matrix itself is that of
`bem.operators.displacement`. A patch without edges repeats itself or its mirror images without end,
and its mean pressure displaces it by the mean compliance. This is 0 for half-spaces: the effect of
the mean on the far field depends on the structure behind, so that displacements are measured from
the mean of the deformed surface.

The approximate inverse on a set A of nodes replaces H by a matrix C that is near H on the whole
grid and easily inverted. The quadratic form of the inverse of C_AA is the minimum of v^T C^-1 v
over all fields v that equal the residual on A. The usual choice, v = 0 outside A, overestimates
this minimum, the more so the more fragmented A is, and the condition number then grows in
proportion to the number of nodes a side. Here v continues the residual outside A by weighted means
of its values nearby, block by block. With this extension E, the condition number of
M = E^T C^-1 E stays near 4 on rough surfaces of any size (`tests/bem/operators/test_patch.py`
measures it).
"""

import math
from functools import lru_cache
from typing import Any

import numpy as np
from scipy import fft

from bem.arrays import Field, Mask, Nodes, Real
from bem.bodies import Body
from bem.influence import InfluenceMatrix, influence_coefficients
from bem.operators.displacement import (
    compliances,
    displacement_filter,
    edgeless_filter,
    even_spectrum,
    pressure_filter,
    stiffnesses,
)
from bem.operators.filters import LARGE, FieldFilter, filtered, kept, spectral_filter
from bem.problem import Boundary

# `BLOCK`, `DECAY`, `OWN_BLOCK` and `VACANT` were chosen by the number of iterations of conjugate
# gradients on the paper's surfaces of 129 to 513 nodes a side, at 1, 10 and 50 % contact.

# Nodes a side of the blocks whose means extend the residual.
BLOCK = 4

# Power of the inverse distance between blocks that is the weight of a block in a mean [1]. Solves
# take up to 118 % more iterations if it is halved, and up to 29 % more if it is doubled
# (`python -m tests.ledger --halved bem.operators.patch.DECAY`).
DECAY = 2.5

# Weight of a node's own block over the weight of a neighbouring block [1]. Solves take up to 12 %
# fewer iterations if it is halved, and up to 16 % more if it is doubled
# (`python -m tests.ledger --halved bem.operators.patch.OWN_BLOCK`).
OWN_BLOCK = 10.0

# Weight of the value zero in the means, over the weight of all nodes together [1]. It lets the
# extension fall to zero far from the set.
VACANT = np.float32(0.05)

# `DECAY` and `VACANT` on bodies that are hardest at their surface, as a hard coating. Their
# stiffness rises with up to the third power of the wave number, so that a residual has to be
# continued farther, and by nearer blocks. Chosen on layers of two cells with a hundredfold modulus,
# on which they save a quarter of the convolutions.
DECAY_HARD = 3.5
VACANT_HARD = np.float32(0.01)

# Least compliance of waves of `LONG_WAVE` blocks, over that of a half-space of the body's surface,
# with which a body is among these [1].
HARDEST_ABOVE = 2.0
LONG_WAVE = 8

# Penalty for the difference of the two pressures of a splitting, over the geometric mean of the
# largest and the least compliance of a wave [1]. Values from 0.3 to 1 need about as many passes; 3
# needs three times as many.
PENALTY = 0.5

# Pairs (a, b) that bound the contact sets worth factorising: a set on a grid of n nodes may have
# a n^b nodes, for each of the pairs. The cost of a factor grows with the cube of the set's size,
# the cost of iterations with the size of the grid (`pytest bench -k few_in_contact`).
FEW_FREE = ((27.0, 1 / 3),)
FEW_EDGELESS = ((0.105, 5 / 6), (9.0, 0.4))

# Largest share of the grid's nodes in a contact set whose values are stored as a list; values on
# larger sets are stored as whole fields [1]. With 0.25, solves take up to 5 % less time, but one
# nearly full contact that yields does not converge
# (`pytest tests/bem/test_edgeless.py -k long_cells_that_yield_near_full`).
LISTED = 0.12

# Rows of blocks that are extended at a time, so that they stay in the cache.
BAND = 32

# Rows of a dense matrix that are tabulated at a time, so that they stay in the cache.
ROWS = 64


class Patch:
    """The influence matrix of a grid, with an approximate inverse on a contact set.

    Search directions are displaced in single precision, because the next direction corrects their
    last digits. Displacements that decide on convergence are computed in double precision.

    Parameters
    ----------
    shape : tuple of int
        Nodes (nx, ny) of the grid.
    boundary : str
        "free", "periodic" or "mirror".
    body : Body
        Reduced body, see `bem.bodies.Body.reduced`.
    aspect : float
        Second side of a cell over its first [1].
    give : float
        Displacement of a compliant far field under a unit load, 0 if it is rigid. It is subtracted
        from every entry of the matrix [first side of a cell x pressure / E*].

    Attributes
    ----------
    norm : float
        Upper bound of the largest eigenvalue of H [1 / E*].
    few : int
        Number of nodes of the largest contact set worth factorising.
    soft : bool
        Whether a displacement may barely fix the load: on a compliant far field near Delta*, or
        without edges near full contact.
    convolutions : int
        Number of applications of the matrix so far.
    contact : ndarray of bool, shape (nx, ny)
        Contact set of the last `take_contact`.
    count : int
        Number of its nodes.
    within : ndarray, shape (nx, ny)
        Factors 1 in the contact set and 0 outside, if the set is a large one. On small grids they
        are in single precision, which takes a third of the time, and on large grids they are bools,
        which take the least memory.
    mean_compliance : float
        Displacement of a patch without edges by a uniform pressure, over this pressure
        [first side of a cell / E*].
    singular : bool
        Whether the contact set is all of a patch without edges, and a uniform pressure displaces
        nothing there.
    """

    contact: Mask
    within: Real | Mask

    def __init__(
        self,
        shape: tuple[int, int],
        boundary: Boundary,
        body: Body,
        aspect: float,
        give: float = 0.0,
    ) -> None:
        self.shape = shape
        self.boundary = boundary
        self.give = give
        self.mean_compliance = body.mean_compliance
        self._body = body
        self._aspect = aspect
        self._exact = displacement_filter(shape, boundary, body, aspect, "float64")
        self._rough = displacement_filter(shape, boundary, body, aspect, "float32")
        self._inverse = _inverse_filter(shape, boundary, body, aspect)
        decay = DECAY
        self._vacant = VACANT
        if _is_hardest_above(body):
            decay = DECAY_HARD
            self._vacant = VACANT_HARD
        self._means = _means_filter(shape, boundary, aspect, decay)
        self.norm = self._exact.largest
        nodes = shape[0] * shape[1]
        limits = FEW_FREE if boundary == "free" else FEW_EDGELESS
        self.few = min(int(factor * nodes**power) for factor, power in limits)
        self.soft = give != 0 or boundary != "free"
        self.convolutions = 0
        self.count = 0
        self.singular = False
        # 1 at the nodes outside the set, and in the padding; empty until a large set is taken.
        self._outside = np.zeros((0, 0), np.float32)
        # Rows and columns of the nodes of a small set, None for a large one.
        self._listed: tuple[Nodes, Nodes] | None = None
        # Flat indices of the same nodes, by the number of columns of the array that they index.
        self._flat_listed: dict[int, Nodes] = {}

    def displace(self, pressure: Real, *, exactly: bool = False) -> Real:
        """Compute the displacement by a pressure, and count one convolution.

        Parameters
        ----------
        pressure : ndarray, shape (nx, ny) or (n,)
            Pressure as a field, or as values of `in_contact` [E*].
        exactly : bool
            Whether to compute in double precision, else to 1e-7.

        Returns
        -------
        ndarray, shape (nx, ny)
            Displacement [first side of a cell]. It is a view of a buffer that the next call
            overwrites. Patches of this shape share the buffer.
        """
        self.convolutions += 1
        matrix = self._exact if exactly else self._rough
        displacement = self._put(pressure, matrix.field)
        matrix.transform()
        if self.give:
            far_field = self.give * float(pressure.sum(dtype=np.float64))
            displacement -= displacement.dtype.type(far_field)
        return displacement

    def _put(self, values: Real, buffer: Real) -> Real:
        """Write values into the nodes of the grid in a buffer, and zeros everywhere else.

        The values are a field, (nx, ny), or those of a small contact set, (n,). Return a view of
        the (nx, ny) part of the buffer that the grid occupies.
        """
        rows, columns = self.shape
        buffer[rows:] = 0
        buffer[:, columns:] = 0
        inside: Real = buffer[:rows, :columns]
        if values.ndim == 1:
            inside.fill(0)
            flat, listed = self._flattened(buffer)
            flat[listed] = values
        else:
            inside[:] = values
        return inside

    def take_contact(self, nodes: Mask) -> None:
        """Set the contact set for `in_contact`, `add_to` and `correct`.

        Set the attributes `contact`, `count` and `singular`, and `within` for a large set.

        Parameters
        ----------
        nodes : ndarray of bool, shape (nx, ny)
            Nodes of the set. The mask is kept, and must not be changed while the set is in use.
        """
        self.contact = nodes
        self.count = int(np.count_nonzero(nodes))
        everywhere = self.boundary != "free" and self.count == nodes.size
        self.singular = everywhere and not self.mean_compliance > 0
        means = self._means
        self._listed = None
        if self.count <= LISTED * nodes.size:
            listed = np.flatnonzero(nodes)
            rows = listed // self.shape[1]
            columns = listed - rows * self.shape[1]  # faster than a remainder
            self._listed = rows, columns
            self._flat_listed = {self.shape[1]: listed}
            self._blocks = rows // BLOCK * means.shape[1] + columns // BLOCK
            self._sum_listed(None)
        else:
            if not self._outside.size:  # the first large set: 1 also in the padding
                self._outside = np.ones(self._inverse.field.shape, np.float32)
            np.logical_not(nodes, out=self._outside[: self.shape[0], : self.shape[1]])
            self.within = nodes.astype(np.float32) if nodes.size < LARGE else nodes
            means.field[:] = BLOCK**2 - _block_sums(self._outside)
        # The buffer holds counts of contact nodes by block. `transform` turns them into weighted
        # shares of contact nodes nearby.
        means.transform()
        self._weights = 1 / (means.field + self._vacant)

    def _sum_listed(self, values: Real | None) -> None:
        """Write the sum of the listed nodes' values in each block into the buffer of the means.

        Without values, write the number of listed nodes in each block.
        """
        size = self._means.field.size
        sums = np.bincount(self._blocks, values, minlength=size)
        self._means.field.reshape(-1)[:] = sums

    def _flattened(self, field: Real) -> tuple[Real, Any]:
        """Return a view of a field, and the index that picks the listed nodes from this view.

        The view is flat, because flat indices take a quarter of the time of rows and columns. Only
        where the field is part of a wider array, it is the field itself.

        `field` has the grid's rows and columns, and may have further ones behind them.
        """
        assert self._listed is not None
        if not field.flags.c_contiguous:
            return field, self._listed
        width = field.shape[1]
        if width not in self._flat_listed:
            rows, columns = self._listed
            self._flat_listed[width] = rows * width + columns
        return field.reshape(-1), self._flat_listed[width]

    def in_contact(self, field: Real) -> Real:
        """Return the values of a field on the contact set, in the form that `correct` takes.

        Parameters
        ----------
        field : ndarray, shape (nx, ny)
            Values at all nodes.

        Returns
        -------
        ndarray of float32, shape (n,) or (nx, ny)
            Values at the n nodes of a small set; for a large set the field, with zeros outside.
        """
        if self._listed is not None:
            array, listed = self._flattened(field)
            values: Real = array[listed].astype(np.float32, copy=False)
            return values
        return np.multiply(field, self.within, dtype=np.float32, casting="same_kind")

    def add_to(
        self,
        field: Real,
        values: Real,
        least: float = -math.inf,
        largest: float = math.inf,
    ) -> None:
        """Add values of the contact set to a field in place, and cut the sums off at bounds.

        Parameters
        ----------
        field : ndarray, shape (nx, ny)
            Field that is changed. Outside the contact set it has to be within the bounds.
        values : ndarray, shape (n,) or (nx, ny)
            Values as `in_contact` returns them.
        least, largest : float
            Bounds of the sums; by default there are none [unit of the field].
        """
        if self._listed is None:
            field += values
            if least > -math.inf or largest < math.inf:
                np.clip(field, least, largest, out=field)
        else:
            array, listed = self._flattened(field)
            array[listed] = np.clip(array[listed] + values, least, largest)

    def add_constant(self, values: Real, constant: np.float32) -> None:
        """Add a constant to the values of the contact set in place, and nothing outside the set.

        Parameters
        ----------
        values : ndarray of float32, shape (n,) or (nx, ny)
            Values as `in_contact` returns them; overwritten.
        constant : numpy.float32
            Number to add [unit of the values].
        """
        if self._listed is None:
            values += constant * self.within
        else:
            values += constant

    def correct(self, residual: Real) -> Real:
        """Apply the approximate inverse, M = E^T C^-1 E, to a residual in contact.

        Parameters
        ----------
        residual : ndarray of float32, shape (n,) or (nx, ny)
            Residual as `in_contact` returns it [first side of a cell].

        Returns
        -------
        ndarray of float32, shape (n,) or (nx, ny)
            Correction of the pressure, zero outside the set [E*]. For a large set it is a view of
            a buffer that the next call overwrites.
        """
        if self._listed is None:
            return self._correct_field(residual)
        return self._correct_listed(residual)

    def _correct_field(self, residual: Real) -> Real:
        """Apply the approximate inverse on a large set; as `correct`.

        All arrays are buffers of the filters: `blocks` and `inside` are views of `field`, the
        buffer of C^-1, so that writing into either changes `field`.
        """
        field = self._inverse.field
        means = self._means
        width = field.shape[1]
        blocks = field.reshape(-1, BLOCK, width)
        inside = self._put(residual, field)  # the nodes of the grid, without the padding
        # Extend the residual outside the set by the means of its values nearby.
        means.field[:] = _block_sums(field)
        means.transform()
        means.field[:] *= self._weights
        extension = means.field.repeat(BLOCK, axis=1)[:, np.newaxis]
        outside = self._outside.reshape(-1, BLOCK, width)
        for first in range(0, len(blocks), BAND):
            band = slice(first, first + BAND)
            blocks[band] += outside[band] * extension[band]
        self._inverse.transform()  # `field` is the pressure now
        # The transpose of the extension adds means of the outside to the set.
        means.field[:] = self._weights * _block_sums(field, self._outside)
        means.transform()
        blocks += means.field.repeat(BLOCK, axis=1)[:, np.newaxis]
        inside *= self.within
        return inside

    def _correct_listed(self, residual: Real) -> Real:
        """Apply the approximate inverse on a small set; as `correct`.

        `blocks` and `flat` are views of `field`, the buffer of C^-1. The result is a new array.
        """
        field = self._inverse.field
        flat, listed = self._flattened(field)
        means = self._means
        blocks = field.reshape(-1, BLOCK, field.shape[1])
        self._sum_listed(residual)
        means.transform()
        means.field[:] *= self._weights
        blocks[:] = means.field.repeat(BLOCK, axis=1)[:, np.newaxis]
        flat[listed] = residual
        self._inverse.transform()
        # The transpose of the extension adds means of the outside to the set.
        corrected: Real = flat[listed]
        sums = _block_sums(field)
        self._sum_listed(corrected)
        outside_sums = sums - means.field
        means.field[:] = self._weights * outside_sums
        means.transform()
        corrected += means.field.reshape(-1)[self._blocks]
        return corrected

    def zero_mean_pressure(self, displacement: Field) -> Field:
        """Compute the pressure of zero mean that displaces a patch without edges as given.

        Parameters
        ----------
        displacement : ndarray, shape (nx, ny)
            Displacement, of which the mean has no effect [first side of a cell].

        Returns
        -------
        ndarray, shape (nx, ny)
            Pressure, a new array [E*].
        """
        inverse = pressure_filter(self.shape, self.boundary, self._body, self._aspect)
        pressure: Field = filtered(inverse, displacement).copy()
        if self.mean_compliance > 0:
            pressure -= pressure.mean()
        return pressure

    def splitting(self) -> tuple[FieldFilter, float] | None:
        """Return the inverse of H + c and the penalty c, for a splitting of the contact problem.

        The alternating direction method of multipliers needs both (`ActiveSet._split`).

        Returns
        -------
        filter : FieldFilter
            (H + c)^-1 of a patch without edges. All patches of this shape on this thread share it.
            For a free patch, the result is None instead of the pair.
        penalty : float
            c, `PENALTY` times the geometric mean of the largest and the least compliance of a wave
            [first side of a cell / E*].
        """
        if self.boundary == "free":
            return None
        grid = self.shape, self.boundary, self._body, self._aspect
        return _splitting_filter(*grid), _penalty(*grid)

    def entries(self, nodes: Nodes, dtype: str) -> Real:
        """Return the lower triangle of the matrix of some nodes, less the far field's `give`.

        Parameters
        ----------
        nodes : ndarray, shape (n,)
            Flat indices of the nodes.
        dtype : str
            Precision, "float64" or "float32".

        Returns
        -------
        ndarray, shape (n, n)
            Matrix in Fortran's order [1 / E*]. Most of its upper triangle is undefined.
        """
        if self.boundary == "free":
            matrix = InfluenceMatrix(self.shape, self._body, self._aspect, dtype)
            return matrix.among(nodes, self.give)
        return self._edgeless_entries(nodes, dtype)

    def _edgeless_entries(self, nodes: Nodes, dtype: str) -> Real:
        """Return the lower triangle for a patch without edges, as `entries`.

        On a mirrored patch each node has three mirror images in the period, and an entry is the sum
        of the displacements by all four.
        """
        nx, ny = self.shape
        rows, columns = np.divmod(nodes, ny)
        if self.boundary == "mirror":
            periods = 2 * nx, 2 * ny
            images = [
                (image_rows, image_columns)
                for image_rows in (rows, -1 - rows)
                for image_columns in (columns, -1 - columns)
            ]
        else:
            periods = nx, ny
            images = [(rows, columns)]
        table = _edgeless_coefficients(periods, self._body, self._aspect, dtype)
        width = 2 * periods[1]  # columns of the table
        # Offsets may be negative: the table has two periods, and the offset (0, 0) is one period
        # from its beginning along both axes.
        centre = periods[0] * width + periods[1]
        places = rows * width + columns + centre
        count = len(nodes)
        matrix = np.zeros((count, count), dtype)
        for first in range(0, count, ROWS):
            band = slice(first, first + ROWS)
            for image_rows, image_columns in images:
                loaded = (image_rows * width + image_columns)[first:]
                offsets = np.subtract.outer(places[band], loaded)
                matrix[band, first:] += table.take(offsets, mode="clip")
        return matrix.T


def _penalty(
    shape: tuple[int, int], boundary: Boundary, body: Body, aspect: float
) -> float:
    """Return the penalty of `Patch.splitting` [first side of a cell / E*].

    On a single node, which has no waves, return 1.
    """
    spectrum = compliances(shape, boundary, body, aspect)
    of_waves = spectrum[spectrum > 0]
    if not of_waves.size:
        return 1.0
    return PENALTY * math.sqrt(of_waves.min() * of_waves.max())


@kept
def _splitting_filter(
    shape: tuple[int, int], boundary: Boundary, body: Body, aspect: float
) -> FieldFilter:
    """Return the filter (H + c)^-1 of `Patch.splitting`."""
    penalised = compliances(shape, boundary, body, aspect)
    penalised += _penalty(shape, boundary, body, aspect)
    return edgeless_filter(shape, boundary, 1 / penalised, "float64")


@kept
def _inverse_filter(
    shape: tuple[int, int], boundary: Boundary, body: Body, aspect: float
) -> FieldFilter:
    """Return the inverse of a matrix C near H as a filter in single precision.

    For a free patch C is the circulant nearest to H in the Frobenius norm (T. Chan 1988). Its grid
    is little wider than the patch, a quarter of the grid that H needs. For a patch without edges C
    is the matrix H of the smallest patch of whole blocks that holds all nodes.
    """
    rows = _whole_blocks(shape[0])
    columns = _whole_blocks(shape[1])
    if boundary != "free":
        whole_blocks = rows, columns
        spectrum = stiffnesses(whole_blocks, boundary, body, aspect)
        return edgeless_filter(whole_blocks, boundary, spectrum, "float32")
    periods = _fast_length(rows), _fast_length(shape[1])
    table = influence_coefficients(periods, body, aspect)
    for period in periods:
        # c_k = ((m - k) t_k + k t_(m - k)) / m along an axis of period m, the mean over a diagonal
        # of the matrix and the diagonal that continues it when the axis is wrapped.
        half = period // 2 + 1  # entries from 0 to half of the period
        share = (np.arange(half) / period)[:, np.newaxis]  # k / m
        folded = (1 - share) * table[:half]
        # From the end of the table: t_(m - k) for k = 1, 2, ...
        folded[1:] += share[1:] * table[: period - half : -1]
        table = folded.T  # the second axis comes next, and the order is restored after it
    return spectral_filter(
        (rows, periods[1]), 1 / even_spectrum(table), "float32", periods
    )


@kept
def _means_filter(
    shape: tuple[int, int], boundary: Boundary, aspect: float, decay: float
) -> FieldFilter:
    """Return the filter from sums over blocks to weighted means over the blocks nearby.

    Its fields have one value for each block of `BLOCK` x `BLOCK` entries of the buffer of
    `_inverse_filter`, whose sums are its input. On a free patch this buffer has no padded rows, but
    padded columns; so has the field here. The filter is in single precision.
    """
    rows = _whole_blocks(shape[0]) // BLOCK
    columns = _whole_blocks(shape[1]) // BLOCK
    if boundary == "free":
        # the periods of `_inverse_filter`, in blocks
        periods = _fast_length(BLOCK * rows) // BLOCK, _fast_length(shape[1]) // BLOCK
        spectrum = _block_means(periods, aspect, decay)[: periods[0] // 2 + 1]
        return spectral_filter((rows, periods[1]), spectrum, "float32", periods)
    spectrum = _block_means((rows, columns), aspect, decay)
    if boundary == "mirror":  # one period holds the patch and its images
        spectrum = _block_means((2 * rows, 2 * columns), aspect, decay)[:rows, :columns]
    return edgeless_filter((rows, columns), boundary, spectrum, "float32")


def _is_hardest_above(body: Body) -> bool:
    """Return whether waves of some blocks find a reduced body softer than its surface."""
    if body.is_homogeneous:
        return False
    wave_numbers = np.array([2 * math.pi / (LONG_WAVE * BLOCK)])
    relative = np.ravel(body.relative_compliance(wave_numbers))
    return float(relative[0]) > HARDEST_ABOVE


def _block_means(blocks: tuple[int, int], aspect: float, decay: float) -> Field:
    """Compute the spectrum of weighted means over (rows, columns) blocks that repeat themselves.

    The means are per node: they are taken from sums over blocks of a field, and where the field is
    uniform they equal it. The spectrum has the shape (rows, columns // 2 + 1).
    """
    along, across = (
        np.minimum(np.arange(count), -np.arange(count) % count) for count in blocks
    )
    distance = np.hypot(along[:, np.newaxis], aspect * across)
    distance[0, 0] = 1  # any number above 0: the weight is replaced below
    weights = distance**-decay
    weights[0, 0] = OWN_BLOCK * min(aspect, 1.0) ** -decay
    weights /= weights.sum() * BLOCK**2  # a block's sum has BLOCK**2 nodes
    spectrum: Field = fft.rfft2(weights).real
    return spectrum


def _whole_blocks(nodes: int) -> int:
    """Return the number of nodes along an axis, rounded up to whole blocks."""
    return -(-nodes // BLOCK) * BLOCK


def _fast_length(nodes: int) -> int:
    """Return a length of at least `nodes` along an axis that transforms are fast for.

    The length is a multiple of 16. Above 256 it is 1, 5 or 25 times a power of two: lengths with a
    factor of 3 can be shorter, but save FFTW no time.
    """
    if nodes <= 256:
        sixteens = -(-nodes // 16)
        return 16 * int(fft.next_fast_len(sixteens, real=True))
    # Each odd number is multiplied by the smallest power of two that suffices.
    return min(odd << (-(-nodes // odd) - 1).bit_length() for odd in (1, 5, 25))


def _block_sums(field: Real, factors: Real | None = None) -> Real:
    """Sum a field, or its product with factors of its shape, over each block.

    The field consists of whole blocks; the result has one value for each of them. Sums of whole
    rows, then of whole columns, are faster than sums along the short axes of the blocks.
    """
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
def _edgeless_coefficients(
    periods: tuple[int, int], body: Body, aspect: float, dtype: str
) -> Real:
    """Return the displacement by a unit pressure on one node of each period.

    The table is flat and read-only. It has two periods along each axis, so that offsets of either
    sign can be looked up. Its sum is the mean compliance [first side of a cell / E*].
    """
    spectrum = compliances(periods, "periodic", body, aspect)
    table = fft.irfft2(spectrum, s=periods).astype(dtype)
    twice = np.tile(table, (2, 2)).reshape(-1)
    twice.setflags(write=False)
    return twice
