"""The printer of the commands: databases, runs, surfaces with their statistics, and contacts."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any

import numpy as np

from gen.quantities import QUANTITIES
from gen.runtime.memory import format_bytes
from gen.runtime.terminal import echo, print_columns
from gen.schema import PHYSICS_CHANGES, REASONS, RUNTIME, TABLE_1, Status, made_by_another

if TYPE_CHECKING:  # each command imports no more than it needs
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from bem import Contact
    from gen.database import Reader
    from gen.maps.contacts import Answer
    from gen.maps.read import Topography
    from gen.maps.texture import ProfileRoughness, SelfAffineFit
    from gen.material import Bodies
    from gen.runtime.documents import Row
    from gen.scene import Scene
    from gen.statistics import Description

MAPS = {"found": "map", "against_found": "the second body's map"}
"""Keys of a scene's surfaces whose maps are shown in lines of their own, and words for a map."""


def print_database(reader: Reader) -> None:
    """Print a summary of a database: rows, times, scene, versions, ranges of all columns."""
    from gen.generation.trial import doubts_after

    counts = reader.counts()
    attributes = reader.attributes
    echo(f"{reader.path}: {attributes['title']}")
    part = ""
    if len(reader.rows) < reader.scene.samples:
        part = f": {reader.rows.start} to {reader.rows.stop - 1} of {reader.scene.samples}, a part"
    echo(
        f"  size      {format_bytes(reader.path.stat().st_size)}, {sum(counts)} rows{part}"
    )
    echo(
        f"  rows      {counts.done} done, {counts.failed} failed, {counts.pending} pending"
    )
    for status in (Status.DONE, Status.FAILED):
        for code, number in reader.reasons(status).items():
            reason = REASONS.get(code, f"reason {code}")
            echo(f"            {number} {status.name.lower()}: {reason}")
    if damage := reader.damage():
        echo(f"  warning   {damage}")
    if counts.done:
        _print_times(reader)
    for doubt in doubts_after(reader):
        echo(f"  warning: {doubt}")
    for line in _scene_lines(json.loads(reader.scene.text())):
        echo(f"  scene     {line}")
    versions = json.loads(str(attributes["versions"]))
    echo(
        "  versions  " + ", ".join(f"{name} {value}" for name, value in versions.items())
    )
    echo(
        f"  made      {attributes['created']}, commit {attributes['git_commit'] or 'unknown'},"
        f" layout {attributes['schema']}, physics {attributes['physics']}"
    )
    _print_changes(int(attributes["physics"]))
    if counts.done:
        _print_ranges(reader)


def _print_changes(physics: int) -> None:
    """Print what has changed since results of a physics number, if it is not today's."""
    changes = (
        f"since physics {n}, {said}" for n, said in PHYSICS_CHANGES.items() if n > physics
    )
    if another := made_by_another(physics):
        for line in (another, *changes):
            echo(f"            {line}")


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
    rows = (
        (column.name, column.unit, *(f"{limit:.6g}" for limit in ranges[column.name]))
        for column in reader.columns()
        if column.name in ranges and column.group != RUNTIME
    )
    print_columns(rows, ("column", "unit", "from", "to"), right=("from", "to"))


def print_plan(scene: Scene, path: Path | None = None) -> None:
    """Print samples, surfaces, nodes and loads of a completed scene, and its database's size."""
    from gen.database import file_bytes
    from gen.generation.forecast import planned_loads
    from gen.generation.trial import doubts_before

    contact, (nx, ny) = scene.contact, scene.grid.shape
    low, mean, high = planned_loads(scene)
    echo(
        f"{scene.samples} samples on {scene.surfaces} surfaces of {nx} x {ny} nodes"
        f"{'' if contact.boundary == 'free' else f', {contact.boundary} boundary'}"
        f"{'' if scene.surface.against is None else ', each against another rough one'}"
    )
    name = "Delta" if scene.quantity == "delta" else scene.quantity
    measure = "" if scene.load_unit == "1" else f" {scene.load_unit}"
    echo(f"  {name:<9} {low:.4g} to {high:.4g}{measure}, {mean:.4g}{measure} on average")
    if contact.hardness_limits is not None:
        least, most = contact.hardness_limits
        drawn = "" if least == most else f" to {most:.4g}"
        echo(f"  hardness  {least:.4g}{drawn} MPa")
    for doubt in doubts_before(scene, scene.samples):
        echo(f"  warning: {doubt}")
    echo(f"  file      {format_bytes(file_bytes(scene, scene.samples))}")
    if path is not None:
        state = "exists" if path.exists() else "does not exist yet"
        echo(f"  output    {path} {state}; nothing was written")


