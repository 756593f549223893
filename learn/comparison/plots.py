"""The pictures of a comparison.

parity.png is like the paper's figures 8 and 10; scores.png and times.png are like its figure 9.
"""

import textwrap
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gen.runtime.figure import draw_parity, new_figure, parity_axes, save
from gen.runtime.files import inside
from learn.comparison.tables import (
    TIMES,
    Interval,
    TableRow,
    Tables,
    notes_on_scores,
    score_names,
)
from learn.models import EVERY, MODELS

COLOURS = {"baseline": "tab:blue", "tuned": "tab:orange"}
"""Colours of results by their kind; other kinds are not drawn."""

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
"""Options of matplotlib for the predictions of each kind of result.

Baselines have circles, which stay visible around the small dots of tuned models.
"""

DPI = 120  # dots per inch, with which pictures are about 1,400 dots wide
LETTERS = 150  # largest number of letters in a line of notes above the bars

PANELS = {
    "nmse": "nMSE [%]",
    "nmae": "nMAE [%]",
    "nmaxe": "nMaxE [%]",
    "r2": "1 - R2 [%]",
    "fit_s": "fit [s]",
    "predict_test_s": "prediction of the test set [s]",
    "predict_row_s": "of one row [s]",
}
"""Titles of the panels of bars, by the score or the column of times.csv that they show."""

LINEAR = ("nmse", "nmae", "nmaxe")
"""Panels with a linear axis; the others have a logarithmic one."""

SHIFTS = {"baseline": -0.2, "tuned": 0.2}
"""Distances of bars from the place of their model, by kind; models are 1 apart."""

BAR_WIDTH = 0.38
"""Width of a bar, with which the two bars of a model nearly touch."""


def draw(tables: Tables) -> list[Path]:
    """Draw parity.png, scores.png and times.png into the folder of a target.

    Parameters
    ----------
    tables : Tables
        The tables of the target.

    Returns
    -------
    list of Path
        The pictures; empty, and nothing is drawn, if no baseline or tuned model has scores.

    Raises
    ------
    InputError
        If a picture cannot be written, or a table of predictions is missing or damaged.
    """
    # Results with the libraries' own settings, of the kind "library", are not drawn.
    rows = [row for row in tables.scored if row.kind in COLOURS]
    if not rows:
        return []
    times = [column for column in TIMES if column != "fits"]
    figures = {
        "parity.png": _parity(tables, rows),
        "scores.png": _bars(rows, score_names(tables.target)),
        "times.png": _bars(rows, times),
    }
    figures["scores.png"].axes[0].set_title(
        _notes_above_bars(tables, rows), fontsize=8, loc="left"
    )
    return [
        save(figure, inside(tables.folder.path, name), dpi=DPI)
        for name, figure in figures.items()
    ]


def _notes_above_bars(tables: Tables, rows: list[TableRow]) -> str:
    """Return the notes on scores, and on searches that the baseline has won, as lines of text."""
    notes = []
    baselines = [row.title for row in rows if row.is_baseline_that_won]
    if baselines:
        notes.append(
            f"tuned is the baseline, which won the search: {', '.join(baselines)}"
        )
    notes += notes_on_scores(tables)
    return "\n".join(textwrap.fill(note, LETTERS) for note in notes)


