"""Contact by the dense matrix: every influence coefficient written out, every set factorised.

Slow, memory-hungry and short: what the fast solver is held against. Block principal pivoting with
Cholesky factors, certified by the complementarity of what it returns.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from bem.influence import Kernel
from bench.half_space import displacement, flat_punch, influence_coefficients

Field = NDArray[np.float64]
Nodes = NDArray[np.intp]

ROUNDING = 1e-11  # pressures and gaps below, in reduced units, count as zero
PATIENCE = 4  # exchanges of all wrong nodes that may pass without fewer of them
EXCHANGES = 10_000  # which only rounding can make necessary
STEPS = 60  # of Newton's method for the compliant far field; it takes as many as sets are met


def influence_matrix(
    shape: tuple[int, int], kernel: Kernel, aspect: float = 1.0, nodes: Nodes | None = None
) -> Field:
    """Displacement of each node under unit pressure on each other.

    Parameters
    ----------
    shape : (nx, ny) nodes of the grid
    kernel, aspect : see `bench.half_space.influence_coefficients`
    nodes : (m,) flat indices of the nodes that count; all unless given

    Returns
    -------
    (m, m) H [first side of a cell / E*]
    """
    table = influence_coefficients(shape, kernel, aspect)
    chosen = np.arange(shape[0] * shape[1]) if nodes is None else nodes
    rows, columns = np.divmod(chosen, shape[1])
    matrix: Field = table[
        np.abs(rows[:, None] - rows[None, :]), np.abs(columns[:, None] - columns[None, :])
    ]
    return matrix


def solve(matrix: Field, interference: Field, start: NDArray[np.bool_] | None = None) -> Field:
    """Pressure p >= 0 with gap w = H p - u >= 0 and p w = 0.

    All nodes of the wrong sign change sides at once as long as that lowers their number, the last
    of them alone where it does not, which ends for any positive definite matrix (Judice and Pires
    1994; Murty 1974).

    Parameters
    ----------
    matrix : (m, m) H, positive definite
    interference : (m,) u
    start : (m,) nodes held in contact at first; those that overlap unless given

    Returns
    -------
    (m,) pressure

    Raises
    ------
    ArithmeticError
        if rounding does not let the nodes settle, or leaves a gap in contact above `ROUNDING` of
        the largest interference
    """
    contact = (interference > 0) if start is None else start.copy()
    accepted = ROUNDING * float(np.abs(interference).max(initial=0.0))
    fewest, patience = interference.size + 1, PATIENCE
    for _ in range(EXCHANGES):
        pressure = balance(matrix, interference, contact)
        gap = matrix @ pressure - interference
        wrong = np.where(contact, pressure < -accepted, gap < -accepted)
        count = int(np.count_nonzero(wrong))
        if not count:
            return _certified(pressure, float(np.abs(gap[contact]).max(initial=0.0)), accepted)
        if count < fewest:
            fewest, patience = count, PATIENCE
        elif patience:
            patience -= 1
        else:
            wrong[: np.flatnonzero(wrong)[-1]] = False
        contact ^= wrong
    raise ArithmeticError(f"dense solve: {count} of {contact.size} nodes are still wrong")


def _certified(pressure: Field, violation: float, accepted: float) -> Field:
    if violation > accepted:
        raise ArithmeticError(f"dense solve: gap of {violation:.1e} in contact")
    return np.maximum(pressure, 0)


def balance(matrix: Field, interference: Field, contact: NDArray[np.bool_]) -> Field:
    """(m,) pressure of either sign that closes the gap on the nodes in contact."""
    pressure = np.zeros(interference.size)
    if contact.any():
        factor = cho_factor(matrix[np.ix_(contact, contact)])
        pressure[contact] = cho_solve(factor, interference[contact])
    return pressure


def press(heights: Field, delta: float, kernel: Kernel, aspect: float = 1.0) -> tuple[Field, Field]:
    """Contact on a rigid far field, from the nodes that the undeformed bodies overlap.

    Parameters
    ----------
    heights : (nx, ny) [um]
    delta : displacement of the far field, above 0 [um]
    kernel, aspect : see `bench.half_space.influence_coefficients`

    Returns
    -------
    pressure : (nx, ny) [E* delta / first side of a cell]
    gap : (nx, ny) [delta]
    """
    interference = (((heights - heights.max()) + delta) / delta).reshape(-1)
    candidates = np.flatnonzero(interference > 0)
    values = solve(
        influence_matrix(heights.shape, kernel, aspect, candidates), interference[candidates]
    )
    return _fields(heights.shape, kernel, aspect, interference, candidates, values)


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
    everywhere, approach = np.arange(depth.size), 1.0
    contact = depth + approach > 0
    for _ in range(STEPS):
        values = solve(matrix, depth + approach, contact)
        contact = values > 0
        slope = float(balance(matrix, np.ones(depth.size), contact).sum())
        advance = (1 + values.sum() / stiffness - approach) / (1 - slope / stiffness)
        if abs(advance) <= ROUNDING * approach:
            return _fields(heights.shape, kernel, aspect, depth + approach, everywhere, values)
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
    shape: tuple[int, int],
    kernel: Kernel,
    aspect: float,
    interference: Field,
    nodes: Nodes,
    values: Field,
) -> tuple[Field, Field]:
    """Pressure and gap on the whole grid from the values on some of its nodes."""
    pressure = np.zeros(interference.size)
    pressure[nodes] = values
    moved = displacement(pressure.reshape(shape), kernel, aspect)
    return pressure.reshape(shape), moved - interference.reshape(shape)
