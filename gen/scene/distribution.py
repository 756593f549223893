"""Distributions of the numbers that a scene draws.

A number is fixed, `[low, high]` is uniform, and a table names every other distribution:
`{ log_uniform = [low, high] }`, `{ normal = [mean, deviation] }`, which is truncated, and
`{ choice = [...] }`.
"""

import math
import sys
from dataclasses import dataclass
from typing import Annotated, Self

from pydantic import (
    Field,
    PlainSerializer,
    PlainValidator,
    Strict,
    ValidationError,
    model_validator,
)
from pydantic_core import PydanticCustomError

from gen.scene.table import Number, Positive, Range, Table

LEAST_INSIDE = 1e-9
"""Smallest share of a normal distribution that its range may hold."""

REACH = 3.0
"""Deviations from the mean at which a normal distribution ends unless a range is given."""


class LogUniform(Table):
    """Numbers whose logarithm is uniform."""

    log_uniform: Range[Positive] = Field(description="[low, high] with 0 < low <= high")

    @model_validator(mode="after")
    def _require_ratio(self) -> Self:
        """Refuse limits whose ratio no number holds."""
        low, high = self.log_uniform
        if math.isinf(math.sqrt(high) / math.sqrt(low)):
            raise ValueError("the range is too wide")
        return self


class Normal(Table):
    """Normally distributed numbers, truncated at both ends of a range."""

    normal: Annotated[tuple[Number, Positive], Strict(False)] = Field(
        description="[mean, deviation]"
    )
    range: Range[Number] | None = Field(default=None, description="[low, high]")

    @property
    def ends(self) -> tuple[float, float]:
        """Smallest and largest number."""
        mean, deviation = self.normal
        return self.range or (mean - REACH * deviation, mean + REACH * deviation)

    @model_validator(mode="after")
    def _require_numbers_inside(self) -> Self:
        """Refuse ends between which a normal distribution has no numbers that can be told apart."""
        mean, deviation = self.normal
        low, high = ((end - mean) / deviation for end in self.ends)
        # The tail that is the shorter one keeps its digits.
        below, above = (-high, -low) if low > 0 else (low, high)
        inside = 0.5 * (math.erfc(-above / math.sqrt(2)) - math.erfc(-below / math.sqrt(2)))
        if not LEAST_INSIDE < inside <= 1:
            raise ValueError(f"less than {LEAST_INSIDE:g} of the distribution is in the range")
        return self


class Choice(Table):
    """One of several numbers, equally likely unless shares are given."""

    choice: Annotated[tuple[Number, ...], Strict(False), Field(min_length=1, max_length=1000)] = (
        Field(description="one or more numbers")
    )
    shares: Annotated[tuple[Positive, ...], Strict(False)] | None = Field(
        default=None, description="a share for each number, 1 in all"
    )

    @model_validator(mode="after")
    def _require_shares(self) -> Self:
        """Refuse shares that do not belong to the numbers."""
        if self.shares is None:
            return self
        if len(self.shares) != len(self.choice):
            raise ValueError(f"{len(self.choice)} numbers have {len(self.shares)} shares")
        if abs(sum(self.shares) - 1.0) > 1e-9:
            raise ValueError(f"the shares sum to {sum(self.shares):.10g}")
        return self


Distribution = float | tuple[float, float] | LogUniform | Normal | Choice

TABLES: dict[str, type[LogUniform | Normal | Choice]] = {
    "log_uniform": LogUniform,
    "normal": Normal,
    "choice": Choice,
}
"""Distributions that are tables, by the key that names them."""


@dataclass(frozen=True)
class Drawn:
    """Validator of a number or a distribution whose values are all within limits.

    Attributes
    ----------
    low, high : float
        Smallest and largest allowed value.
    beyond : bool
        Whether values have to be above `low`, and not only at least `low`.
    """

    low: float = -sys.float_info.max
    high: float = sys.float_info.max
    beyond: bool = False

    def __call__(self, value: object) -> Distribution:
        """Read a number, a range or a table of a distribution.

        One function does it all because an error message for a union of types would name its
        members.
        """
        distribution = _parsed(value)
        smallest, largest = limits(distribution)
        inside = smallest > self.low if self.beyond else smallest >= self.low
        if inside and largest <= self.high:
            return distribution
        if isinstance(distribution, Normal) and distribution.range is None:
            raise ValueError(
                f"without range = [low, high] its values are {smallest:g} to {largest:g}"
            )
        raise PydanticCustomError("distribution", "a value is outside the limits")


def _written(distribution: Distribution) -> float | tuple[float, float] | dict[str, object]:
    """Write a distribution as it stands in a scene's text."""
    if isinstance(distribution, Table):
        return distribution.model_dump(exclude_none=True)
    return distribution


_TEXT = PlainSerializer(_written)
AnyNumber = Annotated[Distribution, PlainValidator(Drawn()), _TEXT]
AtLeastZero = Annotated[Distribution, PlainValidator(Drawn(0.0)), _TEXT]
AboveZero = Annotated[Distribution, PlainValidator(Drawn(0.0, beyond=True)), _TEXT]
FromZeroToOne = Annotated[Distribution, PlainValidator(Drawn(0.0, 1.0)), _TEXT]


def _parsed(value: object) -> Distribution:
    """Turn TOML's number, array or table into a distribution."""
    if isinstance(value, LogUniform | Normal | Choice):
        return value
    if isinstance(value, dict):
        return _table(value)
    if isinstance(value, list | tuple):
        if len(value) != 2:
            raise PydanticCustomError("distribution", "not a range")
        low, high = (_number(limit) for limit in value)
        if low > high:
            raise ValueError(f"{low!r} is above {high!r}")
        if math.isinf(high - low):
            raise ValueError("the range is too wide")
        return low, high
    return _number(value)


def _table(value: dict[str, object]) -> Distribution:
    """Turn a table into the distribution that one of its keys names."""
    named = [table for name, table in TABLES.items() if name in value]
    if len(named) != 1:
        raise ValueError(f"give one of the keys {', '.join(TABLES)}")
    try:
        return named[0].model_validate(value)
    except ValidationError as error:
        fault = error.errors(include_url=False)[0]
        if fault["type"] == "value_error":
            raise ValueError(str(fault["ctx"]["error"])) from None
        key = str(fault["loc"][0])
        field = named[0].model_fields.get(key)
        if field is None:
            raise ValueError(
                f"{key} is unknown beside {next(iter(named[0].model_fields))}"
            ) from None
        raise ValueError(f"{key} is {field.description}") from None


def _number(value: object) -> float:
    """Return a finite number as a float."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise PydanticCustomError("distribution", "not a number")
    if not abs(value) <= sys.float_info.max:
        raise PydanticCustomError("distribution", "not a finite number")
    return float(value) + 0.0


def limits(distribution: Distribution) -> tuple[float, float]:
    """Return the smallest and the largest value of a distribution, equal for a fixed number."""
    match distribution:
        case LogUniform():
            return distribution.log_uniform
        case Normal():
            return distribution.ends
        case Choice():
            return min(distribution.choice), max(distribution.choice)
        case (low, high):
            return low, high
    return distribution, distribution


def is_drawn(distribution: Distribution) -> bool:
    """Tell whether the value is drawn rather than one fixed number."""
    return not isinstance(distribution, float)
