"""A predicted law at given pressures: the curves over Delta, read the other way round.

The surrogate answers at given Delta. At a given pressure p, Delta is where the pressure's curve
reaches p, and area and mean gap are their curves' values at that Delta.

The interval follows by inverting the ends of the pressure's interval: Delta is at least where the
upper end reaches p, and at most where the lower end does. Area and mean gap lie between the ends of
their own intervals at these two Deltas. That holds whenever both intervals do, at whichever Delta
the contact really is; it is wider than an interval made for given pressures would be, because the
errors of area and force go together. A population needs none of this: each surface's own curves
are inverted, and the band is that of the results.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from learn.surrogate.law.points import Points

Values = NDArray[np.float64]

FINE = 20
"""Steps into which an interval of Delta is divided to invert the cubic in it."""

ROUNDING = 1e-12
"""By how much a pressure may be beyond the last one and still be taken for it."""


def reached(points: Points) -> float:
    """The largest pressure of a law over Delta [MPa]."""
    return float(points.values["pressure_MPa"].max())


def at_pressures(points: Points, pressures: Values) -> Points:
    """Read one surface's law at given pressures.

    Parameters
    ----------
    points : monotone, from first touch on
    pressures : (m,) ascending, at most what the law reaches [MPa]

    Returns
    -------
    Points at these pressures; where an end of an interval lies beyond the law or on unknown
    ground, the interval is NaN and the reason says so
    """
    deltas = points.values["delta_um"]
    at = _inverse(deltas, points.values["pressure_MPa"], pressures, first=True)
    values = {
        "delta_um": at,
        "area_percent": _cubic(deltas, points.values["area_percent"])(at),
        "mean_gap_um": _cubic(deltas, points.values["mean_gap_um"])(at),
    }
    reasons = _reasons(points, at)
    if not points.low:
        return Points(values, reasons=reasons)
    least, most = _ends_of_delta(points, pressures, at)
    low, high = {"delta_um": least}, {"delta_um": most}
    for name, (one, other) in {"area_percent": (least, most), "mean_gap_um": (most, least)}.items():
        low[name] = _read(deltas, points.low[name], one)
        high[name] = _read(deltas, points.high[name], other)
    unknown = np.isnan(least) | np.isnan(most)
    said = []
    ends = zip(_reasons(points, least), _reasons(points, most), unknown, strict=True)
    for lower, upper, nowhere in ends:
        end = "beyond the last displacement" if nowhere else lower or upper
        said.append(f"its interval ends {end if nowhere else f'where {end}'}" if end else "")
    return Points(values, low, high, reasons, tuple(said))


def _ends_of_delta(points: Points, pressures: Values, at: Values) -> tuple[Values, Values]:
    """(m,) least and most Delta at given pressures; NaN where the law does not say [um]."""
    deltas = points.values["delta_um"]
    low, high = points.low["pressure_MPa"], points.high["pressure_MPa"]
    nowhere = np.full_like(at, np.nan)
    least, most = nowhere, nowhere
    if np.isfinite(high).all():
        least = np.minimum(_inverse(deltas, high, pressures, first=True), at)
    if np.isfinite(low).all():
        most = np.maximum(_inverse(deltas, low, pressures, first=False), at)
    return least, most


def _inverse(deltas: Values, reach: Values, pressures: Values, *, first: bool) -> Values:
    """(m,) Delta at which a rising pressure reaches others; NaN beyond its end.

    Parameters
    ----------
    deltas, reach : (k,) the curve [um], [MPa]
    pressures : (m,) to be reached; 0 is at first touch [MPa]
    first : on a level stretch take its beginning, else its end
    """
    shares = np.arange(FINE) / FINE
    fine = np.append((deltas[:-1, None] + np.diff(deltas)[:, None] * shares).ravel(), deltas[-1])
    curve = np.maximum.accumulate(_cubic(deltas, reach)(fine))
    rises = np.diff(curve) > 0
    kept = np.concatenate([[True], rises] if first else [rises, [True]])
    end = curve[-1]
    asked = np.where(pressures <= end * (1 + ROUNDING), np.minimum(pressures, end), pressures)
    found = np.interp(asked, curve[kept], fine[kept], right=np.nan)
    return np.where(pressures > 0, found, 0.0)


def _read(deltas: Values, values: Values, at: Values) -> Values:
    """(m,) values between points; NaN at NaN, and next to an interval without an end."""
    if np.isfinite(values).all():
        return _cubic(deltas, values)(at)
    with np.errstate(invalid="ignore"):
        return np.interp(at, deltas, values)


def _cubic(arguments: Values, values: Values) -> Callable[[Values], Values]:
    """The monotone cubic through the points."""
    from scipy.interpolate import PchipInterpolator

    interpolation: Callable[[Values], Values] = PchipInterpolator(arguments, values)
    return interpolation


def _reasons(points: Points, at: Values) -> tuple[str, ...]:
    """Why Deltas between the points are unknown ground: because a neighbour is."""
    deltas = points.values["delta_um"]
    above = np.searchsorted(deltas, at).clip(0, deltas.size - 1)
    below = np.where(deltas[above] == at, above, (above - 1).clip(0))
    return tuple(
        points.reasons[one] or points.reasons[other]
        for one, other in zip(below, above, strict=True)
    )
