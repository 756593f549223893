"""The files: the table, the picture, and how and where they were made."""

import csv
import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, astuple, fields
from pathlib import Path
from typing import Any

from bench.circumstances import circumstances
from bench.picture import new_figure, save
from bench.table import write_table
from bench.work_precision.measurement import AREA_GATE, FORCE_GATE, PRESSURE_GATE, Point
from bench.work_precision.picture import draw
from bench.work_precision.studies import FULL, Extent, Sweep, sweep
from gen.runtime.errors import InputError
from gen.runtime.output import check_folder, write

UNITS = {"delta": "um"}
"""Units of the columns whose names do not say them."""

PARSERS: dict[Any, Callable[[str], Any]] = {
    str: str,
    int: int,
    float: float,
    int | None: lambda text: int(text) if text else None,
    float | None: lambda text: float(text) if text else None,
}
"""How a column's text is read, by the type of the point's attribute."""


def write_report(
    folder: Path, extent: Extent = FULL, announce: Callable[[str], None] = lambda line: None
) -> list[Path]:
    """Measure, and write `solver.csv`, `solver.json` and `solver.png`.

    Parameters
    ----------
    folder : where to; made if there is none
    extent : how much to measure
    announce : told what is being measured, and what was left out and why

    Returns
    -------
    The three files

    Raises
    ------
    InputError
        If the folder cannot be written to, or matplotlib is not installed
    """
    figure = new_figure()
    paths = [folder / f"solver.{ending}" for ending in ("csv", "json", "png")]
    table, record, picture = paths
    check_folder(folder, *(path.name for path in paths))
    done = sweep(extent, announce)
    write_points(table, done.points)
    write(record, json.dumps(_record(extent, done), indent=2, ensure_ascii=False) + "\n")
    draw(figure, done.points)
    save(figure, picture)
    for missing in done.left_out:
        announce(f"{missing.study}: left out {missing.solver}: {missing.reason}")
    return paths


def header() -> list[str]:
    """Names of the columns: those of `Point`, with the unit where the name does not say it."""
    return [
        f"{field.name}_{UNITS[field.name]}" if field.name in UNITS else field.name
        for field in fields(Point)
    ]


def write_points(path: Path, points: Iterable[Point]) -> None:
    """One row a point; a number is written with all its digits, None as nothing."""
    write_table(path, header(), map(astuple, points))


def read_points(path: Path) -> list[Point]:
    """What `write_points` wrote."""
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.reader(file))
    if not rows or rows[0] != header():
        raise InputError(f"{path}: is not a table of work against precision")
    return [_point(row) for row in rows[1:]]


def _point(row: Sequence[str]) -> Point:
    values = {
        field.name: PARSERS[field.type](text)
        for field, text in zip(fields(Point), row, strict=True)
    }
    return Point(**values)


def _record(extent: Extent, done: Sweep) -> dict[str, Any]:
    """Where, when and with what the points were measured, and what is not among them."""
    return {
        **circumstances(),
        "extent": asdict(extent),
        "gates": {"force": FORCE_GATE, "pressure": PRESSURE_GATE, "contact_nodes": AREA_GATE},
        "left_out": [asdict(missing) for missing in done.left_out],
    }
