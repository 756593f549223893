"""A contact law for finite elements: for CalculiX, Abaqus, 4C, and contact elements in C.

The C header has all curves as monotone cubics with consistent tangents. Its names come from the
file's, so that one program can include several laws.

CalculiX and Abaqus take the pressure over the closure as a table, from first touch on. Of the gap's
conductance CalculiX takes conductance, pressure and temperature a line; Abaqus needs the parameter
PRESSURE, without which it takes the second column for a clearance.

CalculiX 2.20, like its newest source (commit 3593817 of August 2026), has room for 20 points where
it presses surface to surface (springforc_f2f.f), takes their number from where the 41st overclosure
stands (plconloc(81), instead of plconloc(801)), and holds the pressure constant behind the last.
So 19 points belong to the law, the 20th is far away on the last slope, and so are 21 more, which
bring the number 20 to its place. What follows 20 conductances overwrites other numbers.

4C imports a Python file and calls its functions with the gap at a node, which is negative where the
bodies overlap, and the offset of its input, by which they have to overlap before they touch. It
does so where gap + offset <= 0, and takes pressures as negative, so that derivatives are positive.
"""

import re
import textwrap
import zlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Values
from gen.law.between import CALCULIX_POINTS, ENOUGH, MOST_AREA, in_range, merged
from gen.law.contact_law import Law
from gen.law.curves import APART, Curves, risen, slopes, trend
from gen.law.lines import LEVEL, Column, Deviation, Line
from gen.options import BAND_SIDES, Units
from gen.quantities import ALSO, CLOSURE, IN_LAWS
from gen.runtime import VERSION, files
from gen.runtime.errors import InputError
from gen.runtime.installation import git_commit
from gen.runtime.terminal import echo

Program = Literal["calculix", "abaqus", "4c"]

FAR = np.linspace(10, CALCULIX_POINTS + 0.5, CALCULIX_POINTS + 2)
"""Overclosures of the 20th to the 41st point, of which the last has the number of points in it
[unit of length]."""

ROUNDING = 1e-4
"""Distance of a cubic from a contact below which it is rounding or the solver's tolerance [%]."""

LONGEST_NAME = 60
TEMPERATURE = 293.15
"""Temperature beside conductances that do not depend on it, which CalculiX asks for [K]."""


class UnitSystem(NamedTuple):
    """A consistent system of units: its description, and what the units of laws are in it."""

    text: str
    pressure: float  # 1 MPa
    length: float  # 1 um
    conductance: float  # 1 W/(mm2 K)


UNITS: dict[Units, UnitSystem] = {
    "mm": UnitSystem("mm, N, s, MPa; conductance in mW/(mm2 K)", 1.0, 1e-3, 1e3),
    "si": UnitSystem("m, N, s, Pa; conductance in W/(m2 K)", 1e6, 1e-6, 1e6),
    "um": UnitSystem("um, uN, s, MPa; conductance in pW/(um2 K)", 1.0, 1.0, 1e6),
}

FUNCTIONS = Path(__file__).parent
"""Folder of the functions that the files in C and for 4C hold: law.h.in and law_4c.py.in."""

GAS_IN_WORDS = (
    "Gas in the gap: conductivity {:g} W/(m K), jump distance {:g} um; its part counts."
)

BEYOND = (
    "beyond, the pressure follows the last slope. No contact was computed there. Give larger"
    " pressures, up to full contact, if your model gets there."
)


class BandEnds(NamedTuple):
    """Parts of the curves of closure and conductance that one file takes."""

    closure: str  # "value", "low" or "high"
    conductance: str


SIDES = {
    "": BandEnds("value", "value"),
    "soft": BandEnds("high", "low"),
    "stiff": BandEnds("low", "high"),
}
"""What the law and each side of its band take of the curves of closure and conductance."""


