"""Numbers of a scene that are fixed or drawn: their notation in scenes, and their quantiles.

A single number is fixed. `[low, high]` is a uniform distribution. A table names one of the other
distributions: `{ log_uniform = [low, high] }`, `{ normal = [mean, deviation] }`, which is
truncated, or `{ choice = [...] }`. Quantiles turn numbers in [0, 1) into values. They use only
operations that all processors round alike, so that a scene has the same plan on every machine.
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

SMALLEST_SHARE = 1e-9  # a range has to hold more than this share of a normal distribution
# A normal distribution without a range ends at this number of deviations from its mean.
REACH = 3.0
LARGEST = sys.float_info.max  # largest number of double precision
DIGITS = 53  # binary digits of a random number in [0, 1)

# Number of intervals between the knots of a normal distribution. Its quantiles are exact at the
# knots, and linear between them.
INTERVALS = 2**16
# Significant decimal digits to which the quantiles at the knots are rounded. Processors agree on
# them.
SIGNIFICANT = 9


class Table(BaseModel):
    """A table of a scene, which refuses unknown keys and values of a wrong type.

    The description of a field says which values are allowed.
    """

    model_config = ConfigDict(
        extra="forbid", frozen=True, strict=True, allow_inf_nan=False
    )


def conflict(words: str) -> PydanticCustomError:
    """Make the error for keys of a table that contradict each other.

    Parameters
    ----------
    words : str
        The message: what is wrong, and what to do. The allowed values of a key are not added to it.

    Returns
    -------
    PydanticCustomError
        The error, which a validator raises.
    """
    return PydanticCustomError("conflict", words)


class Limits(NamedTuple):
    """The smallest and the largest number of a range, in the unit of the key."""

    smallest: float
    largest: float


def ascending(limits: tuple[T, T]) -> tuple[T, T]:
    """Return the limits of a range unchanged; raise ValueError unless they are in ascending order.

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
        If the lower limit is above the upper one, or their difference exceeds the largest number.
    """
    low, high = limits
    if low > high:  # type: ignore[operator]  # pydantic has checked that both are numbers
        raise ValueError(f"{low!r} is above {high!r}")
    if math.isinf(high - low):  # type: ignore[operator]
        raise ValueError("the range is too wide")
    return limits


# Adding 0.0 turns -0.0 into 0.0. The two are equal, and equal scenes must have equal texts.
Number = Annotated[float, AfterValidator(lambda number: number + 0.0)]
Positive = Annotated[Number, Field(gt=0)]
# A range is a tuple here and an array in TOML and JSON. Values are not converted otherwise.
Range = Annotated[tuple[T, T], Strict(False), AfterValidator(ascending)]


class TabulatedDistribution(Table):
    """A distribution that is a table in a scene."""

    @property
    def ends(self) -> Limits:
        """Smallest and largest number of the distribution."""
        raise NotImplementedError

    def quantiles(self, uniform: Values) -> Values:
        """Map each uniform number to the number of this distribution at the same probability.

        Parameters
        ----------
        uniform : ndarray, any shape
            Numbers in [0, 1).

        Returns
        -------
        ndarray, shape of uniform
            Numbers between the ends of the distribution, in the unit of the key.
        """
        raise NotImplementedError


class LogUniform(TabulatedDistribution):
    """A distribution of numbers whose logarithms are uniform."""

    log_uniform: Range[Positive] = Field(description="[low, high] with 0 < low <= high")

    @model_validator(mode="after")
    def _require_ratio(self) -> Self:
        """Refuse limits whose ratio is so large that `log_within` overflows."""
        low, high = self.log_uniform
        if math.isinf(math.sqrt(high) / math.sqrt(low)):
            raise ValueError("the range is too wide")
        return self

    @property
    def ends(self) -> Limits:
        """Smallest and largest number of the distribution."""
        return Limits(*self.log_uniform)

    def quantiles(self, uniform: Values) -> Values:
        """Map uniform numbers to numbers with uniform logarithms."""
        low, high = self.log_uniform
        return log_within(low, high, uniform)


class Normal(TabulatedDistribution):
    """A normal distribution that is truncated at both ends of a range."""

    normal: Annotated[tuple[Number, Positive], Strict(False)] = Field(
        description="[mean, deviation]"
    )
    range: Range[Number] | None = Field(default=None, description="[low, high]")

    @property
    def ends(self) -> Limits:
        """Ends of the range; by default `REACH` deviations below and above the mean."""
        if self.range is not None:
            return Limits(*self.range)
        mean, deviation = self.normal
        return Limits(mean - REACH * deviation, mean + REACH * deviation)

    @model_validator(mode="after")
    def _require_numbers_inside(self) -> Self:
        """Refuse a range with a very small share of the normal distribution.

        Rounding would make its quantiles equal.
        """
        mean, deviation = self.normal
        reduced = _reduced(mean, deviation, self.ends)
        share_below_largest = 0.5 * math.erfc(-reduced.limits.largest / math.sqrt(2))
        share_below_smallest = 0.5 * math.erfc(-reduced.limits.smallest / math.sqrt(2))
        inside = share_below_largest - share_below_smallest
        if not SMALLEST_SHARE < inside <= 1:  # also if `inside` is NaN
            raise ValueError(
                f"less than {SMALLEST_SHARE:g} of the distribution is in the range"
            )
        return self

    def quantiles(self, uniform: Values) -> Values:
        """Map uniform numbers to normally distributed ones, by interpolation between knots."""
        mean, deviation = self.normal
        ends = self.ends
        knots = _normal_knots(mean, deviation, ends.smallest, ends.largest)
        places = uniform * INTERVALS  # whole numbers are the indices of knots
        lower = places.astype(np.intp)  # index of the knot below each number
        rises = knots[lower + 1] - knots[lower]
        rises *= places - lower
        return np.clip(knots[lower] + rises, ends.smallest, ends.largest)


class Choice(TabulatedDistribution):
    """A distribution of several numbers, which are equally likely unless shares are given."""

    choice: Annotated[
        tuple[Number, ...], Strict(False), Field(min_length=1, max_length=1000)
    ] = Field(description="one or more numbers")
    shares: Annotated[tuple[Positive, ...], Strict(False)] | None = Field(
        default=None, description="a share for each number, 1 in all"
    )

    @model_validator(mode="after")
    def _require_shares(self) -> Self:
        """Refuse shares unless each number has one and they sum to 1."""
        if self.shares is None:
            return self
        if len(self.shares) != len(self.choice):
            raise ValueError(f"{len(self.choice)} numbers have {len(self.shares)} shares")
        if abs(sum(self.shares) - 1.0) > 1e-9:
            raise ValueError(f"the shares sum to {sum(self.shares):.10g}")
        return self

    @property
    def ends(self) -> Limits:
        """Smallest and largest number of the choice."""
        return Limits(min(self.choice), max(self.choice))

    def quantiles(self, uniform: Values) -> Values:
        """Map uniform numbers to the numbers of the choice.

        [0, 1) is divided into an interval for each number, in their order, as long as its share.
        """
        values = np.array(self.choice)
        shares = self.shares or (1.0 / len(values),) * len(values)
        # The last interval has no upper border, as the rounded sum of the shares may be below 1.
        borders = np.cumsum(shares)[:-1]
        intervals = np.searchsorted(borders, uniform, side="right")
        return np.asarray(values[intervals])


Distribution = float | tuple[float, float] | LogUniform | Normal | Choice

TABLES: dict[str, type[LogUniform | Normal | Choice]] = {
    "log_uniform": LogUniform,
    "normal": Normal,
    "choice": Choice,
}
"""Classes of the distributions that are tables, by the key that selects them."""

_RULES = ConfigDict(strict=True, allow_inf_nan=False)
_READERS: dict[str, TypeAdapter[Any]] = {
    **{name: TypeAdapter(table) for name, table in TABLES.items()},
    "range": TypeAdapter(Range[Number], config=_RULES),
    "number": TypeAdapter(Number, config=_RULES),
}
"""Pydantic's readers of a number, of a range, and of each table of `TABLES` by its key."""


