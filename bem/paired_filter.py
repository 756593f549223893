"""Filters of periodic fields, by complex transforms of half the length.

`bem.pairs` has the method.
"""

from itertools import chain
from typing import Any

import numpy as np

from bem.arrays import Field, Nodes, Real
from bem.convolution import COLUMN_GAP, SHARED_ENTRIES, SHARED_ROWS
from bem.pairs import Group, factors, groups, partners
from bem.plans import PLAN_BYTES, Plan, aligned, plan
from bem.sections import unforked
from bem.workers import workers

# Entries of the smallest field, and of the smallest one beyond, for which complex transforms take
# less time than real ones: calls of numpy cost more than they save on smaller fields, and larger
# ones need rows in stripes (`bem.convolution`).
LEAST_ENTRIES, MOST_ENTRIES = 2**12, 2**22

# Memory of the columns that are filtered at a time: they stay in the processor's cache with what
# they add to each other, which takes as much.
BATCH_BYTES = 256 * 2**10


def pairs_up(shape: tuple[int, int]) -> bool:
    """Return whether a filter of fields of a shape takes less time by complex transforms."""
    return shape[1] % 2 == 0 and LEAST_ENTRIES <= shape[0] * shape[1] < MOST_ENTRIES


class PairedFilter:
    """A real, even, two-dimensional spectrum that is applied to fields that repeat themselves.

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
        Memory that the filter occupies on one thread.
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
        self._groups = list(groups(numbers, max(BATCH_BYTES // self._waves[:2].nbytes, 1)))
        self._factors = [_tables(spectrum, group, self._waves.dtype) for group in self._groups]
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
        most, rows = max(sum(group.counts) for group in self._groups), self.shape[0]
        lists: list[list[_Batch]] = []
        for thread in range(threads):
            buffers = [aligned((most, rows), self._waves.dtype) for _ in range(2)]
            mine = zip(self._groups[thread::threads], self._factors[thread::threads], strict=True)
            lists.append([_Batch(self._waves, group, tables, buffers) for group, tables in mine])
        return lists

    def transform(self) -> None:
        """Filter `field` in place."""
        if self.field.size < SHARED_ENTRIES:
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


def _tables(spectrum: Field, group: Group, dtype: Any) -> tuple[Real, Any]:
    """Tabulate the factors of Z for both parts of each number, and those of its conjugate."""
    own, across = factors(spectrum, np.r_[group.low, group.high])
    crossing = (1j * across).astype(dtype)
    return np.repeat(own, 2, axis=1).astype(crossing.real.dtype), crossing


class _Batch:
    """The filtering of a group of columns, in buffers that the cache holds.

    Parameters
    ----------
    columns : ndarray, shape (n, nx)
        Waves along the rows, column by column, which are filtered in place.
    group : Group
        The columns that are filtered together.
    tables : tuple of ndarray
        Factors of Z (columns, 2 nx), a pair for each number, and of its conjugate (columns, nx).
    buffers : list of ndarray, shape (columns, nx)
        Room for the columns, and for what they add to their partners.
    """

    def __init__(
        self, columns: Any, group: Group, tables: tuple[Real, Any], buffers: list[Any]
    ) -> None:
        self.buffers, (self._own, self._across) = buffers, tables
        low, high = group.counts
        self._waves, self._crossing = (buffer[: low + high] for buffer in buffers)
        self._entries = self._waves.view(self._own.dtype)
        ends = [(columns[group.low], self._waves[:low], False)]
        if high:
            ends.append((columns[group.high], self._waves[low:], True))
        self._forward = [plan(a, b, 1, backward=mirrored) for a, b, mirrored in ends]
        self._backward = [plan(b, a, 1, backward=not mirrored) for a, b, mirrored in ends]
        self._partners = list(partners(self._waves, self._crossing, group, low))

    def filter(self) -> None:
        """Transform the columns, filter their waves, and transform them back."""
        for forward in self._forward:
            forward.execute()
        np.conjugate(self._waves, out=self._crossing)
        np.multiply(self._crossing, self._across, out=self._crossing)
        np.multiply(self._entries, self._own, out=self._entries)
        for waves, crossing in self._partners:
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
