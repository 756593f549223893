"""The models in pictures: predictions over truth, scores and times, the paper's beside ours."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bench.contents import Content
from bench.files import write_table
from bench.paper.models import Shown, opened, results
from bench.paper.texts import DIGITS, picture
from bench.picture import COLOURS, new_figure
from gen.runtime.figure import draw_parity, parity_axes
from learn.comparison import paper, tables
from learn.comparison.folder import Folder
from learn.comparison.pictures import DOTS
from learn.models import MODELS

# Times of Table 4, in its order.
TIMES = {"fit": "fit [s]", "test": "prediction of\nall test rows [s]"}


def baselines(folder: Path, comparison: Path) -> list[Content]:
    """Draw predictions, scores and times of the baselines (section 4.1)."""
    return predictions(folder, comparison, "baseline") + bars(folder, comparison)


def tuned(folder: Path, comparison: Path) -> list[Content]:
    """Draw predictions of the tuned models beside the baselines' (section 4.2)."""
    return predictions(folder, comparison, "tuned")


def predictions(folder: Path, comparison: Path, kind: str) -> list[Content]:
    """Draw predictions over truth; nothing where the comparison has no result of this kind."""
    ours = opened(comparison)
    shown = results(ours, kind)
    if not shown:
        return []
    kinds = ("baseline",) if kind == "baseline" else ("baseline", "tuned")
    columns = min(3, len(shown))
    lines = -(-len(shown) // columns)
    figure = new_figure(max(3.5 * columns, 4.6), 3.1 * lines + 0.4)
    axes = figure.subplots(lines, columns, squeeze=False).ravel()
    rows: list[tuple[object, ...]] = []
    for model, axis in zip(shown, axes, strict=False):
        for each in kinds:
            if ours.result(each, model):
                rows += _draw_prediction(axis, ours, each, model)
        axis.set_title(MODELS[model].title, fontsize=10)
    for axis in axes[len(shown) :]:
        axis.set_axis_off()
    figure.supxlabel("solved area [%]", fontsize=10)
    figure.supylabel("predicted area [%]", fontsize=10)
    header = ("model", "result", "solved", "predicted")
    path = write_table(folder / f"predictions-{kind}.csv", header, rows, digits=5)
    section = "4.1, baselines" if kind == "baseline" else "4.2, tuned models beside baselines"
    said = {"section": section, **_seen(ours, kind, shown)}
    return [picture(folder, f"predictions-{kind}", figure, path, shows="predictions", **said)]


def _seen(folder: Folder, kind: str, shown: Shown) -> dict[str, str]:
    """Say which model is closest here and in the paper, and which predict areas that cannot be."""
    best = max(shown, key=lambda model: float(shown[model]["test"]["r2"]))
    theirs = max(shown, key=lambda model: paper.TEST[kind][model].r2)
    negative = {m: 100 * float((folder.prediction(kind, m)[1] < 0).mean()) for m in shown}
    below = [f"{MODELS[m].title} ({p:.0f} % of the rows)" for m, p in negative.items() if p >= 1]
    titles = {"best": MODELS[best].title, "theirs": MODELS[theirs].title}
    return {**titles, "below": ", ".join(below) or "hardly any"}


def _draw_prediction(axis: Any, folder: Folder, kind: str, model: str) -> list[tuple[object, ...]]:
    """Draw dots for a model; return its rows for the table."""
    truth, predicted = folder.prediction(kind, model)
    result = folder.result(kind, model) or {}
    colour = COLOURS[0] if kind == "baseline" else COLOURS[1]
    label = f"{kind}: R² {result['test']['r2']:.2f} %\n(paper's {paper.TEST[kind][model].r2:.2f} %)"
    if not axis.lines:
        parity_axes(axis, truth)
    draw_parity(axis, truth, predicted, label=label, color=colour, **DOTS[kind])
    axis.legend(loc="lower right", fontsize=7, markerscale=2, framealpha=0.9)
    return [(model, kind, *pair) for pair in zip(truth, predicted, strict=True)]


def bars(folder: Path, comparison: Path) -> list[Content]:
    """Draw scores and times of the baselines as bars, the paper's beside ours, if there are any."""
    shown, theirs = results(opened(comparison), "baseline"), paper.TEST["baseline"]
    if not shown:
        return []
    models = list(shown)
    figure = new_figure(max(7.5, 2.2 + len(models)), 10.5)
    axes = figure.subplots(len(tables.SCORES) + 2, 1, sharex=True)
    rows: list[tuple[object, ...]] = []
    for axis, (name, title) in zip(axes, tables.SCORES.items(), strict=False):
        ours = [shown[model]["test"][name] for model in models]
        published = [getattr(theirs[model], name) for model in models]
        rows += _draw_bars(axis, f"{title.replace('R2', 'R²')} [%]", models, ours, published)
    for place, (name, title) in enumerate(TIMES.items()):
        axis = axes[len(tables.SCORES) + place]
        ours = [(shown[model].get("times") or {}).get(name) for model in models]
        published = [paper.TIMES["baseline"][model][place] for model in models]
        rows += _draw_bars(axis, title, models, ours, published)
        _on_log_axis(axis)
    names = [MODELS[model].title.replace(" ", "\n") for model in models]
    axes[-1].set_xticks(range(len(models)), names)
    axes[0].legend(ncols=2, loc="lower right", bbox_to_anchor=(1, 1), fontsize=9)
    header = ("model", "quantity", "ours", "paper")
    path = write_table(folder / "bars.csv", header, rows, DIGITS)
    return [picture(folder, "bars", figure, path)]


def _on_log_axis(axis: Any) -> None:
    """Let bars have a logarithmic axis, with room for their numbers."""
    axis.set_yscale("log")
    low, high = axis.get_ylim()
    axis.set_ylim(low / 2, high * 6)


def _draw_bars(
    axis: Any, title: str, models: Sequence[str], ours: Sequence[Any], theirs: Sequence[float]
) -> list[tuple[object, ...]]:
    """Draw two bars a model, 100 - R² for R²; return the rows for the table."""
    unexplained = "R²" in title  # R² of good models look alike
    known = [np.nan if value is None else float(value) for value in ours]
    hatched = {"color": COLOURS[4], "hatch": "///", "edgecolor": "w"}
    for shift, values, label, style in (
        (-0.2, known, "ours", {"color": COLOURS[0]}),
        (0.2, theirs, "the paper's", hatched),
    ):
        heights = [100 - value for value in values] if unexplained else values
        drawn = axis.bar(np.arange(len(models)) + shift, heights, 0.38, label=label, **style)
        axis.bar_label(drawn, [f"{height:.3g}" for height in heights], fontsize=7, padding=1)
    axis.set_ylabel(title.replace("R²", "1 - R²"), fontsize=9)
    axis.margins(y=0.25)
    if unexplained:
        _on_log_axis(axis)
    quantity = title.replace("\n", " ")
    return [(model, quantity, *pair) for model, *pair in zip(models, known, theirs, strict=True)]
