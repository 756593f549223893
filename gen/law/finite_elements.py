"""A contact law as tables: the surface interactions of CalculiX and Abaqus.

Both programs take the pressure over the closure as a table that begins at first touch, and join its
points by straight lines. A conductance is a second table, over the pressure. A line of it has
conductance, pressure and temperature in CalculiX. Abaqus needs the parameter PRESSURE, without
which it reads the second column as a clearance.

CalculiX 2.20, and its newest source (commit 3593817 of August 2026), have three limits:

- For contact from surface to surface, there is room for 20 points (springforc_f2f.f), and the
  pressure is constant beyond the last one. So 19 points follow the law, and the 20th is far away on
  the last slope.
- The number of points is read from the place of the 41st overclosure (plconloc(81), instead of
  plconloc(801)). So 21 more points follow on the last slope, and the last overclosure is 20.5.
- There is room for 20 conductances: further ones overwrite other numbers.

`gen.law.cubics` writes laws as smooth curves, with some of the texts of this module.
"""

import re
import textwrap
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Values
from gen.law.accuracy import deviations_with_errors
from gen.law.between import CALCULIX_POINTS, ENOUGH, MOST_AREA, in_range, merged
from gen.law.contact_law import Law
from gen.law.curves import risen, trend
from gen.law.friction import elastic_slip, stick_slope
from gen.law.layer import compliance_in_law
from gen.law.lines import LEVEL, Column, Deviation, Line
from gen.law.unit_systems import UNITS, UnitSystem
from gen.options import BAND_SIDES, Units
from gen.quantities import CLOSURE
from gen.runtime import VERSION, files
from gen.runtime.errors import InputError
from gen.runtime.installation import git_commit
from gen.runtime.terminal import echo

Program = Literal["calculix", "abaqus", "4c", "table"]
"""Program that reads a file; "table" for MOOSE, Ansys and COMSOL."""

FAR = np.linspace(10, CALCULIX_POINTS + 0.5, CALCULIX_POINTS + 2)
"""Overclosures of the 20th to the 41st point [unit of length of the file]. CalculiX takes the whole
number in the last one, 20.5, for the number of points."""

ROUNDING = 1e-4
"""Largest distance from the law that is written as 0, because rounding and the solver's tolerance
may cause it [%]."""

LONGEST_NAME = 60
"""Largest number of letters of the name of a surface interaction, which has to fit into 80."""

TEMPERATURE = 293.15
"""Temperature in the table of conductances, which do not depend on it; CalculiX wants one [K]."""


GAS_IN_WORDS = (
    "Gas in the gap: conductivity {:g} W/(m K), jump distance {:g} um; its part counts."
)
"""Template of the paragraph about a gas, for both numbers of `gen.material.Gas`."""

FOLLOWS = "beyond, the pressure follows the last slope"
"""What files say about pressures above the last one of the law, after "The law ends at ...:"."""


class BandParts(NamedTuple):
    """Names of the attributes of a `Curve` that one file has: "value", "low" or "high"."""

    closure: str
    conductance: str


SIDES = {
    "": BandParts(closure="value", conductance="value"),
    "soft": BandParts(closure="high", conductance="low"),
    "stiff": BandParts(closure="low", conductance="high"),
}
"""Parts of the curves by the side of the band: "" is the law itself. A soft interface closes
further under a pressure, and conducts less. Its elastic slips are taken as its closures, and its
stiffnesses in shear as its conductances."""


def write(path: Path, law: Law, program: Program, units: Units) -> list[Path]:
    """Write a law as a surface interaction for CalculiX or Abaqus.

    If the closure has a band, each side of the band gets a file of its own. A side that the program
    cannot take is left out with a warning: that happens where the band of few unlike surfaces is
    wide.

    Parameters
    ----------
    path : Path
        File of the law. The files of the sides have "-soft" and "-stiff" after its stem.
    law : Law
        The law, which closes somewhere.
    program : {"calculix", "abaqus"}
        Program that reads the file.
    units : {"mm", "si", "um"}
        System of units of the file.

    Returns
    -------
    list of Path
        The files that were written.

    Raises
    ------
    InputError
        If the program cannot take the law itself.
    """
    system = UNITS[units]
    texts = {path: "\n".join(_lines(path, law, program, system, ""))}
    if law.over_pressure.curves[CLOSURE.in_laws].banded.any():
        for side in BAND_SIDES:
            side_path = path.with_stem(f"{path.stem}-{side}")
            try:
                lines = _lines(side_path, law, program, system, side)
                texts[side_path] = "\n".join(lines)
            except InputError as fault:
                echo(f"warning: {side_path} is not written: {fault}")
    for text_path, text in texts.items():
        files.write(text_path, text + "\n")
    return list(texts)


