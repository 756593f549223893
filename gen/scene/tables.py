"""The tables of a scene beside its surfaces: contact, loads, and optional columns."""

import math
import sys
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self, TypeAlias

from pydantic import AfterValidator, Field, Strict, create_model, model_validator

from gen.distribution import (
    SPANNED,
    AboveZero,
    AtLeastZero,
    Number,
    Positive,
    Table,
    conflict,
    is_drawn,
    limits,
)
from gen.doubts import material_doubts
from gen.generators.function import FUNCTION_WORDS, Function, Hash, named
from gen.material import Bodies
from gen.quantities import stored_quantities

Quantity = Literal[
    "delta", "delta/height_rms", "pressure", "pressure/(E* slope_rms)", "force"
]

UNITS: dict[Quantity, str] = {
    "delta": "um",
    "delta/height_rms": "1",
    "pressure": "MPa",
    "pressure/(E* slope_rms)": "1",
    "force": "uN",
}
"""Units of the quantities that a scene can give as its load."""

HARDNESS = (
    "a finite number above 0, or [low, high] with 0 < low <= high [{}], or a distribution"
)
PIECES = "one or more { share = ..., range = [low, high] }, their shares sum to 1"

Unit = Annotated[
    str, Field(pattern=r"^[^\p{C}\p{Zl}\p{Zp}]{1,20}$")
]  # in one line of a table


class Contact(Table):
    """The half-space's material, the discretisation of its contact and the solver's accuracy."""

    kernel: Literal["uniform-pressure", "concentrated-force"] = "uniform-pressure"
    far_field: Literal["rigid", "compliant"] = "rigid"
    # A scene writes no free patch: without the key it keeps its text and its fingerprint.
    boundary: Literal["free", "periodic", "mirror"] = "free"
    spacing: Literal["side/(n-1)", "side/n"] = "side/(n-1)"
    modulus: Positive = Field(
        default=1.0, description="Young's modulus, a finite number above 0 [MPa]"
    )
    poisson: Annotated[Number, Field(gt=-1, le=0.5)] = Field(
        default=0.0, description="Poisson's ratio, a number above -1, at most 0.5"
    )
    rtol: Annotated[Number, Field(gt=1e-14, lt=1)] = Field(
        default=2e-7, description="a number between 1e-14 and 1"
    )
    max_iterations: Annotated[int, Field(ge=1, le=1_000_000)] = Field(
        default=1000, description="a whole number from 1 to 1000000"
    )
    # None stands for elastic bodies and is never written: scenes without a hardness keep their
    # texts and fingerprints.
    hardness: AboveZero | None = Field(default=None, description=HARDNESS.format("MPa"))
    hardness_ratio: AboveZero | None = Field(
        default=None, description=HARDNESS.format("E*")
    )

    @model_validator(mode="after")
    def _require_what_goes_together(self) -> Self:
        """Refuse what a patch without edges does not have, and impossible hardnesses."""
        if self.boundary != "free":
            cells = {
                "spacing": "side/n",
                "far_field": "rigid",
                "kernel": "uniform-pressure",
            }
            for name, allowed in cells.items():
                if (given := getattr(self, name)) != allowed:
                    said = f"boundary = '{self.boundary}' needs {name} = '{allowed}', not '{given}'"
                    raise conflict(said)
        if self.hardness is not None and self.hardness_ratio is not None:
            raise conflict(
                "hardness [MPa] and hardness_ratio [E*] are both given: give one"
            )
        if (limits := self.hardness_limits) is None:
            return self
        if self.far_field == "compliant":
            raise conflict("a hardness needs far_field = 'rigid', not 'compliant'")
        if not all(sys.float_info.min <= limit <= sys.float_info.max for limit in limits):
            raise conflict("the hardness is beyond what numbers hold [MPa]")
        return self

    @property
    def e_star(self) -> float:
        """Plane-strain modulus E* = E / (1 - nu^2) [MPa]."""
        return self.modulus / (1 - self.poisson**2)

    @property
    def hardness_unit(self) -> float:
        """Unit of the hardness as it is given: E* for a ratio, otherwise 1 [MPa]."""
        return 1.0 if self.hardness_ratio is None else self.e_star

    @property
    def hardness_limits(self) -> tuple[float, float] | None:
        """Smallest and largest hardness [MPa], equal for a fixed one; None for elastic bodies."""
        if (given := self.hardness or self.hardness_ratio) is None:
            return None
        low, high = limits(given)
        return low * self.hardness_unit, high * self.hardness_unit

    @property
    def doubts(self) -> list[str]:
        """What no solid has; hardnesses in shares of E* are taken as they are."""
        if self.hardness is None and self.modulus == 1.0:  # nothing was given
            return []
        ends = (None,) if self.hardness is None else limits(self.hardness)
        return [
            line
            for end in ends
            for line in material_doubts(Bodies(self.e_star, end, self.has_modulus))
        ][:1]

    @property
    def has_modulus(self) -> bool:
        """Whether a modulus other than the default is given.

        The scene of a database has all keys, so that it does not tell whether the default was
        written.
        """
        return self.modulus != 1.0

    @property
    def draws_hardness(self) -> bool:
        """Whether every sample has a hardness of its own."""
        given = self.hardness or self.hardness_ratio
        return given is not None and is_drawn(given)


