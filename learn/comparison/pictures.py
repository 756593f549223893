"""The pictures of a comparison, like the paper's figures 8 to 10."""

import textwrap
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gen.runtime.figure import draw_parity, new_figure, parity_axes, save
from learn.comparison.folder import Folder
from learn.comparison.tables import OUR_AREA, SCORES, Row, Tables, names, nmse_note
from learn.metrics import LEVEL
from learn.models import EVERY, MODELS

COLOURS = {"baseline": "tab:blue", "tuned": "tab:orange"}
"""Colours of the kinds of results."""

DOTS: dict[str, dict[str, Any]] = {
    "baseline": {"marker": "o", "ms": 4, "mew": 0.5, "mfc": "none", "ls": "none", "zorder": 1},
    "tuned": {"marker": ".", "ms": 2, "ls": "none", "zorder": 2},
}
"""Looks of predictions: circles of the baseline stay visible round the dots of tuned models."""

SHIFTS = {"baseline": -0.2, "tuned": 0.2}
"""Distances of the bars from the middle of their model."""

BESIDE = 0.13
"""Distance of a whisker from the middle of its bar, where the number stands."""

DPI = 120
"""Dots per inch: pictures are about 1,400 wide then."""


def draw(tables: Tables) -> list[Path]:
    """Draw parity.png (like figures 8 and 10), scores.png and times.png (like figure 9).

    Nothing is drawn if the folder of the target has no results.
    """
    folder = tables.folder
    shown = [row for row in tables.scores if row["r2"] != "" and row["result"] in COLOURS]
    if not shown:
        return []
    quantity = f"{tables.target.replace('_percent', '')} [{folder.record()['unit']}]"
    places = [(row["model"], row["result"]) for row in shown]
    timed = [row for row in tables.times if (row["model"], row["result"]) in places]
    figures = {
        "parity.png": _parity(folder, places, quantity),
        "scores.png": _bars(shown, [_score(name) for name in names(tables.target)]),
        "times.png": _bars(timed, TIMES),
    }
    figures["scores.png"].axes[0].set_title(_said(tables, shown), fontsize=8, loc="left")
    return [save(figure, folder.path / name, dpi=DPI) for name, figure in figures.items()]


def _parity(folder: Folder, places: list[tuple[str, str]], quantity: str) -> Any:
    """Draw predictions over the truth, baseline and tuned, and the line of equality."""
    models = list(dict.fromkeys(model for model, _ in places))
    columns = min(3, len(models))
    rows = -(-len(models) // columns)
    figure = new_figure(3.6 * columns, 3.5 * rows)
    axes = np.atleast_1d(figure.subplots(rows, columns)).ravel()
    for model, axis in zip(models, axes, strict=False):
        kinds = [kind for name, kind in places if name == model]
        parity_axes(axis, folder.prediction(kinds[0], model)[0])
        for kind in kinds:
            truth, prediction = folder.prediction(kind, model)
            draw_parity(axis, truth, prediction, label=kind, color=COLOURS[kind], **DOTS[kind])
        axis.set(title=EVERY[model].title, xlabel=f"solved {quantity}", ylabel="predicted")
        axis.legend(markerscale=2, loc="upper left", fontsize=8)
    for axis in axes[len(models) :]:
        axis.set_axis_off()
    return figure


class Panel(NamedTuple):
    """What a panel of bars shows: a column, its title, and how its numbers are written."""

    column: str
    title: str
    form: str = "{:.2f}"
    of: Callable[[float], float] = float  # makes the height of a bar of the column's value
    log: bool = False


TIMES = [
    Panel("fit_s", "fit [s]", "{:.2g}", log=True),
    Panel("predict_test_s", "prediction of the test set [s]", "{:.2g}", log=True),
    Panel("predict_row_s", "of one row [s]", "{:.2g}", log=True),
]


def _score(name: str) -> Panel:
    """Return the panel of a score: of R2 what is left of it, since R2 of good models look alike."""
    if name == "r2":
        return Panel(name, "1 - R2 [%]", "{:.3g}", lambda value: 100 - value, log=True)
    return Panel(name, f"{SCORES[name]} [%]")


def _said(tables: Tables, shown: list[Row]) -> str:
    """Explain the whiskers and the nMSE, and name the models whose baseline won the search."""
    lines = []
    if tables.drawn:
        lines.append(f"whiskers: {100 * LEVEL:g} % bootstrap intervals, {tables.how_drawn}")
    won = [EVERY[row["model"]].title for row in shown if row["winner"] == "baseline"]
    if won:
        lines.append(f"tuned is the baseline, which won the search: {', '.join(won)}")
    if tables.target == OUR_AREA:
        lines.append(nmse_note(tables.spread))
    return "\n".join(textwrap.fill(line, 150) for line in lines)


def _bars(rows: list[Row], panels: list[Panel]) -> Any:
    """Draw a pair of bars for each model, baseline and tuned, in panels, with their intervals."""
    figure = new_figure(1.6 + 1.15 * len(MODELS), 2.3 * len(panels))
    axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    models = list(dict.fromkeys(row["model"] for row in rows))
    for axis, panel in zip(axes, panels, strict=True):
        for kind, shift in SHIFTS.items():
            own = [row for row in rows if row["result"] == kind]
            places = np.array([models.index(row["model"]) for row in own]) + shift
            heights = [panel.of(row[panel.column]) for row in own]
            if not own:
                continue
            bars = axis.bar(places, heights, 0.38, color=COLOURS[kind], label=kind)
            axis.bar_label(bars, [panel.form.format(height) for height in heights], fontsize=7)
            for place, height, row in zip(places, heights, own, strict=True):
                ends = [row.get(f"{panel.column}_{end}", "") for end in ("low", "high")]
                if "" not in ends:
                    low, high = sorted(map(panel.of, ends))
                    reach = [[max(height - low, 0.0)], [max(high - height, 0.0)]]
                    axis.errorbar(place + BESIDE, height, reach, color="0.2", lw=1, capsize=2)
        axis.set_xticks(range(len(models)), [EVERY[m].title.replace(" ", "\n") for m in models])
        axis.margins(y=0.2)
        axis.set(ylabel=panel.title, yscale="log" if panel.log else "linear")
    axes[0].legend(ncols=2, loc="lower right", bbox_to_anchor=(1, 1))
    return figure
