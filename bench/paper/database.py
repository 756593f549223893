"""The paper's database beside ours: solve times, distributions, Table 1, and a finer grid.

Section 4.3 and Table 5 train kernel ridge on the coarse grid, and test it on the finer one.
"""

from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from bench.files import Row
from bench.paper.facts import (
    AREA_MAX,
    FINE,
    FINE_ROWS,
    LONGEST_SOLVE,
    RANGES,
    few,
    ratio,
    rows_of,
    why,
)
from bench.picture import COLOURS, new_figure
from bench.report import Report
from bench.surrogates.cost import PAPER_SOLVE
from bench.surrogates.fitting import fit, parted, read, request_for
from gen.arrays import Values
from gen.database import Reader
from gen.runtime.errors import InputError
from gen.runtime.figure import draw_parity, parity_axes
from gen.scene import ALL_COLUMNS, differences, load
from gen.schema import TABLE_1, Column, Status
from learn.dataset import Dataset
from learn.features import OF_SURFACES
from learn.metrics import Scores, scores

# Share of rows inside the paper's range from which on only its ends differ [%].
ENOUGH_INSIDE = 99.0
UNEXPLAINED = {"bandwidth_x", "bandwidth_y"}  # columns that the paper defines otherwise
SHOWN = [column for column in ALL_COLUMNS if column.name in RANGES]  # columns of Table 1
LABELS = {"delta": "far-field displacement Δ [µm]", "area_percent": "effective contact area [%]"}


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
    """Draw the time of a solve against displacement and area (section 2.4)."""
    rows = finished(database)
    seconds = rows["solve_seconds"]
    bins: list[tuple[Any, ...]] = []
    for name in LABELS:
        for part in np.array_split(rows[name].argsort(), min(10, len(rows))):
            values, times = rows[name].iloc[part], 1000 * seconds.iloc[part]
            told = times.agg(["mean", "median", "max"])
            bins.append((name, values.min(), values.max(), len(part), *told))
    header = ("against", "from", "to", "rows", "mean_ms", "median_ms", "longest_ms")
    points = rows[["delta", "area_percent", "hurst", "solve_seconds"]].itertuples()
    names = ("row", "delta_um", "area_percent", "hurst", "solve_s")
    dots = rows_of(names, ([row, *few(values)] for row, *values in points))
    tables = {"solve-times": rows_of(header, bins), "rows": dots}
    return Report(tables, {"solve-times": _times_picture(rows)})


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


def distributions(database: Path) -> Report:
    """Draw the distribution of the displacement, and area against it (section 3.2)."""
    rows = finished(database)
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
    return Report({}, {"database": figure})


def table_1(database: Path) -> Report:
    """Tabulate the ranges of all parameters, and draw their distributions."""
    rows = finished(database)
    ends = ("ours_low", "ours_high", "paper_low", "paper_high", "ours_inside_percent")
    header = ("parameter", "unit", *ends, "deviation", "explanation")
    shown = rows[list(RANGES)]
    low, high = pd.DataFrame(RANGES).to_numpy()
    inside = 100 * ((shown >= low) & (shown <= high)).mean()
    ranges = [_range(column, rows[column.name], inside[column.name]) for column in SHOWN]
    return Report({"table-1": rows_of(header, ranges)}, {"statistics": _histograms(rows)})


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
    statistics = {column.name for column in TABLE_1}
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


MODEL = "kernel-ridge"
CURVATURE = "peak_curvature_mean"
FINE_SCENE = "[surface]\nnodes = 257\n"  # the finer grid, where no database of it is given

PRESET = load("paper")


class Judged(NamedTuple):
    """A surrogate of the coarse grid on rows of the fine one: predicted areas [%]."""

    rows: Dataset
    prediction: Values
    scores: Scores


