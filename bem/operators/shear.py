"""The influence matrix in shear: displacement along an axis by a tangential traction along it.

It is that of two half-spaces of like elastic constants, between which normal pressures and
tangential tractions do not influence each other. In a wave with the wave numbers (q_x, q_y), a
traction along x displaces along x by

    2 / (E* q) (1 - nu q_x^2 / q^2) / (1 - nu)

(Johnson 1985, Contact Mechanics, section 3.6, from Cerruti's point force): by the normal compliance
2 / (E* q) for nu = 0, and by up to 1 / (1 - nu) of it else. Displacements across the traction are
not computed.
"""

import numpy as np
from numpy.typing import NDArray

from bem.arrays import Field, Values
from bem.influence import QUADRATURE
from bem.operators.filters import CosineFilter, FieldFilter, spectral_filter
from bem.operators.patch import even_spectrum, fast_period
from bem.problem import Boundary


def shear_filter(
    shape: tuple[int, int], boundary: Boundary, aspect: float, poisson: float, axis: int
) -> FieldFilter:
    """Return the influence matrix in shear as a filter of fields.

    Parameters
    ----------
    shape : tuple of int
        Nodes (nx, ny) of the patch.
    boundary : str
        "free", "periodic" or "mirror".
    aspect : float
        Second side of a cell over its first [1].
    poisson : float
        Poisson's ratio nu of both bodies, above -1 and at most 0.5 [1].
    axis : int
        0 for traction and displacement along x, 1 for those along y.

    Returns
    -------
    FieldFilter
        Filter from traction [E*] to displacement [first side of a cell], in double precision. On a
        patch without edges it makes the mean 0.
    """
    if boundary == "free":
        periods = fast_period(shape[0]), fast_period(shape[1])
        # Offsets beyond the grid never connect two nodes, so that any value will do there.
        rows = np.minimum(np.arange(periods[0] // 2 + 1), shape[0] - 1)
        columns = np.minimum(np.arange(periods[1] // 2 + 1), shape[1] - 1)
        table = _coefficients(rows[:, np.newaxis], columns, aspect, poisson, axis)
        return spectral_filter(shape, even_spectrum(table), "float64", periods)
    compliances = _compliances(shape, boundary, aspect, poisson, axis)
    if boundary == "mirror":
        return CosineFilter(compliances)
    up_to_half_period = compliances[: shape[0] // 2 + 1]
    return spectral_filter(shape, up_to_half_period, "float64", periods=shape)


def _compliances(
    shape: tuple[int, int], boundary: Boundary, aspect: float, poisson: float, axis: int
) -> Field:
    """Return the compliance of all waves on a patch without edges, and 0 for the mean.

    Its shape and order are those of `bem.operators.patch.wave_numbers`
    [first side of a cell / E*].
    """
    if boundary == "periodic":
        along = np.fft.fftfreq(shape[0])[:, np.newaxis]
        across = np.fft.rfftfreq(shape[1]) / aspect
    else:
        along = np.arange(shape[0])[:, np.newaxis] / (2 * shape[0])
        across = np.arange(shape[1]) / (2 * shape[1]) / aspect
    square = along**2 + across**2
    square[0, 0] = np.inf
    in_line = (along, across)[axis] ** 2 / square  # square of the cosine to the traction
    normal = 1 / (np.pi * np.sqrt(square))  # 2 / |q|
    compliances: Field = normal * (1 - poisson * in_line) / (1 - poisson)
    return compliances


def _coefficients(
    rows: NDArray[np.int64],
    columns: NDArray[np.int64],
    aspect: float,
    poisson: float,
    axis: int,
) -> Field:
    """Compute the (m, n) coefficients of uniform traction on a cell of a free patch.

    `rows`, (m, 1), are the offsets along the first axis and `columns`, (n,), along the second
    [cells]. Near the loaded cell the closed form is used. Farther away its terms would cancel, so
    that quadrature is used, as in `bem.influence` [first side of a cell / E*].
    """
    x, y = np.broadcast_arrays(rows * 1.0, columns * aspect)
    distance = np.hypot(x, y) / max(1.0, aspect)
    table = np.empty(x.shape)
    near = distance < QUADRATURE[0][0]
    table[near] = _closed_form(x[near], y[near], aspect, poisson, axis)
    stops = [start for start, _ in QUADRATURE[1:]] + [np.inf]
    for (start, points), stop in zip(QUADRATURE, stops, strict=True):
        zone = (distance >= start) & (distance < stop)
        table[zone] = _quadrature(x[zone], y[zone], aspect, poisson, axis, points)
    return table


def _closed_form(
    x: Values, y: Values, aspect: float, poisson: float, axis: int
) -> Values:
    """Integrate Cerruti's displacement over a cell of sides 1 and `aspect` at (x, y).

    Along x it is (1 / r + nu / (1 - nu) x^2 / r^3) / pi. Its integral is a sum over the cell's
    corners.
    """
    stiff = 1.0
    soft = 1 / (1 - poisson)
    of_along, of_across = (stiff, soft) if axis == 0 else (soft, stiff)
    total = np.zeros_like(x)
    for sign_x in (1, -1):
        for sign_y in (1, -1):
            along = x + sign_x * 0.5
            across = y + sign_y * 0.5 * aspect
            corner = of_along * along * np.arcsinh(across / np.abs(along))
            corner += of_across * across * np.arcsinh(along / np.abs(across))
            total += sign_x * sign_y * corner
    return total / np.pi


def _quadrature(
    x: Values, y: Values, aspect: float, poisson: float, axis: int, points: int
) -> Values:
    """Integrate Cerruti's displacement over a cell of sides 1 and `aspect` at (x, y).

    The Gauss-Legendre rule has `points` points along each side.
    """
    nodes, weights = np.polynomial.legendre.leggauss(points)
    total = np.zeros_like(x)
    for node_x, weight_x in zip(nodes / 2, weights / 2, strict=True):
        for node_y, weight_y in zip(nodes / 2, weights / 2, strict=True):
            along = (x + node_x) ** 2
            across = (y + aspect * node_y) ** 2
            square = along + across
            in_line = (along, across)[axis] / square
            point = (1 + poisson / (1 - poisson) * in_line) / np.sqrt(square)
            total += weight_x * weight_y * point
    return total * (aspect / np.pi)
