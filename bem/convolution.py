"""The half-space convolution, and the filters that each thread keeps."""

import threading
from collections import OrderedDict
from collections.abc import Callable
from copy import copy
from typing import Any, ClassVar, NamedTuple, Protocol, TypeVar
from weakref import WeakSet

import numpy as np
from scipy import fft

from bem.arrays import Field, Nodes, Real
from bem.influence import Kernel, influence_coefficients
from bem.large_filter import LARGE_NODES, LargeFilter
from bem.places import node_places
from bem.plans import PLAN_BYTES, Plan, aligned, plan, shared_buffer
from bem.sections import unforked
from bem.vectors import pieces
from bem.workers import workers

# Memory of the filters that all threads keep for later solves.
KEPT_BYTES = 256 * 2**20

# The same over the memory of the largest filter, if that is more: a solve that starts from coarser
# grids needs 3.2 times as much, and what it drops is what the next one begins with.
KEPT_LARGEST = 4

# Filters that a thread keeps whatever their memory is: one solve needs as many.
FEWEST_KEPT = 4

# Memory of the columns that are filtered at a time: they stay in the processor's cache.
BATCH_BYTES = 256 * 2**10

# Entries of a field from which on threads share its transforms, and rows that they take at a time.
SHARED_ENTRIES = 2**18
SHARED_ROWS = 64

# Entries of a field from which on columns are kept without rows of zeros whatever their number:
# less memory is then read and written, which takes longer than to copy columns in the cache.
PACKED_ENTRIES = 2**22

# Columns of a spectrum that are tabulated at a time.
TABULATED_COLUMNS = 16

