"""Numbers of a scene that are fixed or drawn: how they are written, and their quantiles.

A number is fixed, `[low, high]` is uniform, and a table names every other distribution:
`{ log_uniform = [low, high] }`, `{ normal = [mean, deviation] }`, which is truncated, and
`{ choice = [...] }`. Quantiles turn numbers in [0, 1) into values; their operations are rounded
alike on every processor, so that a plan is the same everywhere.
"""

import functools
import math
import sys
from typing import Annotated, Any, NamedTuple, Self, TypeVar

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

SMALLEST_SHARE = 1e-9  # smallest share of a normal distribution that its range may hold
REACH = 3.0  # deviations from the mean at which a normal distribution ends unless a range is given
LARGEST = sys.float_info.max  # largest number
DIGITS = 53  # binary digits of a random number in [0, 1)

KNOTS = 2**16  # intervals inside which a normal distribution's quantiles are linear
# decimal digits of the quantiles at their ends, on which processors agree
SIGNIFICANT = 9


class Table(BaseModel):
    """Rules for every table of a scene; a field's description says which values are allowed."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, strict=True, allow_inf_nan=False
    )


def conflict(words: str) -> PydanticCustomError:
    """Return the error for keys of a table that do not go together.

    Parameters
    ----------
    words : str
        What is wrong, and what to do. The message is these words alone, without the values that a
        key allows.

    Returns
    -------
    PydanticCustomError
        The error, for a validator to raise.
    """
    return PydanticCustomError("conflict", words)


class Limits(NamedTuple):
    """Both ends of a range of numbers, in the unit of the key."""

    smallest: float
    largest: float


def ascending(limits: tuple[T, T]) -> tuple[T, T]:
    """Return a range, or refuse it if it is not one.

    Parameters
    ----------
    limits : pair of number
        The lower and the upper limit.

    Returns
    -------
    pair of number
        The same limits.

    Raises
    ------
    ValueError
        If the lower limit is above the upper one, or their distance is beyond the largest number.
    """
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


class TabulatedDistribution(Table):
    """A distribution that a scene writes as a table."""

    @property
    def ends(self) -> Limits:
        """Smallest and largest number."""
        raise NotImplementedError

    def quantiles(self, uniform: Values) -> Values:
        """Map uniform numbers to numbers of this distribution, each by itself.

        Parameters
        ----------
        uniform : ndarray, any shape
            Numbers in [0, 1).

        Returns
        -------
        ndarray, shape of uniform
            Numbers from one end to the other, in the unit of the key.
        """
        raise NotImplementedError


class LogUniform(TabulatedDistribution):
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
    def ends(self) -> Limits:
        """Smallest and largest number."""
        return Limits(*self.log_uniform)

    def quantiles(self, uniform: Values) -> Values:
        """Map uniform numbers so that their logarithms are uniform."""
        low, high = self.log_uniform
        return log_within(low, high, uniform)


class Normal(TabulatedDistribution):
    """Normally distributed numbers, truncated at both ends of a range."""

    normal: Annotated[tuple[Number, Positive], Strict(False)] = Field(
        description="[mean, deviation]"
    )
    range: Range[Number] | None = Field(default=None, description="[low, high]")

    @property
    def ends(self) -> Limits:
        """Smallest and largest number: those of the range, or some deviations from the mean."""
        if self.range is not None:
            return Limits(*self.range)
        mean, deviation = self.normal
        return Limits(mean - REACH * deviation, mean + REACH * deviation)

    @model_validator(mode="after")
    def _require_numbers_inside(self) -> Self:
        """Refuse ends between which a normal distribution has no numbers that can be told apart."""
        reduced = _reduced(*self.normal, self.ends)
        share_below_largest = 0.5 * math.erfc(-reduced.limits.largest / math.sqrt(2))
        share_below_smallest = 0.5 * math.erfc(-reduced.limits.smallest / math.sqrt(2))
        inside = share_below_largest - share_below_smallest
        if not SMALLEST_SHARE < inside <= 1:
            raise ValueError(
                f"less than {SMALLEST_SHARE:g} of the distribution is in the range"
            )
        return self

    def quantiles(self, uniform: Values) -> Values:
        """Map uniform numbers to normally distributed ones, linearly between knots."""
        mean, deviation = self.normal
        ends = self.ends
        knots = _normal_knots(mean, deviation, ends.smallest, ends.largest)
        places = uniform * KNOTS
        lower = places.astype(np.intp)  # index of the knot below each number
        steps = knots[lower + 1] - knots[lower]
        steps *= places - lower
        return np.clip(knots[lower] + steps, ends.smallest, ends.largest)


class Choice(TabulatedDistribution):
    """One of several numbers, equally likely unless shares are given."""

    choice: Annotated[
        tuple[Number, ...], Strict(False), Field(min_length=1, max_length=1000)
    ] = Field(description="one or more numbers")
    shares: Annotated[tuple[Positive, ...], Strict(False)] | None = Field(
        default=None, description="a share for each number, 1 in all"
    )

    @model_validator(mode="after")
    def _require_shares(self) -> Self:
        """Refuse shares unless there is one for each number, and they sum to 1."""
        if self.shares is None:
            return self
        if len(self.shares) != len(self.choice):
            raise ValueError(f"{len(self.choice)} numbers have {len(self.shares)} shares")
        if abs(sum(self.shares) - 1.0) > 1e-9:
            raise ValueError(f"the shares sum to {sum(self.shares):.10g}")
        return self

    @property
    def ends(self) -> Limits:
        """Smallest and largest number."""
        return Limits(min(self.choice), max(self.choice))

    def quantiles(self, uniform: Values) -> Values:
        """Map uniform numbers to the choices, in their order and by their shares."""
        values = np.array(self.choice)
        shares = self.shares or (1.0 / len(values),) * len(values)
        # No upper border for the last number: rounded shares cannot leave a gap below 1.
        borders = np.cumsum(shares)[:-1]
        return np.asarray(values[np.searchsorted(borders, uniform, side="right")])


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
"""Pydantic's readers of a number, a range, and each table by the key that names it."""


