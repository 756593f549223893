"""Error of the nine models against the time that predictions, fits and searches take.

Read from a folder of `learn compare` and `learn tune`, whose fits were timed alone, on one thread.
"""

import csv
from collections.abc import Iterable, Sequence
from dataclasses import astuple, dataclass, fields, replace
from pathlib import Path
from typing import Any

from bench.page.content import Content, Figure, Table
from bench.picture import new_figure, save
from bench.style import STYLES
from bench.table import write_table
from gen.runtime.errors import InputError
from gen.runtime.input_file import require_file
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
    """Read errors and times of all models that a comparison has results of.

    Parameters
    ----------
    comparison : folder of `learn compare` and `learn tune`
    target : `area` or `force`

    Returns
    -------
    In Table 4's order

    Raises
    ------
    InputError
        If the folder has no scores and times.
    """
    folder = comparison / target
    scores, times = _table(folder / "scores.csv"), _table(folder / "times.csv")
    searches = {row["model"]: row for row in _table(folder / "tuning-times.csv")}
    timed = {(row["model"], row["result"]): row for row in times}
    found = []
    for row in scores:
        time = timed.get((row["model"], row["result"]))
        if row["failure"] or time is None:
            continue
        search = searches.get(row["model"]) if row["result"] == "tuned" else None
        found.append(
            Cost(
                model=row["model"],
                result=row["result"],
                nmae=float(row["nmae"]),
                r2=float(row["r2"]),
                predict_s=float(time["predict_row_s"]),
                fit_s=float(time["fit_s"]),
                search_s=float(search["fit_seconds"]) if search else None,
            )
        )
    if not found:
        raise InputError(f"{comparison}: has no scores and times of {target}; run learn compare")
    return [_marked(cost, found) for cost in found]


def front(points: Iterable[Cost], time: str) -> list[Cost]:
    """Those that no other beats in both error and time, fastest first.

    Parameters
    ----------
    points : of which
    time : name of a time of `Cost`; points without it take no part
    """
    best = float("inf")
    kept = []
    known = (point for point in points if getattr(point, time) is not None)
    for point in sorted(known, key=lambda point: (getattr(point, time), point.nmae)):
        if point.nmae < best:
            best = point.nmae
            kept.append(point)
    return kept


def write_report(folder: Path, found: Sequence[Cost]) -> list[Path]:
    """Write `models.csv` and `models.png`.

    Raises
    ------
    InputError
        If the folder cannot be written to, or matplotlib is not installed.
    """
    names = [field.name for field in fields(Cost)]
    picture = _picture(found)
    table = write_table(folder / "models.csv", names, map(astuple, found))
    return [table, save(picture, folder / "models.png")]


def contents(folder: Path) -> list[Content]:
    """List what a page shows of a folder that `write_report` has written."""
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
    """With the times whose fronts it is on."""
    on = [name.removesuffix("_s") for name in TIMES if cost in front(found, name)]
    return replace(cost, front=" ".join(on))


def _table(path: Path) -> list[dict[str, str]]:
    require_file(path)
    try:
        with path.open(encoding="utf-8", newline="") as file:
            return list(csv.DictReader(file))
    except OSError as error:
        raise InputError(
            f"{path}: {error.strerror or error}; give a folder of learn compare or learn tune"
        ) from None


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
