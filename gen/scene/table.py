"""The rules for every table of a scene, and the numbers that stand in them."""

from typing import Annotated, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, Strict

T = TypeVar("T")


class Table(BaseModel):
    """Rules for every table of a scene: no unknown keys, no conversions, no changes afterwards.

    The description of a field completes an error message: it says which values are allowed.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


def without_negative_zero(number: float) -> float:
    """Turn -0.0 into 0.0: the two are equal, and equal scenes must have equal texts."""
    return number + 0.0


def ascending(limits: tuple[T, T]) -> tuple[T, T]:
    """Refuse a range whose lower limit is above the upper one."""
    low, high = limits
    if low > high:  # type: ignore[operator]  # pydantic has made both numbers
        raise ValueError(f"{low!r} is above {high!r}")
    return limits


Number = Annotated[float, AfterValidator(without_negative_zero)]
Positive = Annotated[Number, Field(gt=0)]
# TOML and JSON have arrays where the models have tuples: this conversion alone is allowed.
Range = Annotated[tuple[T, T], Strict(False), AfterValidator(ascending)]