def within(
    low: float = -LARGEST, high: float = LARGEST, *, open_below: bool = False
) -> PlainValidator:
    """Return the validator of a key whose value is a number or a distribution within limits.

    Parameters
    ----------
    low : float
        Lower limit of the values.
    high : float
        Upper limit of the values, which is allowed itself.
    open_below : bool
        Whether the lower limit is not allowed itself.

    Returns
    -------
    PlainValidator
        Pydantic's validator. It returns a `Distribution` for a number, a list, a table or a
        distribution, and raises ValueError or PydanticCustomError for any other value.
    """

    def validated(value: object) -> Distribution:
        """Return the distribution of a value of a scene, or raise if a limit is exceeded."""
        distribution = _read(value)
        smallest, largest = limits(distribution)
        is_high_enough = smallest > low if open_below else smallest >= low
        if not is_high_enough or largest > high:
            raise _beyond_limits(distribution)
        return distribution

    return PlainValidator(validated)


def _read(value: object) -> Distribution:
    """Make a distribution of a value of a scene.

    The errors say what a number, a range or the table in question allows. With a union of types,
    pydantic's errors would name the types instead.
    """
    if isinstance(value, LogUniform | Normal | Choice):
        return value
    key = _reader_of(value)
    try:
        distribution: Distribution = _READERS[key].validate_python(value)
    except ValidationError as error:
        raise _refusal_of(key, error) from None
    return distribution


def _reader_of(value: object) -> str:
    """Return the key in `_READERS` of the reader for a value.

    Raise ValueError for a table that has none or several of the keys of `TABLES`.
    """
    if isinstance(value, list | tuple):
        return "range"
    if not isinstance(value, dict):
        return "number"
    keys = [key for key in TABLES if key in value]
    if len(keys) != 1:
        raise ValueError(f"give one of the keys {', '.join(TABLES)}")
    return keys[0]


