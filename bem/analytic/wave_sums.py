"""Closed forms of sums of plane waves, pressed on an elastic half-space.

Johnson, Greenwood and Higginson, International Journal of Mechanical Sciences 27 (1985); Johnson,
Contact Mechanics (1985), section 13.2. The conventions are those of `bem.analytic.waves`.
"""

import math
from dataclasses import dataclass

import numpy as np

from bem.analytic.waves import refuse_flat
from bem.arrays import Field

# Potential of all other unit charges of a square lattice of unit spacing, with its neutral
# background, at the place of one: 4 zeta(1/2) beta(1/2), Dirichlet's beta.
SQUARE_LATTICE = -3.9002649200019559


@dataclass(frozen=True)
class Sine:
    """A plane wave z = amplitude cos(qx x + qy y + phase).

    Attributes
    ----------
    amplitude : float
        Half of the height from valley to peak [um].
    wavevector : tuple of float
        Wavevector (qx, qy), of modulus 2 pi / wavelength; not zero [1/um].
    phase : float
        Phase at the origin [rad].
    """

    amplitude: float
    wavevector: tuple[float, float]
    phase: float = 0.0

    def heights(self, x: Field, y: Field) -> Field:
        """Return the height at these places [um].

        Parameters
        ----------
        x, y : ndarray
            Places, of shapes that broadcast together [um].

        Returns
        -------
        ndarray, common shape of x and y
            Height [um].
        """
        qx, qy = self.wavevector
        return np.asanyarray(self.amplitude * np.cos(qx * x + qy * y + self.phase))

    def stiffness(self, modulus: float = 1.0) -> float:
        """Return E* q / 2, the pressure that holds one unit of displacement [MPa/um].

        Parameters
        ----------
        modulus : float
            E* [MPa].

        Returns
        -------
        float
            Pressure over displacement [MPa/um].
        """
        return modulus * math.hypot(*self.wavevector) / 2


@dataclass(frozen=True)
class SumOfSines:
    """Plane waves of any directions, wavelengths and phases on top of one another.

    Attributes
    ----------
    sines : tuple of Sine
        The waves, whose heights and, in full contact, pressures add up.
    """

    sines: tuple[Sine, ...]

    def heights(self, x: Field, y: Field) -> Field:
        """Return the height at these places, zero in the mean over all places [um].

        Parameters
        ----------
        x, y : ndarray
            Places, of shapes that broadcast together [um].

        Returns
        -------
        ndarray, common shape of x and y
            Height [um].
        """
        return np.asanyarray(sum(sine.heights(x, y) for sine in self.sines))

    def pressure(self, x: Field, y: Field, mean_pressure: float, modulus: float = 1.0) -> Field:
        """Compute the pressure of full contact, the mean + the sum of E* q / 2 times each height.

        Parameters
        ----------
        x, y : ndarray
            Places, of shapes that broadcast together [um].
        mean_pressure : float
            Mean pressure on the whole surface [MPa].
        modulus : float
            E* [MPa].

        Returns
        -------
        ndarray, common shape of x and y
            Pressure; where it is negative anywhere contact is not full [MPa].
        """
        waves = [sine.stiffness(modulus) * sine.heights(x, y) for sine in self.sines]
        return np.asanyarray(mean_pressure + sum(waves))

    def full_contact_pressure(self, x: Field, y: Field, modulus: float = 1.0) -> float:
        """Return the least mean pressure at which all of these places are in contact [MPa].

        On the nodes of a grid that resolves the waves it is exact for the grid's contact problem,
        and a lower bound of that of the whole surface.

        Parameters
        ----------
        x, y : ndarray
            Places that are to be in contact, of shapes that broadcast together [um].
        modulus : float
            E* [MPa].

        Returns
        -------
        float
            Mean pressure on the whole surface [MPa].
        """
        return -float(self.pressure(x, y, 0.0, modulus).min())


