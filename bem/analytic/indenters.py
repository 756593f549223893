"""Closed forms of axisymmetric indenters on an elastic half-space.

Johnson, Contact Mechanics (1985), sections 3.8, 4.2 and 5.2; Sneddon, International Journal of
Engineering Science 3 (1965); Popov, Hess and Willert, Handbook of Contact Mechanics (2019),
chapter 2.
"""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.special import beta, hyp2f1

from bem.arrays import Field


class Indenter(Protocol):
    """A rigid body of revolution whose tip touches first."""

    def heights(self, radii: Field) -> Field:
        """Return the height at distances from the axis, zero at the tip.

        Parameters
        ----------
        radii : ndarray
            Distance from the axis [um].

        Returns
        -------
        ndarray, shape of radii
            Height [um].
        """

    def contact_radius(self, delta: float) -> float:
        """Return the radius of the contact circle, zero without indentation.

        Parameters
        ----------
        delta : float
            Indentation [um].

        Returns
        -------
        float
            Radius [um].
        """

    def force(self, delta: float, modulus: float = 1.0) -> float:
        """Return the normal force at an indentation.

        Parameters
        ----------
        delta : float
            Indentation [um].
        modulus : float
            E* [MPa].

        Returns
        -------
        float
            Force [uN].
        """

    def pressure(self, radii: Field, delta: float, modulus: float = 1.0) -> Field:
        """Return the contact pressure at distances from the axis, zero outside contact.

        Parameters
        ----------
        radii : ndarray
            Distance from the axis [um].
        delta : float
            Indentation [um].
        modulus : float
            E* [MPa].

        Returns
        -------
        ndarray, shape of radii
            Pressure [MPa].
        """


@dataclass(frozen=True)
class PowerLaw:
    """Sneddon's profile z = -c r^m with any real exponent m >= 1.

    The closed forms follow from the Abel transform of the profile, g(r) = kappa c r^m with
    kappa = sqrt(pi) Gamma(m/2 + 1) / Gamma(m/2 + 1/2). g(a) is the indentation at which the contact
    has the radius a, and the pressure p(r) is E* / pi times the integral of
    g'(x) / sqrt(x^2 - r^2) from r to a.

    Attributes
    ----------
    coefficient : float
        Coefficient c [um^(1 - m)].
    exponent : float
        Exponent m [1].

    Raises
    ------
    ValueError
        If the coefficient is not above 0 and finite, or the exponent not at least 1 and finite.
    """

    coefficient: float
    exponent: float

    def __post_init__(self) -> None:
        """Refuse profiles without a tip, and tips with an infinite slope."""
        if not 0 < self.coefficient < math.inf:
            raise ValueError(
                f"coefficient = {self.coefficient!r}: must be above 0 um^(1 - m)"
            )
        if not 1 <= self.exponent < math.inf:
            raise ValueError(f"exponent = {self.exponent!r}: must be at least 1")

    def heights(self, radii: Field) -> Field:
        """Return the height z = -c r^m [um].

        Parameters
        ----------
        radii : ndarray
            Distance from the axis [um].

        Returns
        -------
        ndarray, shape of radii
            Height [um].
        """
        return np.asanyarray(-self.coefficient * radii**self.exponent)

    def indentation(self, radius: float) -> float:
        """Return the indentation Delta = kappa c a^m at which a is the contact radius [um].

        Parameters
        ----------
        radius : float
            Radius of the contact circle [um].

        Returns
        -------
        float
            Indentation [um].
        """
        kappa = np.pi / beta(0.5, (self.exponent + 1) / 2)
        return float(kappa * self.coefficient * radius**self.exponent)

    def contact_radius(self, delta: float) -> float:
        """Return the contact radius a = (Delta / (kappa c))^(1/m), zero without indentation [um].

        Parameters
        ----------
        delta : float
            Indentation [um].

        Returns
        -------
        float
            Radius [um].
        """
        return float((max(delta, 0.0) / self.indentation(1.0)) ** (1 / self.exponent))

    def force(self, delta: float, modulus: float = 1.0) -> float:
        """Return the normal force F = 2 m / (m + 1) E* a Delta [uN].

        Parameters
        ----------
        delta : float
            Indentation [um].
        modulus : float
            E* [MPa].

        Returns
        -------
        float
            Force [uN].
        """
        share = 2 * self.exponent / (self.exponent + 1)
        return share * modulus * self.contact_radius(delta) * delta

    def pressure(self, radii: Field, delta: float, modulus: float = 1.0) -> Field:
        """Return the contact pressure, zero outside contact [MPa].

        p = m E* Delta / (pi a) sqrt(q) 2F1(1 - m/2, 1; 3/2; q) with q = 1 - r^2 / a^2. At the tip
        it is infinite for the cone, m = 1, and m / (m - 1) E* Delta / (pi a) otherwise.

        Parameters
        ----------
        radii : ndarray
            Distance from the axis [um].
        delta : float
            Indentation [um].
        modulus : float
            E* [MPa].

        Returns
        -------
        ndarray, shape of radii
            Pressure [MPa].
        """
        radius = self.contact_radius(delta)
        if not radius:
            return np.zeros_like(radii, dtype=np.float64)
        q = np.clip(1 - (radii / radius) ** 2, 0, None)
        shape = np.sqrt(q) * hyp2f1(1 - self.exponent / 2, 1.0, 1.5, q)
        scale = self.exponent * modulus * delta / (np.pi * radius)
        return np.asanyarray(scale * shape)


