"""Print what commands report: databases, plans of runs, descriptions of surfaces, contacts."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any

import numpy as np

from gen.material import LAYER_COLUMNS
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
from gen.units import readable_unit, time_with_unit

if TYPE_CHECKING:  # each command imports no more than it needs
    from collections.abc import Iterable, Mapping, Sequence
    from pathlib import Path

    from bem import Budget, Contact
    from gen.database import Reader
    from gen.database.reader import Counts
    from gen.maps.answers import Answer
    from gen.maps.contacts import SolvedLoads
    from gen.maps.joining import JoinedSpectrum
    from gen.maps.read import Topography
    from gen.maps.texture import ProfileRoughness, SelfAffineFit
    from gen.material import Bodies
    from gen.runtime.documents import Row
    from gen.scene import Scene
    from gen.statistics import Description

DIGITS = 6
"""Significant digits of the numbers in reports about databases and contacts."""

MAPS = {"found": "map", "against_found": "the second body's map"}
"""Keys of the table [surface] of a scene that list maps, and the noun for a map in a report.

Each of these maps is printed in a separate line.
"""

LEVELLING_STEPS = frozenset(("level plane", "level quadratic", "level lines", "form"))
"""Steps of a preparation that remove the tilt of a map."""


def print_database(reader: Reader) -> None:
    """Print a summary of a database: rows, times, doubts, scene, versions, ranges of all columns.

    Times and ranges are left out if no row is done.
    """
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
    _print_accuracy(reader.scene)
    for line in _scene_lines(json.loads(reader.scene.text())):
        echo(f"  scene     {line}")
    _print_origin(reader)
    if counts.done:
        _print_ranges(reader)


def _print_rows(reader: Reader, counts: Counts) -> None:
    """Print the size of a database, the counts of its rows by status, and their reasons.

    A failed row has a reason, and a done row too if something about it is undefined.
    """
    size = format_bytes(reader.path.stat().st_size)
    part = ""
    if len(reader.rows) < reader.scene.samples:
        last = reader.rows.stop - 1
        part = f": {reader.rows.start} to {last} of {reader.scene.samples}, a part"
    all_rows = counts.done + counts.failed + counts.pending
    echo(f"  size      {size}, {all_rows} rows{part}")
    echo(
        f"  rows      {counts.done} done, {counts.failed} failed, {counts.pending} pending"
    )
    for status in (Status.DONE, Status.FAILED):
        for code, number in reader.reasons(status).items():
            # A damaged file may have a code that is no reason.
            reason = REASONS.get(code, f"reason {code}")
            echo(f"            {number} {status.name.lower()}: {reason}")


def _print_origin(reader: Reader) -> None:
    """Print with which versions, when, and by which commit and format a database was made.

    If another solver than that of this version made it, the changes of physics since then follow.
    """
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
    """Print the times that the done rows took, of which there is at least one."""
    done = reader.column("status") == Status.DONE
    solve = reader.column("solve_seconds")[done]
    surface = reader.column("surface_seconds")[done]
    mean = time_with_unit(float(solve.mean()))
    median = time_with_unit(float(np.median(solve)))
    longest = time_with_unit(float(solve.max()))
    mean_of_surface = time_with_unit(float(surface.mean()))
    echo(
        f"  times     solve {mean} on average, {median} median, {longest} at most;"
        f" surface and statistics {mean_of_surface}"
    )


def _print_ranges(reader: Reader) -> None:
    """Print a table of the smallest and largest value of each column of numbers over all done rows.

    Columns about the run itself, such as times, are left out.
    """
    ranges = reader.ranges()
    rows = []
    for column in reader.columns():
        if column.name not in ranges or column.group == RUNTIME:
            continue
        limits = ranges[column.name]
        unit = readable_unit(column.unit, limits.largest, DIGITS)
        smallest = f"{limits.smallest / unit.size:.{DIGITS}g}"
        largest = f"{limits.largest / unit.size:.{DIGITS}g}"
        rows.append((column.name, unit.name, smallest, largest))
    print_columns(rows, ("column", "unit", "from", "to"), right=("from", "to"))


def print_plan(scene: Scene, path: Path | None = None) -> None:
    """Print the samples, surfaces, nodes, loads and database size that a scene plans.

    Doubts about the plan are printed too, for which some rows are computed.

    Parameters
    ----------
    scene : Scene
        A completed scene.
    path : Path, optional
        The file that the run would write (`--dry-run`). If it is given, a line tells whether the
        file exists and that nothing was written.
    """
    from gen.database import file_bytes
    from gen.generation.trial import doubts_before

    echo(_plan_of_surfaces(scene))
    _print_plan_of_loads(scene)
    _print_accuracy(scene)
    for doubt in doubts_before(scene, scene.samples):
        echo(f"  warning: {doubt}")
    echo(f"  file      {format_bytes(file_bytes(scene, scene.samples))}")
    if path is not None:
        state = "exists" if path.exists() else "does not exist yet"
        echo(f"  output    {path} {state}; nothing was written")


def _print_accuracy(scene: Scene) -> None:
    """Print the accuracy of a scene with the grid that a trial has found; nothing without one."""
    for number, line in enumerate(scene.report_of_accuracy()):
        echo(f"  {'' if number else 'accuracy':<9} {line}")


def _plan_of_surfaces(scene: Scene) -> str:
    """Return a line with the numbers of samples and surfaces, and the nodes of a surface.

    The boundary follows unless it is free, and then a second rough body if the scene has one.
    """
    nx, ny = scene.grid.shape
    line = f"{scene.samples} samples on {scene.surfaces} surfaces of {nx} x {ny} nodes"
    if scene.contact.boundary != "free":
        line += f", {scene.contact.boundary} boundary"
    if scene.surface.against is not None:
        line += ", each against another rough one"
    return line


def _print_plan_of_loads(scene: Scene) -> None:
    """Print the range and the mean of a scene's loads, and the hardness or its range, if any."""
    from gen.generation.forecast import planned_loads

    loads = planned_loads(scene)
    name = "Delta" if scene.quantity == "delta" else scene.quantity
    unit = ""
    if scene.load_unit != "1":
        unit = f" {scene.load_unit}"
    echo(
        f"  {name:<9} {loads.smallest:.4g} to {loads.largest:.4g}{unit},"
        f" {loads.mean:.4g}{unit} on average"
    )
    if scene.contact.hardness_limits is not None:
        low, high = scene.contact.hardness_limits
        hardness = f"{low:.4g}"
        if high != low:
            hardness += f" to {high:.4g}"
        echo(f"  hardness  {hardness} MPa")
    if scene.contact.layer is not None:
        echo(f"  layer     {scene.contact.layer_text}")


