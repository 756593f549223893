"""The influence matrix of a few nodes, factorised: pressure on any part of them, exactly.

A contact set that is too large gives itself away by tension. Taking the nodes that pull out of a
factorised matrix costs far less than a factor of what is left, and on rough surfaces hardly any of
them ever comes back.
"""

from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bem.influence import Kernel, influence_coefficients

Values = NDArray[np.float64]
Nodes = NDArray[np.intp]
Real = NDArray[Any]  # of float64 or float32

# (sum of the pressure under u, sum of it under a displacement of one) -> displacement of the far
# field besides u
FarFieldLaw = Callable[[float, float], float]

# Contact sets tried before the solution is left to others; and what counts as penetration of a
# node taken out, over the largest displacement, for each precision.
CONTACT_SETS = 20
PENETRATION = {"float64": 1e-14, "float32": 1e-6}

# From this share of the nodes on, those that pull are left out of a new factor.
MANY = 0.15

ROWS = 64  # gathered at a time: their places fit into the cache


class InfluenceMatrix:
    """H between nodes of a grid, entry by entry.

    Parameters
    ----------
    shape, kernel, aspect : see `bem.influence.influence_coefficients`
    dtype : "float64" or "float32"

    Attributes
    ----------
    dtype : of the entries
    """

    def __init__(
        self, shape: tuple[int, int], kernel: Kernel, aspect: float, dtype: str = "float64"
    ) -> None:
        self.dtype = np.dtype(dtype)
        self._columns = shape[1]
        self._offsets = _all_offsets(shape, kernel, aspect, dtype)
        self._width = 2 * shape[1] - 1
        self._centre = (shape[0] - 1) * self._width + shape[1] - 1

    def between(self, nodes: Nodes, loaded: Nodes) -> Real:
        """(a,), (b,) flat indices -> (a, b) displacement of nodes from unit pressure on loaded."""
        places = np.subtract.outer(self._places(nodes), self._places(loaded) - self._centre)
        found: Real = self._offsets.take(places, mode="clip")
        return found

    def among(self, nodes: Nodes) -> Real:
        """(n,) flat indices -> (n, n) in Fortran's order; what is above the diagonal is not set."""
        n, places = len(nodes), self._places(nodes)
        loaded = places - self._centre
        matrix = np.empty((n, n), self._offsets.dtype)
        buffer = np.empty(min(ROWS, n) * n, np.intp)
        for first in range(0, n, ROWS):
            rows = slice(first, min(first + ROWS, n))
            shape = rows.stop - first, n - first
            offsets = buffer[: shape[0] * shape[1]].reshape(shape)
            np.subtract.outer(places[rows], loaded[first:], out=offsets)
            np.take(self._offsets, offsets, out=matrix[rows, first:], mode="clip")
        return matrix.T

    def _places(self, nodes: Nodes) -> Nodes:
        """Differences of these, and the centre, are places in the table of all offsets."""
        row, column = np.divmod(nodes, self._columns)
        places: Nodes = row * self._width + column
        return places


@lru_cache(maxsize=4)
def _all_offsets(shape: tuple[int, int], kernel: Kernel, aspect: float, dtype: str) -> Real:
    """Coefficients of all offsets, negative ones first, so that one difference finds any."""
    table = influence_coefficients(shape, kernel, aspect).astype(dtype)
    table = np.concatenate([table[:0:-1], table])
    return np.concatenate([table[:, :0:-1], table], axis=1).reshape(-1)


