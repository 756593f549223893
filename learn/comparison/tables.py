"""The tables of a comparison, beside the paper's: printed, and written as CSV.

Scores and times go into separate files: the scores are the same for the same seeds whatever the
number of processes, the times are not. Scores have intervals by a bootstrap of the test rows, in
which rows of one surface, or of one tile of a map, are drawn together.
"""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple

from rich.table import Table

from gen.runtime.errors import InputError
from gen.runtime.terminal import echo, print_table
from learn.comparison import paper
from learn.comparison.folder import Folder
from learn.comparison.grid import LEAST_JUDGED, LIBRARY, LIBRARY_ROWS, TABLE_2, space_of
from learn.metrics import BOOTSTRAP, LEVEL, bootstrap, no_better, spread
from learn.models import MODELS

SCORES = {"nmse": "nMSE", "nmae": "nMAE", "nmaxe": "nMaxE", "r2": "R2"}
"""The four scores and their names in the paper [%]."""

OUR_AREA = "area_percent"
"""The target of the paper's tables: beside any other its numbers would mislead."""

WIDTH = 150
"""Width of the tables without a terminal [characters]."""

EXTENT = ["rows", "candidates", "candidates_differing", "candidates_scored", "fits_nominal", "fits"]
"""The extent of a search: keys of a result, and columns of tuning.csv."""

UNBROKEN = {"Model", "", *SCORES.values()}
"""Columns whose cells are not broken into lines."""

NOT_SEARCHED = "not searched"
"""Name of the winner of a search that judged too few candidates."""

WHY_BASELINE = "the baseline wins, no candidate is better over five folds of all rows"
"""What is said of a search that no candidate has won."""

WINNERS = {"grid": "grid", "optimum": "the paper's optimum", "baseline": "the baseline"}
"""Names of the winners' places in tables."""

DECIDED = {
    "winner_r2": "r2_folds",
    "grid_r2": "grid_r2_folds",
    "optimum_r2": "optimum_r2_folds",
    "baseline_r2": "baseline_r2_folds",
}
"""Columns of tuning.csv, and the R2 over the folds of a result whose means [%] they are."""


class Intervals(NamedTuple):
    """Intervals of the scores on the test rows."""

    # Low and high of each score that has an interval [%], by model and kind of result; empty for a
    # result whose test rows are all of one group.
    of: dict[tuple[str, str], dict[str, tuple[float, float]]]
    drawn: str  # number and name of what is drawn, as "12 surfaces"
    spread: float  # variance of the solved test values over their mean, in the target's unit

    def in_words(self) -> str:
        """Say how the intervals were made."""
        return f"{BOOTSTRAP:,} resamples of {self.drawn}; nMaxE has none"


def intervals(folder: Folder) -> Intervals | None:
    """Draw the intervals of all results of a folder; None if no result has scores.

    InputError is raised if predictions or groups are damaged.
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


def write(folder: Folder) -> None:
    """Write scores.csv, times.csv, tuning.csv and tuning-times.csv."""
    target = str(folder.record()["conditions"]["target"])
    header = ["model", "result", *names(target), *(f"train_{name}" for name in names(target))]
    paper_header = [f"paper_{name}" for name in names(target)] if target == OUR_AREA else []
    ends = [f"{name}_{end}" for name in _bounded(target) for end in ("low", "high")]
    more = ["winner", *ends, "level", "resamples", "drawn", "variance_over_mean"]
    header += [*paper_header, "failure", *more]
    folder.write_table("scores.csv", header, _score_rows(folder, target))
    times = ["model", "result", "fit_s", "fits", "predict_test_s", "predict_row_s"]
    folder.write_table("times.csv", times, _time_rows(folder))
    header = ["model", "grid", "searched", *EXTENT, "winner", *DECIDED, "settings"]
    searched = [(m, r, r["search"]) for m, kind, r in folder.results() if _is_search(kind, r)]
    folder.write_table("tuning.csv", header, (_search_row(*each) for each in searched))
    spent = [(m, r["times"]["search"], paper.TUNING_SECONDS[m]) for m, r, _ in searched]
    folder.write_table("tuning-times.csv", ["model", "fit_seconds", "paper_s"], spent)


def _score_rows(folder: Folder, target: str) -> Iterator[list[object]]:
    """Yield the lines of scores.csv."""
    found = intervals(folder)
    for model, kind, result in folder.results():
        row: list[object] = [model, kind]
        for part in ("test", "train"):
            scored = result.get(part) or {}
            row += [scored.get(name, "") for name in names(target)]
        if target == OUR_AREA:
            theirs = paper.TEST.get(kind, {}).get(model)
            row += ["" if theirs is None else getattr(theirs, name) for name in names(target)]
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


def _is_search(kind: str, result: dict[str, Any]) -> bool:
    return kind == "tuned" and "search" in result


def _search_row(model: str, result: dict[str, Any], search: dict[str, Any]) -> list[object]:
    """Return a line of tuning.csv."""
    extent = [search.get("grid", TABLE_2), *(search[name] for name in ("how", *EXTENT))]
    means = [_mean(search, name) for name in DECIDED.values()]
    return [model, *extent, winner_of(search), *means, _settings(result)]


def winner_of(search: dict[str, Any]) -> str:
    """Return the place of a search's winner; earlier versions named one of too few candidates."""
    few = search["candidates_scored"] < min(LEAST_JUDGED, search["candidates_differing"])
    failed = sum(search["failures"].values()) > 0
    return NOT_SEARCHED if few and not failed else search.get("winner") or ""


