"""The tables of a comparison's searches: extent, decision, settings, and times of whole grids."""

from collections.abc import Iterator
from typing import Any, NamedTuple

from rich.table import Table

from learn.comparison import paper
from learn.comparison.folder import Folder
from learn.comparison.search.spaces import TABLE_2, WHOLE
from learn.models import MODELS

SEARCHED = {
    "how": "searched",
    "rows": "rows",
    "candidates": "candidates",
    "candidates_differing": "candidates_differing",
    "candidates_scored": "candidates_scored",
    "fits_nominal": "fits_nominal",
    "fits": "fits",
}
"""The extent of a search: its keys in a result, and its columns in tuning.csv."""

WINNERS = {
    "grid": "grid",
    "optimum": "the paper's optimum",
    "baseline": "the baseline",
}
"""Names of the winners' places in tables; an older folder has none."""

DECIDED = {
    "winner_r2": "r2_folds",
    "grid_r2": "grid_r2_folds",
    "optimum_r2": "optimum_r2_folds",
    "baseline_r2": "baseline_r2_folds",
}
"""Columns of tuning.csv, and the R2 over the folds of a result whose means [%] they are."""


class WholeGrid(NamedTuple):
    """The time of a whole grid [s] and its standard error; see `search.whole_grid.Cost`."""

    grid: str
    seconds: float
    error: float | None
    fits: int
    of: int
    rows: int


def rows(folder: Folder) -> Iterator[list[object]]:
    """Yield the lines of tuning.csv: model, grid, extent, decision and settings."""
    for model in MODELS:
        result = folder.result("tuned", model)
        if result and "search" in result:
            search = result["search"]
            extent = [search[name] for name in SEARCHED]
            winner, means = search.get("winner") or "", (_mean(search, n) for n in DECIDED.values())
            grid = search.get("grid", TABLE_2)
            yield [model, grid, *extent, winner, *means, settings(result)]


HEADER = ["model", "grid", *SEARCHED.values(), "winner", *DECIDED, "settings"]
"""Columns of tuning.csv."""


def _mean(search: dict[str, Any], name: str) -> float | str:
    """Return the mean R2 over the folds [%], "" where there is none."""
    folds = search.get(name) or []
    return sum(folds) / len(folds) if folds else ""


def time_rows(folder: Folder) -> Iterator[list[object]]:
    """Yield the lines of tuning-times.csv."""
    for model in MODELS:
        result = folder.result("tuned", model)
        if result and "times" in result:
            yield [model, result["times"]["search"], paper.TUNING_SECONDS[model]]


def settings(result: dict[str, Any]) -> str:
    """Return the settings of a result in one line; a baseline without any is named."""
    values = ", ".join(f"{name}={value}" for name, value in sorted(result["settings"].items()))
    return values or "those of the library"


def why_baseline(search: dict[str, Any]) -> str:
    """Say why the baseline is the winner of a search: it is better, or nothing else was judged.

    Parameters
    ----------
    search : dict
        Description of the search in its result.
    """
    if search.get("grid_r2_folds"):
        return "the baseline wins, no candidate is better over five folds of all rows"
    return "the baseline stays, no candidate was finished on five folds of all rows within the time"


def undecided(folder: Folder) -> list[str]:
    """Return the models whose winners no cross-validation on all rows has compared to the baseline.

    Folders hold such results where they are older than that rule.
    """
    found = {model: folder.result("tuned", model) or {} for model in MODELS}
    return [
        model
        for model, result in found.items()
        if "settings" in result and not result["search"].get("winner")
    ]


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
        found.add_row(
            MODELS[model].title,
            str(search.get("grid", TABLE_2)),
            str(search["how"]),
            WINNERS.get(search.get("winner"), "of few rows, see below"),
            settings(result),
            *(_number(_mean(search, name)) for name in ("r2_folds", "baseline_r2_folds")),
            str(search["candidates"]),
            str(search["candidates_differing"]),
            str(search["fits"]),
            str(search["fits_nominal"]),
            f"{seconds(result['times']['search'])}{theirs}",
        )
    return found


def _number(value: float | str) -> str:
    return f"{value:.2f}" if isinstance(value, float) else value


def seconds(value: float) -> str:
    """Return a time [s] as text."""
    return f"{value:.0f}" if value >= 1000 else f"{value:.3g}"


def grid_costs(folder: Folder) -> Iterator[tuple[str, WholeGrid]]:
    """Yield the models whose whole grids' times are known, and these times."""
    every = folder.record()["conditions"]["train_rows"]
    for model in MODELS:
        result = folder.result("tuned", model) or {}
        estimate = folder.result("whole-grid", model)
        search = result.get("search") or {}
        if search.get("how") == WHOLE:
            taken, fits = result["times"]["search"], search["fits"] + search.get("baseline_fits", 0)
            yield model, WholeGrid(search.get("grid", TABLE_2), taken, 0.0, fits, fits, every)
        elif estimate is not None:
            yield model, WholeGrid(**{"rows": every, **estimate})


def hours(seconds: float) -> str:
    """Return a time in hours as text, without an exponent.

    Parameters
    ----------
    seconds : float
        The time [s].
    """
    number = seconds / 3600
    return f"{number:.2g}" if number < 99.5 else f"{number:.0f}"


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
        error = "" if cost.error is None else f"{100 * cost.error / cost.seconds:.0f} %"
        table.add_row(
            MODELS[model].title,
            cost.grid,
            f"{hours(cost.seconds)}{theirs}",
            str(cost.of),
            str(cost.fits),
            str(cost.rows),
            "measured" if cost.fits == cost.of else error,
        )
    return table