def _scene_lines(scene: dict[str, Any]) -> list[str]:
    """Return the lines that show a scene: single keys, tables, and each map of its surfaces."""
    tables = {"": {name: each for name, each in scene.items() if name != "title"}}
    tables |= {name: each for name, each in scene.items() if isinstance(each, dict)}
    lines = []
    for table, keys in tables.items():
        shown = (
            f"{name} = {json.dumps(value)}"
            for name, value in keys.items()
            if name not in MAPS and (table or name not in tables)
        )
        lines.append(f"{f'[{table}] ' if table else ''}{', '.join(shown)}")
        for name in (each for each in MAPS if each in keys):
            for number, found in enumerate(keys[name]["maps"]):
                nx, ny = found["nodes"]
                known = f"{nx} x {ny} nodes, SHA-256 {found['sha256'][:12]}..., {found['file']}"
                lines.append(f"  {MAPS[name]} {number}: {known}")
    return lines


def print_preparation(topography: Topography, warnings: list[str]) -> None:
    """Print the steps from a file to a surface, and the warnings about it on standard error."""
    for step in topography.steps:
        echo(f"{topography.name}: {step}")
    for warning in warnings:
        echo(f"warning: {warning}", err=True)


def tell_preparation(topography: Topography, warnings: Sequence[str]) -> None:
    """Print the steps of one of several maps, and the warnings about it, on standard error."""
    echo(f"{topography.name}: {'; '.join(topography.steps)}", err=True)
    for warning in warnings:
        echo(f"  warning: {warning}", err=True)


def print_statistics(
    topography: Topography, found: Description, areal: Description
) -> None:
    """Print the 22 statistics of a surface and its areal parameters, and its tilt unless level."""
    from gen.maps.prepare import least_squares
    from gen.maps.texture import PARAMETERS

    heights, spacing = topography.heights, topography.spacing
    said = (
        f"{heights.shape[0]} x {heights.shape[1]} nodes, spacing {spacing[0]:.6g} x"
        f" {spacing[1]:.6g} um, heights {heights.min():.6g} to {heights.max():.6g} um"
    )
    if not topography.followed & {"level plane", "level quadratic", "form"}:
        tilt = least_squares(topography).tilt
        said += f", tilt {tilt.x:.4g} along x, {tilt.y:.4g} along y"
    echo(said)
    own = [(each.name, each.unit, each.long_name) for each in TABLE_1]
    for title, known, names in (
        ("statistic", found, own),
        ("ISO 25178", areal, [each for each in PARAMETERS if each[0] in areal.values]),
    ):
        rows = (
            (name, f"{known.values[name]:.6g}", unit, words)
            for name, unit, words in names
        )
        print_columns(rows, (title, "value", "unit", "meaning"), right={"value"})
        if known.reason:
            echo(f"Where nan stands: {known.reason}")


def print_profiles(profiles: tuple[ProfileRoughness, ProfileRoughness]) -> None:
    """Print the roughness of the profiles along x and along y of a directional surface."""
    rows = [
        (f"along {axis}", *(f"{value:.6g}" for value in numbers))
        for axis, each in zip("xy", profiles, strict=True)
        for numbers in [(each.rms_height, each.rms_slope, each.wavelength)]
    ]
    titles = ("profiles", "Rq um", "Rdq", "mean wavelength um")
    print_columns(rows, titles, right=set(titles[1:]))
    echo("Their power spectra: --spectrum FILE writes them, --plot FILE draws them")


