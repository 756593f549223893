"""The paper's database beside ours: solve times, distributions, Table 1, and a finer grid.

Section 4.3 and Table 5 train kernel ridge on the coarse grid, and test it on the finer one.
"""

from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from bench.files import Row
from bench.paper.facts import AREA_MAX, FINE, FINE_ROWS, RANGES, few, ratio, rows_of, why
from bench.picture import COLOURS, new_figure
from bench.report import Report
from bench.surrogates.fitting import fit, parted, read, request_for
from gen.arrays import Values
from gen.database import Reader
from gen.quantities import AREA, DELTA
from gen.runtime.errors import InputError
from gen.runtime.figure import draw_parity, parity_axes
from gen.scene import ALL_COLUMNS
from gen.schema import Column, Status
from learn.database_rows import Dataset
from learn.features import OF_SURFACES
from learn.metrics import Scores, scores

UNEXPLAINED = {"bandwidth_x", "bandwidth_y"}  # columns that the paper defines otherwise
SHOWN = [column for column in ALL_COLUMNS if column.name in RANGES]  # columns of Table 1


def finished(path: Path) -> pd.DataFrame:
    """Read the finished rows of a database: Table 1's columns, and the times of the solves."""
    with Reader(path) as reader:
        names = ("status", *RANGES, "solve_seconds")
        rows = pd.DataFrame({name: reader.column(name) for name in names})
    done = rows[rows["status"] == Status.DONE].drop(columns="status")
    if len(done) < 2:
        raise InputError(f"{path} has {len(done)} finished rows: two at least are needed")
    return done


def solve_times(database: Path) -> Report:
    """Tabulate the time of a solve against displacement and area (section 2.4), and all rows."""
    rows = finished(database)
    bins: list[tuple[Any, ...]] = []
    for name in (DELTA.name, AREA.name):
        for part in np.array_split(rows[name].argsort(), min(10, len(rows))):
            values, times = rows[name].iloc[part], 1000 * rows["solve_seconds"].iloc[part]
            told = times.agg(["mean", "median", "max"])
            bins.append((name, values.min(), values.max(), len(part), *told))
    header = ("against", "from", "to", "rows", "mean_ms", "median_ms", "longest_ms")
    points = rows[[DELTA.name, AREA.name, "hurst", "solve_seconds"]].itertuples()
    names = ("row", DELTA.in_tables, AREA.name, "hurst", "solve_s")
    dots = rows_of(names, ([row, *few(values)] for row, *values in points))
    return Report({"solve-times": rows_of(header, bins), "rows": dots})


def table_1(database: Path) -> Report:
    """Tabulate the ranges of all parameters."""
    rows = finished(database)
    ends = ("ours_low", "ours_high", "paper_low", "paper_high", "ours_inside_percent")
    header = ("parameter", "unit", *ends, "deviation", "explanation")
    shown = rows[list(RANGES)]
    low, high = pd.DataFrame(RANGES).to_numpy()
    inside = 100 * ((shown >= low) & (shown <= high)).mean()
    ranges = [_range(column, rows[column.name], inside[column.name]) for column in SHOWN]
    return Report({"table-1": rows_of(header, ranges)})


def _range(column: Column, values: pd.Series, inside: float) -> tuple[object, ...]:
    """Return a row of Table 1, which says why its ends differ."""
    (low, high), ours = RANGES[column.name], (values.min(), values.max())
    reason = {
        **dict.fromkeys(UNEXPLAINED, why("bandwidth")),
        **dict.fromkeys(("hurst", "delta"), ""),
        "area_percent": why("areas", largest=AREA_MAX),
    }.get(column.name, why("extremes"))
    apart = (ours[0] - low, ours[1] - high)
    shifts = ", ".join(f"{100 * each / (high - low):+.1f} %" for each in apart)
    return (
        column.long_name,
        column.unit,
        *ours,
        low,
        high,
        f"{inside:.1f}",
        shifts,
        reason,
    )


MODEL = "kernel-ridge"
CURVATURE = "peak_curvature_mean"
FINE_SCENE = (
    "[surface]\nnodes = 257\n"  # the finer grid, where no database of it is given
)


class Judged(NamedTuple):
    """A surrogate of the coarse grid on rows of the fine one: predicted areas [%]."""

    rows: Dataset
    prediction: Values
    scores: Scores


def fine_grid(database: Path, fine: Path) -> Report:
    """Train with each feature set on the preset's grid, test on the finer one."""
    found = {name: _judge(database, fine, name) for name in OF_SURFACES}
    first = found["paper"].rows
    pairs = zip(first.target, *(e.prediction for e in found.values()), strict=True)
    dots = [
        [row, *few(pair)] for row, pair in zip(first.rows.tolist(), pairs, strict=True)
    ]
    tables = {
        "table-5": _table_5(found, database),
        "fine-grid": rows_of(("row", "solved_percent", *found), dots),
    }
    return Report(tables, {"fine-grid": _fine_picture(found)})


def tests_of(rows: int) -> int:
    """Return the rows of the finer grid that test a database; the paper has 800 for 15,878."""
    return min(FINE_ROWS, max(40, rows // 5))


def _judge(database: Path, fine: Path, features: str) -> Judged:
    """Fit as `learn fit` does on the coarse grid, and test on the fine one."""
    request = request_for(database, MODEL, features, AREA_MAX)
    parts = parted(read(request))
    fitted = fit(request, parts.train, parts.folds)
    rows = read(request_for(fine, MODEL, features, AREA_MAX))
    found = fitted.predict(rows)
    return Judged(rows, found, scores(rows.target, found))


def _table_5(found: dict[str, Judged], database: Path) -> list[Row]:
    """Return Table 5, a column for each feature set, and why the statistics do not carry over.

    The reason is how the mean curvature of peaks changes.
    """
    fine = found["paper"].rows
    with Reader(database) as reader, Reader(Path(fine.name)) as other:
        coarse, own = reader.column(CURVATURE), other.column(CURVATURE)[fine.rows]
    growth, beyond = (
        np.median(own) / np.nanmedian(coarse),
        100 * (own > np.nanmax(coarse)).mean(),
    )
    reason = why("fine", growth=float(growth), beyond=float(beyond))
    rows: list[tuple[object, ...]] = []
    for name, theirs in asdict(FINE).items():
        ours = {features: getattr(each.scores, name) for features, each in found.items()}
        mine = ours["paper"]
        apart = f"{mine - theirs:+.2f}" if name == "r2" else ratio(mine, theirs)
        rows.append((name, *ours.values(), theirs, apart, reason))
    names = (*(f"ours_{name}" for name in found), "paper", "deviation", "explanation")
    return rows_of(("score_percent", *names), rows)


def _fine_picture(found: dict[str, Judged]) -> Any:
    """Draw predictions over truth with each feature set."""
    figure = new_figure(12, 4)
    for axis, (name, each) in zip(
        figure.subplots(1, len(found)), found.items(), strict=True
    ):
        parity_axes(axis, each.rows.target)
        look: dict[str, Any] = {"marker": ".", "ms": 3, "ls": "none", "color": COLOURS[0]}
        draw_parity(axis, each.rows.target, each.prediction, **look)
        beside = f" (the paper's {FINE.r2:.2f} %)" if name == "paper" else ""
        axis.set_title(f"{name} features: R² {each.scores.r2:.2f} %{beside}", fontsize=10)
        axis.set(xlabel="solved area [%]", ylabel="predicted area [%]")
    return figure
