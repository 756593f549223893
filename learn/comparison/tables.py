"""The tables of a comparison, beside the paper's: printed, and written as CSV.

Scores and times go into separate files: the scores are the same for the same seeds whatever the
number of processes, the times are not. Scores have intervals by a bootstrap of the test rows, in
which rows of one surface, or of one tile of a map, are drawn together.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from rich.table import Table

from gen.runtime.errors import InputError
from gen.runtime.terminal import echo, print_table
from learn.comparison import paper, search_tables
from learn.comparison.folder import KINDS, Folder
from learn.metrics import BOOTSTRAP, LEVEL, bootstrap, no_better, spread
from learn.models import MODELS

SCORES = {"nmse": "nMSE", "nmae": "nMAE", "nmaxe": "nMaxE", "r2": "R2"}
"""The four scores and their names in the paper [%]."""

OUR_AREA = "area_percent"
"""The target of the paper's tables: beside any other its numbers would mislead."""

WIDTH = 150
"""Width of the tables without a terminal [characters]."""

Place = tuple[str, str]
"""Model and kind of a result."""


class Intervals(NamedTuple):
    """Intervals of the scores on the test rows.

    Attributes
    ----------
    of : dict
        Low and high of each score that has an interval [%], by model and kind; empty for a result
        whose test rows are all of one group.
    drawn : str
        Number and name of what is drawn, as "12 surfaces".
    spread : float
        Variance of the solved values of the test rows over their mean, in the target's unit.
    """

    of: dict[Place, dict[str, tuple[float, float]]]
    drawn: str
    spread: float

    def in_words(self) -> str:
        """Say how the intervals were made."""
        return f"{BOOTSTRAP:,} resamples of {self.drawn}; nMaxE has none"


def intervals(folder: Folder) -> Intervals | None:
    """Draw the intervals of all results of a folder; None if no result has scores.

    Raises
    ------
    InputError
        If predictions or groups are damaged.
    """
    places = [(m, kind) for m, kind, result in folder.results() if result.get("test")]
    if not places:
        return None
    record, groups = folder.record(), folder.test_groups()
    found = {}
    for model, kind in places:
        truth, prediction = folder.prediction(kind, model)
        path = folder.path / kind / f"{model}.csv"
        if truth.size != groups.size:
            raise InputError(
                f"{path} has {truth.size} rows, rows.csv has {groups.size} test rows: move it away"
            )
        try:
            found[model, kind] = bootstrap(truth, prediction, LEVEL, groups)
        except ValueError as error:
            raise InputError(f"{path} cannot be read: {error}: move it away") from None
    drawn = "tiles" if record.get("split_by_tile") else "surfaces"
    drawn = drawn if record.get("split_by_surface", True) else "rows"
    middle = spread(folder.prediction(places[0][1], places[0][0])[0])
    return Intervals(found, f"{len(set(groups.tolist()))} {drawn}", middle)


def names(target: str) -> list[str]:
    """Return the scores that are free of units for a target's column: nMSE is for areas only."""
    return [name for name in SCORES if name != "nmse" or target == OUR_AREA]


def _bounded(target: str) -> list[str]:
    """Return the scores that have intervals: the largest error has none."""
    return [name for name in names(target) if name != "nmaxe"]


def improvement(baseline: float, tuned: float, name: str) -> float:
    """Return the improvement of a score by tuning [% of the baseline]; positive is better."""
    change = 100 * (tuned - baseline) / abs(baseline) if baseline else 0.0
    return change if name == "r2" else 0.0 - change


def write(folder: Folder) -> list[Path]:
    """Write scores.csv, times.csv, tuning.csv, tuning-times.csv and whole-grids.csv."""
    target = str(folder.record()["conditions"]["target"])
    header = ["model", "result", *names(target), *(f"train_{name}" for name in names(target))]
    paper_header = [f"paper_{name}" for name in names(target)] if target == OUR_AREA else []
    ends = [f"{name}_{end}" for name in _bounded(target) for end in ("low", "high")]
    more = ["winner", *ends, "level", "resamples", "drawn", "variance_over_mean"]
    times = ["model", "result", "fit_s", "fits", "predict_test_s", "predict_row_s"]
    scores = folder.write_table(
        "scores.csv", [*header, *paper_header, "failure", *more], _score_rows(folder, target)
    )
    return [scores, folder.write_table("times.csv", times, _time_rows(folder))] + [
        folder.write_table(name, *content) for name, content in search_tables.files(folder).items()
    ]