class ContactFactor:
    """Cholesky's factor of H on n nodes, out of which nodes can be taken.

    With A = L L^T on all of them, and V = L^-1 E, where E picks out the nodes taken out, the
    pressure under u that is zero on these is L^-T (y - V q) with y = L^-1 u and V^T V q = V^T y,
    and q is how far they then penetrate. Where many pull at a time, a factor of the others is
    cheaper, and they are lost sight of.

    Parameters
    ----------
    matrix : H
    nodes : (n,) flat indices. The first should be those that are least likely to be taken out: the
        last cost less

    Attributes
    ----------
    kept : (k,) places in `nodes` that the factor is of, taken out or not

    Raises
    ------
    numpy.linalg.LinAlgError
        if the matrix of these nodes is not positive definite in its precision
    """

    kept: Nodes

    def __init__(self, matrix: InfluenceMatrix, nodes: Nodes) -> None:
        single = matrix.dtype == np.float32
        self._matrix, self._nodes = matrix, nodes
        self._lapack = lapack("s" if single else "d")
        self._precision = PENETRATION["float32" if single else "float64"]
        self._renew(np.arange(len(nodes)))

    def press(
        self,
        interference: Values,
        law: FarFieldLaw | None = None,
        most_sets: int = CONTACT_SETS,
    ) -> tuple[Values, int]:
        """Take out what pulls, and put back what penetrates once nothing pulls, until all stands.

        Parameters
        ----------
        interference : (n,) u [any length]
        law : how the far field answers, for one that is not rigid
        most_sets : bound on the contact sets

        Returns
        -------
        ((n,) pressure, not negative; contact sets tried)

        Raises
        ------
        numpy.linalg.LinAlgError
            if no pressure answers to that law
        """
        forward = self._forward(interference[self.kept], law)
        tolerance = self._precision * float(np.abs(interference).max())
        pressure, sets = np.zeros_like(interference), 0
        while sets < most_sets:
            values, penetration = self._backward(forward, law)
            if not np.isfinite(values.sum()):
                raise np.linalg.LinAlgError
            pressure[:] = 0
            pressure[self.kept] = np.maximum(values, 0)
            sets += 1
            pulling, sinking = (values < 0).nonzero()[0], penetration > tolerance
            if len(pulling) > MANY * len(values):
                self._renew(self.kept[values > 0])
                forward = self._forward(interference[self.kept], law)
            elif pulling.size:
                self._take_out(pulling)
            elif sinking.any():
                self._put_back(sinking)
            else:
                break
        return pressure, sets

    def correct(self, residual: Values, tolerance: float, law: FarFieldLaw | None = None) -> Values:
        """(n,) what is left of u -> (n,) change of the pressure on the nodes not taken out.

        Those that were, but penetrate by more than the tolerance, are put back.
        """
        sinking = residual[self.kept[self._out]] > tolerance
        if sinking.any():
            self._put_back(sinking)
        left = residual[self.kept]
        left[self._out] = 0  # an open gap, which rounding would carry into the contact
        change = np.zeros_like(residual)
        change[self.kept] = self._backward(self._forward(left, law), law)[0]
        return change

    def _renew(self, kept: Nodes) -> None:
        self.kept = kept
        self._lower = self._factorised(self._matrix.among(self._nodes[kept]))
        self._taken = np.zeros((len(kept), 0), self._lower.dtype, order="F")
        self._gram = np.zeros((0, 0), self._lower.dtype)
        self._out = np.zeros(0, np.intp)  # places in `kept`

    def _forward(self, interference: Values, law: FarFieldLaw | None) -> Real:
        """L^-1 of u, and of a displacement of one where the far field needs it."""
        sides = np.ones((len(interference), 1 if law is None else 2), self._lower.dtype, order="F")
        sides[:, 0] = interference
        return self._triangular(self._lower, sides)

    def _backward(self, forward: Real, law: FarFieldLaw | None) -> tuple[Values, Values]:
        """Pressure, and penetration of the nodes taken out."""
        inside = forward
        sinking = np.zeros((0, forward.shape[1]), forward.dtype)
        if len(self._out):
            sinking = self._lapack.potrs(self._gram, self._taken.T @ forward, lower=1)[0]
            inside = forward - self._taken @ sinking
        pressure = self._triangular(self._lower, inside, transposed=1).astype(np.float64)
        pressure[self._out] = 0
        if law is None:
            return pressure[:, 0], sinking[:, 0]
        moved = law(float(pressure[:, 0].sum()), float(pressure[:, 1].sum()))
        return pressure[:, 0] + moved * pressure[:, 1], sinking[:, 0] + moved * sinking[:, 1]

    def _take_out(self, nodes: Nodes) -> None:
        columns = np.zeros((len(self._lower), len(nodes)), self._lower.dtype, order="F")
        columns[nodes, np.arange(len(nodes))] = 1
        first = int(nodes.min())  # above it, columns of V are zero
        columns[first:] = self._triangular(self._lower[first:, first:], columns[first:])
        self._taken = np.concatenate([self._taken, columns], axis=1)
        self._out = np.concatenate([self._out, nodes])
        self._gram = self._factorised(self._taken.T @ self._taken)

    def _put_back(self, nodes: NDArray[np.bool_]) -> None:
        self._taken, self._out = self._taken[:, ~nodes], self._out[~nodes]
        self._gram = self._factorised(self._taken.T @ self._taken)

    def _factorised(self, matrix: Real) -> Real:
        lower, wrong = self._lapack.potrf(matrix, lower=1, clean=0, overwrite_a=1)
        if wrong:
            raise np.linalg.LinAlgError
        factor: Real = lower
        return factor

    def _triangular(self, lower: Real, sides: Real, transposed: int = 0) -> Real:
        solution: Real = self._lapack.trtrs(lower, sides, lower=1, trans=transposed)[0]
        return solution


class Lapack(NamedTuple):
    """Cholesky's factorisation, with a solve, a solve by it, and a triangular solve."""

    potrf: Callable[..., Any]
    posv: Callable[..., Any]
    potrs: Callable[..., Any]
    trtrs: Callable[..., Any]


@lru_cache(maxsize=2)
def lapack(precision: str) -> Lapack:
    """The routines of a precision, "s" or "d"."""
    from scipy.linalg import lapack  # a tenth of a second, which most commands never need

    return Lapack(*(getattr(lapack, precision + name) for name in Lapack._fields))
