"""Elastic bodies: what a wave of pressure displaces on the surface of each.

A wave of pressure p(q) cos(q x) displaces a body's surface by C(|q|) p(q) cos(q x). Short waves
reach no deeper than about their length, so that every body answers them as a half-space of the
material at its surface does. The plane-strain modulus E* of that material is the unit of pressures,
hardness and tolerances; the function C(|q|) is the body.
"""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, get_args

import numpy as np

from bem.arrays import Field
from bem.checks import Range, real_number, shown

Kernel = Literal["uniform-pressure", "concentrated-force"]
KERNELS: tuple[Kernel, ...] = get_args(Kernel)

# Numbers that a material and a layer may have.
MODULI = Range(0, math.inf, "above 0 MPa")
THICKNESSES = Range(0, math.inf, "above 0 um")
POISSONS = Range(-1, math.nextafter(0.5, 1), "above -1 and at most 0.5")

# Largest difference of a body's relative compliance from 1, for the shortest waves of the grid,
# with which the material at the surface alone decides the pressure at the border of contact [1].
OF_SURFACE = 0.1

# Last power of the series in `_scaled_rest`: the next one would be below rounding.
LAST_POWER = 19


class Body(ABC):
    """An elastic body below a plane surface, the same at every place along it; hashable.

    Attributes
    ----------
    kernel : str
        How the pressure of a node is spread where the patch is free, see `bem.solve`.
    """

    kernel: ClassVar[Kernel] = "uniform-pressure"

    @property
    def is_homogeneous(self) -> bool:
        """Whether it is a half-space of one material, so that no length belongs to it."""
        return False

    @property
    @abstractmethod
    def e_star(self) -> float:
        """Plane-strain modulus of the material at the surface, which short waves feel [MPa]."""

    @property
    def mean_compliance(self) -> float:
        """Displacement by a pressure of 1 MPa on all of the endless surface [um / MPa].

        It is 0 by convention for half-spaces and layers on half-spaces, where it would be infinite:
        displacements are measured from the mean of the deformed surface there.
        """
        return 0.0

    @abstractmethod
    def relative_compliance(self, wave_numbers: Field) -> Field | float:
        """Compute the compliance over that of a half-space with this modulus E*.

        Parameters
        ----------
        wave_numbers : ndarray
            Wave numbers q, above 0 [1/um].

        Returns
        -------
        ndarray or float
            Ratio for each wave number. It is above 0, and goes to 1 for short waves [1].
        """

    def compliance(self, wave_numbers: Field) -> Field:
        """Compute the displacement by waves of pressure; 2 / (E* q) for a half-space.

        The source is Johnson 1985, section 13.2.

        Parameters
        ----------
        wave_numbers : ndarray
            Wave numbers q, above 0 [1/um].

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
            Wave numbers q, above 0 [1/um].

        Returns
        -------
        ndarray
            Pressure over displacement [MPa / um].
        """
        stiffness: Field = (
            self.e_star * wave_numbers / 2 / self.relative_compliance(wave_numbers)
        )
        return stiffness

    def is_deeper_than_cells(self, spacing: tuple[float, float]) -> bool:
        """Tell whether the surface's material decides the compliance of a grid's shortest waves.

        The limit is `OF_SURFACE`.

        Parameters
        ----------
        spacing : tuple of float
            Distance of the nodes along both axes [um].

        Returns
        -------
        bool
            True if it does, as on every half-space.
        """
        shortest = np.array([math.pi / max(spacing)])
        relative = np.ravel(self.relative_compliance(shortest))
        return abs(float(relative[0]) - 1) < OF_SURFACE

    def reduced(self, length: float) -> "Body":
        """Return the body in units of a length and of its modulus E*.

        Parameters
        ----------
        length : float
            Unit of length [um].

        Returns
        -------
        Body
            The body, whose `e_star` is 1. All half-spaces with the same kernel are reduced to the
            same body, so that they share tables and filters.
        """
        if self.is_homogeneous:
            return REDUCED[self.kernel]
        return _Reduced(self, length)


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
        return _plane_strain_modulus(self.modulus, self.poisson)

    @property
    def is_homogeneous(self) -> bool:
        """True."""
        return True

    def relative_compliance(self, wave_numbers: Field) -> float:
        """Return 1, the compliance over that of a half-space.

        Parameters
        ----------
        wave_numbers : ndarray
            Wave numbers q, which do not matter [1/um].

        Returns
        -------
        float
            1.0 [1].
        """
        return 1.0