def _scene_lines(scene: Mapping[str, Any]) -> list[str]:
    """Return lines that show a scene (values by key, tables as dictionaries).

    The first line has the keys outside of tables. Each table has a line with its keys, and a line
    for each map that it lists. The title is left out, because a report begins with it, and so is
    the trial of an accuracy, which has lines of its own.
    """
    tables = {name: value for name, value in scene.items() if isinstance(value, dict)}
    keys_outside = {
        name: value
        for name, value in scene.items()
        if name not in tables and name != "title"
    }
    lines = [_assignments(keys_outside)]
    for name, table in tables.items():
        without_maps = {key: value for key, value in table.items() if key not in MAPS}
        lines.append(f"[{name}] {_assignments(without_maps)}")
        lines += _map_lines(table)
    return lines


def _assignments(values: Mapping[str, Any]) -> str:
    """Write values by key as one line "key = value, key = value", each value as JSON."""
    return ", ".join(f"{key} = {json.dumps(value)}" for key, value in values.items())


def _map_lines(table: Mapping[str, Any]) -> list[str]:
    """Return a line about each map that a table of a scene lists under the keys `MAPS`."""
    lines = []
    for key, noun in MAPS.items():
        kept = table.get(key)
        if not isinstance(kept, dict):
            continue
        if "sha256" in kept:  # the population of surfaces like maps
            lines.append(f"  population: SHA-256 {kept['sha256'][:12]}...")
        for number, record in enumerate(kept.get("maps", ())):
            nx, ny = record["nodes"]
            sha256 = record["sha256"][:12]
            lines.append(
                f"  {noun} {number}: {nx} x {ny} nodes, SHA-256 {sha256}..., {record['file']}"
            )
    return lines


