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
from collections.abc import Iterable, Iterator
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from gen.arrays import Indices, Values
from gen.law.contact_law import Law
from gen.law.curves import CONDUCTANCE, KNOWN, risen, slopes
from gen.options import BAND_SIDES, Units
from gen.runtime import VERSION, files
from gen.runtime.errors import InputError
from gen.runtime.installation import git_commit

Program = Literal["calculix", "abaqus", "4c"]

POINTS = 20  # points that CalculiX has room for; all but the last one are points of the law

FAR = np.linspace(10, POINTS + 0.5, POINTS + 2)
"""Overclosures of the 20th to the 41st point, of which the last has the number of points in it
[unit of length]."""

FINE = 64
"""Parts of an interval of the law, at whose ends straight lines are set beside its cubic."""

FEWER = {
    "abaqus": "More pressures bring it nearer.",
    "calculix": "A table that spans fewer decades of pressure comes nearer.",
}
"""What brings straight lines nearer to the law."""

CLOSER = 1e-6  # relative rise of the closure below which a point is left out

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

GAS_IN_WORDS = "Gas in the gap: conductivity {:g} W/(m K), jump distance {:g} um; its part counts."

SIDES = {"": ("value", "value"), "soft": ("high", "low"), "stiff": ("low", "high")}
"""What the law and each side of its band take of the curves of closure and conductance."""


def write(path: Path, law: Law, program: Program, units: Units) -> list[Path]:
    """Write the surface interaction of a law, and those of both sides of a band of its closure."""
    made = [(path, "")]
    if law.over_pressure.curves["closure_um"].banded.any():
        made += [(path.with_stem(f"{path.stem}-{side}"), side) for side in BAND_SIDES]
    texts = ["\n".join(_lines(each, law, program, UNITS[units], side)) for each, side in made]
    for (each, _), text in zip(made, texts, strict=True):
        files.write(each, text + "\n")
    return [each for each, _ in made]


def write_for_4c(path: Path, law: Law, units: Units) -> list[Path]:
    """Write a law's monotone cubic as the Python file of a contact constitutive law of 4C."""
    pressures, closures, _ = rising(law)
    system = UNITS[units]
    loads, overclosures = pressures * system.pressure, closures * system.length
    columns = {
        "CLOSURES": overclosures,
        "PRESSURES": loads,
        "SLOPES": slopes(overclosures, loads, 0.0),
    }
    lines = list(_comment(_description(law, "4c", system, pressures, ""), "# "))
    lines += ["", *(FUNCTIONS / "law_4c.py.in").read_text(encoding="ascii").splitlines()]
    for name, values in columns.items():
        lines += ["", f"{name} = (", *(f"    {value!r}," for value in values.tolist()), ")"]
    files.write(path, "\n".join(lines) + "\n")
    return [path]


def rising(law: Law, side: str = "") -> tuple[Values, Values, Values | None]:
    """Return the points inside the training at which closure and pressure rise, from first touch.

    They are pressures [MPa], closures [um] and, if the law has them, conductances [W/(mm2 K)], of
    the law itself ("") or of the "soft" or "stiff" side of its band. A side is drawn outwards where
    it turns back.
    """
    table, (closure, conductance) = law.over_pressure, SIDES[side]
    closures = getattr(table.curves["closure_um"], closure)
    known = table.conducting
    conductances = getattr(table.curves[known], conductance) if known else None
    usable = (table.at > 0) & np.isfinite(closures) & ~table.flagged
    if conductances is not None:
        usable &= np.isfinite(conductances)
    places = np.flatnonzero(usable)
    closures = outwards(closures[places], closure)
    places, closures = _apart(places, closures, side)
    if conductances is not None:
        ends = conductances[usable]
        if known == CONDUCTANCE:  # a gas conducts less where contact has taken its place
            ends = outwards(ends, conductance)
        conductances = ends[np.searchsorted(np.flatnonzero(usable), places)]
    if not places.size:
        outside = ": no load lies inside the surrogate's training; --solver solves the law"
        ends = outside if table.flagged.any() else ""
        raise InputError(f"the law closes nowhere, so that only tables can be written{ends}")
    at = np.append(0.0, table.at[places])
    closures = np.append(0.0, closures)
    if conductances is not None:
        first = law.over_delta.curves[known].value[0]  # of the gas alone
        conductances = np.append(first, conductances)
    return at, closures, conductances


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


