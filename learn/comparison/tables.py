"""The tables of a comparison, beside the paper's: printed, and written as CSV.

Scores and times go into separate files: the scores are the same for the same seeds whatever the
number of processes, the times are not.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from rich.markup import escape
from rich.table import Table

from gen.runtime.console import wide_console
from learn.comparison import paper
from learn.comparison.folder import KINDS, Folder
from learn.comparison.search.spaces import TABLE_2, WHOLE
from learn.models import MODELS

SCORES = {"nmse": "nMSE", "nmae": "nMAE", "nmaxe": "nMaxE", "r2": "R2"}
"""The four scores and their names in the paper [%]."""

OUR_AREA = "area_percent"
"""The target of the paper's tables: beside any other its numbers would mislead."""

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


class WholeGrid(NamedTuple):
    """The time of a whole grid [s] and its standard error; see `search.whole_grid.Cost`."""

    grid: str
    seconds: float
    error: float | None
    fits: int
    of: int
    rows: int


def names(target: str) -> list[str]:
    """Return the scores that are free of units for a target: nMSE is for the area only.

    Parameters
    ----------
    target : str
        Column of the target.
    """
    return [name for name in SCORES if name != "nmse" or target == OUR_AREA]


def improvement(baseline: float, tuned: float, name: str) -> float:
    """Return the improvement of a score by tuning [% of the baseline]; positive is better.

    Parameters
    ----------
    baseline, tuned : float
        The score before and after.
    name : str
        Name of the score.
    """
    change = 100 * (tuned - baseline) / abs(baseline) if baseline else 0.0
    return change if name == "r2" else 0.0 - change


def write(folder: Folder) -> list[Path]:
    """Write the tables of scores, times and searches into a folder.

    Parameters
    ----------
    folder : Folder
        The folder of a target.

    Returns
    -------
    list of Path
        scores.csv, times.csv, tuning.csv, tuning-times.csv and whole-grids.csv.
    """
    target = str(folder.record()["conditions"]["target"])
    header = ["model", "result", *names(target), *(f"train_{name}" for name in names(target))]
    paper_header = [f"paper_{name}" for name in names(target)] if target == OUR_AREA else []
    times = ["model", "result", "fit_s", "fits", "predict_test_s", "predict_row_s"]
    search = ["model", "grid", *SEARCHED.values(), "settings"]
    return [
        folder.write_table(
            "scores.csv", [*header, *paper_header, "failure"], _score_rows(folder, target)
        ),
        folder.write_table("times.csv", times, _time_rows(folder)),
        folder.write_table("tuning.csv", search, _search_rows(folder)),
        folder.write_table(
            "tuning-times.csv", ["model", "fit_seconds", "paper_s"], _search_time_rows(folder)
        ),
        folder.write_table(
            "whole-grids.csv",
            ["model", *WholeGrid._fields, "paper_s"],
            ([model, *cost, paper.TUNING_SECONDS[model]] for model, cost in _grid_costs(folder)),
        ),
    ]


def show(folder: Folder) -> None:
    """Print the tables of a folder.

    Parameters
    ----------
    folder : Folder
        The folder of a target.
    """
    record = folder.record()
    conditions = record["conditions"]
    console = wide_console(140)
    area_max = conditions["area_max"]
    limited = "" if area_max is None else f", areas to {area_max:g} %"
    console.print(
        f"{folder.path}: {conditions['target']}, {conditions['train_rows']} training rows,"
        f" {conditions['test_rows']} test rows{limited}; {record['threads']} thread",
        highlight=False,
    )
    console.print(_score_table(folder, str(conditions["target"])))
    if any(folder.result("tuned", model) for model in MODELS):
        console.print(_search_table(folder, str(conditions["target"])))
    if any(_grid_costs(folder)):
        console.print(_grid_cost_table(folder))
    for model, kind, result in results(folder):
        if result.get("failure"):
            text = f"{MODELS[model].title}, {kind}, failed: {result['failure']}"
            console.print(text, highlight=False, markup=False, soft_wrap=True)


def results(folder: Folder) -> Iterator[tuple[str, str, dict[str, Any]]]:
    """Yield model, kind and result of each result in a folder, in Table 4's order.

    Parameters
    ----------
    folder : Folder
        The folder of a target.
    """
    for model in MODELS:
        for kind in KINDS:
            result = folder.result(kind, model)
            if result is not None:
                yield model, kind, result


def _score_rows(folder: Folder, target: str) -> Iterator[list[object]]:
    """Yield the lines of scores.csv."""
    for model, kind, result in results(folder):
        row: list[object] = [model, kind]
        for part in ("test", "train"):
            scored = result.get(part) or {}
            row += [scored.get(name, "") for name in names(target)]
        if target == OUR_AREA:
            row += [getattr(paper.TEST[kind][model], name) for name in names(target)]
        yield [*row, result.get("failure", "")]


def _time_rows(folder: Folder) -> Iterator[list[object]]:
    """Yield the lines of times.csv."""
    for model, kind, result in results(folder):
        times = result.get("times")
        if times:
            yield [model, kind, times["fit"], times["fits"], times["test"], times["row"]]