def _mean(search: dict[str, Any], name: str) -> float | str:
    """Return the mean R2 over the folds [%], "" where there is none."""
    folds = search.get(name) or []
    return sum(folds) / len(folds) if folds else ""


def _settings(result: dict[str, Any]) -> str:
    """Return the settings of a result in one line; a baseline without any is named."""
    values = ", ".join(f"{name}={value}" for name, value in sorted(result["settings"].items()))
    return values or "those of the library"


def show(folder: Folder) -> None:
    """Print the tables of a folder."""
    record, found = folder.record(), intervals(folder)
    conditions = record["conditions"]
    target, area_max = str(conditions["target"]), conditions["area_max"]
    limited = "" if area_max is None else f", areas to {area_max:g} %"
    echo(
        f"{folder.path}: {target}, {conditions['train_rows']} training rows,"
        f" {conditions['test_rows']} test rows{limited}; {record['threads']} thread"
    )
    print_table(_score_table(folder, target, found), WIDTH)
    if found is not None:
        if any(found.of.values()):
            how = f"bootstrap, {found.in_words()}"
            echo(f"{100 * LEVEL:g} % intervals of the scores on the test rows [%]: {how}")
        if target == OUR_AREA:
            echo(nmse_note(found.spread))
    if any(folder.result("tuned", model) for model in MODELS):
        print_table(_search_table(folder, beside=target == OUR_AREA), WIDTH)
    for line in _remarks(folder):
        echo(line)


def _remarks(folder: Folder) -> Iterator[str]:
    """Yield the lines below the tables: useless models, failures, baselines or ends that won."""
    for *_, said in no_better_than_constant(folder):
        yield f"warning: {said}"
    for model, kind, result in folder.results():
        title, search = MODELS[model].title, result.get("search") or {}
        if result.get("failure"):
            yield f"{title}, {label(model, kind)}: {result['failure']}"
        elif search and winner_of(search) == NOT_SEARCHED:
            yield (
                f"{title}: {NOT_SEARCHED}: {search['candidates_scored']} candidates were judged, of"
                f" {LEAST_JUDGED} at least: give a larger --budget"
            )
        elif search.get("winner") == "baseline":
            yield f"{title}: {WHY_BASELINE}"
        elif search:
            yield from _ends(folder, model, result, search)
    if any(kind == "library" for _, kind, _ in folder.results()):
        yield (
            f"Its library fits amplitude and length of a Gaussian process ({LIBRARY_ROWS:,} rows at"
            " most here); the paper's, and ours, has a fixed kernel."
        )


