"""Filters of real fields by complex transforms of half the length.

FFTW has vector instructions for complex transforms and none for real ones, which take more than
twice as long as complex ones of the same work. Neighbours along a row are therefore the real and
the imaginary part of one number here, as they lie in memory, so that no value is moved.
"""

from collections.abc import Iterator
from itertools import chain
from typing import Any, NamedTuple

import numpy as np

from bem.arrays import Field, Nodes, Real
from bem.convolution import COLUMN_GAP, SHARED_ENTRIES, SHARED_ROWS
from bem.plans import PLAN_BYTES, Plan, aligned, plan
from bem.sections import unforked
from bem.workers import workers

# Entries of a field for which this takes less time than real transforms: for fewer, calls of numpy
# take longer than the transforms; for more, rows have to be kept in stripes.
LEAST_ENTRIES, MOST_ENTRIES = 2**12, 2**22

# Memory of the columns that are filtered at a time: they stay in the processor's cache.
BATCH_BYTES = 256 * 2**10


def pairs_up(shape: tuple[int, int]) -> bool:
    """Return whether a filter of fields of a shape takes less time by complex transforms."""
    return shape[1] % 2 == 0 and LEAST_ENTRIES <= shape[0] * shape[1] < MOST_ENTRIES


class PairedFilter:
    """A real, even, two-dimensional spectrum that is applied to fields that repeat themselves.

    With the n = ny / 2 numbers z = a + i b of a row, the transform Z of z holds those of both
    parts, A = (Z(q, k) + conj Z(-q, -k)) / 2 and B = (Z(q, k) - conj Z(-q, -k)) / 2i, and that of
    the field is A + exp(-i t) B with t = pi k / n (Press et al. 2007, Numerical Recipes, section
    12.3). Filtering its waves k and k + n by factors S and S' therefore makes of Z(q, k)

        ((S + S') / 2 - (S - S') / 2 sin t) Z(q, k) + i (S - S') / 2 cos t conj Z(-q, -k).

    Columns k and n - k are filtered together. Those of n - k are transformed backward, which
    leaves them in the order of -q.

    It serves wherever `bem.convolution.Filter` does for periods (nx, ny).

    Parameters
    ----------
    spectrum : ndarray, shape (nx, ny // 2 + 1)
        Real transform of a kernel with periods (nx, ny), ny even, that is even in both directions.
    dtype : str
        Precision, "float64" or "float32".

    Attributes
    ----------
    shape : tuple of int
        Shape (nx, ny) of the fields that it is applied to.
    field : ndarray, shape (nx, ny)
        Buffer of `transform`.
    bytes : int
        Memory that the filter occupies.
    largest : float
        Largest value of the spectrum, which no eigenvalue exceeds.
    """

    def __init__(self, spectrum: Field, dtype: str = "float64") -> None:
        rows, numbers = len(spectrum), spectrum.shape[1] - 1
        self.shape: tuple[int, int] = rows, 2 * numbers
        self.largest = float(spectrum.max())
        waves = "complex64" if dtype == "float32" else "complex128"
        self.field = aligned(self.shape, dtype)
        self._waves = aligned((numbers, rows + COLUMN_GAP), waves)[:, :rows]
        self._rows_in, self._rows_out = self._plan_rows()
        self._groups = list(_groups(numbers, max(BATCH_BYTES // self._waves[:2].nbytes, 1)))
        self._factors = [_factors(spectrum, group, self._waves.dtype) for group in self._groups]
        self._lists = self._plan_columns(1)
        buffers = self._lists[0][0].buffers
        arrays = self.field, self._waves.base, *chain(*self._factors), *buffers
        plans = 2 * len(self._rows_in) + 4 * len(self._groups)
        self.bytes = sum(array.nbytes for array in arrays) + plans * PLAN_BYTES

    def _plan_rows(self) -> tuple[list[Plan], list[Plan]]:
        """Plan the transforms of all rows there and back, in several pieces if they are shared."""
        there, back, rows = [], [], self.shape[0]
        size = SHARED_ROWS if self.field.size >= SHARED_ENTRIES else rows
        for first in range(0, rows, size):
            numbers = self.field[first : first + size].view(self._waves.dtype)
            waves = self._waves[:, first : first + size].T
            there.append(plan(numbers, waves, 1))
            back.append(plan(waves, numbers, 1, backward=True))
        return there, back

    def _plan_columns(self, threads: int) -> list[list["_Batch"]]:
        """Plan all batches of columns, as a list for each thread, which has buffers of its own."""
        most, rows = max(group.size for group in self._groups), self.shape[0]
        lists: list[list[_Batch]] = []
        for thread in range(threads):
            buffers = [aligned((most, rows), self._waves.dtype) for _ in range(2)]
            mine = zip(self._groups[thread::threads], self._factors[thread::threads], strict=True)
            lists.append([_Batch(self._waves, group, factors, buffers) for group, factors in mine])
        return lists

    def transform(self) -> None:
        """Filter `field` in place."""
        if len(self._rows_in) == 1:
            self._rows_in[0].execute()
            _filter_columns(self._lists[0])
            self._rows_out[0].execute()
            return
        team = workers()
        if team.threads > len(self._lists):
            with unforked():
                self._lists = self._plan_columns(team.threads)
        team.share(_execute, self._rows_in)
        team.share(_filter_columns, self._lists)
        team.share(_execute, self._rows_out)

    def __call__(self, field: Real) -> Real:
        """Filter a whole (nx, ny) field."""
        self.field[:] = field
        self.transform()
        return self.field.copy()

    def places(self, nodes: Nodes) -> Nodes:
        """Return the indices in the flat `field` of nodes given as flat indices of (nx, ny)."""
        return nodes


class _Group(NamedTuple):
    """Some columns k up to the middle, and their partners n - k beyond it.

    Attributes
    ----------
    low, high : slice
        The columns of both kinds.
    """

    low: slice
    high: slice

    @property
    def size(self) -> int:
        """Number of columns."""
        return len(range(self.low.start, self.low.stop)) + len(
            range(self.high.start, self.high.stop)
        )


def _groups(columns: int, most: int) -> Iterator[_Group]:
    """Divide the n columns into groups of at most some columns k each, and their partners."""
    half = columns // 2 + 1
    size = -(-half // -(-half // most))
    for start in range(0, half, size):
        stop = min(start + size, half)
        first, last = max(start, 1), min(stop - 1, (columns - 1) // 2)  # those with a partner
        yield _Group(slice(start, stop), slice(columns - last, columns - first + 1))


def _factors(spectrum: Field, group: _Group, dtype: Any) -> tuple[Real, Any]:
    """Tabulate the factors of Z for its two parts, and those of its conjugate, column by column."""
    waves, (rows, n) = spectrum.T, (len(spectrum), spectrum.shape[1] - 1)
    columns = np.r_[group.low, group.high]
    low, high = waves[columns] / (rows * n), waves[n - columns] / (rows * n)
    phase = np.pi * columns[:, np.newaxis] / n
    own, across = (low + high) / 2, (low - high) / 2
    kept = np.repeat(own - across * np.sin(phase), 2, axis=1)
    crossing = (1j * across * np.cos(phase)).astype(dtype)
    return kept.astype(crossing.real.dtype), crossing


class _Batch:
    """The filtering of a group of columns, in buffers that the cache holds.

    Parameters
    ----------
    columns : ndarray, shape (n, nx)
        Waves along the rows, column by column, which are filtered in place.
    group : _Group
        The columns that are filtered together.
    factors : tuple of ndarray
        Factors of Z (columns, 2 nx), a pair for each number, and of its conjugate (columns, nx).
    buffers : list of ndarray, shape (columns, nx)
        Room for the columns, twice.
    """

    def __init__(
        self, columns: Any, group: _Group, factors: tuple[Real, Any], buffers: list[Any]
    ) -> None:
        self.buffers, (self._factors, self._factors_crossing) = buffers, factors
        self._waves, self._crossing = (buffer[: group.size] for buffer in buffers)
        self._entries = self._waves.view(self._factors.dtype)
        many = group.low.stop - group.low.start
        ends = [(columns[group.low], self._waves[:many], False)]
        if many < group.size:
            ends.append((columns[group.high], self._waves[many:], True))
        self._forward = [plan(a, b, 1, backward=beyond) for a, b, beyond in ends]
        self._backward = [plan(b, a, 1, backward=not beyond) for a, b, beyond in ends]
        self._sums = self._partners(group, many)

    def _partners(self, group: _Group, many: int) -> list[tuple[Any, Any]]:
        """Pair columns with what their partners add to them; column 0 is its own partner."""
        crossing = self._crossing.view(self._entries.dtype)
        first = 0 if group.low.start else 1
        low, high = slice(first, first + group.size - many), slice(many, group.size)
        sums = [
            (self._entries[low], crossing[high][::-1]),
            (self._entries[high], crossing[low][::-1]),
        ]
        if first:
            own, other = self._waves[0], self._crossing[0]
            sums += [(own[:1], other[:1]), (own[1:], other[1:][::-1])]
        return sums

    def filter(self) -> None:
        """Transform the columns, filter their waves, and transform them back."""
        for forward in self._forward:
            forward.execute()
        np.conjugate(self._waves, out=self._crossing)
        np.multiply(self._crossing, self._factors_crossing, out=self._crossing)
        np.multiply(self._entries, self._factors, out=self._entries)
        for waves, crossing in self._sums:
            np.add(waves, crossing, out=waves)
        for backward in self._backward:
            backward.execute()


def _filter_columns(batches: list[_Batch]) -> None:
    """Filter batches of columns in place."""
    for batch in batches:
        batch.filter()


def _execute(planned: Plan) -> None:
    """Execute one of FFTW's plans."""
    planned.execute()