def write(path: Path, law: Law, program: Program, units: Units) -> list[Path]:
    """Write the surface interaction of a law, and those of both sides of a band of its closure.

    A side that the program cannot take, because the band of few unlike surfaces is wide, is left
    out with a warning.

    Parameters
    ----------
    path : Path
        File of the law. The sides of the band stand beside it.
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


def write_for_4c(path: Path, law: Law, units: Units) -> list[Path]:
    """Write a law's monotone cubic as the Python file of a contact constitutive law of 4C.

    Parameters
    ----------
    path : Path
        The file.
    law : Law
        The law, which closes somewhere.
    units : {"mm", "si", "um"}
        System of units of the file.

    Returns
    -------
    list of Path
        The file.
    """
    joint = rising(law)
    system = UNITS[units]
    loads = joint.pressures * system.pressure
    overclosures = joint.closures * system.length
    columns = {
        "CLOSURES": overclosures,
        "PRESSURES": loads,
        "SLOPES": _slopes_that_go_on(overclosures, loads),
    }
    lines = list(_comment(_description(law, "4c", system, joint.pressures, ""), "# "))
    lines += _comment([_cubics_in_words(law, [_pressure_at_closure(law)])], "# ")
    lines.append("")
    lines += (FUNCTIONS / "law_4c.py.in").read_text(encoding="ascii").splitlines()
    for name, values in columns.items():
        lines += ["", f"{name} = ("]
        lines += [f"    {value!r}," for value in values.tolist()]
        lines.append(")")
    files.write(path, "\n".join(lines) + "\n")
    return [path]


@dataclass(frozen=True, eq=False)
class Joint:
    """Points inside the training at which closure and pressure rise, from first touch, (k + 1,)."""

    pressures: Values  # [MPa]
    closures: Values  # [um]
    conductances: Values | None  # [W/(mm2 K)]; None if the law has none
    at_loads: NDArray[np.bool_]  # where the points are at loads of the law, not between
    inside: NDArray[np.bool_]  # where neither few nor nearly all nodes touch


def rising(law: Law, side: str = "", *, between: bool = False) -> Joint:
    """Return the points of a law that tables over the closure hold.

    Parameters
    ----------
    law : Law
        The law.
    side : {"", "soft", "stiff"}
        The law itself, or a side of its band.
    between : bool
        True to have contacts that were solved between its points, too.

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
    ends = SIDES[side]
    all_closures = getattr(table.curves[CLOSURE.in_laws], ends.closure)
    usable = (table.at > 0) & np.isfinite(all_closures) & ~table.flagged
    if table.conducting:
        all_conductances = getattr(table.curves[table.conducting], ends.conductance)
        usable &= np.isfinite(all_conductances)
    usable_places = np.flatnonzero(usable)
    closures = outwards(all_closures[usable_places], ends.closure)
    kept = _apart(closures, side)
    if not kept.any():
        reason = ""
        if table.flagged.any():
            reason = (
                ": no load lies inside the surrogate's training; --solver solves the law"
            )
        raise InputError(
            f"the law closes nowhere, so that only tables can be written{reason}"
        )
    conductances: Values | None = None
    if table.conducting:
        gas_alone = law.over_delta.curves[table.conducting].value[0]
        conductances = all_conductances[usable_places]
        # A gas conducts less where contact has taken its place, so that it may fall.
        if trend(table.conducting) == "rises":
            conductances = outwards(conductances, ends.conductance)
        conductances = np.append(gas_alone, conductances[kept])
    places = usable_places[kept]
    inside = in_range(table, law.nodes)[places]
    return Joint(
        pressures=np.append(0.0, table.at[places]),
        closures=np.append(0.0, closures[kept]),
        conductances=conductances,
        at_loads=np.append(True, np.isin(table.at[places], law.over_pressure.at)),
        inside=np.append(inside[0], inside),
    )


def outwards(ends: Values, part: str) -> Values:
    """Make an end of a band rise with the load, without drawing it into the band.

    Every surface rises, but the ends of a band of two or three surfaces are so far from them that
    they may fall: a high end then stays at its largest value before, and a low one is at its
    smallest value behind.

    Parameters
    ----------
    ends : ndarray, shape (k,)
        The end at ascending loads.
    part : {"value", "low", "high"}
        Which end it is; "value" for the law itself, which is left as it is.

    Returns
    -------
    ndarray, shape (k,)
        The end, nowhere inside the one that was given.
    """
    if part == "high":
        return np.asarray(np.maximum.accumulate(ends))
    if part == "low":
        return np.asarray(np.minimum.accumulate(ends[::-1])[::-1])
    return ends


def _apart(closures: Values, side: str) -> NDArray[np.bool_]:
    """Return where the closure rises, of which the table of a program is made, (k,).

    Of points with one closure the first is kept, and for the stiff side the last: straight lines
    to the next point are then on the outer side of the points between.
    """
    if side != "stiff":
        return risen(closures, LEVEL)
    following = np.append(closures[1:], np.inf)
    return np.asarray((closures > 0) & (following > (1 + LEVEL) * closures))


