"""Contact by the dense matrix of influence coefficients, whose parts are factorised.

`press` uses block principal pivoting with Cholesky factors. Its code is short, and its solves are
slow. It accepts a solution only if the conditions of complementarity hold. `press_yielding` also
bounds the pressure by a hardness H: the pressure 0 <= p <= H minimises p A p / 2 - u p. With
A = L L^T, this is the least-squares solution of L^T p = L^-1 u within the bounds, which
`by_least_squares` computes; block pivoting may begin with its sides.

`press_by_nnls` is the paper's algorithm: A. Bemporad and M. Paggi (2015), Int. J. Solids Struct.
69-70, algorithm 3, after Lawson and Hanson (1974). It solves one dense system for each node that
comes into contact, as MIRCO does. It is made faster than MIRCO, so that comparisons do not favour
our solver: LAPACK's Cholesky factors take half the work of MIRCO's LU factors, and influence
coefficients are computed once.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, cholesky, solve_triangular
from scipy.linalg.lapack import dposv
from scipy.optimize import lsq_linear

from bem.bodies import Kernel
from bench.references.half_space import Field, displacement, influence_coefficients

Nodes = NDArray[np.intp]
"""Flat indices of nodes."""

Sides = NDArray[np.intp]
"""State of each node: -1 without pressure, 0 in elastic contact, 1 yielded."""

ROUNDING = 1e-11
"""Largest violation by a gap, or by a pressure in reduced units, that counts as rounding [largest
interference]."""

PATIENCE = 4
"""Number of further exchanges of all wrong nodes after one that has left no fewer wrong ones."""

EXCHANGES = 10_000
"""Number of exchanges after which `solve` gives up; only rounding can make it need more."""


class DenseContact(NamedTuple):
    """A contact that was solved with the dense matrix; the function that makes it states the units.

    Both fields have the shape of the heights, (nx, ny).
    """

    pressure: Field
    gap: Field  # distance of the surfaces; minus the depth of yielding at yielded nodes


def influence_view(shape: tuple[int, int], kernel: Kernel, aspect: float = 1.0) -> Field:
    """Return all influence coefficients as a view of a small table.

    The view takes no memory of its own; each coefficient occurs many times in it.

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
    """Compute the displacement of each node under unit pressure on each node.

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
        Influence matrix: each row has the displacements of one node [first side of a cell / E*].
    """
    if nodes is None:
        nodes = np.arange(shape[0] * shape[1])
    rows, columns = np.divmod(nodes, shape[1])
    coefficients = influence_view(shape, kernel, aspect)
    matrix: Field = coefficients[rows[:, None], columns[:, None], rows, columns]
    return matrix


def displace(pressure: Field, kernel: Kernel, aspect: float = 1.0) -> Field:
    """Compute the displacement under a pressure by the whole matrix, without transforms.

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
    """Find the pressure 0 <= p <= H of a contact by block principal pivoting.

    The gap w = A p - u is at least 0 where p = 0, at most 0 where p = H, and 0 elsewhere. A node is
    wrong if its gap has the wrong sign for its side or, in elastic contact, its pressure is below 0
    or above H. All wrong nodes change sides at once. After `PATIENCE` + 1 such exchanges without a
    new smallest number of wrong nodes, only the last wrong node changes sides, until the number
    reaches a new minimum. This ends for any positive definite matrix (Judice and Pires 1994; Murty
    1974).

    Parameters
    ----------
    matrix : ndarray, shape (m, m)
        Positive definite matrix A.
    interference : ndarray, shape (m,)
        Overlap u of the undeformed bodies, negative where they are apart. Its unit is that of A p.
    start : ndarray of int, shape (m,), optional
        Sides to begin with: -1 at nodes without pressure, 0 in elastic contact, 1 at yielded nodes.
        By default nodes that overlap are at 0, and other nodes at -1.
    hardness : float
        Largest pressure H, in the unit of the pressure; infinite for elastic bodies.

    Returns
    -------
    ndarray, shape (m,)
        Pressure, in the unit of A^-1 u.

    Raises
    ------
    ArithmeticError
        If nodes are still wrong after `EXCHANGES`, or if rounding leaves a gap in elastic contact
        that is larger than `ROUNDING` of the largest interference.
    numpy.linalg.LinAlgError
        If the matrix of the nodes in elastic contact is not positive definite.
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
        # A wrong node in elastic contact goes to the bound that its pressure exceeds. A wrong node
        # at a bound goes into elastic contact.
        exceeded_bound = np.where(pressure > 0, 1, -1)
        next_side = np.where(side == 0, exceeded_bound, 0)
        side = np.where(wrong, next_side, side)
    raise ArithmeticError(f"dense solve: {count} of {side.size} nodes are still wrong")


