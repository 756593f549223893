"""Checks of what a caller passes in: arrays of real numbers, and single numbers in a range.

`bem` and `learn` refuse the same things in the same words. An error is a ValueError of one line,
with the name of the argument, what was passed and what is allowed. Nothing is cast on the way: a
complex number keeps no real part alone, and a text is no number.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from bem.arrays import Values

LARGEST = 1e38
"""End of the loads and the features that can be computed: the solver's steps and the models' trees
hold numbers, and sums of a few, in single precision, which ends at 3.4e38."""

LONGEST = 60  # most characters of a value in a message


class Range(NamedTuple):
    """The numbers that an argument may have.

    Attributes
    ----------
    low, high : float
        Bounds, both excluded.
    words : str
        Their wording in messages.
    whole : bool
        Whether it has to be a whole number.
    """

    low: float
    high: float
    words: str
    whole: bool = False


def refuse_masked(name: str, value: Any) -> None:
    """Refuse an array, or rows of arrays, of which some entries are masked.

    Parameters
    ----------
    name : str
        Name of the argument.
    value : array_like
        What the caller passed.

    Raises
    ------
    ValueError
        If an entry is masked. An array whose mask hides nothing is as any other.
    """
    rows = value if isinstance(value, list | tuple) else [value]
    if any(np.ma.is_masked(row) for row in rows):
        raise ValueError(f"{name} are masked in places: fill or crop them")


def real_array(name: str, value: Any) -> Values:
    """Return a copy of an array of real numbers in double precision.

    Parameters
    ----------
    name : str
        Name of the argument, a plural as "heights".
    value : array_like
        What the caller passed, of any shape.

    Returns
    -------
    ndarray
        The numbers, contiguous; NaN and infinities are kept.

    Raises
    ------
    ValueError
        If entries are masked, or rows have unequal lengths; or if the numbers are complex, logical,
        dates, texts or objects, as whole numbers beyond 64 bits are.
    """
    refuse_masked(name, value)
    try:
        array = np.asarray(value)
    except (ValueError, TypeError, OverflowError):
        raise ValueError(
            f"{name} have rows of unequal length: an array of numbers is needed"
        ) from None
    if array.dtype.kind not in "fiu":
        raise ValueError(f"{name} are of type {array.dtype}: real numbers are needed")
    with np.errstate(over="ignore"):  # long doubles beyond the range become infinite
        return np.array(array, dtype=np.float64, order="C")


def real_number(name: str, value: Any, allowed: Range) -> float | int:
    """Return a real number in a range.

    Parameters
    ----------
    name : str
        Name of the argument.
    value : float
        What the caller passed: a number, or an array without dimensions.
    allowed : Range
        The numbers that it may have.

    Returns
    -------
    float or int
        The number; an int if the range is one of whole numbers.

    Raises
    ------
    ValueError
        If it is no real number, or not in the range. A text is none, even one of digits.
    """
    kind = getattr(getattr(value, "dtype", None), "kind", "f")
    number = math.nan
    if kind in "fiu" and not isinstance(value, bool | str | bytes | bytearray):
        try:
            number = float(value)
        except (TypeError, ValueError, OverflowError):
            number = math.nan
    inside = allowed.low < number < allowed.high
    if not inside or (allowed.whole and not isinstance(value, int | np.integer)):
        raise ValueError(f"{name} = {shown(value)}: must be {allowed.words}")
    return int(value) if allowed.whole else number


def shown(value: Any) -> str:
    """Return a value as a short text for a message."""
    try:
        text = " ".join(repr(value).split())
    except ValueError:  # Python writes no whole number of more than 4,300 digits
        return "a whole number of thousands of digits"
    if len(text) <= LONGEST:
        return text
    return f"{text[: LONGEST // 2]}...{text[-LONGEST // 4 :]}"