def _apart(places: Indices, closures: Values, side: str) -> tuple[Indices, Values]:
    """Return the points at which the closure rises, of which the table of a program is made.

    Of points with one closure the first is kept, and for the stiff side the last: straight lines
    to the next point are then on the outer side of the points between.
    """
    kept = risen(closures, CLOSER)
    if side == "stiff":
        kept = (closures > 0) & (np.append(closures[1:], np.inf) > (1 + CLOSER) * closures)
    return places[kept], closures[kept]


def _lines(path: Path, law: Law, program: Program, units: UnitSystem, side: str) -> Iterator[str]:
    """Yield the whole file."""
    pressures, closures, conductances = rising(law, side)
    points = loads, _ = pressures * units.pressure, closures * units.length
    at, curve, _ = _cubic(*points)
    if program == "calculix":
        points = _for_calculix(*points)
    yield from _comment(_description(law, program, units, pressures, side), "** ")
    off = 100 * _off(at, curve, points[1], points[0]).max()
    straight = "The table is straight between its points: there its pressure is up to"
    straight += f" {off:.2g} % off the monotone cubic through the law. {FEWER[program]}"
    yield from _comment([straight], "** ")
    name = re.sub(r"[^0-9A-Za-z]+", "_", path.stem).strip("_").upper()[:LONGEST_NAME]
    name = name if name[:1].isalpha() else f"LAW_{name}".rstrip("_")  # a letter first
    yield f"*SURFACE INTERACTION, NAME={name}"
    yield "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TABULAR"
    for load, overclosure in zip(*points, strict=True):
        yield f"{load:.10g}, {overclosure:.10g}"  # 20 characters at most, which both programs read
    if conductances is None:
        return
    yield "*GAP CONDUCTANCE" if program == "calculix" else "*GAP CONDUCTANCE, PRESSURE"
    temperature = f", {TEMPERATURE:.10g}" if program == "calculix" else ""
    places = np.arange(pressures.size)
    if program == "calculix" and places.size > POINTS:
        places = _nearest(pressures, conductances, places[[0, 1, -1]], POINTS)
    for place in places:
        conductance = conductances[place] * units.conductance
        yield f"{conductance:.10g}, {loads[place]:.10g}{temperature}"


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
    if law.order.conductivities is not None and program != "4c":
        k1, k2 = law.order.conductivities
        yield f"Conductivities of the bodies: {k1:g} and {k2:g} W/(m K)."
    if law.order.gas is not None and program != "4c":
        yield GAS_IN_WORDS.format(*law.order.gas)
    yield f"Surface: {'; '.join(law.origins)}"
    if side:
        closure, conductance = SIDES[side]
        yield (
            f"The {side} side of the band: its {closure} closures and {conductance} conductances,"
            f" ends at each load by itself and not the curves of one surface. Band: {law.band}."
        )
        ends = getattr(law.over_pressure.curves["closure_um"], closure)
        if (np.diff(ends[np.isfinite(ends)]) < 0).any():
            yield (
                "Where its closures turn back, this side is drawn outwards until they rise: a band"
                " of more surfaces is smoother."
            )
    yield f"Command: {law.order.command}"
    yield f"Made by asperity {VERSION} {git_commit()[:12]}"
    for note in law.notes:
        yield f"How: {note}"
    yield (
        "Overclosure is counted from first touch: let the two meshes just touch where the highest"
        " asperities do. The elastic bodies are the mesh's; these tables are the interface's alone."
    )
    between = "the cubic joins both" if program == "4c" else "the table is a straight line"
    yield (
        f"From 0 to the first pressure, {pressures[1]:.6g} MPa, nothing was computed: there"
        f" {between}."
    )
    conducting = " and the conductance stays the last one" if law.over_pressure.conducting else ""
    beyond = f"the pressure follows the last slope there{conducting}"
    if program == "4c":
        beyond = "both functions raise an error there"
    yield (
        f"The law ends at {pressures[-1]:.6g} MPa. No contact was computed beyond: {beyond}. Give"
        " larger ones, up to full contact, if your model gets there."
    )
    if program == "calculix":
        yield (
            f"CalculiX (2.20 and its source of August 2026) reads {POINTS} points and holds the"
            f" pressure behind them. So the first {POINTS - 1} lines of the table are points of the"
            " monotone cubic through the law, and all others continue its last slope;"
            f" the overclosure of the last line, {FAR[-1]:g}, is where CalculiX finds the number"
            " of points."
        )


