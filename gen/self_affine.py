"""The power spectrum of self-affine surfaces, which maps are fitted with and surfaces made from."""

import math
from dataclasses import dataclass

import numpy as np

from gen.arrays import Values
from gen.runtime.errors import InputError

# relative error that rounding may cause in a comparison with the cut-off
ROUNDING = 1e-12


@dataclass(frozen=True)
class SelfAffineSpectrum:
    """Shape of the power spectrum of a self-affine surface.

    From long to short waves, the spectral density is constant up to the roll-off, falls as
    q^(-2 - 2 hurst) up to the cut-off, and is zero beyond; q is the wavenumber.

    Attributes
    ----------
    hurst : float
        Hurst exponent, from 0 to 1.
    roll_off : float
        Longest wavelength of the power law [um], at least the cut-off. If it exceeds the side of a
        surface, the spectrum of the surface has no flat part.
    cut_off : float
        Shortest wavelength of the spectrum, above 0 [um].
    stretch : float
        Ratio of wavelengths along x (axis 0) to wavelengths along y (axis 1), above 0 [1]. Roll-off
        and cut-off are wavelengths along y.

    Raises
    ------
    InputError
        If an attribute is outside its range.
    """

    hurst: float
    roll_off: float
    cut_off: float
    stretch: float = 1.0

    def __post_init__(self) -> None:
        """Raise InputError if an attribute is outside its range."""
        if not 0.0 <= self.hurst <= 1.0:
            raise InputError(f"hurst {self.hurst}: give a Hurst exponent from 0 to 1")
        if not 0.0 < self.cut_off < math.inf:
            raise InputError(f"cut-off {self.cut_off}: give a wavelength above 0 um")
        if not self.cut_off <= self.roll_off < math.inf:
            raise InputError(
                f"roll-off {self.roll_off}: give a wavelength of at least the cut-off,"
                f" {self.cut_off:g} um"
            )
        if not 0.0 < self.stretch < math.inf:
            raise InputError(f"stretch {self.stretch}: give a ratio above 0")

    def density(self, qx: Values, qy: Values) -> Values:
        """Compute the spectral density at wavevectors, relative to the density of the flat part.

        Parameters
        ----------
        qx, qy : ndarray
            Components of the wavevectors, of shapes that broadcast together [1/um].

        Returns
        -------
        ndarray, common shape of qx and qy
            Relative spectral density [1].
        """
        # Squared wavenumbers relative to the roll-off's square. A square root is not taken, as it
        # would take as long as the power.
        inverse = self.roll_off / (2 * math.pi)  # of the roll-off's wavenumber [um]
        squares = (self.stretch * inverse * qx) ** 2 + (inverse * qy) ** 2
        square_at_cut_off = (self.roll_off / self.cut_off * (1 + ROUNDING)) ** 2
        law = np.maximum(squares, 1.0) ** (-1 - self.hurst)
        return np.where(squares <= square_at_cut_off, law, 0.0)
