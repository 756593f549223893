"""The influence matrix of a few nodes, factorised: pressure on any part of them, exactly.

A contact set that is too large gives itself away by tension. Taking the nodes that pull out of a
factorised matrix costs far less than a factor of what is left. With uniform pressures on the cells
none of them ever comes back, since no node's pressure pulls on another's
(`tests/bem/test_properties.py`); concentrated forces and rounding may make exceptions.
"""

from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bem.influence import InfluenceMatrix

Values = NDArray[np.float64]
Nodes = NDArray[np.intp]
Real = NDArray[Any]  # of float64 or float32

# (sum of the pressure under u, sum of it under a displacement of one) -> displacement of the far
# field besides u
FarFieldLaw = Callable[[float, float], float]

# Contact sets tried before the solution is left to others.
CONTACT_SETS = 20

# From this share of the nodes on, those that pull are left out of a new factor.
MANY = 0.15


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
        self._matrix, self._nodes = matrix, nodes
        self._routines = routines("s" if matrix.dtype == np.float32 else "d")
        self._renew(np.arange(len(nodes)))

    def press(
        self,
        interference: Values,
        law: FarFieldLaw | None = None,
        most_sets: int = CONTACT_SETS,
    ) -> tuple[Values, int]:
        """Take out what pulls until nothing does.

        Parameters
        ----------
        interference : (n,) u, less what the law adds to it [any length]
        law : how the far field answers, for one that is not rigid
        most_sets : bound on the contact sets

        Returns
        -------
        ((n,) pressure, not negative; contact sets tried)

        Raises
        ------
        numpy.linalg.LinAlgError
            if no pressure answers to that law, or rounding leaves none
        """
        forward = self._forward(interference[self.kept], law)
        pressure, sets = np.zeros_like(interference), 0
        while sets < most_sets:
            values = self._backward(forward, law)
            pressure[:] = 0
            pressure[self.kept] = np.maximum(values, 0)
            sets += 1
            pulling = (values < 0).nonzero()[0]
            if not pulling.size:
                break
            if len(pulling) > MANY * len(values):
                self._renew(self.kept[values > 0])
                forward = self._forward(interference[self.kept], law)
            else:
                self._take_out(pulling)
        return pressure, sets

    def correct(self, residual: Values, tolerance: float, law: FarFieldLaw | None = None) -> Values:
        """(n,) what is left of u -> (n,) change of the pressure on the nodes not taken out.

        Those that were, but penetrate by more than the tolerance, are put back. Raises as `press`.
        """
        sinking = residual[self.kept[self._out]] > tolerance
        if sinking.any():
            self._put_back(sinking)
        left = residual[self.kept]
        left[self._out] = 0  # an open gap, which rounding would carry into the contact
        change = np.zeros_like(residual)
        change[self.kept] = self._backward(self._forward(left, law), law)
        return change

    def _renew(self, kept: Nodes) -> None:
        if not kept.size:
            raise np.linalg.LinAlgError
        self.kept = kept
        self._lower = self._factorised(self._matrix.among(self._nodes[kept]))
        self._taken = np.zeros((len(kept), 0), self._lower.dtype, order="F")
        self._gram = np.zeros((0, 0), self._lower.dtype)
        self._out = np.zeros(0, np.intp)  # places in `kept`

    def _forward(self, interference: Values, law: FarFieldLaw | None) -> Real:
        """L^-1 of u, and of a displacement of one where the far field needs it."""
        sides = np.ones((len(interference), 1 if law is None else 2), self._lower.dtype, order="F")
        sides[:, 0] = interference
        return self._solved(self._routines.trtrs, self._lower, sides)

    def _backward(self, forward: Real, law: FarFieldLaw | None) -> Values:
        """Pressure, with what the law adds to the displacement."""
        inside = forward
        if len(self._out):
            sinking = self._solved(self._routines.potrs, self._gram, self._taken.T @ forward)
            inside = forward - self._taken @ sinking
        pressures = self._solved(self._routines.trtrs, self._lower, inside, trans=1)
        pressures = pressures.astype(np.float64)
        pressures[self._out] = 0
        pressure: Values = pressures[:, 0]
        if law is not None:
            plain, uniform = pressures.sum(axis=0)
            pressure = pressure + law(float(plain), float(uniform)) * pressures[:, 1]
        if not np.isfinite(pressure.sum()):
            raise np.linalg.LinAlgError
        return pressure

    def _take_out(self, nodes: Nodes) -> None:
        columns = np.zeros((len(self._lower), len(nodes)), self._lower.dtype, order="F")
        columns[nodes, np.arange(len(nodes))] = 1
        first = int(nodes.min())  # above it, columns of V are zero
        below = self._lower[first:, first:]
        columns[first:] = self._solved(self._routines.trtrs, below, columns[first:])
        self._taken = np.concatenate([self._taken, columns], axis=1)
        self._out = np.concatenate([self._out, nodes])
        self._gram = self._factorised(self._taken.T @ self._taken)

    def _put_back(self, nodes: NDArray[np.bool_]) -> None:
        self._taken, self._out = self._taken[:, ~nodes], self._out[~nodes]
        if self._out.size:
            self._gram = self._factorised(self._taken.T @ self._taken)

    def _factorised(self, matrix: Real) -> Real:
        lower, wrong = self._routines.potrf(matrix, lower=1, clean=0, overwrite_a=1)
        if wrong:
            raise np.linalg.LinAlgError
        factor: Real = lower
        return factor

    def _solved(self, by: Callable[..., Any], lower: Real, sides: Real, **how: int) -> Real:
        solution, wrong = by(lower, sides, lower=1, **how)
        if wrong:
            raise np.linalg.LinAlgError
        solved: Real = solution
        return solved


class Routines(NamedTuple):
    """Cholesky's factorisation, with a solve, a solve by it, and a triangular solve."""

    potrf: Callable[..., Any]
    posv: Callable[..., Any]
    potrs: Callable[..., Any]
    trtrs: Callable[..., Any]


@lru_cache(maxsize=2)
def routines(precision: str) -> Routines:
    """LAPACK's, for a precision "s" or "d"."""
    from scipy.linalg import lapack  # a tenth of a second, which most commands never need

    return Routines(*(getattr(lapack, precision + name) for name in Routines._fields))
