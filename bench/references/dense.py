"""Contact by the dense matrix: every influence coefficient written out, every set factorised.

`press` goes by block principal pivoting with Cholesky factors: slow and short. The solution is
accepted only if it fulfils the conditions of complementarity. `press_yielding` bounds the pressure
by a hardness. With A = L L^T, the pressure 0 <= p <= H that minimises p A p / 2 - u p is the
least-squares solution of L^T p = L^-1 u within these bounds, with which `solve` may begin.

`press_by_nnls` is the paper's algorithm, A. Bemporad and M. Paggi (2015), Int. J. Solids Struct.
69-70, algorithm 3, after Lawson and Hanson (1974): one dense solve for each node that comes into
contact, as in MIRCO. So that the comparison does not flatter ours, dense systems go to LAPACK's
Cholesky instead of MIRCO's LU, half the work, and influence coefficients are kept.
"""

from collections.abc import Callable

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, cholesky, solve_triangular
from scipy.linalg.lapack import dposv
from scipy.optimize import lsq_linear

from bem.influence import Kernel
from bench.references.half_space import Field, displacement, influence_coefficients

Nodes = NDArray[np.intp]
Sides = NDArray[np.intp]

ROUNDING = 1e-11  # pressures and gaps below, in reduced units, count as zero
PATIENCE = 4  # exchanges of all wrong nodes that may pass without fewer of them
EXCHANGES = 10_000  # which only rounding can make necessary


def influence_view(shape: tuple[int, int], kernel: Kernel, aspect: float = 1.0) -> Field:
    """(nx, ny, nx, ny) displacement of node (i, j) under unit pressure on (k, l); a view."""
    table = influence_coefficients(shape, kernel, aspect)
    offsets = [np.abs(np.arange(1 - nodes, nodes)) for nodes in shape]
    return sliding_window_view(table[np.ix_(*offsets)], shape)[::-1, ::-1]


def influence_matrix(
    shape: tuple[int, int],
    kernel: Kernel,
    aspect: float = 1.0,
    nodes: Nodes | None = None,
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
    matrix: Field,
    interference: Field,
    start: Sides | None = None,
    hardness: float = np.inf,
) -> Field:
    """Find the pressure 0 <= p <= H with gap w = A p - u >= 0 where p = 0 and <= 0 where p = H.

    All nodes of the wrong sign change sides at once as long as that lowers their number, the last
    of them alone where it does not, which ends for any positive definite matrix (Judice and Pires
    1994; Murty 1974).

    A is an (m, m) positive definite matrix, u the (m,) interference, and H the hardness. `start`
    holds the (m,) sides to begin with: -1 at nodes without pressure, 1 at yielded nodes, 0 between;
    nodes that overlap are between unless it is given.

    An ArithmeticError is raised if rounding does not let the nodes settle, or leaves a gap in
    contact above `ROUNDING` of the largest interference.
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
            if (violation := float(np.abs(gap[side == 0]).max(initial=0.0))) > accepted:
                raise ArithmeticError(f"dense solve: gap of {violation:.1e} in contact")
            return np.clip(pressure, 0.0, hardness)
        if count < fewest:
            fewest, patience = count, PATIENCE
        elif patience:
            patience -= 1
        else:
            wrong[: np.flatnonzero(wrong)[-1]] = False
        side = np.where(
            wrong, np.where(side == 0, np.where(pressure > 0, 1, -1), 0), side
        )
    raise ArithmeticError(f"dense solve: {count} of {side.size} nodes are still wrong")


def balance(
    matrix: Field, interference: Field, side: Sides, hardness: float = np.inf
) -> Field:
    """(m,) pressure that closes the gap between the bounds, where side is 0; at a bound elsewhere.

    `side` is -1 at nodes without pressure and 1 at yielded nodes.
    """
    pressure = np.where(side > 0, hardness, 0.0)
    free, bound = side == 0, side > 0
    if free.any():
        load = interference[free] - matrix[np.ix_(free, bound)] @ pressure[bound]
        pressure[free] = cho_solve(cho_factor(matrix[np.ix_(free, free)]), load)
    return pressure


def press(
    heights: Field, delta: float, kernel: Kernel, aspect: float = 1.0
) -> tuple[Field, Field]:
    """Solve contact on a rigid far field that is displaced by Delta > 0 [um].

    Return the pressure [E* delta / first side of a cell] and the gap [delta], of the heights' shape
    (nx, ny); kernel and aspect as for `half_space.influence_coefficients`.
    """
    interference = (((heights - heights.max()) + delta) / delta).reshape(-1)
    nodes = np.flatnonzero(interference > 0)  # the others carry nothing
    matrix = influence_matrix(heights.shape, kernel, aspect, nodes)
    pressure = np.zeros(heights.size)
    pressure[nodes] = solve(matrix, interference[nodes])
    field = pressure.reshape(heights.shape)
    return field, displacement(field, kernel, aspect) - interference.reshape(
        heights.shape
    )


def full_contact_delta(heights: Field, kernel: Kernel, aspect: float = 1.0) -> float:
    """Displacement at which the last node comes to touch on a rigid far field [um].

    With all nodes in contact the pressure is linear in Delta: it is the last that becomes positive.
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
) -> tuple[Field, Field]:
    """Solve contact on a rigid far field with bounded pressure.

    The arguments are those of `press`; `sides` may find those that `solve` begins with, as
    `by_least_squares` does. Return the pressure, like the hardness in [E* um / first side of a
    cell], and the gap [um], negative at yielded nodes by the depth to which they yield.
    """
    interference = ((heights - heights.max()) + delta).reshape(-1)
    nodes = np.flatnonzero(interference > 0)
    matrix, over = (
        influence_matrix(heights.shape, kernel, aspect, nodes),
        interference[nodes],
    )
    pressure = np.zeros(heights.size)
    start = None if sides is None else sides(matrix, over, hardness)
    pressure[nodes] = solve(matrix, over, start, hardness)
    field = pressure.reshape(heights.shape)
    return field, displace(field, kernel, aspect) - interference.reshape(heights.shape)