@dataclass(frozen=True)
class DoublySinusoidal:
    """The surface z = amplitude cos(2 pi x / wavelength) cos(2 pi y / wavelength).

    Its peaks are on a square lattice of spacing wavelength / sqrt(2), with the valleys at the
    centres of the squares. There is no closed form between the two ends of the range of loads.

    Attributes
    ----------
    amplitude : float
        Half of the height from valley to peak [um].
    wavelength : float
        Period along x and along y [um].

    Raises
    ------
    ValueError
        If one of them is not above 0 and finite.
    """

    amplitude: float
    wavelength: float

    def __post_init__(self) -> None:
        """Refuse surfaces that are flat or have no wavelength."""
        refuse_flat(self.amplitude, self.wavelength)

    def heights(self, x: Field, y: Field) -> Field:
        """Return the height at these distances from a peak along both axes [um].

        Parameters
        ----------
        x, y : ndarray
            Distances from a peak along both axes, of shapes that broadcast together [um].

        Returns
        -------
        ndarray, common shape of x and y
            Height [um].
        """
        q = 2 * np.pi / self.wavelength
        return np.asanyarray(self.amplitude * np.cos(q * x) * np.cos(q * y))

    def full_contact_pressure(self, modulus: float = 1.0) -> float:
        """Return p* = sqrt(2) pi E* amplitude / wavelength [MPa].

        Parameters
        ----------
        modulus : float
            E* [MPa].

        Returns
        -------
        float
            Mean pressure p* that closes all gaps [MPa].
        """
        return math.sqrt(2) * np.pi * modulus * self.amplitude / self.wavelength

    def area_share_at_light_load(self, mean_pressure: float, modulus: float = 1.0) -> float:
        """Return pi (3 / (8 pi) p / p*)^(2/3), by Hertz at each peak on its own [1].

        The leading term for p / p* -> 0.

        Parameters
        ----------
        mean_pressure : float
            Mean pressure p on the whole surface [MPa].
        modulus : float
            E* [MPa].

        Returns
        -------
        float
            Contact area as a share of the whole [1].
        """
        load = mean_pressure / self.full_contact_pressure(modulus)
        return float(np.pi * (3 / (8 * np.pi) * load) ** (2 / 3))

    def approach_at_light_load(self, mean_pressure: float, modulus: float = 1.0) -> float:
        """Return the two leading terms of the approach for p / p* -> 0 [um].

        Hertz's a^2 / R at each peak of radius R, and what the forces on all other peaks displace
        it, as point forces on a square lattice with zero mean displacement.

        Parameters
        ----------
        mean_pressure : float
            Mean pressure p on the whole surface [MPa].
        modulus : float
            E* [MPa].

        Returns
        -------
        float
            Approach Delta [um].
        """
        spacing = self.wavelength / math.sqrt(2)
        curvature = self.amplitude * (2 * np.pi / self.wavelength) ** 2
        share = self.area_share_at_light_load(mean_pressure, modulus)
        hertz = share * spacing**2 / np.pi * curvature
        return hertz + SQUARE_LATTICE * mean_pressure * spacing / (np.pi * modulus)

    def area_share_near_full_contact(self, mean_pressure: float, modulus: float = 1.0) -> float:
        """Return 1 - 3 / (2 pi) (1 - p / p*), with a circular gap in each valley [1].

        The leading term for p / p* -> 1: the gaps are penny-shaped cracks without a singularity.

        Parameters
        ----------
        mean_pressure : float
            Mean pressure p on the whole surface [MPa].
        modulus : float
            E* [MPa].

        Returns
        -------
        float
            Contact area as a share of the whole [1].
        """
        load = mean_pressure / self.full_contact_pressure(modulus)
        return 1 - 3 / (2 * np.pi) * (1 - load)

    def mean_gap_near_full_contact(self, mean_pressure: float, modulus: float = 1.0) -> float:
        """Return the leading term of the mean gap for p / p* -> 1 [um].

        The gap in a valley is 16 k / (9 pi E*) (b^2 - r^2)^(3/2) where the pressure of full contact
        is k r^2 above its least value and b is the radius of the gap.

        Parameters
        ----------
        mean_pressure : float
            Mean pressure p on the whole surface [MPa].
        modulus : float
            E* [MPa].

        Returns
        -------
        float
            Mean gap [um].
        """
        full = self.full_contact_pressure(modulus)
        rise = 2 * (np.pi / self.wavelength) ** 2 * full
        radius = math.sqrt(1.5 * max(full - mean_pressure, 0.0) / rise)
        volume = 32 * rise * radius**5 / (45 * modulus)
        return 2 * volume / self.wavelength**2
