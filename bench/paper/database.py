"""The paper's database beside ours: solve times, Table 1, and the finer grid of section 4.3.

Section 4.3 and Table 5 train kernel ridge on the coarse grid, and test it on the finer one.
"""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from bench.files import Row
from bench.paper.facts import AREA_MAX, FINE, FINE_ROWS, RANGES, ratio, rounded, why
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

UNEXPLAINED = {"bandwidth_x", "bandwidth_y"}
"""Columns that the paper defines otherwise, without saying how."""

SHOWN = [column for column in ALL_COLUMNS if column.name in RANGES]
"""Columns of Table 1, in our order."""

BINS = 10
"""Number of bins with equally many rows, over which solve times are tabulated."""


def finished(path: Path) -> pd.DataFrame:
    """Read the finished rows of a database.

    Parameters
    ----------
    path : Path
        The database.

    Returns
    -------
    DataFrame
        The columns of Table 1, and `solve_seconds` [s]. The index is the row of the database.

    Raises
    ------
    InputError
        If fewer than two rows are finished.
    """
    with Reader(path) as reader:
        names = ("status", *RANGES, "solve_seconds")
        rows = pd.DataFrame({name: reader.column(name) for name in names})
    done = rows[rows["status"] == Status.DONE].drop(columns="status")
    if len(done) < 2:
        raise InputError(f"{path} has {len(done)} finished rows: two at least are needed")
    return done


def solve_times(database: Path) -> Report:
    """Tabulate the time of a solve against displacement and area (section 2.4).

    Parameters
    ----------
    database : Path
        A database of the paper preset.

    Returns
    -------
    Report
        Tables `solve-times`, of bins with equally many rows, and `rows`, of all rows for pictures.
    """
    rows = finished(database)
    bins: list[Row] = []
    for name in (DELTA.name, AREA.name):
        number = min(BINS, len(rows))
        for places in np.array_split(rows[name].argsort(), number):
            values = rows[name].iloc[places]
            milliseconds = 1000 * rows["solve_seconds"].iloc[places]
            bins.append(
                {
                    "against": name,
                    "from": values.min(),
                    "to": values.max(),
                    "rows": len(places),
                    "mean_ms": milliseconds.mean(),
                    "median_ms": milliseconds.median(),
                    "longest_ms": milliseconds.max(),
                }
            )
    dots: list[Row] = []
    columns = [DELTA.name, AREA.name, "hurst", "solve_seconds"]
    for number, *values in rows[columns].itertuples():
        delta, area, hurst, seconds = rounded(values)
        dots.append(
            {
                "row": number,
                DELTA.in_tables: delta,
                AREA.name: area,
                "hurst": hurst,
                "solve_s": seconds,
            }
        )
    return Report({"solve-times": bins, "rows": dots})


def table_1(database: Path) -> Report:
    """Tabulate the ranges of all parameters, ours and the paper's (Table 1).

    Parameters
    ----------
    database : Path
        A database of the paper preset.

    Returns
    -------
    Report
        Table `table-1`.
    """
    rows = finished(database)
    return Report({"table-1": [_range(column, rows[column.name]) for column in SHOWN]})


def _range(column: Column, values: "pd.Series[float]") -> Row:
    """Return the row of Table 1 for a column, with the reason why its ends differ."""
    low, high = RANGES[column.name]
    inside = 100 * ((values >= low) & (values <= high)).mean()
    our_low = values.min()
    our_high = values.max()
    shifts = [
        100 * (our_low - low) / (high - low),
        100 * (our_high - high) / (high - low),
    ]
    return {
        "parameter": column.long_name,
        "unit": column.unit,
        "ours_low": our_low,
        "ours_high": our_high,
        "paper_low": low,
        "paper_high": high,
        "ours_inside_percent": f"{inside:.1f}",
        "deviation": ", ".join(f"{shift:+.1f} %" for shift in shifts),
        "explanation": _reason_for_range(column.name),
    }


def _reason_for_range(name: str) -> str:
    """Say why the range of a column differs from the paper's; "" where it should not."""
    if name in UNEXPLAINED:
        return why("bandwidth")
    if name in {"hurst", "delta"}:
        return ""
    if name == "area_percent":
        return why("areas", largest=AREA_MAX)
    return why("extremes")


MODEL = "kernel-ridge"
"""The model that section 4.3 tests on the finer grid."""

CURVATURE = "peak_curvature_mean"
"""The statistic whose growth explains why statistics do not carry over to another grid."""

