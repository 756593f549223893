"""Contact by the dense matrix: every influence coefficient written out, every set factorised.

Block principal pivoting with Cholesky factors: slow and short. The solution is accepted only if it
fulfils the conditions of complementarity.
"""

from functools import lru_cache

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from bem.influence import Kernel
from bench.references.half_space import Field, displacement, flat_punch, influence_coefficients

Nodes = NDArray[np.intp]
Sides = NDArray[np.intp]

ROUNDING = 1e-11  # pressures and gaps below, in reduced units, count as zero
PATIENCE = 4  # exchanges of all wrong nodes that may pass without fewer of them
EXCHANGES = 10_000  # which only rounding can make necessary
STEPS = 60  # of Newton's method for the compliant far field; it takes as many as sets are met


def influence_view(shape: tuple[int, int], kernel: Kernel, aspect: float = 1.0) -> Field:
    """(nx, ny, nx, ny) displacement of node (i, j) under unit pressure on (k, l); a view."""
    table = influence_coefficients(shape, kernel, aspect)
    offsets = [np.abs(np.arange(1 - nodes, nodes)) for nodes in shape]
    return sliding_window_view(table[np.ix_(*offsets)], shape)[::-1, ::-1]


def influence_matrix(
    shape: tuple[int, int], kernel: Kernel, aspect: float = 1.0, nodes: Nodes | None = None
) -> Field:
    """Write out the displacement of each node under unit pressure on each other node.

    Return an (m, m) matrix [first side of a cell / E*] for the (m,) flat indices of the nodes that
    count, all unless given; kernel and aspect as for `half_space.influence_coefficients`.
    """
    chosen = np.arange(shape[0] * shape[1]) if nodes is None else nodes
    rows, columns = np.divmod(chosen, shape[1])
    matrix: Field = influence_view(shape, kernel, aspect)[
        rows[:, None], columns[:, None], rows, columns
    ]
    return matrix


def displace(pressure: Field, kernel: Kernel, aspect: float = 1.0) -> Field:
    """(nx, ny) displacement under a (nx, ny) pressure, by the whole matrix."""
    matrix = influence_view(pressure.shape, kernel, aspect)
    return np.asarray(np.einsum("ijkl,kl->ij", matrix, pressure))


def solve(
    matrix: Field, interference: Field, start: Sides | None = None, hardness: float = np.inf
) -> Field:
    """Find the pressure 0 <= p <= H with gap w = A p - u >= 0 where p = 0 and <= 0 where p = H.

    All nodes of the wrong sign change sides at once as long as that lowers their number, the last
    of them alone where it does not, which ends for any positive definite matrix (Judice and Pires
    1994; Murty 1974).

    Parameters
    ----------
    matrix : ndarray, shape (m, m)
        Positive definite A.
    interference : ndarray, shape (m,)
        u.
    start : ndarray, shape (m,), optional
        Sides to begin with: -1 at nodes without pressure, 1 at yielded nodes, 0 between. Nodes that
        overlap are between unless given.
    hardness : float
        H; no bound unless given.

    Raises
    ------
    ArithmeticError
        If rounding does not let the nodes settle, or leaves a gap in contact above `ROUNDING` of
        the largest interference.
    """
    side = np.where(interference > 0, 0, -1) if start is None else start
    accepted = ROUNDING * float(np.abs(interference).max(initial=0.0))
    fewest, patience = interference.size + 1, PATIENCE
    for _ in range(EXCHANGES):
        pressure = balance(matrix, interference, side, hardness)
        gap = matrix @ pressure - interference
        beyond = (pressure < -accepted) | (pressure > hardness + accepted)
        wrong = np.where(side == 0, beyond, side * gap > accepted)
        count = int(np.count_nonzero(wrong))
        if not count:
            return _certified(pressure, gap[side == 0], accepted, hardness)
        if count < fewest:
            fewest, patience = count, PATIENCE
        elif patience:
            patience -= 1
        else:
            wrong[: np.flatnonzero(wrong)[-1]] = False
        side = np.where(wrong, np.where(side == 0, np.where(pressure > 0, 1, -1), 0), side)
    raise ArithmeticError(f"dense solve: {count} of {side.size} nodes are still wrong")