class Paraboloid(PowerLaw):
    """The paraboloid z = -r^2 / (2 R), which replaces a sphere in Hertz's theory (paper, 2.4).

    The contact radius is a = sqrt(R Delta), the force F = 4/3 E* sqrt(R Delta^3), and the pressure
    p = 2 E* / pi sqrt((1 - r^2 / a^2) Delta / R).

    Parameters
    ----------
    radius : float
        Radius of curvature R [um].
    """

    def __init__(self, radius: float) -> None:
        super().__init__(1 / (2 * radius), 2.0)


class Cone(PowerLaw):
    """The cone z = -slope r.

    The contact radius is a = 2 Delta / (pi slope), the force F = 2 E* Delta^2 / (pi slope), and the
    pressure p = E* slope / 2 arcosh(a / r).

    Parameters
    ----------
    slope : float
        Slope of the flank, the cotangent of the half-angle [1].
    """

    def __init__(self, slope: float) -> None:
        super().__init__(slope, 1.0)


@dataclass(frozen=True)
class FlatPunch:
    """A cylinder with a flat end.

    Attributes
    ----------
    radius : float
        Radius a of the cylinder [um].
    depth : float
        Distance of the surface around the cylinder below the cylinder's flat end [um].
    """

    radius: float
    depth: float = 1e6

    def heights(self, radii: Field) -> Field:
        """Return the height, zero on the punch and -depth beyond [um].

        Parameters
        ----------
        radii : ndarray
            Distance from the axis [um].

        Returns
        -------
        ndarray, shape of radii
            Height [um].
        """
        return np.asanyarray(0.0 - self.depth * (radii > self.radius))

    def contact_radius(self, delta: float) -> float:
        """Return the radius of the punch, or zero without indentation [um].

        Parameters
        ----------
        delta : float
            Indentation [um].

        Returns
        -------
        float
            Radius [um].
        """
        return self.radius if delta > 0 else 0.0

    def force(self, delta: float, modulus: float = 1.0) -> float:
        """Return the normal force F = 2 E* a Delta [uN].

        Parameters
        ----------
        delta : float
            Indentation [um].
        modulus : float
            E* [MPa].

        Returns
        -------
        float
            Force [uN].
        """
        return 2 * modulus * self.contact_radius(delta) * delta

    def pressure(self, radii: Field, delta: float, modulus: float = 1.0) -> Field:
        """Return the pressure p = E* Delta / (pi sqrt(a^2 - r^2)) [MPa].

        It is infinite at the rim, and zero outside and without indentation.

        Parameters
        ----------
        radii : ndarray
            Distance from the axis [um].
        delta : float
            Indentation [um].
        modulus : float
            E* [MPa].

        Returns
        -------
        ndarray, shape of radii
            Pressure [MPa].
        """
        if delta <= 0:
            return np.zeros_like(radii, dtype=np.float64)
        squared_half_chord = self.radius**2 - radii**2  # negative outside the punch
        with np.errstate(divide="ignore", invalid="ignore"):
            root = np.sqrt(np.abs(squared_half_chord))
            values = modulus * delta / (np.pi * root)
        return np.asanyarray(values * (squared_half_chord >= 0))


def distances_to_centre(
    shape: tuple[int, int],
    side: float | tuple[float, float],
    shift: tuple[float, float] = (0.0, 0.0),
) -> Field:
    """Compute the distance of a patch's nodes from an axis at or near its centre.

    Parameters
    ----------
    shape : tuple of int
        Nodes (nx, ny), at least two along both axes.
    side : float or tuple of float
        Scan length, one for both axes or one for each; the spacing is side / (nodes - 1) [um].
    shift : tuple of float
        Position of the axis relative to the patch's centre, along both axes of the grid [um].

    Returns
    -------
    ndarray, shape (nx, ny)
        Distance from the axis [um].

    Raises
    ------
    ValueError
        If the sides are neither one length nor two.
    """
    sides = side if isinstance(side, tuple) else (side, side)
    if len(sides) != 2:
        raise ValueError(f"side = {side!r}: one length or two are needed, in um")
    axes = []
    for nodes, length, offset in zip(shape, sides, shift, strict=True):
        from_centre = np.arange(nodes) - (nodes - 1) / 2
        spacing = length / (nodes - 1)
        axes.append(from_centre * spacing - offset)
    along, across = axes
    distances: Field = np.hypot(along[:, None], across[None, :])
    return distances
