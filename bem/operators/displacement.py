"""The influence matrix as a filter of fields: displacement by pressure, and by shear traction.

Lengths are in units of the cell's first side, and E* = 1. On a free patch the filter multiplies by
the transform of the influence coefficients (`bem.influence`). On a patch without edges it
multiplies each wave by a compliance: by that of the body under pressure (`bem.bodies.Body`), or by
that of two half-spaces of like elastic constants in shear. Between these, normal pressures and
tangential tractions do not influence each other. In a wave with the wave numbers (q_x, q_y), a
traction along x displaces along x by

    2 / (E* q) (1 - nu q_x^2 / q^2) / (1 - nu)

(Johnson 1985, Contact Mechanics, section 3.6, from Cerruti's point force): by the normal compliance
2 / (E* q) for nu = 0, and by up to 1 / (1 - nu) of it otherwise. Displacements across the traction
are not computed.
"""

import math
from typing import Any

import numpy as np
from scipy import fft

from bem.arrays import Field
from bem.bodies import HALF_SPACE, Body
from bem.influence import influence_coefficients, shear_coefficients
from bem.operators.filters import CosineFilter, FieldFilter, kept, spectral_filter
from bem.problem import Boundary
from bem.threads import threads_here


@kept
def displacement_filter(
    shape: tuple[int, int], boundary: Boundary, body: Body, aspect: float, dtype: str
) -> FieldFilter:
    """Return the influence matrix under pressure as a filter of fields.

    Parameters
    ----------
    shape : tuple of int
        Nodes (nx, ny) of the patch.
    boundary : str
        "free", "periodic" or "mirror".
    body : Body
        Reduced body, see `bem.bodies.Body.reduced`.
    aspect : float
        Second side of a cell over its first [1].
    dtype : str
        Precision, "float64" or "float32".

    Returns
    -------
    FieldFilter
        Filter from pressure [E*] to displacement [first side of a cell]. On a patch without edges
        it multiplies the mean by the body's mean compliance. It is shared by later calls on this
        thread, with its buffer.
    """
    if boundary != "free":
        spectrum = compliances(shape, boundary, body, aspect)
        return edgeless_filter(shape, boundary, spectrum, dtype)
    if dtype == "float32":
        # Large filters of both precisions share memory.
        exact: Any = displacement_filter(shape, "free", body, aspect, "float64")
        rough: FieldFilter = exact.in_single_precision()
        return rough
    return _free_filter(influence_coefficients(shape, body, aspect))


@kept
def pressure_filter(
    shape: tuple[int, int], boundary: Boundary, body: Body, aspect: float
) -> FieldFilter:
    """Return the inverse of the influence matrix of a patch without edges as a filter of fields.

    Parameters
    ----------
    shape : tuple of int
        Nodes (nx, ny) of the patch.
    boundary : str
        "periodic" or "mirror".
    body : Body
        Reduced body, see `bem.bodies.Body.reduced`.
    aspect : float
        Second side of a cell over its first [1].

    Returns
    -------
    FieldFilter
        Filter from displacement [first side of a cell] to pressure [E*], in double precision. It
        makes the mean 0 if the mean compliance is 0. It is shared by later calls on this thread,
        with its buffer.
    """
    spectrum = stiffnesses(shape, boundary, body, aspect)
    return edgeless_filter(shape, boundary, spectrum, "float64")


