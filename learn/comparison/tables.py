"""The tables and pictures of a comparison, beside the paper's: written, printed and drawn.

| file              | like the paper's | its numbers are made by              |
|-------------------|------------------|--------------------------------------|
| scores.csv        | Table 4          | `jobs.fit_and_time`, `metrics.scores` |
| times.csv         | Table 4          | `jobs.fit_and_time`                  |
| tuning.csv        | Table 3          | `search.GridSearch.report`           |
| tuning-times.csv  | Table 3          | `search.GridSearch.seconds`          |

Intervals of the scores are those of `learn.metrics.bootstrap`; the paper's numbers stand in
`learn.comparison.paper`. Scores and times go into separate files: the scores are the same for the
same seeds whatever the number of processes, the times are not.
"""

import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gen.arrays import Values
from gen.runtime.errors import InputError
from gen.runtime.figure import draw_parity, new_figure, parity_axes, save
from gen.runtime.files import inside
from gen.runtime.terminal import command_to_type, echo, print_columns
from learn.comparison import paper
from learn.comparison.folder import (
    Comparison,
    Folder,
    Predictions,
    Result,
    SearchReport,
    StoredResult,
)
from learn.comparison.grid import LEAST_JUDGED, LIBRARY, LIBRARY_ROWS, space_of
from learn.metrics import BOOTSTRAP, LEVEL, Scores, bootstrap, no_better, spread
from learn.models import EVERY, MODELS, default_model

SCORES = {"nmse": "nMSE", "nmae": "nMAE", "nmaxe": "nMaxE", "r2": "R2"}
"""Names of the scores in the paper, by their field of `learn.metrics.Scores` [%]."""

WITHOUT_INTERVAL = "nmaxe"  # the largest error: a resample cannot exceed it

OUR_AREA = "area_percent"
"""Target of the paper's tables, whose numbers would mislead beside those of other targets."""

NOT_SEARCHED = "not searched"
"""Name of the winner of a search that judged too few candidates."""

WHY_BASELINE = "the baseline wins, no candidate is better over five folds of all rows"
"""What the user is told about a search that no candidate has won."""

WINNERS = {"optimum": "the paper's optimum", "baseline": "the baseline"}
"""Names of the winners' places for people, where they differ from those of files."""

DECIDING = {
    "winner_r2": "r2_folds",
    "grid_r2": "grid_r2_folds",
    "optimum_r2": "optimum_r2_folds",
    "baseline_r2": "baseline_r2_folds",
}
"""Fields of a `SearchReport` with the R2 on folds, by the column of tuning.csv with their mean."""

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
)
"""Columns of tuning.csv."""

COLOURS = {"baseline": "tab:blue", "tuned": "tab:orange"}
"""Colours of the kinds of results that are drawn."""

DOTS: dict[str, dict[str, Any]] = {
    "baseline": {
        "marker": "o",
        "ms": 4,
        "mew": 0.5,
        "mfc": "none",
        "ls": "none",
        "zorder": 1,
    },
    "tuned": {"marker": ".", "ms": 2, "ls": "none", "zorder": 2},
}
"""Looks of predictions: circles of the baseline stay visible round the dots of tuned models."""

DPI = 120  # dots per inch: pictures are about 1,400 wide then

PANELS = {
    "nmse": "nMSE [%]",
    "nmae": "nMAE [%]",
    "nmaxe": "nMaxE [%]",
    "r2": "1 - R2 [%]",
    "fit_s": "fit [s]",
    "predict_test_s": "prediction of the test set [s]",
    "predict_row_s": "of one row [s]",
}
"""Titles of the panels of bars, by their column."""

LINEAR = ("nmse", "nmae", "nmaxe")  # panels that are not on a scale of decades
SHIFTS = {"baseline": -0.2, "tuned": 0.2}  # of the bars from the place of their model

Cells = dict[str, object]
"""Cells of one row of a file, by column; "" for a cell without a value."""


@dataclass(frozen=True)
class Interval:
    """Interval of a score [%]."""

    low: float
    high: float


