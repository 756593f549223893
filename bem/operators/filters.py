"""Filters: real, even spectra that are applied to fields by Fourier or cosine transforms.

No other module imports pyfftw. Every plan is made with FFTW_ESTIMATE. FFTW_MEASURE chooses by
timing, so that the results of two processes could differ in their last bits.
"""

import math
import threading
from collections import OrderedDict
from collections.abc import Callable
from copy import copy
from functools import wraps
from typing import Any, NamedTuple, Protocol, TypeVar, TypeVarTuple, cast
from weakref import WeakSet

import numpy as np
import pyfftw
from scipy import fft

from bem.arrays import Field, Real
from bem.threads import share, threads_here, unforked

# Least number of entries of a padded field for which threads share its transforms, and rows are
# padded a few at a time. Smaller fields fit into the caches as a whole, where padding them at once
# is 1.06 to 1.22 times faster (at 129 nodes a side).
LARGE = 2**19

# Memory of the columns that are filtered at a time, so that they stay in the processor's cache
# [bytes].
BATCH_BYTES = 256 * 2**10

# Rows of a large field that are transformed at a time.
ROWS = 32

# Unused memory between the columns of a buffer [bytes]. Columns whose distance is a power of two
# would compete for the same sets of the processor's cache.
GAP_BYTES = 64

# Memory of one of FFTW's plans, an estimate, because FFTW does not tell it [bytes].
PLAN_BYTES = 5 * 2**10

# Largest memory of the filters that all threads together keep for later solves [bytes].
KEPT_BYTES = 256 * 2**20

# Largest memory of these filters, over the memory of the largest filter of the thread [1]. The
# larger one of this bound and of `KEPT_BYTES` applies.
KEPT_LARGEST = 4

# Number of filters that each thread keeps whatever their memory is.
FEWEST_KEPT = 4

# For `kept`: the type of what a function makes, and the types of its arguments.
Kind = TypeVar("Kind", bound="Buffered")
Arguments = TypeVarTuple("Arguments")


class Buffered(Protocol):
    """An object with buffers, which each thread may keep for later solves.

    Attributes
    ----------
    bytes : int
        Memory that it occupies [bytes].
    """

    bytes: int


class FieldFilter(Protocol):
    """A linear map of (nx, ny) fields, with a buffer of its own.

    Attributes
    ----------
    shape : tuple of int
        Shape (nx, ny) of the fields.
    field : ndarray, shape (nx, at least ny)
        Buffer that `transform` changes. Its first ny columns hold the field; the columns beyond
        must be zero before each call.
    bytes : int
        Memory that the filter occupies [bytes].
    largest : float
        Largest value of the spectrum, an upper bound of the eigenvalues.
    """

    shape: tuple[int, int]
    field: Real
    bytes: int
    largest: float

    def transform(self) -> None:
        """Filter the field in place; the columns beyond it are undefined afterwards."""


def filtered(by: FieldFilter, field: Real) -> Real:
    """Filter a field.

    Parameters
    ----------
    by : FieldFilter
        The filter, whose buffer is used.
    field : ndarray, shape (nx, ny)
        The field, which is left as it is.

    Returns
    -------
    ndarray, shape (nx, ny)
        A view of the filter's buffer, which the next use of the filter overwrites.
    """
    columns = by.shape[1]
    by.field[:, :columns] = field
    if by.field.shape[1] > columns:
        by.field[:, columns:] = 0
    by.transform()
    result: Real = by.field[:, :columns]
    return result


def spectral_filter(
    shape: tuple[int, int], spectrum: Field, dtype: str, periods: tuple[int, int]
) -> "Filter | LargeFilter":
    """Return the filter by Fourier transforms that is fast for the size of a field.

    Parameters
    ----------
    shape : tuple of int
        Shape (nx, ny) of the fields.
    spectrum : ndarray, shape (px // 2 + 1, py // 2 + 1)
        Transform of a kernel that is even along both axes, from 0 to half of either period.
    dtype : str
        Precision: "float64", or "float32", which takes less time and rounds to 1e-7.
    periods : tuple of int
        Periods (px, py) of the kernel [nodes].

    Returns
    -------
    Filter or LargeFilter
        The filter, with new buffers.
    """
    # FFTW's transforms there and back multiply by the number of entries of a period.
    factors = (spectrum.T / math.prod(periods)).astype(dtype, copy=False)
    kind = LargeFilter if shape[0] * periods[1] >= LARGE else Filter
    return kind(shape, factors, periods, float(spectrum.max()))


