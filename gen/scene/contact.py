"""The contact of a scene: the material, the patch, the hardness and the solver's accuracy."""

import sys
from typing import Annotated, Any, Literal, Self

from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator
from pydantic_core import PydanticCustomError

from gen.material import Bodies, plane_strain_modulus
from gen.scene.distribution import AboveZero, Distribution, is_drawn, limits
from gen.scene.table import Number, Positive, Table


class Contact(Table):
    """The half-space's material, the discretisation of its contact and the solver's accuracy."""

    kernel: Literal["uniform-pressure", "concentrated-force"] = Field(
        default="uniform-pressure", description="'uniform-pressure' or 'concentrated-force'"
    )
    far_field: Literal["rigid", "compliant"] = Field(
        default="rigid", description="'rigid' or 'compliant'"
    )
    # A free patch is never written: scenes without the key keep their texts and fingerprints.
    boundary: Literal["free", "periodic", "mirror"] = Field(
        default="free", description="'free', 'periodic' or 'mirror'"
    )
    spacing: Literal["side/(n-1)", "side/n"] = Field(
        default="side/(n-1)", description="'side/(n-1)' or 'side/n'"
    )
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
    hardness: AboveZero | None = Field(
        default=None,
        description="a finite number above 0, or [low, high] with 0 < low <= high [MPa], or"
        " a distribution",
    )
    hardness_ratio: AboveZero | None = Field(
        default=None,
        description="a finite number above 0, or [low, high] with 0 < low <= high [E*], or"
        " a distribution",
    )

    @model_validator(mode="before")
    @classmethod
    def _follow_boundary(cls, content: Any) -> Any:
        """Let the spacing of a patch without edges be that of its cells unless it is given."""
        if isinstance(content, dict) and content.get("boundary", "free") != "free":
            return {"spacing": "side/n", **content}
        return content

    @model_validator(mode="after")
    def _require_free_patch(self) -> Self:
        """Refuse settings that a patch without edges does not have."""
        if self.boundary == "free":
            return self
        for name, allowed in (
            ("spacing", "side/n"),
            ("far_field", "rigid"),
            ("kernel", "uniform-pressure"),
        ):
            if (given := getattr(self, name)) != allowed:
                raise PydanticCustomError(
                    "conflict",
                    f"boundary = '{self.boundary}' needs {name} = '{allowed}', not '{given}'",
                )
        return self

    @model_serializer(mode="wrap")
    def _without_free_boundary(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Leave out the boundary of a free patch."""
        content: dict[str, Any] = handler(self)
        if self.boundary == "free":
            del content["boundary"]
        return content

    @model_validator(mode="after")
    def _require_one_hardness(self) -> Self:
        """Refuse two hardnesses, and a hardness that the model or the numbers cannot have."""
        if self.hardness is not None and self.hardness_ratio is not None:
            raise PydanticCustomError(
                "conflict", "hardness [MPa] and hardness_ratio [E*] are both given: give one"
            )
        if (limits := self.hardness_limits) is None:
            return self
        if self.far_field == "compliant":
            raise PydanticCustomError(
                "conflict", "a hardness needs far_field = 'rigid', not 'compliant'"
            )
        if not all(sys.float_info.min <= limit <= sys.float_info.max for limit in limits):
            raise PydanticCustomError("conflict", "the hardness is beyond what numbers hold [MPa]")
        return self

    def intervals(self, nodes: int) -> int:
        """Return how many times the spacing of some nodes along a side is in that side."""
        return nodes - (self.boundary == "free" and self.spacing == "side/(n-1)")

    @property
    def hardness_unit(self) -> float:
        """Unit of the hardness as it is given: E* for a ratio, otherwise 1 [MPa]."""
        if self.hardness_ratio is None:
            return 1.0
        return plane_strain_modulus(self.modulus, self.poisson)

    @property
    def hardness_distribution(self) -> Distribution | None:
        """Distribution of the hardness in its unit; None for elastic bodies."""
        return self.hardness if self.hardness_ratio is None else self.hardness_ratio

    @property
    def hardness_limits(self) -> tuple[float, float] | None:
        """Smallest and largest hardness [MPa], equal for a fixed one; None for elastic bodies."""
        if (given := self.hardness_distribution) is None:
            return None
        low, high = limits(given)
        return low * self.hardness_unit, high * self.hardness_unit

    @property
    def doubts(self) -> list[str]:
        """What no solid has; hardnesses in shares of E* are taken as they are."""
        ends = (None,) if self.hardness is None else limits(self.hardness)
        e_star = plane_strain_modulus(self.modulus, self.poisson)
        known = "modulus" in self.model_fields_set
        return [line for end in ends for line in Bodies(e_star, end, known).doubts][:1]

    @property
    def draws_hardness(self) -> bool:
        """Whether every sample has a hardness of its own."""
        given = self.hardness_distribution
        return given is not None and is_drawn(given)