@dataclass(frozen=True)
class Intervals:
    """Intervals of the scores of a result, by a bootstrap over its test rows."""

    by_score: dict[str, Interval]  # by field of `learn.metrics.Scores`
    drawn: str  # number and kind of what was drawn, as "12 surfaces"


@dataclass(frozen=True, eq=False)
class TableRow:
    """A result with what the tables have beside it."""

    model: str
    kind: str  # one of `learn.comparison.folder.KINDS`
    result: Result
    published: Scores | None  # the paper's; None for other targets, or a kind it has not
    intervals: Intervals | None  # None without scores, or for one group of rows
    variance_over_mean: float | None  # of the test rows' truth, in the target's unit

    @property
    def title(self) -> str:
        """Name of the model for people."""
        return EVERY[self.model].title

    @property
    def search(self) -> SearchReport | None:
        """Report of the search that the result has won, None for a baseline."""
        return self.result.search

    @property
    def is_baseline_that_won(self) -> bool:
        """Whether the result is of a search that the baseline has won."""
        return self.search is not None and self.search.winner == "baseline"


@dataclass(frozen=True, eq=False)
class Tables:
    """The tables of a target."""

    folder: Folder
    comparison: Comparison  # the folder's description
    rows: list[TableRow]  # one for each result, in the order of Table 4

    @property
    def target(self) -> str:
        """Column of the target."""
        return self.comparison.conditions.target

    @property
    def scored(self) -> list[TableRow]:
        """Rows of the results that have scores."""
        return [row for row in self.rows if row.result.test is not None]


def score_names(target: str) -> list[str]:
    """Return the scores that tables show.

    Parameters
    ----------
    target : str
        Column of the target.

    Returns
    -------
    list of str
        Fields of `learn.metrics.Scores`. The nMSE has the target's unit, and is shown for areas
        only.
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
        Names of the columns, in their order. The largest error has no interval.
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
    """Read the results of a folder, and compute the intervals of their scores.

    Parameters
    ----------
    folder : Folder
        Folder of one target.

    Returns
    -------
    Tables
        The tables of the target.

    Raises
    ------
    InputError
        If a file is damaged, or rows.csv does not belong to the predictions.
    """
    comparison = folder.record()
    rows = [_row(folder, comparison, stored) for stored in folder.results()]
    return Tables(folder, comparison, rows)


def _row(folder: Folder, comparison: Comparison, stored: StoredResult) -> TableRow:
    """Return the row of a result, with the paper's scores if the target is the paper's."""
    published = None
    if comparison.conditions.target == OUR_AREA:
        published = paper.TEST.get(stored.kind, {}).get(stored.model)
    intervals = None
    variance_over_mean = None
    if stored.result.test:
        predictions = folder.prediction(stored.kind, stored.model)
        groups = folder.numbers("rows.csv", "group", part="test")[:, 0]
        path = folder.path / stored.kind / f"{stored.model}.csv"
        _check(path, predictions.truth, groups)
        variance_over_mean = spread(predictions.truth)
        intervals = _intervals(comparison, predictions, groups)
    return TableRow(
        stored.model,
        stored.kind,
        stored.result,
        published,
        intervals,
        variance_over_mean,
    )


def _check(path: Path, truth: Values, groups: Values) -> None:
    """Refuse predictions whose truth, (m,), does not vary, or does not fit to the groups, (m,)."""
    if truth.size != groups.size:
        raise InputError(
            f"{path} has {truth.size} rows, rows.csv has {groups.size} test rows: move it away"
        )
    if truth.size < 2 or np.ptp(truth) == 0:
        raise InputError(f"{path} cannot be read: the truth does not vary: move it away")


def _intervals(
    comparison: Comparison, predictions: Predictions, groups: Values
) -> Intervals | None:
    """Return intervals by resamples of groups of test rows, (m,); None for a single group."""
    ends = bootstrap(predictions.truth, predictions.prediction, LEVEL, groups)
    if not ends:
        return None
    kind = "row"
    if comparison.split_by_tile:
        kind = "tile"
    elif comparison.split_by_surface:
        kind = "surface"
    by_score = {name: Interval(low, high) for name, (low, high) in ends.items()}
    return Intervals(by_score, f"{np.unique(groups).size} {kind}s")


def winner_of(search: SearchReport) -> str:
    """Return the place of a search's winner.

    Parameters
    ----------
    search : SearchReport
        Report of the search.

    Returns
    -------
    str
        "grid", "optimum", "baseline" or `NOT_SEARCHED`. Earlier versions named a winner of too few
        candidates; an older report of failures may have none, "".
    """
    least = min(LEAST_JUDGED, search.candidates_differing)
    if search.candidates_scored < least and not search.failures:
        return NOT_SEARCHED
    return search.winner or ""


def write(tables: Tables) -> None:
    """Write scores.csv, times.csv, tuning.csv and tuning-times.csv into the target's folder.

    Parameters
    ----------
    tables : Tables
        The tables.

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
        _search_cells(row, row.search) for row in tables.rows if row.search is not None
    ]
    _write(tables.folder, "tuning.csv", TUNING, searches)
    columns = ("model", "fit_seconds", "paper_s")
    _write(tables.folder, "tuning-times.csv", columns, searches)