@dataclass(frozen=True, eq=False)
class Tables:
    """The tables of an input file, which are straight between their points."""

    behaviour: Line  # pressure over closure [MPa, um]
    conducting: Line | None  # conductance over pressure [W/(mm2 K), MPa]; None without
    pressures: Values  # of all contacts, from 0 on [MPa], (k,)
    deviations: dict[str, Deviation]  # of the lines from the law, by columns


def _tables(law: Law, side: str, *, calculix: bool) -> Tables:
    """Lay the points of both tables for a law, or for a side of its band.

    A side has the loads of the law alone: it is drawn outwards from its ends there.
    """
    joint = rising(law, side, between=not side)
    pressure = _pressure_column(joint)
    behaviour = pressure.laid()
    if calculix:
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
            checked = _off_checks(law, conducting, law.over_pressure.conducting)
            deviations["conductance"] = deviations["conductance"].or_more(checked)
    return Tables(behaviour, conducting, joint.pressures, deviations)


def _lines(
    path: Path, law: Law, program: Program, units: UnitSystem, side: str
) -> Iterator[str]:
    """Yield the lines of an input file: of the law, or of a side of its band."""
    calculix = program == "calculix"
    tables = _tables(law, side, calculix=calculix)
    yield from _comment(_description(law, program, units, tables.pressures, side), "** ")
    yield from _comment([_lines_in_words(law, side, tables.deviations)], "** ")
    yield f"*SURFACE INTERACTION, NAME={_interaction_name(path)}"
    yield "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TABULAR"
    loads = tables.behaviour.values * units.pressure
    overclosures = tables.behaviour.at * units.length
    if calculix:
        loads, overclosures = _with_far_points(loads, overclosures)
    for load, overclosure in zip(loads, overclosures, strict=True):
        yield f"{load:.10g}, {overclosure:.10g}"  # 20 characters at most, which both programs read
    if tables.conducting is not None:
        yield from _conductance_lines(tables.conducting, units, calculix=calculix)


def _interaction_name(path: Path) -> str:
    """Return the name of the surface interaction in a file, which begins with a letter."""
    stem = re.sub(r"[^0-9A-Za-z]+", "_", path.stem)
    name = stem.strip("_").upper()[:LONGEST_NAME]
    if name[:1].isalpha():
        return name
    return f"LAW_{name}".rstrip("_")


def _conductance_lines(
    conducting: Line, units: UnitSystem, *, calculix: bool
) -> Iterator[str]:
    """Yield the keyword of the conductance and its table."""
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
    """Return the pressure over the closure."""
    return Column.through(
        joint.closures, joint.pressures, joint.at_loads, joint.inside, powers=False
    )


def _conductance_column(joint: Joint, conductances: Values) -> Column:
    """Return the conductance over the pressure."""
    return Column.through(
        joint.pressures, conductances, joint.at_loads, joint.inside, powers=True
    )


def _off_checks(law: Law, line: Line, quantity: str) -> Deviation:
    """Return how far a line is off contacts that had no part in laying its points.

    The line of the closure has pressures over closures, that of a conductance is over pressures.
    """
    checks = law.checks
    if checks is None or quantity not in checks.curves:
        return Deviation(np.nan, np.nan)
    values = checks.curves[quantity].value
    at = checks.at
    solved = values
    if quantity == CLOSURE.in_laws:
        at = values
        solved = checks.at
    usable = np.isfinite(values) & (at >= line.at[1]) & (at <= line.at[-1]) & (solved > 0)
    lines = np.interp(at[usable], line.at, line.values)
    return Deviation.of(
        np.abs(lines / solved[usable] - 1), in_range(checks, law.nodes)[usable]
    )


def _lines_in_words(law: Law, side: str, deviations: Mapping[str, Deviation]) -> str:
    """Say how far the straight lines between the points of a table are off the law."""
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
    largest = f"It is off {reference}, by up to this, {_in_words(deviations)}."
    return f"The table is straight between its points. {largest}"