FINE_SCENE = "[surface]\nnodes = 257\n"
"""Keys of the scene of the finer grid; all other keys are the paper preset's."""


@dataclass(frozen=True, eq=False)
class FineTest:
    """A surrogate of the coarse grid, tested on rows of the finer one."""

    rows: Dataset  # n rows of the finer grid
    prediction: Values  # areas, shape (n,) [%]
    scores: Scores  # [%]


def fine_grid(database: Path, fine: Path) -> Report:
    """Train kernel ridge with each feature set on the preset's grid, and test it on the finer one.

    Parameters
    ----------
    database : Path
        A database of the paper preset.
    fine : Path
        A database with `FINE_SCENE`.

    Returns
    -------
    Report
        Table and picture `fine-grid` of the predictions, and `table-5` of the scores.
    """
    tests = {
        features: _test_on_fine(database, fine, features) for features in OF_SURFACES
    }
    rows = tests["paper"].rows
    dots: list[Row] = []
    for place, number in enumerate(rows.rows.tolist()):
        areas = {"solved_percent": rows.target[place]}
        areas |= {features: test.prediction[place] for features, test in tests.items()}
        values = dict(zip(areas, rounded(areas.values()), strict=True))
        dots.append({"row": number, **values})
    tables = {"table-5": _table_5(tests, database), "fine-grid": dots}
    return Report(tables, pictures={"fine-grid": _fine_picture(tests)})


def number_of_fine_rows(rows: int) -> int:
    """Choose the number of rows of the finer grid that test a surrogate.

    Parameters
    ----------
    rows : int
        Number of rows of the database that trains the surrogate.

    Returns
    -------
    int
        A fifth of the rows, from 40 up to the paper's 800.
    """
    return min(FINE_ROWS, max(40, rows // 5))


def _test_on_fine(database: Path, fine: Path, features: str) -> FineTest:
    """Fit a surrogate as `learn fit` does on the coarse grid, and test it on the finer one."""
    request = request_for(database, MODEL, features, AREA_MAX)
    parts = parted(read(request))
    surrogate = fit(request, parts.train, parts.folds)
    rows = read(request_for(fine, MODEL, features, AREA_MAX))
    prediction = surrogate.predict(rows)
    return FineTest(
        rows=rows, prediction=prediction, scores=scores(rows.target, prediction)
    )


def _table_5(tests: dict[str, FineTest], database: Path) -> list[Row]:
    """Return the rows of Table 5: one for each score, with a column for each feature set."""
    reason = _reason_for_fine(database, tests["paper"].rows)
    table: list[Row] = []
    for name, theirs in asdict(FINE).items():
        row: Row = {"score_percent": name}
        for features, test in tests.items():
            row[f"ours_{features}"] = getattr(test.scores, name)
        ours = row["ours_paper"]
        row["paper"] = theirs
        row["deviation"] = ratio(ours, theirs)
        if name == "r2":
            # R2 of good models is near 100 %: the difference says more than the ratio.
            row["deviation"] = f"{ours - theirs:+.2f}"
        row["explanation"] = reason
        table.append(row)
    return table


def _reason_for_fine(database: Path, fine: Dataset) -> str:
    """Say how the mean curvature of peaks changes on the finer grid."""
    with Reader(database) as reader:
        coarse_values = reader.column(CURVATURE)
    with Reader(Path(fine.name)) as reader:
        fine_values = reader.column(CURVATURE)[fine.rows]
    growth = np.median(fine_values) / np.nanmedian(coarse_values)
    beyond = 100 * (fine_values > np.nanmax(coarse_values)).mean()
    return why("fine", growth=float(growth), beyond=float(beyond))


def _fine_picture(tests: dict[str, FineTest]) -> Any:
    """Draw the areas that are predicted with each feature set over the solved areas."""
    figure = new_figure(12, 4)
    axes = figure.subplots(1, len(tests))
    for axis, (features, test) in zip(axes, tests.items(), strict=True):
        truth = test.rows.target
        parity_axes(axis, truth)
        draw_parity(
            axis, truth, test.prediction, marker=".", ms=3, ls="none", color=COLOURS[0]
        )
        title = f"{features} features: R² {test.scores.r2:.2f} %"
        if features == "paper":
            title += f" (the paper's {FINE.r2:.2f} %)"
        axis.set_title(title, fontsize=10)
        axis.set(xlabel="solved area [%]", ylabel="predicted area [%]")
    return figure
