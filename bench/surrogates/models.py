"""Error of the nine models against the time that predictions, fits and searches take.

Read from a folder of `learn compare` and `learn tune`, whose fits were timed alone, on one thread.
"""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from bench.files import read_table
from bench.picture import STYLES, new_figure
from bench.report import Report
from gen.runtime.errors import InputError
from gen.runtime.figure import log_axis
from learn.models import MODELS

TIMES = {
    "predict_s": "one prediction, alone [s]",
    "fit_s": "a fit [s]",
    "search_s": "the search's fits [s]",
}
"""Kinds of run time, by column, as they stand below the axes; None where there is none."""

# A model with its result (`baseline` or `tuned`), errors on the test rows, times and fronts.
Cost = Mapping[str, Any]


def models(comparison: Path, target: str = "area") -> Report:
    """Set errors against times; the arguments are those of `costs`."""
    found = costs(comparison, target)
    return Report({"models": [dict(each) for each in found]}, pictures={"models": picture(found)})


def costs(comparison: Path, target: str = "area") -> Sequence[Cost]:
    """Read errors and times of all models that a comparison has results of, in Table 4's order.

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
    found: list[dict[str, Any]] = []
    for row in scores:
        key = row["model"], row["result"]
        if key in timed and not row["failure"]:
            errors = {name: float(row[name]) for name in ("nmae", "r2")}
            answer, fit = (float(timed[key][name]) for name in ("predict_row_s", "fit_s"))
            spent = {"predict_s": answer, "fit_s": fit, "search_s": searched.get(key)}
            found.append({"model": key[0], "result": key[1], **errors, **spent})
    if not found:
        raise InputError(f"{comparison}: has no scores and times of {target}; run learn compare")
    fronts = {time.removesuffix("_s"): front(found, time) for time in TIMES}
    for cost in found:
        cost["front"] = " ".join(name for name, best in fronts.items() if cost in best)
    return found


def front(costs: Iterable[Cost], time: str) -> list[Cost]:
    """Return those that no other beats in both error and a time, the fastest first."""
    kept: list[Cost] = []
    known = (cost for cost in costs if cost[time] is not None)
    for cost in sorted(known, key=lambda cost: (cost[time], cost["nmae"])):
        if not kept or cost["nmae"] < kept[-1]["nmae"]:
            kept.append(cost)
    return kept


def picture(found: Sequence[Cost]) -> Any:
    """Draw a panel for each kind of time; a colour and a marker for each model."""
    figure = new_figure(12, 4.8)
    shown = [time for time in TIMES if any(cost[time] is not None for cost in found)]
    panels = figure.subplots(1, len(shown), sharey=True, squeeze=False)[0]
    for panel, time in zip(panels, shown, strict=True):
        known = [cost for cost in found if cost[time] is not None]
        for cost in known:
            fill = "full" if cost["result"] == "tuned" else "none"
            panel.plot(cost[time], cost["nmae"], fillstyle=fill, **_style(cost["model"]))
        best = front(known, time)
        x, y = [cost[time] for cost in best], [cost["nmae"] for cost in best]
        slowest = max(cost[time] for cost in known)
        panel.step([*x, slowest], [*y, y[-1]], where="post", color="0.5", lw=1, zorder=0)
        panel.set_xlabel(TIMES[time])
        log_axis(panel.xaxis)
        log_axis(panel.yaxis)
        panel.grid(visible=True, color="0.92")
    panels[0].set_ylabel("test error nMAE [%]")
    title = "hollow: library settings; filled: tuned; grey: Pareto front"
    figure.suptitle(title, fontsize="medium")
    for model in dict.fromkeys(cost["model"] for cost in found):
        panels[0].plot([], [], label=MODELS[model].title, **_style(model))
    figure.legend(loc="outside lower center", ncols=5)
    return figure


def _style(model: str) -> dict[str, Any]:
    """Return colour and marker of a model; a cross cannot be hollow."""
    style = STYLES[list(MODELS).index(model)]
    marker = "X" if style["marker"] == "x" else style["marker"]
    return {**style, "marker": marker, "markersize": 8, "linestyle": "none"}