class Piece(Table):
    """One piece of a distribution of loads, by default uniform over its range."""

    share: Annotated[Positive, Field(le=1)] = Field(
        description="the share of the samples in this range, a number above 0, at most 1"
    )
    range: AtLeastZero = Field(description=SPANNED)


def _whole(pieces: tuple[Piece, ...]) -> tuple[Piece, ...]:
    """Refuse pieces whose shares do not sum to 1."""
    total = sum(piece.share for piece in pieces)
    if abs(total - 1.0) > 1e-9:
        raise ValueError(f"the shares sum to {total:.10g}")
    return pieces


Pieces = Annotated[tuple[Piece, ...], Strict(False), AfterValidator(_whole)]


def _of_one_range(content: Any) -> Any:
    """Read the range of a table of loads as one piece."""
    if isinstance(content, dict) and "range" in content:
        if "pieces" in content:
            raise conflict("range and pieces are both given: give one")
        rest = {name: value for name, value in content.items() if name != "range"}
        return rest | {"pieces": [{"share": 1.0, "range": content["range"]}]}
    return content


class Delta(Table):
    """Distribution of the far-field displacement: the paper's controlled sampling (section 3.2)."""

    pieces: Pieces = Field(
        default=(
            Piece(share=0.75, range=(5.0, 25.0)),
            Piece(share=0.25, range=(25.0, 45.0)),
        ),
        description=f"range = [low, high], or pieces: {PIECES}",
    )

    _range = model_validator(mode="before")(_of_one_range)


class Load(Table):
    """Distribution of the loads in one of several quantities; [delta] gives displacements alone.

    Relative displacements count in rms heights of their surface, relative pressures in E* times its
    rms slope.
    """

    quantity: Quantity
    pieces: Pieces = Field(description=f"range = [low, high], or pieces: {PIECES}")

    _range = model_validator(mode="before")(_of_one_range)


# A later flag: absent where it is off, so that it changes no scene that does not set it.
Flag = Annotated[bool | None, AfterValidator(lambda wanted: wanted or None)]


def _keys_of_quantities() -> type[Table]:
    """Make the keys of `[store]` that ask for a quantity of contacts each."""
    keys: dict[str, Any] = {
        quantity.name: (bool, False) if quantity.early else (Flag, None)
        for quantity in stored_quantities()
        if quantity.stored == "asked"
    }
    return create_model("StoredQuantities", __base__=Table, **keys)


if TYPE_CHECKING:
    StoredQuantities: TypeAlias = Table
else:
    StoredQuantities = _keys_of_quantities()


class Store(StoredQuantities):
    """Optional columns, stored besides the area, the force and the statistics."""

    function: Function | None = Field(
        default=None,
        description=f"{FUNCTION_WORDS}, whose outputs of each contact become columns",
    )
    # Without it the first contact's outputs count; every database records them.
    outputs: (
        Annotated[dict[str, Unit], Field(min_length=1), AfterValidator(named)] | None
    ) = Field(
        default=None,
        description="a table of the function's outputs, { name = 'unit' }, of 1 to 20 letters",
    )
    least: dict[str, float] | None = Field(
        default=None, description="a table of bounds of outputs, { name = least value }"
    )
    most: dict[str, float] | None = Field(
        default=None, description="a table of bounds of outputs, { name = largest value }"
    )
    # Both are written when a run begins. Powers are measured, and change no row.
    powers: dict[str, Annotated[tuple[int, int, int], Strict(False)]] | None = Field(
        default=None,
        description="a table of powers of heights, lengths and E*, { name = [1, 1, 1] }",
    )
    source: Hash | None = Field(
        default=None, description="the SHA-256 of the module's source"
    )

    @model_validator(mode="after")
    def _require_function(self) -> Self:
        """Refuse outputs of no function."""
        for name in ("outputs", "powers", "source", "least", "most"):
            if self.function is None and getattr(self, name) is not None:
                raise conflict(f"{name} needs function, which gives them")
        for name in self.least or ():
            least, most = self.bounds(name)
            if not least < most:
                said = f"least.{name} = {least:g} is not below most.{name} = {most:g}"
                raise conflict(said)
        return self

    def wants(self, quantity: str) -> bool:
        """Return whether the column of an optional quantity is asked for."""
        return bool(getattr(self, quantity))

    def bounds(self, name: str) -> tuple[float, float]:
        """Return the least and the largest value of an output, infinite where none is stated."""
        return (self.least or {}).get(name, -math.inf), (self.most or {}).get(
            name, math.inf
        )