def print_preparation(topography: Topography, warnings: Sequence[str]) -> None:
    """Print the steps that prepared a surface, and its warnings on standard error, one a line."""
    for step in topography.steps:
        echo(f"{topography.name}: {step}")
    for warning in warnings:
        echo(f"warning: {warning}", err=True)


def print_preparation_in_line(topography: Topography, warnings: Sequence[str]) -> None:
    """Print the steps that prepared one of several maps in a single line, then its warnings.

    All lines go to standard error, because standard output has the table of all maps.
    """
    echo(f"{topography.name}: {'; '.join(topography.steps)}", err=True)
    for warning in warnings:
        echo(f"  warning: {warning}", err=True)


def print_statistics(
    topography: Topography, statistics: Description, areal: Description
) -> None:
    """Print the grid of a surface, then tables of its statistics and ISO 25178 parameters.

    Parameters
    ----------
    topography : Topography
        The surface, whose nodes, spacing, heights and tilt are printed.
    statistics : Description
        Its 22 statistics.
    areal : Description
        Its parameters of ISO 25178. Parameters without a value in it are left out.
    """
    from gen.maps.areal import PARAMETERS

    echo(_grid_line(topography))
    columns = [(column.name, column.unit, column.long_name) for column in TABLE_1]
    _print_description("statistic", statistics, columns)
    parameters = [
        (parameter.name, parameter.unit, parameter.meaning)
        for parameter in PARAMETERS
        if parameter.name in areal.values
    ]
    _print_description("ISO 25178", areal, parameters)


def _grid_line(topography: Topography) -> str:
    """Return a line about the nodes, the spacing and the range of the heights of a surface.

    The tilt is added unless a step of the preparation has removed it.
    """
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
    title: str, description: Description, numbers: Sequence[tuple[str, str, str]]
) -> None:
    """Print a table of numbers of a surface, and why some of them are NaN.

    Each of `numbers` is the name, unit and meaning of a number; `title` is the title of the column
    of names.
    """
    rows = [
        (name, f"{description.values[name]:.6g}", unit, meaning)
        for name, unit, meaning in numbers
    ]
    print_columns(rows, (title, "value", "unit", "meaning"), right={"value"})
    if description.reason:
        echo(f"Where nan stands: {description.reason}")


