"""The friction of a law as Abaqus and CalculiX take it: one number for the shear before slip.

Abaqus takes one elastic slip for all pressures: the median of the law. CalculiX takes one slope of
the shear stress over the shift: that at the pressure of --at-pressure. Both know one number for all
directions.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gen.arrays import Values
from gen.law.contact_law import Law
from gen.law.unit_systems import UnitSystem
from gen.quantities import ELASTIC_SLIPS, SHEAR_STIFFNESSES, Quantity
from gen.runtime.errors import InputError

PARTS = {
    "value": "the law",
    "low": "the low end of its band",
    "high": "the high end of its band",
}
"""Words for the parts of a curve, by the names of its attributes."""


@dataclass(frozen=True)
class Stick:
    """What a file says of the shear before slip."""

    value: float  # elastic slip, or slope of the shear stress over the shift, in units of the file
    words: str  # a paragraph about it


@dataclass(frozen=True, eq=False)
class AlongAxes:
    """A quantity in shear along x and along y, over the pressures at which both have a number."""

    pressures: Values  # ascending [MPa], (k,)
    values: Values  # row 0 along x, row 1 along y, (2, k)


def elastic_slip(law: Law, part: str, system: UnitSystem) -> Stick:
    """Return the median of the elastic slips of a law over its pressures and both axes.

    Parameters
    ----------
    law : Law
        A law with friction.
    part : {"value", "low", "high"}
        The law itself, or an end of its band.
    system : UnitSystem
        Units of the file.

    Returns
    -------
    Stick
        The elastic slip.

    Raises
    ------
    InputError
        If the end of the band is missing at all pressures.
    """
    slips = _along_axes(law, ELASTIC_SLIPS, part)
    lengths = slips.values * system.length
    median = float(np.median(lengths))
    along_x, along_y = (f"{row.min():.4g} to {row.max():.4g}" for row in lengths)
    unit = system.length_unit
    words = (
        f"Elastic slip: {median:.4g} {unit} for all pressures and directions. It is the median of"
        f" {PARTS[part]}, in which it is {along_x} {unit} along x and {along_y} {unit} along y,"
        f" from {slips.pressures[0]:g} to {slips.pressures[-1]:g} MPa."
    )
    return Stick(value=median, words=words)


def stick_slope(law: Law, pressure: float, part: str, system: UnitSystem) -> Stick:
    """Return the mean of the interface's stiffnesses in shear along x and y at a pressure.

    Between the pressures of the law each stiffness is a power of the pressure.

    Parameters
    ----------
    law : Law
        A law with friction.
    pressure : float
        Nominal pressure [MPa].
    part : {"value", "low", "high"}
        The law itself, or an end of its band.
    system : UnitSystem
        Units of the file.

    Returns
    -------
    Stick
        The slope.

    Raises
    ------
    InputError
        If the pressure is outside the law, or the end of the band is missing at all pressures.
    """
    stiffnesses = _along_axes(law, SHEAR_STIFFNESSES, part)
    require_in_law(pressure, stiffnesses.pressures)
    log_pressures = np.log(stiffnesses.pressures)
    logs = [
        np.interp(np.log(pressure), log_pressures, np.log(row))
        for row in stiffnesses.values
    ]
    slopes = np.exp(logs) * system.pressure / system.length
    slope = float(np.mean(slopes))
    unit = f"{system.pressure_unit}/{system.length_unit}"
    words = (
        f"Stick slope: {slope:.4g} {unit} for all pressures and directions. It is the mean of the"
        f" stiffnesses in shear of {PARTS[part]} at {pressure:g} MPa:"
        f" {slopes[0]:.4g} {unit} along x and {slopes[1]:.4g} {unit} along y."
    )
    return Stick(value=slope, words=words)


def _along_axes(law: Law, quantities: Sequence[Quantity], part: str) -> AlongAxes:
    """Return a part of the curves of two quantities, along x and along y, where both are finite."""
    table = law.over_pressure
    curves = [table.curves[quantity.in_laws] for quantity in quantities]
    values = np.array([getattr(curve, part) for curve in curves])
    usable = (table.at > 0) & np.isfinite(values).all(axis=0)
    if not usable.any():
        raise InputError("there is no band of its shear before slip")
    return AlongAxes(pressures=table.at[usable], values=values[:, usable])


def require_in_law(pressure: float, pressures: Values) -> None:
    """Refuse a value of the option --at-pressure that is outside the pressures of a law.

    Parameters
    ----------
    pressure : float
        The value [MPa].
    pressures : ndarray, shape (k,)
        Ascending pressures of the law, at least one [MPa].

    Raises
    ------
    InputError
        If the value is below the first or above the last pressure of the law.
    """
    if not pressures[0] <= pressure <= pressures[-1]:
        raise InputError(
            f"--at-pressure {pressure:g}: the law is from {pressures[0]:g} to"
            f" {pressures[-1]:g} MPa"
        )
