"""The printer of the commands: databases, plans of runs, descriptions of surfaces, contacts."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any

import numpy as np

from gen.quantities import QUANTITIES
from gen.runtime.memory import format_bytes
from gen.runtime.terminal import echo, print_columns
from gen.schema import (
    PHYSICS_CHANGES,
    REASONS,
    RUNTIME,
    TABLE_1,
    Status,
    made_by_other_solver,
)

if TYPE_CHECKING:  # each command imports no more than it needs
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from bem import Contact
    from gen.database import Reader
    from gen.database.reader import Counts
    from gen.maps.contacts import Answer, SolvedLoads
    from gen.maps.read import Topography
    from gen.maps.texture import ProfileRoughness, SelfAffineFit
    from gen.material import Bodies
    from gen.runtime.documents import Row
    from gen.scene import Scene
    from gen.statistics import Description

MAPS = {"found": "map", "against_found": "the second body's map"}
"""Keys of a scene's surfaces whose maps are shown in lines of their own, and words for a map."""

LEVELLING_STEPS = frozenset(("level plane", "level quadratic", "form"))
"""Steps of a preparation that take the tilt out of a map."""


def print_database(reader: Reader) -> None:
    """Print a summary of a database: rows, times, scene, versions, ranges of all columns."""
    from gen.generation.trial import doubts_after

    counts = reader.counts()
    echo(f"{reader.path}: {reader.attributes['title']}")
    _print_rows(reader, counts)
    damage = reader.damage()
    if damage:
        echo(f"  warning   {damage}")
    if counts.done:
        _print_times(reader)
    for doubt in doubts_after(reader):
        echo(f"  warning: {doubt}")
    for line in _scene_lines(json.loads(reader.scene.text())):
        echo(f"  scene     {line}")
    _print_origin(reader)
    if counts.done:
        _print_ranges(reader)


def _print_rows(reader: Reader, counts: Counts) -> None:
    """Print the size of a database, the counts of its rows, and the reasons of failed ones."""
    size = format_bytes(reader.path.stat().st_size)
    part = ""
    if len(reader.rows) < reader.scene.samples:
        last = reader.rows.stop - 1
        part = f": {reader.rows.start} to {last} of {reader.scene.samples}, a part"
    echo(f"  size      {size}, {sum(counts)} rows{part}")
    echo(
        f"  rows      {counts.done} done, {counts.failed} failed, {counts.pending} pending"
    )
    for status in (Status.DONE, Status.FAILED):
        for code, number in reader.reasons(status).items():
            reason = REASONS.get(code, f"reason {code}")
            echo(f"            {number} {status.name.lower()}: {reason}")


def _print_origin(reader: Reader) -> None:
    """Print the versions that made a database, and how results have changed since."""
    attributes = reader.attributes
    versions = json.loads(str(attributes["versions"]))
    names = [f"{name} {version}" for name, version in versions.items()]
    echo(f"  versions  {', '.join(names)}")
    echo(
        f"  made      {attributes['created']}, commit {attributes['git_commit'] or 'unknown'},"
        f" layout {attributes['schema']}, physics {attributes['physics']}"
    )
    physics = int(attributes["physics"])
    other_solver = made_by_other_solver(physics)
    if other_solver:
        echo(f"            {other_solver}")
        for number, change in PHYSICS_CHANGES.items():
            if number > physics:
                echo(f"            since physics {number}, {change}")


def _print_times(reader: Reader) -> None:
    """Print the times of the rows that are done."""
    done = reader.column("status") == Status.DONE
    solve = 1e3 * reader.column("solve_seconds")[done]
    surface = 1e3 * reader.column("surface_seconds")[done]
    echo(
        f"  times     solve {solve.mean():.2f} ms on average, {np.median(solve):.2f} median,"
        f" {solve.max():.2f} at most; surface and statistics {surface.mean():.2f} ms"
    )


def _print_ranges(reader: Reader) -> None:
    """Print the ranges of all columns of results over the rows that are done."""
    ranges = reader.ranges()
    rows = []
    for column in reader.columns():
        if column.name in ranges and column.group != RUNTIME:
            limits = [f"{limit:.6g}" for limit in ranges[column.name]]
            rows.append((column.name, column.unit, *limits))
    print_columns(rows, ("column", "unit", "from", "to"), right=("from", "to"))