@dataclass(frozen=True, eq=False)
class Joint:
    """The points of a law that become a table over the closure: first touch, then k contacts.

    Closure and pressure rise from each point to the next. All arrays have shape (k + 1,). Contacts
    outside a surrogate's training are left out.
    """

    pressures: Values  # [MPa]
    closures: Values  # [um]
    conductances: Values | None  # [W/(mm2 K)]; None if the law has none
    # True at first touch and the loads of the law, False at contacts solved between the loads.
    at_loads: NDArray[np.bool_]
    inside: NDArray[np.bool_]  # True where neither few nor nearly all nodes touch


def rising(law: Law, side: str = "", *, between: bool = False) -> Joint:
    """Return the points of a law from which a table over the closure is written.

    They are first touch, then the usable contacts: contacts inside a surrogate's training that have
    a closure and, if the law has a conductance, a conductance.

    Parameters
    ----------
    law : Law
        The law.
    side : {"", "soft", "stiff"}
        The law itself, or a side of its band.
    between : bool
        True to add the contacts that were solved between the loads of the law.

    Returns
    -------
    Joint
        Two points or more.

    Raises
    ------
    InputError
        If the law closes nowhere.
    """
    table = law.over_pressure
    if between and law.between_pressures is not None:
        table = merged(table, law.between_pressures)
    parts = SIDES[side]
    all_closures = getattr(table.curves[CLOSURE.in_laws], parts.closure)
    loaded = table.at > 0
    usable = loaded & np.isfinite(all_closures) & ~table.flagged
    if table.conductance_name:
        all_conductances = getattr(
            table.curves[table.conductance_name], parts.conductance
        )
        usable &= np.isfinite(all_conductances)
    usable_places = np.flatnonzero(usable)
    closures = outwards(all_closures[usable_places], parts.closure)
    kept = _apart(closures, side)
    if not kept.any():
        reason = ""
        if table.flagged.any():
            reason = (
                "; no load lies inside the surrogate's training; --solver solves the law"
            )
        raise InputError(
            f"the law closes nowhere: only --csv and --json can write it{reason}"
        )
    conductances: Values | None = None
    if table.conductance_name:
        # The curves over Delta begin at first touch, where only a gas conducts.
        gas_alone = law.over_delta.curves[table.conductance_name].value[0]
        conductances = all_conductances[usable_places]
        # The conductance of the gas alone may fall: contact takes the place of the gap.
        if trend(table.conductance_name) == "rises":
            conductances = outwards(conductances, parts.conductance)
        conductances = np.append(gas_alone, conductances[kept])
    places = usable_places[kept]
    inside = in_range(table, law.nodes)[places]
    # First touch is taken to be inside the range of `in_range` if the first contact is.
    return Joint(
        pressures=np.append(0.0, table.at[places]),
        closures=np.append(0.0, closures[kept]),
        conductances=conductances,
        at_loads=np.append(True, np.isin(table.at[places], law.over_pressure.at)),
        inside=np.append(inside[0], inside),
    )


def outwards(ends: Values, part: str) -> Values:
    """Make an end of a band rise with the load by moving it outwards, away from the law.

    The curve of each surface rises. The ends of a band of two or three surfaces may fall, because
    they are far from these curves. Each value of a high end becomes the largest of the values up to
    its load; each value of a low end becomes the smallest of the values from its load to the last.

    Parameters
    ----------
    ends : ndarray, shape (k,)
        The end at ascending loads.
    part : {"value", "low", "high"}
        Which end it is. Values of the law itself, "value", are returned as they are.

    Returns
    -------
    ndarray, shape (k,)
        The end that rises, or stays level.
    """
    if part == "high":
        return np.asarray(np.maximum.accumulate(ends))
    if part == "low":
        return np.asarray(np.minimum.accumulate(ends[::-1])[::-1])
    return ends


