"""A contact law as a surface interaction of finite elements, for CalculiX and for Abaqus.

Both take the pressure over the closure as a table, from first touch on. They differ in the gap's
conductance: CalculiX takes conductance, pressure and temperature a line; Abaqus needs the parameter
PRESSURE, without which it takes the second column for a clearance.

CalculiX 2.20 presses surface to surface only with tables of a certain form: springforc_f2f.f has
room for 20 points, and takes their number from where the 41st overclosure stands (plconloc(81),
instead of plconloc(801)). With other tables it finds no pressure, or diverges. Its tables therefore
have 20 points of the law, and 21 more that continue the last slope up to an overclosure of 20.5,
which means the same to programs that read all of them. Node to surface presses right with any
table, but its conductance does not look at the table.
"""

import re
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Values
from gen.law.contact_law import Law
from gen.law.curves import CONDUCTANCE
from gen.option_groups import Units
from gen.runtime import output
from gen.runtime.errors import InputError
from gen.runtime.provenance import git_commit, versions

Program = Literal["calculix", "abaqus"]

POINTS = 20
"""Points of the law in CalculiX's table."""

FURTHER = 21
"""Points behind them, the last of which has the number of the law's points in its overclosure."""

FAR = POINTS + 0.5
"""That overclosure [unit of length]."""

WIDTH = 100
LONGEST_NAME = 60
TEMPERATURE = 293.15
"""Temperature beside conductances that do not depend on it, which CalculiX asks for [K]."""


class UnitSystem(NamedTuple):
    """A consistent system of units.

    Attributes
    ----------
    text : str
        Description.
    pressure, length, conductance : float
        What 1 MPa, 1 um and 1 W/(mm2 K) are in it.
    """

    text: str
    pressure: float
    length: float
    conductance: float


UNITS: dict[Units, UnitSystem] = {
    "mm": UnitSystem("mm, N, s, MPa; conductance in mW/(mm2 K)", 1.0, 1e-3, 1e3),
    "si": UnitSystem("m, N, s, Pa; conductance in W/(m2 K)", 1e6, 1e-6, 1e6),
}


def write(path: Path, law: Law, program: Program, units: Units) -> None:
    """Write a surface interaction, whole or not at all.

    Parameters
    ----------
    path : Path
        File to write; its name is that of the interaction.
    law : Law
        The law, whose table against pressure is taken.
    program : {"calculix", "abaqus"}
        Program that reads it.
    units : {"mm", "si"}
        System of units.

    Raises
    ------
    InputError
        If the closure does not rise with the pressure, or the file cannot be written.
    """
    output.write(path, "\n".join(_lines(path, law, program, UNITS[units])) + "\n")


def rising(law: Law) -> tuple[Values, Values, Values | None]:
    """Return the points at which closure and pressure rise, from first touch on.

    Returns
    -------
    pressures : ndarray, shape (m,)
        Pressures; the first is 0 [MPa].
    closures : ndarray, shape (m,)
        Closures [um].
    conductances : ndarray, shape (m,), or None
        Conductances, if the law has them [W/(mm2 K)].
    """
    curves = law.over_pressure.curves
    pressures, closures = law.over_pressure.at, curves["closure_um"].value
    known = curves.get(CONDUCTANCE)
    kept: list[int] = []
    last = 0.0
    for place, closure in enumerate(closures.tolist()):
        finite = known is None or np.isfinite(known.value[place])
        if closure > last and pressures[place] > 0 and finite:
            kept.append(place)
            last = closure

    def some(values: Values) -> Values:
        return np.append(0.0, values[kept])

    return some(pressures), some(closures), None if known is None else some(known.value)