def print_profiles(profiles: Sequence[ProfileRoughness]) -> None:
    """Print the roughness of the profiles of a directional surface, those along x, then along y."""
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
    """Print the self-affine law of a surface, and whether its shortest wave has enough nodes.

    Parameters
    ----------
    fit : SelfAffineFit or str
        The law, or the reason why there is none.
    nodes_per_wave : float
        Number of nodes in the shortest wave. NaN, of a surface without waves, prints no line.
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


def print_joined(joined: JoinedSpectrum) -> None:
    """Print the scans of a joined spectrum with the waves that they know, and its law."""
    from gen.maps.read import spacing_text
    from gen.statistics import rms_slope

    rows = []
    for scan in joined.scans:
        topography = scan.topography
        nx, ny = topography.heights.shape
        waves = scan.range
        slope = rms_slope(topography.heights, topography.spacing)
        rows.append(
            (
                topography.name,
                f"{nx} x {ny}",
                spacing_text(topography.spacing, 4),
                f"{waves.longest:.4g} to {waves.shortest:.4g}",
                waves.limit,
                f"{topography.heights.std():.4g}",
                f"{slope:.4g}",
            )
        )
    titles = (
        "scan",
        "nodes",
        "spacing um",
        "known waves um",
        "limit",
        "rms height um",
        "rms slope",
    )
    print_columns(rows, titles, right=set(titles[1:]) - {"limit"})
    first = 2 * math.pi / joined.spectrum.edges[0, 0]
    last = 2 * math.pi / joined.spectrum.edges[-1, 1]
    echo(
        f"joined spectrum of waves of {first:.4g} to {last:.4g} um: rms height"
        f" {joined.rms_height:.4g} um, rms slope {joined.rms_slope:.4g}"
    )
    print_spectrum(joined.fit, nodes_per_wave=math.nan)


def _print_law(fit: SelfAffineFit) -> None:
    """Print the wavelengths between which a self-affine law holds, and its parameters.

    The parameters have the names and units of the keys that a scene gives the generator `spectral`.
    """
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
    *LAYER_COLUMNS,
    "boundary",
    "hardness_MPa",
    "residual",
}
"""Columns of tables of several contacts that are only written to files.