def _score_rows(folder: Folder, target: str) -> Iterator[list[object]]:
    """Yield the lines of scores.csv."""
    found = intervals(folder)
    for model, kind, result in folder.results():
        row: list[object] = [model, kind]
        for part in ("test", "train"):
            scored = result.get(part) or {}
            row += [scored.get(name, "") for name in names(target)]
        if target == OUR_AREA:
            row += [getattr(paper.TEST[kind][model], name) for name in names(target)]
        row += [result.get("failure", ""), (result.get("search") or {}).get("winner") or ""]
        own = found.of.get((model, kind), {}) if found else {}
        row += [end for name in _bounded(target) for end in own.get(name, ("", ""))]
        row += [LEVEL, BOOTSTRAP, found.drawn] if found and own else ["", "", ""]
        yield [*row, found.spread if found and (model, kind) in found.of else ""]


def _time_rows(folder: Folder) -> Iterator[list[object]]:
    """Yield the lines of times.csv."""
    for model, kind, result in folder.results():
        if times := result.get("times"):
            yield [model, kind, times["fit"], times["fits"], times["test"], times["row"]]


def show(folder: Folder) -> None:
    """Print the tables of a folder."""
    record = folder.record()
    conditions = record["conditions"]
    target, area_max = str(conditions["target"]), conditions["area_max"]
    limited = "" if area_max is None else f", areas to {area_max:g} %"
    echo(
        f"{folder.path}: {target}, {conditions['train_rows']} training rows,"
        f" {conditions['test_rows']} test rows{limited}; {record['threads']} thread"
    )
    print_table(_score_table(folder, target), WIDTH)
    found = intervals(folder)
    if found is not None:
        if any(found.of.values()):
            print_table(_interval_table(found, target), WIDTH)
        if target == OUR_AREA:
            echo(nmse_note(found.spread))
    if any(folder.result("tuned", model) for model in MODELS):
        print_table(search_tables.table(folder, beside=target == OUR_AREA), WIDTH)
    if any(search_tables.grid_costs(folder)):
        print_table(search_tables.grid_cost_table(folder), WIDTH)
    for line in _remarks(folder):
        echo(line)


def _remarks(folder: Folder) -> Iterator[str]:
    """Yield the lines below the tables: useless models, failures, baselines that won."""
    for *_, said in no_better_than_constant(folder):
        yield f"warning: {said}"
    for model, kind, result in folder.results():
        if result.get("failure"):
            yield f"{MODELS[model].title}, {kind}, failed: {result['failure']}"
        elif kind == "tuned" and result["search"].get("winner") == "baseline":
            yield f"{MODELS[model].title}: {search_tables.why_baseline(result['search'])}"


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


def _interval_table(found: Intervals, target: str) -> Table:
    """Return a table of the intervals of the scores on the test rows."""
    table = Table(
        title=(
            f"{100 * LEVEL:g} % intervals of the scores on the test rows [%]: bootstrap,"
            f" {found.in_words()}"
        )
    )
    for column in ("Model", "", *(SCORES[name] for name in _bounded(target))):
        table.add_column(column, justify="left" if column in {"Model", ""} else "right")
    for (model, kind), own in found.of.items():
        if own:
            ends = [f"{own[name][0]:.2f} to {own[name][1]:.2f}" for name in _bounded(target)]
            table.add_row(MODELS[model].title, kind, *ends)
    return table


def _score_table(folder: Folder, target: str) -> Table:
    """Return a table like Table 4, with the paper's numbers in brackets."""
    table = Table(title=("Scores on the test rows [%] and times [s]; the paper's in brackets"))
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
    for name, theirs_s in zip(("fit", "test"), paper.TIMES[kind][model], strict=True):
        theirs = f" ({theirs_s:.3g})" if beside else ""
        cells.append(f"{search_tables.seconds(times[name])}{theirs}")
    return [*cells, search_tables.seconds(times["row"])]
