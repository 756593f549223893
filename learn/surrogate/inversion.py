"""A law at given pressures, from its points at given displacements.

The surrogate predicts at given Delta. At a given pressure p, Delta is the point at which the curve
of the pressure reaches p; area and mean gap are the values of their curves at that Delta. The
interval follows by inversion of the ends of the pressure's interval: Delta is at least the point at
which the upper end reaches p, and at most the point at which the lower end does. Area and mean gap
lie between the ends of their own intervals at these two Deltas. This holds whenever both intervals
do; it is wider than an interval made for given pressures, because the errors of area and force are
correlated. For a population the curves of each surface are inverted, and the band is that of the
results.
"""

import numpy as np
from scipy.interpolate import PchipInterpolator

from gen.arrays import Values
from gen.law.curves import STIFFNESS, Points

FINE = 20
"""Steps into which an interval of Delta is divided to invert the cubic in it."""

ROUNDING = 1e-12
"""Relative distance beyond the last pressure within which a pressure counts as the last one."""


def at_pressures(points: Points, pressures: Values) -> Points:
    """Evaluate the law of one surface at ascending pressures that it reaches, (m,) [MPa].

    The points are monotone, from first touch on. Where an end of an interval lies beyond the law or
    outside the training, the interval is NaN and the reason says so.
    """
    deltas = points.values["delta_um"]
    at = _inverse(deltas, points.values["pressure_MPa"], pressures, first=True)
    known = ("area_percent", "mean_gap_um", "closure_um", STIFFNESS)
    values = {"delta_um": at} | {
        name: _read(deltas, points.values[name], at) for name in known if name in points.values
    }
    reasons = _reasons(points, at)
    if not points.low:
        return Points(values, reasons=reasons)
    least, most = _ends_of_delta(points, pressures, at)
    low, high = {"delta_um": least}, {"delta_um": most}
    for name in points.low.keys() & {*known}:
        one, other = (most, least) if name == "mean_gap_um" else (least, most)
        low[name] = _read(deltas, points.low[name], one)
        high[name] = _read(deltas, points.high[name], other)
    unknown = np.isnan(least) | np.isnan(most)
    said = []
    ends = zip(_reasons(points, least), _reasons(points, most), unknown, strict=True)
    for lower, upper, nowhere in ends:
        end = "beyond the last displacement" if nowhere else lower or upper
        said.append(f"its interval ends {end if nowhere else f'where {end}'}" if end else "")
    return Points(values, low, high, reasons, tuple(said))


def read_at(points: Points, argument: str, over: Values) -> Points:
    """Read the points of one surface at other arguments, (m,)."""
    place = np.searchsorted(points.values[argument], over).clip(0, len(points.reasons) - 1)
    return points.changed(
        lambda _, each: _read(points.values[argument], each, over),
        *np.array(points.reasons, dtype=object)[place],
    )


def _ends_of_delta(points: Points, pressures: Values, at: Values) -> tuple[Values, Values]:
    """Return the least and most Delta at given pressures, each (m,); NaN beyond the law [um]."""
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
    """Return the Delta at which a rising pressure reaches given ones, (m,); NaN beyond its end.

    The curve is given by pressures `reach` at `deltas`, each (k,) [MPa, um]. Of a level stretch it
    is the beginning if `first`, else the end. No pressure is at first touch.
    """
    shares = np.arange(FINE) / FINE
    fine = np.append((deltas[:-1, None] + np.diff(deltas)[:, None] * shares).ravel(), deltas[-1])
    curve = np.maximum.accumulate(PchipInterpolator(deltas, reach)(fine))
    rises = np.diff(curve) > 0
    kept = np.concatenate([[True], rises] if first else [rises, [True]])
    end = curve[-1]
    asked = np.where(pressures <= end * (1 + ROUNDING), np.minimum(pressures, end), pressures)
    deltas_at = np.interp(asked, curve[kept], fine[kept], right=np.nan)
    return np.where(pressures > 0, deltas_at, 0.0)


def _read(deltas: Values, values: Values, at: Values) -> Values:
    """Interpolate between points, (m,); NaN at NaN, and next to an interval without an end."""
    if np.isfinite(values).all():
        return PchipInterpolator(deltas, values)(at)
    with np.errstate(invalid="ignore"):
        return np.interp(at, deltas, values)


def _reasons(points: Points, at: Values) -> tuple[str, ...]:
    """Return why Deltas between points lie outside the training: because a neighbour does."""
    deltas = points.values["delta_um"]
    above = np.searchsorted(deltas, at).clip(0, deltas.size - 1)
    below = np.where(deltas[above] == at, above, (above - 1).clip(0))
    return tuple(
        points.reasons[one] or points.reasons[other]
        for one, other in zip(below, above, strict=True)
    )
