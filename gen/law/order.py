"""The request for a contact law: its surfaces, its loads, and the quantities of its tables."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from bem.problem import Boundary
from gen.arrays import Values
from gen.maps.bodies import Opposite
from gen.maps.settings import Reading
from gen.material import Gas, loads_from
from gen.quantities import (
    ALSO,
    ALWAYS_IN_LAWS,
    APERTURES,
    CONTINUUM,
    DELTA,
    GAS,
    JOINT,
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
"""Name of the quantity that a table is tabulated against, by the kind of its loads."""

USUAL_LEVEL = 0.9
"""Coverage of a band unless the order has another one."""


@dataclass(frozen=True)
class Order:
    """A request for a law."""

    inputs: tuple[str, ...]  # surfaces, folders of surfaces, databases or scenes
    # Displacements [um] and pressures [MPa] as text, each "" if it is not given. The solver needs
    # one of them or both; a surrogate has loads of its own.
    delta: str = ""
    pressure: str = ""
    surfaces: int = 50  # number of surfaces of a database's or scene's population
    level: float | None = None  # coverage of the band; None for the usual one
    e_star: float | None = None  # [MPa]; None for that of the scenes, or else 1 MPa
    # Hardness of the softer body [MPa]; None for that of the scenes, which have one or none.
    hardness: float | None = None
    boundary: Boundary | None = None  # of the patches; None for the usual one
    conductivities: tuple[float, float] | None = None  # of both bodies [W/(m K)]
    gas: Gas | None = None  # in the gap
    stiffness: bool = False  # with the stiffness, which conductivities bring along too
    grid_error: bool = False  # with the area in the continuum and the error of the grid
    flow: bool = False  # with the hydraulic apertures of the gap
    also: tuple[str, ...] = ()  # further quantities, by names of `gen.quantities.ALSO`
    reading: Reading = field(default_factory=Reading)  # how files are read
    opposite: Opposite | None = None  # second rough body against surfaces from files
    # Tables between whose loads further contacts are solved, for files whose programs join points.
    between: tuple[Load, ...] = ()
    # Whether straight lines between the pressures are judged by contacts of their own.
    straight: bool = False
    command: str = ""  # command line, for the record

    @property
    def coverage(self) -> float:
        """Coverage of the band, between 0 and 1."""
        if self.level is None:
            return USUAL_LEVEL
        return self.level

    @property
    def requested(self) -> tuple[Load, ...]:
        """Kinds of the loads that the order gives; Delta if it gives none."""
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
            If a text has no loads that a law allows.
        """
        loads: dict[Load, Values] = {}
        if self.delta:
            loads["delta"] = np.unique(loads_from("delta", self.delta))
        if self.pressure:
            loads["pressure"] = np.unique(loads_from("pressure", self.pressure))
        return loads

    @property
    def media(self) -> Media:
        """What conducts through the interface."""
        return Media(self.conductivities, self.gas)

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """Quantities that are read off each contact; the conductance follows from the stiffness."""
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
        quantities += [ALSO[name] for name in self.also]
        return tuple(quantities)

    def refuse_impossible(self, hardness: float | None) -> None:
        """Refuse further quantities that no contact of the bodies has.

        Parameters
        ----------
        hardness : float or None
            Hardness of the softer body [MPa]; None for elastic bodies.

        Raises
        ------
        InputError
            If the bodies are elastic and a quantity is one of bodies that yield.
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
        Names, several in one text with commas between them.

    Returns
    -------
    tuple of str
        Names of `gen.quantities.ALSO`.

    Raises
    ------
    InputError
        If no law has a quantity of a name.
    """
    stripped = [name.strip() for text in names for name in text.split(",")]
    for name in stripped:
        if name not in ALSO:
            raise InputError(f"--also {quoted(name)}: give one of {', '.join(ALSO)}")
    return tuple(dict.fromkeys(stripped))