def _in_words(deviations: Mapping[str, Deviation]) -> str:
    """Say how far each column is off, where neither few nor nearly all nodes touch, and elsewhere.

    A column that is nowhere off, as it has no two loads, is left out.
    """
    inside = {name: off.inside for name, off in deviations.items() if off.inside >= 0}
    outside = {name: off.outside for name, off in deviations.items() if off.outside >= 0}
    texts = []
    elsewhere = f"where fewer than {ENOUGH} nodes or nearly all touch"
    if inside:
        where = f"where {ENOUGH} nodes or more and up to {MOST_AREA:g} % of all touch"
        texts.append(f"{where}: {_percentages(inside)}")
        elsewhere = "elsewhere"
    if outside:
        texts.append(f"{elsewhere}: {_percentages(outside)}")
    return "; ".join(texts) or "nowhere, as it has one load"


def _percentages(shares: Mapping[str, float]) -> str:
    """Write shares in per cent beside their names; those of rounding are 0."""
    percents = {name: 100 * share for name, share in shares.items()}
    rounded = {
        name: share if share > ROUNDING else 0.0 for name, share in percents.items()
    }
    return ", ".join(f"{name} {share:.2g} %" for name, share in rounded.items())


def _comment(paragraphs: Iterable[str], mark: str, width: int = 100) -> Iterator[str]:
    """Yield the lines of paragraphs, each after the mark of a comment."""
    for text in paragraphs:
        yield from textwrap.wrap(
            re.sub(r"[^ -~]", "?", text),
            width,
            initial_indent=mark,
            subsequent_indent=f"{mark}  ",
            break_on_hyphens=False,
        )


def _description(
    law: Law, program: Program, units: UnitSystem, pressures: Values, side: str
) -> Iterator[str]:
    """Yield the paragraphs of the comment at the top."""
    yield f"Contact of rough surfaces: {law.bodies.text}. Units: {units.text}."
    if program != "4c":
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
    yield (
        "Overclosure is counted from first touch: let the two meshes just touch where the highest"
        " asperities do. The elastic bodies are the mesh's; these tables are the interface's alone."
    )
    between = "the table is a straight line"
    if program == "4c":
        between = "the cubic joins both"
    yield (
        f"From 0 to the first pressure, {pressures[1]:.6g} MPa, nothing was computed: there"
        f" {between}."
    )
    yield f"The law ends at {pressures[-1]:.6g} MPa: {BEYOND}"
    if law.over_pressure.conducting and program != "4c":
        yield "Beyond its last point the conductance stays the last one."
    if program == "calculix":
        yield from _advice_for_calculix(conducts=bool(law.over_pressure.conducting))


def _conductors(law: Law) -> Iterator[str]:
    """Yield what conducts through the interface."""
    if law.order.conductivities is not None:
        k1, k2 = law.order.conductivities
        yield f"Conductivities of the bodies: {k1:g} and {k2:g} W/(m K)."
    if law.order.gas is not None:
        yield GAS_IN_WORDS.format(*law.order.gas)


def _side_in_words(law: Law, side: str) -> Iterator[str]:
    """Yield what a side of the band is."""
    ends = SIDES[side]
    yield (
        f"The {side} side of the band: its {ends.closure} closures and {ends.conductance}"
        " conductances, ends at each load by itself and not the curves of one surface. Band:"
        f" {law.band}."
    )
    closures = getattr(law.over_pressure.curves[CLOSURE.in_laws], ends.closure)
    if (np.diff(closures[np.isfinite(closures)]) < 0).any():
        yield (
            "Where its closures turn back, this side is drawn outwards until they rise: a band"
            " of more surfaces is smoother."
        )


def _advice_for_calculix(*, conducts: bool) -> Iterator[str]:
    """Yield how CalculiX reads the tables, and the kind of contact that they are made for."""
    last = CALCULIX_POINTS - 1
    yield (
        f"CalculiX (2.20 and its source of August 2026) reads {CALCULIX_POINTS} points and"
        f" holds the pressure behind them. So the first {last} lines of the table are points"
        " of the law, laid where straight lines follow it best. All others continue its last"
        f" slope; the overclosure of the last line, {FAR[-1]:g}, is where CalculiX finds the"
        " number of points."
    )
    faces = "Take TYPE=SURFACE TO SURFACE in *CONTACT PAIR, for which this table is made"
    if conducts:
        faces += (
            ": with TYPE=NODE TO SURFACE CalculiX passes no heat, and says nothing of it"
        )
    yield f"{faces}."