def _write(folder: Folder, name: str, columns: Sequence[str], rows: list[Cells]) -> None:
    """Write some columns of rows as a table of a folder."""
    folder.write_table(
        name, columns, [[row.get(column, "") for column in columns] for row in rows]
    )


def _score_cells(row: TableRow, target: str) -> Cells:
    """Return the cells of a row of scores.csv."""
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
        cells["drawn"] = row.intervals.drawn
    return cells


def _time_cells(row: TableRow) -> Cells:
    """Return the cells of a row of times.csv."""
    cells: Cells = {"model": row.model, "result": row.kind}
    for column, name in TIMES.items():
        cells[column] = getattr(row.result.times, name)
    return cells


def _search_cells(row: TableRow, search: SearchReport) -> Cells:
    """Return the cells of a row of tuning.csv and of tuning-times.csv."""
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
        "settings": _settings_in_words(row.result),
        "paper_s": paper.TUNING_SECONDS.get(row.model, ""),
    }
    for column, name in DECIDING.items():
        folds: list[float] = getattr(search, name)
        if folds:
            cells[column] = sum(folds) / len(folds)
    if row.result.times is not None:
        cells["fit_seconds"] = row.result.times.search
    return cells


def _settings_in_words(result: Result) -> str:
    """Return the settings of a result as text, in alphabetical order."""
    settings = sorted(result.settings.items())
    return ", ".join(f"{name}={value}" for name, value in settings) or (
        "those of the library"
    )


def show(tables: Tables) -> None:
    """Print the tables of a folder, and remarks about them.

    Parameters
    ----------
    tables : Tables
        The tables.
    """
    conditions = tables.comparison.conditions
    limit = ""
    if conditions.area_max is not None:
        limit = f", areas to {conditions.area_max:g} %"
    echo(
        f"{tables.folder.path}: {tables.target}, {conditions.train_rows} training rows,"
        f" {conditions.test_rows} test rows{limit}; {tables.comparison.threads} thread"
    )
    echo(
        "Scores on the test rows [%] with their intervals, times [s]; the paper's in brackets:"
    )
    scores = [SCORES[name] for name in score_names(tables.target)]
    numbers = (*scores, "fit", "test set", "one row")
    lines = [_line_of_scores(row, tables.target) for row in tables.rows]
    print_columns(lines, ("Model", "", *numbers), right=numbers)
    for note in _notes(tables):
        echo(note)
    _show_searches(tables)
    for remark in _remarks(tables):
        echo(remark)


def _show_searches(tables: Tables) -> None:
    """Print a table like Table 3, if there are tuned models."""
    tuned = [row for row in tables.rows if row.kind == "tuned"]
    if not tuned:
        return
    echo(
        "Searches: means of R2 over the five folds of all rows [%], which decide; sum of the fits'"
        " times [s], the paper's tuning time in brackets:"
    )
    texts = ("Model", "Grid", "Searched", "Winner", "Best settings")
    numbers = ("R2", "baseline", "candidates", "differ", "fits", "of", "time")
    lines = [_line_of_search(row, tables.target) for row in tuned]
    print_columns(lines, (*texts, *numbers), right=numbers)


