"""Contact by the dense matrix: all influence coefficients are written out, and sets factorised.

`press` uses block principal pivoting with Cholesky factors, which is slow and short. It accepts a
solution only if the conditions of complementarity hold. `press_yielding` bounds the pressure by a
hardness. With A = L L^T, the pressure 0 <= p <= H that minimises p A p / 2 - u p is the
least-squares solution of L^T p = L^-1 u within these bounds; `solve` may begin with it.

`press_by_nnls` is the paper's algorithm: A. Bemporad and M. Paggi (2015), Int. J. Solids Struct.
69-70, algorithm 3, after Lawson and Hanson (1974). It solves one dense system for each node that
comes into contact, as MIRCO does. To compare fairly it is faster than MIRCO: LAPACK's Cholesky
factors take half the work of MIRCO's LU factors, and influence coefficients are kept.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, cholesky, solve_triangular
from scipy.linalg.lapack import dposv
from scipy.optimize import lsq_linear

from bem.influence import Kernel
from bench.references.half_space import Field, displacement, influence_coefficients

Nodes = NDArray[np.intp]
"""Flat indices of nodes."""

Sides = NDArray[np.intp]
"""State of each node: -1 without pressure, 1 yielded, 0 in elastic contact."""

ROUNDING = 1e-11
"""Pressures and gaps in reduced units below this count as zero [largest interference]."""

PATIENCE = 4
"""Number of exchanges of all wrong nodes that may pass without fewer wrong nodes."""

EXCHANGES = 10_000
"""Number of exchanges after which `solve` gives up; only rounding can take as many."""


class DenseContact(NamedTuple):
    """A contact that was solved with the dense matrix. The function that makes it states the units.

    Both fields have the shape of the heights, (nx, ny).
    """

    pressure: Field
    gap: Field  # negative at yielded nodes, by the depth to which they yield


def influence_view(shape: tuple[int, int], kernel: Kernel, aspect: float = 1.0) -> Field:
    """Return all influence coefficients as a view of a table, which takes no memory of its own.

    Parameters
    ----------
    shape : (int, int)
        Nodes along x and y.
    kernel : {"uniform-pressure", "concentrated-force"}
        Kernel, as for `half_space.influence_coefficients`.
    aspect : float
        Second side of a cell over its first [1].

    Returns
    -------
    ndarray, shape (nx, ny, nx, ny)
        Displacement of node (i, j) under unit pressure on node (k, l) [first side of a cell / E*].
    """
    table = influence_coefficients(shape, kernel, aspect)
    offsets = [np.abs(np.arange(1 - nodes, nodes)) for nodes in shape]
    mirrored = table[np.ix_(*offsets)]
    return sliding_window_view(mirrored, shape)[::-1, ::-1]


def influence_matrix(
    shape: tuple[int, int],
    kernel: Kernel,
    aspect: float = 1.0,
    nodes: Nodes | None = None,
) -> Field:
    """Write out the displacement of nodes under unit pressure on each of them.

    Parameters
    ----------
    shape : (int, int)
        Nodes along x and y.
    kernel : {"uniform-pressure", "concentrated-force"}
        Kernel, as for `half_space.influence_coefficients`.
    aspect : float
        Second side of a cell over its first [1].
    nodes : ndarray of int, shape (m,), optional
        Flat indices of the nodes that the matrix is for; all nodes by default.

    Returns
    -------
    ndarray, shape (m, m)
        Influence matrix [first side of a cell / E*].
    """
    if nodes is None:
        nodes = np.arange(shape[0] * shape[1])
    rows, columns = np.divmod(nodes, shape[1])
    coefficients = influence_view(shape, kernel, aspect)
    matrix: Field = coefficients[rows[:, None], columns[:, None], rows, columns]
    return matrix


def displace(pressure: Field, kernel: Kernel, aspect: float = 1.0) -> Field:
    """Compute the displacement under a pressure by the whole matrix.

    Parameters
    ----------
    pressure : ndarray, shape (nx, ny)
        Contact pressure [E*].
    kernel : {"uniform-pressure", "concentrated-force"}
        Kernel, as for `half_space.influence_coefficients`.
    aspect : float
        Second side of a cell over its first [1].

    Returns
    -------
    ndarray, shape (nx, ny)
        Displacement [first side of a cell].
    """
    matrix = influence_view(pressure.shape, kernel, aspect)
    return np.asarray(np.einsum("ijkl,kl->ij", matrix, pressure))


def solve(
    matrix: Field,
    interference: Field,
    start: Sides | None = None,
    hardness: float = np.inf,
) -> Field:
    """Find the pressure 0 <= p <= H with gap w = A p - u >= 0 where p = 0 and <= 0 where p = H.

    All nodes of the wrong sign change sides at once as long as this lowers their number; otherwise
    only the last of them does. This ends for any positive definite matrix (Judice and Pires 1994;
    Murty 1974).

    Parameters
    ----------
    matrix : ndarray, shape (m, m)
        Positive definite matrix A.
    interference : ndarray, shape (m,)
        Overlap u of the undeformed bodies, negative where they are apart.
    start : ndarray of int, shape (m,), optional
        Sides to begin with: -1 at nodes without pressure, 1 at yielded nodes, 0 between. By
        default nodes that overlap are at 0, and other nodes at -1.
    hardness : float
        Largest pressure H; infinite for elastic bodies.

    Returns
    -------
    ndarray, shape (m,)
        Pressure, in the unit of A^-1 u.

    Raises
    ------
    ArithmeticError
        If rounding keeps nodes changing sides, or leaves a gap in contact above `ROUNDING` of the
        largest interference.
    """
    side = start
    if side is None:
        side = np.where(interference > 0, 0, -1)
    accepted = ROUNDING * float(np.abs(interference).max(initial=0.0))
    fewest = interference.size + 1
    patience = PATIENCE
    for _ in range(EXCHANGES):
        pressure = balance(matrix, interference, side, hardness)
        gap = matrix @ pressure - interference
        is_outside = (pressure < -accepted) | (pressure > hardness + accepted)
        wrong = np.where(side == 0, is_outside, side * gap > accepted)
        count = int(np.count_nonzero(wrong))
        if not count:
            _require_closed(gap[side == 0], accepted)
            return np.clip(pressure, 0.0, hardness)
        if count < fewest:
            fewest = count
            patience = PATIENCE
        elif patience:
            patience -= 1
        else:  # only the last wrong node changes sides
            wrong[: np.flatnonzero(wrong)[-1]] = False
        # A node between the bounds goes to the bound that it exceeds; others go between.
        bound_beyond = np.where(pressure > 0, 1, -1)
        opposite = np.where(side == 0, bound_beyond, 0)
        side = np.where(wrong, opposite, side)
    raise ArithmeticError(f"dense solve: {count} of {side.size} nodes are still wrong")


def _require_closed(gap: Field, accepted: float) -> None:
    """Raise ArithmeticError if a gap in elastic contact, (k,), is larger than the accepted one."""
    largest = float(np.abs(gap).max(initial=0.0))
    if largest > accepted:
        raise ArithmeticError(f"dense solve: gap of {largest:.1e} in contact")


def balance(
    matrix: Field, interference: Field, side: Sides, hardness: float = np.inf
) -> Field:
    """Compute the pressure that closes the gap at all nodes between the bounds.

    Parameters
    ----------
    matrix : ndarray, shape (m, m)
        Positive definite matrix A.
    interference : ndarray, shape (m,)
        Overlap u of the undeformed bodies.
    side : ndarray of int, shape (m,)
        -1 at nodes without pressure, 1 at yielded nodes, 0 between the bounds.
    hardness : float
        Pressure of yielded nodes.

    Returns
    -------
    ndarray, shape (m,)
        Pressure: 0 and the hardness at the bounds; between them it may be outside of the bounds.
    """
    pressure = np.where(side > 0, hardness, 0.0)
    free = side == 0
    yielded = side > 0
    if free.any():
        by_yielded = matrix[np.ix_(free, yielded)] @ pressure[yielded]
        factor = cho_factor(matrix[np.ix_(free, free)])
        pressure[free] = cho_solve(factor, interference[free] - by_yielded)
    return pressure


def press(
    heights: Field, delta: float, kernel: Kernel, aspect: float = 1.0
) -> DenseContact:
    """Solve an elastic contact on a rigid far field.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights of the surface [um].
    delta : float
        Displacement of the far field from first touch, above 0 [um].
    kernel : {"uniform-pressure", "concentrated-force"}
        Kernel, as for `half_space.influence_coefficients`.
    aspect : float
        Second side of a cell over its first [1].

    Returns
    -------
    DenseContact
        Pressure [E* delta / first side of a cell] and gap [delta].

    Raises
    ------
    ArithmeticError
        If `solve` finds no solution.
    """
    overlap = (heights - heights.max()) + delta
    interference = (overlap / delta).reshape(-1)
    nodes = np.flatnonzero(interference > 0)  # other nodes carry nothing
    matrix = influence_matrix(heights.shape, kernel, aspect, nodes)
    pressure = np.zeros(heights.size)
    pressure[nodes] = solve(matrix, interference[nodes])
    field = pressure.reshape(heights.shape)
    gap = displacement(field, kernel, aspect) - interference.reshape(heights.shape)
    return DenseContact(field, gap)


def full_contact_delta(heights: Field, kernel: Kernel, aspect: float = 1.0) -> float:
    """Compute the displacement at which the last node comes into contact on a rigid far field.

    If all nodes are in contact, the pressure is linear in Delta. The result is the Delta at which
    the last pressure becomes positive.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights of the surface [um].
    kernel : {"uniform-pressure", "concentrated-force"}
        Kernel, as for `half_space.influence_coefficients`.
    aspect : float
        Second side of a cell over its first [1].

    Returns
    -------
    float
        Displacement Delta [um].
    """
    factor = cho_factor(influence_matrix(heights.shape, kernel, aspect))
    at_first_touch = cho_solve(factor, (heights - heights.max()).reshape(-1))
    per_delta = cho_solve(factor, np.ones(heights.size))
    return float((-at_first_touch / per_delta).max())


def press_yielding(
    heights: Field,
    delta: float,
    hardness: float,
    kernel: Kernel,
    aspect: float = 1.0,
    sides: Callable[[Field, Field, float], Sides] | None = None,
) -> DenseContact:
    """Solve a contact with a bounded pressure on a rigid far field.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights of the surface [um].
    delta : float
        Displacement of the far field from first touch [um].
    hardness : float
        Largest pressure [E* um / first side of a cell].
    kernel : {"uniform-pressure", "concentrated-force"}
        Kernel, as for `half_space.influence_coefficients`.
    aspect : float
        Second side of a cell over its first [1].
    sides : callable, optional
        Function that returns the sides to begin with from matrix, interference and hardness, as
        `by_least_squares` does; by default `solve` chooses them.

    Returns
    -------
    DenseContact
        Pressure in the unit of the hardness, and gap [um].

    Raises
    ------
    ArithmeticError
        If `solve` finds no solution.
    """
    interference = ((heights - heights.max()) + delta).reshape(-1)
    nodes = np.flatnonzero(interference > 0)  # other nodes carry nothing
    matrix = influence_matrix(heights.shape, kernel, aspect, nodes)
    start = None
    if sides is not None:
        start = sides(matrix, interference[nodes], hardness)
    pressure = np.zeros(heights.size)
    pressure[nodes] = solve(matrix, interference[nodes], start, hardness)
    field = pressure.reshape(heights.shape)
    gap = displace(field, kernel, aspect) - interference.reshape(heights.shape)
    return DenseContact(field, gap)


def by_least_squares(matrix: Field, interference: Field, hardness: float) -> Sides:
    """Find the sides of the nodes by bounded least squares.

    Parameters
    ----------
    matrix : ndarray, shape (m, m)
        Positive definite matrix A.
    interference : ndarray, shape (m,)
        Overlap u of the undeformed bodies.
    hardness : float
        Largest pressure, in the unit of A^-1 u.

    Returns
    -------
    ndarray of int, shape (m,)
        -1 at nodes without pressure, 1 at yielded nodes, 0 between.
    """
    factor = cholesky(matrix, lower=True)
    target = solve_triangular(factor, interference, lower=True)
    solution = lsq_linear(
        factor.T, target, bounds=(0.0, hardness), method="bvls", tol=1e-15
    )
    return np.asarray(solution.active_mask)


class _ActiveSet:
    """Nodes in contact in the paper's algorithm, with the rows of the matrix that belong to them.

    `add` and `release` keep both in one order: the first `count` entries are in contact.
    """

    def __init__(self, matrix: Field) -> None:
        self.matrix = matrix  # shape (m, m)
        self.nodes: Nodes = np.empty(len(matrix), np.intp)  # indices of candidates
        self.rows = np.empty_like(matrix)  # rows of the matrix for these nodes
        self.count = 0

    @property
    def inside(self) -> Nodes:
        """Indices of the nodes in contact, (count,); a view that `release` changes."""
        return self.nodes[: self.count]

    def add(self, node: np.intp) -> None:
        """Bring a node into contact."""
        self.nodes[self.count] = node
        self.rows[self.count] = self.matrix[node]
        self.count += 1

    def balance(self, interference: Field) -> Field:
        """Return the pressures of the nodes in contact, (count,), which close their gaps.

        Raises ArithmeticError if rounding has made the matrix indefinite.
        """
        inside = self.inside
        block = self.rows[: self.count, inside].T
        pressures: Field
        _, pressures, failed = dposv(block, interference[inside], overwrite_a=True)
        if failed:
            raise ArithmeticError("the influence matrix is not positive definite")
        return pressures

    def release(self, pressure: Field, balanced: Field) -> None:
        """Move towards balanced pressures until one becomes zero, and release its node.

        Changes `pressure`, (m,), at the nodes in contact. `balanced`, (count,), has a pressure that
        is not positive. The last node in contact takes the place of the released one.
        """
        inside = self.inside
        before = pressure[inside]
        falling = np.flatnonzero(balanced <= 0)
        tiny = np.finfo(float).tiny
        falls = before[falling] - balanced[falling] + tiny
        shares = before[falling] / falls
        pressure[inside] = before + shares.min() * (balanced - before)
        stopping = falling[shares.argmin()]
        pressure[self.nodes[stopping]] = 0
        last = self.count - 1
        self.nodes[stopping] = self.nodes[last]
        self.rows[stopping] = self.rows[last]
        self.count = last


def press_by_nnls(
    heights: Field,
    delta: float,
    *,
    kernel: Kernel = "uniform-pressure",
    rtol: float = 1e-8,
) -> Field:
    """Solve an elastic contact on square cells and a rigid far field by the paper's algorithm.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights of the surface [um].
    delta : float
        Displacement of the far field from first touch, above 0 [um].
    kernel : {"uniform-pressure", "concentrated-force"}
        Kernel, as for `half_space.influence_coefficients`.
    rtol : float
        Largest penetration that may be left at nodes without pressure [Delta].

    Returns
    -------
    ndarray, shape (nx, ny)
        Pressure p >= 0 with gap w = H p - u >= -rtol and p w = 0 [E* Delta / spacing].

    Raises
    ------
    ArithmeticError
        If rounding keeps the algorithm from ending. No contact is known with which it does.
    """
    overlap = (heights - heights.max()) + delta
    reduced = (overlap / delta).reshape(-1)
    nodes = np.flatnonzero(reduced > 0)
    interference = reduced[nodes]
    candidates = interference.size
    active = _ActiveSet(influence_matrix(heights.shape, kernel, nodes=nodes))
    pressure = np.zeros(candidates)
    gap = -interference
    solves = 0
    while active.count < candidates and gap.min() < -rtol:
        active.add(gap.argmin())
        balanced = active.balance(interference)
        solves += 1
        while balanced.min() <= 0:
            active.release(pressure, balanced)
            if solves > 10 * candidates:
                raise ArithmeticError(
                    f"no end after {solves} solves for {candidates} nodes"
                )
            balanced = active.balance(interference)
            solves += 1
        pressure[active.inside] = balanced
        gap = balanced @ active.rows[: active.count] - interference
        gap[active.inside] = 0
    field = np.zeros(heights.size)
    field[nodes] = pressure
    return field.reshape(heights.shape)