def _lines(path: Path, law: Law, program: Program, units: UnitSystem) -> Iterator[str]:
    """Yield the whole file."""
    pressures, closures, conductances = rising(law)
    if pressures.size < 2:
        raise InputError("the law closes nowhere below full contact: give smaller pressures")
    for paragraph in _description(law, program, units, float(pressures[-1])):
        yield from textwrap.wrap(
            re.sub(r"[^ -~]", "?", paragraph),
            WIDTH,
            initial_indent="** ",
            subsequent_indent="**   ",
            break_on_hyphens=False,
        )
    yield f"*SURFACE INTERACTION, NAME={_name(path)}"
    yield "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TABULAR"
    loads, overclosures = pressures * units.pressure, closures * units.length
    if program == "calculix":
        loads, overclosures = _for_calculix(loads, overclosures)
    for load, overclosure in zip(loads, overclosures, strict=True):
        yield f"{_number(load)}, {_number(overclosure)}"
    if conductances is None:
        return
    yield "*GAP CONDUCTANCE" if program == "calculix" else "*GAP CONDUCTANCE, PRESSURE"
    temperature = f", {_number(TEMPERATURE)}" if program == "calculix" else ""
    for conductance, pressure in zip(conductances, pressures, strict=True):
        number = _number(conductance * units.conductance)
        yield f"{number}, {_number(pressure * units.pressure)}{temperature}"


def _description(law: Law, program: Program, units: UnitSystem, last: float) -> Iterator[str]:
    """Yield the paragraphs of the comment at the top."""
    version = versions(["asperity"]).get("asperity", "")
    yield f"Contact of rough surfaces: {law.bodies.text}. Units: {units.text}."
    if law.order.conductivities is not None:
        k1, k2 = law.order.conductivities
        yield f"Conductivities of the bodies: {k1:g} and {k2:g} W/(m K)."
    yield f"Surface: {'; '.join(law.origins)}"
    yield f"Command: {law.order.command}"
    yield f"Made by asperity {version} {git_commit()[:12]}"
    for note in law.notes:
        yield f"How: {note}"
    yield (
        "Overclosure is counted from first touch: let the two meshes just touch where the highest"
        " asperities do. The elastic bodies are the mesh's; these tables are the interface's alone."
    )
    yield f"The law ends at {last:.6g} MPa."
    if program == "calculix":
        yield (
            f"The first {POINTS} lines of the table are points of the law and of the monotone cubic"
            f" through it. {FURTHER} more continue the last slope: behind them CalculiX 2.20 finds"
            " the number of points."
        )


def _for_calculix(pressures: Values, closures: Values) -> tuple[Values, Values]:
    """Return `POINTS` points of the monotone cubic through a law, and `FURTHER` far away.

    All points of the law are among them if it has no more, otherwise evenly chosen ones.
    """
    from scipy.interpolate import PchipInterpolator

    own = closures.size - 1
    if own >= POINTS:
        places = np.rint(np.linspace(0, own, POINTS))
    else:
        parts = np.full(own, (POINTS - 1) // own)
        parts[: (POINTS - 1) % own] += 1  # intervals differ by one part at most
        places = np.append(np.repeat(np.arange(own), parts) + _shares(parts), own)
    chosen = np.interp(places, np.arange(own + 1), closures)
    loads = np.asarray(PchipInterpolator(closures, pressures)(chosen))
    slope = (loads[-1] - loads[-2]) / (chosen[-1] - chosen[-2])
    further = np.linspace(chosen[-1], FAR, FURTHER + 1)[1:]
    last = loads[-1] + slope * (further - chosen[-1])
    return np.append(loads, last), np.append(chosen, further)


def _shares(parts: NDArray[np.int64]) -> Values:
    """Return where the parts of each interval begin, as shares of the interval."""
    return np.concatenate([np.arange(many) / many for many in parts])


def _name(path: Path) -> str:
    """Return the name of the interaction: letters, digits and underscores, a letter first."""
    own = re.sub(r"[^0-9A-Za-z]+", "_", path.stem).strip("_").upper()[:LONGEST_NAME]
    return own if own[:1].isalpha() else f"LAW_{own}".rstrip("_")


def _number(value: float) -> str:
    """Return a number of at most 20 characters, which both programs read."""
    return f"{value:.10g}"
