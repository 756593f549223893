"""Print a contact law, and write it as CSV, JSON, a picture, and the files of programs."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Values
from gen.law import accuracy, cubics, finite_elements, programs
from gen.law.contact_law import Law
from gen.law.curves import Curve, Curves
from gen.law.surfaces import Source
from gen.material import LayeredBody, columns_of_layer
from gen.options import LawOutputs, LayerPlace, Units
from gen.quantities import (
    AREA,
    CLOSURE,
    CONTINUUM,
    DELTA,
    ELASTIC_SLIPS,
    IN_LAWS,
    MEAN_GAP,
    PRESSURE,
    SHEAR_STIFFNESSES,
    SLIP_CURVES,
    STIFFNESS,
)
from gen.runtime import VERSION
from gen.runtime.documents import Row, json_text, write_csv
from gen.runtime.figure import save
from gen.runtime.files import write
from gen.runtime.installation import git_commit
from gen.runtime.terminal import echo, first_reason, print_columns

PARTS = {
    "": "value",
    "_low": "low",
    "_high": "high",
    "_slope": "slope",
    "_std": "std",
}
"""Attributes of `Curve` by the suffix of their columns, which follows the name of the quantity."""

FORMAT_VERSION = 1
"""Version of the JSON document. It is raised when a reader of the last version would misread a
file."""


def write_files(law: Law, files: LawOutputs, figure: Any) -> Iterator[Path]:
    """Write a law to all files that the options name, and yield each one once it is written.

    Parameters
    ----------
    law : Law
        The law.
    files : LawOutputs
        Paths of the files, None for those not wanted, and the units of finite-element files.
    figure : matplotlib.figure.Figure or None
        Empty figure for the picture; None if no picture is named.

    Yields
    ------
    Path
        File that was written. A format may have several files.

    Raises
    ------
    InputError
        If the law closes nowhere, and a file other than CSV and JSON is named; no file is written
        then. Also if a program cannot take the law; the files before its own are written then.
    """
    paths = {name: getattr(files, name) for name in WRITERS}
    named = {name: path for name, path in paths.items() if path is not None}
    if files.picture is not None or named.keys() - {"table", "json"}:
        finite_elements.rising(law)  # raises InputError before any file is written
    for name, path in named.items():
        yield from WRITERS[name](path, law, files.units)
    if files.picture is not None:
        draw(figure, law, files.picture)
        yield files.picture


def show(law: Law) -> None:
    """Print the notes of a law, and the tables that its order requests.

    Parameters
    ----------
    law : Law
        The law. `law.order.requested` names the tables: Delta if the order gives no loads.
    """
    for note in law.notes:
        echo(note)
    if "delta" in law.order.requested:
        _show_table(law, law.over_delta)
    if "pressure" in law.order.requested:
        _show_table(law, law.over_pressure)


def _show_table(law: Law, table: Curves) -> None:
    """Print a table of a law under its title.

    If errors were asked for, the grid and the errors of each row follow its quantities. The last
    column has the reason of each row: why it has no band, or what is outside a surrogate's
    training. Rows with a reason and no band show "(-)" in place of the band.
    """
    echo(law.title)
    echo(f"{law.bodies.text}; band: {law.band}")
    names = _columns_shown(table)
    about_errors: list[str] = []  # titles of their columns
    banded = np.any([curve.banded for curve in table.curves.values()], axis=0)
    lines: list[list[str]] = []
    for place, row in enumerate(cells(table)):
        reason = table.reasons[place]
        withheld = bool(reason) and not banded[place]
        line = [f"{row[table.against]:.5g}"]
        line += [_text_of_cell(row, name, withheld=withheld) for name in names]
        if law.order.errors is not None:
            cells_of_load = accuracy.cells(table, place, law.order.errors, surfaces=1)
            line += accuracy.shown_cells(cells_of_load)
            about_errors = accuracy.shown_columns(cells_of_load)
        line.append(first_reason(reason))
        lines.append(line)
    last = "reason" if any(table.reasons) else ""
    titles = [table.against, *names, *about_errors]
    print_columns(lines, [*titles, last], right=titles)


def _columns_shown(table: Curves) -> list[str]:
    """Return the names of the quantities whose columns are printed.

    A table against Delta is printed without the closure, so that its lines are shorter. A table
    against pressure is printed without Delta if Delta equals the closure at every pressure. Shifts
    and losses are in files alone.
    """
    slip_curves = {quantity.in_laws for quantity in SLIP_CURVES}
    names = [name for name in table.curves if name not in slip_curves]
    if table.against == DELTA.in_laws:
        names.remove(CLOSURE.in_laws)
        return names
    deltas = table.curves[DELTA.in_laws].value
    closures = table.curves[CLOSURE.in_laws].value
    if np.array_equal(deltas, closures):
        names.remove(DELTA.in_laws)
    return names


def _text_of_cell(row: Row, name: str, *, withheld: bool) -> str:
    """Return the value of a quantity and its band as text, as "1.5 (1.2 to 1.8)".

    A value that is unknown is "-", without a band. If the band is `withheld`, it is "(-)". A value
    without a band, or with a band of no width, has nothing behind it.
    """
    value = row[name]
    low = row[f"{name}_low"]
    high = row[f"{name}_high"]
    if value == "":
        return "-"
    band = ""
    if isinstance(low, float) and isinstance(high, float) and low < high:
        band = f" ({low:.4g} to {high:.4g})"
    elif withheld:
        band = " (-)"
    return f"{value:.4g}{band}"


def cells(table: Curves) -> list[Row]:
    """Return the rows of a table of a law, with numbers by the names of the columns.

    Parameters
    ----------
    table : Curves
        Table of a law, with k arguments.

    Returns
    -------
    list of dict
        k rows. Each has the argument and, for every quantity, the value, both ends of the band, the
        slope and the standard deviation, whose columns end as in `PARTS`. NaN becomes "".
    """
    rows: list[Row] = [{table.against: argument} for argument in table.at.tolist()]
    for name, curve in table.curves.items():
        for suffix, part in PARTS.items():
            numbers = getattr(curve, part).tolist()
            for row, number in zip(rows, numbers, strict=True):
                row[f"{name}{suffix}"] = _cell(number)
    return rows


def write_table(path: Path, law: Law) -> list[Path]:
    """Write a law as CSV: the table against Delta, then the table against pressure.

    For each quantity there are the value, the band, the slope and the standard deviation, and for a
    population a column for each surface. Columns that are empty in all rows are left out, such as
    the band of one surface. The first row of each table has the files of the surfaces, their hashes
    and their preparation.

    Parameters
    ----------
    path : Path
        The file.
    law : Law
        The law.

    Returns
    -------
    list of Path
        The file.
    """
    rows = [*_rows(law, law.over_delta), *_rows(law, law.over_pressure)]
    used = [name for name in rows[0] if any(row[name] != "" for row in rows)]
    write_csv(path, [{name: row[name] for name in used} for row in rows])
    return [path]


def _rows(law: Law, table: Curves) -> list[Row]:
    """Return the rows of a table for CSV. Both tables of a law have the same columns.

    In a table's own argument, such as delta_um, the column of the value has the argument. The
    columns of its band, slope and deviation are "", and are there because the other table needs
    them.
    """
    quantities = [DELTA.in_laws, *law.over_delta.curves]
    columns = [f"{name}{suffix}" for name in quantities for suffix in PARTS]
    rows: list[Row] = []
    sources = law.sources
    for place, numbers in enumerate(cells(table)):
        row = _about_the_load(law, table, place)
        row |= {column: numbers.get(column, "") for column in columns}
        row |= _about_the_errors(law, table, place)
        row["resolved"] = _resolved(table, place)
        row["reason"] = table.reasons[place]
        row |= _record_of_the_files(sources)
        row |= _of_each_surface(law, table, place)
        rows.append(row)
        sources = ()  # only the first row has them
    return rows


def _about_the_load(law: Law, table: Curves, place: int) -> Row:
    """Return the first cells of a row: its kind of argument, the share outside, and the bodies.

    The share is that of the surfaces outside a surrogate's training, 0 to 1. Layer and hardness are
    left out if there is none, and the boundary if it is free.
    """
    row: Row = {"against": table.against, "outside": float(table.outside[place])}
    if law.bodies.layered is not None:
        row |= columns_of_layer(law.bodies.layered.body)
        row["layer_in"] = law.order.layer_in
    if law.bodies.hardness is not None:
        row["hardness_MPa"] = law.bodies.hardness
    if law.boundary != "free":
        row["boundary"] = law.boundary
    return row


def _about_the_errors(law: Law, table: Curves, place: int) -> Row:
    """Return the cells about errors that were asked for, and about the limits of the maps.

    The row is empty if no error was asked for.
    """
    row = _errors_at(law, table, place)
    if law.limits:
        row |= accuracy.worst_limits(law.limits).columns
    return row


def _errors_at(law: Law, table: Curves, place: int) -> Row:
    """Return the cells about the errors at one argument of a table; {} if none was asked for."""
    errors = law.order.errors
    if errors is None:
        return {}
    row = accuracy.cells(table, place, errors, len(law.surface_names))
    if law.sampled is not None:
        row |= law.sampled.cells(table, place)
    return row


def _of_each_surface(law: Law, table: Curves, place: int) -> Row:
    """Return the cells of a row with each quantity on each surface.

    They are "" in a law of one surface, and for quantities that the table does not have.
    """
    row: Row = {}
    for name in (DELTA.in_laws, *law.over_delta.curves):
        columns = [
            f"{name}_surface_{number}" for number in range(1, len(law.surface_names) + 1)
        ]
        row |= dict.fromkeys(columns, "")
        curve = table.curves.get(name)
        if curve is not None and curve.surfaces is not None:
            numbers = curve.surfaces[:, place].tolist()
            row |= dict(zip(columns, map(_cell, numbers), strict=True))
    return row


def _resolved(table: Curves, place: int) -> str:
    """Return "yes" or "no": whether the grid resolves the contact at an argument of a table.

    Return "" if that was not judged, and at first touch, where there is no contact to resolve.
    """
    if table.resolved is None or not table.at[place] > 0:
        return ""
    return "yes" if table.resolved[place] else "no"


def _record_of_the_files(sources: Sequence[Source]) -> Row:
    """Return the cells with the files of surfaces, their hashes and their preparation.

    All three are "" without sources.
    """
    files = [file for source in sources for file in source.files]
    steps = " | ".join("; ".join(source.steps) for source in sources)
    return {
        "files": "; ".join(file.path for file in files),
        "sha256": "; ".join(file.sha256 for file in files),
        # Without commas, because simple readers of CSV cut lines there.
        "prepared": steps.replace(",", ";"),
    }


def _cell(number: float) -> float | str:
    """Return a number for a table, "" for NaN."""
    return "" if math.isnan(number) else number


def write_json(path: Path, law: Law) -> list[Path]:
    """Write a law as JSON, with null for numbers that are not finite.

    Parameters
    ----------
    path : Path
        The file.
    law : Law
        The law.

    Returns
    -------
    list of Path
        The file.
    """
    gas: dict[str, float] = {}
    if law.order.gas is not None:
        gas = law.order.gas.by_keys
    friction: dict[str, float] = {}
    if law.order.friction is not None:
        friction = {
            "friction": law.order.friction.coefficient,
            "poisson_in_shear": law.order.friction.poisson,
        }
    layer: dict[str, Any] = {}
    if law.bodies.layered is not None:
        layer = _layer_in_json(law.bodies.layered, law.order.layer_in)
    document: dict[str, Any] = {
        "format": "asperity contact law",
        "version": FORMAT_VERSION,
        "e_star_MPa": law.bodies.e_star,
        **layer,
        "hardness_MPa": law.bodies.hardness,
        "conductivities_W_per_m_K": law.order.conductivities,
        **gas,
        **friction,
        "boundary": law.boundary,
        "surfaces": list(law.descriptions),
        "sources": [asdict(source) for source in law.sources],
        "surface_names": list(law.surface_names),
        "band": law.band,
        "notes": list(law.notes),
        "command": law.order.command,
        "made": datetime.now(UTC).isoformat(timespec="seconds"),
        "asperity": VERSION,
        "commit": git_commit(),
        "tables": [
            _table_in_json(law.over_delta) | _errors_in_json(law, law.over_delta),
            _table_in_json(law.over_pressure) | _errors_in_json(law, law.over_pressure),
        ],
    }
    if law.order.errors is not None:
        document["errors_asked_percent"] = {
            name: 100 * error for name, error in law.order.errors.items()
        }
        document["limits_of_maps"] = [_nulls(limits.columns) for limits in law.limits]
    if law.sampled is not None:
        document["population"] = law.sampled.in_json
    write(path, json_text(document))
    return [path]


def _layer_in_json(layered: LayeredBody, layer_in: LayerPlace) -> dict[str, Any]:
    """Return the layer of a law for JSON, with the place of its uniform compression."""
    return {
        "layer": {
            **columns_of_layer(layered.body),
            "compression_um_per_MPa": layered.layer_compliance,
            "compression_is_in": layer_in,
        }
    }


def _table_in_json(table: Curves) -> dict[str, Any]:
    """Return a table of a law as an object for JSON."""
    curves = {name: _curve_in_json(curve) for name, curve in table.curves.items()}
    return {
        "against": table.against,
        "at": table.at.tolist(),
        "gap_at_rest_um": table.at_rest[MEAN_GAP.in_laws],
        "share_of_surfaces_outside_the_training": table.outside.tolist(),
        "reasons": list(table.reasons),
        "grid": list(table.unresolved),
        "curves": curves,
    }


def _errors_in_json(law: Law, table: Curves) -> dict[str, Any]:
    """Return the columns about the errors of a table for JSON; {} if none was asked for."""
    if law.order.errors is None:
        return {}
    columns: dict[str, list[Any]] = {}
    for place in range(table.at.size):
        for column, cell in _nulls(_errors_at(law, table, place)).items():
            columns.setdefault(column, []).append(cell)
    return {"errors": columns}


def _nulls(row: Row) -> dict[str, Any]:
    """Return a row for JSON, with None in place of ""."""
    return {column: None if cell == "" else cell for column, cell in row.items()}


def _curve_in_json(curve: Curve) -> dict[str, Any]:
    """Return a curve as an object for JSON.

    A curve of a population has the standard deviation and a list for each surface, too.
    """
    numbers: dict[str, Any] = {
        "value": _finite(curve.value),
        "low": _finite(curve.low),
        "high": _finite(curve.high),
        "slope": _finite(curve.slope),
    }
    if curve.surfaces is not None:
        numbers["std"] = _finite(curve.std)
        numbers["by_surface"] = [_finite(surface) for surface in curve.surfaces]
    return numbers


def _finite(values: Values) -> list[float | None]:
    """Return numbers for JSON, None for those that are not finite."""
    return [number if math.isfinite(number) else None for number in values.tolist()]


WRITERS: dict[str, Callable[[Path, Law, Units], list[Path]]] = {
    "table": lambda path, law, _: write_table(path, law),
    "json": lambda path, law, _: write_json(path, law),
    "header": lambda path, law, _: cubics.write_header(path, law),
    "calculix": lambda path, law, units: finite_elements.write(
        path, law, "calculix", units
    ),
    "abaqus": lambda path, law, units: finite_elements.write(path, law, "abaqus", units),
    "for_4c": cubics.write_for_4c,
    "moose": programs.write_for_moose,
    "ansys": programs.write_for_ansys,
    "comsol": programs.write_for_comsol,
}
"""Functions that write a file, by the field of `gen.options.LawOutputs` that has its path.

