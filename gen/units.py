"""Units in which numbers for people have no exponents: N, GPa and N/um.

Times have three digits, in ms or s.

Files keep the units of all computations: forces in uN, moduli and pressures in MPa.
"""

import math
from typing import NamedTuple


class Unit(NamedTuple):
    """A unit of numbers for people."""

    name: str
    size: float  # in the unit of computations


LARGER_UNITS = {
    "uN": Unit(name="N", size=1e6),
    "MPa": Unit(name="GPa", size=1e3),
    "N/m": Unit(name="N/um", size=1e6),
}
"""Larger units by the names of the units of computations."""


def readable_unit(unit: str, largest: float, digits: int) -> Unit:
    """Choose the unit in which numbers are written without exponents.

    Parameters
    ----------
    unit : str
        Unit of computations, as "uN".
    largest : float
        The largest number by its amount, in this unit. It may be NaN or infinite.
    digits : int
        Significant digits of the numbers, as in the format ".6g".

    Returns
    -------
    Unit
        The larger unit if the number would have an exponent and if there is a larger unit,
        otherwise the given one.
    """
    same = Unit(name=unit, size=1.0)
    if not math.isfinite(largest) or abs(largest) < 10.0**digits:
        return same
    return LARGER_UNITS.get(unit, same)


def with_unit(number: float, unit: str, digits: int = 4) -> str:
    """Write a number with a unit in which it has no exponent.

    Parameters
    ----------
    number : float
        The number, in the unit of computations.
    unit : str
        Unit of computations, as "uN".
    digits : int
        Significant digits.

    Returns
    -------
    str
        The number and its unit, as "50.78 N".
    """
    readable = readable_unit(unit, number, digits)
    return f"{number / readable.size:.{digits}g} {readable.name}"


def time_with_unit(seconds: float) -> str:
    """Write a measured time with three significant digits, in ms below a second.

    Parameters
    ----------
    seconds : float
        The time [s].

    Returns
    -------
    str
        The time and its unit, as "23.5 ms" or "6.03 s".
    """
    rounded = float(f"{seconds:.3g}")
    if rounded < 1:
        return f"{1e3 * rounded:.6g} ms"
    return f"{rounded:.6g} s"
