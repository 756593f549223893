"""Parse the numbers that users type, and refuse the same ones everywhere."""

import math
import re

from gen.runtime.errors import InputError

MOST = 100_000  # most values of one option
DIGITS = 18  # most digits of a whole number: enough for 2^59, and few enough for 64 bits

MAGNITUDES = (1e-60, 1e60)  # of useful lengths [um] and moduli [MPa]: their squares stay finite


SERIES = re.compile(rf"([^:]+):([^:]+):\s*([0-9]{{1,{DIGITS}}})\s*(:\s*log\s*)?")
"""Start, stop and count of a series, and perhaps the mark of an even ratio."""


def values_from(text: str, option: str, advice: str) -> list[float]:
    """Parse the numbers of an option; `advice` says in messages which are allowed.

    They are numbers, start:stop:count, or start:stop:count:log, with commas between them. Raise
    InputError for anything else, or more than `MOST` numbers.
    """
    values: list[float] = []
    for part in text.split(","):
        series = SERIES.fullmatch(part)
        start, stop, count, log = series.groups() if series else (part, part, "1", None)
        try:
            ends = [float(start), float(stop)]
        except ValueError:
            raise InputError(f"{option} {shown(text)}: {advice}") from None
        finite = all(map(math.isfinite, ends)) and (not log or min(ends) > 0)
        if series and not (finite and int(count) > 1):
            raise InputError(f"{option} {shown(text)}: {advice}")
        if len(values) + int(count) > MOST:
            raise InputError(f"{option} {shown(text)}: give {MOST:,} values at most")
        if not series:
            values.append(ends[0])
            continue
        import numpy as np  # here, so that --help does not wait for it

        values += (np.geomspace if log else np.linspace)(ends[0], ends[1], int(count)).tolist()
    return values


LOADS = {
    "delta": "give numbers from {:g} to {:g} um, as 2, 1,2,5 or 5:45:9".format(*MAGNITUDES),
    "pressure": f"give pressures from 0 to {MAGNITUDES[1]:g} MPa, not all 0, as 0:100:20",
}
"""Advice for the loads of a law and of predictions."""


def loads_from(load: str, text: str) -> list[float]:
    """Parse displacements above 0 [um], or nominal pressures of 0 or more, not all 0 [MPa]."""
    values = values_from(text, f"--{load}", LOADS[load])
    allowed = all(magnitude(value) or (value == 0 and load == "pressure") for value in values)
    if not allowed or not any(values):
        raise InputError(f"--{load} {shown(text)}: {LOADS[load]}")
    return values


def shown(text: str, most: int = 60) -> str:
    """Quote a text of the user's, shortened if it is too long to be typed by hand."""
    return repr(text) if len(text) <= most else f"{text[:most]!r}... ({len(text)} characters)"


def magnitude(value: float) -> bool:
    """Tell whether a length, load or modulus is positive and within `MAGNITUDES`."""
    return MAGNITUDES[0] < value < MAGNITUDES[1]
