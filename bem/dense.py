"""Dense algebra for few nodes: the factor of their influence matrix, with pressures that are fixed.

Where few nodes are in contact, a Cholesky factor of their matrix costs less than convolutions.
Nodes under tension, and nodes beyond the hardness, are fixed at zero and at the hardness in the
factor that is there, which costs far less than factorising the matrix of the rest.
"""

from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from bem.arrays import Mask, Nodes, Real, Values

# Sets tried before iterations take over: sets that do not cycle need fewer.
MOST_SETS = 20

# Share of nodes under tension above which a new factor of the rest is cheaper than fixing them.
MANY = 0.15

# BLAS may set the processor's flag of an invalid operation for numbers that no result contains, of
# which numpy would warn; a pressure that is not finite is refused where it comes out.
NO_WARNING = np.errstate(invalid="ignore")


class DenseSolution(NamedTuple):
    """The pressure on some nodes, and what it leaves there.

    Attributes
    ----------
    pressure : ndarray, shape (n,)
        Pressure between zero and the hardness.
    shift : float
        Displacement of the far field in addition to the interference.
    sets : int
        Sets of fixed nodes tried.
    settled : bool
        Whether the last of them stands.
    """

    pressure: Values
    shift: float
    sets: int
    settled: bool


class ContactFactor:
    """The Cholesky factor of H on n nodes, in which pressures of nodes can be fixed.

    Let A = L L^T on all nodes, V = L^-1 E, where E selects the fixed nodes, and b their pressures.
    The pressure under u is L^-T (y - V q) with y = L^-1 u and V^T V q = V^T y - b, and q is the
    residual u - A p of the fixed nodes: penetration where it is positive. Where many nodes are
    under tension at a time and bodies are elastic, the matrix of the rest is factorised instead,
    and these cannot return.

    Parameters
    ----------
    entries : callable
        Returns the lower triangle of the matrix of some nodes, in Fortran's order.
    nodes : ndarray, shape (n,)
        Flat indices, best ordered with those first that are least likely to be fixed: fixing the
        last ones costs less.
    hardness : float
        Largest pressure, inf for elastic bodies [reduced].

    Attributes
    ----------
    nodes : ndarray, shape (n,)
        The nodes that the factor contains.

    Raises
    ------
    numpy.linalg.LinAlgError
        If the matrix of these nodes is not positive definite in its precision.
    """

    def __init__(
        self, entries: Callable[[Nodes], Real], nodes: Nodes, hardness: float = np.inf
    ) -> None:
        self._entries, self._hardness = entries, hardness
        self._factorise(nodes)

    def _factorise(self, nodes: Nodes) -> None:
        """Factorise the matrix of some nodes, none of which is fixed."""
        if not nodes.size:
            raise np.linalg.LinAlgError
        self.nodes = nodes
        matrix = self._entries(nodes)
        self._routines = routines("s" if matrix.dtype == np.float32 else "d")
        self._lower = self._by(self._routines.potrf, matrix, clean=0, overwrite_a=1)
        self._fixed = np.zeros(0, np.intp)  # positions in `nodes`
        self._at = np.zeros(0)
        self._columns = np.zeros((len(nodes), 0), self._lower.dtype, order="F")
        self._gram: Real | None = None  # factor of V^T V, once it is needed

    @NO_WARNING
    def solve(
        self, interference: Values, load: float | None, most_sets: int = MOST_SETS
    ) -> DenseSolution:
        """Fix and free nodes until no pressure is out of bounds and every residual has its sign.

        Parameters
        ----------
        interference : ndarray, shape of the grid, flat
            Interference u without the displacement that a load adds [any unit of length].
        load : float or None
            Sum of the pressure if it is given.
        most_sets : int
            Bound on the sets.

        Raises
        ------
        numpy.linalg.LinAlgError
            If no pressure carries the load, or rounding leaves none.
        """
        forward = self._forward(interference[self.nodes], load)
        for sets in range(1, most_sets + 1):
            pressure, residual, shift = self._backward(forward, self._at, load)
            free = np.ones(len(pressure), bool)
            free[self._fixed] = False
            tension = free & (pressure < 0)
            excess = free & (pressure > self._hardness)
            changing = bool(tension.any() or excess.any())
            # Yielded nodes return last: load that others lose may close their gaps again.
            returning = (residual > 0) & (self._at == 0)
            if not changing:
                returning |= (residual < 0) & (self._at > 0)
            if not (changing or returning.any()):
                return DenseSolution(pressure, shift, sets, settled=True)
            many = np.count_nonzero(tension) > MANY * len(pressure)
            if many and self._hardness == np.inf:
                self._factorise(self.nodes[free & ~tension])
                forward = self._forward(interference[self.nodes], load)
            else:
                self._free(returning)
                self._fix(np.flatnonzero(tension), 0.0)
                self._fix(np.flatnonzero(excess), self._hardness)
        return DenseSolution(
            np.clip(pressure, 0, self._hardness), shift, most_sets, settled=False
        )

    @NO_WARNING
    def correct(self, residual: Values, load: float | None) -> Values:
        """Compute the change of the free nodes' pressure that removes a residual.

        Parameters
        ----------
        residual : ndarray, shape of the grid, flat
            Remaining part of u [unit of u].
        load : float or None
            None, or 0 for a change that carries no load.
        """
        left = residual[self.nodes]
        left[self._fixed] = 0  # an open gap, which rounding would carry into the contact
        return self._backward(self._forward(left, load), np.zeros_like(self._at), load)[0]

    def _forward(self, interference: Values, load: float | None) -> Real:
        """Apply L^-1 to u, and to a unit displacement if a load is given."""
        sides = np.ones(
            (len(interference), 1 if load is None else 2), self._lower.dtype, order="F"
        )
        sides[:, 0] = interference
        return self._by(self._routines.trtrs, self._lower, sides)

    def _backward(
        self, forward: Real, at: Values, load: float | None
    ) -> tuple[Values, Values, float]:
        """Return the pressure, the residual of the fixed nodes, and the shift that a load needs."""
        inside, residuals = forward, np.zeros((0, forward.shape[1]))
        if len(self._fixed):
            sides = np.asfortranarray(self._columns.T @ forward)
            sides[:, 0] -= at
            if self._gram is None:
                gram = self._columns.T @ self._columns
                self._gram = self._by(self._routines.potrf, gram, clean=0, overwrite_a=1)
            residuals = self._by(self._routines.potrs, self._gram, sides)
            inside = forward - self._columns @ residuals
        pressures = self._by(self._routines.trtrs, self._lower, inside, trans=1)
        pressures = pressures.astype(np.float64)
        pressures[self._fixed] = 0
        pressures[self._fixed, 0] = at
        shift = 0.0
        if load is not None:
            plain, uniform = pressures.sum(axis=0)
            if not uniform > 0:
                raise np.linalg.LinAlgError
            shift = float((load - plain) / uniform)
            pressures[:, 0] += shift * pressures[:, 1]
            residuals = residuals[:, :1] + shift * residuals[:, 1:]
        if not np.isfinite(pressures[:, 0].sum()):
            raise np.linalg.LinAlgError
        return pressures[:, 0].copy(), residuals[:, 0], shift

    def _fix(self, places: Nodes, at: float) -> None:
        """Add the columns of V that keep the pressure of some nodes where it is put."""
        if not places.size:
            return
        columns = np.zeros((len(self._lower), len(places)), self._lower.dtype, order="F")
        columns[places, np.arange(len(places))] = 1
        first = int(places.min())  # above it, columns of V are zero
        below = self._lower[first:, first:]
        columns[first:] = self._by(self._routines.trtrs, below, columns[first:])
        self._columns = np.concatenate([self._columns, columns], axis=1)
        self._fixed = np.concatenate([self._fixed, places])
        self._at = np.concatenate([self._at, np.full(len(places), at)])
        self._gram = None

    def _free(self, returning: Mask) -> None:
        """Drop the columns of V of some fixed nodes, which are free again."""
        if not returning.any():
            return
        self._columns, self._fixed = self._columns[:, ~returning], self._fixed[~returning]
        self._at, self._gram = self._at[~returning], None

    def _by(self, routine: Callable[..., Any], *matrices: Real, **how: int) -> Real:
        """Apply one of LAPACK's routines, for which the first matrix is a lower triangle."""
        found, wrong = routine(*matrices, lower=1, **how)
        if wrong:
            raise np.linalg.LinAlgError
        result: Real = found
        return result


class Routines(NamedTuple):
    """The routines of LAPACK that this package uses, in one precision.

    Attributes
    ----------
    potrf : callable
        Cholesky factorisation.
    potrs : callable
        Solve by a Cholesky factor.
    trtrs : callable
        Solve by a triangular matrix.
    """

    potrf: Callable[..., Any]
    potrs: Callable[..., Any]
    trtrs: Callable[..., Any]


@lru_cache(maxsize=2)
def routines(precision: str) -> Routines:
    """Return LAPACK's routines for single ("s") or double ("d") precision."""
    from scipy.linalg import lapack  # a tenth of a second, which most commands never need

    return Routines(*(getattr(lapack, precision + name) for name in Routines._fields))
