"""The consistent systems of units in which files for programs are written."""

from typing import NamedTuple

from gen.options import Units


class UnitSystem(NamedTuple):
    """A consistent system of units, with factors that convert the units of laws into its units."""

    pressure: float  # value of 1 MPa
    length: float  # value of 1 um
    conductance: float  # value of 1 W/(mm2 K)
    pressure_unit: str
    length_unit: str
    force_unit: str
    conductance_unit: str

    @property
    def text(self) -> str:
        """The units in words."""
        mechanical = f"{self.length_unit}, {self.force_unit}, s, {self.pressure_unit}"
        return f"{mechanical}; conductance in {self.conductance_unit}"


UNITS: dict[Units, UnitSystem] = {
    "mm": UnitSystem(
        pressure=1.0,
        length=1e-3,
        conductance=1e3,
        pressure_unit="MPa",
        length_unit="mm",
        force_unit="N",
        conductance_unit="mW/(mm2 K)",
    ),
    "si": UnitSystem(
        pressure=1e6,
        length=1e-6,
        conductance=1e6,
        pressure_unit="Pa",
        length_unit="m",
        force_unit="N",
        conductance_unit="W/(m2 K)",
    ),
    "um": UnitSystem(
        pressure=1.0,
        length=1.0,
        conductance=1e6,
        pressure_unit="MPa",
        length_unit="um",
        force_unit="uN",
        conductance_unit="pW/(um2 K)",
    ),
}
"""Systems of units by their names in the option --units."""