def _with_far_points(loads: Values, overclosures: Values) -> tuple[Values, Values]:
    """Append the points at `FAR` on the last slope, in the units of the file."""
    if overclosures[-1] >= FAR[0]:
        raise InputError(
            f"the law closes by {overclosures[-1]:.4g}: CalculiX takes up to {FAR[0]:g}"
        )
    slope = (loads[-1] - loads[-2]) / (overclosures[-1] - overclosures[-2])
    further = loads[-1] + slope * (FAR - overclosures[-1])
    return np.append(loads, further), np.append(overclosures, FAR)


PER_LINE = 5  # numbers in a line of the C header


def write_header(path: Path, law: Law) -> list[Path]:
    """Write a law as a C header, without the points outside a surrogate's training.

    Parameters
    ----------
    path : Path
        The file, from whose name those of its functions come.
    law : Law
        The law, which closes somewhere.

    Returns
    -------
    list of Path
        The file.
    """
    law = _inside_training(law)
    stem = re.sub(r"[^0-9A-Za-z]+", "_", path.stem).strip("_")
    name = f"asperity_{stem or 'law'}"  # asperity_steel_2 for steel-2.h
    guard = f"{name.upper()}_H"
    functions = list(_functions(law))
    body = list(_body(functions, name))
    checksum = f"0x{zlib.crc32(chr(10).join(body).encode()):08x}u"
    description = [*_header_description(law, name), _cubics_in_words(law, functions)]
    # Names may have what would end a comment, splice lines or make a compiler warn.
    odd = re.compile(r"[^ -~]|[\\?]|\*(?=/)|(?<=/)\*")
    # A second law of this name in a program is an error.
    lines = [
        "/*",
        *_comment((odd.sub("_", text) for text in description), " * ", 96),
        " */",
        f"#ifdef {guard}",
        f"#if {guard} != {checksum}",
        f'#error "two laws are named {name}: give one of the headers another file name"',
        "#endif",
        "#else",
        f"#define {guard} {checksum}",
        *body,
        "#endif",
    ]
    files.write(path, "\n".join(lines) + "\n")
    return [path]


def _inside_training(law: Law) -> Law:
    """Return a law without the points outside a surrogate's training."""
    over_delta = law.over_delta
    over_pressure = law.over_pressure
    if not over_delta.flagged.any() and not over_pressure.flagged.any():
        return law
    return replace(
        law,
        over_delta=over_delta.chosen(~over_delta.flagged),
        over_pressure=over_pressure.chosen(~over_pressure.flagged),
    )


def _header_description(law: Law, name: str) -> Iterator[str]:
    """Yield the paragraphs of the comment at the top."""
    commit = git_commit()[:12]
    yield f"Contact law of rough surfaces, E* = {law.bodies.e_star:.17g} MPa."
    if law.bodies.hardness is not None:
        yield f"Bodies that yield, without hardening: hardness {law.bodies.hardness:.17g} MPa."
    if law.order.gas is not None:
        yield GAS_IN_WORDS.format(*law.order.gas)
    yield f"Surface: {'; '.join(law.descriptions)}"
    for source in law.sources:
        yield f"From: {source.text}"
    if law.order.command:
        yield f"Command: {law.order.command}"
    yield f"Made: {datetime.now(UTC).isoformat(timespec='seconds')}, asperity {VERSION} {commit}"
    for note in law.notes:
        yield f"How: {note}"
    yield _band_in_words(law)
    yield (
        "Delta, closure and mean gap in um, nominal pressure in MPa, area in %, force in uN,"
        " stiffness in MPa/um, conductance in W/(mm2 K)."
    )
    for name_of_quantity in law.order.also:
        quantity = ALSO[name_of_quantity]
        yield f"{short_name(quantity.in_laws)}: {quantity.words} [{quantity.unit}]."
    yield (
        "Closure is what the interface alone gives way from first touch on:"
        f" {name}_pressure_at_closure(closure) and its tangent are the law of a contact element."
    )
    yield (
        f"{name}_area(delta), {name}_delta_at_pressure(pressure) and the like are monotone cubics;"
        " _tangent is their slope. Below 0 they are as at first touch, with tangents of 0."
    )
    ends = f"{law.over_delta.at[-1]:.6g} um and {law.over_pressure.at[-1]:.6g} MPa"
    yield (
        f"The tables end at {ends}. Pressure, force, Delta and closure follow their last slope"
        " beyond, as in CalculiX and Abaqus; all other functions stay the last value, with tangents"
        " of 0. No contact was computed there. Give larger pressures, up to full contact, if your"
        " model gets there."
    )


