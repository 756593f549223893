"""The tables of a comparison's searches: extent, decision, settings, and times of whole grids."""

from collections.abc import Iterator
from typing import Any

from rich.table import Table

from learn.comparison import paper
from learn.comparison.folder import Folder
from learn.comparison.grid import TABLE_2, WHOLE
from learn.models import MODELS

EXTENT = ["rows", "candidates", "candidates_differing", "candidates_scored", "fits_nominal", "fits"]
"""The extent of a search: keys of a result, and columns of tuning.csv."""

WINNERS = {"grid": "grid", "optimum": "the paper's optimum", "baseline": "the baseline"}
"""Names of the winners' places in tables."""

DECIDED = {
    "winner_r2": "r2_folds",
    "grid_r2": "grid_r2_folds",
    "optimum_r2": "optimum_r2_folds",
    "baseline_r2": "baseline_r2_folds",
}
"""Columns of tuning.csv, and the R2 over the folds of a result whose means [%] they are."""

COST = ["grid", "seconds", "error", "fits", "of", "rows"]
"""The time of a whole grid: keys of its file, and columns of whole-grids.csv."""


def files(folder: Folder) -> dict[str, tuple[list[str], list[list[object]]]]:
    """Return the columns and lines of the tables of searches (CSV), by their names."""
    extents, times = [], []
    for model in MODELS:
        result = folder.result("tuned", model)
        if result and "search" in result:
            search = result["search"]
            extent = [search.get("grid", TABLE_2), *(search[name] for name in ("how", *EXTENT))]
            means = [_mean(search, name) for name in DECIDED.values()]
            winner = search.get("winner") or ""
            extents.append([model, *extent, winner, *means, settings(result)])
            times.append([model, result["times"]["search"], paper.TUNING_SECONDS[model]])
    costs = [
        [model, *(cost[name] for name in COST), paper.TUNING_SECONDS[model]]
        for model, cost in grid_costs(folder)
    ]
    header = ["model", "grid", "searched", *EXTENT, "winner", *DECIDED, "settings"]
    return {
        "tuning.csv": (header, extents),
        "tuning-times.csv": (["model", "fit_seconds", "paper_s"], times),
        "whole-grids.csv": (["model", *COST, "paper_s"], costs),
    }


def _mean(search: dict[str, Any], name: str) -> float | str:
    """Return the mean R2 over the folds [%], "" where there is none."""
    folds = search.get(name) or []
    return sum(folds) / len(folds) if folds else ""


def settings(result: dict[str, Any]) -> str:
    """Return the settings of a result in one line; a baseline without any is named."""
    values = ", ".join(f"{name}={value}" for name, value in sorted(result["settings"].items()))
    return values or "those of the library"


def why_baseline(search: dict[str, Any]) -> str:
    """Say why the baseline is the winner of a search, by the description in its result."""
    if search.get("grid_r2_folds"):
        return "the baseline wins, no candidate is better over five folds of all rows"
    return "the baseline stays, no candidate was finished on five folds of all rows within the time"


def table(folder: Folder, beside: bool) -> Table:
    """Return a table like Table 3, with the extent of the searches and their winners.

    Parameters
    ----------
    folder : Folder
        The folder of a target.
    beside : bool
        Whether the paper's times stand beside ours.
    """
    found = Table(
        title=(
            "Searches: means of R2 over the five folds of all rows [%], which decide; sum of the"
            " fits' times [s], the paper's tuning time in brackets"
        )
    )
    for column in ("Model", "Grid", "Searched", "Winner", "Best settings"):
        found.add_column(column)
    for column in ("R2", "baseline", "candidates", "differ", "fits", "of", "time"):
        found.add_column(column, justify="right")
    for model in MODELS:
        result = folder.result("tuned", model)
        if result is None:
            continue
        search = result.get("search")
        if not search:
            found.add_row(MODELS[model].title, "failed")
            continue
        theirs = f" ({paper.TUNING_SECONDS[model]:.0f})" if beside else ""
        means = [_mean(search, name) for name in ("r2_folds", "baseline_r2_folds")]
        found.add_row(
            MODELS[model].title,
            str(search.get("grid", TABLE_2)),
            str(search["how"]),
            WINNERS.get(search.get("winner"), ""),
            settings(result),
            *(f"{mean:.2f}" if isinstance(mean, float) else mean for mean in means),
            *(str(search[name]) for name in ("candidates", "candidates_differing")),
            *(str(search[name]) for name in ("fits", "fits_nominal")),
            f"{seconds(result['times']['search'])}{theirs}",
        )
    return found


def seconds(value: float) -> str:
    """Return a time [s] as text."""
    return f"{value:.0f}" if value >= 1000 else f"{value:.3g}"


def hours(seconds: float) -> str:
    """Return a time [s] in hours as text, without an exponent."""
    number = seconds / 3600
    return f"{number:.2g}" if number < 99.5 else f"{number:.0f}"


def grid_costs(folder: Folder) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the models whose whole grids' times are known, and these times by `COST`."""
    every = folder.record()["conditions"]["train_rows"]
    for model in MODELS:
        result = folder.result("tuned", model) or {}
        estimate = folder.result("whole-grid", model)
        search = result.get("search") or {}
        if search.get("how") == WHOLE:
            taken, fits = result["times"]["search"], search["fits"] + search.get("baseline_fits", 0)
            cost = [search.get("grid", TABLE_2), taken, 0.0, fits, fits, every]
            yield model, dict(zip(COST, cost, strict=True))
        elif estimate is not None:
            yield model, {"rows": every, **estimate}


def grid_cost_table(folder: Folder) -> Table:
    """Return a table of the times of whole grids on one thread [h]."""
    table = Table(
        title="Whole grids, one fit after the other on one thread; the paper's in brackets"
    )
    table.add_column("Model")
    table.add_column("Grid")
    for column in ("time [h]", "fits", "timed on all rows", "on rows up to", "relative error"):
        table.add_column(column, justify="right")
    for model, cost in grid_costs(folder):
        theirs = f" ({hours(paper.TUNING_SECONDS[model])})"
        error = "" if cost["error"] is None else f"{100 * cost['error'] / cost['seconds']:.0f} %"
        table.add_row(
            MODELS[model].title,
            cost["grid"],
            f"{hours(cost['seconds'])}{theirs}",
            *(str(cost[name]) for name in ("of", "fits", "rows")),
            "measured" if cost["fits"] == cost["of"] else error,
        )
    return table
