"""Form of a measured map: its least-squares polynomial in x and y."""

from __future__ import annotations

import numpy as np

from gen.arrays import Heights, Values

HIGHEST_DEGREE = 20
"""Largest total degree of a form: higher ones follow the waviness, which is for an L-filter."""

BLOCK = 1 << 15
"""Nodes that enter the fit at a time, which bounds the memory."""


def number_of_terms(degree: int) -> int:
    """Return the number of coefficients of a polynomial in x and y of a total degree."""
    return (degree + 1) * (degree + 2) // 2


def fitted_polynomial(heights: Heights, degree: int) -> Heights:
    """Fit a polynomial of a total degree to the measured nodes by least squares.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights with NaN in the holes [um]. There are more nodes than `degree` along each axis.
    degree : int
        Largest sum of the exponents of x and y.

    Returns
    -------
    ndarray, shape (nx, ny)
        Polynomial at all nodes [um].
    """
    along_x, along_y = (_orthonormal_polynomials(nodes, degree) for nodes in heights.shape)
    i, j = np.nonzero(np.add.outer(np.arange(degree + 1), np.arange(degree + 1)) <= degree)
    triangle: Values = np.empty((0, i.size + 1))
    rows = max(1, BLOCK // heights.shape[1])
    for first in range(0, len(heights), rows):
        block = heights[first : first + rows]
        terms = along_x[first : first + rows, None, i] * along_y[None, :, j]
        equations = np.concatenate([terms, block[:, :, None]], axis=2)[~np.isnan(block)]
        triangle = np.asarray(np.linalg.qr(np.concatenate([triangle, equations]), mode="r"))
    coefficients = np.zeros((degree + 1, degree + 1))
    coefficients[i, j] = np.linalg.lstsq(triangle[:, :-1], triangle[:, -1], rcond=None)[0]
    fit: Heights = along_x @ coefficients @ along_y.T
    return fit


def _orthonormal_polynomials(nodes: int, degree: int) -> Values:
    """Return orthonormal polynomials on equal steps, one of each degree in a column."""
    powers = np.polynomial.legendre.legvander(np.linspace(-1, 1, nodes), degree)
    return np.asarray(np.linalg.qr(powers)[0])