@dataclass(frozen=True)
class ConcentratedForces(HalfSpace):
    """A half-space under MIRCO's concentrated forces at the nodes of a free patch.

    Its attributes are those of `HalfSpace`.
    """

    kernel: ClassVar[Kernel] = "concentrated-force"


@dataclass(frozen=True)
class Layered(Body):
    """A layer of uniform thickness, bonded to its base, without friction at its surface.

    Attributes
    ----------
    thickness : float
        Thickness of the layer [um].
    modulus : float
        Young's modulus of the layer [MPa].
    poisson : float
        Poisson's ratio of the layer [1].
    base : HalfSpace or "rigid"
        Body below the layer.

    Raises
    ------
    ValueError
        If a number is not in its range, or the base is neither of the two.
    """

    thickness: float
    modulus: float
    poisson: float
    base: HalfSpace | Literal["rigid"]

    def __post_init__(self) -> None:
        """Check the numbers and the base."""
        thickness = real_number("thickness", self.thickness, THICKNESSES)
        # The class is frozen for its users.
        object.__setattr__(self, "thickness", thickness)
        _check_material(self, self.modulus, self.poisson)
        if type(self.base) is not HalfSpace and self.base != "rigid":
            raise ValueError(
                f"base = {shown(self.base)}: must be a bem.HalfSpace or 'rigid'"
            )

    @property
    def e_star(self) -> float:
        """Plane-strain modulus E / (1 - nu^2) of the layer [MPa]."""
        return _plane_strain_modulus(self.modulus, self.poisson)

    @property
    def mean_compliance(self) -> float:
        """Displacement by a pressure of 1 MPa on all of the surface [um / MPa].

        On a rigid base it is the thickness over the layer's modulus under uniaxial strain, which is
        infinite for an incompressible layer. On a half-space it is 0 by convention.
        """
        if self.base != "rigid":
            return 0.0
        nu = self.poisson
        return self.thickness * (1 + nu) * (1 - 2 * nu) / ((1 - nu) * self.modulus)

    def scaled(self, lengths: float = 1.0, moduli: float = 1.0) -> "Layered":
        """Return the body at another scale, on which the contacts are copies of those of this one.

        Parameters
        ----------
        lengths : float
            Factor of all lengths along the surface, which the thickness has, too.
        moduli : float
            Factor of the moduli of the layer and of the base.

        Returns
        -------
        Layered
            The body with the same Poisson's ratios.

        Raises
        ------
        ValueError
            If a scaled number is not in its range.
        """
        base = self.base
        if isinstance(base, HalfSpace):
            base = HalfSpace(moduli * base.modulus, base.poisson)
        return Layered(
            lengths * self.thickness, moduli * self.modulus, self.poisson, base
        )

    @property
    def _shear_ratio(self) -> float:
        """Shear modulus of the layer over that of the base, 0 on a rigid base [1]."""
        if not isinstance(self.base, HalfSpace):
            return 0.0
        layer = self.modulus / (1 + self.poisson)
        return layer / (self.base.modulus / (1 + self.base.poisson))

    def relative_compliance(self, wave_numbers: Field) -> Field:
        """Compute the compliance over that of a half-space of the layer's material.

        The formula is that of O'Sullivan and King (1988, Journal of Tribology 110, 235) for a
        normal load without friction. Its numerator and denominator are written as sums in which
        nothing cancels, so that no digits are lost for thin layers, for incompressible ones and for
        a rigid base, whose shear ratio is 0.

        Parameters
        ----------
        wave_numbers : ndarray
            Wave numbers q, above 0 [1/um].

        Returns
        -------
        ndarray
            Ratio for each wave number [1].
        """
        ratio = self._shear_ratio
        # Kolosov's constants 3 - 4 nu of the layer and of the base.
        layer = 3 - 4 * self.poisson
        base = 1.0  # any number: for a rigid base it is multiplied by the ratio 0
        if isinstance(self.base, HalfSpace):
            base = 3 - 4 * self.base.poisson
        twice_depth = 2 * self.thickness * wave_numbers  # 2 q h
        decay = np.exp(-twice_depth)
        square_of_ratio = ratio * ratio  # inf, not an error, where it is too large
        of_both = ratio * (1 + layer) * (1 + base)
        of_rests = (
            2 * layer + ratio * (layer - 1) * (base - 1) + 2 * square_of_ratio * base
        )
        linear = (
            2 * (layer - 1)
            + ratio * (base - 1) * (layer - 3)
            + 4 * square_of_ratio * base
        )
        square = (1 + layer) * (2 + ratio * (base - 1))
        # Bodies that overflow here are refused by `bem.problem.check_solvable`.
        with np.errstate(over="ignore", invalid="ignore"):
            above = of_both * (1 + decay**2)
            above += of_rests * _scaled_rest(twice_depth, first=3)
            above += 2 * linear * twice_depth * decay
            below = 2 * (1 + layer) ** 2 * decay
            below += of_rests * _scaled_rest(twice_depth, first=4)
            below += square * twice_depth**2 * decay
            below -= of_both * np.expm1(-2 * twice_depth)
            relative: Field = above / below
        return relative


