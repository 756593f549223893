"""Numbers as users type them: read in this one place, so that they are refused in one way."""

import math

from gen.runtime.errors import InputError

MOST = 100_000
"""Values that one option may stand for."""

DIGITS = 18
"""Digits of a whole number at most: enough for 2^59, few enough for any machine."""

MAGNITUDES = (1e-60, 1e60)
"""Between these are all useful lengths [um] and moduli [MPa]: squares, products and ratios of them
are numbers still."""


def whole(text: str) -> int | None:
    """Return the whole number that a text spells in decimal digits, None if there is none.

    Parameters
    ----------
    text : digits, blanks around them allowed
    """
    digits = text.strip()
    good = digits.isascii() and digits.isdecimal() and len(digits) <= DIGITS
    return int(digits) if good else None


def rows_from(text: str) -> tuple[int, int] | None:
    """Return the first row and one past the last from "100:200"; None from nothing.

    Raises
    ------
    InputError
        If the text is anything else.
    """
    if not text:
        return None
    first, _, last = text.partition(":")
    rows = whole(first), whole(last)
    if rows[0] is None or rows[1] is None:
        raise InputError(f"--rows {shown(text)}: give two row numbers, as 0:1000")
    return rows[0], rows[1]


def values_from(text: str, option: str, advice: str) -> list[float]:
    """Return the numbers of "5", "1,2,5" or "1:100:20", which is start, stop and count.

    Parameters
    ----------
    text : numbers, or several with commas
    option : its name in messages
    advice : what is allowed, in messages

    Raises
    ------
    InputError
        If part of the text is no number, or stands for more than `MOST` of them.
    """
    found: list[float] = []
    for part in text.split(","):
        spelt = _series(part)
        if spelt is None:
            raise InputError(f"{option} {shown(text)}: {advice}")
        start, stop, count = spelt
        if len(found) + count > MOST:
            raise InputError(f"{option} {shown(text)}: give {MOST:,} values at most")
        found += [start] if count == 1 else _even(start, stop, count)
    return found


def shown(text: str, most: int = 60) -> str:
    """Quote what a user has typed, and only the beginning of what nobody has typed by hand."""
    return repr(text) if len(text) <= most else f"{text[:most]!r}... ({len(text)} characters)"


def magnitude(value: float) -> bool:
    """Whether a length, load or modulus is a number above 0 that can be computed with."""
    return MAGNITUDES[0] < value < MAGNITUDES[1]


def _series(text: str) -> tuple[float, float, int] | None:
    """Return start, stop and count, 1 of a single number; None if the text is neither."""
    parts = text.split(":")
    count = whole(parts[2]) if len(parts) == 3 else 1
    try:
        ends = [float(part) for part in parts[:2]]
    except ValueError:
        return None
    if len(parts) == 1:
        return ends[0], ends[0], 1
    if len(parts) != 3 or count is None or count < 2 or not all(map(math.isfinite, ends)):
        return None
    return ends[0], ends[1], count


def _even(start: float, stop: float, count: int) -> list[float]:
    """Return evenly spaced numbers, both ends among them."""
    import numpy as np  # which --help does not wait for

    return [float(value) for value in np.linspace(start, stop, count)]
