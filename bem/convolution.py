"""The half-space convolution and its circulant inverse by FFTW: the only home of pyfftw.

Every plan is made with FFTW_ESTIMATE: FFTW_MEASURE chooses by timing, so that two processes
could differ in the last bits of a result.
"""

import threading
from collections import OrderedDict
from collections.abc import Callable
from typing import Any

import numpy as np
import pyfftw
from numpy.typing import NDArray
from scipy import fft

from bem.influence import Kernel, influence_coefficients

Real = NDArray[Any]  # of float64 or float32, as the filter is
KEPT_BYTES = 256 * 2**20  # what filters kept for the next solve may occupy


class Filter:
    """A real, even, two-dimensional spectrum applied to fields by pruned FFTs.

    Rows that are zero on the way in are not transformed, rows that nobody reads on the way out
    are not either: the padding costs a half of the second axis and nothing of the first.

    Parameters
    ----------
    shape : (nx, ny) of the fields it is applied to
    spectrum : (px, qy) with qy = py//2 + 1, real transform of a kernel of even periods
        (px, py) that is even in both directions
    dtype : "float64", or "float32" for less time (`pytest bench -k convolution`) at 1e-7

    Attributes
    ----------
    source, result : (nx, py) buffers of `transform`
    largest : the largest value of the spectrum, which no eigenvalue exceeds
    """

    def __init__(
        self, shape: tuple[int, int], spectrum: NDArray[np.float64], dtype: str = "float64"
    ) -> None:
        periods = spectrum.shape[0], 2 * (spectrum.shape[1] - 1)
        # Every coefficient twice, so that a real product serves real and imaginary parts.
        self._factors = np.repeat(spectrum / (periods[0] * periods[1]), 2, axis=1).astype(dtype)
        self.shape = shape
        self.largest = float(spectrum.max())
        self.source = pyfftw.zeros_aligned((shape[0], periods[1]), dtype)
        self.result = pyfftw.zeros_aligned((shape[0], periods[1]), dtype)
        waves = "complex64" if dtype == "float32" else "complex128"
        self._waves = pyfftw.zeros_aligned(spectrum.shape, waves)
        self._padded = pyfftw.zeros_aligned(spectrum.shape, waves)
        self._parts = self._waves.view(dtype)
        self._plans = self._make_plans()
        self.bytes = sum(
            a.nbytes for a in (self._factors, self.source, self.result, self._padded, self._waves)
        )

    def _make_plans(self) -> tuple[Callable[[], None], ...]:
        # The rows beyond nx of `_padded` stay zero for ever: nothing has to clear them.
        rows_in, rows_out = self._padded[: self.shape[0]], self._waves[: self.shape[0]]
        estimate, consume = "FFTW_ESTIMATE", "FFTW_DESTROY_INPUT"
        back = {"direction": "FFTW_BACKWARD"}
        plans = (
            pyfftw.FFTW(self.source, rows_in, axes=(1,), flags=(estimate,)),
            pyfftw.FFTW(self._padded, self._waves, axes=(0,), flags=(estimate,)),
            pyfftw.FFTW(self._waves, self._waves, axes=(0,), flags=(estimate,), **back),
            pyfftw.FFTW(rows_out, self.result, axes=(1,), flags=(estimate, consume), **back),
        )
        return tuple(plan.execute for plan in plans)

    def transform(self) -> None:
        """Filter `source` [:, :ny], zero beyond, into `result` [:, :ny]."""
        rows_in, columns_in, columns_out, rows_out = self._plans
        rows_in()
        columns_in()
        np.multiply(self._parts, self._factors, out=self._parts)
        columns_out()
        rows_out()

    def __call__(self, field: Real) -> Real:
        """Filter a whole (nx, ny) field."""
        self.source[:, : self.shape[1]] = field
        self.transform()
        result: Real = self.result[:, : self.shape[1]].copy()
        return result

    def places(self, nodes: NDArray[np.intp]) -> NDArray[np.intp]:
        """Where nodes, as flat indices of (nx, ny), stand in the flat `source` and `result`."""
        padding = self.source.shape[1] - self.shape[1]
        places: NDArray[np.intp] = np.asarray(nodes + nodes // self.shape[1] * padding, np.intp)
        return places


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
        self._source = operator.source.reshape(-1)
        self._result = operator.result.reshape(-1)

    def __call__(self, values: Real) -> Real:
        """(m,) values on the nodes -> (m,) filtered values on the same nodes."""
        return self._apply(self._places, values)[self._places]

    def spread(self, some: NDArray[np.intp], values: Real) -> Real:
        """(a,) values on nodes[some] -> (m,) filtered values on all the nodes."""
        return self._apply(self._places[some], values)[self._places]

    def within(self, some: NDArray[np.intp], values: Real) -> Real:
        """(a,) values on nodes[some] -> (a,) filtered values on the same nodes."""
        places = self._places[some]
        return self._apply(places, values)[places]

    def _apply(self, places: NDArray[np.intp], values: Real) -> Real:
        self._operator.source.fill(0)  # the filter is shared: clear what its last user left
        self._source[places] = values
        self._operator.transform()
        result: Real = self._result
        return result


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
    return _FILTERS.get(("displacement", shape, kernel, aspect, dtype), _make_displacement_filter)


def circulant_inverse(
    shape: tuple[int, int], kernel: Kernel, aspect: float = 1.0, dtype: str = "float64"
) -> Filter:
    """Inverse of the circulant matrix next to H in the Frobenius norm (T. Chan 1988).

    Takes what `displacement_filter` takes; works on the unpadded grid, a quarter of its cost.
    """
    return _FILTERS.get(("circulant", shape, kernel, aspect, dtype), _make_circulant_inverse)


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


def _make_circulant_inverse(
    shape: tuple[int, int], kernel: Kernel, aspect: float, dtype: str
) -> Filter:
    rows, columns = (2 * int(fft.next_fast_len((nodes + 1) // 2, real=True)) for nodes in shape)
    periods = rows, columns
    table = influence_coefficients(periods, kernel, aspect)
    for axis, period in enumerate(periods):
        # Per axis c_k = ((m - k) t_k + k t_(m - k)) / m: the mean over each wrapped diagonal.
        steps = np.arange(period)
        share = (steps / period).reshape([-1 if a == axis else 1 for a in (0, 1)])
        table = (1 - share) * table + share * np.take(table, -steps % period, axis=axis)
    return Filter(shape, 1 / fft.rfft2(table).real, dtype)


class _Filters(threading.local):
    """The filters used last on this thread, as many as fit into `KEPT_BYTES`."""

    def __init__(self) -> None:
        self._kept: OrderedDict[tuple[Any, ...], Filter] = OrderedDict()

    def get(self, key: tuple[Any, ...], make: Callable[..., Filter]) -> Filter:
        found = self._kept.pop(key, None)
        self._kept[key] = found or make(*key[1:])
        while len(self._kept) > 2 and sum(kept.bytes for kept in self._kept.values()) > KEPT_BYTES:
            self._kept.popitem(last=False)
        return self._kept[key]


_FILTERS = _Filters()
