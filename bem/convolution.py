"""The half-space convolution by FFTW; no other module imports pyfftw.

Every plan is made with FFTW_ESTIMATE, because FFTW_MEASURE chooses by timing, so that two processes
could differ in the last bits of a result.
"""

import threading
from collections import OrderedDict
from collections.abc import Callable
from functools import lru_cache
from typing import Any, ClassVar, Protocol, TypeVar
from weakref import WeakSet

import numpy as np
import pyfftw
from scipy import fft

from bem.arrays import Field, Nodes, Real
from bem.influence import Kernel, influence_coefficients
from bem.sections import unforked

# Memory of the filters that all threads keep for later solves.
KEPT_BYTES = 256 * 2**20

# Filters that a thread keeps whatever their memory is: one solve needs as many.
FEWEST_KEPT = 4

# Memory of one of FFTW's plans, estimated because FFTW does not tell.
PLAN_BYTES = 5 * 2**10

# Memory of the columns that are filtered at a time: they stay in the processor's cache.
BATCH_BYTES = 256 * 2**10

Kind = TypeVar("Kind", bound="FieldFilter")

# Entries left unused after a column, so that columns do not lie a power of two apart.
COLUMN_GAP = 8


class FieldFilter(Protocol):
    """A linear map of (nx, ny) fields, whose attributes `Filter` describes."""

    shape: tuple[int, int]
    field: Real
    bytes: int
    largest: float

    def transform(self) -> None:
        """Filter the field in place."""

    def __call__(self, field: Real) -> Real:
        """Filter a whole (nx, ny) field."""

    def places(self, nodes: Nodes) -> Nodes:
        """Return the indices in the flat `field` of nodes given as flat indices of (nx, ny)."""