def print_plan(scene: Scene, path: Path | None = None) -> None:
    """Print samples, surfaces, nodes and loads of a completed scene, and its database's size.

    With the `path` of the database also whether that exists.
    """
    from gen.database import file_bytes
    from gen.generation.trial import doubts_before

    echo(_plan_of_surfaces(scene))
    _print_plan_of_loads(scene)
    for doubt in doubts_before(scene, scene.samples):
        echo(f"  warning: {doubt}")
    echo(f"  file      {format_bytes(file_bytes(scene, scene.samples))}")
    if path is not None:
        state = "exists" if path.exists() else "does not exist yet"
        echo(f"  output    {path} {state}; nothing was written")


def _plan_of_surfaces(scene: Scene) -> str:
    """Return a line about the samples and the surfaces of a scene."""
    nx, ny = scene.grid.shape
    line = f"{scene.samples} samples on {scene.surfaces} surfaces of {nx} x {ny} nodes"
    if scene.contact.boundary != "free":
        line += f", {scene.contact.boundary} boundary"
    if scene.surface.against is not None:
        line += ", each against another rough one"
    return line


def _print_plan_of_loads(scene: Scene) -> None:
    """Print the range and the mean of the loads of a scene, and the range of its hardness."""
    from gen.generation.forecast import planned_loads

    loads = planned_loads(scene)
    name = "Delta" if scene.quantity == "delta" else scene.quantity
    unit = "" if scene.load_unit == "1" else f" {scene.load_unit}"
    echo(
        f"  {name:<9} {loads.smallest:.4g} to {loads.largest:.4g}{unit},"
        f" {loads.mean:.4g}{unit} on average"
    )
    if scene.contact.hardness_limits is not None:
        low, high = scene.contact.hardness_limits
        span = f"{low:.4g}" if low == high else f"{low:.4g} to {high:.4g}"
        echo(f"  hardness  {span} MPa")


def _scene_lines(scene: Mapping[str, Any]) -> list[str]:
    """Return the lines that show a scene: single keys, tables, and each map of its surfaces.

    The title is left out, as it is the title of the database too.
    """
    tables = {name: value for name, value in scene.items() if isinstance(value, dict)}
    single = {
        name: value
        for name, value in scene.items()
        if name not in tables and name != "title"
    }
    lines = [_assignments(single)]
    for table, keys in tables.items():
        short = {name: value for name, value in keys.items() if name not in MAPS}
        lines.append(f"[{table}] {_assignments(short)}")
        lines += _map_lines(keys)
    return lines


def _assignments(keys: Mapping[str, Any]) -> str:
    """Write keys with their values in one line."""
    return ", ".join(f"{name} = {json.dumps(value)}" for name, value in keys.items())


def _map_lines(table: Mapping[str, Any]) -> list[str]:
    """Return a line about each map that a table of a scene lists."""
    lines = []
    for key, noun in MAPS.items():
        if key not in table:
            continue
        for number, record in enumerate(table[key]["maps"]):
            nx, ny = record["nodes"]
            sha256 = record["sha256"][:12]
            lines.append(
                f"  {noun} {number}: {nx} x {ny} nodes, SHA-256 {sha256}..., {record['file']}"
            )
    return lines


def print_preparation(topography: Topography, warnings: Sequence[str]) -> None:
    """Print the steps from a file to a surface, and the warnings about it on standard error."""
    for step in topography.steps:
        echo(f"{topography.name}: {step}")
    for warning in warnings:
        echo(f"warning: {warning}", err=True)


def print_preparation_in_line(topography: Topography, warnings: Sequence[str]) -> None:
    """Print the steps of one of several maps in a line, and its warnings, on standard error."""
    echo(f"{topography.name}: {'; '.join(topography.steps)}", err=True)
    for warning in warnings:
        echo(f"  warning: {warning}", err=True)


