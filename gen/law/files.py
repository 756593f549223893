"""A contact law as people and programs take it: printed, CSV, JSON, picture, and all its files."""

from __future__ import annotations

import math
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gen.arrays import Values
from gen.law import c_header, finite_elements
from gen.law.contact_law import Law
from gen.law.curves import CONDUCTANCE, CONTINUUM, STIFFNESS, Curve, Curves
from gen.options import LawOutputs
from gen.runtime import VERSION
from gen.runtime.documents import Row, text_of, write_csv
from gen.runtime.figure import save
from gen.runtime.files import write
from gen.runtime.installation import git_commit
from gen.runtime.terminal import brief, echo, print_table

if TYPE_CHECKING:
    from rich.table import Table

WIDTH = 140  # width of a printed table without a terminal [characters]

PARTS = ("value", "low", "high", "slope")
ENDS = ("", "_low", "_high", "_slope")  # ends of the columns' names of these parts

FORMAT = "asperity contact law"
FORMAT_VERSION = 1  # raised whenever a reader of the last version would misread a file

LABELS = {
    "closure_um": "closure [µm]",
    "area_percent": "contact area [%]",
    CONTINUUM: "area in the continuum [%]",
    CONDUCTANCE: "conductance [W/(mm² K)]",
    STIFFNESS: "stiffness [MPa/µm]",
}


def write_files(law: Law, files: LawOutputs, figure: Any) -> Iterator[Path]:
    """Write a law to the files asked for, and yield each file once it is written.

    Raise InputError if a file cannot be written, or the law cannot be told in its format.
    """
    if any((files.header, files.calculix, files.abaqus, files.picture)):
        finite_elements.rising(law)  # refused before any file is written
    for path, write_one in (
        (files.table, write_table),
        (files.json, write_json),
        (files.header, c_header.write),
    ):
        if path is not None:
            write_one(path, law)
            yield path
    if files.calculix is not None:
        yield from finite_elements.write(files.calculix, law, "calculix", files.units)
    if files.abaqus is not None:
        yield from finite_elements.write(files.abaqus, law, "abaqus", files.units)
    if files.picture is not None:
        draw(figure, law, files.picture)
        yield files.picture


def write_table(path: Path, law: Law) -> None:
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
    names = [name for name in curves.names if name not in _left_out(curves)]
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


def _left_out(curves: Curves) -> set[str]:
    """Return the curves that are not printed, so that rows fit: a Delta that is the closure too."""
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
                    curve = curves.curves[name]
                    for end, part in zip(ENDS, PARTS, strict=True):
                        number = float(getattr(curve, part)[place])
                        row[f"{name}{end}"] = "" if np.isnan(number) else number
            yield {**row, "reason": curves.reasons[place]}


def write_json(path: Path, law: Law) -> None:
    """Write a law as JSON, with null for numbers that are not finite."""
    content = {
        "format": FORMAT,
        "version": FORMAT_VERSION,
        "e_star_MPa": law.bodies.e_star,
        "hardness_MPa": law.bodies.hardness,
        "conductivities_W_per_m_K": law.order.conductivities,
        "boundary": law.boundary,
        "surfaces": list(law.origins),
        "band": law.band,
        "notes": list(law.notes),
        "command": law.order.command,
        "made": datetime.now(UTC).isoformat(timespec="seconds"),
        "asperity": VERSION,
        "commit": git_commit(),
        "tables": [_json_table(law.over_delta), _json_table(law.over_pressure)],
    }
    write(path, text_of(content))


def _json_table(curves: Curves) -> dict[str, Any]:
    """Return one table."""
    return {
        "against": curves.against,
        "at": _numbers(curves.at),
        "gap_at_rest_um": curves.gap_at_rest,
        "share_of_surfaces_outside_the_training": _numbers(curves.outside),
        "reasons": list(curves.reasons),
        "curves": {
            name: {part: _numbers(getattr(curves.curves[name], part)) for part in PARTS}
            for name in curves.names
        },
    }


def _numbers(values: Values) -> list[float | None]:
    return [value if math.isfinite(value) else None for value in values.tolist()]


def draw(figure: Any, law: Law, picture: Path) -> None:
    """Draw closure, area and stiffness or conductance over pressure, inside the training."""
    curves = law.over_pressure.chosen(~law.over_pressure.flagged)
    names = ["closure_um", CONTINUUM if CONTINUUM in curves.curves else "area_percent"]
    names += [name for name in (CONDUCTANCE, STIFFNESS) if name in curves.curves][:1]
    figure.suptitle(
        f"{law.title}\n{law.bodies.text}; band: {law.band}", fontsize=11, parse_math=False
    )
    axes = figure.subplots(2, len(names))
    for column, name in enumerate(names):
        for row, scale in enumerate(("linear", "log")):
            _draw_curve(axes[row, column], curves.at, curves.curves[name], scale)
            axes[row, column].set(xlabel="nominal pressure [MPa]", ylabel=LABELS[name])
    save(figure, picture)


def _draw_curve(axis: Any, at: Any, curve: Curve, scale: str) -> None:
    """Draw one curve and its band in axes of one scale."""
    finite = np.isfinite(curve.value)
    drawn = finite & (at > 0) & (curve.value > 0) if scale == "log" else finite
    axis.set(xscale=scale, yscale=scale)
    axis.plot(at[drawn], curve.value[drawn], ".-", color="tab:blue")
    band = drawn & curve.banded
    band &= (curve.low > 0) | (scale == "linear")
    if band.any():
        axis.fill_between(at[band], curve.low[band], curve.high[band], alpha=0.25, lw=0)
    axis.grid(alpha=0.3)
    if scale == "linear":
        axis.set(xlim=(0, None), ylim=(0, None))
