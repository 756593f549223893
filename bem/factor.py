"""The factorised influence matrix of a few nodes, which gives the pressure on any part of them.

A contact set that is too large shows by tension. Removing the nodes under tension from a
factorised matrix costs far less than factorising the matrix of the rest. With uniform pressures on
the cells no removed node ever returns, because no entry off the diagonal of the matrix's inverse is
positive (`tests/bem/test_properties.py`); concentrated forces and rounding may make exceptions.
"""

from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple, Protocol

import numpy as np

from bem.arrays import Mask, Nodes, Real, Values

# Maps the sum of the pressure under u, and its sum under a unit displacement, to the displacement
# of the far field in addition to u.
FarFieldLaw = Callable[[float, float], float]

# Contact sets tried before iterations take over: sets that do not cycle need fewer.
CONTACT_SETS = 20

# Share of nodes under tension above which a new factor of the rest is cheaper than removing them.
MANY = 0.15


class Entries(Protocol):
    """An influence matrix whose entries are known.

    Attributes
    ----------
    dtype : numpy.dtype
        Precision of the entries.
    """

    dtype: Any

    def among(self, nodes: Nodes) -> Real:
        """Return the lower triangle of the (n, n) matrix of (n,) nodes, in Fortran's order."""


class ContactFactor:
    """The Cholesky factor of H on n nodes, from which nodes can be removed.

    Let A = L L^T on all nodes and V = L^-1 E, where E selects the removed nodes. The pressure under
    u that vanishes on the removed nodes is L^-T (y - V q) with y = L^-1 u and V^T V q = V^T y, and
    q is their penetration. If many nodes are removed at a time, the matrix of the rest is
    factorised instead, and the removed nodes can no longer return.

    Parameters
    ----------
    matrix : Entries
        The influence matrix H of the grid.
    nodes : ndarray, shape (n,)
        Flat indices, best ordered with those first that are least likely to be removed: removing
        the last ones costs less.

    Attributes
    ----------
    kept : ndarray, shape (k,)
        Positions in `nodes` that the factor contains, removed or not.

    Raises
    ------
    numpy.linalg.LinAlgError
        If the matrix of these nodes is not positive definite in its precision.
    """

    kept: Nodes

    def __init__(self, matrix: Entries, nodes: Nodes) -> None:
        self._matrix, self._nodes = matrix, nodes
        self._routines = routines("s" if matrix.dtype == np.float32 else "d")
        self._renew(np.arange(len(nodes)))

    def solve(
        self,
        interference: Values,
        law: FarFieldLaw | None = None,
        most_sets: int = CONTACT_SETS,
    ) -> tuple[Values, int]:
        """Remove nodes under tension until none is left.

        Parameters
        ----------
        interference : ndarray, shape (n,)
            Interference u, without the displacement that the law adds [any unit of length].
        law : FarFieldLaw, optional
            Displacement of a far field that is not rigid.
        most_sets : int
            Bound on the contact sets.

        Returns
        -------
        pressure : ndarray, shape (n,)
            Pressure, not negative.
        sets : int
            Contact sets tried.

        Raises
        ------
        numpy.linalg.LinAlgError
            If no pressure satisfies the law, or rounding leaves none.
        """
        forward = self._forward(interference[self.kept], law)
        pressure, sets = np.zeros_like(interference), 0
        while sets < most_sets:
            values = self._backward(forward, law)
            pressure[:] = 0
            pressure[self.kept] = np.maximum(values, 0)
            sets += 1
            tension = (values < 0).nonzero()[0]
            if not tension.size:
                break
            if len(tension) > MANY * len(values):
                self._renew(self.kept[values > 0])
                forward = self._forward(interference[self.kept], law)
            else:
                self._remove(tension)
        return pressure, sets

    def correct(self, residual: Values, tolerance: float, law: FarFieldLaw | None = None) -> Values:
        """Compute the change of pressure that removes a residual; return penetrating nodes.

        Parameters
        ----------
        residual : ndarray, shape (n,)
            Remaining part of u [unit of u].
        tolerance : float
            Penetration above which removed nodes are returned to the factor [unit of u].
        law : FarFieldLaw, optional
            Displacement of a far field that is not rigid.

        Returns
        -------
        ndarray, shape (n,)
            Change of the pressure, zero on removed nodes.

        Raises
        ------
        numpy.linalg.LinAlgError
            If no pressure satisfies the law, or rounding leaves none.
        """
        penetrating = residual[self.kept[self._removed]] > tolerance
        if penetrating.any():
            self._return(penetrating)
        left = residual[self.kept]
        left[self._removed] = 0  # an open gap, which rounding would carry into the contact
        change = np.zeros_like(residual)
        change[self.kept] = self._backward(self._forward(left, law), law)
        return change

    def _renew(self, kept: Nodes) -> None:
        """Factorise the matrix of some of the nodes and forget the rest."""
        if not kept.size:
            raise np.linalg.LinAlgError
        self.kept = kept
        self._lower = self._factorised(self._matrix.among(self._nodes[kept]))
        self._columns = np.zeros((len(kept), 0), self._lower.dtype, order="F")
        self._gram = np.zeros((0, 0), self._lower.dtype)
        self._removed = np.zeros(0, np.intp)  # positions in `kept`

    def _forward(self, interference: Values, law: FarFieldLaw | None) -> Real:
        """Apply L^-1 to u, and to a unit displacement if the law needs it."""
        sides = np.ones((len(interference), 1 if law is None else 2), self._lower.dtype, order="F")
        sides[:, 0] = interference
        return self._solved(self._routines.trtrs, self._lower, sides)

    def _backward(self, forward: Real, law: FarFieldLaw | None) -> Values:
        """Return the pressure under u and the displacement that the law adds."""
        inside = forward
        if len(self._removed):
            penetration = self._solved(
                self._routines.potrs, self._gram, _product(self._columns.T, forward)
            )
            inside = forward - _product(self._columns, penetration)
        pressures = self._solved(self._routines.trtrs, self._lower, inside, trans=1)
        pressures = pressures.astype(np.float64)
        pressures[self._removed] = 0
        pressure: Values = pressures[:, 0]
        if law is not None:
            plain, uniform = pressures.sum(axis=0)
            pressure = pressure + law(float(plain), float(uniform)) * pressures[:, 1]
        if not np.isfinite(pressure.sum()):
            raise np.linalg.LinAlgError
        return pressure

    def _remove(self, nodes: Nodes) -> None:
        """Add the columns of V that force zero pressure on some of the kept nodes."""
        columns = np.zeros((len(self._lower), len(nodes)), self._lower.dtype, order="F")
        columns[nodes, np.arange(len(nodes))] = 1
        first = int(nodes.min())  # above it, columns of V are zero
        below = self._lower[first:, first:]
        columns[first:] = self._solved(self._routines.trtrs, below, columns[first:])
        self._columns = np.concatenate([self._columns, columns], axis=1)
        self._removed = np.concatenate([self._removed, nodes])
        self._gram = self._factorised(_product(self._columns.T, self._columns))

    def _return(self, nodes: Mask) -> None:
        """Drop the columns of V of some removed nodes, which may then carry pressure again."""
        self._columns, self._removed = self._columns[:, ~nodes], self._removed[~nodes]
        if self._removed.size:
            self._gram = self._factorised(_product(self._columns.T, self._columns))

    def _factorised(self, matrix: Real) -> Real:
        """Return the lower Cholesky factor, which overwrites the matrix."""
        lower, wrong = self._routines.potrf(matrix, lower=1, clean=0, overwrite_a=1)
        if wrong:
            raise np.linalg.LinAlgError
        factor: Real = lower
        return factor

    def _solved(self, by: Callable[..., Any], lower: Real, sides: Real, **how: int) -> Real:
        """Solve a system by a lower factor with one of LAPACK's routines."""
        solution, wrong = by(lower, sides, lower=1, **how)
        if wrong:
            raise np.linalg.LinAlgError
        solved: Real = solution
        return solved


class Routines(NamedTuple):
    """The routines of LAPACK that this package uses, in one precision.

    Attributes
    ----------
    potrf : callable
        Cholesky factorisation.
    posv : callable
        Cholesky factorisation with a solve.
    potrs : callable
        Solve by a Cholesky factor.
    trtrs : callable
        Solve by a triangular matrix.
    """

    potrf: Callable[..., Any]
    posv: Callable[..., Any]
    potrs: Callable[..., Any]
    trtrs: Callable[..., Any]


@lru_cache(maxsize=2)
def routines(precision: str) -> Routines:
    """Return LAPACK's routines for single ("s") or double ("d") precision."""
    from scipy.linalg import lapack  # a tenth of a second, which most commands never need

    return Routines(*(getattr(lapack, precision + name) for name in Routines._fields))


def _product(left: Real, right: Real) -> Real:
    """Return left @ right; a pressure that is not finite is refused where it comes out.

    BLAS may set the processor's flag of an invalid operation for numbers that no result contains,
    of which numpy would warn.
    """
    with np.errstate(invalid="ignore"):
        product: Real = left @ right
    return product