def print_statistics(
    topography: Topography, statistics: Description, areal: Description
) -> None:
    """Print a line about the grid of a surface, its 22 statistics and its ISO 25178 parameters."""
    from gen.maps.areal import PARAMETERS

    echo(_grid_line(topography))
    _print_description(
        "statistic",
        statistics,
        [(column.name, column.unit, column.long_name) for column in TABLE_1],
    )
    _print_description(
        "ISO 25178",
        areal,
        [(name, unit, words) for name, unit, words in PARAMETERS if name in areal.values],
    )


def _grid_line(topography: Topography) -> str:
    """Return a line about nodes, spacing and heights of a surface, and about a tilt left in it."""
    from gen.maps.prepare import least_squares

    heights = topography.heights
    nx, ny = heights.shape
    x, y = topography.spacing
    line = (
        f"{nx} x {ny} nodes, spacing {x:.6g} x {y:.6g} um, heights {heights.min():.6g} to"
        f" {heights.max():.6g} um"
    )
    if not topography.followed & LEVELLING_STEPS:
        tilt = least_squares(topography).tilt
        line += f", tilt {tilt.x:.4g} along x, {tilt.y:.4g} along y"
    return line


def _print_description(
    title: str, description: Description, columns: Sequence[tuple[str, str, str]]
) -> None:
    """Print numbers of a surface, given by names, units and meanings, and why some are NaN."""
    rows = [
        (name, f"{description.values[name]:.6g}", unit, words)
        for name, unit, words in columns
    ]
    print_columns(rows, (title, "value", "unit", "meaning"), right={"value"})
    if description.reason:
        echo(f"Where nan stands: {description.reason}")


def print_profiles(profiles: Sequence[ProfileRoughness]) -> None:
    """Print the roughness of the profiles along x and along y of a directional surface."""
    rows = [
        (
            f"along {axis}",
            f"{roughness.rms_height:.6g}",
            f"{roughness.rms_slope:.6g}",
            f"{roughness.wavelength:.6g}",
        )
        for axis, roughness in zip("xy", profiles, strict=True)
    ]
    titles = ("profiles", "Rq um", "Rdq", "mean wavelength um")
    print_columns(rows, titles, right=set(titles[1:]))
    echo("Their power spectra: --spectrum FILE writes them, --plot FILE draws them")


def print_spectrum(fit: SelfAffineFit | str, nodes_per_wave: float) -> None:
    """Print the self-affine law of a surface, or why there is none, and its shortest wave.

    A surface without waves has NaN nodes per wave, and no line about them.
    """
    from gen.maps.texture import WELL_RESOLVED

    if isinstance(fit, str):
        echo(f"self-affine law: none, {fit}")
    else:
        _print_law(fit)
    if math.isnan(nodes_per_wave):
        return
    meaning = (
        "nodes: too few for the area of contact in the continuum to 1 %, see gen contact"
    )
    if nodes_per_wave >= WELL_RESOLVED:
        meaning = "nodes: enough for the area of contact in the continuum to 1 %"
    print_columns([("shortest wave", f"{nodes_per_wave:.2g}", meaning)])


def _print_law(fit: SelfAffineFit) -> None:
    """Print a self-affine law: where it holds, and its parameters as a scene has them."""
    law = fit.spectrum
    remarks = "".join(f"; {remark}" for remark in fit.remarks)
    echo(
        f"self-affine law over {fit.decades:.2g} decades, from {law.roll_off:.4g} to"
        f" {law.cut_off:.4g} um, the spectrum within a factor of {fit.scatter:.3g}{remarks}; as"
        " a start for the generator spectral:"
    )
    print_columns(
        [
            ("hurst", f"{law.hurst:.6g}", "1", "Hurst exponent"),
            (
                "roll_off",
                f"{law.roll_off:.6g}",
                "um",
                "longest wavelength of the power law",
            ),
            ("cut_off", f"{law.cut_off:.6g}", "um", "shortest wavelength"),
            ("rms_height", f"{fit.rms_height:.6g}", "um", "root mean square height"),
        ]
    )
    echo(
        "Here hurst is the exponent of the spectrum, as the generator spectral takes it;"
        " diamond-square and midpoint need a hurst that is 0.07 to 0.16 larger for this spectrum"
    )