def by_least_squares(matrix: Field, interference: Field, hardness: float) -> Sides:
    """(m,) sides by bounded least squares: -1 without pressure, 1 at yielded nodes, 0 between."""
    factor = cholesky(matrix, lower=True)
    target = solve_triangular(factor, interference, lower=True)
    found = lsq_linear(factor.T, target, bounds=(0.0, hardness), method="bvls", tol=1e-15)
    return np.asarray(found.active_mask)


def press_by_nnls(
    heights: Field,
    delta: float,
    *,
    kernel: Kernel = "uniform-pressure",
    rtol: float = 1e-8,
) -> Field:
    """Press a surface on square cells as `press` does, up to a penetration rtol over Delta.

    Return the pressure, shape (nx, ny) [E* Delta / spacing]: p >= 0 with gap w = H p - u >= -rtol
    and p w = 0. ArithmeticError is raised if rounding keeps the method from ending, which no
    contact has been seen to do.
    """
    over = (((heights - heights.max()) + delta) / delta).reshape(-1)
    nodes = np.flatnonzero(over > 0)
    matrix, interference = (
        influence_matrix(heights.shape, kernel, nodes=nodes),
        over[nodes],
    )
    candidates = interference.size
    active = np.empty(candidates, np.intp)  # the first `count` are in contact
    rows = np.empty_like(matrix)  # those of H that belong to them
    pressure, gap = np.zeros(candidates), -interference
    count = solves = 0
    while count < candidates and gap.min() < -rtol:
        active[count] = gap.argmin()
        rows[count] = matrix[active[count]]
        count += 1
        while True:
            inside = active[:count]
            _, values, failed = dposv(
                rows[:count, inside].T, interference[inside], overwrite_a=True
            )
            if failed:
                raise ArithmeticError("the influence matrix is not positive definite")
            solves += 1
            if values.min() > 0:
                break
            count = _release(pressure, values, active, rows, count)
            if solves > 10 * candidates:
                raise ArithmeticError(
                    f"no end after {solves} solves for {candidates} nodes"
                )
        pressure[inside] = values
        gap = values @ rows[:count] - interference
        gap[inside] = 0
    found = np.zeros(heights.size)
    found[nodes] = pressure
    return found.reshape(heights.shape)


def _release(
    pressure: Field, values: Field, active: Nodes, rows: Field, count: int
) -> int:
    """Go towards the balance as far as pressures stay positive; release the node that stops it.

    The last of the active nodes takes its place. Return the number of nodes still in contact.
    """
    inside = active[:count]
    here = pressure[inside]
    falling = np.flatnonzero(values <= 0)
    shares = here[falling] / (here[falling] - values[falling] + np.finfo(float).tiny)
    pressure[inside] = here + shares.min() * (values - here)
    stopping = falling[shares.argmin()]
    pressure[active[stopping]] = 0
    active[stopping] = active[count - 1]
    rows[stopping] = rows[count - 1]
    return count - 1
