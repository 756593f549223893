"""The tables of a comparison, beside the paper's: printed, and written as CSV.

Scores and times go into separate files: the scores are the same for the same seeds whatever the
number of processes, the times are not.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rich.table import Table

from gen.runtime.terminal import echo, print_table, to_type
from learn.comparison import intervals, paper, search_tables
from learn.comparison.folder import KINDS, Folder
from learn.comparison.intervals import Intervals
from learn.metrics import no_better
from learn.models import MODELS

SCORES = {"nmse": "nMSE", "nmae": "nMAE", "nmaxe": "nMaxE", "r2": "R2"}
"""The four scores and their names in the paper [%]."""

WIDTH = 150
"""Width of the tables without a terminal [characters]."""

OUR_AREA = "area_percent"
"""The target of the paper's tables: beside any other its numbers would mislead."""


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
    ends = [f"{name}_{end}" for name in _bounded(target) for end in ("low", "high")]
    more = ["winner", *ends, "level", "resamples", "drawn", "variance_over_mean"]
    times = ["model", "result", "fit_s", "fits", "predict_test_s", "predict_row_s"]
    return [
        folder.write_table(
            "scores.csv", [*header, *paper_header, "failure", *more], _score_rows(folder, target)
        ),
        folder.write_table("times.csv", times, _time_rows(folder)),
        folder.write_table("tuning.csv", search_tables.HEADER, search_tables.rows(folder)),
        folder.write_table(
            "tuning-times.csv",
            ["model", "fit_seconds", "paper_s"],
            search_tables.time_rows(folder),
        ),
        folder.write_table(
            "whole-grids.csv",
            ["model", *search_tables.WholeGrid._fields, "paper_s"],
            (
                [model, *cost, paper.TUNING_SECONDS[model]]
                for model, cost in search_tables.grid_costs(folder)
            ),
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
    area_max = conditions["area_max"]
    limited = "" if area_max is None else f", areas to {area_max:g} %"
    echo(
        f"{folder.path}: {conditions['target']}, {conditions['train_rows']} training rows,"
        f" {conditions['test_rows']} test rows{limited}; {record['threads']} thread",
    )
    target = str(conditions["target"])
    print_table(_score_table(folder, target), WIDTH)
    _show_uncertainty(folder, target)
    if any(folder.result("tuned", model) for model in MODELS):
        print_table(search_tables.table(folder, beside=target == OUR_AREA), WIDTH)
    if any(search_tables.grid_costs(folder)):
        print_table(search_tables.grid_cost_table(folder), WIDTH)
    for line in _remarks(folder):
        echo(line)


def _show_uncertainty(folder: Folder, target: str) -> None:
    """Print the intervals of the scores, and explain the nMSE."""
    found = intervals.of(folder)
    if found is None:
        return
    if found.of:
        print_table(_interval_table(found, target), WIDTH)
    elif not found.drawn:
        again = to_type(f"learn compare DATABASE -o {folder.path.parent}")
        line = f"no intervals: rows.csv is older than they are and names no surfaces: {again}"
        echo(line)
    if target == OUR_AREA:
        echo(nmse_note(found.spread))


def nmse_note(spread: float) -> str:
    """Explain the nMSE by the R2 that it is computed from.

    Parameters
    ----------
    spread : float
        Variance of the solved areas of the test rows over their mean [%].
    """
    return (
        "nMSE has the target's unit: it is (1 - R2) times the variance of the test rows' areas over"
        f" their mean, {spread:.2g} % of area here and {paper.SPREAD:.2g} % in the paper. At the"
        f" same R2 the nMSE is {spread / paper.SPREAD:.2g} times the paper's: compare R2."
    )


def no_better_than_constant(folder: Folder) -> Iterator[tuple[str, str, str]]:
    """Yield the models and kinds of results that a constant predicts as well, and say so."""
    for model, kind, result in folder.results():
        said = no_better(result["test"]["r2"]) if result.get("test") else ""
        if said:
            yield model, kind, f"{MODELS[model].title}, {kind}: {said}"


def _remarks(folder: Folder) -> Iterator[str]:
    """Yield the lines below the tables: useless models, baselines that won, older searches."""
    for *_, said in no_better_than_constant(folder):
        yield f"warning: {said}"
    for model, kind, result in folder.results():
        if result.get("failure"):
            yield f"{MODELS[model].title}, {kind}, failed: {result['failure']}"
        elif kind == "tuned" and result["search"].get("winner") == "baseline":
            yield f"{MODELS[model].title}: {search_tables.why_baseline(result['search'])}"
    older = search_tables.undecided(folder)
    if older:
        again = f"learn tune DATABASE -o {folder.path.parent} --model {' --model '.join(older)}"
        yield (
            f"chosen before baselines were judged beside a search ({', '.join(older)}):"
            f" {to_type(again)} decides anew by five folds of all rows"
        )


def _bounded(target: str) -> list[str]:
    """Return the scores that have intervals: the largest error has none."""
    return [name for name in names(target) if name != "nmaxe"]


def _score_rows(folder: Folder, target: str) -> Iterator[list[object]]:
    """Yield the lines of scores.csv."""
    found = intervals.of(folder)
    for model, kind, result in folder.results():
        row: list[object] = [model, kind]
        for part in ("test", "train"):
            scored = result.get(part) or {}
            row += [scored.get(name, "") for name in names(target)]
        if target == OUR_AREA:
            row += [getattr(paper.TEST[kind][model], name) for name in names(target)]
        row += [result.get("failure", ""), (result.get("search") or {}).get("winner") or ""]
        yield [*row, *_interval_cells(found, (model, kind), target)]


def _interval_cells(found: Intervals | None, place: tuple[str, str], target: str) -> list[object]:
    """Return the ends of a result's intervals, how they were drawn, and the spread of the truth."""
    own = found.of.get(place, {}) if found else {}
    ends = [end for name in _bounded(target) for end in own.get(name, ("", ""))]
    if found is None or not own:
        return [*ends, "", "", "", found.spread if found and place in found.scored else ""]
    drawn = f"{found.groups} {found.drawn}"
    return [*ends, intervals.LEVEL, intervals.BOOTSTRAP, drawn, found.spread]


def _interval_table(found: Intervals, target: str) -> Table:
    """Return a table of the intervals of the scores on the test rows."""
    table = Table(
        title=(
            f"{100 * intervals.LEVEL:g} % intervals of the scores on the test rows [%]: bootstrap,"
            f" {intervals.BOOTSTRAP:,} resamples of {found.groups} {found.drawn}; nMaxE has none"
        )
    )
    for column in ("Model", "", *(SCORES[name] for name in _bounded(target))):
        table.add_column(column, justify="left" if column in {"Model", ""} else "right")
    for (model, kind), own in found.of.items():
        ends = [f"{own[name][0]:.2f} to {own[name][1]:.2f}" for name in _bounded(target)]
        table.add_row(MODELS[model].title, kind, *ends)
    return table


def _time_rows(folder: Folder) -> Iterator[list[object]]:
    """Yield the lines of times.csv."""
    for model, kind, result in folder.results():
        times = result.get("times")
        if times:
            yield [model, kind, times["fit"], times["fits"], times["test"], times["row"]]


def _score_table(folder: Folder, target: str) -> Table:
    """Return a table like Table 4, with the paper's numbers in brackets."""
    table = Table(title="Scores on the test rows [%] and times [s]; the paper's in brackets")
    for column in ("Model", ""):
        table.add_column(column, no_wrap=True)
    for column in (*(SCORES[name] for name in names(target)), "fit", "test set", "one row"):
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
    won = (result.get("search") or {}).get("winner") == "baseline"
    cells = [MODELS[model].title, f"{kind}: baseline" if won else kind]
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
        f"{search_tables.seconds(times['fit'])}{their_fit}",
        f"{search_tables.seconds(times['test'])}{their_test}",
        search_tables.seconds(times["row"]),
    ]
