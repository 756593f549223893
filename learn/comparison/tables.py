"""The tables and pictures of a comparison, beside the paper's: written, printed and drawn.

Scores and times go into separate files (CSV): the scores are the same for the same seeds whatever
the number of processes, the times are not.
"""

import textwrap
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gen.runtime.errors import InputError
from gen.runtime.figure import draw_parity, new_figure, parity_axes, save
from gen.runtime.files import inside
from gen.runtime.terminal import command_to_type, echo, print_columns
from learn.comparison import paper
from learn.comparison.folder import Folder
from learn.comparison.grid import LEAST_JUDGED, LIBRARY, LIBRARY_ROWS, TABLE_2, space_of
from learn.metrics import BOOTSTRAP, LEVEL, bootstrap, no_better, spread
from learn.models import EVERY, MODELS, default_model

SCORES = {
    "nmse": "nMSE",
    "nmae": "nMAE",
    "nmaxe": "nMaxE",
    "r2": "R2",
}  # [%], in the paper
OUR_AREA = "area_percent"  # target of the paper's tables, whose numbers would mislead beside others
NOT_SEARCHED = (
    "not searched"  # name of the winner of a search that judged too few candidates
)

WHY_BASELINE = "the baseline wins, no candidate is better over five folds of all rows"
"""What is said of a search that no candidate has won."""

WINNERS = {"optimum": "the paper's optimum", "baseline": "the baseline"}
"""Names of the winners' places for people, where they are others."""

DECIDED = {
    "winner_r2": "r2_folds",
    "grid_r2": "grid_r2_folds",
    "optimum_r2": "optimum_r2_folds",
    "baseline_r2": "baseline_r2_folds",
}
"""Columns of tuning.csv, and the R2 over the folds of a result whose means [%] they are."""

TIMES = {"fit_s": "fit", "fits": "fits", "predict_test_s": "test", "predict_row_s": "row"}
"""Columns of times.csv after model and result, and the times of a result that they have."""

TUNING = (
    *("model", "grid", "searched", "rows", "candidates", "candidates_differing"),
    *("candidates_scored", "fits_nominal", "fits", "winner", *DECIDED, "settings"),
)
"""Columns of tuning.csv."""

COLOURS = {
    "baseline": "tab:blue",
    "tuned": "tab:orange",
}  # colours of the kinds of results

DOTS: dict[str, dict[str, Any]] = {
    "baseline": {
        "marker": "o",
        "ms": 4,
        "mew": 0.5,
        "mfc": "none",
        "ls": "none",
        "zorder": 1,
    },
    "tuned": {"marker": ".", "ms": 2, "ls": "none", "zorder": 2},
}
"""Looks of predictions: circles of the baseline stay visible round the dots of tuned models."""

DPI = 120  # dots per inch: pictures are about 1,400 wide then

Row = dict[str, Any]


@dataclass(frozen=True, eq=False)
class Tables:
    """The tables of a target: a row for each result, by the columns of its files.

    Beside the cells of scores.csv, which are "" without a value, a row has those of times.csv if
    there are times, and "settings" and "search" of the result.
    """

    folder: Folder
    record: dict[str, Any]  # the folder's description
    target: str  # its column
    rows: list[Row]


def names(target: str) -> list[str]:
    """Return the scores that are free of units for a target's column: nMSE is for areas only."""
    return [name for name in SCORES if name != "nmse" or target == OUR_AREA]


def columns(target: str) -> list[str]:
    """Return the columns of scores.csv; the largest error has no interval."""
    own = names(target)
    published = [f"paper_{name}" for name in own if target == OUR_AREA]
    ends = [f"{name}_{end}" for name in own if name != "nmaxe" for end in ("low", "high")]
    return [
        *("model", "result", *own, *(f"train_{name}" for name in own), *published),
        *(
            "failure",
            "winner",
            *ends,
            "level",
            "resamples",
            "drawn",
            "variance_over_mean",
        ),
    ]