class _Batch(NamedTuple):
    """Some columns of waves that a `Filter` transforms, multiplies and transforms back.

    Attributes
    ----------
    forward : Plan
        Transform along the first axis, from the columns into a buffer.
    buffer : ndarray, shape (columns, 2 period)
        Real and imaginary parts of the buffer.
    factors : ndarray, shape (columns, 2 period)
        Factor of each of these real and imaginary parts.
    backward : Plan
        Transform from the buffer back into the columns.
    padding : ndarray, shape (columns, period - rows)
        Part of the columns beyond the rows of the field. It has to be zero before each call.
    """

    forward: "Plan"
    buffer: Real
    factors: Real
    backward: "Plan"
    padding: Any


class Filter:
    """A spectrum that is applied to small fields by pruned transforms.

    Neither rows of zeros in the input nor unused rows of the output are transformed along the
    second axis. Waves along the second axis are stored column by column, and filtered in batches of
    columns in a buffer that fits into the cache.

    Parameters
    ----------
    shape : tuple of int
        Shape (nx, ny) of the fields.
    factors : ndarray, shape (py // 2 + 1, px // 2 + 1)
        Factors of the waves, transposed and divided by the number of entries of a period.
    periods : tuple of int
        Periods (px, py) of the kernel [nodes].
    largest : float
        Largest value of the spectrum.
    """

    def __init__(
        self,
        shape: tuple[int, int],
        factors: Real,
        periods: tuple[int, int],
        largest: float,
    ) -> None:
        self.shape = shape
        self.largest = largest
        self.periods = periods
        period = periods[0]
        columns = len(factors)
        waves = _wave_type(factors)
        # Each factor is repeated, so that one real product serves real and imaginary parts.
        all_factors = np.concatenate([factors, _mirrored_half(factors, period)], axis=1)
        self._factors = np.repeat(all_factors, 2, axis=1)
        self.field: Real = _aligned((shape[0], periods[1]), factors.dtype)
        length = period + GAP_BYTES // waves.itemsize
        self._waves = _aligned((columns, length), waves)[:, :period]
        # Beyond the field's rows is padding, which stays 0 between calls.
        in_rows = self._waves[:, : shape[0]]
        self._rows_forward = _plan(self.field, in_rows.T)
        self._rows_backward = _plan(in_rows.T, self.field, backward=True)
        fitting = max(BATCH_BYTES // self._waves[:1].nbytes, 1)  # columns in the cache
        batches = max(round(columns / fitting), 1)
        batch_columns = -(-columns // batches)
        buffer: Any = _aligned((batch_columns, period), waves)
        self._batches = []
        for first in range(0, columns, batch_columns):
            batch_waves = self._waves[first : first + batch_columns]
            batch_buffer = buffer[: len(batch_waves)]
            batch = _Batch(
                forward=_plan(batch_waves, batch_buffer),
                buffer=batch_buffer.view(factors.dtype),
                factors=self._factors[first : first + batch_columns],
                backward=_plan(batch_buffer, batch_waves, backward=True),
                padding=batch_waves[:, shape[0] :],
            )
            self._batches.append(batch)
        arrays = self._factors, self.field, self._waves, buffer
        self.bytes = sum(array.nbytes for array in arrays)
        self.bytes += 2 * PLAN_BYTES * len(self._batches)

    def in_single_precision(self) -> "Filter":
        """Return a filter by the same spectrum in single precision, with buffers of its own."""
        # Every factor is stored twice, and the factors beyond half a period mirror the first ones.
        half = 2 * (self.periods[0] // 2 + 1)
        factors = self._factors[:, :half:2].astype(np.float32)
        return Filter(self.shape, factors, self.periods, self.largest)

    def transform(self) -> None:
        """Filter the field in place; the columns beyond it are undefined afterwards.

        Any error passes through, and leaves the field undefined.
        """
        try:
            self._rows_forward.execute()
            for forward, buffer, factors, backward, padding in self._batches:
                forward.execute()
                np.multiply(buffer, factors, out=buffer)
                backward.execute()
                padding.fill(0)
            self._rows_backward.execute()
        except BaseException:
            # The filter may be used again, for example after Ctrl-C. Leave the padding of the
            # waves zero, as the next call expects.
            self._waves.fill(0)
            raise


class LargeFilter:
    """A spectrum that is applied to large fields with few transfers between memory and cache.

    Fields have no padding. A few rows at a time are padded and transformed in the processor's
    cache, and only their waves are written to memory. A few columns of waves at a time are then
    copied into the cache, filtered, and copied back. Threads share the rows and the columns.

    Parameters
    ----------
    shape : tuple of int
        Shape (nx, ny) of the fields.
    factors : ndarray, shape (py // 2 + 1, px // 2 + 1)
        Factors of the waves, transposed and divided by the number of entries of a period.
    periods : tuple of int
        Periods (px, py) of the kernel [nodes].
    largest : float
        Largest value of the spectrum.
    """

    def __init__(
        self,
        shape: tuple[int, int],
        factors: Real,
        periods: tuple[int, int],
        largest: float,
    ) -> None:
        self.shape = shape
        self.largest = largest
        self.periods = periods
        self._memory: dict[str, Real] = {}  # flat buffers by the name of their use
        self._make_buffers(factors)

    def in_single_precision(self) -> "LargeFilter":
        """Return a filter by the same spectrum in single precision.

        The two must not be used at the same time, because their buffers share memory.
        """
        single = copy(self)  # a shallow copy: both have one `_memory`
        single._make_buffers(self.factors.astype(np.float32))
        return single

    def _make_buffers(self, factors: Real) -> None:
        """Set the factors, buffers, the first lane and `bytes`.

        `factors` are those of the constructor.
        """
        rows = self.shape[0]
        columns = len(factors)
        if factors.dtype == np.float32:
            # Each factor is repeated, so that one real product serves real and imaginary parts.
            self.factors = np.repeat(factors, 2, axis=1)
        else:  # double precision is used a few times in a solve: less memory matters more
            self.factors = factors
        waves = _wave_type(factors)
        self.field: Real = self._buffer("fields", self.shape, factors.dtype)
        # A row is as long as whole lines of the cache, and one more line as a gap.
        line = GAP_BYTES // waves.itemsize
        width = -(-columns // line) * line + line
        self.waves: Any = self._buffer("waves", (rows, width), waves)[:, :columns]
        self._lanes = [_Lane(self)]
        arrays: tuple[Any, ...] = self.factors, self.field, self.waves.base
        self.bytes = sum(array.nbytes for array in arrays) + self._lanes[0].bytes

    def _buffer(self, name: str, shape: tuple[int, int], dtype: Any) -> Real:
        """Return a buffer in the memory of this name, which both precisions share.

        The first call for a name allocates the memory. It is for double precision, so that the
        memory suffices for both.
        """
        if name not in self._memory:
            self._memory[name] = _aligned((math.prod(shape),), dtype)
        memory = self._memory[name].view(dtype)
        buffer: Real = memory[: math.prod(shape)].reshape(shape)
        return buffer

    def transform(self) -> None:
        """Filter the field in place."""
        missing = threads_here() - len(self._lanes)
        if missing > 0:  # more threads than in any earlier call
            with unforked():
                self._lanes += [_Lane(self) for _ in range(missing)]
        rows, columns = self.waves.shape
        self._share(_Lane.transform_rows, rows, ROWS)
        self._share(_Lane.filter_columns, columns, self._lanes[0].columns)
        self._share(_Lane.transform_back, rows, ROWS)

    def _share(
        self, work: Callable[["_Lane", slice], None], size: int, length: int
    ) -> None:
        """Cut `size` rows or columns into slices of at most `length`, and do the work on them.

        Threads share the slices. `work` takes the lane of its thread and a slice.
        """
        slices = [
            slice(first, min(first + length, size)) for first in range(0, size, length)
        ]
        share(lambda thread, part: work(self._lanes[thread], part), slices)


class _Lane:
    """The buffers and plans of one thread, which transforms some rows or columns at a time.

    Buffers that transforms read stay zero beyond the field, because nothing is written there.

    Parameters
    ----------
    owner : LargeFilter
        The filter, whose field, waves and factors the lane uses.

    Attributes
    ----------
    columns : int
        Number of columns that are filtered at a time.
    bytes : int
        Memory of buffers and plans [bytes].
    """

    def __init__(self, owner: LargeFilter) -> None:
        self._field = owner.field
        self._waves = owner.waves
        self._factors = owner.factors
        self._make_row_plans(owner.shape[0], owner.periods[1])
        self._make_column_plans(owner.periods[0])
        buffers = self._padded, self._returned, self._filtered, self._source, self._target
        self.bytes = sum(
            (array if array.base is None else array.base).nbytes for array in buffers
        )
        self.bytes += (2 + 2 * len(self._rows_forward)) * PLAN_BYTES

    def _make_row_plans(self, rows: int, period: int) -> None:
        """Make the buffers and plans of rows, for `ROWS` of them and for the remaining ones."""
        dtype = self._field.dtype
        self._padded = _aligned((ROWS, period), dtype)
        self._returned = _aligned((ROWS, period), dtype)
        self._rows_forward = {}  # plans by the number of rows
        self._rows_backward = {}
        # A part has `ROWS` rows, or the rows that remain at the end.
        for count in {min(ROWS, rows), rows % ROWS} - {0}:
            waves = self._waves[:count]
            if count < ROWS:  # the remaining rows are the last ones
                waves = self._waves[rows - count :]
            self._rows_forward[count] = _plan(self._padded[:count], waves)
            self._rows_backward[count] = _plan(
                waves, self._returned[:count], backward=True
            )

    def _make_column_plans(self, period: int) -> None:
        """Make the buffers and plans of columns."""
        wave_type = self._waves.dtype
        self.columns = max(BATCH_BYTES // (period * wave_type.itemsize), 1)
        length = period + GAP_BYTES // wave_type.itemsize
        self._source = _aligned((self.columns, length), wave_type)[:, :period]
        self._target = _aligned((self.columns, length), wave_type)[:, :period]
        # No gap is needed here: nothing reads or writes across the columns of this buffer.
        self._filtered: Any = _aligned((self.columns, period), wave_type)
        self._forward = _plan(self._source, self._filtered)
        self._backward = _plan(self._filtered, self._target, backward=True)

    def transform_rows(self, part: slice) -> None:
        """Pad a part of the field's rows, and write their waves to the rows of waves."""
        rows = self._field[part]
        padded = self._padded[: len(rows)]
        padded[:, : rows.shape[1]] = rows
        forward = self._rows_forward[len(rows)]
        forward.update_arrays(padded, self._waves[part])
        forward.execute()

    def filter_columns(self, part: slice) -> None:
        """Filter a part of the columns of waves: transform, multiply by the factors, go back."""
        waves = self._waves[:, part]
        factors = self._factors[part]
        rows, columns = waves.shape
        self._source[:columns, :rows] = waves.T
        self._forward.execute()
        values: Any = self._filtered[:columns]
        repeats = 1
        if factors.dtype == np.float32:  # real and imaginary parts have a factor each
            values = values.view(np.float32)
            repeats = 2
        half = factors.shape[1]  # length of the factors up to half of a period
        values[:, :half] *= factors
        values[:, half:] *= _mirrored_half(factors, self._filtered.shape[1], repeats)
        self._backward.execute()
        waves[:] = self._target[:columns, :rows].T

    def transform_back(self, part: slice) -> None:
        """Transform a part of the rows of waves back into the field, without the padding."""
        rows = self._field[part]
        returned = self._returned[: len(rows)]
        backward = self._rows_backward[len(rows)]
        backward.update_arrays(self._waves[part], returned)
        backward.execute()
        rows[:] = returned[:, : rows.shape[1]]


class CosineFilter:
    """A spectrum that is applied by cosine transforms to a field and its mirror images.

    The mirrors are half a cell beyond the outer nodes. Cosine
    transforms of types II and III diagonalise every even convolution of such a field (Martucci
    1994, IEEE Transactions on Signal Processing 42), without padding. scipy's transforms are faster
    than those of FFTW, which has no vector instructions for them.

    Parameters
    ----------
    spectrum : ndarray, shape (nx, ny)
        Factor of the wave with i and j half periods along the sides.
    dtype : str
        Precision, "float64" or "float32".
    """

    def __init__(self, spectrum: Field, dtype: str = "float64") -> None:
        self.shape: tuple[int, int] = spectrum.shape[0], spectrum.shape[1]
        self.largest = float(spectrum.max())
        self._factors = spectrum.astype(dtype)
        self.field = np.zeros(self.shape, dtype)
        self.bytes = 2 * self.field.nbytes

    def in_single_precision(self) -> "CosineFilter":
        """Return a filter by the same spectrum in single precision, with a buffer of its own."""
        return CosineFilter(self._factors, "float32")

    def transform(self) -> None:
        """Filter the field in place."""
        with unforked():
            workers = threads_here() if self.field.size >= LARGE else 1
            waves: Any = fft.dctn(self.field, type=2, overwrite_x=True, workers=workers)
            waves *= self._factors
            result: Any = fft.idctn(waves, type=2, overwrite_x=True, workers=workers)
            # scipy may have worked in place, but need not have.
            if not np.may_share_memory(result, self.field):
                self.field[:] = result


class RowTransform:
    """Transforms of real rows, one band of rows after the other: Fourier's waves or cosines.

    Parameters
    ----------
    rows : int
        Number of rows in a band.
    columns : int
        Nodes of a row.
    is_periodic : bool
        Whether rows repeat themselves, so that they have Fourier's waves. Otherwise they have the
        cosines of rows that mirror themselves half a node beyond their ends.

    Attributes
    ----------
    band : ndarray, shape (rows, columns)
        Buffer for the rows, which `waves` may overwrite.
    count : int
        Number by which amplitudes are multiplied in `waves`: nodes of a period.
    bytes : int
        Memory that the transform occupies [bytes].
    """

    def __init__(self, rows: int, columns: int, *, is_periodic: bool) -> None:
        self.band = _aligned((rows, columns), np.float64)
        self.count = columns if is_periodic else 2 * columns
        self.bytes = self.band.nbytes
        self._waves: Any = None
        self._plan: Plan | None = None
        if is_periodic:
            self._waves = _aligned((rows, columns // 2 + 1), np.complex128)
            self._plan = _plan(self.band, self._waves)
            self.bytes += self._waves.nbytes + PLAN_BYTES

    def waves(self) -> Any:
        """Transform the rows in the buffer.

        Returns
        -------
        ndarray, shape (rows, columns // 2 + 1) or (rows, columns)
            Complex amplitudes of the waves, or real ones of the cosines, times `count`. The next
            call may overwrite them [unit of the rows].
        """
        if self._plan is None:
            with unforked():
                return fft.dct(self.band, overwrite_x=True)
        self._plan.execute()
        return self._waves


def _wave_type(factors: Real) -> np.dtype[Any]:
    """Return the complex type of waves with the precision of their factors."""
    return np.result_type(factors.dtype, np.complex64)


def _mirrored_half(factors: Real, period: int, repeats: int = 1) -> Real:
    """Return the factors beyond half a period, which mirror the factors before it.

    Each row of `factors` has the factors from 0 to half a period, each one `repeats` times. The
    result is a view of `factors`.
    """
    missing = repeats * period - factors.shape[1]
    return factors[:, repeats : repeats + missing][:, ::-1]


class Plan(Protocol):
    """A planned transform of several vectors, which also serves other arrays of equal layout."""

    def execute(self) -> None:
        """Transform the present source into the present target."""

    def update_arrays(self, source: Any, target: Any) -> None:
        """Replace source and target.

        Parameters
        ----------
        source : ndarray
            Array to transform, with the shape, strides and alignment of the present source.
        target : ndarray
            Array of the results, with the shape, strides and alignment of the present target.
        """


def _plan(source: Any, target: Any, *, backward: bool = False) -> Plan:
    """Plan transforms from one array to another along the second axis.

    A backward transform may destroy its source.
    """
    direction = "FFTW_FORWARD"
    flags: tuple[str, ...] = ("FFTW_ESTIMATE",)
    if backward:
        direction = "FFTW_BACKWARD"
        flags = ("FFTW_ESTIMATE", "FFTW_DESTROY_INPUT")
    plan = pyfftw.FFTW(source, target, axes=(1,), direction=direction, flags=flags)
    return cast("Plan", plan)


def _aligned(shape: tuple[int, ...], dtype: Any) -> Real:
    """Return zeros at an address that FFTW's vector instructions can load from."""
    zeros: Real = pyfftw.zeros_aligned(shape, dtype)
    return zeros


class _Kept(threading.local):
    """The filters that this thread keeps; each thread sees attributes of its own.

    Attributes
    ----------
    memory : _Memory
        Count of the bytes of these filters, which all threads can read.
    filters : OrderedDict
        Filters by the function that made them and its arguments, in the order of their last use.
    """

    def __init__(self) -> None:
        self.memory = _Memory()
        self.filters: OrderedDict[tuple[Any, ...], Any] = OrderedDict()
        with unforked(), _COUNTING:
            _MEMORIES.add(self.memory)


class _Memory:
    """Count of the bytes of the filters that one thread keeps; it is freed with the thread."""

    bytes = 0  # memory of all these filters [bytes]


# The memories of all threads, and the lock under which they are added up.
_MEMORIES: WeakSet[_Memory] = WeakSet()
_COUNTING = threading.Lock()
_KEPT = _Kept()


def kept(make: Callable[[*Arguments], Kind]) -> Callable[[*Arguments], Kind]:
    """Let each thread keep the filters that a function makes, for later calls.

    Filters have buffers, so that no two threads can share one. If the filters of all threads take
    more memory than `KEPT_BYTES` and `KEPT_LARGEST` allow, the thread that makes another filter
    forgets the filters that it used least recently.

    Parameters
    ----------
    make : callable
        Function that makes a filter from hashable positional arguments.

    Returns
    -------
    callable
        The function, which returns the kept filter if this thread has one for its arguments.
    """

    @wraps(make)
    def kept_or_made(*arguments: *Arguments) -> Kind:
        """Return the filter that this thread keeps for the arguments, or make and keep it."""
        filters = _KEPT.filters
        key = make, *arguments
        if key in filters:
            filters.move_to_end(key)
            earlier: Kind = filters[key]
            return earlier
        # No other thread may fork now: the child would get copies of the locks that are held while
        # plans are made.
        with unforked():
            new = make(*arguments)
            filters[key] = new
            _KEPT.memory.bytes += new.bytes
            _forget_oldest()
        return new

    return kept_or_made


def _forget_oldest() -> None:
    """Forget filters of this thread until the filters of all threads are within the bounds.

    The bound is the larger one of `KEPT_BYTES` and `KEPT_LARGEST` times this thread's largest
    filter. The least recently used filters go first, and the `FEWEST_KEPT` latest ones stay in any
    case.
    """
    filters = _KEPT.filters
    largest = max(kept_filter.bytes for kept_filter in filters.values())
    with _COUNTING:
        occupied = sum(memory.bytes for memory in _MEMORIES)
    excess = occupied - max(KEPT_BYTES, KEPT_LARGEST * largest)
    while excess > 0 and len(filters) > FEWEST_KEPT:
        _, oldest = filters.popitem(last=False)
        _KEPT.memory.bytes -= oldest.bytes
        excess -= oldest.bytes


@kept
def row_transform(rows: int, columns: int, is_periodic: bool) -> RowTransform:
    """Return a transform of bands of rows.

    Parameters
    ----------
    rows, columns, is_periodic
        See `RowTransform`.

    Returns
    -------
    RowTransform
        The transform. It is shared by later calls on this thread, with its buffers.
    """
    return RowTransform(rows, columns, is_periodic=is_periodic)
