"""The elastic half-space, written independently of `bem`, whose results are checked against it.

Lengths are in units of a cell's first side and E* = 1. Love's closed form serves at every
distance, SciPy convolves and solves.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.signal import fftconvolve
from scipy.sparse.linalg import LinearOperator, cg

from bem.influence import Kernel

Field = NDArray[np.float64]
Long = NDArray[np.longdouble]

FLAT_PUNCH_RTOL = 1e-13  # of conjugate gradients, in the 2-norm


@lru_cache(maxsize=16)
def influence_coefficients(
    shape: tuple[int, int], kernel: Kernel, aspect: float = 1.0
) -> Field:
    """Displacement at a cell's centre from unit pressure on the cell (i, j) away.

    The kernel is "uniform-pressure", after Love (1929), or "concentrated-force", as in MIRCO, which
    is for square cells; the aspect is the second side of a cell over its first side [1]. Return a
    read-only array of the shape [first side of a cell x pressure / E*].
    """
    x, y = (index.astype(np.longdouble) for index in np.indices(shape))
    if kernel == "uniform-pressure":
        table = _uniform_pressure(x, y * aspect, aspect)
    else:
        table = _concentrated_force(np.hypot(x, y))
    coefficients = table.astype(np.float64)
    coefficients.setflags(write=False)
    return coefficients


def _uniform_pressure(x: Long, y: Long, aspect: float) -> Long:
    """Johnson (1985), eq. 3.25, in the machine's longest numbers: far away it cancels."""
    left, right = x - 0.5, x + 0.5
    lower, upper = y - 0.5 * aspect, y + 0.5 * aspect
    total: Long = right * _log_ratio(right, upper, lower) - left * _log_ratio(
        left, upper, lower
    )
    total += upper * _log_ratio(upper, right, left) - lower * _log_ratio(
        lower, right, left
    )
    return total / np.pi


def _log_ratio(across: Long, far: Long, near: Long) -> Long:
    ratio = (far + np.hypot(across, far)) / (near + np.hypot(across, near))
    return np.asarray(np.log(ratio))


def _concentrated_force(distance: Long) -> Long:
    """A force on a disc of half a cell's radius, 2/pi asin(1/(2 r)); MIRCO's diagonal is 2/pi."""
    distance[0, 0] = 0.5
    table: Long = 2 / np.pi * np.arcsin(0.5 / distance)
    table[0, 0] = 2 / np.pi
    return table


def displacement(pressure: Field, kernel: Kernel, aspect: float = 1.0) -> Field:
    """Return the displacement [first side of a cell] under a pressure [E*], convolved by SciPy."""
    table = influence_coefficients(pressure.shape, kernel, aspect)
    mirrored = table[
        np.ix_(*(np.abs(np.arange(1 - nodes, nodes)) for nodes in table.shape))
    ]
    moved: Field = fftconvolve(mirrored, pressure, mode="valid")
    return moved


@lru_cache(maxsize=16)
def flat_punch(shape: tuple[int, int], kernel: Kernel, aspect: float = 1.0) -> Field:
    """Return the read-only pressure that moves every node by one unit [E* / first side of a cell].

    By SciPy's conjugate gradients; raises ArithmeticError if they do not reach `FLAT_PUNCH_RTOL`.
    """
    nodes = shape[0] * shape[1]
    matrix = LinearOperator(
        (nodes, nodes),
        matvec=lambda values: displacement(values.reshape(shape), kernel, aspect).reshape(
            -1
        ),
        dtype=np.float64,
    )
    values, failure = cg(matrix, np.ones(nodes), rtol=FLAT_PUNCH_RTOL)
    if failure:
        raise ArithmeticError(
            f"flat punch on {shape[0]} x {shape[1]} nodes did not converge"
        )
    pressure: Field = values.reshape(shape)
    pressure.setflags(write=False)
    return pressure


def critical_delta(heights: Field, kernel: Kernel, aspect: float = 1.0) -> float:
    """Delta* of a compliant far field: the flat punch's mean of the depth below the top [um]."""
    depth = heights.max() - heights
    return float(np.average(depth, weights=flat_punch(heights.shape, kernel, aspect)))