def read(folder: Folder) -> Tables:
    """Make the tables of a folder; InputError is raised if predictions or groups are damaged."""
    record = folder.record()
    target, rows = record["conditions"]["target"], []
    for model, kind, result in folder.results():
        search = result.get("search") or {}
        row: Row = dict.fromkeys(columns(target), "")
        row |= {"model": model, "result": kind, "failure": result.get("failure", "")}
        row |= {"winner": search.get("winner") or "", **(result.get("test") or {})}
        row |= {
            f"train_{name}": value for name, value in (result.get("train") or {}).items()
        }
        theirs = paper.TEST.get(kind, {}).get(model)
        if theirs is not None and target == OUR_AREA:
            row |= {f"paper_{name}": value for name, value in vars(theirs).items()}
        if result.get("test"):
            truth, prediction = folder.prediction(kind, model)
            groups = folder.numbers("rows.csv", "group", part="test")[:, 0]
            path = folder.path / kind / f"{model}.csv"
            if truth.size != groups.size:
                given = f"{truth.size} rows, rows.csv has {groups.size} test rows"
                raise InputError(f"{path} has {given}: move it away")
            if truth.size < 2 or np.ptp(truth) == 0:
                raise InputError(
                    f"{path} cannot be read: the truth does not vary: move it away"
                )
            row["variance_over_mean"] = spread(truth)
            if ends := bootstrap(truth, prediction, LEVEL, groups):
                by = "surface" if record.get("split_by_surface", True) else "row"
                drawn = f"{np.unique(groups).size} {'tile' if record.get('split_by_tile') else by}s"
                row |= {"level": LEVEL, "resamples": BOOTSTRAP, "drawn": drawn}
                for name, (low, high) in ends.items():
                    row |= {f"{name}_low": low, f"{name}_high": high}
        if own := result.get("times"):
            row |= {column: own[name] for column, name in TIMES.items()}
            row["fit_seconds"] = own["search"]
        rows.append(row | {"settings": result.get("settings", {}), "search": search})
    return Tables(folder, record, target, rows)


def winner_of(search: Row) -> str:
    """Return the place of a search's winner; earlier versions named one of too few candidates."""
    few = search["candidates_scored"] < min(LEAST_JUDGED, search["candidates_differing"])
    return NOT_SEARCHED if few and not search["failures"] else search.get("winner") or ""


def write(tables: Tables) -> None:
    """Write scores.csv, times.csv, tuning.csv and tuning-times.csv."""
    searches = [_searched(row) for row in tables.rows if row["search"]]
    timed = [row for row in tables.rows if "fits" in row]
    files = {
        "scores.csv": (columns(tables.target), tables.rows),
        "times.csv": (("model", "result", *TIMES), timed),
        "tuning.csv": (TUNING, searches),
        "tuning-times.csv": (("model", "fit_seconds", "paper_s"), searches),
    }
    for name, (header, rows) in files.items():
        tables.folder.write_table(
            name, header, ([row[key] for key in header] for row in rows)
        )


def _searched(row: Row) -> Row:
    """Return the row of tuning.csv of a search's result, with the columns of tuning-times.csv."""
    search = row["search"]
    folds = {column: search.get(name) or [] for column, name in DECIDED.items()}
    settings = (f"{name}={value}" for name, value in sorted(row["settings"].items()))
    return {
        **row,
        **search,
        "grid": search.get("grid", TABLE_2),
        "searched": search["how"],
        "winner": winner_of(search),
        **{column: sum(own) / len(own) if own else "" for column, own in folds.items()},
        "settings": ", ".join(settings) or "those of the library",
        "paper_s": paper.TUNING_SECONDS.get(row["model"], ""),
    }


