"""A contact law as a table: printed, and written as CSV."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gen.runtime.console import wide_console
from gen.runtime.table import Row, write_csv
from learn.surrogate.law import c_header
from learn.surrogate.law.contact_law import Law
from learn.surrogate.law.curves import COLUMNS, Curve, Curves
from learn.surrogate.ranges import brief

if TYPE_CHECKING:
    from rich.table import Table

ENDS = ("", "_low", "_high", "_slope")


def write(law: Law, table: Path | None, header: Path | None) -> list[Path]:
    """Write a law as CSV and as a C header, where asked for."""
    written = []
    if table is not None:
        write_csv(table, list(_rows(law)))
        written.append(table)
    if header is not None:
        c_header.write(header, law)
        written.append(header)
    return written


def show(law: Law) -> None:
    """Print the law against the given kind of load: Delta, nominal pressure, or both."""
    console = wide_console(140)
    for note in law.notes:
        console.print(note, highlight=False, markup=False, soft_wrap=True)
    title = f"{law.bodies.text}; band: {law.band}"
    if law.order.delta or not law.order.pressure:
        console.print(_printed(law.over_delta, title))
    if law.order.pressure:
        console.print(_printed(law.over_pressure, title))


def _printed(curves: Curves, title: str) -> Table:
    """Return one table; rows outside the training are dim and have a reason instead of a band."""
    from rich.markup import escape
    from rich.table import Table

    table = Table(title=title)
    for name in (curves.against, *COLUMNS[curves.against]):
        table.add_column(name, justify="right")
    reasons = any(curves.reasons)
    if reasons:
        table.add_column("reason")
    for place, argument in enumerate(curves.at):
        cells = [f"{argument:.5g}"]
        cells += [_shown(curves.curves[name], place, curves) for name in COLUMNS[curves.against]]
        if reasons:
            cells.append(escape(brief(curves.reasons[place])))
        table.add_row(*cells, style="dim" if curves.withheld(place) else "")
    return table


def _shown(curve: Curve, place: int, curves: Curves) -> str:
    """Return a value with its band, with `-` for a band that is withheld, or alone."""
    value, low, high = curve.value[place], curve.low[place], curve.high[place]
    if low < high:
        return f"{value:.4g} ({low:.4g} to {high:.4g})"
    return f"{value:.4g} (-)" if curves.withheld(place) else f"{value:.4g}"


def _rows(law: Law) -> Iterator[Row]:
    """Yield the rows of the CSV: the table against Delta, then the one against pressure."""
    names = "delta_um", *COLUMNS["delta_um"]
    for curves in (law.over_delta, law.over_pressure):
        for place, argument in enumerate(curves.at):
            row: Row = {"against": curves.against, "outside": float(curves.outside[place])}
            if law.bodies.hardness is not None:
                row["hardness_MPa"] = law.bodies.hardness
            if law.boundary != "free":
                row["boundary"] = law.boundary
            for name in names:
                row |= {f"{name}{end}": "" for end in ENDS}
                if name == curves.against:
                    row[name] = float(argument)
                elif name in curves.curves:
                    row |= _cells(name, curves.curves[name], place)
            yield {**row, "reason": curves.reasons[place]}


def _cells(name: str, curve: Curve, place: int) -> Row:
    """Return the cells of a value, its band and its slope; those of a missing band are empty."""
    parts = curve.value, curve.low, curve.high, curve.slope
    numbers = zip(ENDS, (float(part[place]) for part in parts), strict=True)
    return {f"{name}{end}": "" if np.isnan(number) else number for end, number in numbers}