def _notes(tables: Tables) -> Iterator[str]:
    """Yield how the intervals were made, and what the nMSE is, for tables and pictures."""
    drawn = [row.intervals.drawn for row in tables.rows if row.intervals is not None]
    for text in dict.fromkeys(drawn):
        yield (
            f"{100 * LEVEL:g} % intervals of the scores on the test rows [%]: bootstrap,"
            f" {BOOTSTRAP:,} resamples of {text}; nMaxE has none"
        )
    spreads = [row.variance_over_mean or 0.0 for row in tables.rows]
    largest = max(spreads, default=0.0)
    if largest and tables.target == OUR_AREA:
        yield (
            "nMSE has the target's unit: it is (1 - R2) times the variance of the test rows' areas"
            f" over their mean, {largest:.2g} % of area here and {paper.SPREAD:.2g} % in the paper."
            f" At the same R2 the nMSE is {largest / paper.SPREAD:.2g} times the paper's: compare"
            " R2."
        )


def _remarks(tables: Tables) -> Iterator[str]:
    """Yield the lines below the tables: useless models, failures, odd searches, and the best."""
    features = tables.comparison.conditions.features
    for useless in no_better_than_constant(tables):
        yield f"warning: {useless.message}"
    for row in tables.rows:
        yield from _remarks_on_result(row, features)
    if len({row.model for row in tables.scored}) > 1:
        best = min(tables.scored, key=_nmae)
        usual = EVERY[default_model(features)].title
        fit = command_to_type("learn fit")
        yield (
            f"smallest nMAE: {best.title}, {label(best.model, best.kind)}; {fit} takes {usual}"
            " unless told otherwise"
        )


def _nmae(row: TableRow) -> float:
    """Return the nMAE of a row on the test rows [%], infinite without scores."""
    return np.inf if row.result.test is None else row.result.test.nmae


def _remarks_on_result(row: TableRow, features: str) -> Iterator[str]:
    """Yield why a result has failed, or what is odd about it or its search."""
    if row.result.failure:
        yield f"{row.title}, {label(row.model, row.kind)}: {row.result.failure}"
    elif row.kind == "library":
        yield (
            f"Its library fits amplitude and length of a Gaussian process ({LIBRARY_ROWS:,} rows at"
            " most here); the paper's, and ours, has a fixed kernel."
        )
    elif row.search is None:
        return
    elif winner_of(row.search) == NOT_SEARCHED:
        judged = f"{row.search.candidates_scored} candidates were judged"
        yield f"{row.title}: {NOT_SEARCHED}: {judged}, of {LEAST_JUDGED} at least"
    elif row.is_baseline_that_won:
        yield f"{row.title}: {WHY_BASELINE}"
    else:
        for remark in _remarks_on_ends(row, row.search, features):
            yield f"{row.title}: {remark}"


def _remarks_on_ends(row: TableRow, search: SearchReport, features: str) -> Iterator[str]:
    """Yield which settings of a winner lie beyond the grid, or at an end of all values tried."""
    values = space_of(row.model, features).values
    for name, value in row.result.settings.items():
        is_number = isinstance(value, int | float)
        if is_number and value not in values.get(name, [value]):
            yield f"{name} = {value} lies beyond the grid, where the search went on"
        if name in search.ends:
            yield f"{name} = {value} at an end of what was tried: a better one may lie beyond"


def label(model: str, kind: str) -> str:
    """Return the name of a kind of result for people.

    Parameters
    ----------
    model : str
        Name of the model.
    kind : str
        One of `learn.comparison.folder.KINDS`.

    Returns
    -------
    str
        The name. A model whose baseline is not its library's own has two of its kinds renamed.
    """
    if kind == "library":
        return "its library's own"
    if kind == "baseline" and model in LIBRARY:
        return "baseline: the paper's"
    return kind


