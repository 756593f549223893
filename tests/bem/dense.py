"""Dense reference: every entry of the influence matrix, and a direct solver that uses them all."""

from functools import lru_cache

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from bem.influence import Kernel, influence_coefficients

Field = NDArray[np.float64]

ROUNDING = 1e-13  # pressures and gaps below, in reduced units, count as zero
PATIENCE = 3  # exchanges of all wrong nodes that may pass without fewer of them


def influence_matrix(shape: tuple[int, int], kernel: Kernel, aspect: float = 1.0) -> Field:
    """(nx, ny, nx, ny) displacement of node (i, j) under unit pressure on (k, l); a view."""
    table = influence_coefficients(shape, kernel, aspect)
    offsets = [np.abs(np.arange(1 - nodes, nodes)) for nodes in shape]
    mirrored = table[np.ix_(*offsets)]
    return sliding_window_view(mirrored, shape)[::-1, ::-1]


def displace(pressure: Field, kernel: Kernel, aspect: float = 1.0) -> Field:
    """(nx, ny) displacement under a (nx, ny) pressure [first side of a cell / E*]."""
    matrix = influence_matrix(pressure.shape, kernel, aspect)
    return np.einsum("ijkl,kl->ij", matrix, pressure)


def press(heights: Field, delta: float, kernel: Kernel, aspect: float = 1.0) -> tuple[Field, Field]:
    """Solve the contact of a rigid far field.

    Returns
    -------
    pressure : (nx, ny) in units of E* delta / first side of a cell
    gap : (nx, ny) in units of delta
    """
    return _press(heights.tobytes(), heights.shape, delta, kernel, aspect)


@lru_cache(maxsize=512)  # modules that test the solver's two ways ask for everything twice
def _press(
    values: bytes, shape: tuple[int, int], delta: float, kernel: Kernel, aspect: float
) -> tuple[Field, Field]:
    heights = np.frombuffer(values).reshape(shape)
    interference = ((heights - heights.max()) + delta) / delta
    candidates = np.nonzero(interference > 0)  # a node that is not overlapped carries nothing
    rows, columns = (index[:, None] for index in candidates)
    matrix = influence_matrix(heights.shape, kernel, aspect)[rows, columns, rows.T, columns.T]
    pressure = np.zeros(heights.shape)
    pressure[candidates] = solve(matrix, interference[candidates])
    gap = displace(pressure, kernel, aspect) - interference
    for field in (pressure, gap):
        field.setflags(write=False)
    return pressure, gap


def solve(matrix: Field, interference: Field) -> Field:
    """Pressure p >= 0 with gap w = H p - u >= 0 and p w = 0, for a positive definite matrix.

    Block principal pivoting (Judice and Pires 1994): all nodes of the wrong sign change sides at
    once as long as that lowers their number, the last of them alone where it does not, which
    ends for any positive definite matrix (Murty 1974).

    Parameters
    ----------
    matrix : (m, m) H
    interference : (m,) u
    """
    contact = np.zeros(interference.size, dtype=bool)
    fewest, patience = interference.size + 1, PATIENCE
    while True:
        pressure = _balance(matrix, interference, contact)
        gap = matrix @ pressure - interference
        wrong = np.where(contact, pressure < -ROUNDING, gap < -ROUNDING)
        count = int(np.count_nonzero(wrong))
        if not count:
            return np.maximum(pressure, 0)
        if count < fewest:
            fewest, patience = count, PATIENCE
        elif patience:
            patience -= 1
        else:
            wrong[: np.flatnonzero(wrong)[-1]] = False
        contact ^= wrong


def _balance(matrix: Field, interference: Field, contact: NDArray[np.bool_]) -> Field:
    """Pressure of either sign that closes the gap on these nodes."""
    pressure = np.zeros(interference.size)
    if contact.any():
        factor = cho_factor(matrix[np.ix_(contact, contact)])
        pressure[contact] = cho_solve(factor, interference[contact])
    return pressure
