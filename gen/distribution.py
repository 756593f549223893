"""Numbers of a scene that are fixed or drawn: how they are written, and their quantiles.

A number is fixed, `[low, high]` is uniform, and a table names every other distribution:
`{ log_uniform = [low, high] }`, `{ normal = [mean, deviation] }`, which is truncated, and
`{ choice = [...] }`. Quantiles turn numbers in [0, 1) into values; their operations are rounded
alike on every processor, so that a plan is the same everywhere.
"""

import functools
import math
import sys
from typing import Annotated, Any, Self, TypeVar

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    PlainValidator,
    SerializeAsAny,
    Strict,
    TypeAdapter,
    ValidationError,
    model_validator,
)
from pydantic_core import PydanticCustomError

from gen.arrays import Values

T = TypeVar("T")

LEAST_INSIDE = 1e-9  # smallest share of a normal distribution that its range may hold
REACH = 3.0  # deviations from the mean at which a normal distribution ends unless a range is given
LARGEST = sys.float_info.max  # number
DIGITS = 53  # binary digits of a random number in [0, 1)

KNOTS = 2**16  # intervals inside which a normal distribution's quantiles are linear
SIGNIFICANT = (
    9  # decimal digits of the quantiles at their ends, on which processors agree
)


class Table(BaseModel):
    """Rules for every table of a scene; a field's description says which values are allowed."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, strict=True, allow_inf_nan=False
    )


def conflict(words: str) -> PydanticCustomError:
    """Return the error for keys that do not go together; no allowed values are told."""
    return PydanticCustomError("conflict", words)


def ascending(limits: tuple[T, T]) -> tuple[T, T]:
    """Refuse a range whose lower limit is above the upper one, or whose width no number holds."""
    low, high = limits
    if low > high:  # type: ignore[operator]  # pydantic has made both numbers
        raise ValueError(f"{low!r} is above {high!r}")
    if math.isinf(high - low):  # type: ignore[operator]
        raise ValueError("the range is too wide")
    return limits


# -0.0 becomes 0.0: the two are equal, and equal scenes must have equal texts.
Number = Annotated[float, AfterValidator(lambda number: number + 0.0)]
Positive = Annotated[Number, Field(gt=0)]
# TOML and JSON have arrays where the models have tuples: this conversion alone is allowed.
Range = Annotated[tuple[T, T], Strict(False), AfterValidator(ascending)]


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

    @property
    def ends(self) -> tuple[float, float]:
        """Smallest and largest number."""
        return self.log_uniform

    def quantiles(self, uniform: Values) -> Values:
        """Map numbers in [0, 1) to numbers of this distribution."""
        return log_within(*self.log_uniform, uniform)


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
        inside = 0.5 * (
            math.erfc(-above / math.sqrt(2)) - math.erfc(-below / math.sqrt(2))
        )
        if not LEAST_INSIDE < inside <= 1:
            raise ValueError(
                f"less than {LEAST_INSIDE:g} of the distribution is in the range"
            )
        return self

    def quantiles(self, uniform: Values) -> Values:
        """Map numbers in [0, 1) to numbers of this distribution, linearly between its knots."""
        knots = _normal_knots(*self.normal, *self.ends)
        places = uniform * KNOTS
        left = places.astype(np.intp)
        steps = knots[left + 1] - knots[left]
        steps *= places - left
        return np.clip(knots[left] + steps, *self.ends)


class Choice(Table):
    """One of several numbers, equally likely unless shares are given."""

    choice: Annotated[
        tuple[Number, ...], Strict(False), Field(min_length=1, max_length=1000)
    ] = Field(description="one or more numbers")
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

    @property
    def ends(self) -> tuple[float, float]:
        """Smallest and largest number."""
        return min(self.choice), max(self.choice)

    def quantiles(self, uniform: Values) -> Values:
        """Map numbers in [0, 1) to numbers of this distribution."""
        values = np.array(self.choice)
        shares = self.shares or (1.0 / len(values),) * len(values)
        # The last number takes the rest: rounded shares cannot leave a gap below 1.
        return np.asarray(
            values[np.searchsorted(np.cumsum(shares)[:-1], uniform, side="right")]
        )


Distribution = float | tuple[float, float] | LogUniform | Normal | Choice

TABLES: dict[str, type[LogUniform | Normal | Choice]] = {
    "log_uniform": LogUniform,
    "normal": Normal,
    "choice": Choice,
}
"""Distributions that are tables, by the key that names them."""

_RULES = ConfigDict(strict=True, allow_inf_nan=False)
_READERS: dict[str, TypeAdapter[Any]] = {
    **{name: TypeAdapter(table) for name, table in TABLES.items()},
    "range": TypeAdapter(Range[Number], config=_RULES),
    "number": TypeAdapter(Number, config=_RULES),
}
"""What reads a number, an array, and each table."""


def within(
    low: float = -LARGEST, high: float = LARGEST, *, beyond: bool = False
) -> PlainValidator:
    """Read a number or a distribution whose values are all within limits, or `beyond` the lower."""

    def read(
        value: object,
    ) -> Distribution:  # errors of a union of types would name its members
        distribution: Distribution
        if isinstance(value, LogUniform | Normal | Choice):
            distribution = value
        else:
            keys = ["range" if isinstance(value, list | tuple) else "number"]
            if isinstance(value, dict):
                keys = [name for name in TABLES if name in value]
            if len(keys) != 1:
                raise ValueError(f"give one of the keys {', '.join(TABLES)}")
            try:
                distribution = _READERS[keys[0]].validate_python(value)
            except ValidationError as error:
                raise _refusal(keys[0], error) from None
        smallest, largest = limits(distribution)
        if (smallest > low if beyond else smallest >= low) and largest <= high:
            return distribution
        if isinstance(distribution, Normal) and distribution.range is None:
            raise ValueError(
                f"without range = [low, high] its values are {smallest:g} to {largest:g}"
            )
        raise PydanticCustomError("distribution", "a value is outside the limits")

    return PlainValidator(read)


def _refusal(key: str, error: ValidationError) -> Exception:
    """Return the error for a number, a range or a table that breaks its rules, in its words."""
    fault = error.errors(include_url=False)[0]
    if fault["type"] == "value_error":
        return ValueError(str(fault["ctx"]["error"]))
    if key not in TABLES:
        return PydanticCustomError("distribution", "not a finite number or a range")
    inner = str(fault["loc"][0])
    field = TABLES[key].model_fields.get(inner)
    said = f"is {field.description}" if field else f"is unknown beside {key}"
    return ValueError(f"{inner} {said}")


AnyNumber = Annotated[Distribution, within(), SerializeAsAny()]
AtLeastZero = Annotated[Distribution, within(0.0), SerializeAsAny()]
SPANNED = (
    "two finite numbers [low, high] with 0 <= low <= high, one number, or a distribution"
)
AboveZero = Annotated[Distribution, within(0.0, beyond=True), SerializeAsAny()]
FromZeroToOne = Annotated[Distribution, within(0.0, 1.0), SerializeAsAny()]


def limits(distribution: Distribution) -> tuple[float, float]:
    """Return the smallest and the largest value of a distribution, equal for a fixed number."""
    if isinstance(distribution, Table):
        return distribution.ends
    return (
        distribution if isinstance(distribution, tuple) else (distribution, distribution)
    )


def is_drawn(distribution: Distribution) -> bool:
    """Tell whether the value is drawn rather than one fixed number."""
    return not isinstance(distribution, float)


def quantiles(distribution: Distribution, uniform: Values) -> Values:
    """Map numbers in [0, 1) to the values of a distribution, which are within its limits."""
    if isinstance(distribution, Table):
        return distribution.quantiles(uniform)
    if isinstance(distribution, tuple):
        low, high = distribution
        return low + (high - low) * uniform  # rounding cannot exceed the upper end
    return np.full(uniform.shape, distribution)


def log_within(low: float, high: float, uniform: Values) -> Values:
    """Map numbers in [0, 1) logarithmically to [low, high], alike on every processor.

    Each binary digit multiplies by a root of high / low: logarithms and exponentials may differ.
    """
    values = np.full(uniform.shape, low)
    factor = math.sqrt(high) / math.sqrt(low)
    rest = uniform.copy()
    for _ in range(DIGITS):
        rest *= 2.0
        digit = rest >= 1.0
        values[digit] *= factor
        rest -= digit
        factor = math.sqrt(factor)
    np.minimum(values, high, out=values)
    return values


@functools.lru_cache(maxsize=16)
def _normal_knots(mean: float, deviation: float, low: float, high: float) -> Values:
    """Compute quantiles at equal steps of probability, rounded to what all processors agree on."""
    from scipy.special import ndtr, ndtri

    # In the lower tail probabilities keep their digits: a range above the mean is turned over.
    below, above = (low - mean) / deviation, (high - mean) / deviation
    turned = below > 0
    first, last = (-above, -below) if turned else (below, above)
    shares = np.linspace(ndtr(first), ndtr(last), KNOTS + 1)
    reduced = ndtri(shares)
    reduced[0], reduced[-1] = first, last
    if turned:
        reduced = -reduced[::-1]
    rounded = np.array([float(f"{value:.{SIGNIFICANT}g}") for value in reduced.tolist()])
    return np.clip(mean + deviation * rounded, low, high)