def show(tables: Tables) -> None:
    """Print the tables of a folder, and what there is to say of them."""
    conditions, area_max = (
        tables.record["conditions"],
        tables.record["conditions"]["area_max"],
    )
    limited = "" if area_max is None else f", areas to {area_max:g} %"
    echo(
        f"{tables.folder.path}: {tables.target}, {conditions['train_rows']} training rows,"
        f" {conditions['test_rows']} test rows{limited}; {tables.record['threads']} thread"
    )
    echo(
        "Scores on the test rows [%] with their intervals, times [s]; the paper's in brackets:"
    )
    numbers = (
        *(SCORES[name] for name in names(tables.target)),
        "fit",
        "test set",
        "one row",
    )
    print_columns(_scored(tables), ("Model", "", *numbers), right=numbers)
    for line in _notes(tables):
        echo(line)
    if any(row["result"] == "tuned" for row in tables.rows):
        echo(
            "Searches: means of R2 over the five folds of all rows [%], which decide; sum of the"
            " fits' times [s], the paper's tuning time in brackets:"
        )
        numbers = ("R2", "baseline", "candidates", "differ", "fits", "of", "time")
        texts = ("Model", "Grid", "Searched", "Winner", "Best settings")
        print_columns(_searches(tables), (*texts, *numbers), right=numbers)
    for line in _remarks(tables):
        echo(line)


def _notes(tables: Tables) -> Iterator[str]:
    """Yield how the intervals were made, and what the nMSE is, for tables and pictures."""
    for drawn in {row["drawn"] for row in tables.rows} - {""}:
        yield (
            f"{100 * LEVEL:g} % intervals of the scores on the test rows [%]: bootstrap,"
            f" {BOOTSTRAP:,} resamples of {drawn}; nMaxE has none"
        )
    middle = max(
        (float(row["variance_over_mean"] or 0) for row in tables.rows), default=0.0
    )
    if middle and tables.target == OUR_AREA:
        yield (
            "nMSE has the target's unit: it is (1 - R2) times the variance of the test rows' areas"
            f" over their mean, {middle:.2g} % of area here and {paper.SPREAD:.2g} % in the paper."
            f" At the same R2 the nMSE is {middle / paper.SPREAD:.2g} times the paper's: compare"
            " R2."
        )


def _remarks(tables: Tables) -> Iterator[str]:
    """Yield the lines below the tables: useless models, failures, what is odd, and the best."""
    features = tables.record["conditions"]["features"]
    for _, said in no_better_than_constant(tables):
        yield f"warning: {said}"
    for row in tables.rows:
        model, kind, search = row["model"], row["result"], row["search"]
        title = EVERY[model].title
        if row["failure"]:
            yield f"{title}, {label(model, kind)}: {row['failure']}"
        elif kind == "library":
            yield (
                f"Its library fits amplitude and length of a Gaussian process ({LIBRARY_ROWS:,}"
                " rows at most here); the paper's, and ours, has a fixed kernel."
            )
        elif search and winner_of(search) == NOT_SEARCHED:
            judged = f"{search['candidates_scored']} candidates were judged"
            yield f"{title}: {NOT_SEARCHED}: {judged}, of {LEAST_JUDGED} at least"
        elif search.get("winner") == "baseline":
            yield f"{title}: {WHY_BASELINE}"
        elif search:
            yield from (
                f"{title}: {odd}" for odd in _at_ends(row, space_of(model, features)[1])
            )
    known = [row for row in tables.rows if row["nmae"] != ""]
    if len({row["model"] for row in known}) > 1:
        best = min(known, key=lambda row: float(row["nmae"]))
        name = f"{EVERY[best['model']].title}, {label(best['model'], best['result'])}"
        usual = EVERY[default_model(features)].title
        fit = command_to_type("learn fit")
        yield f"smallest nMAE: {name}; {fit} takes {usual} unless told otherwise"