def _beyond_limits(distribution: Distribution) -> Exception:
    """Make the error for a distribution that has values beyond the limits of its key."""
    # The ends of a normal distribution without a range are not in the scene, so they are named.
    if isinstance(distribution, Normal) and distribution.range is None:
        smallest, largest = distribution.ends
        return ValueError(
            f"without range = [low, high] its values are {smallest:g} to {largest:g}"
        )
    return PydanticCustomError("distribution", "a value is outside the limits")


def _refusal_of(key: str, error: ValidationError) -> Exception:
    """Turn pydantic's error into one that says what is allowed.

    `key` is the notation that was read: "number", "range" or a key of `TABLES`. Only the first
    fault that pydantic reports is used.
    """
    fault = error.errors(include_url=False)[0]
    # A validator of this module has raised the error, in its own words.
    if fault["type"] == "value_error":
        return ValueError(str(fault["ctx"]["error"]))
    if key not in TABLES:
        return PydanticCustomError("distribution", "not a finite number or a range")
    name = str(fault["loc"][0])  # key of the table
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
        Both values, in the unit of the key. They are equal for a fixed number.
    """
    if isinstance(distribution, TabulatedDistribution):
        return distribution.ends
    if isinstance(distribution, tuple):
        return Limits(*distribution)
    return Limits(distribution, distribution)


def is_drawn(distribution: Distribution) -> bool:
    """Tell whether a distribution is a range or a table rather than one fixed number.

    Parameters
    ----------
    distribution : Distribution
        A number, a range or a distribution of a scene.

    Returns
    -------
    bool
        True for a range or a table, even if its two ends are equal.
    """
    # Fixed numbers are floats, also whole ones.
    return not isinstance(distribution, float)


def quantiles(distribution: Distribution, uniform: Values) -> Values:
    """Map each uniform number to the value of a distribution at the same probability.

    Parameters
    ----------
    distribution : Distribution
        A number, a range or a distribution of a scene.
    uniform : ndarray, any shape
        Numbers in [0, 1).

    Returns
    -------
    ndarray, shape of uniform
        Values within the limits of the distribution, in the unit of the key.
    """
    if isinstance(distribution, TabulatedDistribution):
        return distribution.quantiles(uniform)
    if isinstance(distribution, tuple):
        low, high = distribution
        return low + (high - low) * uniform  # rounding cannot exceed the upper end
    return np.full(uniform.shape, distribution)


def log_within(low: float, high: float, uniform: Values) -> Values:
    """Map uniform numbers to numbers with uniform logarithms, with equal bits on every processor.

    A number starts as `low` and is multiplied by the 2^k-th root of high / low if the k-th binary
    digit of the uniform number is 1. Logarithms and exponentials are not used, because processors
    round them differently.

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
        Values from `low` to `high`, in the unit of both.
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
    np.minimum(values, high, out=values)  # rounding may exceed the upper end
    return values


class _Reduced(NamedTuple):
    """The range of a normal distribution, in deviations from its mean."""

    limits: Limits  # ends of the range, with the signs exchanged if it is mirrored [1]
    is_mirrored: bool  # whether the range was above the mean and is mirrored at the mean


def _reduced(mean: float, deviation: float, ends: Limits) -> _Reduced:
    """Return a range in deviations from the mean; mirror it at the mean if it is above the mean.

    Probabilities of the lower tail are small numbers, which keep their digits; probabilities of the
    upper tail are rounded to 1.
    """
    smallest = (ends.smallest - mean) / deviation
    largest = (ends.largest - mean) / deviation
    if smallest > 0:
        return _Reduced(Limits(-largest, -smallest), is_mirrored=True)
    return _Reduced(Limits(smallest, largest), is_mirrored=False)


@functools.lru_cache(maxsize=16)
def _normal_knots(mean: float, deviation: float, low: float, high: float) -> Values:
    """Return the quantiles of a normal distribution that is truncated to low and high.

    The `INTERVALS` + 1 quantiles are at equal steps of probability, in the unit of the mean. In
    deviations from the mean they are rounded to the digits on which all processors agree.
    """
    from scipy.special import ndtr, ndtri

    reduced = _reduced(mean, deviation, Limits(low, high))
    first, last = reduced.limits
    probabilities = np.linspace(ndtr(first), ndtr(last), INTERVALS + 1)
    knots = ndtri(probabilities)
    # The ends are known, and rounding in the probabilities would move them.
    knots[0] = first
    knots[-1] = last
    if reduced.is_mirrored:
        knots = -knots[::-1]
    rounded = np.array([float(f"{knot:.{SIGNIFICANT}g}") for knot in knots.tolist()])
    return np.clip(mean + deviation * rounded, low, high)