class Filter:
    """A real, even, two-dimensional spectrum that is applied to fields by pruned FFTs.

    Neither rows of zeros in the input nor unused rows of the output are transformed. The padding
    therefore costs half of the second axis and nothing of the first.

    Waves along the second axis are stored column by column, with a few unused entries after a
    column, because columns a power of two apart would compete for the same sets of the processor's
    cache. They are filtered in batches, in a buffer that the cache holds.

    Parameters
    ----------
    shape : tuple of int
        Shape (nx, ny) of the fields that it is applied to.
    spectrum : ndarray, shape (px, qy)
        Real transform, qy = py//2 + 1, of a kernel with periods (px, py) that is even in both
        directions.
    dtype : str
        Precision: "float64", or "float32", which takes less time (`pytest bench -k convolution`)
        and rounds to 1e-7.
    across : int, optional
        Second period py; even by default.

    Attributes
    ----------
    field : ndarray, shape (nx, py)
        Buffer of `transform`.
    bytes : int
        Memory that the filter occupies.
    largest : float
        Largest value of the spectrum, which no eigenvalue exceeds.
    """

    def __init__(
        self,
        shape: tuple[int, int],
        spectrum: Field,
        dtype: str = "float64",
        across: int | None = None,
    ) -> None:
        period, columns = spectrum.shape[0], spectrum.shape[1]
        across = 2 * (columns - 1) if across is None else across
        # Coefficients are repeated, so that a real product serves real and imaginary parts.
        self._factors = np.repeat(spectrum.T / (period * across), 2, axis=1).astype(dtype)
        self.shape = shape
        self.largest = float(spectrum.max())
        self.field = pyfftw.zeros_aligned((shape[0], across), dtype)
        waves = "complex64" if dtype == "float32" else "complex128"
        whole = pyfftw.zeros_aligned((columns, period + COLUMN_GAP), waves)
        self._waves = whole[:, :period]
        rows = self._waves[:, : shape[0]].T
        self._rows_in = _plan(self.field, rows, 1)
        self._rows_out = _plan(rows, self.field, 1, backward=True)
        self._batches = self._plan_columns()
        buffer = self._batches[0][1]
        arrays = self._factors, self.field, whole, buffer
        plans = 2 + 2 * len(self._batches)
        self.bytes = sum(array.nbytes for array in arrays) + plans * PLAN_BYTES

    def _plan_columns(self) -> list[tuple[Callable[[], None], Real, Real, Callable[[], None], Any]]:
        """Plan each batch of columns: forward, waves, factors, backward, rows to clear."""
        columns, period = self._waves.shape
        size = min(max(BATCH_BYTES // (period * self._waves.itemsize), 1), columns)
        buffer = pyfftw.empty_aligned((size, period), self._waves.dtype)
        batches = []
        for first in range(0, columns, size):
            here = self._waves[first : first + size]
            there = buffer[: len(here)]
            batches.append(
                (
                    _plan(here, there, 1),
                    there.view(self.field.dtype),
                    self._factors[first : first + size],
                    _plan(there, here, 1, backward=True),
                    here[:, self.shape[0] :],
                )
            )
        return batches

    def transform(self) -> None:
        """Filter `field`[:, :ny] in place; the rest must be zero and is undefined afterwards."""
        try:
            self._transform()
        except BaseException:  # on Ctrl-C, for example: the filter is used again
            self._waves.fill(0)
            raise

    def _transform(self) -> None:
        """Transform rows, filter columns, transform rows back."""
        self._rows_in()
        for forward, waves, factors, backward, beyond in self._batches:
            forward()
            np.multiply(waves, factors, out=waves)
            backward()
            beyond.fill(0)  # rows beyond nx are zero in the next input
        self._rows_out()

    def __call__(self, field: Real) -> Real:
        """Filter a whole (nx, ny) field."""
        self.field.fill(0)  # the filter is shared: clear the last input
        inside = self.field[:, : self.shape[1]]
        inside[:] = field
        self.transform()
        result: Real = inside.copy()
        return result

    def places(self, nodes: Nodes) -> Nodes:
        """Return the indices in the flat `field` of nodes given as flat indices of (nx, ny)."""
        return node_places(self.shape, self.field.shape[1])[nodes]


class Selection:
    """A filter applied to values on some nodes, with zero on all other nodes.

    Parameters
    ----------
    operator : FieldFilter
        The filter of the whole field.
    nodes : ndarray, shape (m,), or None
        Flat indices into its (nx, ny); None for all nodes of an unpadded filter.
    """

    def __init__(self, operator: FieldFilter, nodes: Nodes | None) -> None:
        self._operator = operator
        self._places = None if nodes is None else operator.places(nodes)
        self._field = operator.field.reshape(-1)

    def __call__(self, values: Real) -> Real:
        """Filter (m,) values on the nodes, and return (m,) values on the same nodes."""
        if self._places is None:
            return self._apply(slice(None), values).copy()
        return self._apply(self._places, values)[self._places]

    def everywhere(self, values: Real) -> Real:
        """Filter (m,) values on the nodes into a new (nx, ny) field on all nodes of the grid."""
        self._apply(slice(None) if self._places is None else self._places, values)
        field: Real = self._operator.field[:, : self._operator.shape[1]].copy()
        return field

    def spread(self, some: Nodes, values: Real) -> Real:
        """Filter (a,) values on nodes[some], and return (m,) values on all the nodes."""
        if self._places is None:
            return self._apply(some, values).copy()
        return self._apply(self._places[some], values)[self._places]

    def _apply(self, places: Nodes | slice, values: Real) -> Real:
        """Filter values at some places; the result is the filter's own buffer."""
        self._field.fill(0)  # the filter is shared: clear the last input
        self._field[places] = values
        self._operator.transform()
        filtered: Real = self._field
        return filtered


@lru_cache(maxsize=4)
def node_places(shape: tuple[int, int], across: int) -> Nodes:
    """Return the index of every node of (nx, ny) in a flat field with `across` columns."""
    return np.arange(shape[0] * across).reshape(shape[0], across)[:, : shape[1]].reshape(-1)


def _plan(source: Real, target: Real, axis: int, *, backward: bool = False) -> Callable[[], None]:
    """Plan a transform along one axis; a backward one may destroy its input."""
    direction = "FFTW_BACKWARD" if backward else "FFTW_FORWARD"
    flags = ("FFTW_ESTIMATE", "FFTW_DESTROY_INPUT") if backward else ("FFTW_ESTIMATE",)
    plan = pyfftw.FFTW(source, target, axes=(axis,), direction=direction, flags=flags)
    execute: Callable[[], None] = plan.execute
    return execute


def displacement_filter(
    shape: tuple[int, int], kernel: Kernel, aspect: float = 1.0, dtype: str = "float64"
) -> Filter:
    """Return H as a filter, which is exact for free (non-periodic) boundaries.

    Parameters
    ----------
    shape : tuple of int
        Nodes (nx, ny) of the grid.
    kernel : str
        Influence coefficients, see `bem.influence.influence_coefficients`.
    aspect : float
        Second side of a cell over its first [1].
    dtype : str
        Precision, "float64" or "float32".

    Returns
    -------
    Filter
        Maps an (nx, ny) pressure to an (nx, ny) displacement [first side of a cell / E*]. All
        callers on one thread share it, so that its buffer must not be kept.
    """
    return kept_filter(_make_displacement_filter, shape, kernel, aspect, dtype)


def kept_filter(make: Callable[..., Kind], *arguments: Any) -> Kind:
    """Return the filter that `make` makes from the arguments; this thread keeps it for later."""
    return _FILTERS.get(make, arguments)


def fast_period(nodes: int) -> int:
    """Return the smallest even period with small prime factors that a grid's kernel allows.

    The kernel is even, so that 2 nodes - 2 is exact, a power of two for 2^k + 1 nodes.

    Parameters
    ----------
    nodes : int
        Nodes of the grid along an axis.
    """
    return 2 * int(fft.next_fast_len(max(nodes - 1, 1), real=True))


def _make_displacement_filter(
    shape: tuple[int, int], kernel: Kernel, aspect: float, dtype: str
) -> Filter:
    """Tabulate the spectrum of H."""
    table = influence_coefficients(shape, kernel, aspect)
    offsets = []
    for nodes in shape:
        index = np.arange(fast_period(nodes))
        # Offsets beyond the grid never connect two nodes, so that any value will do there.
        offsets.append(np.minimum(np.minimum(index, len(index) - index), nodes - 1))
    return Filter(shape, fft.rfft2(table[np.ix_(*offsets)]).real, dtype)


class _Kept:
    """The filters of one thread in the order of their last use, and their memory."""

    def __init__(self) -> None:
        self.filters: OrderedDict[tuple[Any, ...], Any] = OrderedDict()
        self.bytes = 0


class _Filters(threading.local):
    """The filters last used on this thread, as many as `KEPT_BYTES` for all threads allow.

    Filters hold scratch space too, so that no two threads can share one.
    """

    _threads: ClassVar[WeakSet[_Kept]] = WeakSet()
    _changing = threading.Lock()

    def __init__(self) -> None:
        self._kept = _Kept()
        with unforked(), self._changing:
            self._threads.add(self._kept)

    def get(self, make: Callable[..., Kind], arguments: tuple[Any, ...]) -> Kind:
        """Return a kept filter, or make one and keep it."""
        filters, key = self._kept.filters, (make, *arguments)
        kept = filters.get(key)
        if kept is not None:
            filters.move_to_end(key)
            found: Kind = kept
            return found
        with unforked():  # plans and transforms are made under locks
            made = filters[key] = make(*arguments)
            self._kept.bytes += made.bytes
            self._forget()
        return made

    def _forget(self) -> None:
        """Drop this thread's oldest filters while those of all threads take too much memory."""
        with self._changing:
            excess = sum(kept.bytes for kept in self._threads) - KEPT_BYTES
        while excess > 0 and len(self._kept.filters) > FEWEST_KEPT:
            _, oldest = self._kept.filters.popitem(last=False)
            self._kept.bytes -= oldest.bytes
            excess -= oldest.bytes


_FILTERS = _Filters()
