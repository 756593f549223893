"""Filters: real, even spectra that are applied to fields by Fourier or cosine transforms.

No other module imports pyfftw. Every plan is made with FFTW_ESTIMATE, because FFTW_MEASURE chooses
by timing, so that two processes could differ in the last bits of a result.
"""

import math
import threading
from collections import OrderedDict
from collections.abc import Callable
from copy import copy
from functools import wraps
from typing import Any, Protocol, TypeVar, TypeVarTuple, cast
from weakref import WeakSet

import numpy as np
import pyfftw
from scipy import fft

from bem.arrays import Field, Real
from bem.threads import share, threads_here, unforked

# Entries of a padded field from which on threads share its transforms, and rows are padded a few at
# a time: below, whole fields fit into the caches (1.06 to 1.22 times faster at 129 nodes a side).
LARGE = 2**19

# Memory of the columns that are filtered at a time: they stay in the processor's cache.
BATCH_BYTES = 256 * 2**10

# Rows of a large field that are transformed at a time.
ROWS = 32

# Memory by which columns in a buffer lie apart beyond their length. Columns a power of two apart
# would compete for the same sets of the processor's cache.
GAP_BYTES = 64

# Memory of one of FFTW's plans, estimated because FFTW does not tell.
PLAN_BYTES = 5 * 2**10

# Memory of the filters that all threads keep for later solves; the same over the memory of the
# largest filter, if that is more; and the filters that a thread keeps whatever their memory is.
KEPT_BYTES, KEPT_LARGEST, FEWEST_KEPT = 256 * 2**20, 4, 4

Kind = TypeVar("Kind", bound="FieldFilter")
Given = TypeVarTuple("Given")


class FieldFilter(Protocol):
    """A linear map of (nx, ny) fields.

    Attributes
    ----------
    shape : tuple of int
        Shape (nx, ny) of the fields.
    field : ndarray, shape (nx, at least ny)
        Buffer of `transform`: the field, and zeros beyond its columns.
    bytes : int
        Memory that the filter occupies.
    largest : float
        Largest value of the spectrum, which no eigenvalue exceeds.
    """

    shape: tuple[int, int]
    field: Real
    bytes: int
    largest: float

    def transform(self) -> None:
        """Filter the field in place; columns beyond it are undefined afterwards."""


def filtered(by: FieldFilter, field: Real) -> Real:
    """Filter a whole (nx, ny) field; the next use of the filter overwrites the result."""
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
    """Return the filter by a Fourier transform that suits the size of a field.

    Parameters
    ----------
    shape : tuple of int
        Shape (nx, ny) of the fields.
    spectrum : ndarray, shape (px // 2 + 1, py // 2 + 1)
        Transform of a kernel that is even along both axes, up to half of either period.
    dtype : str
        Precision: "float64", or "float32", which takes less time and rounds to 1e-7.
    periods : tuple of int
        Periods (px, py) of the kernel.
    """
    factors = (spectrum.T / math.prod(periods)).astype(dtype, copy=False)
    kind = LargeFilter if shape[0] * periods[1] >= LARGE else Filter
    return kind(shape, factors, periods, float(spectrum.max()))


