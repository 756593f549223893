"""Curves of a contact law: monotone values with a band and slopes, over Delta or over pressure."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gen.errors import InputError
from learn.surrogate.sources import numbers_from

Values = NDArray[np.float64]

QUANTITIES = ("area_percent", "force_uN", "mean_gap_um", "pressure_MPa")
RISING = {"area_percent": True, "force_uN": True, "mean_gap_um": False, "pressure_MPa": True}
FINE = 400
"""Displacements between which the law against pressure is interpolated."""


@dataclass(frozen=True, eq=False)
class Curve:
    """One quantity against an argument.

    Attributes
    ----------
    value, low, high, slope : (k,) in the quantity's unit, slope over the argument's unit
    """

    value: Values
    low: Values
    high: Values
    slope: Values


def by_delta(
    deltas: Values, tables: dict[str, Values], rest: dict[str, Values], level: float
) -> tuple[dict[str, Curve], float]:
    """Monotone curves over Delta, from 0 on, and the largest relative correction."""
    curves: dict[str, Curve] = {}
    corrected = 0.0
    arguments = np.concatenate([[0.0], deltas])
    for name, table in tables.items():
        start = np.repeat(rest[name][:, None, None], 3, axis=1)
        whole = np.concatenate([start, table], axis=2)
        if len(whole) == 1:
            value, low, high = whole[0]
        else:
            value = whole[:, 0].mean(axis=0)
            low, high = np.quantile(whole[:, 0], [(1 - level) / 2, (1 + level) / 2], axis=0)
        smooth = [_monotone(each, rising=RISING[name]) for each in (value, low, high)]
        largest = float(np.abs(value).max()) or 1.0
        corrected = max(corrected, float(np.abs(smooth[0] - value).max()) / largest)
        value, low, high = smooth
        curves[name] = Curve(
            value, np.minimum(low, value), np.maximum(high, value), _slope(arguments, value)
        )
    return curves, corrected


def _monotone(values: Values, *, rising: bool) -> Values:
    """The closest monotone values, by least squares."""
    from scipy.optimize import isotonic_regression

    return np.asarray(isotonic_regression(values, increasing=rising).x)


def _slope(arguments: Values, values: Values) -> Values:
    """Slopes of the monotone cubic through the values."""
    from scipy.interpolate import PchipInterpolator

    return np.asarray(PchipInterpolator(arguments, values).derivative()(arguments))


def by_pressure(
    deltas: Values, curves: dict[str, Curve], text: str
) -> tuple[Values, dict[str, Curve]]:
    """The same curves against the nominal pressure."""
    from scipy.interpolate import PchipInterpolator

    fine = np.unique(np.concatenate([deltas, np.linspace(0, deltas[-1], FINE)]))
    reached = PchipInterpolator(deltas, curves["pressure_MPa"].value)(fine)
    rising = np.concatenate([[True], np.diff(np.maximum.accumulate(reached)) > 0])
    fine, reached = fine[rising], reached[rising]
    if reached.size < 2:
        raise InputError("the law has no force at all: nothing to tabulate against pressure")
    pressure = np.unique(curves["pressure_MPa"].value)  # as close as Delta's where it is small
    if text:
        pressure = np.unique(pressures_from(text))
        if pressure[-1] > reached[-1]:
            raise InputError(
                f"--pressure {text}: the law ends at {reached[-1]:.4g} MPa, Delta ="
                f" {deltas[-1]:.4g} um: give a larger --delta"
            )
    at = np.interp(pressure, reached, fine)
    found: dict[str, Curve] = {"delta_um": _curve(pressure, at, at, at)}
    for name in ("area_percent", "mean_gap_um"):
        ends = curves[name].value, curves[name].low, curves[name].high
        found[name] = _curve(pressure, *(PchipInterpolator(deltas, each)(at) for each in ends))
    return pressure, found


def _curve(arguments: Values, value: Values, low: Values, high: Values) -> Curve:
    slope = _slope(arguments, value) if arguments.size > 1 else np.zeros(1)
    return Curve(value, low, high, slope)


def pressures_from(text: str) -> Values:
    """Nominal pressures from "1:100:20" [MPa]."""
    advice = "give pressures of 0 MPa or more, as 0:100:20"
    values = numbers_from(text, "--pressure", advice)
    if not (values >= 0).all():
        raise InputError(f"--pressure {text!r}: {advice}")
    return values
