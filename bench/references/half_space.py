"""The elastic half-space, written independently of `bem`, to compare results of `bem` with it.

Lengths are in units of a cell's first side, and E* = 1. Closed forms give the influence
coefficients at every distance; SciPy convolves and solves.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.signal import fftconvolve
from scipy.sparse.linalg import LinearOperator, cg

from bem.bodies import Kernel

Field = NDArray[np.float64]
"""Values at the nodes, of shape (nx, ny) unless a function states another one."""

Long = NDArray[np.longdouble]
"""Numbers of the machine's longest floating-point type."""

FLAT_PUNCH_RTOL = 1e-13
"""Relative residual at which the conjugate gradients of `flat_punch` end, in the 2-norm [1]."""


@lru_cache(maxsize=16)
def influence_coefficients(
    shape: tuple[int, int], kernel: Kernel, aspect: float = 1.0
) -> Field:
    """Compute the displacement at a cell's centre by unit pressure on a cell i and j cells away.

    Calls with equal arguments return one array.

    Parameters
    ----------
    shape : (int, int)
        Numbers of offsets along x and y.
    kernel : {"uniform-pressure", "concentrated-force"}
        How the pressure acts: uniformly on the cell, after Love (1929), or as MIRCO's force on a
        disc, which is for square cells.
    aspect : float
        Second side of a cell over its first [1].

    Returns
    -------
    ndarray, shape `shape`
        Coefficients, read-only [first side of a cell / E*].
    """
    rows, columns = np.indices(shape)
    x = rows.astype(np.longdouble)
    y = columns.astype(np.longdouble)
    if kernel == "uniform-pressure":
        table = _uniform_pressure(x, y * aspect, aspect)
    else:
        table = _concentrated_force(np.hypot(x, y))
    coefficients = table.astype(np.float64)
    coefficients.setflags(write=False)
    return coefficients


def _uniform_pressure(x: Long, y: Long, aspect: float) -> Long:
    """Return the displacement at the offset (x, y) by unit pressure on a cell of 1 by `aspect`.

    Source: Johnson (1985), eq. 3.25. Far away its terms cancel. Numbers of the longest type keep
    enough digits there.
    """
    x_low = x - 0.5
    x_high = x + 0.5
    y_low = y - 0.5 * aspect
    y_high = y + 0.5 * aspect
    of_x_high = x_high * _log_ratio(x_high, y_high, y_low)
    of_x_low = x_low * _log_ratio(x_low, y_high, y_low)
    total: Long = of_x_high - of_x_low
    of_y_high = y_high * _log_ratio(y_high, x_high, x_low)
    of_y_low = y_low * _log_ratio(y_low, x_high, x_low)
    total += of_y_high - of_y_low
    return total / np.pi


def _log_ratio(across: Long, far: Long, near: Long) -> Long:
    """Return the logarithm in a term of Love's solution.

    The term is for an edge at the distance `across`, with ends at `far` and `near` along it.
    """
    to_far = np.hypot(across, far)
    to_near = np.hypot(across, near)
    ratio = (far + to_far) / (near + to_near)
    return np.asarray(np.log(ratio))


def _concentrated_force(distance: Long) -> Long:
    """Return the displacement 2/pi asin(1/(2 r)) by a force on a disc of half a cell's radius.

    `distance` holds r; its first entry, the distance 0, is overwritten. The result there is 2/pi,
    as in MIRCO.
    """
    distance[0, 0] = 0.5
    table: Long = 2 / np.pi * np.arcsin(0.5 / distance)
    table[0, 0] = 2 / np.pi
    return table


def displacement(pressure: Field, kernel: Kernel, aspect: float = 1.0) -> Field:
    """Compute the displacement under a pressure by SciPy's convolution.

    Parameters
    ----------
    pressure : ndarray, shape (nx, ny)
        Contact pressure [E*].
    kernel : {"uniform-pressure", "concentrated-force"}
        Kernel, as for `influence_coefficients`.
    aspect : float
        Second side of a cell over its first [1].

    Returns
    -------
    ndarray, shape (nx, ny)
        Displacement [first side of a cell].
    """
    table = influence_coefficients(pressure.shape, kernel, aspect)
    offsets = [np.abs(np.arange(1 - nodes, nodes)) for nodes in table.shape]
    mirrored = table[np.ix_(*offsets)]
    moved: Field = fftconvolve(mirrored, pressure, mode="valid")
    return moved


@lru_cache(maxsize=16)
def flat_punch(shape: tuple[int, int], kernel: Kernel, aspect: float = 1.0) -> Field:
    """Find the pressure that displaces every node by 1, by SciPy's conjugate gradients.

    Calls with equal arguments return one array.

    Parameters
    ----------
    shape : (int, int)
        Nodes along x and y.
    kernel : {"uniform-pressure", "concentrated-force"}
        Kernel, as for `influence_coefficients`.
    aspect : float
        Second side of a cell over its first [1].

    Returns
    -------
    ndarray, shape `shape`
        Pressure, read-only [E* / first side of a cell].

    Raises
    ------
    ArithmeticError
        If the residual does not fall to `FLAT_PUNCH_RTOL`.
    """

    def moved(pressure: Field) -> Field:
        """Return the displacement, (nodes,), under a pressure, (nodes,)."""
        return displacement(pressure.reshape(shape), kernel, aspect).reshape(-1)

    nodes = shape[0] * shape[1]
    matrix = LinearOperator((nodes, nodes), matvec=moved, dtype=np.float64)
    values, failure = cg(matrix, np.ones(nodes), rtol=FLAT_PUNCH_RTOL)
    if failure:
        raise ArithmeticError(
            f"flat punch on {shape[0]} x {shape[1]} nodes did not converge"
        )
    pressure: Field = values.reshape(shape)
    pressure.setflags(write=False)
    return pressure


def critical_delta(heights: Field, kernel: Kernel, aspect: float = 1.0) -> float:
    """Compute Delta*; a compliant far field has a solution for displacements below it only.

    Delta* is the mean depth below the highest node, weighted by the pressure of a flat punch.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights of the surface [um].
    kernel : {"uniform-pressure", "concentrated-force"}
        Kernel, as for `influence_coefficients`.
    aspect : float
        Second side of a cell over its first [1].

    Returns
    -------
    float
        Displacement Delta* [um].
    """
    depth = heights.max() - heights
    weights = flat_punch(heights.shape, kernel, aspect)
    return float(np.average(depth, weights=weights))
