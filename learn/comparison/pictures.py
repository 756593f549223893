"""The pictures of a comparison, like the paper's figures 8 to 10."""

import textwrap
from pathlib import Path
from typing import Any

import numpy as np

from gen.runtime.figure import draw_parity, new_figure, parity_axes, save
from learn.comparison import tables
from learn.comparison.folder import Folder
from learn.comparison.tables import Intervals
from learn.metrics import LEVEL
from learn.models import MODELS

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

Place = tuple[str, str]
"""Model and kind of a result."""


def draw(folder: Folder) -> list[Path]:
    """Draw parity.png (like figures 8 and 10), scores.png and times.png (like figure 9).

    Nothing is drawn if the folder of the target has no results.
    """
    record, found = folder.record(), tables.intervals(folder)
    scored = [each for each in folder.results() if each[2].get("test") and each[1] in COLOURS]
    shown = {(model, kind): result for model, kind, result in scored}
    if found is None:
        return []
    target = str(record["conditions"]["target"])
    quantity = f"{target.replace('_percent', '')} [{record['unit']}]"
    figures = {
        "parity.png": _parity(folder, [*shown], quantity),
        "scores.png": _scores(found, shown, target),
        "times.png": _times(shown),
    }
    return [save(figure, folder.path / name, dpi=DPI) for name, figure in figures.items()]


def _parity(folder: Folder, places: list[Place], quantity: str) -> Any:
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
        axis.set(title=MODELS[model].title, xlabel=f"solved {quantity}", ylabel="predicted")
        axis.legend(markerscale=2, loc="upper left", fontsize=8)
    for axis in axes[len(models) :]:
        axis.set_axis_off()
    return figure


def _scores(found: Intervals, shown: dict[Place, dict[str, Any]], target: str) -> Any:
    """Draw every score of every model with its interval; the worst model fills the height."""
    wanted = tables.names(target)
    figure = new_figure(1.6 + 1.15 * len(MODELS), 2.3 * len(wanted))
    axes = figure.subplots(len(wanted), 1, sharex=True, squeeze=False)[:, 0]
    for name, axis in zip(wanted, axes, strict=True):
        unexplained = name == "r2"  # R2 of good models look alike
        values = {place: result["test"][name] for place, result in shown.items()}
        ends = {p: own[name] for p, own in found.of.items() if p in shown and name in own}
        if unexplained:
            values = {place: 100 - value for place, value in values.items()}
            ends = {place: (100 - high, 100 - low) for place, (low, high) in ends.items()}
        _bars(axis, values, "{:.3g}" if unexplained else "{:.2f}", ends)
        axis.set_ylabel("1 - R2 [%]" if unexplained else f"{tables.SCORES[name]} [%]")
        if unexplained:
            axis.set_yscale("log")
    axes[0].legend(ncols=2, loc="lower right", bbox_to_anchor=(1, 1))
    axes[0].set_title(_said(found, shown, target), fontsize=8, loc="left")
    return figure


def _said(found: Intervals, shown: dict[Place, dict[str, Any]], target: str) -> str:
    """Explain the whiskers and the nMSE, and name the models whose baseline won the search."""
    lines = []
    if any(found.of.values()):
        lines.append(f"whiskers: {100 * LEVEL:g} % bootstrap intervals, {found.in_words()}")
    searches = ((model, result.get("search") or {}) for (model, _), result in shown.items())
    won = [MODELS[model].title for model, each in searches if each.get("winner") == "baseline"]
    if won:
        lines.append(f"tuned is the baseline, which won the search: {', '.join(won)}")
    if target == tables.OUR_AREA:
        lines.append(tables.nmse_note(found.spread))
    return "\n".join(textwrap.fill(line, 150) for line in lines)


def _times(shown: dict[Place, dict[str, Any]]) -> Any:
    """Draw times of fit and prediction on a logarithmic axis."""
    titles = {"fit": "fit [s]", "test": "prediction of the test set [s]", "row": "of one row [s]"}
    figure = new_figure(1.6 + 1.15 * len(MODELS), 7)
    axes = figure.subplots(len(titles), 1, sharex=True)
    for (name, title), axis in zip(titles.items(), axes, strict=True):
        values = {place: result["times"][name] for place, result in shown.items()}
        _bars(axis, values, "{:.2g}", {})
        axis.set(ylabel=title, yscale="log")
    axes[0].legend(ncols=2, loc="lower right", bbox_to_anchor=(1, 1))
    return figure


def _bars(
    axis: Any, values: dict[Place, float], form: str, ends: dict[Place, tuple[float, float]]
) -> None:
    """Draw a pair of bars for each model, baseline and tuned, with the intervals of some."""
    models = list(dict.fromkeys(model for model, _ in values))
    for kind, shift in SHIFTS.items():
        there = [(models.index(m), value) for (m, each), value in values.items() if each == kind]
        if there:
            places, heights = zip(*there, strict=True)
            bars = axis.bar(
                np.array(places) + shift, heights, 0.38, color=COLOURS[kind], label=kind
            )
            axis.bar_label(bars, [form.format(height) for height in heights], fontsize=7)
    for (model, kind), (low, high) in ends.items():
        value = values[model, kind]
        reach = [[max(value - low, 0.0)], [max(high - value, 0.0)]]
        place = models.index(model) + SHIFTS[kind] + BESIDE
        axis.errorbar(place, value, reach, color="0.2", lw=1, capsize=2)
    axis.set_xticks(range(len(models)), [MODELS[m].title.replace(" ", "\n") for m in models])
    axis.margins(y=0.2)