def fine_grid(database: Path, fine: Path) -> Report:
    """Train with each feature set on the preset's grid, test on the finer one."""
    check(fine)
    found = {name: _judge(database, fine, name) for name in OF_SURFACES}
    first = found["paper"].rows
    pairs = zip(first.target, *(e.prediction for e in found.values()), strict=True)
    dots = [[row, *few(pair)] for row, pair in zip(first.rows.tolist(), pairs, strict=True)]
    tables = {
        "table-5": _table_5(found, _curvature(database, first)),
        "fine-grid": rows_of(("row", "solved_percent", *found), dots),
    }
    return Report(tables, {"fine-grid": _fine_picture(found)})


def tests_of(rows: int) -> int:
    """Return the rows of the finer grid that test a database; the paper has 800 for 15,878."""
    return min(FINE_ROWS, max(40, rows // 5))


def check(fine: Path) -> None:
    """Refuse all databases but the paper preset's on a finer grid."""
    with Reader(fine) as reader:
        scene = reader.scene
    nodes, coarse = scene.shape[0], PRESET.shape[0]
    if nodes <= coarse:
        raise InputError(
            f"--fine {fine}: has {nodes} nodes a side, give one with more than {coarse}:"
            " python -m gen run fine -o fine.h5"
        )
    alike = {"surface": scene.surface.model_copy(update={"nodes": coarse}), "store": PRESET.store}
    different = differences(scene.model_copy(update=alike), PRESET)
    if any(not line.startswith("seed") for line in different):
        raise InputError(
            f"--fine {fine}: give one of the paper preset with another grid ({different[0]})"
        )


def _judge(database: Path, fine: Path, features: str) -> Judged:
    """Fit as `learn fit` does on the coarse grid, and test on the fine one."""
    request = request_for(database, MODEL, features, AREA_MAX)
    parts = parted(read(request))
    fitted = fit(request, parts.train, parts.folds)
    rows = read(request_for(fine, MODEL, features, AREA_MAX))
    found = fitted.predict(rows)
    return Judged(rows, found, scores(rows.target, found))


def _curvature(database: Path, fine: Dataset) -> str:
    """Say why the statistics do not carry over: how the mean curvature of peaks changes."""
    with Reader(database) as reader, Reader(Path(fine.name)) as other:
        coarse, own = reader.column(CURVATURE), other.column(CURVATURE)[fine.rows]
    growth = float(np.median(own) / np.nanmedian(coarse))
    return why("fine", growth=growth, beyond=100 * float((own > np.nanmax(coarse)).mean()))


def _table_5(found: dict[str, Judged], curvature: str) -> list[Row]:
    """Return Table 5, a column for each feature set."""
    rows: list[tuple[object, ...]] = []
    for name, theirs in asdict(FINE).items():
        ours = {features: getattr(each.scores, name) for features, each in found.items()}
        mine = ours["paper"]
        apart = f"{mine - theirs:+.2f}" if name == "r2" else ratio(mine, theirs)
        rows.append((name, *ours.values(), theirs, apart, curvature))
    header = ("score_percent", *(f"ours_{name}" for name in found))
    names = (*header, "paper", "deviation", "explanation")
    return rows_of(names, rows)


def _fine_picture(found: dict[str, Judged]) -> Any:
    """Draw predictions over truth with each feature set."""
    figure = new_figure(12, 4)
    for axis, (name, each) in zip(figure.subplots(1, len(found)), found.items(), strict=True):
        parity_axes(axis, each.rows.target)
        look: dict[str, Any] = {"marker": ".", "ms": 3, "ls": "none", "color": COLOURS[0]}
        draw_parity(axis, each.rows.target, each.prediction, **look)
        beside = f" (the paper's {FINE.r2:.2f} %)" if name == "paper" else ""
        axis.set_title(f"{name} features: R² {each.scores.r2:.2f} %{beside}", fontsize=10)
        axis.set(xlabel="solved area [%]", ylabel="predicted area [%]")
    return figure
