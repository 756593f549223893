"""Dense algebra for few nodes: a factor of their influence matrix, with pressures that are fixed.

Where few nodes are in contact, a Cholesky factor of their matrix costs less than convolutions.
Nodes under tension are fixed at zero pressure, and nodes beyond the hardness at the hardness. The
factor stays and is bordered by the fixed nodes, which costs far less than factorising the matrix of
the free nodes.

Constants say how far they move the counts of the ledger, see `bem.active_set`.
"""

from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from bem.arrays import Mask, Nodes, Real, Values

# Sets of fixed nodes that are tried before iterations take over. Sets that do not cycle need fewer.
# This number matters in rare cases.
MOST_SETS = 20

# Share of the nodes that are under tension above which factorising the matrix of the other nodes is
# cheaper than fixing the nodes under tension [1]. This number matters little.
MANY = 0.15

# BLAS may set the processor's flag of an invalid operation for numbers that no result contains, of
# which numpy would warn. A pressure that is not finite is refused where it is computed.
NO_WARNING = np.errstate(invalid="ignore")


class DenseSolution(NamedTuple):
    """The pressure on some nodes that dense algebra has computed.

    Attributes
    ----------
    nodes : ndarray, shape (n,)
        Flat indices of the nodes of the factor. Nodes that the factor has lost are missing; their
        pressure is zero.
    pressure : ndarray, shape (n,)
        Pressure of these nodes, between zero and the hardness [reduced]. Unless `settled`, it may
        belong to more nodes: the nodes of the factor before the last set.
    shift : float
        Displacement of the far field in addition to the interference; 0 without a given load
        [unit of displacement].
    sets : int
        Number of sets of fixed nodes that were tried.
    settled : bool
        Whether the last set is in equilibrium on these nodes.
    """

    nodes: Nodes
    pressure: Values
    shift: float
    sets: int
    settled: bool


class _Backward(NamedTuple):
    """Pressure of a factor's nodes under one interference, with the fixed nodes held at theirs.

    Attributes
    ----------
    pressure : ndarray, shape (n,)
        Pressure of all nodes of the factor [reduced].
    residual : ndarray, shape (number fixed,)
        Penetration of the fixed nodes, negative for gaps [unit of displacement].
    shift : float
        Displacement of the far field that a given load needs, else 0 [unit of displacement].
    """

    pressure: Values
    residual: Values
    shift: float


