"""Print databases, and the work and time of a scene's run."""

from __future__ import annotations

import json
import signal
from typing import TYPE_CHECKING, Any

import numpy as np

from gen.runtime.memory import size
from gen.runtime.terminal import echo, print_columns, to_type
from gen.schema import PHYSICS_CHANGES, REASONS, RUNTIME, Status, made_by_another

if TYPE_CHECKING:
    from pathlib import Path

    from gen.database import Reader
    from gen.generation.run import Estimate, RunResult
    from gen.scene import Scene

MAPS = {"found": "map", "against_found": "the second body's map"}
"""Keys of a scene's surfaces whose maps are shown in lines of their own, and words for a map."""


def print_result(path: Path, result: RunResult) -> None:
    """Say how a run ended, and how to continue it."""
    pending, done, failed = result.counts
    echo(f"{path}: {done} rows done, {failed} failed, {pending} pending")
    if failed:
        echo(f"warning: {failed} rows failed; why: {to_type(f'gen info {path}')}")
    if result.overdue:
        echo(
            f"warning: {result.overdue} rows took longer than --sample-limit and are pending; the"
            " same command with a larger one, or without, goes on with them"
        )
    if pending and result.signal:
        name = signal.Signals(result.signal).name
        echo(f"stopped by {name}; the same command goes on with the rows that are pending")


def print_database(reader: Reader) -> None:
    """Print a summary of a database: rows, times, scene, versions, ranges of all columns."""
    counts = reader.counts()
    attributes = reader.attributes
    echo(f"{reader.path}: {attributes['title']}")
    part = ""
    if len(reader.rows) < reader.scene.samples:
        part = f": {reader.rows.start} to {reader.rows.stop - 1} of {reader.scene.samples}, a part"
    echo(f"  size      {size(reader.size_bytes)}, {sum(counts)} rows{part}")
    echo(f"  rows      {counts.done} done, {counts.failed} failed, {counts.pending} pending")
    for status in (Status.DONE, Status.FAILED):
        for code, number in reader.reasons(status).items():
            reason = REASONS.get(code, f"reason {code}")
            echo(f"            {number} {status.name.lower()}: {reason}")
    echo(f"  times     {_times(reader)}")
    for line in _scene_lines(json.loads(reader.scene.text())):
        echo(f"  scene     {line}")
    versions = json.loads(str(attributes["versions"]))
    echo("  versions  " + ", ".join(f"{name} {value}" for name, value in versions.items()))
    echo(
        f"  made      {attributes['created']}, commit {attributes['git_commit'] or 'unknown'},"
        f" layout {attributes['schema']}, physics {attributes['physics']}"
    )
    for line in _changes_since(int(attributes["physics"])):
        echo(f"            {line}")
    if counts.done:
        _print_ranges(reader)


def print_plan(scene: Scene, path: Path | None = None) -> None:
    """Print samples, surfaces, nodes and loads of a completed scene, and its database's size."""
    from gen.generation.run import planned_loads
    from gen.scene import row_bytes

    contact, (nx, ny) = scene.contact, scene.shape
    low, mean, high = planned_loads(scene)
    echo(
        f"{scene.samples} samples on {scene.surfaces} surfaces of {nx} x {ny} nodes"
        f"{f', {contact.boundary} boundary' if scene.edgeless else ''}"
        f"{'' if scene.surface.against is None else ', each against another rough one'}"
    )
    name = "Delta" if scene.quantity == "delta" else scene.quantity
    measure = "" if scene.load_unit == "1" else f" {scene.load_unit}"
    echo(f"  {name:<9} {low:.4g} to {high:.4g}{measure}, {mean:.4g}{measure} on average")
    if contact.hardness_limits is not None:
        least, most = contact.hardness_limits
        drawn = "" if least == most else f" to {most:.4g}"
        echo(f"  hardness  {least:.4g}{drawn} MPa")
    for doubt in contact.doubts:
        echo(f"  warning: {doubt}")
    echo(f"  file      {size(scene.samples * row_bytes(scene))}")
    if path is not None:
        state = "exists" if path.exists() else "does not exist yet"
        echo(f"  output    {path} {state}; nothing was written")


def print_estimate(scene: Scene, estimate: Estimate) -> None:
    """Print the time and the memory that a run of a completed scene is going to need."""
    print_plan(scene)
    hours, rest = divmod(round(estimate.seconds), 3600)
    echo(
        f"  time      {hours}:{rest // 60:02}:{rest % 60:02} h on {estimate.workers} workers:"
        f" {estimate.milliseconds:.2f} ms a sample, mean of {estimate.measured} measured here"
    )
    echo(f"  memory    {size(estimate.memory_bytes)} on all ranks")


def _scene_lines(scene: dict[str, Any]) -> list[str]:
    """Return the lines that show a scene: single keys, tables, and each map of its surfaces."""
    tables = {name: value for name, value in scene.items() if isinstance(value, dict)}
    single = {name: value for name, value in scene.items() if name not in {"title", *tables}}
    lines = [_settings(single)]
    for table, keys in tables.items():
        shown = {name: value for name, value in keys.items() if name not in MAPS}
        lines.append(f"[{table}] {_settings(shown)}")
        for name in (each for each in MAPS if each in keys):
            for number, found in enumerate(keys[name]["maps"]):
                nx, ny = found["nodes"]
                known = f"{nx} x {ny} nodes, SHA-256 {found['sha256'][:12]}..., {found['file']}"
                lines.append(f"  {MAPS[name]} {number}: {known}")
    return lines


def _settings(keys: dict[str, Any]) -> str:
    """Return keys and their values on one line."""
    return ", ".join(f"{name} = {json.dumps(value)}" for name, value in keys.items())


def _changes_since(physics: int) -> list[str]:
    """Say that another solver made a database, and in one line each what has changed since."""
    changes = [f"since physics {n}, {said}" for n, said in PHYSICS_CHANGES.items() if n > physics]
    another = made_by_another(physics)
    return [another, *changes] if another else []


def _times(reader: Reader) -> str:
    """Return the times of the done rows in words."""
    done = reader.column("status") == Status.DONE
    if not done.any():
        return "no row is done"
    solve = 1e3 * reader.column("solve_seconds")[done]
    surface = 1e3 * reader.column("surface_seconds")[done]
    return (
        f"solve {solve.mean():.2f} ms on average, {np.median(solve):.2f} median,"
        f" {solve.max():.2f} at most; surface and statistics {surface.mean():.2f} ms"
    )


def _print_ranges(reader: Reader) -> None:
    """Print the range of every column over the done rows."""
    ranges = reader.ranges()
    rows = (
        (column.name, column.unit, *(f"{limit:.6g}" for limit in ranges[column.name]))
        for column in reader.columns()
        if column.name in ranges and column.group != RUNTIME
    )
    print_columns(rows, ("column", "unit", "from", "to"), right=("from", "to"))