def _for_calculix(pressures: Values, closures: Values) -> tuple[Values, Values]:
    """Return points of the cubic through a law, its own if they fit; then those at `FAR`."""
    if closures[-1] >= FAR[0]:
        raise InputError(f"the law closes by {closures[-1]:.4g}: CalculiX takes up to {FAR[0]:g}")
    at, curve, bends = _cubic(pressures, closures)
    if closures.size < POINTS:
        chosen = at[_nearest(at, curve, FINE * np.arange(closures.size), POINTS - 1)]
    else:  # from the first load on, lines that are about equally far off
        steps = np.sqrt(np.maximum(bends[FINE:], 1e-6 * bends.max())) * np.gradient(at[FINE:])
        length = np.append(0.0, np.cumsum((steps[1:] + steps[:-1]) / 2))
        wanted = np.linspace(0, length[-1], POINTS - 2)
        chosen = np.append(0.0, np.interp(wanted, length, at[FINE:]))
    loads = np.interp(chosen, at, curve)
    slope = (loads[-1] - loads[-2]) / (chosen[-1] - chosen[-2])
    return np.append(loads, loads[-1] + slope * (FAR - chosen[-1])), np.append(chosen, FAR)


def _cubic(pressures: Values, closures: Values) -> tuple[Values, Values, Values]:
    """Return closures, pressures and curvatures of a law, straight up to its first load."""
    from scipy.interpolate import PchipInterpolator

    last = closures.size - 1
    at = np.interp(np.arange(FINE * last + 1) / FINE, np.arange(last + 1), closures)
    cubic = PchipInterpolator(closures, pressures)
    curve = np.where(at < closures[1], np.interp(at, closures, pressures), cubic(at))
    return at, curve, np.abs(cubic(at, 2)) / np.where(curve > 0, curve, np.inf)


def _nearest(at: Values, curve: Values, places: Indices, room: int) -> Indices:
    """Add points of a curve, each where the straight lines are furthest off, until no more fit."""
    while places.size < min(room, at.size):
        off = _off(at, curve, at[places], curve[places])
        off[places] = -1.0
        places = np.sort(np.append(places, off.argmax()))
    return places


def _off(at: Values, curve: Values, points: Values, values: Values) -> Values:
    """Return by which share of its value the straight lines between points are off a curve."""
    lines = np.interp(at, points, values)
    return np.asarray(np.abs(lines - curve) / np.where(curve > 0, curve, np.inf))


PER_LINE = 5  # numbers in a line of the C header


