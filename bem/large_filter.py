"""A filter of large fields, whose transforms read and write memory as rarely as they can.

Fields hold no padding. A few rows at a time are padded in the processor's cache and transformed
there; only their waves go to memory, row by row. A few columns of waves at a time are then copied
into the cache, filtered, and copied back.
"""

from collections import deque
from collections.abc import Callable
from copy import copy
from typing import Any

import numpy as np

from bem.arrays import Field, Nodes, Real
from bem.plans import PLAN_BYTES, aligned, plan, shared_buffer
from bem.sections import unforked
from bem.workers import workers

# Nodes of a grid from which on the filter of a free patch is a large one. Below it fields fit into
# the caches well enough for `bem.convolution.Filter`.
LARGE_NODES = 10**6

# Rows that are transformed at a time, and memory of the columns that are.
ROWS = 32
COLUMN_BYTES = 256 * 2**10

# Memory that rows of waves are aligned to, and that columns in the cache are apart beyond their
# length, so that neither lie a power of two apart.
LINE_BYTES = 64


class LargeFilter:
    """A real, even, two-dimensional spectrum that is applied to large fields.

    It is a `bem.convolution.FieldFilter`, whose field holds the nodes alone. Neither rows nor
    columns of zeros are transformed.

    Parameters
    ----------
    shape : tuple of int
        Shape (nx, ny) of the fields.
    spectrum : ndarray, shape (px, qy)
        Real transform, qy = py//2 + 1, of a kernel with even periods (px, py) that is even in both
        directions.
    dtype : str
        Precision, "float64" or "float32".

    Attributes
    ----------
    field : ndarray, shape (nx, ny)
        Buffer of `transform`.
    bytes : int
        Memory that the filter occupies.
    largest : float
        Largest value of the spectrum, which no eigenvalue exceeds.
    """

    def __init__(self, shape: tuple[int, int], spectrum: Field, dtype: str = "float64") -> None:
        self.shape, self.largest = shape, float(spectrum.max())
        self._across = 2 * (spectrum.shape[1] - 1)
        scaled = spectrum.T / (spectrum.shape[0] * self._across)
        self._open(scaled.astype(dtype, copy=False))

    def in_single_precision(self) -> "LargeFilter":
        """Return the same filter in single precision.

        The two must not be used at once: their buffers lie in the same memory.
        """
        single = copy(self)
        single._open(self._factors.astype(np.float32))
        return single

    def _open(self, factors: Real) -> None:
        """Make the buffers of a filter from factors for (columns, px) waves."""
        rows, dtype, (columns, _) = self.shape[0], factors.dtype, factors.shape
        waves = np.dtype("complex64" if dtype == np.float32 else "complex128")
        # Coefficients are repeated, so that a real product serves real and imaginary parts. In
        # double precision, which is applied a few times in a solve, they are not, to save memory.
        self._factors = factors if dtype == np.float64 else np.repeat(factors, 2, axis=1)
        self._period = factors.shape[1]
        self.field: Real = shared_buffer(self, "_fields", self.shape, dtype)
        line = LINE_BYTES // waves.itemsize
        wide = -(-columns // line) * line + line
        self._waves = shared_buffer(self, "_columns", (rows, wide), waves)[:, :columns]
        self._lanes = [_Lane(self)]
        arrays: tuple[Any, ...] = self._factors, self.field, self._waves.base
        self.bytes = sum(array.nbytes for array in arrays) + self._lanes[0].bytes

    def transform(self) -> None:
        """Filter the field in place."""
        team = workers()
        if team.threads > len(self._lanes):
            with unforked():
                self._lanes += [_Lane(self) for _ in range(team.threads - len(self._lanes))]
        rows, columns = self._waves.shape
        self._share(_Lane.transform_rows, rows, ROWS)
        self._share(_Lane.filter_columns, columns, self._lanes[0].columns)
        self._share(_Lane.transform_back, rows, ROWS)

    def _share(self, work: Callable[["_Lane", slice], None], size: int, length: int) -> None:
        """Do some work on all slices of a length, which lanes draw until none is left."""
        left = deque(slice(first, min(first + length, size)) for first in range(0, size, length))

        def draw(lane: _Lane) -> None:
            while left:
                try:
                    some = left.popleft()
                except IndexError:  # another thread was faster
                    return
                work(lane, some)

        workers().share(draw, self._lanes)

    def __call__(self, field: Real) -> Real:
        """Filter a whole (nx, ny) field."""
        self.field[:] = field
        self.transform()
        result: Real = self.field.copy()
        return result

    def places(self, nodes: Nodes) -> Nodes:
        """Return the indices in the flat `field` of nodes: the same, as it holds them alone."""
        return nodes


class _Lane:
    """The buffers and plans of one thread, which transforms some rows or columns at a time.

    Buffers that transforms read keep their zeros beyond the field: nothing else is written there.

    Parameters
    ----------
    owner : LargeFilter
        The filter, whose field, waves and factors are read and written.
    """

    def __init__(self, owner: LargeFilter) -> None:
        self._field, self._waves, self._factors = owner.field, owner._waves, owner._factors
        dtype, waves, period = owner.field.dtype, owner._waves.dtype, owner._period
        self.columns = max(COLUMN_BYTES // (period * waves.itemsize), 1)
        rows = owner.shape[0]
        self._padded, self._returned = (aligned((ROWS, owner._across), dtype) for _ in range(2))
        wide = period + LINE_BYTES // waves.itemsize
        self._source, self._target = (
            aligned((self.columns, wide), waves)[:, :period] for _ in range(2)
        )
        self._filtered = aligned((self.columns, period), waves)
        self._there, self._back = {}, {}
        for many in {min(ROWS, rows), rows % ROWS} - {0}:
            here = self._waves[rows - many :] if many < ROWS else self._waves[:many]
            self._there[many] = plan(self._padded[:many], here, 1)
            self._back[many] = plan(here, self._returned[:many], 1, backward=True)
        self._forward = plan(self._source, self._filtered, 1)
        self._backward = plan(self._filtered, self._target, 1, backward=True)
        buffers = self._padded, self._returned, self._filtered, self._source, self._target
        self.bytes = sum(
            (buffer if buffer.base is None else buffer.base).nbytes for buffer in buffers
        )
        self.bytes += (2 + 2 * len(self._there)) * PLAN_BYTES

    def transform_rows(self, some: slice) -> None:
        """Pad some rows of the field and transform them to waves."""
        rows, waves = self._field[some], self._waves[some]
        padded = self._padded[: len(rows)]
        padded[:, : rows.shape[1]] = rows
        there = self._there[len(rows)]
        there.update_arrays(padded, waves)
        there.execute()

    def filter_columns(self, some: slice) -> None:
        """Transform some columns of waves, multiply them by their factors, and transform back."""
        waves, factors = self._waves[:, some], self._factors[some]
        rows, columns = waves.shape
        self._source[:columns, :rows] = waves.T
        self._forward.execute()
        filtered: Any = self._filtered[:columns]
        if factors.shape == filtered.shape:
            np.multiply(filtered.real, factors, out=filtered.real)
            np.multiply(filtered.imag, factors, out=filtered.imag)
        else:
            numbers = filtered.view(factors.dtype)
            np.multiply(numbers, factors, out=numbers)
        self._backward.execute()
        waves[:] = self._target[:columns, :rows].T

    def transform_back(self, some: slice) -> None:
        """Transform some rows of waves back and keep the part that belongs to the field."""
        rows, waves = self._field[some], self._waves[some]
        returned = self._returned[: len(rows)]
        back = self._back[len(rows)]
        back.update_arrays(waves, returned)
        back.execute()
        rows[:] = returned[:, : rows.shape[1]]
