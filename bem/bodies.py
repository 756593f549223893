"""Elastic bodies: what a wave of pressure displaces on the surface of each.

A wave of pressure p(q) cos(q x) displaces a body's surface by C(|q|) p(q) cos(q x). Short waves
reach no deeper than about their length, so that every body answers them as a half-space of the
material at its surface does. The plane-strain modulus E* of that material is the unit of pressures,
hardness and tolerances; the function C(|q|) is the body.
"""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, Literal, get_args

from bem.arrays import Field
from bem.checks import Range, real_number

Kernel = Literal["uniform-pressure", "concentrated-force"]
KERNELS: tuple[Kernel, ...] = get_args(Kernel)

# Numbers that a material may have.
MODULI = Range(0, math.inf, "above 0 MPa")
POISSONS = Range(-1, math.nextafter(0.5, 1), "above -1 and at most 0.5")


class Body(ABC):
    """An elastic body below a plane surface, alike at every place along it; hashable.

    Attributes
    ----------
    kernel : str
        How the pressure of a node is spread where the patch is free, see `bem.solve`.
    """

    kernel: ClassVar[Kernel] = "uniform-pressure"

    @property
    @abstractmethod
    def e_star(self) -> float:
        """Plane-strain modulus of the material at the surface, which short waves feel [MPa]."""

    @property
    def mean_compliance(self) -> float:
        """Displacement by a uniform pressure of 1 MPa without end [um / MPa].

        It is 0 by convention for whatever lies on a half-space, which has no end below:
        displacements then count from the mean of the deformed surface.
        """
        return 0.0

    @abstractmethod
    def relative_compliance(self, wave_numbers: Field) -> Field | float:
        """Compute the compliance over that of a half-space with this modulus E*.

        Parameters
        ----------
        wave_numbers : ndarray
            Wave numbers |q|, above 0 [1/um].

        Returns
        -------
        ndarray or float
            Ratio for each wave number, above 0, which goes to 1 for short waves [1].
        """

    def compliance(self, wave_numbers: Field) -> Field:
        """Compute the displacement by waves of pressure; 2 / (E* |q|) for a half-space.

        The source is Johnson 1985, section 13.2.

        Parameters
        ----------
        wave_numbers : ndarray
            Wave numbers |q|, above 0 [1/um].

        Returns
        -------
        ndarray
            Displacement over pressure [um / MPa].
        """
        compliance: Field = self.relative_compliance(wave_numbers) / (
            self.e_star * wave_numbers / 2
        )
        return compliance

    def stiffness(self, wave_numbers: Field) -> Field:
        """Compute the pressure that displaces the surface by waves: the inverse of `compliance`.

        Parameters
        ----------
        wave_numbers : ndarray
            Wave numbers |q|, above 0 [1/um].

        Returns
        -------
        ndarray
            Pressure over displacement [MPa / um].
        """
        stiffness: Field = (
            self.e_star * wave_numbers / 2 / self.relative_compliance(wave_numbers)
        )
        return stiffness

    @abstractmethod
    def reduced(self, length: float) -> "Body":
        """Return the body in units of a length and of its modulus E*.

        Parameters
        ----------
        length : float
            Unit of length [um].

        Returns
        -------
        Body
            The body, whose `e_star` is 1. Bodies that differ in units alone are equal, so that they
            share tables and filters.
        """


@dataclass(frozen=True)
class HalfSpace(Body):
    """A homogeneous elastic half-space.

    Attributes
    ----------
    modulus : float
        Young's modulus E; or, without `poisson`, the plane-strain modulus E* [MPa].
    poisson : float
        Poisson's ratio [1].

    Raises
    ------
    ValueError
        If a number is not in its range.
    """

    modulus: float
    poisson: float = 0.0

    def __post_init__(self) -> None:
        """Check the numbers."""
        _check_material(self, self.modulus, self.poisson)

    @property
    def e_star(self) -> float:
        """Plane-strain modulus E / (1 - nu^2) [MPa]."""
        return self.modulus / (1 - self.poisson**2)

    def relative_compliance(self, wave_numbers: Field) -> float:
        """Return 1, whatever the wave numbers are."""
        return 1.0

    def reduced(self, length: float) -> Body:
        """Return `HALF_SPACE`: a half-space has no length of its own."""
        return REDUCED[self.kernel]


@dataclass(frozen=True)
class ConcentratedForces(HalfSpace):
    """A half-space under MIRCO's concentrated forces at the nodes of a free patch.

    Its attributes are those of `HalfSpace`.
    """

    kernel: ClassVar[Kernel] = "concentrated-force"


def _check_material(body: Body, modulus: float, poisson: float) -> None:
    """Check the numbers of a body's material, and set them as plain floats."""
    # The classes are frozen for their users.
    object.__setattr__(body, "modulus", real_number("modulus", modulus, MODULI))
    object.__setattr__(body, "poisson", real_number("poisson", poisson, POISSONS))


# The half-space of unit modulus, into which all are reduced.
HALF_SPACE = HalfSpace(1.0)

# The same for either kernel.
REDUCED: dict[Kernel, HalfSpace] = {
    "uniform-pressure": HALF_SPACE,
    "concentrated-force": ConcentratedForces(1.0),
}

# The half-spaces by their kernels, as arguments of `bem.solve` name them.
HALF_SPACES: dict[Kernel, type[HalfSpace]] = {
    "uniform-pressure": HalfSpace,
    "concentrated-force": ConcentratedForces,
}