def _at_ends(row: Row, space: paper.Space) -> Iterator[str]:
    """Say which settings of a search's winner lie beyond the grid, or at an end of all values."""
    for name, value in row["settings"].items():
        if isinstance(value, int | float) and value not in space.get(name, [value]):
            yield f"{name} = {value} lies beyond the grid, where the search went on"
        if name in row["search"].get("ends", ()):
            yield f"{name} = {value} at an end of what was tried: a better one may lie beyond"


def label(model: str, kind: str) -> str:
    """Return the name of a kind of result for people."""
    if kind == "library":
        return "its library's own"
    return "baseline: the paper's" if kind == "baseline" and model in LIBRARY else kind


def no_better_than_constant(tables: Tables) -> Iterator[tuple[Row, str]]:
    """Yield the rows of models that a constant predicts as well, and say so."""
    for row in tables.rows:
        if row["r2"] != "" and (said := no_better(row["r2"])):
            yield row, f"{EVERY[row['model']].title}, {row['result']}: {said}"


def _scored(tables: Tables) -> Iterator[list[str]]:
    """Yield the lines of a table like Table 4, with the paper's numbers in brackets."""
    for row in tables.rows:
        model, kind = row["model"], row["result"]
        won = row["winner"] == "baseline"
        cells = [EVERY[model].title, f"{kind}: baseline" if won else label(model, kind)]
        if row["r2"] == "":
            yield [*cells, "failed"]
            continue
        theirs = row.get("paper_r2", "") != ""
        for name in names(tables.target):
            published = f" ({row[f'paper_{name}']:.2f})" if theirs else ""
            ends = row.get(f"{name}_low", ""), row.get(f"{name}_high", "")
            below = "" if "" in ends else "\n{:.2f} to {:.2f}".format(*ends)
            cells.append(f"{row[name]:.2f}{published}{below}")
        for place, name in enumerate(("fit_s", "predict_test_s")):
            published = f" ({paper.TIMES[kind][model][place]:.3g})" if theirs else ""
            cells.append(f"{_seconds(row[name])}{published}")
        yield [*cells, _seconds(row["predict_row_s"])]


def _searches(tables: Tables) -> Iterator[list[str]]:
    """Yield the lines of a table like Table 3: extent and winners of the searches."""
    for row in (row for row in tables.rows if row["result"] == "tuned"):
        if not row["search"]:
            yield [EVERY[row["model"]].title, "", row["failure"].partition(":")[0]]
            continue
        search = _searched(row)
        published = tables.target == OUR_AREA and search["paper_s"] != ""
        theirs = f" ({search['paper_s']:.0f})" if published else ""
        means = (search[name] for name in ("winner_r2", "baseline_r2"))
        extent = ("candidates", "candidates_differing", "fits", "fits_nominal")
        yield [
            *(EVERY[row["model"]].title, search["grid"], search["searched"]),
            *(str(WINNERS.get(search["winner"], search["winner"])), search["settings"]),
            *("" if mean == "" else f"{mean:.2f}" for mean in means),
            *(str(search[name]) for name in extent),
            f"{_seconds(search['fit_seconds'])}{theirs}",
        ]


def _seconds(value: float) -> str:
    """Return a time [s] as text."""
    return f"{value:.0f}" if value >= 1000 else f"{value:.3g}"


def draw(tables: Tables) -> list[Path]:
    """Draw parity.png (like figures 8 and 10), scores.png and times.png (like figure 9).

    Nothing is drawn if the folder of the target has no results.
    """
    folder = tables.folder
    shown = [row for row in tables.rows if row["r2"] != "" and row["result"] in COLOURS]
    if not shown:
        return []
    quantity = f"{tables.target.replace('_percent', '')} [{tables.record['unit']}]"
    places = [(row["model"], row["result"]) for row in shown]
    figures = {
        "parity.png": _parity(folder, places, quantity),
        "scores.png": _bars(shown, names(tables.target)),
        "times.png": _bars(shown, [name for name in TIMES if name != "fits"]),
    }
    said, won = [*_notes(tables)], [row for row in shown if row["winner"] == "baseline"]
    if won:
        titles = ", ".join(EVERY[row["model"]].title for row in won)
        said.insert(0, f"tuned is the baseline, which won the search: {titles}")
    text = "\n".join(textwrap.fill(line, 150) for line in said)
    figures["scores.png"].axes[0].set_title(text, fontsize=8, loc="left")
    return [
        save(figure, inside(folder.path, name), dpi=DPI)
        for name, figure in figures.items()
    ]


