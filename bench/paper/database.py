"""The paper's database beside ours: solve times, distributions, and Table 1."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from bench.contents import Content
from bench.files import write_table
from bench.paper.facts import AREA_MAX, LONGEST_SOLVE, RANGES
from bench.paper.texts import DIGITS, picture, table, why
from bench.picture import COLOURS, new_figure
from bench.surrogates.times import PAPER_ROWS, PAPER_SOLVE
from gen.database import Reader
from gen.runtime.errors import InputError
from gen.scene.columns import ALL_COLUMNS
from gen.schema import Column, Status, statistics_columns

# Share of rows inside the paper's range from which on only its ends differ [%].
ENOUGH_INSIDE = 99.0
UNEXPLAINED = {"bandwidth_x", "bandwidth_y"}  # columns that the paper defines otherwise
SHOWN = [column for column in ALL_COLUMNS if column.name in RANGES]  # columns of Table 1
LABELS = {"delta": "far-field displacement Δ [µm]", "area_percent": "effective contact area [%]"}


def read(path: Path) -> pd.DataFrame:
    """Read the finished rows of a database: Table 1's columns, and the times of the solves."""
    with Reader(path) as reader:
        names = ("status", *RANGES, "solve_seconds")
        rows = pd.DataFrame({name: reader.column(name) for name in names})
    done = rows[rows["status"] == Status.DONE].drop(columns="status")
    if len(done) < 2:
        raise InputError(f"{path} has {len(done)} finished rows: two at least are needed")
    return done


def solve_times(folder: Path, database: Path) -> list[Content]:
    """Draw the time of a solve against displacement and area (section 2.4)."""
    rows = read(database)
    seconds = rows["solve_seconds"]
    bins: list[tuple[Any, ...]] = []
    for name in LABELS:
        for part in np.array_split(rows[name].argsort(), min(10, len(rows))):
            values, times = rows[name].iloc[part], 1000 * seconds.iloc[part]
            told = times.agg(["mean", "median", "max"])
            bins.append((name, values.min(), values.max(), len(part), *told))
    header = ("against", "from", "to", "rows", "mean_ms", "median_ms", "longest_ms")
    data = write_table(folder / "solve-times.csv", header, bins, DIGITS)
    half = len(bins) // 2
    delta, area = (each[-1][4] / each[0][4] for each in (bins[:half], bins[half:]))
    mean, most = 1000 * seconds.mean(), 1000 * seconds.max()
    said = {"rows": len(rows), "mean": mean, "most": most, "times": 1000 * PAPER_SOLVE / mean}
    said |= {"delta": delta, "area": area, "why": why("solver")}
    drawn, points = _times_picture(rows), _points(folder, rows)
    return [picture(folder, "solve-times", drawn, data, points, **said)]


def _times_picture(rows: pd.DataFrame) -> Any:
    figure = new_figure(10.5, 4.4)
    axes = figure.subplots(1, 2, sharey=True)
    seconds = rows["solve_seconds"]
    for axis, (name, label) in zip(axes, LABELS.items(), strict=True):
        shown = axis.scatter(rows[name], seconds, s=2, c=rows["hurst"], rasterized=True)
        axis.axhline(PAPER_SOLVE, color=COLOURS[1], ls="--")
        axis.axhline(LONGEST_SOLVE, color="k", ls=":")
        axis.set(xlabel=label, yscale="log", ylim=(seconds.min() / 2, 3 * LONGEST_SOLVE))
    left = float(rows["delta"].min())
    for height, text in (
        (PAPER_SOLVE, f"the paper's mean, {PAPER_SOLVE:g} s"),
        (LONGEST_SOLVE, f"the paper's longest, about {LONGEST_SOLVE:g} s"),
    ):
        axes[0].annotate(text, (left, height), (0, -12), textcoords="offset points", fontsize=9)
    axes[0].set(ylabel="time of a solve [s]", title="(a) against the displacement")
    axes[1].set(title="(b) against the area")
    figure.colorbar(shown, ax=axes, label="Hurst exponent H")
    return figure


