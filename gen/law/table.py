"""A contact law as a table: printed, and written as CSV."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gen.law.contact_law import Law
from gen.law.curves import Curve, Curves
from gen.runtime.files import Row, write_csv
from gen.runtime.terminal import brief, echo, print_table

if TYPE_CHECKING:
    from rich.table import Table

WIDTH = 140
"""Width of a printed table without a terminal [characters]."""

ENDS = ("", "_low", "_high", "_slope")


def write(path: Path, law: Law) -> None:
    """Write a law as CSV: the table against Delta, then the one against pressure.

    Columns that are empty throughout, as those of a band that one surface has not, are left out.
    """
    rows = list(_rows(law))
    full = [name for name in rows[0] if any(row[name] != "" for row in rows)]
    write_csv(path, [{name: row[name] for name in full} for row in rows])


def show(law: Law) -> None:
    """Print the law against the given kind of load: Delta, nominal pressure, or both."""
    for note in law.notes:
        echo(note)
    title = f"{law.title}\n{law.bodies.text}; band: {law.band}"
    if law.order.delta or not law.order.pressure:
        print_table(_printed(law.over_delta, title), WIDTH)
    if law.order.pressure:
        print_table(_printed(law.over_pressure, title), WIDTH)


def _printed(curves: Curves, title: str) -> Table:
    """Return one table; rows outside the training are dim and have a reason instead of a band."""
    from rich.table import Table

    table = Table(title=title)
    names = [name for name in curves.names if name not in _beside_the_point(curves)]
    for name in (curves.against, *names):
        table.add_column(name, justify="right")
    reasons = any(curves.reasons)
    if reasons:
        table.add_column("reason")
    for place, argument in enumerate(curves.at):
        cells = [f"{argument:.5g}"]
        cells += [_shown(curves.curves[name], place, curves) for name in names]
        if reasons:
            cells.append(brief(curves.reasons[place]))
        table.add_row(*cells, style="dim" if curves.withheld(place) else "")
    return table


def _beside_the_point(curves: Curves) -> set[str]:
    """Return the names of curves that are not printed, so that rows fit the width of a terminal.

    Against Delta that is the closure; against pressure it is Delta, where it equals the closure.
    """
    if curves.against == "delta_um":
        return {"closure_um"}
    delta, closure = (curves.curves[name].value for name in ("delta_um", "closure_um"))
    return {"delta_um"} if np.array_equal(delta, closure) else set()


def _shown(curve: Curve, place: int, curves: Curves) -> str:
    """Return a value with its band, with `-` for what is withheld, or alone."""
    value, low, high = curve.value[place], curve.low[place], curve.high[place]
    if np.isnan(value):
        return "-"
    if low < high:
        return f"{value:.4g} ({low:.4g} to {high:.4g})"
    return f"{value:.4g} (-)" if curves.withheld(place) else f"{value:.4g}"


def _rows(law: Law) -> Iterator[Row]:
    """Yield the rows of the CSV, of which some columns may be empty throughout."""
    names = "delta_um", *law.over_delta.names
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
    """Return the cells of a value, its band and its slope; what is unknown is empty."""
    parts = curve.value, curve.low, curve.high, curve.slope
    numbers = zip(ENDS, (float(part[place]) for part in parts), strict=True)
    return {f"{name}{end}": "" if np.isnan(number) else number for end, number in numbers}