def _require_closed(gap: Field, accepted: float) -> None:
    """Raise ArithmeticError if a gap in elastic contact, (k,), is larger than `accepted`."""
    largest = float(np.abs(gap).max(initial=0.0))
    if largest > accepted:
        raise ArithmeticError(f"dense solve: gap of {largest:.1e} in contact")


def balance(
    matrix: Field, interference: Field, side: Sides, hardness: float = np.inf
) -> Field:
    """Compute the pressure that closes the gap at all nodes in elastic contact.

    Parameters
    ----------
    matrix : ndarray, shape (m, m)
        Positive definite matrix A.
    interference : ndarray, shape (m,)
        Overlap u of the undeformed bodies.
    side : ndarray of int, shape (m,)
        -1 at nodes without pressure, 0 in elastic contact, 1 at yielded nodes.
    hardness : float
        Pressure of yielded nodes.

    Returns
    -------
    ndarray, shape (m,)
        Pressure in the unit of A^-1 u: 0 at nodes without pressure, the hardness at yielded nodes.
        In elastic contact it may be negative or above the hardness.

    Raises
    ------
    numpy.linalg.LinAlgError
        If the matrix of the nodes in elastic contact is not positive definite.
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
    numpy.linalg.LinAlgError
        If the matrix of some nodes is not positive definite.
    """
    overlap = (heights - heights.max()) + delta
    interference = (overlap / delta).reshape(-1)
    nodes = np.flatnonzero(interference > 0)  # nodes without overlap cannot touch
    matrix = influence_matrix(heights.shape, kernel, aspect, nodes)
    pressure = np.zeros(heights.size)
    pressure[nodes] = solve(matrix, interference[nodes])
    field = pressure.reshape(heights.shape)
    gap = displacement(field, kernel, aspect) - interference.reshape(heights.shape)
    return DenseContact(field, gap)