@dataclass(frozen=True, eq=False)
class UselessModel:
    """A model that a constant predicts as well as."""

    row: TableRow
    message: str  # for the user


def no_better_than_constant(tables: Tables) -> list[UselessModel]:
    """Return the results that are no better than predicting a constant.

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
        fault = no_better(row.result.test.r2) if row.result.test else ""
        if fault:
            useless.append(UselessModel(row, f"{row.title}, {row.kind}: {fault}"))
    return useless


def _line_of_scores(row: TableRow, target: str) -> list[str]:
    """Return a line of the printed Table 4, with the paper's numbers in brackets."""
    kind = label(row.model, row.kind)
    if row.is_baseline_that_won:
        kind = f"{row.kind}: baseline"
    line = [row.title, kind]
    if row.result.test is None or row.result.times is None:
        return [*line, "failed"]
    for name in score_names(target):
        text = f"{getattr(row.result.test, name):.2f}"
        if row.published is not None:
            text += f" ({getattr(row.published, name):.2f})"
        if row.intervals is not None and name in row.intervals.by_score:
            interval = row.intervals.by_score[name]
            text += f"\n{interval.low:.2f} to {interval.high:.2f}"
        line.append(text)
    fit = _seconds(row.result.times.fit)
    test = _seconds(row.result.times.test)
    if row.published is not None:
        published = paper.TIMES[row.kind][row.model]
        fit += f" ({published[0]:.3g})"
        test += f" ({published[1]:.3g})"
    return [*line, fit, test, _seconds(row.result.times.row)]


def _line_of_search(row: TableRow, target: str) -> list[str]:
    """Return a line of the printed Table 3: extent and winner of a search."""
    if row.search is None:
        return [row.title, "", row.result.failure.partition(":")[0]]
    cells = _search_cells(row, row.search)
    seconds = _seconds(row.result.times.search if row.result.times else None)
    if target == OUR_AREA and row.model in paper.TUNING_SECONDS:
        seconds += f" ({paper.TUNING_SECONDS[row.model]:.0f})"
    winner = winner_of(row.search)
    return [
        row.title,
        row.search.grid,
        row.search.how,
        WINNERS.get(winner, winner),
        _settings_in_words(row.result),
        _two_digits(cells.get("winner_r2")),
        _two_digits(cells.get("baseline_r2")),
        str(row.search.candidates),
        str(row.search.candidates_differing),
        str(row.search.fits),
        str(row.search.fits_nominal),
        seconds,
    ]


def _two_digits(value: object) -> str:
    """Return a number with two digits behind the point, "" for anything else."""
    return f"{value:.2f}" if isinstance(value, int | float) else ""


def _seconds(value: float | None) -> str:
    """Return a time [s] as text, "" if it is not known."""
    if value is None:
        return ""
    return f"{value:.0f}" if value >= 1000 else f"{value:.3g}"


def draw(tables: Tables) -> list[Path]:
    """Draw parity.png (like figures 8 and 10), scores.png and times.png (like figure 9).

    Parameters
    ----------
    tables : Tables
        The tables.

    Returns
    -------
    list of Path
        The pictures in the folder of the target. None is drawn without a result that has scores.

    Raises
    ------
    InputError
        If a file cannot be written.
    """
    rows = [row for row in tables.scored if row.kind in COLOURS]
    if not rows:
        return []
    times = [name for name in TIMES if name != "fits"]
    figures = {
        "parity.png": _parity(tables, rows),
        "scores.png": _bars(rows, score_names(tables.target)),
        "times.png": _bars(rows, times),
    }
    notes = [*_notes(tables)]
    baselines = [row.title for row in rows if row.is_baseline_that_won]
    if baselines:
        notes.insert(
            0, f"tuned is the baseline, which won the search: {', '.join(baselines)}"
        )
    text = "\n".join(textwrap.fill(line, 150) for line in notes)
    figures["scores.png"].axes[0].set_title(text, fontsize=8, loc="left")
    return [
        save(figure, inside(tables.folder.path, name), dpi=DPI)
        for name, figure in figures.items()
    ]


