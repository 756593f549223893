"""The half-space convolution by FFTW: the only home of pyfftw.

Every plan is made with FFTW_ESTIMATE: FFTW_MEASURE chooses by timing, so that two processes
could differ in the last bits of a result.
"""

import threading
from collections import OrderedDict
from collections.abc import Callable
from functools import lru_cache
from typing import Any, ClassVar
from weakref import WeakSet

import numpy as np
import pyfftw
from numpy.typing import NDArray
from scipy import fft

from bem.influence import Kernel, influence_coefficients
from bem.sections import unforked

Real = NDArray[Any]  # of float64 or float32, as the filter is
KEPT_BYTES = 256 * 2**20  # what filters kept for the next solves may occupy, on all threads
FEWEST_KEPT = 4  # filters of a thread that are kept whatever they occupy: those of one solve
PLAN_BYTES = 5 * 2**10  # of one of FFTW's plans, whose own tables are out of sight
BATCH_BYTES = 256 * 2**10  # of the columns that are filtered at a time
COLUMN_GAP = 8  # entries left unused after a column


class Filter:
    """A real, even, two-dimensional spectrum applied to fields by pruned FFTs.

    Rows that are zero on the way in are not transformed, rows that nobody reads on the way out
    are not either: the padding costs a half of the second axis and nothing of the first.

    Waves along the second axis are kept column by column, with a few unused entries between one
    column and the next: columns a power of two apart would all fall into the same sets of the
    processor's cache. They are filtered a batch at a time, in a buffer that the cache holds.

    Parameters
    ----------
    shape : (nx, ny) of the fields it is applied to
    spectrum : (px, qy) with qy = py//2 + 1, real transform of a kernel of even periods
        (px, py) that is even in both directions
    dtype : "float64", or "float32" for less time (`pytest bench -k convolution`) at 1e-7

    Attributes
    ----------
    field : (nx, py) buffer of `transform`
    bytes : memory that it occupies
    largest : the largest value of the spectrum, which no eigenvalue exceeds
    """

    def __init__(
        self, shape: tuple[int, int], spectrum: NDArray[np.float64], dtype: str = "float64"
    ) -> None:
        period, columns = spectrum.shape[0], spectrum.shape[1]
        across = 2 * (columns - 1)
        # Every coefficient twice, so that a real product serves real and imaginary parts.
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
        """Per batch of columns: forward, its waves and factors, backward, what to clear."""
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
        """Filter `field` [:, :ny], zero beyond, in place; beyond it is left undefined."""
        try:
            self._transform()
        except BaseException:  # Ctrl-C, say: the filter is kept, and its next user finds it as new
            self._waves.fill(0)
            raise

    def _transform(self) -> None:
        self._rows_in()
        for forward, waves, factors, backward, beyond in self._batches:
            forward()
            np.multiply(waves, factors, out=waves)
            backward()
            beyond.fill(0)  # rows beyond nx are zero on the way in
        self._rows_out()

    def __call__(self, field: Real) -> Real:
        """Filter a whole (nx, ny) field."""
        self.field.fill(0)  # what its last user left
        inside = self.field[:, : self.shape[1]]
        inside[:] = field
        self.transform()
        result: Real = inside.copy()
        return result

    def places(self, nodes: NDArray[np.intp]) -> NDArray[np.intp]:
        """Where nodes, as flat indices of (nx, ny), stand in the flat `field`."""
        return _places(self.shape, self.field.shape[1])[nodes]


class Selection:
    """A `Filter` between values on some nodes, everything else being zero.

    Parameters
    ----------
    operator : the filter of the whole field
    nodes : (m,) flat indices into its (nx, ny)
    """

    def __init__(self, operator: Filter, nodes: NDArray[np.intp]) -> None:
        self._operator = operator
        self._places = operator.places(nodes)
        self._field = operator.field.reshape(-1)

    def __call__(self, values: Real) -> Real:
        """(m,) values on the nodes -> (m,) filtered values on the same nodes."""
        return self._apply(self._places, values)[self._places]

    def everywhere(self, values: Real) -> Real:
        """Filter (m,) values on the nodes into a new (nx, ny) field on all nodes of the grid."""
        self._apply(self._places, values)
        field: Real = self._operator.field[:, : self._operator.shape[1]].copy()
        return field

    def spread(self, some: NDArray[np.intp], values: Real) -> Real:
        """(a,) values on nodes[some] -> (m,) filtered values on all the nodes."""
        return self._apply(self._places[some], values)[self._places]

    def within(self, some: NDArray[np.intp], values: Real) -> Real:
        """(a,) values on nodes[some] -> (a,) filtered values on the same nodes."""
        places = self._places[some]
        return self._apply(places, values)[places]

    def _apply(self, places: NDArray[np.intp], values: Real) -> Real:
        self._field.fill(0)  # the filter is shared: clear what its last user left
        self._field[places] = values
        self._operator.transform()
        filtered: Real = self._field
        return filtered


