"""A contact law as people and programs take it: printed, CSV, JSON, picture, and all its files."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Values
from gen.law import finite_elements
from gen.law.contact_law import Law
from gen.law.curves import Curve, Curves
from gen.options import LawOutputs, Units
from gen.quantities import (
    AREA,
    CLOSURE,
    CONTINUUM,
    DELTA,
    IN_LAWS,
    MEAN_GAP,
    PRESSURE,
    STIFFNESS,
)
from gen.runtime import VERSION
from gen.runtime.documents import Row, json_text, write_csv
from gen.runtime.figure import save
from gen.runtime.files import write
from gen.runtime.installation import git_commit
from gen.runtime.terminal import echo, first_reason, print_columns

PARTS = ("value", "low", "high", "slope", "std")
ENDS = (
    "",
    "_low",
    "_high",
    "_slope",
    "_std",
)  # ends of the columns' names of these parts

GAS_KEYS = ("gas_conductivity_W_per_m_K", "gas_jump_distance_um")
FORMAT_VERSION = 1  # raised whenever a reader of the last version would misread a file


def write_files(law: Law, files: LawOutputs, figure: Any) -> Iterator[Path]:
    """Write a law to the files asked for, and yield each file once it is written."""
    asked = {
        name: path for name, path in files._asdict().items() if isinstance(path, Path)
    }
    if asked.keys() - {"table", "json"}:
        finite_elements.rising(law)  # refused before any file is written
    for name, write_one in WRITERS.items():
        if name in asked:
            yield from write_one(asked[name], law, files.units)
    if files.picture is not None:
        draw(figure, law, files.picture)
        yield files.picture


def show(law: Law) -> None:
    """Print the law against the given kind of load: Delta, nominal pressure, or both.

    Rows outside a surrogate's training have a reason instead of a band.
    """
    for note in law.notes:
        echo(note)
    by_delta = bool(law.order.delta or not law.order.pressure)
    for curves in [law.over_delta] * by_delta + [law.over_pressure] * bool(
        law.order.pressure
    ):
        echo(law.title)
        echo(f"{law.bodies.text}; band: {law.band}")
        names, known = list(curves.curves), curves.curves
        if curves.against == DELTA.in_laws:
            names.remove(CLOSURE.in_laws)  # so that rows fit
        elif np.array_equal(known[DELTA.in_laws].value, known[CLOSURE.in_laws].value):
            names.remove(DELTA.in_laws)
        banded = np.any([curve.banded for curve in known.values()], axis=0)
        rows = []
        for place, argument in enumerate(curves.at):
            cells = [f"{argument:.5g}"]
            for curve in (known[name] for name in names):
                value, low, high = curve.value[place], curve.low[place], curve.high[place]
                band = " (-)" if curves.reasons[place] and not banded[place] else ""
                band = f" ({low:.4g} to {high:.4g})" if low < high else band
                cells.append("-" if np.isnan(value) else f"{value:.4g}{band}")
            reason = curves.reasons[place]
            rows.append([*cells, first_reason(reason) if reason else ""])
        titles = [curves.against, *names, "reason" if any(curves.reasons) else ""]
        print_columns(rows, titles, right=titles[:-1])


def write_table(path: Path, law: Law) -> list[Path]:
    """Write a law as CSV: the table against Delta, then the one against pressure.

    Those of a population have its mean, band, slope and standard deviation, and a column for each
    surface. Columns that are empty throughout, as those of a band that one surface has not, are
    left out. The first row of each table has the files of the surfaces, their hashes and their
    preparation.
    """
    rows: list[Row] = []
    for curves in (law.over_delta, law.over_pressure):
        for place in range(curves.at.size):
            about = _about_the_load(law, curves, place)
            record = _record_of_the_files(law if place == 0 else None)
            surfaces = _of_each_surface(law, curves, place)
            row: Row = {**about, **_of_the_law(law, curves, place)}
            row["resolved"] = _resolved(curves, place)
            row["reason"] = curves.reasons[place]
            rows.append({**row, **record, **surfaces})
    full = [name for name in rows[0] if any(row[name] != "" for row in rows)]
    write_csv(path, [{name: row[name] for name in full} for row in rows])
    return [path]


def _about_the_load(law: Law, curves: Curves, place: int) -> Row:
    """Return what a row of a table is about, and the share of surfaces outside a training."""
    row: Row = {"against": curves.against, "outside": float(curves.outside[place])}
    if law.bodies.hardness is not None:
        row["hardness_MPa"] = law.bodies.hardness
    if law.boundary != "free":
        row["boundary"] = law.boundary
    return row


def _of_the_law(law: Law, curves: Curves, place: int) -> Row:
    """Return the cells of a row with all parts of all curves, "" for those that it has not."""
    row: Row = {}
    for name in (DELTA.in_laws, *law.over_delta.curves):
        row |= {f"{name}{end}": "" for end in ENDS}
        if name == curves.against:
            row[name] = float(curves.at[place])
        elif name in curves.curves:
            for end, part in zip(ENDS, PARTS, strict=True):
                row[f"{name}{end}"] = _cell(getattr(curves.curves[name], part)[place])
    return row


def _of_each_surface(law: Law, curves: Curves, place: int) -> Row:
    """Return the cells of a row with a column for each surface of a population."""
    row: Row = {}
    for name in (DELTA.in_laws, *law.over_delta.curves):
        columns = [f"{name}_surface_{number}" for number in range(1, len(law.names) + 1)]
        row |= dict.fromkeys(columns, "")
        curve = curves.curves.get(name)
        if curve is not None and curve.surfaces is not None:
            row |= dict(zip(columns, map(_cell, curve.surfaces[:, place]), strict=True))
    return row


def _resolved(curves: Curves, place: int) -> str:
    """Say whether the grid resolves the contact at a load; "" where that is not judged."""
    if curves.resolved is None or not curves.at[place] > 0:
        return ""
    return "yes" if curves.resolved[place] else "no"


def _record_of_the_files(law: Law | None) -> Row:
    """Return the files of the surfaces, their hashes and their preparation; empty cells if None."""
    sources = () if law is None else law.sources
    files = [file for source in sources for file in source.files]
    return {
        "files": "; ".join(file.path for file in files),
        "sha256": "; ".join(file.sha256 for file in files),
        # without commas, at which simple readers of CSV cut lines
        "prepared": " | ".join("; ".join(source.steps) for source in sources).replace(
            ",", ";"
        ),
    }


def _cell(number: float) -> float | str:
    """Return a number for a table, "" for NaN."""
    return "" if np.isnan(number) else float(number)


def write_json(path: Path, law: Law) -> list[Path]:
    """Write a law as JSON, with null for numbers that are not finite."""
    content = {
        "format": "asperity contact law",
        "version": FORMAT_VERSION,
        "e_star_MPa": law.bodies.e_star,
        "hardness_MPa": law.bodies.hardness,
        "conductivities_W_per_m_K": law.order.conductivities,
        **dict(zip(GAS_KEYS, law.order.gas or (), strict=False)),
        "boundary": law.boundary,
        "surfaces": list(law.descriptions),
        "sources": [asdict(source) for source in law.sources],
        "surface_names": list(law.names),
        "band": law.band,
        "notes": list(law.notes),
        "command": law.order.command,
        "made": datetime.now(UTC).isoformat(timespec="seconds"),
        "asperity": VERSION,
        "commit": git_commit(),
        "tables": [
            {
                "against": curves.against,
                "at": curves.at.tolist(),
                "gap_at_rest_um": curves.rest[MEAN_GAP.in_laws],
                "share_of_surfaces_outside_the_training": curves.outside.tolist(),
                "reasons": list(curves.reasons),
                "grid": list(curves.grid),
                "curves": {
                    name: _numbers(curve) for name, curve in curves.curves.items()
                },
            }
            for curves in (law.over_delta, law.over_pressure)
        ],
    }
    write(path, json_text(content))
    return [path]


def _numbers(curve: Curve) -> dict[str, Any]:
    """Return a curve for JSON; one of a population with a list for each of its surfaces."""
    numbers: dict[str, Any] = {part: _finite(getattr(curve, part)) for part in PARTS[:4]}
    if curve.surfaces is not None:
        numbers["std"] = _finite(curve.std)
        numbers["by_surface"] = [_finite(each) for each in curve.surfaces]
    return numbers


def _finite(values: Values) -> list[float | None]:
    """Return numbers for JSON, None for those that are not finite."""
    return [each if math.isfinite(each) else None for each in values.tolist()]


WRITERS: dict[str, Callable[[Path, Law, Units], list[Path]]] = {
    "table": lambda path, law, _: write_table(path, law),
    "json": lambda path, law, _: write_json(path, law),
    "header": lambda path, law, _: finite_elements.write_header(path, law),
    "calculix": lambda path, law, units: finite_elements.write(
        path, law, "calculix", units
    ),
    "abaqus": lambda path, law, units: finite_elements.write(path, law, "abaqus", units),
    "for_4c": finite_elements.write_for_4c,
}
"""What writes each field of `gen.options.LawOutputs`, and returns the files that it has written. A
further format is a field there, with the end of its files' names, and a line here."""