def _band_in_words(law: Law) -> str:
    """Return which functions give the ends of the band, and what the band is."""
    if law.over_delta.banded or law.over_pressure.banded:
        return (
            f"Band (the functions _low and _high): {law.band}. NAN where no band holds."
        )
    functions = "No functions _low and _high"
    if any(curve.banded.all() for curve in law.over_pressure.curves.values()):
        functions = "Functions _low and _high of the area in the continuum alone"
    return f"{functions}. Band: {law.band}."


def short_name(quantity: str) -> str:
    """Return what functions of a header call a quantity.

    Parameters
    ----------
    quantity : str
        Name of a quantity in laws.

    Returns
    -------
    str
        The short name.
    """
    law = IN_LAWS[quantity].law
    assert law is not None  # it is in laws
    return law.short


def _goes_on(quantity: str) -> bool:
    """Return whether functions of a quantity go on with their last slope beyond the last point.

    A joint that is pressed further gives way further. All other quantities have a bound, or no
    known one as conductances, which stay the last in CalculiX and Abaqus too.
    """
    law = IN_LAWS[quantity].law
    return law is not None and law.goes_on


@dataclass(frozen=True, eq=False)
class Between:
    """Contacts of one function that were solved between its points; none if none were solved."""

    at: Values  # arguments, (m,)
    values: Values  # (m,)
    inside: NDArray[np.bool_]  # where neither few nor nearly all nodes touch, (m,)


NONE_BETWEEN = Between(np.zeros(0), np.zeros(0), np.zeros(0, dtype=bool))
"""Contacts of a function between whose points none was solved."""


@dataclass(frozen=True, eq=False)
class Function:
    """A function of the C header: a monotone cubic through points from first touch on."""

    name: str  # without the name of the law
    argument: str
    at: Values  # (k,)
    values: Values  # (k,)
    goes_on: bool  # with the last slope beyond the last point
    tangent: bool  # whether its slope is a function too
    between: Between
    falls: bool = False

    @property
    def slopes(self) -> Values:
        """Slopes of the cubic at its points."""
        if self.goes_on:
            return _slopes_that_go_on(self.at, self.values)
        return slopes(self.at, self.values, float(self.values[0]))

    @property
    def deviation(self) -> Deviation:
        """Largest distances of the cubic from the contacts between its points, as shares of these.

        Those of a quantity that falls to nothing are shares of its value at first touch.
        """
        usable = np.isfinite(self.between.values)
        if not usable.any() or self.at.size < 2 or not np.isfinite(self.values).all():
            return Deviation(np.nan, np.nan)
        from scipy.interpolate import PchipInterpolator

        contacts = self.between.values[usable]
        cubic = PchipInterpolator(self.at, self.values)(self.between.at[usable])
        unit = np.abs(contacts)
        if self.falls:
            unit = np.full(contacts.shape, abs(self.values[0]))
        distances = np.abs(cubic - contacts) / np.where(unit > 0, unit, np.inf)
        return Deviation.of(distances, self.between.inside[usable])


def _functions(law: Law) -> Iterator[Function]:
    """Yield the functions of the C header, from first touch on, where curves over Delta begin."""
    yield from _functions_of(law, law.over_delta, law.between_deltas)
    yield from _functions_of(law, law.over_pressure, law.between_pressures)
    yield _pressure_at_closure(law)


def _functions_of(law: Law, table: Curves, between: Curves | None) -> Iterator[Function]:
    """Yield the functions of one table, and those of the ends of its bands."""
    for quantity, curve in table.curves.items():
        parts = {"": "value"}
        if table.banded or curve.banded.all():
            parts |= {"_low": "low", "_high": "high"}
        for suffix, part in parts.items():
            yield _function(law, table, between, quantity, part, suffix)


def _function(
    law: Law,
    table: Curves,
    between: Curves | None,
    quantity: str,
    part: str,
    suffix: str,
) -> Function:
    """Return the function of a part of a curve: its value, or an end of its band."""
    argument = short_name(table.against)
    over = ""
    if argument == "pressure":
        over = "_at_pressure"
    at = table.at
    values = getattr(table.curves[quantity], part)
    if at.size and at[0] > 0:  # pressures that were given begin behind first touch
        at = np.append(0.0, at)
        values = np.append(_at_first_touch(law, quantity, part), values)
    return Function(
        name=f"{short_name(quantity)}{over}{suffix}",
        argument=argument,
        at=at,
        values=values,
        goes_on=_goes_on(quantity),
        tangent=not suffix,
        between=_contacts_between(law, between, quantity, part),
        falls=trend(quantity) == "falls",
    )