def _apart(closures: Values, side: str) -> NDArray[np.bool_]:
    """Return True at the points that a table keeps, so that its closures rise, (k,).

    Of neighbouring points with the same closure one is kept: the last, which has the largest
    pressure, on the stiff side of a band, else the first. Then no dropped point is beyond the
    straight lines of a side of the band.
    """
    if side != "stiff":
        return risen(closures, LEVEL)
    following = np.append(closures[1:], np.inf)
    return np.asarray((closures > 0) & (following > (1 + LEVEL) * closures))


@dataclass(frozen=True, eq=False)
class Tables:
    """The tables of an input file, whose points straight lines join."""

    behaviour: Line  # pressure [MPa] over closure [um]
    # Conductance [W/(mm2 K)] over pressure [MPa]; None if the law has none.
    conducting: Line | None
    # 0 and the pressures of all contacts from which the tables were made [MPa], (k + 1,).
    pressures: Values
    # Distances of the lines from the law, of "pressure" and, if there is one, "conductance".
    deviations: dict[str, Deviation]


def _tables(law: Law, side: str, *, calculix: bool) -> Tables:
    """Lay the points of both tables for a law, or for a side of its band.

    For a side, contacts between the loads of the law are not used: `outwards` moves the ends of the
    band at the loads.
    """
    joint = rising(law, side, between=(side == ""))
    pressure = _pressure_column(joint)
    behaviour = pressure.laid()
    if calculix:
        # CalculiX has room for `CALCULIX_POINTS`, the last of which is the first one of `FAR`. All
        # the other ones are laid, even if fewer would follow the law well enough.
        behaviour = pressure.laid(CALCULIX_POINTS - 1, filled=True)
    deviations = {"pressure": pressure.deviation(behaviour)}
    if not side:
        checked = _off_checks(law, behaviour, CLOSURE.in_laws)
        deviations["pressure"] = deviations["pressure"].or_more(checked)
    conducting: Line | None = None
    if joint.conductances is not None:
        conductance = _conductance_column(joint, joint.conductances)
        conducting = conductance.laid(CALCULIX_POINTS if calculix else None)
        deviations["conductance"] = conductance.deviation(conducting)
        if not side:
            checked = _off_checks(law, conducting, law.over_pressure.conductance_name)
            deviations["conductance"] = deviations["conductance"].or_more(checked)
    return Tables(
        behaviour=behaviour,
        conducting=conducting,
        pressures=joint.pressures,
        deviations=deviations,
    )


def _lines(
    path: Path, law: Law, program: Program, units: UnitSystem, side: str
) -> Iterator[str]:
    """Yield the lines of an input file: of the law, or of a side of its band."""
    calculix = program == "calculix"
    tables = _tables(law, side, calculix=calculix)
    yield from comment(description(law, program, units, tables.pressures, side), "** ")
    yield from comment([_lines_in_words(law, side, tables.deviations)], "** ")
    yield f"*SURFACE INTERACTION, NAME={name_in_capitals(path, LONGEST_NAME)}"
    yield "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TABULAR"
    loads = tables.behaviour.values * units.pressure
    overclosures = tables.behaviour.at * units.length
    if calculix:
        loads, overclosures = _with_far_points(loads, overclosures)
    for load, overclosure in zip(loads, overclosures, strict=True):
        yield f"{load:.10g}, {overclosure:.10g}"  # 20 characters at most, which both programs read
    yield from _friction_lines(law, units, side, calculix=calculix)
    if tables.conducting is not None:
        yield from _conductance_lines(tables.conducting, units, calculix=calculix)


def name_in_capitals(path: Path, longest: int | None = None) -> str:
    """Change the stem of a file into a valid name of an interaction or a table.

    Letters are upper case, other characters than letters and digits become "_", and a name that
    does not begin with a letter gets "LAW_" before it.

    Parameters
    ----------
    path : Path
        The file.
    longest : int, optional
        Largest number of characters before "LAW_" is added; by default all are kept.

    Returns
    -------
    str
        The name, as "STEEL_2" for steel-2.inp.
    """
    stem = re.sub(r"[^0-9A-Za-z]+", "_", path.stem)
    name = stem.strip("_").upper()[:longest]
    if name[:1].isalpha():
        return name
    return f"LAW_{name}".rstrip("_")


