"""The optional columns of a scene."""

import math
from typing import Annotated, Self

from pydantic import AfterValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from gen.scene.table import Table
from gen.scene.user_function import FUNCTION_WORDS, Function, Hash, named

LONGEST_UNIT = 20
"""Most letters of a unit."""

MOST_OUTPUTS = 1000
"""Most outputs of a function."""


def is_unit(unit: object) -> bool:
    """Tell whether something can be the unit of a column: a short text, "1" for pure numbers."""
    return isinstance(unit, str) and 0 < len(unit) <= LONGEST_UNIT and unit.isprintable()


def _units(outputs: dict[str, str]) -> dict[str, str]:
    """Refuse units that cannot stand in a table, and more outputs than a file should have."""
    for name, unit in outputs.items():
        if not is_unit(unit):
            raise ValueError(f"{name}: a unit is a text of 1 to {LONGEST_UNIT} letters")
    if not 1 <= len(outputs) <= MOST_OUTPUTS:
        raise ValueError(f"{len(outputs)} outputs: give 1 to {MOST_OUTPUTS}")
    return outputs


def flags() -> tuple[str, ...]:
    """Return the names of the optional columns that are asked for by true."""
    fields = Store.model_fields.items()
    return tuple(name for name, field in fields if field.annotation in {bool, bool | None})


# A later flag: absent where it is off, so that it changes no scene that does not set it.
Flag = Annotated[bool | None, AfterValidator(lambda wanted: wanted or None)]


class Store(Table):
    """Optional columns, stored besides the area, the force and the statistics."""

    mean_gap: bool = Field(default=False, description="true or false")
    largest_pressure: bool = Field(default=False, description="true or false")
    perimeter: bool = Field(default=False, description="true or false")
    heights: bool = Field(default=False, description="true or false")
    pressure: bool = Field(default=False, description="true or false")
    stiffness: Flag = Field(default=None, description="true or false")
    interface_stiffness: Flag = Field(default=None, description="true or false")
    contact_spots: Flag = Field(default=None, description="true or false")
    largest_spot_percent: Flag = Field(default=None, description="true or false")
    contact_connects: Flag = Field(default=None, description="true or false")
    gap_connects: Flag = Field(default=None, description="true or false")
    corrected_area_percent: Flag = Field(default=None, description="true or false")
    function: Function | None = Field(
        default=None, description=f"{FUNCTION_WORDS}, whose outputs of each contact become columns"
    )
    # Without it the first contact's outputs count; every database records them.
    outputs: Annotated[dict[str, str], AfterValidator(named), AfterValidator(_units)] | None = (
        Field(default=None, description="a table of the function's outputs, { name = 'unit' }")
    )
    least: dict[str, float] | None = Field(
        default=None, description="a table of bounds of outputs, { name = least value }"
    )
    most: dict[str, float] | None = Field(
        default=None, description="a table of bounds of outputs, { name = largest value }"
    )
    # Written when a run begins: the SHA-256 of the module's source.
    source: Hash | None = Field(default=None, description="the SHA-256 of the module's source")

    @model_validator(mode="after")
    def _require_function(self) -> Self:
        """Refuse outputs of no function."""
        for name in ("outputs", "source", "least", "most"):
            if self.function is None and getattr(self, name) is not None:
                raise PydanticCustomError("conflict", f"{name} needs function, which gives them")
        for name in self.least or ():
            least, most = self.bounds(name)
            if not least < most:
                said = f"least.{name} = {least:g} is not below most.{name} = {most:g}"
                raise PydanticCustomError("conflict", said)
        return self

    def bounds(self, name: str) -> tuple[float, float]:
        """Return the least and the largest value of an output, infinite where none is stated."""
        return (self.least or {}).get(name, -math.inf), (self.most or {}).get(name, math.inf)
