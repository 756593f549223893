"""The law of one surface at other arguments than those at which it was predicted.

`at_pressures` inverts a law over Delta: it finds the Delta at which the curve of the pressure
reaches a given pressure, and reads the other curves at this Delta. `at_arguments` only
interpolates.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator

from gen.arrays import Values
from gen.law.curves import Points, entries_at, trend
from gen.quantities import DELTA, FORCE, PRESSURE

FINE = 20
"""Number of steps into which each interval between two Deltas is divided. Within a step the
monotone cubic is inverted as if it were a straight line."""

ROUNDING = 1e-12
"""Largest relative distance by which rounding may put a pressure above the last one of a curve."""


def at_pressures(points: Points, pressures: Values) -> Points:
    """Evaluate the law of one surface at pressures.

    Parameters
    ----------
    points : Points
        Monotone points of the surface at k Deltas from first touch.
    pressures : ndarray, shape (m,)
        Ascending pressures that the surface reaches [MPa].

    Returns
    -------
    Points
        Points at the pressures, with Delta and its interval, and without pressure and force. An end
        of an interval that is beyond the last Delta is NaN. `why_no_interval` has a text for each
        pressure: the reason why the interval does not hold (an end is beyond the last Delta, or
        outside the training), or "" if it holds.
    """
    deltas = points.values[DELTA.in_laws]
    curve = points.values[PRESSURE.in_laws]
    deltas_at = _inverse(deltas, curve, pressures, first=True)
    loads = {DELTA.in_laws, PRESSURE.in_laws, FORCE.in_laws}
    names = [name for name in points.values if name not in loads]
    values = {DELTA.in_laws: deltas_at}
    for name in names:
        values[name] = _interpolate(deltas, points.values[name], deltas_at)
    reasons = _reasons_at(points, deltas_at)
    if not points.low:  # The points have no intervals.
        return Points(values=values, reasons=reasons)
    interval = _interval_of_delta(points, pressures, deltas_at)
    low = {DELTA.in_laws: interval.low}
    high = {DELTA.in_laws: interval.high}
    for name in names:
        if name not in points.low:  # The quantity has no interval.
            continue
        # A quantity that falls with the load is smallest at the largest Delta.
        falls = trend(name) == "falls"
        at_low = interval.high if falls else interval.low
        at_high = interval.low if falls else interval.high
        low[name] = _interpolate(deltas, points.low[name], at_low)
        high[name] = _interpolate(deltas, points.high[name], at_high)
    return Points(
        values=values,
        low=low,
        high=high,
        reasons=reasons,
        why_no_interval=_faults_of_intervals(points, interval),
    )


@dataclass(frozen=True, eq=False)
class DeltaInterval:
    """The intervals of Delta at m pressures; an end is NaN where it is beyond the last Delta."""

    low: Values  # (m,) [um]
    high: Values  # (m,) [um]


def _interval_of_delta(points: Points, pressures: Values, at: Values) -> DeltaInterval:
    """Invert both ends of the pressure's interval at pressures, (m,) [MPa].

    `at` are the Deltas at the pressures, (m,) [um]; the intervals are widened to contain them. The
    low ends of Delta follow from the upper ends of the pressure, and are all NaN if one of these is
    not finite. The high ends of Delta follow from the lower ends of the pressure in like manner.
    """
    deltas = points.values[DELTA.in_laws]
    low = np.full_like(at, np.nan)
    high = np.full_like(at, np.nan)
    # The upper end of the pressure reaches a given pressure first, at the smallest Delta.
    upper = points.high[PRESSURE.in_laws]
    if np.isfinite(upper).all():
        low = np.minimum(_inverse(deltas, upper, pressures, first=True), at)
    lower = points.low[PRESSURE.in_laws]
    if np.isfinite(lower).all():
        high = np.maximum(_inverse(deltas, lower, pressures, first=False), at)
    return DeltaInterval(low=low, high=high)


def _faults_of_intervals(points: Points, interval: DeltaInterval) -> tuple[str, ...]:
    """Say for each pressure why the interval of its Delta does not hold; "" where it does.

    An end may be beyond the last Delta, or outside the training.
    """
    is_beyond = np.isnan(interval.low) | np.isnan(interval.high)
    reasons_low = _reasons_at(points, interval.low)
    reasons_high = _reasons_at(points, interval.high)
    faults: list[str] = []
    for place, beyond in enumerate(is_beyond):
        reason = reasons_low[place] or reasons_high[place]
        if beyond:
            faults.append("its interval ends beyond the last displacement")
        elif reason:
            faults.append(f"its interval ends where {reason}")
        else:
            faults.append("")
    return tuple(faults)


def at_arguments(points: Points, argument: str, arguments: Values) -> Points:
    """Interpolate the law of one surface to other values of a quantity.

    Parameters
    ----------
    points : Points
        Points of the surface under k loads.
    argument : str
        Name of the quantity in laws; it rises with the loads.
    arguments : ndarray, shape (m,)
        Values of the quantity, none above the last one of the points.

    Returns
    -------
    Points
        Points at these values. Each has the reason of the old point at the next larger value.
    """
    old_arguments = points.values[argument]
    last = len(points.reasons) - 1
    places = np.searchsorted(old_arguments, arguments).clip(0, last)
    return points.changed(
        lambda _, values: _interpolate(old_arguments, values, arguments),
        entries_at(points.reasons, places),
    )


def _inverse(deltas: Values, curve: Values, pressures: Values, *, first: bool) -> Values:
    """Return the Deltas, (m,) [um], at which a rising curve of the pressure reaches `pressures`.

    `curve` are the pressures of the curve [MPa] at `deltas` [um], (k,) each; `pressures` are (m,)
    [MPa]. Where the curve is level, the Delta is the first of this level if `first` is True,
    otherwise the last. Delta is 0 at a pressure of 0, and NaN beyond the end of the curve.
    """
    shares = np.arange(FINE) / FINE
    between = deltas[:-1, None] + np.diff(deltas)[:, None] * shares
    fine_deltas = np.append(between.ravel(), deltas[-1])
    fine_curve = np.maximum.accumulate(PchipInterpolator(deltas, curve)(fine_deltas))
    rises = np.diff(fine_curve) > 0
    # Of fine points at one pressure, keep the first, or the last.
    kept = np.append(True, rises) if first else np.append(rises, True)
    # A pressure that only rounding puts above the last one is taken for the last one.
    end = fine_curve[-1]
    is_reached = pressures <= end * (1 + ROUNDING)
    corrected = np.where(is_reached, np.minimum(pressures, end), pressures)
    deltas_at = np.interp(corrected, fine_curve[kept], fine_deltas[kept], right=np.nan)
    return np.where(pressures > 0, deltas_at, 0.0)


def _interpolate(arguments: Values, values: Values, at: Values) -> Values:
    """Interpolate values at arguments, both (k,), to new arguments `at`, (m,).

    The interpolation is monotone and cubic, or linear if a value is not finite. It is NaN at NaN,
    and not finite beside a value that is not finite.
    """
    if np.isfinite(values).all():
        return PchipInterpolator(arguments, values)(at)
    with np.errstate(invalid="ignore"):
        return np.interp(at, arguments, values)


def _reasons_at(points: Points, at: Values) -> tuple[str, ...]:
    """Return why Deltas, (m,) [um], are outside the training: the reason of a neighbouring point.

    Between two points it is the reason of the lower one, or else of the upper one. At the Delta of
    a point it is the reason of this point; for NaN it is that of the last two points. The text is
    "" inside the training.
    """
    deltas = points.values[DELTA.in_laws]
    above = np.searchsorted(deltas, at).clip(0, deltas.size - 1)
    below = np.where(deltas[above] == at, above, (above - 1).clip(0))
    return tuple(
        points.reasons[lower] or points.reasons[upper]
        for lower, upper in zip(below, above, strict=True)
    )