They return the paths of all files that they wrote. For a new format, add a field there, with the
end of the names of its files, and a line here."""


@dataclass(frozen=True, eq=False)
class Panel:
    """A quantity over the pressure, which both panels of one column of a picture show."""

    curve: Curve  # at k pressures
    label: str  # of the vertical axis
    # True where the area of the nodes replaces the area in the continuum, (k,): circles mark these
    # points. False if there are none.
    of_nodes: NDArray[np.bool_] | bool = False


def draw(figure: Any, law: Law, picture: Path) -> None:
    """Draw closure, area and stiffness or conductance over pressure into a figure, and save it.

    Loads at which most surfaces are outside a surrogate's training are left out. The area is chosen
    by `drawn_area`. The upper row has linear axes, the lower row logarithmic ones.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        Empty figure.
    law : Law
        The law.
    picture : Path
        File of the picture.
    """
    curves = law.over_pressure.chosen(~law.over_pressure.flagged)
    panels = _panels(curves)
    figure.suptitle(
        f"{law.title}\n{law.bodies.text}\nband: {law.band}", fontsize=11, parse_math=False
    )
    axes = figure.subplots(2, len(panels))
    for row, scale in enumerate(("linear", "log")):
        for column, panel in enumerate(panels):
            _draw_panel(axes[row, column], curves.at, panel, scale)
    save(figure, picture)


def _panels(curves: Curves) -> list[Panel]:
    """Return panels of the closure, of the area, and of the conductance or else the stiffness.

    The third one is left out if the table has neither. Tables with shear have two further panels:
    stiffness in shear and elastic slip, along x.
    """
    closure = Panel(curve=curves.curves[CLOSURE.in_laws], label=CLOSURE.label)
    panels = [closure, drawn_area(curves)]
    name = curves.conductance_name or STIFFNESS.in_laws
    if name in curves.curves:
        panels.append(Panel(curve=curves.curves[name], label=IN_LAWS[name].label))
    for quantity in (SHEAR_STIFFNESSES[0], ELASTIC_SLIPS[0]):  # along x
        if quantity.in_laws in curves.curves:
            curve = curves.curves[quantity.in_laws]
            panels.append(Panel(curve=curve, label=quantity.label))
    return panels


def _draw_panel(axis: Any, pressures: Values, panel: Panel, scale: str) -> None:
    """Draw a quantity and its band over pressures, (k,) [MPa]. `scale` is "linear" or "log".

    Points that are not finite are left out; on logarithmic axes also those that are not above 0.
    """
    curve = panel.curve
    drawn = np.isfinite(curve.value)
    band = curve.banded
    if scale == "log":
        drawn = drawn & (pressures > 0) & (curve.value > 0)
        band = band & (curve.low > 0)
    band = band & drawn
    axis.set(xscale=scale, yscale=scale)
    axis.plot(pressures[drawn], curve.value[drawn], ".-", color="tab:blue")
    _mark_area_of_nodes(axis, pressures, panel, drawn)
    if band.any():
        axis.fill_between(
            pressures[band], curve.low[band], curve.high[band], alpha=0.25, lw=0
        )
    axis.grid(alpha=0.3)
    if scale == "linear":
        axis.set(xlim=(0, None), ylim=(0, None))
    axis.set(xlabel=PRESSURE.label, ylabel=panel.label)


def _mark_area_of_nodes(
    axis: Any, pressures: Values, panel: Panel, drawn: NDArray[np.bool_]
) -> None:
    """Mark with circles the points whose area is that of the nodes, not that in the continuum.

    At their loads, the grid does not resolve the contact. A point at 0 MPa is not marked.
    `pressures` are the pressures of the points of the panel, (k,) [MPa]. `drawn` is True at the
    points that are drawn, (k,).
    """
    marked = drawn & panel.of_nodes & (pressures > 0)
    if not marked.any():
        return  # no point to mark, and no legend
    axis.plot(
        pressures[marked],
        panel.curve.value[marked],
        "o",
        color="tab:orange",
        fillstyle="none",
        label="not resolved: area of the nodes",
    )
    axis.legend(fontsize=8)


def drawn_area(curves: Curves) -> Panel:
    """Choose the area to draw: in the continuum where the grid resolves it, else of the nodes.

    Parameters
    ----------
    curves : Curves
        Table against pressure.

    Returns
    -------
    Panel
        The area of the nodes, if the area in the continuum was not asked for or the grid resolves
        it nowhere. Otherwise the area in the continuum, with the area of the nodes at loads where
        the grid does not resolve it; these loads are marked.
    """
    nodes = curves.curves[AREA.in_laws]
    continuum = curves.curves.get(CONTINUUM.in_laws)
    if continuum is None or curves.resolved is None:
        return Panel(curve=nodes, label="area of the nodes in contact [%]")
    if not curves.resolved_somewhere:
        label = "area of the nodes in contact [%]\n(not resolved by the grid)"
        return Panel(curve=nodes, label=label)
    resolved = curves.resolved
    area = Curve(
        value=np.where(resolved, continuum.value, nodes.value),
        low=np.where(resolved, continuum.low, nodes.low),
        high=np.where(resolved, continuum.high, nodes.high),
        slope=np.where(resolved, continuum.slope, nodes.slope),
    )
    return Panel(curve=area, label=CONTINUUM.label, of_nodes=~resolved)
