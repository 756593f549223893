"""Checks of arguments: arrays of real numbers, and single numbers in a range.

`bem`, `learn` and `asperity` refuse the same values with the same words. An error is a ValueError
of one line, with the name of the argument, the value that was passed and the values that are
allowed. No check casts a value: a complex number is refused, not reduced to its real part, and a
text is no number even if it consists of digits.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from bem.arrays import Values

# Upper bound of the loads and features that can be computed [any unit]. The solver's steps and the
# models' trees hold numbers, and sums of a few of them, in single precision, which ends at 3.4e38.
LARGEST = 1e38

# Largest number of characters of a value in a message.
LONGEST = 60


class Range(NamedTuple):
    """The numbers that an argument may have.

    Attributes
    ----------
    low, high : float
        Bounds, both excluded.
    words : str
        Wording of the range in messages, which follows "must be".
    integer : bool
        Whether numbers have to be whole.
    """

    low: float
    high: float
    words: str
    integer: bool = False


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
        If an entry is masked. A masked array without any masked entry is allowed.
    """
    rows = [value]
    if isinstance(value, list | tuple):
        rows = list(value)
    if any(np.ma.is_masked(row) for row in rows):
        raise ValueError(f"{name} are masked in places: fill or crop them")


def real_array(name: str, value: Any) -> Values:
    """Copy an array of real numbers in double precision.

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
        If entries are masked, rows have unequal lengths, or entries are complex, logical, dates,
        texts or objects. Whole numbers beyond 64 bits are objects.
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
    """Check a real number in a range.

    Parameters
    ----------
    name : str
        Name of the argument.
    value : float
        What the caller passed: a number, or an array without dimensions if the range is not of
        whole numbers.
    allowed : Range
        The range of the number.

    Returns
    -------
    float or int
        The number; an int if the range has whole numbers only.

    Raises
    ------
    ValueError
        If the value is no real number, or not in the range. A text is no number, even if it
        consists of digits.
    """
    # Numbers without a dtype are judged by float().
    kind = getattr(getattr(value, "dtype", None), "kind", "f")
    number = math.nan
    if kind in "fiu" and not isinstance(value, bool | str | bytes | bytearray):
        try:
            number = float(value)
        except (TypeError, ValueError, OverflowError):
            number = math.nan
    inside = allowed.low < number < allowed.high
    if not inside or (allowed.integer and not isinstance(value, int | np.integer)):
        raise ValueError(f"{name} = {shown(value)}: must be {allowed.words}")
    return int(value) if allowed.integer else number


def shown(value: Any) -> str:
    """Return a value as a short text of one line for a message.

    Parameters
    ----------
    value : object
        Any value.

    Returns
    -------
    str
        Its representation. If it is longer than `LONGEST` characters, its middle is replaced by
        "...", so that it has fewer. A whole number of thousands of digits is described in words.
    """
    try:
        text = " ".join(repr(value).split())
    except ValueError:  # Python writes no whole number of more than 4,300 digits
        return "a whole number of thousands of digits"
    if len(text) <= LONGEST:
        return text
    from_end = LONGEST // 4
    return f"{text[: LONGEST // 2]}...{text[-from_end:]}"