def draw(figure: Any, law: Law, picture: Path) -> None:
    """Draw closure, area and stiffness or conductance over pressure, inside the training.

    Areas are those in the continuum where the grid resolves the contact. Others are those of the
    nodes, which circles mark.
    """
    curves = law.over_pressure.chosen(~law.over_pressure.flagged)
    area = drawn_area(curves)
    panels = [Panel(curves.curves[CLOSURE.in_laws], CLOSURE.label), area]
    names = [
        name for name in (curves.conducting, STIFFNESS.in_laws) if name in curves.curves
    ]
    panels += [Panel(curves.curves[name], IN_LAWS[name].label) for name in names[:1]]
    figure.suptitle(
        f"{law.title}\n{law.bodies.text}\nband: {law.band}", fontsize=11, parse_math=False
    )
    axes, at = figure.subplots(2, len(panels)), curves.at
    for (row, scale), (column, panel) in product(
        enumerate(("linear", "log")), enumerate(panels)
    ):
        axis, curve = axes[row, column], panel.curve
        finite = np.isfinite(curve.value)
        drawn = finite & (at > 0) & (curve.value > 0) if scale == "log" else finite
        axis.set(xscale=scale, yscale=scale)
        axis.plot(at[drawn], curve.value[drawn], ".-", color="tab:blue")
        marked = drawn & panel.of_nodes & (at > 0)
        if marked.any():
            axis.plot(
                at[marked],
                curve.value[marked],
                "o",
                color="tab:orange",
                fillstyle="none",
                label="not resolved: area of the nodes",
            )
            axis.legend(fontsize=8)
        band = drawn & curve.banded & ((curve.low > 0) | (scale == "linear"))
        if band.any():
            axis.fill_between(
                at[band], curve.low[band], curve.high[band], alpha=0.25, lw=0
            )
        axis.grid(alpha=0.3)
        if scale == "linear":
            axis.set(xlim=(0, None), ylim=(0, None))
        axis.set(xlabel=PRESSURE.label, ylabel=panel.label)
    save(figure, picture)


@dataclass(frozen=True, eq=False)
class Panel:
    """What one column of a picture shows over the pressure."""

    curve: Curve
    label: str
    of_nodes: NDArray[np.bool_] | bool = (
        False  # where an area is marked as that of the nodes
    )


def drawn_area(curves: Curves) -> Panel:
    """Return the area to draw, which is one in the continuum only where the grid resolves it.

    Parameters
    ----------
    curves : Curves
        Table against pressure.

    Returns
    -------
    Panel
        The area of the nodes if that in the continuum is not known, or is resolved nowhere.
        Otherwise the area in the continuum, and that of the nodes at loads that are marked.
    """
    nodes = curves.curves[AREA.in_laws]
    continuum = curves.curves.get(CONTINUUM.in_laws)
    if continuum is None or curves.resolved is None:
        return Panel(nodes, "area of the nodes in contact [%]")
    if not curves.resolved_somewhere:
        return Panel(
            nodes, "area of the nodes in contact [%]\n(not resolved by the grid)"
        )
    parts = {
        part: np.where(curves.resolved, getattr(continuum, part), getattr(nodes, part))
        for part in ("value", "low", "high", "slope")
    }
    return Panel(Curve(**parts), CONTINUUM.label, ~curves.resolved)
