"""Loads of a law, from the text of an option."""

import numpy as np

from gen.arrays import Values
from gen.runtime.errors import InputError
from gen.runtime.numbers import MAGNITUDES, magnitude, shown, values_from


def deltas_from(text: str) -> Values:
    """Parse displacements, as "2", "1,2,5" or "5:45:9" [um].

    Raises
    ------
    InputError
        If the text is not made of numbers within `gen.runtime.numbers.MAGNITUDES`.
    """
    advice = "give numbers above 0 um, as 2, 1,2,5 or 5:45:9"
    values = numbers_from(text, "--delta", advice)
    if not all(map(magnitude, values)):
        low, high = MAGNITUDES
        raise InputError(f"--delta {shown(text)}: give numbers from {low:g} to {high:g} um")
    return values


def pressures_from(text: str) -> Values:
    """Parse nominal pressures, as "1:100:20" [MPa].

    Raises
    ------
    InputError
        If the text is not made of numbers of 0 or more, or all are 0.
    """
    advice = f"give pressures from 0 to {MAGNITUDES[1]:g} MPa, not all 0, as 0:100:20"
    values = numbers_from(text, "--pressure", advice)
    if not values.any() or not all(value == 0 or magnitude(value) for value in values):
        raise InputError(f"--pressure {shown(text)}: {advice}")
    return values


def numbers_from(text: str, option: str, advice: str) -> Values:
    """Parse finite numbers, as "2", "1,2,5" or "5:45:9".

    Raises
    ------
    InputError
        If there are none or too many, or one is not finite; the message has the option and the
        advice.
    """
    values = np.array(values_from(text, option, advice))
    if not np.isfinite(values).all():
        raise InputError(f"{option} {shown(text)}: {advice}")
    return values