class Filter:
    """A spectrum that is applied to small fields by pruned transforms.

    Neither rows of zeros in the input nor unused rows of the output are transformed, so that the
    padding costs half of the second axis and nothing of the first. Waves along the second axis are
    stored column by column and filtered in batches, in a buffer that the cache holds.

    Parameters
    ----------
    shape, factors, periods, largest
        See `spectral_filter`; the factors are those of the waves, in columns.
    """

    def __init__(
        self,
        shape: tuple[int, int],
        factors: Real,
        periods: tuple[int, int],
        largest: float,
    ) -> None:
        self.shape, self.largest, self.periods = shape, largest, periods
        period, columns = periods[0], len(factors)
        waves = "complex64" if factors.dtype == np.float32 else "complex128"
        # Coefficients are repeated, so that a real product serves real and imaginary parts.
        whole = np.concatenate([factors, _other_half(factors, period)], axis=1)
        self._factors = np.repeat(whole, 2, axis=1)
        self.field: Real = _aligned((shape[0], periods[1]), factors.dtype)
        wide = period + GAP_BYTES // np.dtype(waves).itemsize
        self._waves = _aligned((columns, wide), waves)[:, :period]
        inside = self._waves[:, : shape[0]]
        self._there = _plan(self.field, inside.T)
        self._back = _plan(inside.T, self.field, backward=True)
        fitting = max(BATCH_BYTES // self._waves[:1].nbytes, 1)
        size = -(-columns // max(round(columns / fitting), 1))
        buffer: Any = _aligned((size, period), waves)
        self._batches = []
        for first in range(0, columns, size):
            some = self._waves[first : first + size]
            here = buffer[: len(some)]
            self._batches.append(
                (
                    _plan(some, here),
                    (here.view(factors.dtype), self._factors[first : first + size]),
                    _plan(here, some, backward=True),
                    some[:, shape[0] :],
                )
            )
        arrays = self._factors, self.field, self._waves, buffer
        self.bytes = sum(array.nbytes for array in arrays) + 2 * PLAN_BYTES * len(
            self._batches
        )

    def in_single_precision(self) -> "Filter":
        """Return the same filter in single precision."""
        factors = self._factors[:, : 2 * (self.periods[0] // 2 + 1) : 2].astype(
            np.float32
        )
        return Filter(self.shape, factors, self.periods, self.largest)

    def transform(self) -> None:
        """Filter the field in place; columns beyond it are undefined afterwards."""
        try:
            self._there.execute()
            for forward, (waves, factors), backward, beyond in self._batches:
                forward.execute()
                np.multiply(waves, factors, out=waves)
                backward.execute()
                beyond.fill(0)
            self._back.execute()
        except BaseException:  # on Ctrl-C, for example: the filter is used again
            self._waves.fill(0)
            raise


class LargeFilter:
    """A spectrum that is applied to large fields, reading and writing memory as rarely as it can.

    Fields hold no padding. A few rows at a time are padded in the processor's cache and transformed
    there; only their waves go to memory. A few columns of waves at a time are then copied into the
    cache, filtered, and copied back. Threads share the rows and the columns.

    Parameters
    ----------
    shape, factors, periods, largest
        See `spectral_filter`; the factors are those of the waves, in columns.
    """

    def __init__(
        self,
        shape: tuple[int, int],
        factors: Real,
        periods: tuple[int, int],
        largest: float,
    ) -> None:
        self.shape, self.largest, self.periods = shape, largest, periods
        self._rooms: dict[str, Real] = {}
        self._open(factors)

    def in_single_precision(self) -> "LargeFilter":
        """Return the same filter in single precision.

        The two must not be used at once: their buffers lie in the same memory.
        """
        single = copy(self)
        single._open(self.factors.astype(np.float32))
        return single

    def _open(self, factors: Real) -> None:
        """Make the buffers of a filter from factors of half of the waves of each column."""
        rows, dtype, columns = self.shape[0], factors.dtype, len(factors)
        # In double precision, applied a few times in a solve, they are not repeated: less memory.
        self.factors = factors if dtype == np.float64 else np.repeat(factors, 2, axis=1)
        waves = np.dtype("complex64" if dtype == np.float32 else "complex128")
        self.field: Real = self._room("fields", self.shape, dtype)
        line = GAP_BYTES // waves.itemsize
        wide = -(-columns // line) * line + line
        self.waves: Any = self._room("waves", (rows, wide), waves)[:, :columns]
        self._lanes = [_Lane(self)]
        arrays: tuple[Any, ...] = self.factors, self.field, self.waves.base
        self.bytes = sum(array.nbytes for array in arrays) + self._lanes[0].bytes

    def _room(self, name: str, shape: tuple[int, int], dtype: Any) -> Real:
        """Return a buffer in the flat memory that both precisions share."""
        if name not in self._rooms:
            self._rooms[name] = _aligned((math.prod(shape),), dtype)
        room: Real = self._rooms[name].view(dtype)[: math.prod(shape)].reshape(shape)
        return room

    def transform(self) -> None:
        """Filter the field in place."""
        if threads_here() > len(self._lanes):
            with unforked():
                self._lanes += [
                    _Lane(self) for _ in range(threads_here() - len(self._lanes))
                ]
        rows, columns = self.waves.shape
        self._share(_Lane.transform_rows, rows, ROWS)
        self._share(_Lane.filter_columns, columns, self._lanes[0].columns)
        self._share(_Lane.transform_back, rows, ROWS)

    def _share(
        self, work: Callable[["_Lane", slice], None], size: int, length: int
    ) -> None:
        """Do some work on all slices of a length, each thread in its own lane."""
        slices = [
            slice(first, min(first + length, size)) for first in range(0, size, length)
        ]
        share(lambda thread, some: work(self._lanes[thread], some), slices)


class _Lane:
    """The buffers and plans of one thread, which transforms some rows or columns at a time.

    Buffers that transforms read keep their zeros beyond the field: nothing else is written there.
    """

    def __init__(self, owner: LargeFilter) -> None:
        self._field, self._waves, self._factors = owner.field, owner.waves, owner.factors
        dtype, waves, period = owner.field.dtype, owner.waves.dtype, owner.periods[0]
        self.columns = max(BATCH_BYTES // (period * waves.itemsize), 1)
        rows = owner.shape[0]
        self._padded, self._returned = (
            _aligned((ROWS, owner.periods[1]), dtype) for _ in range(2)
        )
        wide = period + GAP_BYTES // waves.itemsize
        self._source, self._target = (
            _aligned((self.columns, wide), waves)[:, :period] for _ in range(2)
        )
        self._filtered: Any = _aligned((self.columns, period), waves)
        self._there, self._back = {}, {}
        for many in {min(ROWS, rows), rows % ROWS} - {0}:
            here = self._waves[rows - many :] if many < ROWS else self._waves[:many]
            self._there[many] = _plan(self._padded[:many], here)
            self._back[many] = _plan(here, self._returned[:many], backward=True)
        self._forward = _plan(self._source, self._filtered)
        self._backward = _plan(self._filtered, self._target, backward=True)
        buffers = self._padded, self._returned, self._filtered, self._source, self._target
        self.bytes = sum(
            (each if each.base is None else each.base).nbytes for each in buffers
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
        here: Any = self._filtered[:columns]
        half, times = factors.shape[1], 1
        if factors.dtype == np.float32:
            here, times = here.view(np.float32), 2
        here[:, :half] *= factors
        here[:, half:] *= _other_half(factors, self._filtered.shape[1], times)
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


class CosineFilter:
    """A spectrum that is applied to a field continued by its mirror images, by cosine transforms.

    The field is continued evenly about its borders, half a cell beyond the outer nodes. Cosine
    transforms of types II and III diagonalise every even convolution of such a field (Martucci
    1994, IEEE Transactions on Signal Processing 42), at the field's own size. Those of scipy take
    less time than FFTW's, which has no vector instructions for them.

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
        """Return the same filter in single precision."""
        return CosineFilter(self._factors, "float32")

    def transform(self) -> None:
        """Filter the field in place."""
        with unforked():
            many = threads_here() if self.field.size >= LARGE else 1
            waves: Any = fft.dctn(self.field, type=2, overwrite_x=True, workers=many)
            waves *= self._factors
            here: Any = fft.idctn(waves, type=2, overwrite_x=True, workers=many)
            if not np.may_share_memory(here, self.field):
                self.field[:] = here


def _other_half(factors: Real, period: int, times: int = 1) -> Real:
    """Return the factors beyond half a period, which mirror those before it, each some times."""
    beyond = times * period - factors.shape[1]
    return factors[:, times : times + beyond][:, ::-1]


class Plan(Protocol):
    """A planned transform of many vectors, which may be applied to other arrays of that layout."""

    def execute(self) -> None:
        """Transform the source that was given last into the target."""

    def update_arrays(self, source: Any, target: Any) -> None:
        """Take another source and target of the same shape, strides and alignment."""


def _plan(source: Any, target: Any, *, backward: bool = False) -> Plan:
    """Plan transforms along the second axis; backward ones may destroy their input."""
    direction = "FFTW_BACKWARD" if backward else "FFTW_FORWARD"
    flags = ("FFTW_ESTIMATE", "FFTW_DESTROY_INPUT") if backward else ("FFTW_ESTIMATE",)
    return cast(
        "Plan", pyfftw.FFTW(source, target, axes=(1,), direction=direction, flags=flags)
    )


def _aligned(shape: tuple[int, ...], dtype: Any) -> Real:
    """Return zeros at an address that FFTW's vector instructions can load from."""
    zeros: Real = pyfftw.zeros_aligned(shape, dtype)
    return zeros


class _Kept(threading.local):
    """The filters last used on this thread, in the order of their last use, and their memory."""

    def __init__(self) -> None:
        self.memory = _Memory()
        self.filters: OrderedDict[tuple[Any, ...], Any] = OrderedDict()
        with unforked(), _COUNTING:
            _MEMORIES.add(self.memory)


class _Memory:
    """The memory of the filters that one thread keeps; it is gone with the thread."""

    bytes = 0


_MEMORIES: WeakSet[_Memory] = WeakSet()
_COUNTING = threading.Lock()
_KEPT = _Kept()


def kept(make: Callable[[*Given], Kind]) -> Callable[[*Given], Kind]:
    """Let each thread keep the filters that a function makes, for the same arguments later.

    Filters hold scratch space too, so that no two threads can share one. All threads keep as many
    as `KEPT_BYTES` allow.
    """

    @wraps(make)
    def found(*arguments: *Given) -> Kind:
        filters, key = _KEPT.filters, (make, *arguments)
        if key in filters:
            filters.move_to_end(key)
            there: Kind = filters[key]
            return there
        with unforked():  # plans and transforms are made under locks
            made = filters[key] = make(*arguments)
            _KEPT.memory.bytes += made.bytes
            bound = max(
                KEPT_BYTES, KEPT_LARGEST * max(each.bytes for each in filters.values())
            )
            with _COUNTING:
                excess = sum(memory.bytes for memory in _MEMORIES) - bound
            while excess > 0 and len(filters) > FEWEST_KEPT:
                _, oldest = filters.popitem(last=False)
                _KEPT.memory.bytes -= oldest.bytes
                excess -= oldest.bytes
        return made

    return found
