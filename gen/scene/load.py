"""The loads of a scene: displacements, pressures or forces, in pieces of their distribution."""

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, Strict, model_validator
from pydantic_core import PydanticCustomError

from gen.scene.distribution import AtLeastZero
from gen.scene.table import Positive, Table

Quantity = Literal["delta", "delta/height_rms", "pressure", "pressure/(E* slope_rms)", "force"]

UNITS: dict[Quantity, str] = {
    "delta": "um",
    "delta/height_rms": "1",
    "pressure": "MPa",
    "pressure/(E* slope_rms)": "1",
    "force": "uN",
}
"""Units of the quantities that a scene can give as its load."""

QUANTITIES = ", ".join(f"'{name}'" for name in UNITS)
PIECES = "one or more { share = ..., range = [low, high] }, their shares sum to 1"


class Piece(Table):
    """One piece of a distribution of loads, by default uniform over its range."""

    share: Annotated[Positive, Field(le=1)] = Field(
        description="the share of the samples in this range, a number above 0, at most 1"
    )
    range: AtLeastZero = Field(
        description="two finite numbers [low, high] with 0 <= low <= high, one number, or a"
        " distribution"
    )


def _whole(pieces: tuple[Piece, ...]) -> tuple[Piece, ...]:
    """Refuse pieces whose shares do not sum to 1."""
    total = sum(piece.share for piece in pieces)
    if abs(total - 1.0) > 1e-9:
        raise ValueError(f"the shares sum to {total:.10g}")
    return pieces


Pieces = Annotated[tuple[Piece, ...], Strict(False), AfterValidator(_whole)]


class Delta(Table):
    """Distribution of the far-field displacement: the paper's controlled sampling (section 3.2)."""

    pieces: Pieces = Field(
        default=(Piece(share=0.75, range=(5.0, 25.0)), Piece(share=0.25, range=(25.0, 45.0))),
        description=PIECES,
    )


class Load(Table):
    """Distribution of the loads in one of several quantities; [delta] gives displacements alone.

    Relative displacements count in rms heights of their surface, relative pressures in E* times its
    rms slope.
    """

    quantity: Quantity = Field(description=f"one of {QUANTITIES}")
    pieces: Pieces = Field(description=f"range = [low, high], or pieces: {PIECES}")

    @model_validator(mode="before")
    @classmethod
    def _of_one_range(cls, content: Any) -> Any:
        """Read a range as one piece."""
        if isinstance(content, dict) and "range" in content:
            if "pieces" in content:
                raise PydanticCustomError("conflict", "range and pieces are both given: give one")
            rest = {name: value for name, value in content.items() if name != "range"}
            return rest | {"pieces": [{"share": 1.0, "range": content["range"]}]}
        return content