@dataclass(frozen=True)
class Pair(Body):
    """Two elastic bodies of which one is rough; their compliances add.

    Attributes
    ----------
    first, second : Body
        The bodies; which of them is rough makes no difference.
    """

    first: Body
    second: Body

    @property
    def is_homogeneous(self) -> bool:
        """Whether both are half-spaces."""
        return self.first.is_homogeneous and self.second.is_homogeneous

    @property
    def e_star(self) -> float:
        """Modulus of both, whose inverse is the sum of their inverse moduli [MPa]."""
        return 1 / (1 / self.first.e_star + 1 / self.second.e_star)

    @property
    def mean_compliance(self) -> float:
        """Sum of the mean compliances [um / MPa]."""
        return self.first.mean_compliance + self.second.mean_compliance

    def relative_compliance(self, wave_numbers: Field) -> Field | float:
        """Add the bodies' compliances, as the ratio of `Body.relative_compliance` [1]."""
        first = self.first.relative_compliance(wave_numbers) / self.first.e_star
        second = self.second.relative_compliance(wave_numbers) / self.second.e_star
        return self.e_star * (first + second)


@dataclass(frozen=True)
class _Reduced(Body):
    """A body in units of a length [um] and of its own modulus E*."""

    body: Body
    length: float

    @property
    def e_star(self) -> float:
        """1."""
        return 1.0

    @property
    def mean_compliance(self) -> float:
        """Mean compliance of the body [length / E*]."""
        return self.body.mean_compliance * (self.body.e_star / self.length)

    def relative_compliance(self, wave_numbers: Field) -> Field | float:
        """Return the ratio of the body; wave numbers are in 1 / length."""
        return self.body.relative_compliance(wave_numbers / self.length)


@dataclass(frozen=True)
class WithoutMean(Body):
    """A body whose displacements are measured from the mean of its deformed surface.

    Its mean compliance is 0, whatever that of the body is.

    Attributes
    ----------
    body : Body
        The body.
    """

    body: Body

    @property
    def e_star(self) -> float:
        """Modulus of the body [MPa]."""
        return self.body.e_star

    def relative_compliance(self, wave_numbers: Field) -> Field | float:
        """Return the ratio of the body, see `Body.relative_compliance`."""
        return self.body.relative_compliance(wave_numbers)


