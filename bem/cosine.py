"""Filters by cosine transforms: convolutions of a field that its mirror images continue."""

from typing import Any

import numpy as np
from scipy import fft

from bem.arrays import Field, Nodes, Real
from bem.sections import unforked
from bem.vectors import SHORT, each_row
from bem.workers import workers


class CosineFilter:
    """A spectrum that is applied to a field continued by its mirror images, by cosine transforms.

    The field is continued evenly about its borders, half a cell beyond the outer nodes. Cosine
    transforms of types II and III diagonalise every even convolution of such a field (Martucci
    1994, IEEE Transactions on Signal Processing 42), at the field's own size. Those of scipy take
    less time than FFTW's, which has no vector instructions for them.

    It serves wherever `bem.convolution.Filter` does.

    Parameters
    ----------
    spectrum : ndarray, shape (nx, ny)
        Factor of the wave with i and j half periods along the sides.
    dtype : str
        Precision, "float64" or "float32".

    Attributes
    ----------
    shape : tuple of int
        Shape (nx, ny) of the fields that it is applied to.
    field : ndarray, shape (nx, ny)
        Buffer of `transform`.
    bytes : int
        Memory that the filter occupies.
    largest : float
        Largest value of the spectrum, which no eigenvalue exceeds.
    """

    def __init__(self, spectrum: Field, dtype: str = "float64") -> None:
        self.shape: tuple[int, int] = spectrum.shape[0], spectrum.shape[1]
        self.largest = float(spectrum.max())
        self._factors = spectrum.astype(dtype)
        self.field = np.zeros(self.shape, dtype)
        self.bytes = 2 * self.field.nbytes

    def transform(self) -> None:
        """Filter `field` in place."""
        with unforked():
            many = workers().threads if self.field.size >= SHORT else 1
            waves: Any = fft.dctn(self.field, type=2, overwrite_x=True, workers=many)

            def multiply(some: slice) -> None:
                waves[some] *= self._factors[some]

            each_row(multiply, *self.shape)
            filtered: Any = fft.idctn(waves, type=2, overwrite_x=True, workers=many)
            if not np.may_share_memory(filtered, self.field):
                self.field[:] = filtered

    def __call__(self, field: Real) -> Real:
        """Filter a whole (nx, ny) field."""
        self.field[:] = field
        self.transform()
        return self.field.copy()

    def places(self, nodes: Nodes) -> Nodes:
        """Return the indices in the flat `field` of nodes given as flat indices of (nx, ny)."""
        return nodes