They would make the table too wide for a terminal.
"""


def print_contacts(solved: SolvedLoads) -> None:
    """Print a single contact in full, or a table with a line for each of several contacts.

    The table is without the limits of the map, which are the same in all rows.
    """
    from gen.maps.limits import NODES_A_WAVE

    if len(solved.rows) == 1:
        _print_contact(solved.rows[0], solved.last, solved.seconds)
        return
    hidden = {*COLUMNS_OF_FILES, NODES_A_WAVE}
    rows = [
        [answer for answer in row if answer.column not in hidden and not answer.is_detail]
        for row in solved.rows
    ]
    columns = [_in_readable_unit(column) for column in zip(*rows, strict=True)]
    titles = [column[0].column for column in columns]
    cells = [[answer.shown for answer in row] for row in zip(*columns, strict=True)]
    print_columns(cells, titles, right=titles)


def _in_readable_unit(column: Sequence[Answer]) -> list[Answer]:
    """Return the answers of a column in a unit in which the largest of them has no exponent."""
    numbers = [abs(answer.value) for answer in column if isinstance(answer.value, float)]
    largest = max(filter(math.isfinite, numbers), default=0.0)
    unit = readable_unit(column[0].unit_alone, largest, DIGITS)
    return [answer.in_unit(unit) for answer in column]


def _print_contact(answers: Sequence[Answer], contact: Contact, seconds: float) -> None:
    """Print a table of all answers about a contact, its mean pressure, its grid and its solution.

    `seconds` is the time of the solution [s].
    """
    from gen.maps.accuracy import NODES_X, NODES_Y
    from gen.maps.answers import CONTINUUM_ERROR

    # The area's line states its error, and the line "solved on" the nodes of the grid.
    repeated = {CONTINUUM_ERROR, NODES_X, NODES_Y}
    # On a rigid far field the approach is Delta, which has a line already.
    if contact.approach == contact.delta:
        repeated.add(QUANTITIES["approach"].in_tables)
    x, y = contact.problem.spacing
    area = contact.contact_nodes * x * y  # [um2]
    mean_pressure = 0.0  # [MPa]
    if area:
        mean_pressure = contact.force / area
    lines = []
    for answer in answers:
        if answer.column not in repeated and not answer.is_detail:
            (readable,) = _in_readable_unit([answer])
            lines.append((readable.label, readable.shown, readable.unit))
    if contact.budget is not None:
        lines.append(_line_of_solved_grid(contact.budget))
    lines.append(
        ("contact pressure", f"{mean_pressure:.6g}", "MPa, mean where in contact")
    )
    lines.append(("spacing", f"{x:.6g} x {y:.6g}", "um"))
    convolutions = f"({contact.convolutions} convolutions)"
    lines.append(("iterations", f"{contact.iterations}", convolutions))
    milliseconds = f"{1e3 * seconds:.1f}"
    lines.append(("time", milliseconds, "ms, the set-up of a first solve included"))
    print_columns(lines)


def _line_of_solved_grid(budget: Budget) -> tuple[str, str, str]:
    """Return the label, the value and the unit of the line about the grid that was solved.

    `budget` is that of a contact within errors.
    """
    nx, ny = budget.nodes
    map_nx, map_ny = budget.map_nodes
    return "solved on", f"{nx} x {ny}", f"of {map_nx} x {map_ny} nodes"


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
"""Columns that the first table of `print_described_maps` has."""


def print_described_maps(rows: Sequence[Row], units: Mapping[str, str]) -> None:
    """Print a table of the main numbers of all maps, then mean and deviation of every number.

    Parameters
    ----------
    rows : sequence of Row
        One row for each map, then two rows with mean and standard deviation, from
        `gen.maps.several.summary`.
    units : mapping of str to str
        Units of the columns of numbers, by the columns' names.
    """
    main_rows = [[_title(row), *_shown_columns(row, MAIN)] for row in rows]
    print_columns(main_rows, ["surface", *MAIN], right=MAIN)
    mean = rows[-2]
    deviation = rows[-1]
    lines = [
        (name, _shown(mean[name]), _shown(deviation[name]), units[name])
        for name in mean
        if name in units
    ]
    titles = ("statistic", "mean", "standard deviation", "unit")
    print_columns(lines, titles, right={"mean", "standard deviation"})


def print_pressed_maps(rows: Sequence[Row], column: str, bodies: Bodies) -> None:
    """Print a table for each load, with a line for each map, the mean and the standard deviation.

    Parameters
    ----------
    rows : sequence of Row
        One row for each map and load, then for each load two rows with mean and standard deviation.
    column : str
        Column that holds the load in the quantity that the user gave, such as "given_delta_um".
    bodies : Bodies
        Material of both bodies, for the title of each table.
    """
    from gen.maps.accuracy import is_detail
    from gen.maps.answers import CONTINUUM_ERROR
    from gen.maps.limits import CUT_OFF, TIP_RADIUS

    hidden = {
        *COLUMNS_OF_FILES,
        "row",
        "surface",
        "prepared",
        "warnings",
        CONTINUUM_ERROR,
        column,
    }
    # Few files state the limits of their instruments.
    for name in (CUT_OFF, TIP_RADIUS):
        if all(row.get(name, "") == "" for row in rows):
            hidden.add(name)
    names = [name for name in rows[0] if name not in hidden and not is_detail(name)]
    loads = dict.fromkeys(row[column] for row in rows)  # each load once, in their order
    for load in loads:
        echo(f"{column.removeprefix('given_')} = {_shown(load)}; {bodies.text}")
        lines = [
            [_title(row), *_shown_columns(row, names)]
            for row in rows
            if row[column] == load
        ]
        print_columns(lines, ["surface", *names], right=names)


def _title(row: Row) -> str:
    """Return the title of a row of several maps: the map's name, "mean" or "standard deviation"."""
    if row["row"] == "surface":
        return str(row["surface"])
    return str(row["row"])


def _shown_columns(row: Row, names: Iterable[str]) -> list[str]:
    """Return some cells of a row, by the names of their columns, as texts for people."""
    return [_shown(row[name]) for name in names]


def _shown(value: float | int | str) -> str:
    """Return a value as text for people: five digits of a float, "-" for NaN and an empty text."""
    if isinstance(value, float) and math.isnan(value):
        return "-"
    if isinstance(value, float):
        return f"{value:.5g}"
    return str(value) or "-"