def _scaled_rest(values: Field, first: int) -> Field:
    """Compute 2 exp(-y) times a power series of y without its first terms, for numbers y above 0.

    `first` is the power of the first term that is left. With 3 the series is that of sinh y, and
    the result 2 exp(-y) (sinh y - y). With 4 it is that of cosh y, and the result
    2 exp(-y) (cosh y - 1 - y^2 / 2). For y below 1, where these differences cancel, the series
    itself is summed.
    """
    decay = np.exp(-values)
    if first == 3:
        closed = 1 - decay**2 - 2 * decay * values
    else:
        closed = 1 + decay**2 - decay * (2 + values**2)
    small = np.minimum(values, 1.0)
    term = small**first / math.factorial(first)
    series = term.copy()
    for power in range(first + 2, LAST_POWER + 1, 2):
        term *= small**2 / (power * (power - 1))
        series += term
    return np.where(values < 1, 2 * decay * series, closed)


def checked_body(body: Any) -> Body:
    """Check the argument `body` of `bem.solve`.

    Parameters
    ----------
    body : Body or tuple of two Body
        What the caller passed.

    Returns
    -------
    Body
        The body; of two bodies it is their `Pair`.

    Raises
    ------
    ValueError
        If it is neither, one of two bodies is under concentrated forces, or a body of a class of
        the caller's cannot be hashed or has no modulus E* above 0.
    """
    if isinstance(body, Body):
        _check_hash_and_modulus(body)
        return body
    if isinstance(body, tuple | list) and len(body) == 2:
        first, second = body
        if _may_be_paired(first) and _may_be_paired(second):
            _check_hash_and_modulus(first)
            _check_hash_and_modulus(second)
            return Pair(first, second)
    raise ValueError(
        f"body = {shown(body)}: must be a bem.HalfSpace, a bem.Layered, another bem.Body, or two of"
        " them, (a, b)"
    )


def _check_hash_and_modulus(body: Body) -> None:
    """Refuse a body that cannot be the key of a table, or whose E* is not above 0."""
    name = type(body).__name__
    try:
        hash(body)
    except TypeError as error:
        raise ValueError(
            f"body = a {name}, which cannot be hashed: make the class a frozen dataclass of numbers"
        ) from error
    if not body.e_star > 0:
        raise ValueError(f"e_star of the {name} = {body.e_star}: must be above 0 MPa")


def _may_be_paired(body: Any) -> bool:
    """Return whether a value is a body whose compliance can be added to that of another one."""
    return isinstance(body, Body) and body.kernel == "uniform-pressure"


def _plane_strain_modulus(modulus: float, poisson: float) -> float:
    """Return E* = E / (1 - nu^2) of a material [MPa]."""
    return modulus / (1 - poisson**2)


def _check_material(body: Body, modulus: float, poisson: float) -> None:
    """Check the numbers of a body's material, and set them as plain floats."""
    # The classes are frozen for their users.
    object.__setattr__(body, "modulus", real_number("modulus", modulus, MODULI))
    object.__setattr__(body, "poisson", real_number("poisson", poisson, POISSONS))


# The half-space of unit modulus, to which all half-spaces are reduced.
HALF_SPACE = HalfSpace(1.0)

# The half-spaces of unit modulus by their kernels.
REDUCED: dict[Kernel, HalfSpace] = {
    "uniform-pressure": HALF_SPACE,
    "concentrated-force": ConcentratedForces(1.0),
}

# The half-spaces by their kernels, as arguments of `bem.solve` name them.
HALF_SPACES: dict[Kernel, type[HalfSpace]] = {
    "uniform-pressure": HalfSpace,
    "concentrated-force": ConcentratedForces,
}
