"""The request for a contact law: its surfaces, its loads, and the quantities of its tables."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from bem.problem import Boundary
from gen.arrays import Values
from gen.maps.bodies import Opposite
from gen.maps.settings import Reading
from gen.material import Friction, Gas, LayeredBody, loads_from
from gen.options import LayerPlace
from gen.quantities import (
    ALSO,
    ALWAYS_IN_LAWS,
    APERTURES,
    CONTINUUM,
    DELTA,
    GAS,
    JOINT,
    OF_SHEAR,
    PRESSURE,
    STIFFNESS,
    Media,
    Quantity,
)
from gen.runtime.errors import InputError
from gen.runtime.terminal import quoted

Load = Literal["delta", "pressure"]
"""Kind of the loads of a law: displacements Delta [um] or nominal pressures [MPa]."""

ARGUMENTS: dict[Load, str] = {"delta": DELTA.in_laws, "pressure": PRESSURE.in_laws}
"""Name of the argument of a table, by the kind of its loads."""

USUAL_LEVEL = 0.9
"""Coverage of a band if the order gives none: the chance that a further surface of the same kind is
inside the band."""


@dataclass(frozen=True)
class Order:
    """A request for a law."""

    inputs: tuple[str, ...]  # surfaces, folders of surfaces, databases or scenes
    # Displacements [um] and pressures [MPa] as text; "" if not given. The solver needs one of them
    # or both. A surrogate without them takes displacements from its training.
    delta: str = ""
    pressure: str = ""
    surfaces: int = 50  # number of surfaces that each scene or database gives
    level: float | None = None  # coverage of the band; None for `USUAL_LEVEL`
    # E* [MPa]; None to take that of the scenes, or 1 MPa without scenes.
    e_star: float | None = None
    # Hardness of the softer body [MPa]; None to take that of the scenes, which may have none.
    hardness: float | None = None
    # Bodies with a layer, whose E* is `e_star`; None to take those of the scenes, if these have a
    # layer and `e_star` is None.
    layered: LayeredBody | None = None
    # What has the uniform compression of a layer: the mesh, or the closure of the law.
    layer_in: LayerPlace = "mesh"
    # Boundary of the patches; None for the usual one of `gen.law.surfaces`.
    boundary: Boundary | None = None
    # Conductivities of both bodies [W/(m K)]; None for a law without conductance of spots.
    conductivities: tuple[float, float] | None = None
    gas: Gas | None = None  # gas in the gap; None for none
    # Friction of bodies of like elastic constants; None for a law without shear.
    friction: Friction | None = None
    # Pressure at which the file for CalculiX takes its stick slope [MPa]; None for no slope.
    stick_pressure: float | None = None
    stiffness: bool = False  # True for the stiffness; conductivities add it, too
    # True for the area in the continuum, and the error of the grid in it.
    grid_error: bool = False
    # Largest relative errors of answers, by their names in `bem.answers.ANSWERS` [1], for which
    # contacts are solved on the coarsest grid that gives them; None for the grid of the surface. Of
    # a scene they are the errors of the means over its population.
    errors: Mapping[str, float] | None = None
    flow: bool = False  # True for the hydraulic apertures of the gap
    also: tuple[str, ...] = ()  # names of further quantities, of `gen.quantities.ALSO`
    # False to leave out a table for which no loads are given, with errors of means.
    both_tables: bool = True
    reading: Reading = field(default_factory=Reading)  # how files are read
    opposite: Opposite | None = None  # second rough body against surfaces from files
    # Tables between whose loads further contacts are solved, for programs that join the points.
    between: tuple[Load, ...] = ()
    # True if a program joins points by straight lines: then further contacts are solved for these,
    # and others to compare the lines with.
    straight: bool = False
    command: str = ""  # command line that files of the law name; "" if there is none

    @property
    def coverage(self) -> float:
        """Coverage of the band, between 0 and 1."""
        if self.level is None:
            return USUAL_LEVEL
        return self.level

    @property
    def requested(self) -> tuple[Load, ...]:
        """Kinds of the loads that the order gives; "delta" alone if it gives none."""
        loads: list[Load] = []
        if self.delta or not self.pressure:
            loads.append("delta")
        if self.pressure:
            loads.append("pressure")
        return tuple(loads)

    def loads(self) -> dict[Load, Values]:
        """Parse the loads of the order.

        Returns
        -------
        dict
            Ascending displacements [um] and pressures [MPa], each (k,), by their kind. A kind that
            the order does not give is left out.

        Raises
        ------
        InputError
            If a text is no list of loads, or has loads that a law does not allow.
        """
        loads: dict[Load, Values] = {}
        if self.delta:
            deltas = loads_from("delta", self.delta)
            loads["delta"] = np.unique(deltas)  # sorted, each once
        if self.pressure:
            pressures = loads_from("pressure", self.pressure)
            loads["pressure"] = np.unique(pressures)
        return loads

    @property
    def media(self) -> Media:
        """Conductivities of the bodies, the gas, and the friction."""
        return Media(
            conductivities=self.conductivities, gas=self.gas, friction=self.friction
        )

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """Quantities that are read off each contact.

        The conductance of the spots is not among them: it is computed from the stiffness.
        """
        quantities = list(ALWAYS_IN_LAWS)
        if self.grid_error:
            quantities.append(CONTINUUM)
        if self.stiffness or self.conductivities:
            quantities.append(STIFFNESS)
        if self.gas:
            quantities.append(GAS)
        if self.gas and self.conductivities:
            quantities.append(JOINT)
        if self.flow:
            quantities += APERTURES
        if self.friction:
            quantities += OF_SHEAR
        quantities += [ALSO[name] for name in self.also]
        return tuple(quantities)

    def refuse_impossible(self, hardness: float | None) -> None:
        """Refuse quantities of `also` that contacts of elastic bodies do not have.

        Parameters
        ----------
        hardness : float or None
            Hardness of the softer body [MPa]; None for elastic bodies.

        Raises
        ------
        InputError
            If the bodies are elastic and a quantity exists only for bodies that yield.
        """
        for name in self.also:
            if ALSO[name].needs_hardness and hardness is None:
                raise InputError(
                    f"--also {name}: elastic bodies have none: give --hardness"
                )


def require_also(names: Sequence[str]) -> tuple[str, ...]:
    """Return the names of further quantities of a law, each once.

    Parameters
    ----------
    names : sequence of str
        Texts of one name, or of several names with commas between them.

    Returns
    -------
    tuple of str
        Names of `gen.quantities.ALSO`, without blanks around them.

    Raises
    ------
    InputError
        If a name is not in `gen.quantities.ALSO`.
    """
    stripped = [name.strip() for text in names for name in text.split(",")]
    for name in stripped:
        if name not in ALSO:
            raise InputError(f"--also {quoted(name)}: give one of {', '.join(ALSO)}")
    return tuple(dict.fromkeys(stripped))
