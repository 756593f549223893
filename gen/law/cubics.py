"""A contact law as smooth curves: a header for contact elements in C, and a Python file for 4C.

Both hold monotone cubics with consistent tangents. The names in the C header come from the name of
its file, so that one program can include several laws.

4C imports the Python file, and calls its functions with two lengths. The first is the gap at a
node, which is negative where the bodies overlap. The second is the offset, which the input of 4C
states: the overlap at which the rough surfaces first touch. The law acts where gap + offset <= 0.
Pressures of 4C are negative, so their derivatives with respect to the gap are positive.
"""

import re
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Values
from gen.law.accuracy import deviations_with_errors
from gen.law.between import in_range
from gen.law.contact_law import Law
from gen.law.curves import APART, Curves, slopes, trend
from gen.law.finite_elements import (
    GAS_IN_WORDS,
    beyond_in_words,
    comment,
    description,
    in_words,
    rising,
    write_lines,
)
from gen.law.layer import compliance_in_law
from gen.law.lines import Deviation
from gen.law.unit_systems import UNITS
from gen.options import Units
from gen.quantities import ALSO, CLOSURE, CONTINUUM, IN_LAWS
from gen.runtime import VERSION
from gen.runtime.installation import git_commit

TEMPLATES = Path(__file__).parent
"""Folder of the templates law.h.in and law_4c.py.in, which have the functions of the files."""

PER_LINE = 5
"""Number of numbers in a line of the C header."""