def _parity(folder: Folder, places: list[tuple[str, str]], quantity: str) -> Any:
    """Draw predictions over the truth, baseline and tuned, and the line of equality."""
    models = list(dict.fromkeys(model for model, _ in places))
    columns = min(3, len(models))
    rows = -(-len(models) // columns)
    figure = new_figure(3.6 * columns, 3.5 * rows)
    axes = np.atleast_1d(figure.subplots(rows, columns)).ravel()
    for model, axis in zip(models, axes, strict=False):
        kinds = [kind for name, kind in places if name == model]
        parity_axes(axis, folder.prediction(kinds[0], model)[0])
        for kind in kinds:
            truth, prediction = folder.prediction(kind, model)
            draw_parity(
                axis, truth, prediction, label=kind, color=COLOURS[kind], **DOTS[kind]
            )
        axis.set(
            title=EVERY[model].title, xlabel=f"solved {quantity}", ylabel="predicted"
        )
        axis.legend(markerscale=2, loc="upper left", fontsize=8)
    for axis in axes[len(models) :]:
        axis.set_axis_off()
    return figure


PANELS = {name: f"{title} [%]" for name, title in SCORES.items()} | {
    "r2": "1 - R2 [%]",
    "fit_s": "fit [s]",
    "predict_test_s": "prediction of the test set [s]",
    "predict_row_s": "of one row [s]",
}
"""Titles of the panels of bars, by their column; all but errors are on a scale of decades."""


def _left(row: Row, column: str, end: str) -> float:
    """Return the height of a bar, or an end of its interval if it has one, as "_low".

    Of R2 it is what is left of it, since R2 of good models look alike.
    """
    value = row.get(f"{column}{end}", "")
    value = float(row[column] if value == "" else value)
    return 100 - value if column == "r2" else value


def _bars(rows: list[Row], columns: list[str]) -> Any:
    """Draw a pair of bars for each model, baseline and tuned, in panels, with their intervals."""
    figure = new_figure(1.6 + 1.15 * len(MODELS), 2.3 * len(columns))
    axes = figure.subplots(len(columns), 1, sharex=True, squeeze=False)[:, 0]
    models = list(dict.fromkeys(row["model"] for row in rows))
    for axis, column in zip(axes, columns, strict=True):
        for kind, shift in zip(COLOURS, (-0.2, 0.2), strict=True):
            own = [row for row in rows if row["result"] == kind]
            if not own:
                continue
            places = np.array([models.index(row["model"]) for row in own]) + shift
            ends = [
                [_left(row, column, end) for row in own] for end in ("", "_low", "_high")
            ]
            reach = np.array(
                [ends[0] - np.min(ends, axis=0), np.max(ends, axis=0) - ends[0]]
            )
            look = {"color": COLOURS[kind], "label": kind, "ecolor": "0.2", "capsize": 2}
            within = (
                reach.tolist() if np.any(reach) else None
            )  # of arrays NumPy 2.1 warns
            bars = axis.bar(places, ends[0], 0.38, yerr=within, **look)
            axis.bar_label(bars, fmt="{:.3g}", fontsize=7)
        axis.set_xticks(
            range(len(models)), [EVERY[m].title.replace(" ", "\n") for m in models]
        )
        axis.margins(y=0.2)
        errors = column in SCORES and column != "r2"
        axis.set(ylabel=PANELS[column], yscale="linear" if errors else "log")
    axes[0].legend(ncols=2, loc="lower right", bbox_to_anchor=(1, 1))
    return figure
