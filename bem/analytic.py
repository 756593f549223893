"""Closed forms of axisymmetric indenters on an elastic half-space: what numerics must reproduce.

Johnson, Contact Mechanics (1985), sections 3.8, 4.2 and 5.2; Sneddon (1965). Lengths in um,
moduli and pressures in MPa, forces in uN.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

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
class Paraboloid:
    """Hertz's sphere (paper, section 2.4), by its radius of curvature R [um]."""

    radius: float

    def heights(self, radii: Field) -> Field:
        """z = -r^2 / (2 R) [um]."""
        return -(radii**2) / (2 * self.radius)

    def contact_radius(self, delta: float) -> float:
        """a = sqrt(R Delta) [um]."""
        return float(np.sqrt(self.radius * delta))

    def force(self, delta: float, modulus: float = 1.0) -> float:
        """F = 4/3 E* sqrt(R Delta^3) [uN]."""
        return float(4 / 3 * modulus * np.sqrt(self.radius * delta**3))

    def pressure(self, radii: Field, delta: float, modulus: float = 1.0) -> Field:
        """p = 2 E* / pi sqrt(Delta / R) sqrt(1 - r^2 / a^2) [MPa]."""
        share = np.clip(1 - (radii / self.contact_radius(delta)) ** 2, 0, None)
        return np.asarray(2 * modulus / np.pi * np.sqrt(delta / self.radius * share))


@dataclass(frozen=True)
class Cone:
    """A cone, by the slope of its flank, the cotangent of its half-angle [1]."""

    slope: float

    def heights(self, radii: Field) -> Field:
        """z = -slope r [um]."""
        return -self.slope * radii

    def contact_radius(self, delta: float) -> float:
        """a = 2 Delta / (pi slope) [um]."""
        return 2 * delta / (np.pi * self.slope)

    def force(self, delta: float, modulus: float = 1.0) -> float:
        """F = 2 E* Delta^2 / (pi slope) [uN]."""
        return 2 * modulus * delta**2 / (np.pi * self.slope)

    def pressure(self, radii: Field, delta: float, modulus: float = 1.0) -> Field:
        """p = E* slope / 2 arcosh(a / r) [MPa], infinite at the tip."""
        with np.errstate(divide="ignore"):
            ratio = self.contact_radius(delta) / np.asarray(radii)
        return np.asarray(modulus * self.slope / 2 * np.arccosh(np.maximum(ratio, 1)))


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
        return 2 * modulus * self.radius * delta

    def pressure(self, radii: Field, delta: float, modulus: float = 1.0) -> Field:
        """p = E* Delta / (pi sqrt(a^2 - r^2)) [MPa], infinite at the rim."""
        inside = self.radius**2 - np.asarray(radii) ** 2
        with np.errstate(divide="ignore", invalid="ignore"):
            values = modulus * delta / (np.pi * np.sqrt(inside))
        return np.where(inside >= 0, values, 0.0)


def distances_to_centre(shape: tuple[int, int], side: float | tuple[float, float]) -> Field:
    """(nx, ny) distance of each node from the centre of a patch [um].

    Parameters
    ----------
    shape : (nx, ny) nodes, two at least along each axis
    side : one scan length or one per axis [um]; the nodes are side / (nodes - 1) apart
    """
    sides = side if isinstance(side, tuple) else (side, side)
    axes = [
        (np.arange(nodes) - (nodes - 1) / 2) * (length / (nodes - 1))
        for nodes, length in zip(shape, sides, strict=True)
    ]
    distances: Field = np.hypot(axes[0][:, None], axes[1][None, :])
    return distances