def write_lines(path: Path, lines: Iterable[str]) -> list[Path]:
    """Write the lines of a program's only file.

    Parameters
    ----------
    path : Path
        The file.
    lines : iterable of str
        Its lines, without line ends.

    Returns
    -------
    list of Path
        The file, as the result of a function of `gen.law.files.WRITERS`.
    """
    files.write(path, "\n".join(lines) + "\n")
    return [path]


def _friction_lines(
    law: Law, units: UnitSystem, side: str, *, calculix: bool
) -> Iterator[str]:
    """Yield the keyword of the friction with its line, below a comment about it.

    Without friction there are no lines. Without --at-pressure CalculiX gets a comment alone. The
    soft side of a band has its large elastic slips and its small stiffnesses in shear, as it has
    large closures and small conductances.
    """
    friction = law.order.friction
    if friction is None:
        return
    parts = SIDES[side]
    pressure = law.order.stick_pressure
    if not calculix:
        slip = elastic_slip(law, parts.closure, units)
        yield from comment([slip.words], "** ")
        yield f"*FRICTION, ELASTIC SLIP={slip.value:.10g}"
        yield f"{friction.coefficient:.10g}"
    elif pressure is None:
        yield (
            "** No *FRICTION: its stick slope grows with the pressure; --at-pressure gives it"
            " at one."
        )
    else:
        slope = stick_slope(law, pressure, parts.conductance, units)
        yield from comment([slope.words], "** ")
        yield "*FRICTION"
        yield f"{friction.coefficient:.10g}, {slope.value:.10g}"


def _conductance_lines(
    conducting: Line, units: UnitSystem, *, calculix: bool
) -> Iterator[str]:
    """Yield the keyword line of the conductance, then the lines of its table."""
    keyword = "*GAP CONDUCTANCE, PRESSURE"
    temperature = ""
    if calculix:
        keyword = "*GAP CONDUCTANCE"
        temperature = f", {TEMPERATURE:.10g}"
    yield keyword
    loads = conducting.at * units.pressure
    conductances = conducting.values * units.conductance
    for conductance, load in zip(conductances, loads, strict=True):
        yield f"{conductance:.10g}, {load:.10g}{temperature}"


def _pressure_column(joint: Joint) -> Column:
    """Return the column of the pressure over the closure [MPa over um].

    Between its points, the pressure is taken as an exponential of the closure.
    """
    return Column.through(
        at=joint.closures,
        values=joint.pressures,
        at_loads=joint.at_loads,
        inside=joint.inside,
        power_law=False,
    )


def _conductance_column(joint: Joint, conductances: Values) -> Column:
    """Return the column of the joint's conductances over the pressure [W/(mm2 K) over MPa].

    `conductances` has shape (k + 1,). Between its points, the conductance is taken as a power of
    the pressure.
    """
    return Column.through(
        at=joint.pressures,
        values=conductances,
        at_loads=joint.at_loads,
        inside=joint.inside,
        power_law=True,
    )


def _off_checks(law: Law, line: Line, quantity: str) -> Deviation:
    """Return the largest relative distances [1] of a line from the law's checks.

    Checks are contacts that were solved without any part in the choice of the line's points.
    `quantity` is the closure for a line of pressures over closures, or the conductance for a line
    of conductances over pressures. Both distances are NaN without checks.
    """
    checks = law.checks
    if checks is None or quantity not in checks.curves:
        return Deviation(inside=np.nan, outside=np.nan)
    values = checks.curves[quantity].value
    if quantity == CLOSURE.in_laws:  # the closure is the argument of its line
        at = values
        solved = checks.at
    else:
        at = checks.at
        solved = values
    # A line begins at first touch, and its second point is the first load. Nothing was computed
    # between both, so checks there are left out.
    compared = (at >= line.at[1]) & (at <= line.at[-1])
    usable = compared & np.isfinite(values) & (solved > 0)
    line_values = np.interp(at[usable], line.at, line.values)
    distances = np.abs(line_values / solved[usable] - 1)
    inside = in_range(checks, law.nodes)
    return Deviation.of(distances, inside[usable])


