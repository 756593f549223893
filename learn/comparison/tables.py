"""The tables of a comparison beside the paper's: what they contain, and their files.

`read` collects the results of a folder, and `write` writes these tables into it:

| file              | like the paper's | its numbers are made by               |
|-------------------|------------------|---------------------------------------|
| scores.csv        | Table 4          | `jobs.fit_and_time`, `metrics.scores` |
| times.csv         | Table 4          | `jobs.fit_and_time`                   |
| tuning.csv        | Table 3          | `search.GridSearch.report`            |
| tuning-times.csv  | Table 3          | `search.GridSearch.seconds`           |

`learn.metrics.bootstrap` makes the intervals of the scores, and `learn.comparison.paper` has the
paper's numbers. Scores and times are in separate files, because scores are equal for equal seeds
and any number of processes, and times are not. `learn.comparison.printing` prints the tables, and
`learn.comparison.plots` draws them.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gen.arrays import Values
from gen.runtime.errors import InputError
from learn.comparison import paper
from learn.comparison.folder import (
    Comparison,
    Folder,
    Predictions,
    Result,
    SearchReport,
    StoredResult,
)
from learn.comparison.grid import LIBRARY
from learn.metrics import BOOTSTRAP, LEVEL, Scores, bootstrap, no_better, spread
from learn.models import EVERY

SCORES = {"nmse": "nMSE", "nmae": "nMAE", "nmaxe": "nMaxE", "r2": "R2"}
"""Names of the scores in the paper, by their field of `learn.metrics.Scores` [%]."""

WITHOUT_INTERVAL = "nmaxe"
"""Score without an interval: no resample has a larger error than the largest one of all rows."""

OUR_AREA = "area_percent"
"""Target of the paper's tables. The paper's numbers are shown beside this target only."""

NOT_SEARCHED = "not searched"
"""Winner in tables of a search that judged too few candidates."""

WHY_BASELINE = "the baseline wins, no candidate is better over five folds of all rows"
"""Remark for the user on a search that no candidate has won."""

DECIDING = {
    "winner_r2": "r2_folds",
    "grid_r2": "grid_r2_folds",
    "optimum_r2": "optimum_r2_folds",
    "baseline_r2": "baseline_r2_folds",
}
"""Fields of a `SearchReport` with R2 on single folds, by the column of tuning.csv with the mean."""

TIMES = {"fit_s": "fit", "fits": "fits", "predict_test_s": "test", "predict_row_s": "row"}
"""Fields of the `Times` of a result, by the column of times.csv."""

TUNING = (
    "model",
    "grid",
    "searched",
    "rows",
    "candidates",
    "candidates_differing",
    "candidates_scored",
    "fits_nominal",
    "fits",
    "winner",
    *DECIDING,
    "settings",
    "ends",
)
"""Columns of tuning.csv."""

Cells = dict[str, object]
"""Cells of one row of a table, by column. A missing column has an empty cell."""


@dataclass(frozen=True)
class Interval:
    """Interval of a score [%]."""

    low: float  # lower end
    high: float  # upper end


@dataclass(frozen=True)
class Intervals:
    """Intervals of the scores of a result, by a bootstrap of its test rows."""

    by_score: dict[str, Interval]  # intervals by the field of `learn.metrics.Scores`
    resampled: str  # number and kind of the groups that are resampled, as "12 surfaces"


@dataclass(frozen=True, eq=False)
class TableRow:
    """A row of the tables: a result, and the numbers that are shown beside it."""

    model: str  # name of the model
    kind: str  # kind of the result, one of `learn.comparison.folder.KINDS`
    result: Result  # settings, scores, times and report of the search
    # the paper's scores of this model and kind [%]; None if the paper has none for the target
    published: Scores | None
    # intervals of the scores; None without scores, or if all test rows are of one group
    intervals: Intervals | None
    # variance over mean magnitude of the target in the test rows, in its unit; None without scores
    variance_over_mean: float | None

    @property
    def title(self) -> str:
        """Title of the model for people."""
        return EVERY[self.model].title

    @property
    def search(self) -> SearchReport | None:
        """Report of the search whose winner has this result; None if nothing was searched."""
        return self.result.search

    @property
    def is_baseline_that_won(self) -> bool:
        """Whether the result is that of a search which the baseline has won."""
        return self.search is not None and self.search.winner == "baseline"


@dataclass(frozen=True, eq=False)
class Tables:
    """The tables of one target."""

    folder: Folder  # folder of the target
    comparison: Comparison  # data and conditions of all results
    rows: list[TableRow]  # one row for each result, in the order of the paper's Table 4

    @property
    def target(self) -> str:
        """Column of the target."""
        return self.comparison.conditions.target

    @property
    def scored(self) -> list[TableRow]:
        """Rows whose result has scores."""
        return [row for row in self.rows if row.result.test is not None]


def score_names(target: str) -> list[str]:
    """Return the scores that the tables of a target show.

    Parameters
    ----------
    target : str
        Column of the target.

    Returns
    -------
    list of str
        Fields of `learn.metrics.Scores`. The nMSE is left out unless the target is the area in
        percent, because it has the target's unit.
    """
    return [name for name in SCORES if name != "nmse" or target == OUR_AREA]


def score_columns(target: str) -> list[str]:
    """Return the columns of scores.csv.

    Parameters
    ----------
    target : str
        Column of the target.

    Returns
    -------
    list of str
        Names of the columns, in their order. The paper's scores are left out unless the target is
        `OUR_AREA`.
    """
    names = score_names(target)
    columns = ["model", "result", *names]
    columns += [f"train_{name}" for name in names]
    if target == OUR_AREA:
        columns += [f"paper_{name}" for name in names]
    columns += ["failure", "winner"]
    for name in names:
        if name != WITHOUT_INTERVAL:
            columns += [f"{name}_low", f"{name}_high"]
    return [*columns, "level", "resamples", "drawn", "variance_over_mean"]


def read(folder: Folder) -> Tables:
    """Read the results of a target, and compute the intervals of their scores.

    Parameters
    ----------
    folder : Folder
        Folder of the target.

    Returns
    -------
    Tables
        The tables of the target.

    Raises
    ------
    InputError
        If the folder has no comparison, a file is missing or damaged, rows.csv has another number
        of test rows than the predictions, or the target is constant in the test rows.
    """
    comparison = folder.record()
    rows = [_row(folder, comparison, stored) for stored in folder.results()]
    return Tables(folder=folder, comparison=comparison, rows=rows)


def _row(folder: Folder, comparison: Comparison, stored: StoredResult) -> TableRow:
    """Return the row of a stored result.

    Predictions and rows.csv are read if the result has scores; InputError is raised if these files
    are damaged or do not belong together.
    """
    published = None
    if comparison.conditions.target == OUR_AREA:
        published = paper.TEST.get(stored.kind, {}).get(stored.model)
    intervals = None
    variance_over_mean = None
    if stored.result.test:
        predictions = folder.prediction(stored.kind, stored.model)
        groups = folder.numbers("rows.csv", "group", part="test")[:, 0]
        path = folder.path / stored.kind / f"{stored.model}.csv"
        _require_matching_truth(groups, predictions.truth, path)
        variance_over_mean = spread(predictions.truth)
        intervals = _intervals(comparison, predictions, groups)
    return TableRow(
        model=stored.model,
        kind=stored.kind,
        result=stored.result,
        published=published,
        intervals=intervals,
        variance_over_mean=variance_over_mean,
    )


def _require_matching_truth(groups: Values, truth: Values, path: Path) -> None:
    """Raise InputError unless each test row has a true target, and the targets differ.

    `groups` are the groups of the m test rows in rows.csv, (m,). `truth` are the true targets in
    the table of predictions, which is the file `path`.
    """
    if truth.size != groups.size:
        raise InputError(
            f"{path} has {truth.size} rows, rows.csv has {groups.size} test rows: move it away"
        )
    if truth.size < 2 or np.ptp(truth) == 0:
        raise InputError(f"{path} cannot be read: the truth does not vary: move it away")


def _intervals(
    comparison: Comparison, predictions: Predictions, groups: Values
) -> Intervals | None:
    """Return the intervals of the scores of predictions; None if all test rows are in one group.

    `groups` are the groups of the m test rows, (m,), which are resampled as a whole.
    """
    ends = bootstrap(predictions.truth, predictions.prediction, LEVEL, groups)
    if not ends:
        return None
    kind = "row"  # Rows that were split one by one are groups of their own.
    if comparison.split_by_tile:
        kind = "tile"
    elif comparison.split_by_surface:
        kind = "surface"
    by_score = {name: Interval(low=low, high=high) for name, (low, high) in ends.items()}
    return Intervals(by_score=by_score, resampled=f"{np.unique(groups).size} {kind}s")


def winner_of(search: SearchReport) -> str:
    """Return where the winner of a search comes from.

    Parameters
    ----------
    search : SearchReport
        Report of the search.

    Returns
    -------
    str
        "grid", "optimum" (of the paper), "baseline", or `NOT_SEARCHED` if too few candidates were
        judged; "" for a report of an earlier version that has failures and no winner.
    """
    # Reports of earlier versions name a winner of too few candidates, too.
    needed = min(search.enough, search.candidates_differing)
    if search.candidates_scored < needed and not search.failures:
        return NOT_SEARCHED
    return search.winner or ""


def write(tables: Tables) -> None:
    """Write scores.csv, times.csv, tuning.csv and tuning-times.csv into the folder of a target.

    Parameters
    ----------
    tables : Tables
        The tables of the target.

    Raises
    ------
    InputError
        If a file cannot be written.
    """
    scores = [_score_cells(row, tables.target) for row in tables.rows]
    _write(tables.folder, "scores.csv", score_columns(tables.target), scores)
    times = [_time_cells(row) for row in tables.rows if row.result.times is not None]
    _write(tables.folder, "times.csv", ("model", "result", *TIMES), times)
    searches = [
        search_cells(row, row.search) for row in tables.rows if row.search is not None
    ]
    _write(tables.folder, "tuning.csv", TUNING, searches)
    columns = ("model", "fit_seconds", "paper_s")
    _write(tables.folder, "tuning-times.csv", columns, searches)


def _write(folder: Folder, name: str, columns: Sequence[str], rows: list[Cells]) -> None:
    """Write columns of rows as a CSV table of a folder; cells of missing columns are empty."""
    cells = [[row.get(column, "") for column in columns] for row in rows]
    folder.write_table(name, columns, cells)


def _score_cells(row: TableRow, target: str) -> Cells:
    """Return the cells of a result in scores.csv."""
    cells: Cells = {
        "model": row.model,
        "result": row.kind,
        "failure": row.result.failure,
    }
    if row.search is not None:
        cells["winner"] = row.search.winner or ""
    for name in score_names(target):
        if row.result.test:
            cells[name] = getattr(row.result.test, name)
        if row.result.train:
            cells[f"train_{name}"] = getattr(row.result.train, name)
        if row.published is not None:
            cells[f"paper_{name}"] = getattr(row.published, name)
    if row.variance_over_mean is not None:
        cells["variance_over_mean"] = row.variance_over_mean
    if row.intervals is not None:
        for name, interval in row.intervals.by_score.items():
            cells[f"{name}_low"] = interval.low
            cells[f"{name}_high"] = interval.high
        cells["level"] = LEVEL
        cells["resamples"] = BOOTSTRAP
        cells["drawn"] = row.intervals.resampled
    return cells


def _time_cells(row: TableRow) -> Cells:
    """Return the cells of a result in times.csv."""
    cells: Cells = {"model": row.model, "result": row.kind}
    for column, name in TIMES.items():
        cells[column] = getattr(row.result.times, name)
    return cells


def search_cells(row: TableRow, search: SearchReport) -> Cells:
    """Return the cells of a result in tuning.csv and in tuning-times.csv.

    Parameters
    ----------
    row : TableRow
        Row of the result.
    search : SearchReport
        Report of the search that the result has won.

    Returns
    -------
    dict
        Cells by column: R2 in percent, times in seconds. Each file takes the cells of its own
        columns. A mean of R2 (`DECIDING`) is left out unless there is a score on every fold. `ends`
        are the winner's settings that are at an end of all values that were tried.
        `fit_seconds`, the sum of the times of all fits of the search, is left out if the result has
        no times.
    """
    cells: Cells = {
        "model": row.model,
        "grid": search.grid,
        "searched": search.how,
        "rows": search.rows,
        "candidates": search.candidates,
        "candidates_differing": search.candidates_differing,
        "candidates_scored": search.candidates_scored,
        "fits_nominal": search.fits_nominal,
        "fits": search.fits,
        "winner": winner_of(search),
        "settings": settings_text(row.result),
        "paper_s": paper.TUNING_SECONDS.get(row.model, ""),
    }
    for column, name in DECIDING.items():
        folds: list[float] = getattr(search, name)
        if folds:
            cells[column] = sum(folds) / len(folds)
    if not row.is_baseline_that_won:
        cells["ends"] = ", ".join(search.ends)
    if row.result.times is not None:
        cells["fit_seconds"] = row.result.times.search
    return cells


def settings_text(result: Result) -> str:
    """Write the settings of a result.

    Parameters
    ----------
    result : Result
        The result.

    Returns
    -------
    str
        As "alpha=0.1, kernel=rbf", in alphabetical order; "those of the library" without settings.
    """
    if not result.settings:
        return "those of the library"
    settings = sorted(result.settings.items())
    return ", ".join(f"{name}={value}" for name, value in settings)


def notes_on_scores(tables: Tables) -> Iterator[str]:
    """Explain the intervals of the scores, and the nMSE, for prints and pictures.

    Parameters
    ----------
    tables : Tables
        The tables of a target.

    Yields
    ------
    str
        One note. There is none without scores; the note on the nMSE is for areas only.
    """
    if not tables.scored:
        return
    # Groups and spread are equal for all results with scores: these share the test rows.
    row = tables.scored[0]
    if row.intervals is not None:
        yield (
            f"{100 * LEVEL:g} % intervals of the scores on the test rows [%]: bootstrap,"
            f" {BOOTSTRAP:,} resamples of {row.intervals.resampled}; nMaxE has none"
        )
    if row.variance_over_mean and tables.target == OUR_AREA:
        ratio = row.variance_over_mean / paper.SPREAD
        yield (
            "nMSE has the target's unit: it is (1 - R2) times the variance of the test rows' areas"
            f" over their mean, {row.variance_over_mean:.2g} % of area here and"
            f" {paper.SPREAD:.2g} % in the paper. At the same R2 the nMSE is {ratio:.2g} times the"
            " paper's: compare R2."
        )


def kind_text(model: str, kind: str) -> str:
    """Write the kind of a result for people.

    Parameters
    ----------
    model : str
        Name of the model.
    kind : str
        One of `learn.comparison.folder.KINDS`.

    Returns
    -------
    str
        The kind itself, but for a model in `LIBRARY`: its baseline has the paper's settings, and a
        result of the kind "library" those of its library.
    """
    if kind == "library":
        return "its library's own"
    if kind == "baseline" and model in LIBRARY:
        return "baseline: the paper's"
    return kind


@dataclass(frozen=True, eq=False)
class UselessModel:
    """A result that is no better than predicting a constant."""

    row: TableRow  # row of the result
    message: str  # message for the user


def no_better_than_constant(tables: Tables) -> list[UselessModel]:
    """List the results that are no better than predicting a constant.

    Parameters
    ----------
    tables : Tables
        The tables.

    Returns
    -------
    list of UselessModel
        The results whose R2 on the test rows is not above 0, in the order of the rows.
    """
    useless = []
    for row in tables.rows:
        if row.result.test is None:
            continue
        fault = no_better(row.result.test.r2)
        if fault:
            message = f"{row.title}, {row.kind}: {fault}"
            useless.append(UselessModel(row=row, message=message))
    return useless