def _parity(tables: Tables, rows: list[TableRow]) -> Any:
    """Return a figure of predictions over the truth, with a panel for each model.

    A panel has the predictions of baseline and tuned model, and the line of equality.
    """
    quantity = f"{tables.target.replace('_percent', '')} [{tables.comparison.unit}]"
    models = list(dict.fromkeys(row.model for row in rows))
    columns = min(3, len(models))
    lines = -(-len(models) // columns)  # rounded up
    figure = new_figure(3.6 * columns, 3.5 * lines)
    # A single panel is no array.
    axes = np.atleast_1d(figure.subplots(lines, columns)).ravel()
    # The last line may have more panels than there are models left.
    for model, axis in zip(models, axes, strict=False):
        kinds = [row.kind for row in rows if row.model == model]
        # All kinds have the same test rows, so the truth of the first one gives the axes.
        parity_axes(axis, tables.folder.prediction(kinds[0], model).truth)
        for kind in kinds:
            predictions = tables.folder.prediction(kind, model)
            draw_parity(
                axis,
                predictions.truth,
                predictions.prediction,
                label=kind,
                color=COLOURS[kind],
                **DOTS[kind],
            )
        axis.set(
            title=EVERY[model].title, xlabel=f"solved {quantity}", ylabel="predicted"
        )
        axis.legend(markerscale=2, loc="upper left", fontsize=8)
    for unused_axis in axes[len(models) :]:
        unused_axis.set_axis_off()
    return figure


def _bars(rows: list[TableRow], columns: list[str]) -> Any:
    """Return a figure of bars, with a panel for each of the columns, which are keys of `PANELS`.

    A panel has two bars for each model, one for its baseline and one for its tuned result.
    """
    figure = new_figure(1.6 + 1.15 * len(MODELS), 2.3 * len(columns))
    axes = figure.subplots(len(columns), 1, sharex=True, squeeze=False)[:, 0]
    for axis, column in zip(axes, columns, strict=True):
        _draw_panel(axis, rows, column)
    axes[0].legend(ncols=2, loc="lower right", bbox_to_anchor=(1, 1))
    return figure


def _draw_panel(axis: Any, rows: list[TableRow], column: str) -> None:
    """Draw the bars of all models for one column of `PANELS`."""
    models = list(dict.fromkeys(row.model for row in rows))
    titles = [EVERY[model].title.replace(" ", "\n") for model in models]
    for kind in COLOURS:
        rows_of_kind = [row for row in rows if row.kind == kind]
        if rows_of_kind:
            places = [models.index(row.model) + SHIFTS[kind] for row in rows_of_kind]
            _draw_bars(axis, places, rows_of_kind, column)
    axis.set_xticks(range(len(models)), titles)
    axis.margins(y=0.2)  # room for the numbers above the bars
    scale = "log"
    if column in LINEAR:
        scale = "linear"
    axis.set(ylabel=PANELS[column], yscale=scale)


def _draw_bars(axis: Any, places: list[float], rows: list[TableRow], column: str) -> None:
    """Draw the bars of results of one kind for a column of `PANELS`, with their intervals.

    `places` are the places of the bars on the axis of the models, one for each result.
    """
    bars = [_bar(row, column) for row in rows]
    heights = np.array([bar.height for bar in bars])
    ends = np.array([[bar.height, bar.low, bar.high] for bar in bars])
    # Distances of both ends of the intervals from the heights, (2, bars), which may not be
    # negative. The height itself is among the ends, because it may be outside of its interval.
    reach = np.array([heights - ends.min(axis=1), ends.max(axis=1) - heights])
    errors = None
    if np.any(reach):
        errors = reach.tolist()  # NumPy 2.1 warns of an array here.
    drawn_bars = axis.bar(
        places,
        heights,
        BAR_WIDTH,
        yerr=errors,
        color=COLOURS[rows[0].kind],
        label=rows[0].kind,
        ecolor="0.2",
        capsize=2,
    )
    axis.bar_label(drawn_bars, fmt="{:.3g}", fontsize=7)


@dataclass(frozen=True)
class Bar:
    """A bar with the interval of its height; all three are equal for a height without interval."""

    height: float  # score [%] or time [s]
    low: float  # one end of the interval
    high: float  # other end of the interval, which may be the smaller one


def _bar(row: TableRow, column: str) -> Bar:
    """Return the bar of a result that has scores, for a score [%] or a time [s].

    The height for R2 is its distance to 100 %, because bars of R2 of good models look alike.
    """
    if column in TIMES:
        seconds = float(getattr(row.result.times, TIMES[column]))
        return Bar(height=seconds, low=seconds, high=seconds)
    score = float(getattr(row.result.test, column))
    interval = Interval(low=score, high=score)
    if row.intervals is not None:
        interval = row.intervals.by_score.get(column, interval)
    if column == "r2":
        return Bar(height=100 - score, low=100 - interval.low, high=100 - interval.high)
    return Bar(height=score, low=interval.low, high=interval.high)
