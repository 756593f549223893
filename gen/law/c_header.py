"""A contact law as one small C header: tables, monotone cubics, consistent tangents.

All names come from the file's name, so that one program can include several laws.
"""

from __future__ import annotations

import re
import textwrap
import zlib
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gen.arrays import Values
from gen.law.curves import (
    APERTURES,
    CONDUCTANCE,
    CONTINUUM,
    FROM_REST,
    GAS,
    JOINT,
    STIFFNESS,
    slopes,
)
from gen.law.finite_elements import GAS_IN_WORDS, rising
from gen.runtime import VERSION, files
from gen.runtime.installation import git_commit

if TYPE_CHECKING:
    from gen.law.contact_law import Law
    from gen.law.curves import Curves

SHORT = {
    "area_percent": "area",
    "force_uN": "force",
    "mean_gap_um": "mean_gap",
    "pressure_MPa": "pressure",
    "delta_um": "delta",
    "closure_um": "closure",
    STIFFNESS: "stiffness",
    CONDUCTANCE: "conductance",
    GAS: "gas_conductance",
    JOINT: "joint_conductance",
    CONTINUUM: "continuum_area",
    APERTURES[0]: "hydraulic_aperture_x",
    APERTURES[1]: "hydraulic_aperture_y",
}
ARGUMENTS = {"delta_um": ("delta", ""), "pressure_MPa": ("pressure", "_at_pressure")}
"""Name of the argument, and end of the functions' names, for each table."""

PER_LINE = 5
WIDTH = 96

FUNCTIONS = """
/* Place of the interval that holds an argument between the ends of a table. */
static inline int NAME_place(const double *x, int n, double at)
{
    int low = 0, high = n - 1;
    while (high - low > 1) {
        int middle = (low + high) / 2;
        if (x[middle] <= at) low = middle; else high = middle;
    }
    return low;
}

/* Cubic with the values y and the slopes s at x; beyond the ends, the value there. */
static inline double NAME_interpolate(const double *x, const double *y, const double *s, int n,
                                      double at)
{
    int i;
    double h, t, u;
    if (!(at > x[0])) return y[0];
    if (at >= x[n - 1]) return y[n - 1];
    i = NAME_place(x, n, at);
    if (at == x[i]) return y[i];
    h = x[i + 1] - x[i];
    t = (at - x[i]) / h;
    u = 1.0 - t;
    return y[i] + t * t * (3.0 - 2.0 * t) * (y[i + 1] - y[i])
           + h * t * u * (u * s[i] - t * s[i + 1]);
}

/* Slope of the same cubic: the consistent tangent, continuous; 0 beyond the ends. */
static inline double NAME_slope(const double *x, const double *y, const double *s, int n, double at)
{
    int i;
    double h, t, u;
    if (n < 2 || at < x[0] || at > x[n - 1]) return 0.0;
    i = NAME_place(x, n, at);
    if (at == x[i]) return s[i];
    h = x[i + 1] - x[i];
    t = (at - x[i]) / h;
    u = 1.0 - t;
    return 6.0 * t * u * (y[i + 1] - y[i]) / h + u * (1.0 - 3.0 * t) * s[i]
           + t * (3.0 * t - 2.0) * s[i + 1];
}
"""


def write(path: Path, law: Law) -> list[Path]:
    """Write the header whole or not at all, without the points outside a surrogate's training.

    Raise InputError if it cannot be written, or everything is outside the training.
    """
    over_delta, over_pressure = law.over_delta, law.over_pressure
    law = replace(
        law,
        over_delta=over_delta.chosen(~over_delta.flagged),
        over_pressure=over_pressure.chosen(~over_pressure.flagged),
    )
    own = re.sub(r"[^0-9A-Za-z]+", "_", path.stem).strip("_")
    name = f"asperity_{own or 'law'}"  # asperity_steel_2 for steel-2.h
    files.write(path, "\n".join(_lines(law, name)) + "\n")
    return [path]


def _lines(law: Law, name: str) -> Iterator[str]:
    """Yield the whole header; a second law of the same name in a program is made an error."""
    body = list(_body(law, name))
    checksum = f"0x{zlib.crc32(chr(10).join(body).encode()):08x}u"
    guard = f"{name.upper()}_H"
    yield "/*"
    for paragraph in _description(law, name):
        # Without what could end a comment, splice lines or make a compiler warn, as names may.
        said = re.sub(r"[^ -~]|[\\?]|\*(?=/)|(?<=/)\*", "_", paragraph)
        yield from textwrap.wrap(
            said,
            WIDTH,
            initial_indent=" * ",
            subsequent_indent=" *   ",
            break_on_hyphens=False,
        )
    yield " */"
    yield f"#ifdef {guard}"
    yield f"#if {guard} != {checksum}"
    yield f'#error "two laws are named {name}: give one of the headers another file name"'
    yield "#endif"
    yield "#else"
    yield f"#define {guard} {checksum}"
    yield from body
    yield "#endif"


def _description(law: Law, name: str) -> Iterator[str]:
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
    """Yield tables and functions."""
    yield "#include <math.h>"
    yield FUNCTIONS.replace("NAME", name)
    for curves in (law.over_delta, law.over_pressure):
        argument, suffix = ARGUMENTS[curves.against]
        at, columns = _columns(curves, suffix, law.over_delta)
        yield from _tables(name, argument, at, columns)
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


def _columns(curves: Curves, suffix: str, rest: Curves) -> tuple[Values, dict[str, Values]]:
    """Return arguments and columns from first touch on, where the curves of `rest` begin."""
    missing = curves.at[:1] > 0  # first touch, where pressures were given
    columns = {}
    for name, curve in curves.curves.items():
        banded = curves.banded or curve.banded.all()
        for end, part in (("", "value"), ("_low", "low"), ("_high", "high"))[: 3 if banded else 1]:
            values, first = getattr(curve, part), np.zeros(1)
            if name in FROM_REST and name in rest.curves:
                first = getattr(rest.curves[name], part)[:1]
            columns[f"{SHORT[name]}{suffix}{end}"] = np.concatenate([first[missing], values])
    return np.concatenate([np.zeros(1)[missing], curves.at]), columns


def _array(name: str, size: str, values: Values) -> Iterator[str]:
    yield f"static const double {name}[{size}] = {{"
    texts = ["NAN" if np.isnan(value) else f"{value:.17g}" for value in values.tolist()]
    for start in range(0, len(texts), PER_LINE):
        yield "    " + ", ".join(texts[start : start + PER_LINE]) + ","
    yield "};"