def write_header(path: Path, law: Law) -> list[Path]:
    """Write a law as a C header, without the points outside a surrogate's training."""
    if law.over_delta.flagged.any() or law.over_pressure.flagged.any():
        inside = [each.chosen(~each.flagged) for each in (law.over_delta, law.over_pressure)]
        law = replace(law, over_delta=inside[0], over_pressure=inside[1])
    own = re.sub(r"[^0-9A-Za-z]+", "_", path.stem).strip("_")
    name = f"asperity_{own or 'law'}"  # asperity_steel_2 for steel-2.h
    guard, body = f"{name.upper()}_H", list(_body(law, name))
    checksum = f"0x{zlib.crc32(chr(10).join(body).encode()):08x}u"
    # A second law of this name in a program is an error. What is said comes without what could end
    # a comment, splice lines or make a compiler warn, as names may.
    odd = re.compile(r"[^ -~]|[\\?]|\*(?=/)|(?<=/)\*")
    lines = [
        "/*",
        *_comment((odd.sub("_", each) for each in _header_description(law, name)), " * ", 96),
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


def _header_description(law: Law, name: str) -> Iterator[str]:
    """Yield the paragraphs of the comment at the top."""
    commit = git_commit()[:12]
    yield f"Contact law of rough surfaces, E* = {law.bodies.e_star:.17g} MPa."
    if law.bodies.hardness is not None:
        yield f"Bodies that yield, without hardening: hardness {law.bodies.hardness:.17g} MPa."
    if law.order.gas is not None:
        yield GAS_IN_WORDS.format(*law.order.gas)
    yield f"Surface: {'; '.join(law.origins)}"
    if law.order.command:
        yield f"Command: {law.order.command}"
    yield f"Made: {datetime.now(UTC).isoformat(timespec='seconds')}, asperity {VERSION} {commit}"
    for note in law.notes:
        yield f"How: {note}"
    if law.over_delta.banded or law.over_pressure.banded:
        yield f"Band (the functions _low and _high): {law.band}. NAN where no band holds."
    else:
        banded = any(curve.banded.all() for curve in law.over_pressure.curves.values())
        few = "Functions _low and _high of the area in the continuum alone"
        yield f"{few if banded else 'No functions _low and _high'}. Band: {law.band}."
    yield (
        "Delta, closure and mean gap in um, nominal pressure in MPa, area in %, force in uN,"
        " stiffness in MPa/um, conductance in W/(mm2 K)."
    )
    yield (
        "Closure is what the interface alone gives way from first touch on:"
        f" {name}_pressure_at_closure(closure) and its tangent are the law of a contact element."
    )
    yield (
        f"{name}_area(delta), {name}_delta_at_pressure(pressure) and the like are monotone cubics;"
        " _tangent is their slope. Beyond the ends of the tables, values are constant, those"
        " at the end, and tangents 0: below 0 as at first touch, and up to"
        f" {law.over_delta.at[-1]:.6g} um and {law.over_pressure.at[-1]:.6g} MPa."
    )


def _body(law: Law, name: str) -> Iterator[str]:
    """Yield tables and functions, from first touch on, where the curves over Delta begin."""
    yield "#include <math.h>"
    functions = (FUNCTIONS / "law.h.in").read_text(encoding="ascii")
    yield "\n" + functions.replace("NAME", name)
    rest = law.over_delta.curves
    for curves in (law.over_delta, law.over_pressure):
        argument = KNOWN[curves.against].short
        suffix = "_at_pressure" if argument == "pressure" else ""
        missing = curves.at[:1] > 0  # first touch, where pressures were given
        columns = {}
        for quantity, curve in curves.curves.items():
            parts = [("", "value"), ("_low", "low"), ("_high", "high")]
            banded = curves.banded or curve.banded.all()
            for end, part in parts if banded else parts[:1]:
                values, first = getattr(curve, part), np.zeros(1)
                if KNOWN[quantity].resting and quantity in rest:
                    first = getattr(rest[quantity], part)[:1]
                columns[f"{KNOWN[quantity].short}{suffix}{end}"] = np.append(first[missing], values)
        yield from _tables(name, argument, np.append(np.zeros(1)[missing], curves.at), columns)
    pressures, closures, _ = rising(law)
    yield from _tables(name, "closure", closures, {"pressure_at_closure": pressures})


def _tables(name: str, argument: str, at: Values, columns: dict[str, Values]) -> Iterator[str]:
    """Yield the tables of some columns over one argument, and their functions."""
    size, over = f"{name.upper()}_{argument.upper()}S", f"{name}_{argument}s_table"
    yield f"#define {size} {at.size}"
    yield from _array(over, size, at)
    for column, values in columns.items():
        own = f"{name}_{column}"
        yield from _array(f"{own}_table", size, values)
        yield from _array(f"{own}_slopes", size, slopes(at, values, float(values[0])))
        tangent = not column.endswith(("_low", "_high"))
        tables = f"{over}, {own}_table, {own}_slopes, {size}, {argument}"
        for end, function in (("", "interpolate"), ("_tangent", "slope"))[: 1 + tangent]:
            yield f"static inline double {own}{end}(double {argument})"
            yield f"{{ return {name}_{function}({tables}); }}"


def _array(name: str, size: str, values: Values) -> Iterator[str]:
    yield f"static const double {name}[{size}] = {{"
    texts = ["NAN" if np.isnan(value) else f"{value:.17g}" for value in values.tolist()]
    for start in range(0, len(texts), PER_LINE):
        yield "    " + ", ".join(texts[start : start + PER_LINE]) + ","
    yield "};"