def _points(folder: Path, rows: pd.DataFrame) -> Path:
    """Write the points of the pictures."""
    points = rows[["delta", "area_percent", "hurst", "solve_seconds"]].itertuples()
    header = ("row", "delta_um", "area_percent", "hurst", "solve_s")
    return write_table(folder / "rows.csv", header, points, digits=5)


def distributions(folder: Path, database: Path) -> list[Content]:
    """Draw the distribution of the displacement, and area against it (section 3.2)."""
    rows = read(database)
    area = rows["area_percent"]
    figure = new_figure(10.5, 4.2)
    left, right = figure.subplots(1, 2)
    bins = np.linspace(*RANGES["delta"], 41)
    left.hist(rows["delta"], bins, color=COLOURS[0], edgecolor="w", lw=0.5)
    left.set(title="(a) displacements", xlabel=LABELS["delta"], ylabel="number of rows")
    shown = right.scatter(rows["delta"], area, s=2, c=rows["hurst"], rasterized=True)
    limit = f"largest area of the paper, {AREA_MAX:g} %"
    right.axhline(AREA_MAX, color=COLOURS[1], ls="--", lw=2, label=limit)
    right.legend(loc="upper left", fontsize=9)
    right.set(title="(b) areas", xlabel=LABELS["delta"], ylabel=LABELS["area_percent"])
    figure.colorbar(shown, ax=right, label="Hurst exponent H")
    said = {"rows": len(rows), "papers": PAPER_ROWS, "largest": area.max()}
    said |= {"below": 100 * float((area <= AREA_MAX).mean())}
    said |= {"why": why("areas", largest=AREA_MAX)}
    return [picture(folder, "database", figure, _points(folder, rows), **said)]


def table_1(folder: Path, database: Path) -> list[Content]:
    """Tabulate the ranges of all parameters, and draw their distributions."""
    rows = read(database)
    ends = ("ours_low", "ours_high", "paper_low", "paper_high", "ours_inside_percent")
    header = ("parameter", "unit", *ends, "deviation", "explanation")
    shown = rows[list(RANGES)]
    low, high = pd.DataFrame(RANGES).to_numpy()
    inside = 100 * ((shown >= low) & (shown <= high)).mean()
    ranges = [_range(column, rows[column.name], inside[column.name]) for column in SHOWN]
    data = write_table(folder / "table-1.csv", header, ranges, DIGITS)
    outside = [each.long_name for each in SHOWN if inside[each.name] < ENOUGH_INSIDE]
    return [
        table(data, outside=", ".join(outside) or "none"),
        picture(folder, "statistics", _histograms(rows), data),
    ]


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
    return column.long_name, column.unit, *ours, low, high, f"{inside:.1f}", shifts, reason


def _histograms(rows: pd.DataFrame) -> Any:
    """Draw every parameter of Table 1 with the paper's range."""
    figure = new_figure(11, 10.5)
    axes = figure.subplots(-(-len(SHOWN) // 5), 5).ravel()
    statistics = {column.name for column in statistics_columns()}
    for axis, column in zip(axes, SHOWN, strict=False):
        values, (low, high) = rows[column.name], RANGES[column.name]
        spaced = np.geomspace if column.name in UNEXPLAINED else np.linspace
        axis.set_xscale("log" if column.name in UNEXPLAINED else "linear")
        bins = spaced(min(low, values.min()), max(high, values.max()), 31)
        axis.hist(values, bins, color=COLOURS[0 if column.name in statistics else 2])
        for end in (low, high):
            axis.axvline(end, color=COLOURS[1], ls="--", lw=1.5)
        unit = {"1": "", "um": " [µm]", "um-1": " [1/µm]"}.get(column.unit, f" [{column.unit}]")
        name = column.name.replace("_percent", "").replace("_", " ")
        axis.set_title(name.replace(" curvature", "\ncurvature", 1) + unit, fontsize=9)
        axis.set_yticks([])
        axis.tick_params(labelsize=8)
    for axis in axes[len(SHOWN) :]:
        axis.set_axis_off()
    return figure