def _certified(pressure: Field, closed: Field, accepted: float, hardness: float) -> Field:
    violation = float(np.abs(closed).max(initial=0.0))
    if violation > accepted:
        raise ArithmeticError(f"dense solve: gap of {violation:.1e} in contact")
    return np.clip(pressure, 0.0, hardness)


def balance(matrix: Field, interference: Field, side: Sides, hardness: float = np.inf) -> Field:
    """(m,) pressure that closes the gap between the bounds, where side is 0; at a bound elsewhere.

    `side` is -1 at nodes without pressure and 1 at yielded nodes.
    """
    pressure = np.where(side > 0, hardness, 0.0)
    free, bound = side == 0, side > 0
    if free.any():
        load = interference[free] - matrix[np.ix_(free, bound)] @ pressure[bound]
        pressure[free] = cho_solve(cho_factor(matrix[np.ix_(free, free)]), load)
    return pressure


def press(heights: Field, delta: float, kernel: Kernel, aspect: float = 1.0) -> tuple[Field, Field]:
    """Solve contact on a rigid far field; a second call with the same arguments costs nothing.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights [um].
    delta : float
        Displacement of the far field, above 0 [um].
    kernel, aspect
        See `half_space.influence_coefficients`.

    Returns
    -------
    pressure : ndarray, shape (nx, ny)
        Read-only [E* delta / first side of a cell].
    gap : ndarray, shape (nx, ny)
        Read-only [delta].
    """
    values = np.ascontiguousarray(heights, np.float64).tobytes()
    return _press(values, heights.shape, delta, kernel, aspect)


@lru_cache(maxsize=512)  # tests of the solver's two ways ask for everything twice
def _press(
    values: bytes, shape: tuple[int, int], delta: float, kernel: Kernel, aspect: float
) -> tuple[Field, Field]:
    """Solve on the nodes that the undeformed bodies overlap: the others carry nothing."""
    heights = np.frombuffer(values).reshape(shape)
    interference = (((heights - heights.max()) + delta) / delta).reshape(-1)
    nodes = np.flatnonzero(interference > 0)
    matrix = influence_matrix(shape, kernel, aspect, nodes)
    pressure = np.zeros(interference.size)
    pressure[nodes] = solve(matrix, interference[nodes])
    return _fields(pressure, interference, shape, kernel, aspect)


def press_compliant(
    heights: Field, delta: float, kernel: Kernel, aspect: float = 1.0
) -> tuple[Field, Field]:
    """Contact on a compliant far field, below its Delta*; parameters and result as for `press`.

    The force is a convex, piecewise linear function of the approach, so that Newton's method for
    approach = 1 + force / K starts below the solution, never passes it and ends exactly.
    """
    depth = ((heights - heights.max()) / delta).reshape(-1)
    matrix = influence_matrix(heights.shape, kernel, aspect)
    stiffness = float(flat_punch(heights.shape, kernel, aspect).sum())
    approach = 1.0
    side = np.where(depth + approach > 0, 0, -1)
    for _ in range(STEPS):
        values = solve(matrix, depth + approach, side)
        side = np.where(values > 0, 0, -1)
        slope = float(balance(matrix, np.ones(depth.size), side).sum())
        advance = (1 + values.sum() / stiffness - approach) / (1 - slope / stiffness)
        if abs(advance) <= ROUNDING * approach:
            return _fields(values, depth + approach, heights.shape, kernel, aspect)
        approach += float(advance)
    raise ArithmeticError(f"dense solve: {STEPS} approaches of a compliant far field")


def full_contact_delta(heights: Field, kernel: Kernel, aspect: float = 1.0) -> float:
    """Displacement at which the last node comes to touch on a rigid far field [um].

    With all nodes in contact the pressure is linear in Delta: it is the last that becomes positive.
    """
    factor = cho_factor(influence_matrix(heights.shape, kernel, aspect))
    at_first_touch = cho_solve(factor, (heights - heights.max()).reshape(-1))
    per_delta = cho_solve(factor, np.ones(heights.size))
    return float((-at_first_touch / per_delta).max())


def _fields(
    pressure: Field, interference: Field, shape: tuple[int, int], kernel: Kernel, aspect: float
) -> tuple[Field, Field]:
    """Pressure and gap on the grid, read-only."""
    field = pressure.reshape(shape)
    gap = displacement(field, kernel, aspect) - interference.reshape(shape)
    for each in (field, gap):
        each.setflags(write=False)
    return field, gap