# Period over rows from which on columns of a shared field are kept so.
PACKED_PERIOD = 1.5

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
        self.shape, self.largest = shape, float(spectrum.max())
        scaled = spectrum.T / (period * across)
        self._open(across, scaled.astype(dtype, copy=False))

    def in_single_precision(self) -> "Filter":
        """Return the same filter in single precision.

        The two must not be used at once: buffers of large filters lie in the same memory.
        """
        single = copy(self)
        repeats = self._factors.shape[1] // self._period
        single._open(self.field.shape[1], self._factors[:, ::repeats].astype(np.float32))
        return single

    def _open(self, across: int, factors: Real) -> None:
        """Make the buffers and plans of a filter from factors for (columns, px) waves."""
        shape, dtype, (columns, period) = self.shape, factors.dtype, factors.shape
        waves = "complex64" if dtype == np.float32 else "complex128"
        entries = shape[0] * across
        self._shared = entries >= SHARED_ENTRIES
        pruned = self._shared and period >= PACKED_PERIOD * shape[0]
        self._packed = pruned or entries >= max(PACKED_ENTRIES, SHARED_ENTRIES)
        # Coefficients are repeated, so that a real product serves real and imaginary parts. Large
        # filters in double precision, which are applied a few times in a solve, save the memory.
        spare = self._packed and dtype == np.float64
        self._factors = factors if spare else np.repeat(factors, 2, axis=1)
        self.field = self._buffer("_fields", (shape[0], across), dtype)
        self._many, self._period = columns, period
        self._stripes = self._open_stripes(waves)
        self._rows_in, self._rows_out = self._plan_rows()
        self._lists = self._plan_columns(1)
        first = self._lists[0][0]
        ends = (first.source, first.target) if self._packed else ()
        buffer = first.products[0][0]
        arrays = self._factors, self.field, self._waves, *(end.base for end in (buffer, *ends))
        plans = len(self._rows_in) + len(self._rows_out) + 2 * len(self._lists[0])
        self.bytes = sum(array.nbytes for array in arrays) + plans * PLAN_BYTES

    def _buffer(self, name: str, shape: tuple[int, ...], dtype: Any) -> Any:
        """Return a buffer, in the memory of the copied filter's if columns are packed."""
        if not self._packed:
            vars(self).pop(name, None)
        return shared_buffer(self, name, shape, dtype)

    def _open_stripes(self, dtype: str) -> list[Any]:
        """Make the waves of the rows, and return them as (stripes, columns, rows of a stripe).

        Packed columns are cut into stripes of the rows that are transformed together, which the
        processor's cache then holds while the transforms fill them row by row. What is left of the
        rows is a last, narrower stripe. Other columns are a single stripe.
        """
        rows, columns = self.shape[0], self._many
        size = SHARED_ROWS if self._packed else rows
        many, rest = divmod(rows, size)
        wide = (SHARED_ROWS if self._packed else self._period) + COLUMN_GAP
        left = columns * (rest + COLUMN_GAP) if rest else 0
        self._waves = self._buffer("_columns", (many * columns * wide + left,), dtype)
        stripes = []
        if many:
            whole = self._waves[: many * columns * wide].reshape(many, columns, wide)
            stripes.append(whole[:, :, :size])
            self._whole = whole[0, :, : self._period]  # all of the columns, unless they are packed
        if rest:
            narrow = self._waves[many * columns * wide :].reshape(1, columns, -1)
            stripes.append(narrow[:, :, :rest])
        return stripes

    def _plan_rows(self) -> tuple[list[Plan], list[Plan]]:
        """Plan the transforms of all rows there and back, in several pieces if they are shared."""
        there, back, last = [], [], 0
        for stripe in (stripe for stripes in self._stripes for stripe in stripes):
            rows = stripe.shape[1]
            size = SHARED_ROWS if self._shared else rows
            for first in range(0, rows, size):
                waves = stripe[:, first : first + size].T
                field = self.field[last + first : last + first + len(waves)]
                there.append(plan(field, waves, 1))
                back.append(plan(waves, field, 1, backward=True))
            last += rows
        return there, back

    def _plan_columns(self, threads: int) -> list[list["_Batch"]]:
        """Plan all batches of columns, as a list for each thread, which has a buffer of its own."""
        columns, period, dtype = self._many, self._period, self._waves.dtype
        fitting = max(BATCH_BYTES // (period * dtype.itemsize), 1)
        size = fitting if columns > 2 * fitting else -(-columns // max(round(columns / fitting), 1))
        lists: list[list[_Batch]] = []
        for thread in range(threads):
            buffer = aligned((size, period), dtype)
            wide = size, period + COLUMN_GAP
            ends = [aligned(wide, dtype)[:, :period] for _ in range(2 * self._packed)]
            batches = []
            for first in range(thread * size, columns, threads * size):
                some = slice(first, min(first + size, columns))
                there = buffer[: some.stop - first]
                whole: Any = None if ends else self._whole[some]
                source, target = (end[: len(there)] for end in ends) if ends else (whole, whole)
                batches.append(
                    _Batch(
                        packed=self._between(source, some) if ends else [],
                        source=source[:, : self.shape[0]],
                        forward=plan(source, there, 1),
                        products=_products(there, self._factors[some]),
                        backward=plan(there, target, 1, backward=True),
                        target=target[:, : self.shape[0]],
                        beyond=target[:, self.shape[0] :],
                        unpacked=self._between(target, some) if ends else [],
                    )
                )
            lists.append(batches)
        return lists

    def _between(self, buffer: Any, some: slice) -> list[tuple[Any, Any]]:
        """Pair the rows of a buffer for some columns with the same rows of the packed columns."""
        pairs, last = [], 0
        for stripes in self._stripes:
            many, _, rows = stripes.shape
            here = buffer[:, last : last + many * rows].reshape(len(buffer), many, rows)
            pairs.append((here, stripes[:, some].transpose(1, 0, 2)))
            last += many * rows
        return pairs

    def transform(self) -> None:
        """Filter `field`[:, :ny] in place; the rest must be zero and is undefined afterwards."""
        try:
            if self._shared:
                self._transform_shared()
                return
            self._rows_in[0].execute()
            _filter_columns(self._lists[0])
            self._rows_out[0].execute()
        except BaseException:  # on Ctrl-C, for example: the filter is used again
            self._waves.fill(0)
            raise

    def _transform_shared(self) -> None:
        """Transform rows, filter columns, transform rows back, each in pieces."""
        team = workers()
        if team.threads > len(self._lists):
            with unforked():
                self._lists = self._plan_columns(team.threads)
        team.share(_execute, self._rows_in)
        team.share(_filter_packed if self._packed else _filter_columns, self._lists)
        team.share(_execute, self._rows_out)

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
        return node_places(self.shape, self.field.shape[1], nodes)


class _Batch(NamedTuple):
    """Some columns of waves that are filtered together, in a buffer that the cache holds.

    Attributes
    ----------
    packed, unpacked : list of tuple
        Rows of the source, and of the target, with the same rows of the packed columns; empty if
        columns are not packed.
    source, target : ndarray, shape (columns, nx)
        Rows of the field before and after, where the transforms read and write them: in further
        buffers if columns are packed.
    forward, backward : Plan
        Transforms from the source into the buffer, and from there into the target.
    products : list of tuple
        Views of the buffer and the factors that multiply them.
    beyond : ndarray, shape (columns, px - nx)
        Rows of the target beyond the field.
    """

    packed: list[tuple[Any, Any]]
    source: Any
    forward: Plan
    products: list[tuple[Any, Real]]
    backward: Plan
    target: Any
    beyond: Any
    unpacked: list[tuple[Any, Any]]


def _products(buffer: Any, factors: Real) -> list[tuple[Any, Real]]:
    """Pair views of complex waves with real factors, one for each number or for each wave."""
    if factors.shape == buffer.shape:
        return [(buffer.real, factors), (buffer.imag, factors)]
    return [(buffer.view(factors.dtype), factors)]


def _filter_columns(batches: list[_Batch]) -> None:
    """Filter batches of columns in place; rows beyond the field are zero in the next input."""
    for batch in batches:
        batch.forward.execute()
        for waves, factors in batch.products:
            np.multiply(waves, factors, out=waves)
        batch.backward.execute()
        batch.beyond.fill(0)


def _filter_packed(batches: list[_Batch]) -> None:
    """Filter batches of packed columns; rows beyond the field stay zero in the source."""
    for batch in batches:
        for rows, columns in batch.packed:
            rows[:] = columns
        batch.forward.execute()
        for waves, factors in batch.products:
            np.multiply(waves, factors, out=waves)
        batch.backward.execute()
        for rows, columns in batch.unpacked:
            columns[:] = rows


def _execute(planned: Plan) -> None:
    """Execute one of FFTW's plans."""
    planned.execute()


def displacement_filter(
    shape: tuple[int, int], kernel: Kernel, aspect: float = 1.0, dtype: str = "float64"
) -> Filter | LargeFilter:
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
    Filter or LargeFilter
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
) -> Filter | LargeFilter:
    """Tabulate the spectrum of H, a real transform of its even table in both directions."""
    if dtype == "float32":
        return displacement_filter(shape, kernel, aspect).in_single_precision()
    table = influence_coefficients(shape, kernel, aspect)
    offsets = []
    for nodes in shape:
        index = np.arange(fast_period(nodes))
        # Offsets beyond the grid never connect two nodes, so that any value will do there.
        offsets.append(np.minimum(np.minimum(index, len(index) - index), nodes - 1))
    rows = np.empty((shape[0], fast_period(shape[1]) // 2 + 1), np.complex128)
    spectrum = np.empty((rows.shape[1], fast_period(shape[0])))

    def transform_rows(some: slice) -> None:
        rows[some] = fft.rfft(table[some, offsets[1]])

    def transform_columns(some: slice) -> None:
        spectrum[some] = fft.fft(rows[:, some].T[:, offsets[0]]).real

    workers().share(transform_rows, pieces(len(rows), SHARED_ROWS))
    workers().share(transform_columns, pieces(len(spectrum), TABULATED_COLUMNS))
    kind = LargeFilter if shape[0] * shape[1] >= LARGE_NODES else Filter
    return kind(shape, spectrum.T, dtype)


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
        filters = self._kept.filters
        bound = max(KEPT_BYTES, KEPT_LARGEST * max(made.bytes for made in filters.values()))
        with self._changing:
            excess = sum(kept.bytes for kept in self._threads) - bound
        while excess > 0 and len(filters) > FEWEST_KEPT:
            _, oldest = filters.popitem(last=False)
            self._kept.bytes -= oldest.bytes
            excess -= oldest.bytes


_FILTERS = _Filters()
