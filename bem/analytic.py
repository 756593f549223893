"""Closed forms of axisymmetric indenters on an elastic half-space: what numerics must reproduce.

Johnson, Contact Mechanics (1985), sections 3.8, 4.2 and 5.2; Sneddon, International Journal of
Engineering Science 3 (1965); Popov, Hess and Willert, Handbook of Contact Mechanics (2019),
chapter 2. Lengths in um, moduli and pressures in MPa, forces in uN.
"""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.special import beta, hyp2f1

Field = NDArray[np.float64]


class Indenter(Protocol):
    """A rigid body of revolution whose tip touches first."""

    def heights(self, radii: Field) -> Field:
        """Surface height at these distances from the axis, zero at the tip [um]."""

    def contact_radius(self, delta: float) -> float:
        """Radius of the contact circle at indentation delta [um]."""

    def force(self, delta: float, modulus: float = 1.0) -> float:
        """Normal force at indentation delta [uN]; modulus is E* [MPa]."""

    def pressure(self, radii: Field, delta: float, modulus: float = 1.0) -> Field:
        """Contact pressure at these distances from the axis, zero outside contact [MPa]."""


@dataclass(frozen=True)
class PowerLaw:
    """Sneddon's profiles z = -c r^m for any m from 1 on, whole or not.

    All follows from the Abel transform of the profile, g(r) = kappa c r^m with
    kappa = sqrt(pi) Gamma(m/2 + 1) / Gamma(m/2 + 1/2): g(a) is the indentation that makes a the
    radius of contact, and p(r) = E* / pi times the integral of g'(x) / sqrt(x^2 - r^2) from r to a.

    Attributes
    ----------
    coefficient : c [um^(1 - m)]
    exponent : m [1]
    """

    coefficient: float
    exponent: float

    def __post_init__(self) -> None:
        """Refuse what is no indenter, or has an infinite slope at its tip."""
        if not 0 < self.coefficient < math.inf:
            raise ValueError(f"coefficient = {self.coefficient!r}: must be above 0 um^(1 - m)")
        if not 1 <= self.exponent < math.inf:
            raise ValueError(f"exponent = {self.exponent!r}: must be at least 1")

    def heights(self, radii: Field) -> Field:
        """z = -c r^m [um]."""
        return np.asarray(-self.coefficient * radii**self.exponent)

    def indentation(self, radius: float) -> float:
        """Delta = kappa c a^m, which makes a the contact radius [um]."""
        kappa = np.pi / beta(0.5, (self.exponent + 1) / 2)
        return float(kappa * self.coefficient * radius**self.exponent)

    def contact_radius(self, delta: float) -> float:
        """a = (Delta / (kappa c))^(1/m) [um]."""
        return float((max(delta, 0.0) / self.indentation(1.0)) ** (1 / self.exponent))

    def force(self, delta: float, modulus: float = 1.0) -> float:
        """F = 2 m / (m + 1) E* a Delta [uN]."""
        share = 2 * self.exponent / (self.exponent + 1)
        return share * modulus * self.contact_radius(delta) * delta

    def pressure(self, radii: Field, delta: float, modulus: float = 1.0) -> Field:
        """p = m E* Delta / (pi a) sqrt(q) 2F1(1 - m/2, 1; 3/2; q), q = 1 - r^2 / a^2 [MPa].

        Infinite at the tip for m = 1, the cone; at most m / (m - 1) E* Delta / (pi a) there else.
        """
        radius = self.contact_radius(delta)
        if not radius:
            return np.zeros(np.shape(radii))
        inside = np.clip(1 - (radii / radius) ** 2, 0, None)
        shape = np.sqrt(inside) * hyp2f1(1 - self.exponent / 2, 1.0, 1.5, inside)
        return np.asarray(self.exponent * modulus * delta / (np.pi * radius) * shape)


class Paraboloid(PowerLaw):
    """Hertz's sphere (paper, section 2.4), by its radius of curvature R: z = -r^2 / (2 R).

    a = sqrt(R Delta), F = 4/3 E* sqrt(R Delta^3) and p = 2 E* / pi sqrt((1 - r^2 / a^2) Delta / R).

    Parameters
    ----------
    radius : R [um]
    """

    def __init__(self, radius: float) -> None:
        super().__init__(1 / (2 * radius), 2.0)


class Cone(PowerLaw):
    """A cone, by the slope of its flank, the cotangent of its half-angle: z = -slope r.

    a = 2 Delta / (pi slope), F = 2 E* Delta^2 / (pi slope) and p = E* slope / 2 arcosh(a / r).

    Parameters
    ----------
    slope : [1]
    """

    def __init__(self, slope: float) -> None:
        super().__init__(slope, 1.0)


@dataclass(frozen=True)
class FlatPunch:
    """A cylinder with a flat end, by its radius a [um]; `depth` is how far the rim stands out."""

    radius: float
    depth: float = 1e6

    def heights(self, radii: Field) -> Field:
        """Zero on the punch, -depth beyond [um]."""
        return np.where(radii <= self.radius, 0.0, -self.depth)

    def contact_radius(self, delta: float) -> float:
        """The punch's own, whatever the indentation [um]."""
        return self.radius if delta > 0 else 0.0

    def force(self, delta: float, modulus: float = 1.0) -> float:
        """F = 2 E* a Delta [uN]."""
        return 2 * modulus * self.contact_radius(delta) * delta

    def pressure(self, radii: Field, delta: float, modulus: float = 1.0) -> Field:
        """p = E* Delta / (pi sqrt(a^2 - r^2)) [MPa], infinite at the rim."""
        if delta <= 0:
            return np.zeros(np.shape(radii))
        inside = self.radius**2 - radii**2
        with np.errstate(divide="ignore", invalid="ignore"):
            values = modulus * delta / (np.pi * np.sqrt(inside))
        return np.where(inside >= 0, values, 0.0)


def distances_to_centre(
    shape: tuple[int, int],
    side: float | tuple[float, float],
    shift: tuple[float, float] = (0.0, 0.0),
) -> Field:
    """(nx, ny) distance of each node from the centre of a patch, or from an axis beside it [um].

    Parameters
    ----------
    shape : (nx, ny) nodes, two at least along each axis
    side : one scan length or one per axis [um]; the nodes are side / (nodes - 1) apart
    shift : of the axis out of the patch's centre [um]
    """
    sides = side if isinstance(side, tuple) else (side, side)
    axes = [
        (np.arange(nodes) - (nodes - 1) / 2) * (length / (nodes - 1)) - moved
        for nodes, length, moved in zip(shape, sides, shift, strict=True)
    ]
    distances: Field = np.hypot(axes[0][:, None], axes[1][None, :])
    return distances
