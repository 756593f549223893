"""The half-space under a pressure that repeats without end, wave by wave.

A wave of pressure p with the wave number q displaces the surface by 2 p / (E* |q|) (Johnson 1985,
section 13.2). The mean pressure displaces nothing: what it does to the far field depends on the
body behind, so that displacements are counted from the mean of the deformed surface. Lengths are in
units of the cell's first side and E* = 1, as in `bem.influence`.
"""

import math

import numpy as np
from scipy import fft

from bem.arrays import Field
from bem.convolution import FieldFilter, Filter, kept_filter
from bem.cosine import CosineFilter
from bem.paired_filter import PairedFilter, pairs_up
from bem.spacing import Boundary


def wave_numbers(shape: tuple[int, int], boundary: Boundary, aspect: float = 1.0) -> Field:
    """Return |q| of the waves that a patch without edges holds [1 / first side of a cell].

    Parameters
    ----------
    shape : tuple of int
        Cells (nx, ny) of the patch.
    boundary : str
        "periodic" or "mirror".
    aspect : float
        Second side of a cell over its first [1].

    Returns
    -------
    ndarray, shape (nx, ny // 2 + 1) or (nx, ny)
        In the order of a real Fourier transform if the patch repeats itself, of a cosine transform
        if its mirror images continue it.
    """
    if boundary == "periodic":
        along, across = fft.fftfreq(shape[0]), fft.rfftfreq(shape[1])
    else:
        along, across = (np.arange(cells) / (2 * cells) for cells in shape)
    length: Field = 2 * math.pi * np.hypot(along[:, np.newaxis], across / aspect)
    return length


def spectral_filter(
    shape: tuple[int, int], boundary: Boundary, aspect: float = 1.0, dtype: str = "float64"
) -> FieldFilter:
    """Return the influence matrix H of a patch without edges as a filter.

    Parameters
    ----------
    shape : tuple of int
        Cells (nx, ny) of the patch.
    boundary : str
        "periodic" or "mirror".
    aspect : float
        Second side of a cell over its first [1].
    dtype : str
        Precision, "float64" or "float32".

    Returns
    -------
    Filter, PairedFilter or CosineFilter
        Maps an (nx, ny) pressure to an (nx, ny) displacement of zero mean [first side of a cell /
        E*]. All callers on one thread share it, so that its buffer must not be kept.
    """
    return kept_filter(_make_displacement, shape, boundary, aspect, dtype)


def inverse_filter(
    shape: tuple[int, int], boundary: Boundary, aspect: float = 1.0, dtype: str = "float64"
) -> FieldFilter:
    """Return the inverse of the influence matrix on fields of zero mean as a filter.

    Parameters
    ----------
    shape, boundary, aspect, dtype
        As in `spectral_filter`.

    Returns
    -------
    Filter, PairedFilter or CosineFilter
        Maps an (nx, ny) displacement to the (nx, ny) pressure of zero mean that causes it but for
        its mean [E* / first side of a cell]. All callers on one thread share it.
    """
    return kept_filter(_make_inverse, shape, boundary, aspect, dtype)


def _make_displacement(
    shape: tuple[int, int], boundary: Boundary, aspect: float, dtype: str
) -> FieldFilter:
    """Tabulate 2 / |q|, and zero for the mean."""
    numbers = wave_numbers(shape, boundary, aspect)
    numbers[0, 0] = math.inf
    return even_filter(shape, boundary, 2 / numbers, dtype)


def _make_inverse(
    shape: tuple[int, int], boundary: Boundary, aspect: float, dtype: str
) -> FieldFilter:
    """Tabulate |q| / 2."""
    return even_filter(shape, boundary, wave_numbers(shape, boundary, aspect) / 2, dtype)


def even_filter(
    shape: tuple[int, int], boundary: Boundary, spectrum: Field, dtype: str
) -> FieldFilter:
    """Return the filter that has a spectrum, in the order of `wave_numbers`."""
    if boundary == "mirror":
        return CosineFilter(spectrum, dtype)
    if pairs_up(shape):
        return PairedFilter(spectrum, dtype)
    return Filter(shape, spectrum, dtype, across=shape[1])