def shear_filter(
    shape: tuple[int, int], boundary: Boundary, aspect: float, poisson: float, axis: int
) -> FieldFilter:
    """Return the influence matrix in shear along an axis as a filter of fields.

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
        return _free_filter(shear_coefficients(shape, aspect, poisson, axis))
    square_of_cosine = _direction(shape, boundary, aspect, axis) ** 2
    spectrum = compliances(shape, boundary, HALF_SPACE, aspect)
    spectrum *= (1 - poisson * square_of_cosine) / (1 - poisson)
    return edgeless_filter(shape, boundary, spectrum, "float64")


# Free patches


def _free_filter(coefficients: Field) -> FieldFilter:
    """Return the filter in double precision by the coefficients of all offsets of a free patch.

    `coefficients` has the shape (nx, ny) of the patch, for offsets from 0.
    """
    rows, columns = coefficients.shape
    periods = fast_period(rows), fast_period(columns)
    # Offsets beyond the grid never connect two nodes, so that any value will do there.
    along = np.minimum(np.arange(periods[0] // 2 + 1), rows - 1)
    across = np.minimum(np.arange(periods[1] // 2 + 1), columns - 1)
    table = coefficients[along[:, np.newaxis], across]
    return spectral_filter((rows, columns), even_spectrum(table), "float64", periods)


def fast_period(nodes: int) -> int:
    """Return the smallest period of an even kernel that is exact for a grid and fast to transform.

    Because the kernel is even, 2 nodes - 2 is long enough: a power of two for 2^k + 1 nodes.

    Parameters
    ----------
    nodes : int
        Nodes of the grid along an axis.

    Returns
    -------
    int
        Even period with small prime factors [nodes].
    """
    return 2 * int(fft.next_fast_len(max(nodes - 1, 1), real=True))


def even_spectrum(quarter: Field) -> Field:
    """Transform a table that is even along both axes.

    Parameters
    ----------
    quarter : ndarray, shape (m, n)
        Entries of the table from 0 to half of a period along both axes; overwritten.

    Returns
    -------
    ndarray, shape (m, n)
        Spectrum from 0 to half of a period along both axes [unit of the table].
    """
    spectrum: Field = fft.dctn(quarter, type=1, overwrite_x=True, workers=threads_here())
    return spectrum


# Patches without edges


def edgeless_filter(
    shape: tuple[int, int], boundary: Boundary, spectrum: Field, dtype: str
) -> FieldFilter:
    """Return the filter of a patch without edges by an even spectrum.

    Parameters
    ----------
    shape : tuple of int
        Nodes (nx, ny) of the patch.
    boundary : str
        "periodic" or "mirror".
    spectrum : ndarray, shape (nx, ny // 2 + 1) or (nx, ny)
        Factor of each wave, in the order of `compliances` [any unit].
    dtype : str
        Precision, "float64" or "float32".

    Returns
    -------
    FieldFilter
        The filter, with new buffers.
    """
    if boundary == "mirror":
        return CosineFilter(spectrum, dtype)
    up_to_half_period = spectrum[: shape[0] // 2 + 1]
    return spectral_filter(shape, up_to_half_period, dtype, periods=shape)


def compliances(
    shape: tuple[int, int], boundary: Boundary, body: Body, aspect: float
) -> Field:
    """Compute the compliances of all waves on a patch without edges, and of the mean.

    Parameters
    ----------
    shape : tuple of int
        Nodes (nx, ny) of the patch.
    boundary : str
        "periodic" or "mirror".
    body : Body
        Reduced body, see `bem.bodies.Body.reduced`.
    aspect : float
        Second side of a cell over its first [1].

    Returns
    -------
    ndarray, shape (nx, ny // 2 + 1) or (nx, ny)
        Displacement over pressure, in the order of a real Fourier transform of a periodic patch or
        of a cosine transform of a mirrored one; the mean is the first entry
        [first side of a cell / E*].
    """
    numbers = _wave_numbers(shape, boundary, aspect)
    numbers[0, 0] = 1  # any number above 0: the entry is replaced below
    spectrum = body.compliance(numbers)
    spectrum[0, 0] = body.mean_compliance
    return spectrum


def stiffnesses(
    shape: tuple[int, int], boundary: Boundary, body: Body, aspect: float
) -> Field:
    """Compute the inverse of `compliances`, and 0 where a compliance is 0.

    Parameters
    ----------
    shape : tuple of int
        Nodes (nx, ny) of the patch.
    boundary : str
        "periodic" or "mirror".
    body : Body
        Reduced body, see `bem.bodies.Body.reduced`.
    aspect : float
        Second side of a cell over its first [1].

    Returns
    -------
    ndarray, shape (nx, ny // 2 + 1) or (nx, ny)
        Pressure over displacement, in the order of `compliances` [E* / first side of a cell].
    """
    numbers = _wave_numbers(shape, boundary, aspect)
    numbers[0, 0] = 1  # any number above 0: the entry is replaced below
    spectrum = body.stiffness(numbers)
    spectrum[0, 0] = 0
    if body.mean_compliance > 0:
        spectrum[0, 0] = 1 / body.mean_compliance
    return spectrum


def _wave_numbers(shape: tuple[int, int], boundary: Boundary, aspect: float) -> Field:
    """Compute the wave numbers |q| of all waves [1 / first side of a cell].

    Their shape and order are those of `compliances`.
    """
    length: Field = 2 * math.pi * np.hypot(*_frequencies(shape, boundary, aspect))
    return length


def _direction(
    shape: tuple[int, int], boundary: Boundary, aspect: float, axis: int
) -> Field:
    """Compute the cosine of the angle between each wave vector and an axis, 0 for the mean [1].

    Shape and order are those of `compliances`.
    """
    frequencies = _frequencies(shape, boundary, aspect)
    length = np.hypot(*frequencies)
    length[0, 0] = 1  # any number above 0: the mean has no wave vector
    cosine: Field = frequencies[axis] / length
    return cosine


def _frequencies(
    shape: tuple[int, int], boundary: Boundary, aspect: float
) -> tuple[Field, Field]:
    """Compute the waves in the first side of a cell along both axes, for a patch without edges.

    The frequencies along the first axis are a column, those along the second axis a row, in the
    order of `compliances`.
    """
    if boundary == "periodic":
        along = fft.fftfreq(shape[0])
        across = fft.rfftfreq(shape[1])
    else:
        along = np.arange(shape[0]) / (2 * shape[0])
        across = np.arange(shape[1]) / (2 * shape[1])
    return along[:, np.newaxis], across[np.newaxis] / aspect
