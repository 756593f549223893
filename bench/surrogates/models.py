"""Error of the nine models against the time that predictions, fits and searches take.

Read from a folder of `learn compare` and `learn tune`, whose fits were timed alone, on one thread.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from bench.page.content import Content, Figure, Table
from bench.picture import new_figure
from bench.report import Report
from bench.style import STYLES
from bench.table import read_table
from gen.runtime.errors import InputError
from learn.models import MODELS

TIMES = {
    "predict_s": "one prediction, alone [s]",
    "fit_s": "a fit [s]",
    "search_s": "the search's fits [s]",
}
"""Kinds of run time, by column, as they stand below the axes."""

AREA = "area"


@dataclass(frozen=True)
class Cost:
    """What a model is worth and what it takes.

    Attributes
    ----------
    model, result : which, and `baseline` or `tuned`
    nmae, r2 : on the test rows [%]
    predict_s, fit_s : one row predicted alone, and the fit to all training rows [s]
    search_s : all fits of the search [s]; None without one
    front : names of the times for which nothing else is both faster and more exact
    """

    model: str
    result: str
    nmae: float
    r2: float
    predict_s: float
    fit_s: float
    search_s: float | None
    front: str = ""


def costs(comparison: Path, target: str = AREA) -> list[Cost]:
    """Read errors and times of all models that a comparison has results of, in Table 4's order.

    Parameters
    ----------
    comparison : folder of `learn compare` and `learn tune`
    target : `area` or `force`

    Raises
    ------
    InputError
        If the folder has no scores and times.
    """
    try:
        scores, times, searches = (
            read_table(comparison / target / name)[1]
            for name in ("scores.csv", "times.csv", "tuning-times.csv")
        )
    except InputError as error:
        raise InputError(f"{error}; give a folder of learn compare or learn tune") from None
    timed = {(row["model"], row["result"]): row for row in times}
    searched = {(row["model"], "tuned"): float(row["fit_seconds"]) for row in searches}
    found = [
        Cost(
            *key,
            nmae=float(row["nmae"]),
            r2=float(row["r2"]),
            predict_s=float(timed[key]["predict_row_s"]),
            fit_s=float(timed[key]["fit_s"]),
            search_s=searched.get(key),
        )
        for row in scores
        if (key := (row["model"], row["result"])) in timed and not row["failure"]
    ]
    if not found:
        raise InputError(f"{comparison}: has no scores and times of {target}; run learn compare")
    return [_marked(cost, found) for cost in found]


def front(points: Iterable[Cost], time: str) -> list[Cost]:
    """Return the points that no other beats in both error and time, fastest first.

    Parameters
    ----------
    points : of which
    time : name of a time of `Cost`; points without it take no part
    """
    kept: list[Cost] = []
    known = (point for point in points if getattr(point, time) is not None)
    for point in sorted(known, key=lambda point: (getattr(point, time), point.nmae)):
        if not kept or point.nmae < kept[-1].nmae:
            kept.append(point)
    return kept


def report(found: Sequence[Cost]) -> Report:
    """Make a report of errors and times."""
    return Report({"models": found}, pictures={"models": _picture(found)})


def contents(folder: Path) -> list[Content]:
    """List what a folder of this report holds, with what to see in it."""
    return [
        Figure(
            folder / "models.png",
            "Test error of the nine models over the time that one prediction, a fit and a search"
            " of the hyperparameters take; filled dots are tuned, hollow ones have their"
            " libraries' settings. The line is the Pareto front: whatever lies above it is both"
            " slower and less accurate than something else.",
            data=(folder / "models.csv",),
        ),
        Table(folder / "models.csv", "The same as numbers; times in seconds, error nMAE in %."),
    ]


def _marked(cost: Cost, found: Sequence[Cost]) -> Cost:
    """Add the names of the times whose fronts it is on."""
    on = [name.removesuffix("_s") for name in TIMES if cost in front(found, name)]
    return replace(cost, front=" ".join(on))


def _picture(found: Sequence[Cost]) -> Any:
    """A panel for each kind of time; a colour and a marker for each model."""
    figure = new_figure(12, 4.8)
    shown = [time for time in TIMES if any(getattr(cost, time) is not None for cost in found)]
    panels = figure.subplots(1, len(shown), sharey=True, squeeze=False)[0]
    for panel, time in zip(panels, shown, strict=True):
        known = [cost for cost in found if getattr(cost, time) is not None]
        for cost in known:
            fill = "full" if cost.result == "tuned" else "none"
            panel.plot(getattr(cost, time), cost.nmae, fillstyle=fill, **_style(cost.model))
        best = front(known, time)
        x, y = [getattr(cost, time) for cost in best], [cost.nmae for cost in best]
        slowest = max(getattr(cost, time) for cost in known)
        panel.step([*x, slowest], [*y, y[-1]], where="post", color="0.5", lw=1, zorder=0)
        panel.set(xscale="log", yscale="log", xlabel=TIMES[time])
        panel.yaxis.set_major_formatter("{x:g}")
        panel.yaxis.set_minor_formatter("{x:g}")
        panel.grid(visible=True, color="0.92")
    panels[0].set_ylabel("test error nMAE [%]")
    figure.suptitle(
        "hollow: library settings; filled: tuned; grey: Pareto front", fontsize="medium"
    )
    for model in dict.fromkeys(cost.model for cost in found):
        panels[0].plot([], [], label=MODELS[model].title, **_style(model))
    figure.legend(loc="outside lower center", ncols=5)
    return figure


def _style(model: str) -> dict[str, Any]:
    """Colour and marker."""
    style = {**STYLES[list(MODELS).index(model)], "markersize": 8, "linestyle": "none"}
    if style["marker"] == "x":  # which cannot be hollow
        style["marker"] = "X"
    return style