def full_contact_delta(heights: Field, kernel: Kernel, aspect: float = 1.0) -> float:
    """Compute the displacement at which the last node comes into contact on a rigid far field.

    If all nodes are in contact, the pressure is linear in Delta. The result is the smallest Delta
    at which no pressure is negative.

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

    Raises
    ------
    numpy.linalg.LinAlgError
        If the influence matrix is not positive definite.
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
    find_start: Callable[[Field, Field, float], Sides] | None = None,
) -> DenseContact:
    """Solve a contact of bodies that yield at a hardness, on a rigid far field.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights of the surface [um].
    delta : float
        Displacement of the far field from first touch, above 0 [um].
    hardness : float
        Largest pressure [E* um / first side of a cell].
    kernel : {"uniform-pressure", "concentrated-force"}
        Kernel, as for `half_space.influence_coefficients`.
    aspect : float
        Second side of a cell over its first [1].
    find_start : callable, optional
        Function that takes the matrix, (m, m), the interference, (m,) [um], and the hardness, and
        returns the sides, (m,), that `solve` begins with, as `by_least_squares` does. Without it,
        `solve` begins with its default.

    Returns
    -------
    DenseContact
        Pressure in the unit of the hardness, and gap [um].

    Raises
    ------
    ArithmeticError
        If `solve` finds no solution.
    numpy.linalg.LinAlgError
        If the matrix of some nodes is not positive definite.
    """
    interference = ((heights - heights.max()) + delta).reshape(-1)
    nodes = np.flatnonzero(interference > 0)  # nodes without overlap cannot touch
    matrix = influence_matrix(heights.shape, kernel, aspect, nodes)
    start = None
    if find_start is not None:
        start = find_start(matrix, interference[nodes], hardness)
    pressure = np.zeros(heights.size)
    pressure[nodes] = solve(matrix, interference[nodes], start, hardness)
    field = pressure.reshape(heights.shape)
    gap = displace(field, kernel, aspect) - interference.reshape(heights.shape)
    return DenseContact(field, gap)


def by_least_squares(matrix: Field, interference: Field, hardness: float) -> Sides:
    """Find the side of each node by bounded least squares.

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
        -1 at nodes without pressure, 0 in elastic contact, 1 at yielded nodes.

    Raises
    ------
    numpy.linalg.LinAlgError
        If the matrix is not positive definite.
    """
    factor = cholesky(matrix, lower=True)
    target = solve_triangular(factor, interference, lower=True)
    solution = lsq_linear(
        factor.T, target, bounds=(0.0, hardness), method="bvls", tol=1e-15
    )
    return np.asarray(solution.active_mask)


class _ActiveSet:
    """Nodes in contact in the paper's algorithm, with the rows of the matrix that belong to them.

    Candidates are the m nodes that overlap. `rows[i]` is the row of the matrix for `nodes[i]`. Only
    the first `count` entries of both arrays are valid, in no particular order.
    """

    def __init__(self, matrix: Field) -> None:
        self.matrix = matrix  # influence matrix of all m candidates, (m, m)
        # Indices of the nodes in contact among the candidates, (m,).
        self.nodes: Nodes = np.empty(len(matrix), np.intp)
        self.rows = np.empty_like(matrix)  # rows of the matrix for these nodes, (m, m)
        self.count = 0  # number of nodes in contact

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
        # LAPACK writes its factor into `block`, which is a copy.
        _, pressures, failed = dposv(block, interference[inside], overwrite_a=True)
        if failed:
            raise ArithmeticError("the influence matrix is not positive definite")
        return pressures

    def release(self, pressure: Field, balanced: Field) -> None:
        """Move pressures towards balanced ones until one of them becomes 0, and release its node.

        `pressure`, (m,), has the present pressures of all candidates. It is changed in place at the
        nodes in contact. `balanced`, (count,), has the pressures that `balance` returned, of which
        at least one must be 0 or negative. In `nodes` and `rows` the last node in contact takes the
        place of the released one.
        """
        inside = self.inside
        before = pressure[inside]
        falling = np.flatnonzero(balanced <= 0)
        tiny = np.finfo(float).tiny  # which avoids 0 / 0
        falls = before[falling] - balanced[falling] + tiny
        # Share of the way to the balanced pressure at which each pressure becomes 0.
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
        Largest penetration that may remain at nodes without pressure [Delta].

    Returns
    -------
    ndarray, shape (nx, ny)
        Pressure [E* Delta / spacing]. It is not negative; the gap is 0 where it is positive, and at
        least -rtol Delta elsewhere.

    Raises
    ------
    ArithmeticError
        If rounding keeps the algorithm from ending. No contact is known for which this happens.
    """
    overlap = (heights - heights.max()) + delta
    reduced = (overlap / delta).reshape(-1)
    nodes = np.flatnonzero(reduced > 0)  # the candidates: other nodes cannot touch
    interference = reduced[nodes]
    candidate_count = interference.size
    active = _ActiveSet(influence_matrix(heights.shape, kernel, nodes=nodes))
    pressure = np.zeros(candidate_count)
    gap = -interference
    solves = 0
    while active.count < candidate_count and gap.min() < -rtol:
        active.add(gap.argmin())
        balanced = active.balance(interference)
        solves += 1
        while balanced.min() <= 0:
            active.release(pressure, balanced)
            if solves > 10 * candidate_count:
                raise ArithmeticError(
                    f"no end after {solves} solves for {candidate_count} nodes"
                )
            balanced = active.balance(interference)
            solves += 1
        pressure[active.inside] = balanced
        gap = balanced @ active.rows[: active.count] - interference
        gap[active.inside] = 0
    field = np.zeros(heights.size)
    field[nodes] = pressure
    return field.reshape(heights.shape)