def within(
    low: float = -LARGEST, high: float = LARGEST, *, open_below: bool = False
) -> PlainValidator:
    """Return the validator of a key that takes a number or a distribution within limits.

    Parameters
    ----------
    low : float
        Smallest value that the distribution may have.
    high : float
        Largest value that the distribution may have.
    open_below : bool
        Whether all values must be above `low`, rather than at least `low`.

    Returns
    -------
    PlainValidator
        Pydantic's validator. It makes a `Distribution` of a number, a list, a table or a
        distribution, and refuses anything else by ValueError or PydanticCustomError.
    """

    def read(value: object) -> Distribution:
        distribution = _read(value)
        smallest, largest = limits(distribution)
        is_high_enough = smallest > low if open_below else smallest >= low
        if not is_high_enough or largest > high:
            raise _beyond_limits(distribution)
        return distribution

    return PlainValidator(read)


def _read(value: object) -> Distribution:
    """Make a distribution of a value of a scene; errors tell what is wrong with its kind of value.

    A union of types would be shorter, but pydantic's errors would name the types.
    """
    if isinstance(value, LogUniform | Normal | Choice):
        return value
    key = _reader_of(value)
    try:
        distribution: Distribution = _READERS[key].validate_python(value)
    except ValidationError as error:
        raise _refusal(key, error) from None
    return distribution


def _reader_of(value: object) -> str:
    """Return the key in `_READERS` of a value's reader; refuse a table unless it names one kind."""
    if isinstance(value, list | tuple):
        return "range"
    if not isinstance(value, dict):
        return "number"
    names = [name for name in TABLES if name in value]
    if len(names) != 1:
        raise ValueError(f"give one of the keys {', '.join(TABLES)}")
    return names[0]


def _beyond_limits(distribution: Distribution) -> Exception:
    """Return the error for a distribution that has values beyond the limits of its key."""
    if isinstance(distribution, Normal) and distribution.range is None:
        smallest, largest = distribution.ends
        return ValueError(
            f"without range = [low, high] its values are {smallest:g} to {largest:g}"
        )
    return PydanticCustomError("distribution", "a value is outside the limits")


def _refusal(key: str, error: ValidationError) -> Exception:
    """Turn pydantic's error for a number, a range or a table into one that says what is allowed."""
    fault = error.errors(include_url=False)[0]
    if fault["type"] == "value_error":
        return ValueError(str(fault["ctx"]["error"]))
    if key not in TABLES:
        return PydanticCustomError("distribution", "not a finite number or a range")
    name = str(fault["loc"][0])
    field = TABLES[key].model_fields.get(name)
    if field is None:
        return ValueError(f"{name} is unknown beside {key}")
    return ValueError(f"{name} is {field.description}")