def print_spectrum(fit: SelfAffineFit | str, nodes: float) -> None:
    """Print the self-affine law of a surface, or why there is none, and its shortest wave."""
    from gen.maps.texture import WELL_RESOLVED

    if isinstance(fit, str):
        echo(f"self-affine law: none, {fit}")
    else:
        law = fit.spectrum
        remarks = "".join(f"; {remark}" for remark in fit.remarks)
        echo(
            f"self-affine law over {fit.decades:.2g} decades, from {law.roll_off:.4g} to"
            f" {law.cut_off:.4g} um, the spectrum within a factor of {fit.scatter:.3g}{remarks}; as"
            " a start for the generator spectral:"
        )
        print_columns(
            (name, f"{value:.6g}", unit, meaning)
            for name, value, unit, meaning in (
                ("hurst", law.hurst, "1", "Hurst exponent"),
                ("roll_off", law.roll_off, "um", "longest wavelength of the power law"),
                ("cut_off", law.cut_off, "um", "shortest wavelength"),
                ("rms_height", fit.rms_height, "um", "root mean square height"),
            )
        )
        echo(
            "That is the exponent of the spectrum, which spectral gives if it is asked for it;"
            " diamond-square and midpoint give it if they are asked for 0.07 to 0.16 more"
        )
    if not math.isnan(nodes):
        said = "nodes: areas of contact are those of the grid, see gen contact"
        if nodes >= WELL_RESOLVED:
            said = "nodes: enough for the area of contact in the continuum to 1 %"
        print_columns([("shortest wave", f"{nodes:.2g}", said)])


ONE_ONLY = {
    *(quantity.in_tables for quantity in QUANTITIES.values() if quantity.single),
    "modulus_MPa",
    "boundary",
    "hardness_MPa",
    "residual",
}
"""Columns that a table of several loads has in its file alone."""


def print_contacts(
    rows: Sequence[Sequence[Answer]], contact: Contact, seconds: float
) -> None:
    """Print one contact in full, with the time that it took [s]; several with a line for each."""
    if len(rows) > 1:
        kept = [[each for each in row if each.column not in ONE_ONLY] for row in rows]
        titles = [each.column for each in kept[0]]
        print_columns(
            [[each.shown for each in row] for row in kept], titles, right=titles
        )
        return
    from gen.maps.contacts import CONTINUUM_ERROR

    [row] = rows
    left_out = {CONTINUUM_ERROR}  # it stands with the area
    left_out |= (
        {QUANTITIES["approach"].in_tables} if contact.approach == contact.delta else set()
    )  # rigid far field
    row = [each for each in row if each.column not in left_out]
    x, y = contact.problem.spacing
    mean = contact.force / (contact.contact_nodes * x * y or 1)
    print_columns(
        [
            *((each.label, each.shown, each.unit) for each in row),
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
"""Columns that `print_looks` shows of each map."""


def print_looks(rows: Sequence[Row], units: Mapping[str, str]) -> None:
    """Print a row for each map with the main numbers, then mean and deviation of all numbers.

    `rows` are those of the maps and of `gen.maps.several.summary`, `units` those of the columns.
    """
    titles = ["surface", *MAIN]
    print_columns(
        [[_title(row), *(_shown(row[name]) for name in MAIN)] for row in rows],
        titles,
        right=MAIN,
    )
    mean, deviation = rows[-2:]
    lines = [
        (name, _shown(mean[name]), _shown(deviation[name]), units[name])
        for name in mean
        if name in units
    ]
    titles = ["statistic", "mean", "standard deviation", "unit"]
    print_columns(lines, titles, right={"mean", "standard deviation"})


def print_pressed_maps(rows: Sequence[Row], column: str, bodies: Bodies) -> None:
    """Print a table of all maps for each load, which is in a column, with mean and deviation."""
    hidden = ONE_ONLY | {"row", "surface", "prepared", "warnings", column}
    hidden |= {"continuum_area_error_percent"}
    names = [name for name in rows[0] if name not in hidden]
    for value in dict.fromkeys(row[column] for row in rows):
        same = [row for row in rows if row[column] == value]
        echo(f"{column.removeprefix('given_')} = {_shown(value)}; {bodies.text}")
        lines = [[_title(row), *(_shown(row[name]) for name in names)] for row in same]
        print_columns(lines, ["surface", *names], right=names)


def _title(row: Row) -> str:
    """Return the name of a map, or "mean" and the like."""
    return str(row["surface"] if row["row"] == "surface" else row["row"])


def _shown(value: float | int | str) -> str:
    """Return a cell for people: few digits, and - where there is no number."""
    if isinstance(value, float):
        return "-" if math.isnan(value) else f"{value:.5g}"
    return str(value) or "-"