def _search_rows(folder: Folder) -> Iterator[list[object]]:
    """Yield the lines of tuning.csv."""
    for model in MODELS:
        result = folder.result("tuned", model)
        if result and "search" in result:
            search = result["search"]
            extent = [search[name] for name in SEARCHED]
            yield [model, search.get("grid", TABLE_2), *extent, _settings(result)]


def _search_time_rows(folder: Folder) -> Iterator[list[object]]:
    """Yield the lines of tuning-times.csv."""
    for model in MODELS:
        result = folder.result("tuned", model)
        if result and "times" in result:
            yield [model, result["times"]["search"], paper.TUNING_SECONDS[model]]


def _settings(result: dict[str, Any]) -> str:
    """Return the settings of a result in one line."""
    return ", ".join(f"{name}={value}" for name, value in sorted(result["settings"].items()))


def _score_table(folder: Folder, target: str) -> Table:
    """Return a table like Table 4, with the paper's numbers in brackets."""
    table = Table(
        title=escape("Scores on the test rows [%] and times [s]; the paper's in brackets")
    )
    for column in ("Model", "", *(SCORES[name] for name in names(target))):
        table.add_column(column, justify="left" if column in {"Model", ""} else "right")
    for column in ("fit", "test set", "one row"):
        table.add_column(column, justify="right")
    for model in MODELS:
        both = [folder.result(kind, model) for kind in KINDS]
        for kind, result in zip(KINDS, both, strict=True):
            if result is not None:
                table.add_row(*_score_cells(model, kind, result, target))
        scored = [result["test"] for result in both if result and result.get("test")]
        if len(scored) == len(KINDS):
            better = [
                f"{improvement(scored[0][name], scored[1][name], name):+.2f} %"
                for name in names(target)
            ]
            table.add_row(MODELS[model].title, "improvement", *better, "", "", "")
        if any(both):
            table.add_section()
    return table


def _score_cells(model: str, kind: str, result: dict[str, Any], target: str) -> list[str]:
    """Return a line of this table."""
    cells = [MODELS[model].title, kind]
    scored, times = result.get("test"), result.get("times") or {}
    if not scored:
        return [*cells, "failed"]
    beside = target == OUR_AREA
    for name in names(target):
        theirs = f" ({getattr(paper.TEST[kind][model], name):.2f})" if beside else ""
        cells.append(f"{scored[name]:.2f}{theirs}")
    fit, test = paper.TIMES[kind][model]
    their_fit, their_test = (f" ({fit:.3g})", f" ({test:.3g})") if beside else ("", "")
    return [
        *cells,
        f"{_seconds(times['fit'])}{their_fit}",
        f"{_seconds(times['test'])}{their_test}",
        _seconds(times["row"]),
    ]


def _seconds(value: float) -> str:
    return f"{value:.0f}" if value >= 1000 else f"{value:.3g}"


def _search_table(folder: Folder, target: str) -> Table:
    """Return a table like Table 3, with the extent of the searches."""
    table = Table(
        title=escape("Searches: sum of the fits' times [s]; the paper's tuning time in brackets")
    )
    for column in ("Model", "Grid", "Searched", "Best settings"):
        table.add_column(column)
    for column in ("candidates", "differ", "fits", "of", "time"):
        table.add_column(column, justify="right")
    for model, kind, result in results(folder):
        if kind != "tuned":
            continue
        search = result.get("search")
        if not search:
            table.add_row(MODELS[model].title, "failed")
            continue
        theirs = f" ({paper.TUNING_SECONDS[model]:.0f})" if target == OUR_AREA else ""
        table.add_row(
            MODELS[model].title,
            str(search.get("grid", TABLE_2)),
            str(search["how"]),
            _settings(result),
            str(search["candidates"]),
            str(search["candidates_differing"]),
            str(search["fits"]),
            str(search["fits_nominal"]),
            f"{_seconds(result['times']['search'])}{theirs}",
        )
    return table


def _grid_costs(folder: Folder) -> Iterator[tuple[str, WholeGrid]]:
    """Yield the models whose whole grids' times are known, and these times."""
    every = folder.record()["conditions"]["train_rows"]
    for model in MODELS:
        result = folder.result("tuned", model) or {}
        estimate = folder.result("whole-grid", model)
        search = result.get("search") or {}
        if search.get("how") == WHOLE:
            seconds, fits = result["times"]["search"], search["fits"]
            yield model, WholeGrid(search.get("grid", TABLE_2), seconds, 0.0, fits, fits, every)
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


def _grid_cost_table(folder: Folder) -> Table:
    """Return a table of the times of whole grids on one thread [h]."""
    table = Table(
        title=escape("Whole grids, one fit after the other on one thread; the paper's in brackets")
    )
    table.add_column("Model")
    table.add_column("Grid")
    for column in ("time [h]", "fits", "timed on all rows", "on rows up to", "relative error"):
        table.add_column(escape(column), justify="right")
    for model, cost in _grid_costs(folder):
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