AnyNumber = Annotated[Distribution, within(), SerializeAsAny()]
AtLeastZero = Annotated[Distribution, within(0.0), SerializeAsAny()]
SPANNED = (
    "two finite numbers [low, high] with 0 <= low <= high, one number, or a distribution"
)
AboveZero = Annotated[Distribution, within(0.0, open_below=True), SerializeAsAny()]
FromZeroToOne = Annotated[Distribution, within(0.0, 1.0), SerializeAsAny()]


def limits(distribution: Distribution) -> Limits:
    """Return the smallest and the largest value of a distribution.

    Parameters
    ----------
    distribution : Distribution
        A number, a range or a distribution of a scene.

    Returns
    -------
    Limits
        Both values, which are equal for a fixed number.
    """
    if isinstance(distribution, TabulatedDistribution):
        return distribution.ends
    if isinstance(distribution, tuple):
        return Limits(*distribution)
    return Limits(distribution, distribution)


def is_drawn(distribution: Distribution) -> bool:
    """Tell whether the value is drawn rather than one fixed number.

    Parameters
    ----------
    distribution : Distribution
        A number, a range or a distribution of a scene.

    Returns
    -------
    bool
        True for ranges and tables, also where both ends are equal.
    """
    return not isinstance(distribution, float)


def quantiles(distribution: Distribution, uniform: Values) -> Values:
    """Map uniform numbers to the values of a distribution, each by itself.

    Parameters
    ----------
    distribution : Distribution
        A number, a range or a distribution of a scene.
    uniform : ndarray, any shape
        Numbers in [0, 1).

    Returns
    -------
    ndarray, shape of uniform
        Values within the limits of the distribution, in its unit.
    """
    if isinstance(distribution, TabulatedDistribution):
        return distribution.quantiles(uniform)
    if isinstance(distribution, tuple):
        low, high = distribution
        return low + (high - low) * uniform  # rounding cannot exceed the upper end
    return np.full(uniform.shape, distribution)


def log_within(low: float, high: float, uniform: Values) -> Values:
    """Map uniform numbers to numbers whose logarithms are uniform, alike on every processor.

    Each binary digit of a uniform number multiplies by a root of high / low. Logarithms and
    exponentials, which processors round differently, are not used.

    Parameters
    ----------
    low : float
        Smallest value, above 0.
    high : float
        Largest value, at least `low`.
    uniform : ndarray, any shape
        Numbers in [0, 1).

    Returns
    -------
    ndarray, shape of uniform
        Values from low to high, in the unit of both.
    """
    values = np.full(uniform.shape, low)
    factor = math.sqrt(high) / math.sqrt(low)
    remainder = uniform.copy()
    for _ in range(DIGITS):
        remainder *= 2.0
        digit = remainder >= 1.0
        values[digit] *= factor
        remainder -= digit
        factor = math.sqrt(factor)
    np.minimum(values, high, out=values)
    return values


class _Reduced(NamedTuple):
    """The range of a normal distribution in deviations from its mean."""

    limits: Limits
    is_mirrored: bool  # whether the range was above the mean, and is turned over


def _reduced(mean: float, deviation: float, ends: Limits) -> _Reduced:
    """Return a range in deviations from the mean, turned over if it is in the upper tail.

    In the lower tail probabilities keep their digits.
    """
    smallest = (ends.smallest - mean) / deviation
    largest = (ends.largest - mean) / deviation
    if smallest > 0:
        return _Reduced(Limits(-largest, -smallest), is_mirrored=True)
    return _Reduced(Limits(smallest, largest), is_mirrored=False)


@functools.lru_cache(maxsize=16)
def _normal_knots(mean: float, deviation: float, low: float, high: float) -> Values:
    """Compute the quantiles of a normal distribution from low to high at its knots.

    The `KNOTS` + 1 quantiles are at equal steps of probability, and rounded to the digits on which
    all processors agree.
    """
    from scipy.special import ndtr, ndtri

    reduced = _reduced(mean, deviation, Limits(low, high))
    first, last = reduced.limits
    shares = np.linspace(ndtr(first), ndtr(last), KNOTS + 1)
    knots = ndtri(shares)
    knots[0] = first
    knots[-1] = last
    if reduced.is_mirrored:
        knots = -knots[::-1]
    rounded = np.array([float(f"{knot:.{SIGNIFICANT}g}") for knot in knots.tolist()])
    return np.clip(mean + deviation * rounded, low, high)