def _parity(tables: Tables, rows: list[TableRow]) -> Any:
    """Draw predictions over the truth, baseline and tuned, and the line of equality."""
    quantity = f"{tables.target.replace('_percent', '')} [{tables.comparison.unit}]"
    models = list(dict.fromkeys(row.model for row in rows))
    columns = min(3, len(models))
    lines = -(-len(models) // columns)
    figure = new_figure(3.6 * columns, 3.5 * lines)
    axes = np.atleast_1d(figure.subplots(lines, columns)).ravel()
    for model, axis in zip(models, axes, strict=False):
        kinds = [row.kind for row in rows if row.model == model]
        parity_axes(axis, tables.folder.prediction(kinds[0], model).truth)
        for kind in kinds:
            shown = tables.folder.prediction(kind, model)
            draw_parity(
                axis,
                shown.truth,
                shown.prediction,
                label=kind,
                color=COLOURS[kind],
                **DOTS[kind],
            )
        axis.set(
            title=EVERY[model].title, xlabel=f"solved {quantity}", ylabel="predicted"
        )
        axis.legend(markerscale=2, loc="upper left", fontsize=8)
    for axis in axes[len(models) :]:
        axis.set_axis_off()
    return figure


def _bars(rows: list[TableRow], columns: list[str]) -> Any:
    """Draw a pair of bars for each model, baseline and tuned, in one panel for each column."""
    figure = new_figure(1.6 + 1.15 * len(MODELS), 2.3 * len(columns))
    axes = figure.subplots(len(columns), 1, sharex=True, squeeze=False)[:, 0]
    models = list(dict.fromkeys(row.model for row in rows))
    titles = [EVERY[model].title.replace(" ", "\n") for model in models]
    for axis, column in zip(axes, columns, strict=True):
        for kind in COLOURS:
            of_kind = [row for row in rows if row.kind == kind]
            if of_kind:
                places = [models.index(row.model) + SHIFTS[kind] for row in of_kind]
                _draw_bars(axis, places, of_kind, column)
        axis.set_xticks(range(len(models)), titles)
        axis.margins(y=0.2)
        scale = "linear" if column in LINEAR else "log"
        axis.set(ylabel=PANELS[column], yscale=scale)
    axes[0].legend(ncols=2, loc="lower right", bbox_to_anchor=(1, 1))
    return figure


def _draw_bars(axis: Any, places: list[float], rows: list[TableRow], column: str) -> None:
    """Draw the bars of one kind of results at some places, with their intervals."""
    bars = [_bar(row, column) for row in rows]
    heights = np.array([bar.height for bar in bars])
    ends = np.array([[bar.height, bar.low, bar.high] for bar in bars])
    reach = np.array([heights - ends.min(axis=1), ends.max(axis=1) - heights])
    drawn = axis.bar(
        places,
        heights,
        0.38,
        yerr=reach.tolist() if np.any(reach) else None,  # of arrays NumPy 2.1 warns
        color=COLOURS[rows[0].kind],
        label=rows[0].kind,
        ecolor="0.2",
        capsize=2,
    )
    axis.bar_label(drawn, fmt="{:.3g}", fontsize=7)


@dataclass(frozen=True)
class Bar:
    """Height of a bar, and the ends of its interval, which are the height without one."""

    height: float
    low: float
    high: float


def _bar(row: TableRow, column: str) -> Bar:
    """Return the bar of a result that has scores, for a score [%] or a time [s].

    For R2 it is the distance to 100 %, since R2 of good models look alike.
    """
    if column in TIMES:
        seconds = float(getattr(row.result.times, TIMES[column]))
        return Bar(seconds, seconds, seconds)
    value = float(getattr(row.result.test, column))
    interval = Interval(value, value)
    if row.intervals is not None:
        interval = row.intervals.by_score.get(column, interval)
    if column == "r2":
        return Bar(100 - value, 100 - interval.low, 100 - interval.high)
    return Bar(value, interval.low, interval.high)
