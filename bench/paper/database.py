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
"""Names of columns that the paper defines otherwise. It does not state its definition."""

SHOWN = [column for column in ALL_COLUMNS if column.name in RANGES]
"""Columns of Table 1, in the order of our databases."""

BINS = 10
"""Largest number of bins for which solve times are tabulated. All bins have equal numbers of rows,
or differ by one."""


def finished(path: Path) -> pd.DataFrame:
    """Read the finished rows of a database.

    Parameters
    ----------
    path : Path
        The database.

    Returns
    -------
    DataFrame
        The columns of Table 1 by our names, and `solve_seconds` [s]. The index is the number of the
        row in the database.

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
        Table `solve-times`, with a row for each of `BINS` bins of displacement and of area, and
        table `rows`, with a row for each finished row of the database, for pictures.

    Raises
    ------
    InputError
        If fewer than two rows are finished.
    """
    rows = finished(database)
    number_of_bins = min(BINS, len(rows))
    bins: list[Row] = []
    for name in (DELTA.name, AREA.name):
        for places in np.array_split(rows[name].argsort(), number_of_bins):
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
        Table `table-1`, with a row for each of `SHOWN`.

    Raises
    ------
    InputError
        If fewer than two rows are finished.
    """
    rows = finished(database)
    return Report({"table-1": [_range(column, rows[column.name]) for column in SHOWN]})


def _range(column: Column, values: "pd.Series[float]") -> Row:
    """Return the row of Table 1 for a column and its values in our database.

    `ours_inside_percent` is the share of our values inside the paper's range, as a text. In
    `deviation` are the shifts of the lower and the upper end, over the length of the paper's range,
    as a text.
    """
    paper_low, paper_high = RANGES[column.name]
    our_low = values.min()
    our_high = values.max()
    inside = 100 * ((values >= paper_low) & (values <= paper_high)).mean()
    length = paper_high - paper_low
    shifts = [
        100 * (our_low - paper_low) / length,
        100 * (our_high - paper_high) / length,
    ]
    return {
        "parameter": column.long_name,
        "unit": column.unit,
        "ours_low": our_low,
        "ours_high": our_high,
        "paper_low": paper_low,
        "paper_high": paper_high,
        "ours_inside_percent": f"{inside:.1f}",
        "deviation": ", ".join(f"{shift:+.1f} %" for shift in shifts),
        "explanation": _reason_for_range(column.name),
    }


def _reason_for_range(name: str) -> str:
    """Return why the range of a column differs from the paper's; "" if it should not differ."""
    if name in UNEXPLAINED:
        return why("bandwidth")
    if name in {"hurst", "delta"}:  # drawn from the paper's range
        return ""
    if name == "area_percent":
        return why("areas", largest=AREA_MAX)
    return why("extremes")


MODEL = "kernel-ridge"
"""The model that section 4.3 tests on the finer grid."""

CURVATURE = "peak_curvature_mean"
"""Column of the statistic whose growth on the finer grid explains why a surrogate of statistics is
wrong there."""

FINE_SCENE = "[surface]\nnodes = 257\n"
"""Keys (TOML) of the scene of the finer grid. All other keys are those of the paper preset."""


@dataclass(frozen=True, eq=False)
class FineTest:
    """A surrogate of the coarse grid, tested on rows of the finer one."""

    rows: Dataset  # n rows of the finer grid
    prediction: Values  # (n,) predicted areas [%]
    scores: Scores  # scores on these rows [%]


def fine_grid(database: Path, fine: Path) -> Report:
    """Train kernel ridge with each feature set on the preset's grid, and test it on the finer one.

    Parameters
    ----------
    database : Path
        A database of the paper preset.
    fine : Path
        A database of the scene with `FINE_SCENE`.

    Returns
    -------
    Report
        Table and picture `fine-grid` of the predictions, and table `table-5` of the scores.

    Raises
    ------
    InputError
        If a database has too few usable rows.
    """
    tests = {
        features: _test_on_fine(database, fine, features) for features in OF_SURFACES
    }
    rows = tests["paper"].rows  # equal for all feature sets
    columns = {"solved_percent": rows.target}
    columns |= {features: test.prediction for features, test in tests.items()}
    dots: list[Row] = []
    for number, *areas in zip(rows.rows.tolist(), *columns.values(), strict=True):
        row_of_areas = dict(zip(columns, rounded(areas), strict=True))
        dots.append({"row": number, **row_of_areas})
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
    """Return the rows of Table 5: one for each score, with a column for each feature set.

    `deviation` compares our score with the paper's features to the paper's score.
    """
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
    """Return a sentence on how the mean curvature of peaks changes on the finer grid.

    `database` is that of the coarse grid, of which all rows are read; a row that failed has NaN.
    Of the fine grid, only the rows of `fine` are read. The sentence has the ratio of the medians,
    and the share of fine rows above the largest coarse value [%].
    """
    with Reader(database) as reader:
        coarse_values = reader.column(CURVATURE)
    with Reader(Path(fine.name)) as reader:
        fine_values = reader.column(CURVATURE)[fine.rows]
    growth = np.median(fine_values) / np.nanmedian(coarse_values)
    is_beyond = fine_values > np.nanmax(coarse_values)
    return why("fine", growth=float(growth), beyond=100 * float(is_beyond.mean()))


def _fine_picture(tests: dict[str, FineTest]) -> Any:
    """Return a figure of predicted over solved areas, with a panel for each feature set."""
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