def _lines_in_words(law: Law, side: str, deviations: Mapping[str, Deviation]) -> str:
    """Return a paragraph about how far the straight lines of the tables are off the law."""
    between = law.between_pressures
    if side:
        reference = "the curve through the loads of the law"
    elif between is None:
        reference = (
            "the curve through the loads of the law, between which no contact was solved"
        )
    else:
        number = between.at.size
        if law.checks is not None:
            number += law.checks.at.size
        reference = f"contacts at {number} pressures between the loads of the law"
    largest = f"It is off {reference}, by up to this, {in_words(deviations)}."
    together = ""
    if law.order.errors is not None:
        tables = (law.over_pressure, law.between_pressures, law.checks)
        together = deviations_with_errors(tables, law.order.errors, deviations)
    return f"The table is straight between its points. {largest}{together}"


def in_words(deviations: Mapping[str, Deviation]) -> str:
    """Say how far columns are off the law: in the range followed closely, and elsewhere.

    Lines follow the law closely where neither few nor nearly all nodes touch.

    Parameters
    ----------
    deviations : mapping
        Deviations by the names of the columns. A number that is NaN is left out.

    Returns
    -------
    str
        Part of a sentence, without a full stop. If all numbers are NaN, it says that there is one
        load.
    """
    # Numbers that are NaN fail the comparison.
    inside = {name: off.inside for name, off in deviations.items() if off.inside >= 0}
    outside = {name: off.outside for name, off in deviations.items() if off.outside >= 0}
    texts: list[str] = []
    elsewhere = f"where fewer than {ENOUGH} nodes or nearly all touch"
    if inside:
        where = f"where {ENOUGH} nodes or more and up to {MOST_AREA:g} % of all touch"
        texts.append(f"{where}: {_percentages(inside)}")
        elsewhere = "elsewhere"
    if outside:
        texts.append(f"{elsewhere}: {_percentages(outside)}")
    return "; ".join(texts) or "nowhere, as it has one load"


def _percentages(shares: Mapping[str, float]) -> str:
    """Return names with their shares in per cent, as "pressure 1.2 %, conductance 0 %".

    Numbers up to `ROUNDING` become 0.
    """
    texts: list[str] = []
    for name, share in shares.items():
        percent = 100 * share
        if percent <= ROUNDING:
            percent = 0.0
        rounded = float(f"{percent:.2g}")  # so that 160 is not written as 1.6e+02
        texts.append(f"{name} {rounded:g} %")
    return ", ".join(texts)


def comment(paragraphs: Iterable[str], mark: str, width: int = 100) -> Iterator[str]:
    """Break paragraphs into lines of a comment.

    Characters outside printable ASCII become "?".

    Parameters
    ----------
    paragraphs : iterable of str
        The paragraphs, without line ends.
    mark : str
        What begins each line, as "# ". Two blanks follow it on all but a paragraph's first line.
    width : int
        Largest number of characters of a line.

    Yields
    ------
    str
        A line of the comment, without its end.
    """
    for text in paragraphs:
        printable = re.sub(r"[^ -~]", "?", text)
        yield from textwrap.wrap(
            printable,
            width,
            initial_indent=mark,
            subsequent_indent=f"{mark}  ",
            break_on_hyphens=False,
        )


def description(
    law: Law, program: Program, units: UnitSystem, pressures: Values, side: str
) -> Iterator[str]:
    """Yield the paragraphs of the comment at the top of a file.

    Parameters
    ----------
    law : Law
        The law.
    program : {"calculix", "abaqus", "4c", "table"}
        Program that reads the file.
    units : UnitSystem
        Units of the file.
    pressures : ndarray, shape (k + 1,)
        0 and the pressures of the contacts in the file [MPa].
    side : {"", "soft", "stiff"}
        The law itself, or a side of its band.

    Yields
    ------
    str
        A paragraph.
    """
    yield f"Contact of rough surfaces: {law.bodies.text}. Units: {units.text}."
    if program != "4c":  # its file has no conductance
        yield from _conductors(law)
    yield f"Surface: {'; '.join(law.descriptions)}"
    for source in law.sources:
        yield f"From: {source.text}"
    if side:
        yield from _side_in_words(law, side)
    yield f"Command: {law.order.command}"
    yield f"Made by asperity {VERSION} {git_commit()[:12]}"
    for note in law.notes:
        yield f"How: {note}"
    contents = "these tables are the interface's alone"
    if compliance_in_law(law.order, law.bodies) > 0:
        contents = "these tables are those of interface and layer together"
    yield (
        "Overclosure is counted from first touch: let the two meshes just touch where the highest"
        f" asperities do. The elastic bodies are the mesh's; {contents}."
    )
    between = "the table is a straight line"
    if program == "4c":
        between = "the cubic joins both"
    yield (
        f"From 0 to the first pressure, {pressures[1]:.6g} MPa, nothing was computed: there"
        f" {between}."
    )
    end = f"The law ends at {pressures[-1]:.6g} MPa"
    beyond = beyond_in_words(law, pressures[-1])
    if program == "table":
        yield f"{end}. {beyond}"
        yield (
            "The pressure over the closure has two further points, far away: before first touch"
            " with the pressure 0, and beyond the end on the last slope. Let the tables over the"
            " pressure stay at their last values. Shares are parts of 1. This file was not tried in"
            " the program that reads it."
        )
        return
    yield f"{end}: {FOLLOWS}. {beyond}"
    if law.over_pressure.conductance_name and program != "4c":
        yield "Beyond its last point the conductance stays the last one."
    if program == "calculix":
        yield from _advice_for_calculix(conducts=bool(law.over_pressure.conductance_name))