def write_header(path: Path, law: Law) -> list[Path]:
    """Write a law as a C header. Points outside a surrogate's training are left out.

    Parameters
    ----------
    path : Path
        The file. Its stem is part of the names of the functions.
    law : Law
        The law, which closes somewhere.

    Returns
    -------
    list of Path
        The file.
    """
    whole_law = law
    law = _inside_training(whole_law)
    stem = re.sub(r"[^0-9A-Za-z]+", "_", path.stem).strip("_")
    name = f"asperity_{stem or 'law'}"  # asperity_steel_2 for steel-2.h
    guard = f"{name.upper()}_H"
    functions = list(_functions(law))
    body = list(_body(functions, name))
    code = "\n".join(body)
    checksum = f"0x{zlib.crc32(code.encode()):08x}u"
    beyond = beyond_in_words(whole_law, law.over_pressure.at[-1])
    paragraphs = [
        *_header_description(law, name, beyond),
        _cubics_in_words(law, functions),
    ]
    safe_paragraphs = [_without_code(text) for text in paragraphs]
    # The guard holds the checksum: including this header twice is allowed, but another law of the
    # same name is an error.
    lines = [
        "/*",
        *comment(safe_paragraphs, " * ", width=96),
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
    return write_lines(path, lines)


def _without_code(text: str) -> str:
    """Return a text that is safe in a comment in C.

    Names of files may hold characters that end a comment, splice lines or make a compiler warn.
    """
    apart = re.sub(r"\*(?=/)", "* ", text)
    apart = re.sub(r"/(?=\*)", "/ ", apart)
    return re.sub(r"[^ -~]|[\\?]", "_", apart)


def _inside_training(law: Law) -> Law:
    """Return a law without the points at which most surfaces are outside a surrogate's training."""
    over_delta = law.over_delta
    over_pressure = law.over_pressure
    if not over_delta.flagged.any() and not over_pressure.flagged.any():
        return law
    return replace(
        law,
        over_delta=over_delta.chosen(~over_delta.flagged),
        over_pressure=over_pressure.chosen(~over_pressure.flagged),
    )


def _header_description(law: Law, name: str, beyond: str) -> Iterator[str]:
    """Yield the paragraphs of the comment at the top of a header, but for the one on cubics.

    `name` begins the names of its functions, `beyond` says why the tables end where they do.
    """
    commit = git_commit()[:12]
    yield f"Contact law of rough surfaces, E* = {law.bodies.e_star:.17g} MPa."
    if law.bodies.layered is not None:
        yield f"Layer: {law.bodies.layered.text}."
    if law.bodies.hardness is not None:
        yield f"Bodies that yield, without hardening: hardness {law.bodies.hardness:.17g} MPa."
    if law.order.gas is not None:
        yield GAS_IN_WORDS.format(*law.order.gas)
    yield f"Surface: {'; '.join(law.descriptions)}"
    for source in law.sources:
        yield f"From: {source.text}"
    if law.order.command:
        yield f"Command: {law.order.command}"
    written_at = datetime.now(UTC).isoformat(timespec="seconds")
    yield f"Made: {written_at}, asperity {VERSION} {commit}"
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
    interface = "the interface alone gives"
    if compliance_in_law(law.order, law.bodies) > 0:
        interface = "interface and layer give"
    yield (
        f"Closure is what {interface} way from first touch on:"
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
        f" of 0. {beyond}"
    )


def _band_in_words(law: Law) -> str:
    """Return a sentence on which functions give the ends of the band, and on what the band is."""
    if law.over_delta.banded or law.over_pressure.banded:
        return (
            f"Band (the functions _low and _high): {law.band}. NAN where no band holds."
        )
    functions = "No functions _low and _high"
    # `_functions_of` writes them for each table with a complete band of this area.
    tables = (law.over_delta, law.over_pressure)
    if any(_has_band_of_area_everywhere(table) for table in tables):
        functions = "Functions _low and _high of the area in the continuum alone"
    return f"{functions}. Band: {law.band}."


def _has_band_of_area_everywhere(table: Curves) -> bool:
    """Return whether the area in the continuum has a band at every point of a table."""
    area = table.curves.get(CONTINUUM.in_laws)
    return area is not None and bool(area.banded.all())


def short_name(quantity: str) -> str:
    """Return the name of a quantity in the functions of a header.

    Parameters
    ----------
    quantity : str
        Name of a quantity in laws, as "area_percent".

    Returns
    -------
    str
        The short name, as "area".
    """
    law = IN_LAWS[quantity].law
    assert law is not None  # every quantity in `IN_LAWS` has it
    return law.short


def _goes_on(quantity: str) -> bool:
    """Return whether a quantity follows its last slope beyond the last point; otherwise it stays.

    Pressure, force, Delta and closure follow it, because a joint that is pressed further gives way
    further. All other quantities stay: areas and gaps because they have a bound, and a conductance,
    which has none that is known, because CalculiX and Abaqus keep it constant.
    """
    law = IN_LAWS[quantity].law
    return law is not None and law.goes_on


@dataclass(frozen=True, eq=False)
class Between:
    """Contacts that were solved between the points of a function; m may be 0."""

    at: Values  # arguments of the function, in its unit, (m,)
    values: Values  # values there, in the unit of the quantity; NaN where unknown, (m,)
    inside: NDArray[np.bool_]  # True where neither few nor nearly all nodes touch, (m,)


NONE_BETWEEN = Between(at=np.zeros(0), values=np.zeros(0), inside=np.zeros(0, dtype=bool))
"""No contacts, for a function between whose points none was solved."""


@dataclass(frozen=True, eq=False)
class Function:
    """A function of the C header: a monotone cubic through points, the first at first touch."""

    name: str  # without the name of the law, as "area_at_pressure_low"
    argument: str  # name of the argument: "delta", "pressure" or "closure"
    at: Values  # ascending arguments of the points [um or MPa], (k,)
    values: Values  # values at the points, in the unit of the quantity, (k,)
    # True if it follows its last slope beyond the last point, False if it stays constant there.
    goes_on: bool
    tangent: bool  # True if the header has a function for its slope, too
    between: Between
    falls: bool = False  # True for a quantity that falls with the load, as a gap

    @property
    def slopes(self) -> Values:
        """Slopes of the cubic at its points, (k,)."""
        if self.goes_on:
            return _slopes_that_go_on(self.at, self.values)
        return slopes(self.at, self.values, float(self.values[0]))

    @property
    def deviation(self) -> Deviation:
        """Largest relative distances of the cubic from the contacts between its points.

        Each distance is divided by the value of the contact. For a quantity that falls, it is
        divided by the value at first touch, because the value of the contact may be 0. Both are NaN
        if there is no contact with a known value, or if the cubic has fewer than two points or
        a value that is not finite.
        """
        usable = np.isfinite(self.between.values)
        if not usable.any() or self.at.size < 2 or not np.isfinite(self.values).all():
            return Deviation(inside=np.nan, outside=np.nan)
        from scipy.interpolate import CubicHermiteSpline

        contacts = self.between.values[usable]
        # the cubic that is written, whose last slope may be that of `_slopes_that_go_on`
        cubic = CubicHermiteSpline(self.at, self.values, self.slopes)
        reference = np.abs(contacts)
        if self.falls:
            reference = np.full(contacts.shape, abs(self.values[0]))
        # A contact whose value is 0 gets the relative distance 0.
        reference = np.where(reference > 0, reference, np.inf)
        distances = np.abs(cubic(self.between.at[usable]) - contacts) / reference
        return Deviation.of(distances, self.between.inside[usable])


def _functions(law: Law) -> Iterator[Function]:
    """Yield the functions of the C header: over Delta, over pressure, and pressure over closure."""
    yield from _functions_of(law, law.over_delta, law.between_deltas)
    yield from _functions_of(law, law.over_pressure, law.between_pressures)
    yield _pressure_at_closure(law)


def _functions_of(law: Law, table: Curves, between: Curves | None) -> Iterator[Function]:
    """Yield the functions of a table: for each quantity its value, then both ends of its band.

    `between` has the contacts that were solved between the arguments of the table, or is None.
    """
    for quantity, curve in table.curves.items():
        yield _function(law, table, between, quantity, part="value")
        # If the table has a band anywhere, all quantities have functions for both ends of the band,
        # which are NAN where no band holds. Otherwise only the area in the continuum may have them:
        # it has them if its band, which `Curves.banded` does not consider, is complete.
        if table.banded or curve.banded.all():
            yield _function(law, table, between, quantity, part="low")
            yield _function(law, table, between, quantity, part="high")


def _function(
    law: Law,
    table: Curves,
    between: Curves | None,
    quantity: str,
    part: str,
) -> Function:
    """Return the function of a part of a quantity's curve: "value", "low" or "high".

    The name of the function of an end of the band ends with "_low" or "_high". `between` has the
    contacts between the arguments of the table; None if there are none.
    """
    suffix = ""
    if part != "value":
        suffix = f"_{part}"
    argument = short_name(table.against)
    over = ""
    if argument == "pressure":
        over = "_at_pressure"
    at = table.at
    values = getattr(table.curves[quantity], part)
    if at.size and at[0] > 0:
        # A table over pressure may lack the point of first touch: put it in front.
        at = np.append(0.0, at)
        values = np.append(_at_first_touch(law, quantity, part), values)
    return Function(
        name=f"{short_name(quantity)}{over}{suffix}",
        argument=argument,
        at=at,
        values=values,
        goes_on=_goes_on(quantity),
        tangent=part == "value",  # the ends of a band have no tangent
        between=_contacts_between(law, between, quantity, part),
        falls=trend(quantity) == "falls",
    )


def _at_first_touch(law: Law, quantity: str, part: str) -> float:
    """Return a part of a quantity ("value", "low" or "high") at first touch, in its unit."""
    curves = law.over_delta.curves
    # A quantity whose `at_rest` is None is 0 at first touch. Delta, which is 0 there too, has no
    # curve in the table over Delta.
    if IN_LAWS[quantity].at_rest is None or quantity not in curves:
        return 0.0
    return float(getattr(curves[quantity], part)[0])


def _contacts_between(
    law: Law, between: Curves | None, quantity: str, part: str
) -> Between:
    """Return the contacts between the points of a table, with a part of the curve of a quantity."""
    if between is None or quantity not in between.curves:
        return NONE_BETWEEN
    values = getattr(between.curves[quantity], part)
    return Between(at=between.at, values=values, inside=in_range(between, law.nodes))


def _pressure_at_closure(law: Law) -> Function:
    """Return the pressure [MPa] over the closure [um], which a contact element and 4C take."""
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
    """Return a paragraph about how far functions are off the contacts between their points."""
    if law.between_pressures is None:
        return "No contact was solved between the points to compare the cubics with."
    deviations: dict[str, Deviation] = {}
    for function in functions:
        # The ends of a band and the value share one number, the largest.
        name = function.name.removesuffix("_low").removesuffix("_high")
        deviation = function.deviation
        deviations[name] = deviation.or_more(deviations.get(name, deviation))
    number = law.between_pressures.at.size
    off = f"They are off contacts at {number} pressures between the points by up to this"
    falling = ""
    if any(function.falls for function in functions):
        falling = " Of gaps and apertures these are shares of the value at first touch."
    together = ""
    if law.order.errors is not None:
        tables = (
            law.over_delta,
            law.over_pressure,
            law.between_deltas,
            law.between_pressures,
        )
        together = deviations_with_errors(tables, law.order.errors, deviations)
    return (
        f"The cubics go through the loads of the law. {off},"
        f" {in_words(deviations)}.{falling}{together}"
    )


def _body(functions: Iterable[Function], name: str) -> Iterator[str]:
    """Yield the code of a header: the template's functions, then tables and functions of the law.

    `name` begins all names. The functions of one argument have to follow each other.
    """
    yield "#include <math.h>"
    template = (TEMPLATES / "law.h.in").read_text(encoding="ascii")
    yield "\n" + template.replace("NAME", name)
    last_argument = ""
    for function in functions:
        argument = function.argument
        size = f"{name.upper()}_{argument.upper()}S"
        over = f"{name}_{argument}s_table"
        if argument != last_argument:  # all functions of an argument share its table
            yield f"#define {size} {function.at.size}"
            yield from _array(over, size, function.at)
            last_argument = argument
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
    """Return the slopes of the monotone cubic at points, (k,), with a last one that is not 0.

    A cubic may end level, and the joint would be perfectly soft beyond. Then the last slope is that
    of the straight line over the last interval, with which the cubic is monotone, too.
    """
    tangents = slopes(at, values, float(values[0]))
    if at.size > 1:
        secant = (values[-1] - values[-2]) / (at[-1] - at[-2])
        if tangents[-1] <= APART * secant:  # 0 within rounding
            tangents[-1] = secant
    return tangents


def _array(name: str, size: str, values: Values) -> Iterator[str]:
    """Yield the lines of a constant array in C; `size` is the macro that has its length."""
    yield f"static const double {name}[{size}] = {{"
    texts = ["NAN" if np.isnan(value) else f"{value:.17g}" for value in values.tolist()]
    for start in range(0, len(texts), PER_LINE):
        yield "    " + ", ".join(texts[start : start + PER_LINE]) + ","
    yield "};"


def write_for_4c(path: Path, law: Law, units: Units) -> list[Path]:
    """Write the pressure over the closure as the Python file of a contact constitutive law of 4C.

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
    paragraphs = [
        *description(law, "4c", system, joint.pressures, side=""),
        _cubics_in_words(law, [_pressure_at_closure(law)]),
    ]
    lines = list(comment(paragraphs, "# "))
    lines.append("")
    lines += (TEMPLATES / "law_4c.py.in").read_text(encoding="ascii").splitlines()
    for name, values in columns.items():
        lines += ["", f"{name} = ("]
        lines += [f"    {value!r}," for value in values.tolist()]
        lines.append(")")
    return write_lines(path, lines)
