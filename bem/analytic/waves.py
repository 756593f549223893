"""Closed forms of surfaces that repeat without end, pressed on an elastic half-space.

Westergaard, Journal of Applied Mechanics 6 (1939); Johnson, Greenwood and Higginson, International
Journal of Mechanical Sciences 27 (1985); Johnson, Contact Mechanics (1985), section 13.2.

The conventions of `bem` on patches without edges apply. The heights z of a rigid surface are
pressed down into the half-space. The amplitude is half of the height from valley to peak. The mean
displacement of the half-space is zero. The approach Delta counts from the first touch of the
highest point: the mean gap is max(z) - mean(z) - Delta, and contact is full at
Delta = max(z) - mean(z).
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import lambertw

from bem.arrays import Field

# Potential at one of the unit charges of a square lattice of unit spacing, by all other charges and
# a neutralising uniform background [1]. It is 4 zeta(1/2) beta(1/2) with Dirichlet's beta.
SQUARE_LATTICE = -3.9002649200019559


@dataclass(frozen=True)
class WavySurface:
    """Westergaard's surface z = amplitude cos(2 pi x / wavelength), which is uniform along y.

    Attributes
    ----------
    amplitude : float
        Half of the height from valley to peak [um].
    wavelength : float
        Distance from peak to peak [um].

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

    def heights(self, x: Field) -> Field:
        """Return the height at distances from a peak [um].

        Parameters
        ----------
        x : ndarray
            Distance from a peak [um].

        Returns
        -------
        ndarray, shape of x
            Height [um].
        """
        return np.asanyarray(self.amplitude * np.cos(2 * np.pi * x / self.wavelength))

    def full_contact_pressure(self, modulus: float = 1.0) -> float:
        """Return p* = pi E* amplitude / wavelength, the mean pressure that closes all gaps [MPa].

        Parameters
        ----------
        modulus : float
            E* [MPa].

        Returns
        -------
        float
            Mean pressure p* [MPa].
        """
        return np.pi * modulus * self.amplitude / self.wavelength

    def area_share(self, mean_pressure: float, modulus: float = 1.0) -> float:
        """Return the contact area as a share of the whole, 2 / pi arcsin sqrt(p / p*) [1].

        It equals the width of each strip of contact over the wavelength.

        Parameters
        ----------
        mean_pressure : float
            Mean pressure p on the whole surface [MPa].
        modulus : float
            E* [MPa].

        Returns
        -------
        float
            Contact area as a share of the whole, from 0 to 1 [1].
        """
        load = self._load(mean_pressure, modulus)
        return 2 / np.pi * math.asin(math.sqrt(load))

    def pressure(self, x: Field, mean_pressure: float, modulus: float = 1.0) -> Field:
        """Compute the contact pressure.

        With psi = pi x / wavelength, it is 2 p* |cos(psi)| sqrt(p / p* - sin^2(psi)) up to full
        contact, and p + p* cos(2 psi) for larger loads.

        Parameters
        ----------
        x : ndarray
            Distance from a peak [um].
        mean_pressure : float
            Mean pressure p on the whole surface [MPa].
        modulus : float
            E* [MPa].

        Returns
        -------
        ndarray, shape of x
            Pressure, zero outside contact [MPa].
        """
        full = self.full_contact_pressure(modulus)
        angle = np.pi * x / self.wavelength
        if mean_pressure >= full:
            return np.asanyarray(mean_pressure + full * np.cos(2 * angle))
        load = max(mean_pressure, 0.0) / full
        inside = np.clip(load - np.sin(angle) ** 2, 0, None)
        cosine = np.abs(np.cos(angle))
        return np.asanyarray(2 * full * cosine * np.sqrt(inside))

    def gap(self, x: Field, mean_pressure: float, modulus: float = 1.0) -> Field:
        """Compute the gap between the surface and the half-space.

        It is amplitude s (sinh(2 t) - 2 t) with s = p / p* and
        sqrt(s) cosh(t) = |sin(pi x / wavelength)|.

        Parameters
        ----------
        x : ndarray
            Distance from a peak [um].
        mean_pressure : float
            Mean pressure p on the whole surface [MPa].
        modulus : float
            E* [MPa].

        Returns
        -------
        ndarray, shape of x
            Gap, zero inside contact [um].
        """
        load = self._load(mean_pressure, modulus)
        angle = np.pi * x / self.wavelength
        sine = np.abs(np.sin(angle))
        if not load:
            return np.asanyarray(2 * self.amplitude * sine**2)
        cosh = np.maximum(sine / math.sqrt(load), 1.0)  # 1 inside contact
        t = np.arccosh(cosh)
        return np.asanyarray(self.amplitude * load * (np.sinh(2 * t) - 2 * t))

    def approach(self, mean_pressure: float, modulus: float = 1.0) -> float:
        """Return the approach Delta = amplitude s (1 - ln s) with s = p / p* [um].

        It is the integral of dDelta/dp = wavelength / (pi E*) ln(p* / p), the compliance of
        periodic flat punches on the strips of contact. At full contact it is the amplitude.

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
        load = self._load(mean_pressure, modulus)
        if not load:
            return 0.0
        return self.amplitude * load * (1 - math.log(load))

    def mean_gap(self, mean_pressure: float, modulus: float = 1.0) -> float:
        """Return the mean gap, amplitude - Delta [um].

        Parameters
        ----------
        mean_pressure : float
            Mean pressure p on the whole surface [MPa].
        modulus : float
            E* [MPa].

        Returns
        -------
        float
            Mean gap, zero in full contact [um].
        """
        return self.amplitude - self.approach(mean_pressure, modulus)

    def mean_pressure(self, approach: float, modulus: float = 1.0) -> float:
        """Return the mean pressure at an approach, the inverse of `approach` [MPa].

        p = p* exp(1 + W(-Delta / (e amplitude))) with the lower branch of Lambert's W. At full
        contact there is no inverse: all mean pressures of at least p* have one approach.

        Parameters
        ----------
        approach : float
            Approach Delta, below the amplitude [um].
        modulus : float
            E* [MPa].

        Returns
        -------
        float
            Mean pressure p on the whole surface, zero without contact [MPa].

        Raises
        ------
        ValueError
            If the approach is not below that of full contact.
        """
        if not approach < self.amplitude:
            raise ValueError(
                f"approach = {approach!r}: must be below {self.amplitude:g} um"
            )
        if approach <= 0:
            return 0.0
        argument = -approach / (np.e * self.amplitude)
        branch = lambertw(argument, -1)
        return self.full_contact_pressure(modulus) * math.exp(1 + branch.real)

    def stiffness(self, mean_pressure: float, modulus: float = 1.0) -> float:
        """Return the stiffness dp/dDelta = pi E* / (wavelength ln(p* / p)) [MPa/um].

        Parameters
        ----------
        mean_pressure : float
            Mean pressure p on the whole surface [MPa].
        modulus : float
            E* [MPa].

        Returns
        -------
        float
            Stiffness per area, zero without load and infinite at full contact [MPa/um].
        """
        load = self._load(mean_pressure, modulus)
        if not load:
            return 0.0
        if load == 1:
            return math.inf
        return -np.pi * modulus / (self.wavelength * math.log(load))

    def _load(self, mean_pressure: float, modulus: float) -> float:
        """Return the mean pressure over that of full contact, bounded to 0 and 1 [1]."""
        load = mean_pressure / self.full_contact_pressure(modulus)
        return min(max(load, 0.0), 1.0)


def refuse_flat(amplitude: float, wavelength: float) -> None:
    """Refuse an amplitude or a wavelength that is not above 0 and finite.

    Parameters
    ----------
    amplitude : float
        Half of the height from valley to peak [um].
    wavelength : float
        Distance from peak to peak [um].

    Raises
    ------
    ValueError
        If one of them is not above 0 and finite.
    """
    for name, value in (("amplitude", amplitude), ("wavelength", wavelength)):
        if not 0 < value < math.inf:
            raise ValueError(f"{name} = {value!r}: must be above 0 um")


@dataclass(frozen=True)
class DoublySinusoidal:
    """The surface z = amplitude cos(2 pi x / wavelength) cos(2 pi y / wavelength).

    Its peaks form a square lattice of spacing wavelength / sqrt(2), with the valleys at the centres
    of the squares. Closed forms exist only for the limits of light load and nearly full contact.

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
        """Return the height at distances from a peak along both axes [um].

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
        """Return p* = sqrt(2) pi E* amplitude / wavelength, which closes all gaps [MPa].

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

    def area_share_at_light_load(
        self, mean_pressure: float, modulus: float = 1.0
    ) -> float:
        """Return the contact area as a share of the whole, pi (3 / (8 pi) p / p*)^(2/3) [1].

        It is the leading term for p / p* -> 0: Hertz's contact at each peak, without interaction.

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

        The first is Hertz's a^2 / R at a peak of radius of curvature R. The second is the
        displacement of this peak by point forces on all other peaks of the lattice, with zero mean
        displacement.

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

    def area_share_near_full_contact(
        self, mean_pressure: float, modulus: float = 1.0
    ) -> float:
        """Return the contact area as a share of the whole, 1 - 3 / (2 pi) (1 - p / p*) [1].

        It is the leading term for p / p* -> 1: the gap in each valley is a circular crack without a
        singularity at its rim.

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

    def mean_gap_near_full_contact(
        self, mean_pressure: float, modulus: float = 1.0
    ) -> float:
        """Return the leading term of the mean gap for p / p* -> 1 [um].

        The gap at the distance r from a valley is 16 k / (9 pi E*) (b^2 - r^2)^(3/2). Here b is the
        radius of the gap, and the pressure of full contact is k r^2 above its least value.

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