def _at_first_touch(law: Law, quantity: str, part: str) -> float:
    """Return a part of a quantity at first touch, in its unit."""
    curves = law.over_delta.curves
    if IN_LAWS[quantity].at_rest is None or quantity not in curves:
        return 0.0
    return float(getattr(curves[quantity], part)[0])


def _contacts_between(
    law: Law, between: Curves | None, quantity: str, part: str
) -> Between:
    """Return the contacts between the points of a table, with a part of one quantity."""
    if between is None or quantity not in between.curves:
        return NONE_BETWEEN
    values = getattr(between.curves[quantity], part)
    return Between(between.at, values, in_range(between, law.nodes))


def _pressure_at_closure(law: Law) -> Function:
    """Return the law of a contact element, which 4C has too."""
    joint = rising(law)
    between = NONE_BETWEEN
    if law.between_pressures is not None:
        contacts = law.between_pressures
        between = Between(
            at=contacts.curves[CLOSURE.in_laws].value,
            values=contacts.at,
            inside=in_range(contacts, law.nodes),
        )
    return Function(
        name="pressure_at_closure",
        argument="closure",
        at=joint.closures,
        values=joint.pressures,
        goes_on=True,
        tangent=True,
        between=between,
    )


def _cubics_in_words(law: Law, functions: Iterable[Function]) -> str:
    """Say how far monotone cubics are off the contacts solved between their points."""
    if law.between_pressures is None:
        return "No contact was solved between the points to compare the cubics with."
    deviations: dict[str, Deviation] = {}
    for function in functions:  # a band counts to its function
        name = function.name.removesuffix("_low").removesuffix("_high")
        deviation = function.deviation
        deviations[name] = deviation.or_more(deviations.get(name, deviation))
    number = law.between_pressures.at.size
    off = f"They are off contacts at {number} pressures between the points by up to this"
    falling = ""
    if any(function.falls for function in functions):
        falling = " Of gaps and apertures these are shares of the value at first touch."
    return f"The cubics go through the loads of the law. {off}, {_in_words(deviations)}.{falling}"


def _body(functions: Iterable[Function], name: str) -> Iterator[str]:
    """Yield the tables of the functions, and the functions."""
    yield "#include <math.h>"
    template = (FUNCTIONS / "law.h.in").read_text(encoding="ascii")
    yield "\n" + template.replace("NAME", name)
    last = ""
    for function in functions:
        argument = function.argument
        size = f"{name.upper()}_{argument.upper()}S"
        over = f"{name}_{argument}s_table"
        if argument != last:
            yield f"#define {size} {function.at.size}"
            yield from _array(over, size, function.at)
            last = argument
        full = f"{name}_{function.name}"
        yield from _array(f"{full}_table", size, function.values)
        yield from _array(f"{full}_slopes", size, function.slopes)
        tables = f"{over}, {full}_table, {full}_slopes, {size}, {argument}"
        kind = "held_"
        if function.goes_on:
            kind = ""
        yield f"static inline double {full}(double {argument})"
        yield f"{{ return {name}_{kind}interpolate({tables}); }}"
        if function.tangent:
            yield f"static inline double {full}_tangent(double {argument})"
            yield f"{{ return {name}_{kind}slope({tables}); }}"


def _slopes_that_go_on(at: Values, values: Values) -> Values:
    """Return the slopes of the monotone cubic, the last one of which is above 0 if values rise.

    A cubic may end level, and a joint would be perfectly soft beyond. There the slope of the last
    interval takes its place, with which the cubic is monotone too.
    """
    tangents = slopes(at, values, float(values[0]))
    if at.size > 1:
        secant = (values[-1] - values[-2]) / (at[-1] - at[-2])
        if tangents[-1] <= APART * secant:  # 0 within rounding
            tangents[-1] = secant
    return tangents


def _array(name: str, size: str, values: Values) -> Iterator[str]:
    """Yield the lines of a constant array in C."""
    yield f"static const double {name}[{size}] = {{"
    texts = ["NAN" if np.isnan(value) else f"{value:.17g}" for value in values.tolist()]
    for start in range(0, len(texts), PER_LINE):
        yield "    " + ", ".join(texts[start : start + PER_LINE]) + ","
    yield "};"