COLUMNS_OF_FILES = {
    *(quantity.in_tables for quantity in QUANTITIES.values() if quantity.single),
    "modulus_MPa",
    "boundary",
    "hardness_MPa",
    "residual",
}
"""Columns that a table of several contacts has only in its file, not on the terminal."""


def print_contacts(solved: SolvedLoads) -> None:
    """Print one contact in full, or several with a line for each."""
    if len(solved.rows) == 1:
        _print_contact(solved.rows[0], solved.last, solved.seconds)
        return
    rows = [
        [answer for answer in row if answer.column not in COLUMNS_OF_FILES]
        for row in solved.rows
    ]
    titles = [answer.column for answer in rows[0]]
    cells = [[answer.shown for answer in row] for row in rows]
    print_columns(cells, titles, right=titles)


def _print_contact(answers: Sequence[Answer], contact: Contact, seconds: float) -> None:
    """Print the answers about a contact, its grid, and the time that its solution took [s]."""
    from gen.maps.contacts import CONTINUUM_ERROR

    # The error stands behind the area. On a rigid far field the approach is Delta.
    repeated = {CONTINUUM_ERROR}
    if contact.approach == contact.delta:
        repeated.add(QUANTITIES["approach"].in_tables)
    x, y = contact.problem.spacing
    area = contact.contact_nodes * x * y
    mean = contact.force / area if area else contact.force
    print_columns(
        [
            *(
                (answer.label, answer.shown, answer.unit)
                for answer in answers
                if answer.column not in repeated
            ),
            ("contact pressure", f"{mean:.6g}", "MPa, mean where in contact"),
            ("spacing", f"{x:.6g} x {y:.6g}", "um"),
            (
                "iterations",
                f"{contact.iterations}",
                f"({contact.convolutions} convolutions)",
            ),
            ("time", f"{1e3 * seconds:.1f}", "ms, the set-up of a first solve included"),
        ]
    )


MAIN = (
    "nodes_x",
    "nodes_y",
    "side_x_um",
    "side_y_um",
    "Sq",
    "Ssk",
    "Sku",
    "Sdq",
    "Sal",
    "Str",
    "hurst",
    "roll_off",
    "cut_off",
    "nodes_a_wave",
)
"""Columns that `print_described_maps` shows of each map."""


def print_described_maps(rows: Sequence[Row], units: Mapping[str, str]) -> None:
    """Print a row for each map with the main numbers, then mean and deviation of all numbers.

    `rows` are those of the maps, then the two of `gen.maps.several.summary`; `units` are those of
    the columns by their names.
    """
    main_rows = [[_title(row), *(_shown(row[name]) for name in MAIN)] for row in rows]
    print_columns(main_rows, ["surface", *MAIN], right=MAIN)
    mean, deviation = rows[-2:]
    lines = [
        (name, _shown(mean[name]), _shown(deviation[name]), units[name])
        for name in mean
        if name in units
    ]
    titles = ("statistic", "mean", "standard deviation", "unit")
    print_columns(lines, titles, right={"mean", "standard deviation"})


def print_pressed_maps(rows: Sequence[Row], column: str, bodies: Bodies) -> None:
    """Print a table of all maps for each load, with mean and deviation.

    The loads stand in the `column` of the rows that the user gave them in.
    """
    hidden = {
        *COLUMNS_OF_FILES,
        "row",
        "surface",
        "prepared",
        "warnings",
        "continuum_area_error_percent",
        column,
    }
    names = [name for name in rows[0] if name not in hidden]
    for load in dict.fromkeys(row[column] for row in rows):
        echo(f"{column.removeprefix('given_')} = {_shown(load)}; {bodies.text}")
        lines = [
            [_title(row), *(_shown(row[name]) for name in names)]
            for row in rows
            if row[column] == load
        ]
        print_columns(lines, ["surface", *names], right=names)


def _title(row: Row) -> str:
    """Return the name of a map, or the kind of a row that summarises maps, as "mean"."""
    title = row["surface"] if row["row"] == "surface" else row["row"]
    return str(title)


def _shown(value: float | int | str) -> str:
    """Return a cell for people: at most five digits of a number, and - where there is none."""
    if isinstance(value, float) and math.isnan(value):
        return "-"
    if isinstance(value, float):
        return f"{value:.5g}"
    return str(value) or "-"