class ContactFactor:
    """The Cholesky factor of H on n nodes, in which pressures of nodes can be fixed.

    Let A = L L^T on all nodes, V = L^-1 E, where E selects the fixed nodes, and b their pressures.
    The pressure under u is L^-T (y - V q) with y = L^-1 u and V^T V q = V^T y - b, and q is the
    residual u - A p of the fixed nodes: penetration where it is positive. Where many nodes are
    under tension at a time and bodies are elastic, the matrix of the other nodes is factorised
    instead, and the nodes under tension cannot return.

    Parameters
    ----------
    entries : callable
        Function of (n,) node indices that returns the lower triangle of their (n, n) matrix, in
        Fortran's order.
    nodes : ndarray, shape (n,)
        Flat indices. Nodes that are likely to be fixed are best put last, where fixing costs less.
    hardness : float
        Largest pressure, inf for elastic bodies [reduced].

    Attributes
    ----------
    nodes : ndarray, shape (n,)
        The nodes that the factor contains now.

    Raises
    ------
    numpy.linalg.LinAlgError
        If the matrix of these nodes is not positive definite in its precision, or there are none.
    """

    def __init__(
        self, entries: Callable[[Nodes], Real], nodes: Nodes, hardness: float = np.inf
    ) -> None:
        self._entries = entries
        self._hardness = hardness
        self._factorise(nodes)

    def _factorise(self, nodes: Nodes) -> None:
        """Factorise the matrix of some nodes, none of which is fixed."""
        if not nodes.size:
            raise np.linalg.LinAlgError
        self.nodes = nodes
        matrix = self._entries(nodes)
        is_single = matrix.dtype == np.float32
        self._routines = routines("s" if is_single else "d")
        self._lower = self._by(self._routines.potrf, matrix, clean=0, overwrite_a=1)
        self._fixed = np.zeros(0, np.intp)  # positions of the fixed nodes in `nodes`
        self._at = np.zeros(0)  # their pressures, zero or the hardness
        self._columns = np.zeros((len(nodes), 0), self._lower.dtype, order="F")  # V
        self._gram: Real | None = None  # factor of V^T V, once it is needed

    @NO_WARNING
    def solve(
        self, interference: Values, load: float | None, most_sets: int = MOST_SETS
    ) -> DenseSolution:
        """Fix and free nodes until every pressure is within bounds and every residual has its sign.

        Nodes at zero pressure then do not penetrate, and nodes at the hardness do not open. Nodes
        that an earlier call fixed are fixed at the start. The factor may lose nodes on the way.

        Parameters
        ----------
        interference : ndarray, shape of the grid, flat
            Interference u, without the displacement that a load adds [unit of displacement].
        load : float or None
            Sum of the pressure, None if it is not given [reduced].
        most_sets : int
            Bound on the sets of fixed nodes.

        Returns
        -------
        DenseSolution
            The pressure, cut off at the bounds if the sets have not settled.

        Raises
        ------
        numpy.linalg.LinAlgError
            If no pressure carries the load, or rounding leaves none.
        """
        forward = self._forward(interference[self.nodes], load)
        for sets in range(1, most_sets + 1):
            backward = self._backward(forward, self._at, load)
            pressure = backward.pressure
            free = np.ones(len(pressure), bool)
            free[self._fixed] = False
            tension = free & (pressure < 0)
            excess = free & (pressure > self._hardness)
            changing = bool(tension.any() or excess.any())
            returning = (backward.residual > 0) & (self._at == 0)
            # Yielded nodes whose gap opens return only when nothing else changes: nodes fixed in
            # the same pass displace them less, which may close the gap again.
            if not changing:
                returning |= (backward.residual < 0) & (self._at > 0)
            if not (changing or returning.any()):
                return DenseSolution(
                    self.nodes, pressure, backward.shift, sets, settled=True
                )
            much_tension = np.count_nonzero(tension) > MANY * len(pressure)
            if much_tension and self._hardness == np.inf:
                self._factorise(self.nodes[free & ~tension])
                forward = self._forward(interference[self.nodes], load)
            else:
                self._free(returning)
                self._fix(np.flatnonzero(tension), at=0.0)
                self._fix(np.flatnonzero(excess), at=self._hardness)
        within = np.clip(pressure, 0, self._hardness)
        return DenseSolution(self.nodes, within, backward.shift, most_sets, settled=False)

    @NO_WARNING
    def correct(self, residual: Values, load: float | None) -> Values:
        """Compute the change of the free nodes' pressure that removes a residual from these nodes.

        Parameters
        ----------
        residual : ndarray, shape of the grid, flat
            Remaining penetration u - H p [unit of displacement].
        load : float or None
            None at a given displacement, or 0 for a change that carries no load [reduced].

        Returns
        -------
        ndarray, shape (n,)
            Change of pressure, zero on fixed nodes [reduced].

        Raises
        ------
        numpy.linalg.LinAlgError
            If no displacement makes the change carry no load, or rounding leaves none.
        """
        remaining = residual[self.nodes]
        remaining[self._fixed] = 0  # rounding would carry an open gap into the contact
        forward = self._forward(remaining, load)
        return self._backward(forward, np.zeros_like(self._at), load).pressure

    def _forward(self, interference: Values, load: float | None) -> Real:
        """Return L^-1 u as a column, and, if a load is given, L^-1 1 in a second column.

        `interference` is u on the nodes of the factor.
        """
        columns = 1
        if load is not None:
            columns = 2
        sides = np.ones((len(interference), columns), self._lower.dtype, order="F")
        sides[:, 0] = interference
        return self._by(self._routines.trtrs, self._lower, sides)

    def _backward(self, forward: Real, at: Values, load: float | None) -> _Backward:
        """Return pressure, residual and shift for the columns that `_forward` has returned.

        `at` holds the pressures of the fixed nodes. Raise LinAlgError if no displacement carries
        the load, or pressures are not finite.
        """
        inside = forward
        residuals = np.zeros((0, forward.shape[1]))
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
            # The first column carries a load; each unit of the shift adds the second column.
            carried, by_unit_shift = pressures.sum(axis=0)
            if not by_unit_shift > 0:
                raise np.linalg.LinAlgError
            shift = float((load - carried) / by_unit_shift)
            pressures[:, 0] += shift * pressures[:, 1]
            residuals = residuals[:, :1] + shift * residuals[:, 1:]
        pressure = pressures[:, 0]
        if not np.isfinite(pressure.sum()):
            raise np.linalg.LinAlgError
        return _Backward(pressure=pressure.copy(), residual=residuals[:, 0], shift=shift)

    def _fix(self, places: Nodes, at: float) -> None:
        """Add the columns of V that hold the nodes at some positions at a pressure [reduced]."""
        if not places.size:
            return
        columns = np.zeros((len(self._lower), len(places)), self._lower.dtype, order="F")
        columns[places, np.arange(len(places))] = 1
        first = int(places.min())  # the rows of V before this one are zero
        lower_right = self._lower[first:, first:]
        columns[first:] = self._by(self._routines.trtrs, lower_right, columns[first:])
        self._columns = np.concatenate([self._columns, columns], axis=1)
        self._fixed = np.concatenate([self._fixed, places])
        self._at = np.concatenate([self._at, np.full(len(places), at)])
        self._gram = None

    def _free(self, returning: Mask) -> None:
        """Drop the columns of V of some fixed nodes, by their mask, which are free again."""
        if not returning.any():
            return
        self._columns = self._columns[:, ~returning]
        self._fixed = self._fixed[~returning]
        self._at = self._at[~returning]
        self._gram = None

    def _by(self, routine: Callable[..., Any], *matrices: Real, **options: int) -> Real:
        """Call one of LAPACK's routines, and return the matrix that it computes.

        The first of the matrices is a lower triangle. Raise LinAlgError if the routine reports a
        failure.
        """
        computed, failure = routine(*matrices, lower=1, **options)
        if failure:
            raise np.linalg.LinAlgError
        result: Real = computed
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
    """Return LAPACK's routines for a precision.

    Parameters
    ----------
    precision : str
        "s" for single and "d" for double precision.

    Returns
    -------
    Routines
        The routines, which overwrite no argument unless they are told to.
    """
    from scipy.linalg import lapack  # a tenth of a second, which most commands never need

    return Routines(*(getattr(lapack, precision + name) for name in Routines._fields))