def _ends(
    folder: Folder, model: str, result: dict[str, Any], search: dict[str, Any]
) -> Iterator[str]:
    """Say which settings of a winner lie beyond the grid, or at an end with more beyond."""
    _, space = space_of(model, folder.record()["conditions"]["features"])
    for name, value in result["settings"].items():
        title, said = MODELS[model].title, f"{name} = {value}"
        if isinstance(value, int | float) and value not in space.get(name, [value]):
            yield f"{title}: {said} lies beyond the grid, where the search went on"
        if name in search.get("ends", ()):
            yield f"{title}: {said} at an end of what was tried: a better one may lie beyond"


def label(model: str, kind: str) -> str:
    """Return the name of a kind of result for people."""
    if kind == "library":
        return "its library's own"
    return "baseline: the paper's" if kind == "baseline" and model in LIBRARY else kind


def nmse_note(spread: float) -> str:
    """Explain the nMSE by the variance of the solved test areas over their mean [%]."""
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


def _new_table(title: str, texts: Sequence[str], numbers: Iterable[str]) -> Table:
    """Return a table without rows, with columns of texts and of numbers."""
    table = Table(title=title)
    for column in texts:
        table.add_column(column, no_wrap=column in UNBROKEN)
    for column in numbers:
        table.add_column(column, justify="right", no_wrap=column in UNBROKEN)
    return table


def _score_table(folder: Folder, target: str, found: Intervals | None) -> Table:
    """Return a table like Table 4, with the paper's numbers in brackets, intervals below."""
    title = "Scores on the test rows [%] with their intervals, times [s]; the paper's in brackets"
    numbers = (*(SCORES[name] for name in names(target)), "fit", "test set", "one row")
    table = _new_table(title, ("Model", ""), numbers)
    beside = target == OUR_AREA
    for model, kind, result in folder.results():
        won = (result.get("search") or {}).get("winner") == "baseline"
        cells = [MODELS[model].title, f"{kind}: baseline" if won else label(model, kind)]
        scored, times = result.get("test"), result.get("times") or {}
        if not scored:
            table.add_row(*cells, "failed")
            continue
        own = found.of.get((model, kind), {}) if found else {}
        theirs = paper.TEST.get(kind, {}).get(model) if beside else None
        for name in names(target):
            published = f" ({getattr(theirs, name):.2f})" if theirs else ""
            ends = "\n{:.2f} to {:.2f}".format(*own[name]) if name in own else ""
            cells.append(f"{scored[name]:.2f}{published}{ends}")
        for place, name in enumerate(("fit", "test")):
            published = f" ({paper.TIMES[kind][model][place]:.3g})" if theirs else ""
            cells.append(f"{_seconds(times[name])}{published}")
        table.add_row(*cells, _seconds(times["row"]))
    return table


def _search_table(folder: Folder, *, beside: bool) -> Table:
    """Return a table like Table 3: extent and winners of the searches, the paper's times beside."""
    title = (
        "Searches: means of R2 over the five folds of all rows [%], which decide; sum of the fits'"
        " times [s], the paper's tuning time in brackets"
    )
    texts = ("Model", "Grid", "Searched", "Winner", "Best settings")
    numbers = ("R2", "baseline", "candidates", "differ", "fits", "of", "time")
    table = _new_table(title, texts, numbers)
    for model in MODELS:
        result = folder.result("tuned", model)
        if result is None:
            continue
        search = result.get("search")
        if not search:
            table.add_row(MODELS[model].title, "", result["failure"].partition(":")[0])
            continue
        theirs = f" ({paper.TUNING_SECONDS[model]:.0f})" if beside else ""
        means = [_mean(search, name) for name in ("r2_folds", "baseline_r2_folds")]
        extent = ("candidates", "candidates_differing", "fits", "fits_nominal")
        table.add_row(
            MODELS[model].title,
            str(search.get("grid", TABLE_2)),
            str(search["how"]),
            WINNERS.get(winner_of(search), winner_of(search)),
            _settings(result),
            *(f"{mean:.2f}" if isinstance(mean, float) else mean for mean in means),
            *(str(search[name]) for name in extent),
            f"{_seconds(result['times']['search'])}{theirs}",
        )
    return table


def _seconds(value: float) -> str:
    """Return a time [s] as text."""
    return f"{value:.0f}" if value >= 1000 else f"{value:.3g}"
