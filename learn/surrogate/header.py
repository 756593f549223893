"""A contact law as one small C header: tables, linear interpolation, consistent tangents."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gen import output

if TYPE_CHECKING:
    from learn.surrogate.law import Law

SHORT = {
    "area_percent": "area",
    "force_uN": "force",
    "mean_gap_um": "mean_gap",
    "pressure_MPa": "pressure",
    "delta_um": "delta",
}
PER_LINE = 5

FUNCTIONS = """
/* Piecewise linear; beyond the ends of the table, the value there. */
static inline double asperity_interpolate(const double *x, const double *y, int n, double at)
{
    int low = 0, high = n - 1;
    if (!(at > x[0])) return y[0];
    if (at >= x[n - 1]) return y[n - 1];
    while (high - low > 1) {
        int middle = (low + high) / 2;
        if (x[middle] <= at) low = middle; else high = middle;
    }
    return y[low] + (y[high] - y[low]) * ((at - x[low]) / (x[high] - x[low]));
}

/* Slope of the same piecewise linear function: the consistent tangent; 0 beyond the ends. */
static inline double asperity_slope(const double *x, const double *y, int n, double at)
{
    int low = 0, high = n - 1;
    if (at < x[0] || at > x[n - 1]) return 0.0;
    while (high - low > 1) {
        int middle = (low + high) / 2;
        if (x[middle] <= at) low = middle; else high = middle;
    }
    return (y[high] - y[low]) / (x[high] - x[low]);
}
"""


def write(path: Path, law: Law) -> None:
    """Write the header; one that is there is replaced by a whole one.

    Raises
    ------
    InputError
        If it cannot be written.
    """
    output.write(path, "\n".join(_lines(law)) + "\n")


def _lines(law: Law) -> Iterator[str]:
    yield f"/* Contact law of a rough surface, E* = {law.e_star:.17g} MPa."
    for note in law.notes:
        yield f" * {_comment(note)}"
    yield f" * Band (low, high): {_comment(law.band)}."
    yield " * Delta and mean gap in um, nominal pressure in MPa, area in %, force in uN."
    yield " */"
    yield "#ifndef ASPERITY_LAW_H"
    yield "#define ASPERITY_LAW_H"
    yield ""
    yield f"#define ASPERITY_DELTAS {law.delta.size}"
    yield f"#define ASPERITY_PRESSURES {law.pressure.size}"
    yield ""
    yield from _array("delta", "DELTAS", law.delta)
    for name, curve in law.by_delta.items():
        yield from _array(SHORT[name], "DELTAS", curve.value)
        yield from _array(f"{SHORT[name]}_low", "DELTAS", curve.low)
        yield from _array(f"{SHORT[name]}_high", "DELTAS", curve.high)
    yield from _array("at_pressure", "PRESSURES", law.pressure)
    for name, curve in law.by_pressure.items():
        yield from _array(f"{SHORT[name]}_at_pressure", "PRESSURES", curve.value)
    yield FUNCTIONS
    for name in law.by_delta:
        yield from _functions(f"asperity_{SHORT[name]}", SHORT[name], "delta", "DELTAS", "delta")
    for name in law.by_pressure:
        own = f"{SHORT[name]}_at_pressure"
        yield from _functions(f"asperity_{own}", own, "at_pressure", "PRESSURES", "pressure")
    yield "#endif"


def _array(name: str, size: str, values: NDArray[np.float64]) -> Iterator[str]:
    yield f"static const double asperity_{name}_table[ASPERITY_{size}] = {{"
    texts = [f"{value:.17g}" for value in values]
    for start in range(0, len(texts), PER_LINE):
        yield "    " + ", ".join(texts[start : start + PER_LINE]) + ","
    yield "};"


def _functions(name: str, table: str, over: str, size: str, argument: str) -> Iterator[str]:
    tables = f"asperity_{over}_table, asperity_{table}_table, ASPERITY_{size}, {argument}"
    for suffix, function in (("", "interpolate"), ("_tangent", "slope")):
        yield f"static inline double {name}{suffix}(double {argument})"
        yield f"{{ return asperity_{function}({tables}); }}"


def _comment(text: str) -> str:
    """Nothing in a file's name may end the comment, or be other than ASCII."""
    return text.replace("*/", "* /").encode("ascii", "backslashreplace").decode()