@lru_cache(maxsize=4)
def _places(shape: tuple[int, int], across: int) -> NDArray[np.intp]:
    """Where each node of (nx, ny) stands in a flat field of so many columns."""
    return np.arange(shape[0] * across).reshape(shape[0], across)[:, : shape[1]].reshape(-1)


def _plan(source: Real, target: Real, axis: int, *, backward: bool = False) -> Callable[[], None]:
    """A transform along one axis; a backward one may destroy what it transforms."""
    direction = "FFTW_BACKWARD" if backward else "FFTW_FORWARD"
    flags = ("FFTW_ESTIMATE", "FFTW_DESTROY_INPUT") if backward else ("FFTW_ESTIMATE",)
    plan = pyfftw.FFTW(source, target, axes=(axis,), direction=direction, flags=flags)
    execute: Callable[[], None] = plan.execute
    return execute


def displacement_filter(
    shape: tuple[int, int], kernel: Kernel, aspect: float = 1.0, dtype: str = "float64"
) -> Filter:
    """H: pressure -> displacement, exact for free (non-periodic) boundaries.

    Parameters
    ----------
    shape : (nx, ny) nodes
    kernel : see `bem.influence.influence_coefficients`
    aspect : second side of a cell over its first [1]
    dtype : "float64" or "float32"

    Returns
    -------
    Filter of (nx, ny) pressure into (nx, ny) displacement [first side of a cell / E*]; shared
    between its callers on one thread: use it and leave it
    """
    return kept_filter(_make_displacement_filter, shape, kernel, aspect, dtype)


def kept_filter(make: Callable[..., Filter], *arguments: Any) -> Filter:
    """The filter that `make` makes from these arguments, kept on this thread for the next call."""
    return _FILTERS.get(make, arguments)


def fast_period(nodes: int) -> int:
    """Smallest even period with small prime factors that the kernel of `nodes` nodes allows.

    The kernel is even, so 2 nodes - 2 is exact: a power of two for 2^k + 1 nodes.
    """
    return 2 * int(fft.next_fast_len(max(nodes - 1, 1), real=True))


def _make_displacement_filter(
    shape: tuple[int, int], kernel: Kernel, aspect: float, dtype: str
) -> Filter:
    table = influence_coefficients(shape, kernel, aspect)
    offsets = []
    for nodes in shape:
        index = np.arange(fast_period(nodes))
        # Offsets beyond the grid never meet a node: any value serves there.
        offsets.append(np.minimum(np.minimum(index, len(index) - index), nodes - 1))
    return Filter(shape, fft.rfft2(table[np.ix_(*offsets)]).real, dtype)


class _Kept:
    """The filters of one thread, the one used last at the end, and what they occupy."""

    def __init__(self) -> None:
        self.filters: OrderedDict[tuple[Any, ...], Filter] = OrderedDict()
        self.bytes = 0


class _Filters(threading.local):
    """The filters used last on this thread, as many as `KEPT_BYTES` of all threads allow.

    They are scratch space too, so that no thread can use another's.
    """

    _threads: ClassVar[WeakSet[_Kept]] = WeakSet()
    _changing = threading.Lock()

    def __init__(self) -> None:
        self._kept = _Kept()
        with unforked(), self._changing:
            self._threads.add(self._kept)

    def get(self, make: Callable[..., Filter], arguments: tuple[Any, ...]) -> Filter:
        filters, key = self._kept.filters, (make, *arguments)
        found = filters.get(key)
        if found is not None:
            filters.move_to_end(key)
            return found
        with unforked():  # plans and transforms are made under locks
            made = filters[key] = make(*arguments)
            self._kept.bytes += made.bytes
            self._forget()
        return made

    def _forget(self) -> None:
        """Let this thread's oldest filters go while those of all threads are too large."""
        with self._changing:
            excess = sum(kept.bytes for kept in self._threads) - KEPT_BYTES
        while excess > 0 and len(self._kept.filters) > FEWEST_KEPT:
            _, oldest = self._kept.filters.popitem(last=False)
            self._kept.bytes -= oldest.bytes
            excess -= oldest.bytes


_FILTERS = _Filters()