def beyond_in_words(law: Law, last_pressure: float) -> str:
    """Say why a file has no contacts beyond its last pressure, and what may be done.

    Parameters
    ----------
    law : Law
        The law, with its points outside a surrogate's training.
    last_pressure : float
        The last pressure in the file [MPa].

    Returns
    -------
    str
        Sentences.
    """
    table = law.over_pressure
    if (table.flagged & (table.at > last_pressure)).any():
        return (
            "The larger loads of the law lie outside the surrogate's training and are left out:"
            " train it on them, or solve the law."
        )
    return (
        "No contact was computed there. Give larger pressures, up to full contact, if your model"
        " gets there."
    )


def _conductors(law: Law) -> Iterator[str]:
    """Yield paragraphs about the conductivities of the bodies and about the gas, if given."""
    if law.order.conductivities is not None:
        k1, k2 = law.order.conductivities
        yield f"Conductivities of the bodies: {k1:g} and {k2:g} W/(m K)."
    if law.order.gas is not None:
        yield GAS_IN_WORDS.format(*law.order.gas)


def _side_in_words(law: Law, side: str) -> Iterator[str]:
    """Yield paragraphs that say what a side of the band is, and whether `outwards` moved it."""
    parts = SIDES[side]
    yield (
        f"The {side} side of the band: its {parts.closure} closures and {parts.conductance}"
        " conductances, ends at each load by itself and not the curves of one surface. Band:"
        f" {law.band}."
    )
    closures = getattr(law.over_pressure.curves[CLOSURE.in_laws], parts.closure)
    if (np.diff(closures[np.isfinite(closures)]) < 0).any():
        yield (
            "Where its closures turn back, this side is drawn outwards until they rise: a band"
            " of more surfaces is smoother."
        )


def _advice_for_calculix(*, conducts: bool) -> Iterator[str]:
    """Yield paragraphs on how CalculiX reads the tables, and for which kind of contact they are."""
    last = CALCULIX_POINTS - 1
    yield (
        f"CalculiX (2.20 and its source of August 2026) reads {CALCULIX_POINTS} points and"
        f" holds the pressure behind them. So the first {last} lines of the table follow the law."
        " The first two and the last of them lie on it; the others may lie a little beside it,"
        " so that straight lines are as near to it as possible. All further lines continue the"
        f" last slope; the overclosure of the last line, {FAR[-1]:g}, is where CalculiX finds the"
        " number of points."
    )
    faces = "Take TYPE=SURFACE TO SURFACE in *CONTACT PAIR, for which this table is made"
    if conducts:
        faces += (
            ": with TYPE=NODE TO SURFACE CalculiX passes no heat, and says nothing of it"
        )
    yield f"{faces}."


def _with_far_points(loads: Values, overclosures: Values) -> tuple[Values, Values]:
    """Append the points at `FAR` on the last slope to pressures and overclosures, both (k,).

    All are in the units of the file. Raises InputError if the last overclosure reaches the first
    one of `FAR`.
    """
    if overclosures[-1] >= FAR[0]:
        raise InputError(
            f"the law closes by {overclosures[-1]:.4g}: CalculiX takes up to {FAR[0]:g}"
        )
    slope = (loads[-1] - loads[-2]) / (overclosures[-1] - overclosures[-2])
    last_pressure = loads[-1] + slope * (FAR - overclosures[-1])
    return np.append(loads, last_pressure), np.append(overclosures, FAR)
