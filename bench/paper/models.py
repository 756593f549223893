"""The paper's nine models beside ours, Tables 2 to 4 and pictures, and the numbers in its text."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from bench.paper.database import finished
from bench.paper.facts import (
    AREA_MAX,
    LONGEST_SOLVE,
    TRAIN_ROWS,
    few,
    ratio,
    rows_of,
    why,
)
from bench.picture import COLOURS, new_figure
from bench.report import Report
from bench.surrogates.cost import PAPER_ROWS, PAPER_SOLVE, PAPER_TESTS
from gen.database import Reader
from gen.runtime.errors import InputError
from gen.runtime.figure import draw_parity, parity_axes
from gen.schema import Status
from learn.comparison import paper, tables
from learn.comparison.folder import Folder, SearchReport
from learn.comparison.paper import OPTIMA, SPACES
from learn.comparison.plots import DOTS
from learn.comparison.tables import NOT_SEARCHED
from learn.models import MODELS

# So far may the paper's nMSE and R2 of a model be from those of its others, relatively.
BELONG = 0.15
MANY = 20  # values of a hyperparameter that are all listed

Shown = dict[str, dict[str, Any]]
ENDS = "", "_paper"  # of the names of columns


def opened(comparison: Path) -> Folder:
    """Find the part of a comparison that is on the paper's inputs and target."""
    folder = Folder(comparison / "area")
    if not (folder.path / "comparison.json").exists():
        raise InputError(
            f"--comparison {comparison}: give a folder of learn compare or learn tune, for the area"
        )
    features = folder.record().conditions.features
    if features != "paper":
        raise InputError(
            f"--comparison {comparison}: is on {features} features, not the paper's"
        )
    return folder


def results(folder: Folder, kind: str) -> Shown:
    """Return the results that have scores, by model, in the order of Table 4."""
    return {model: result for model, found, result in _scored(folder) if found == kind}


def _searched(folder: Folder) -> Shown:
    """Return the results of searches that judged enough candidates, by model."""
    return {
        stored.model: stored.result.content()
        for stored in folder.results()
        if stored.kind == "tuned"
        and stored.result.test is not None
        and stored.result.search is not None
        and tables.winner_of(stored.result.search) != NOT_SEARCHED
    }


def _scored(folder: Folder) -> list[tuple[str, str, dict[str, Any]]]:
    """Return model, kind and result of all that have scores."""
    return [
        (stored.model, stored.kind, stored.result.content())
        for stored in folder.results()
        if stored.result.test is not None
    ]


def spread(folder: Folder) -> float:
    """Return variance over mean of the test areas [%], as in `paper.SPREAD`."""
    model, kind, _ = _scored(folder)[0]
    truth, _ = folder.prediction(kind, model)
    return float(truth.var() / truth.mean())


def table_2(comparison: Path | None = None) -> Report:
    """Tabulate search spaces and optima."""
    tuned = {} if comparison is None else _searched(opened(comparison))
    rows: list[tuple[object, ...]] = []
    for model, space in SPACES.items():
        search, found = (
            tuned.get(model, {}).get(name, {}) for name in ("search", "settings")
        )
        default = "the library's" if search.get("winner") == "baseline" else ""
        for name, values in space.items():
            theirs = _value(OPTIMA[model][name])
            ours = _value(found[name]) if name in found else default
            same = (
                "" if not (found or default) else "same" if ours == theirs else "another"
            )
            parameter, tried = name.removeprefix("estimator__"), _values(values)
            rows.append(
                (_title(model), parameter, len(values), tried, theirs, ours, same)
            )
    header = (
        "model",
        "hyperparameter",
        "points",
        "values_tried",
        "paper_optimum",
        "our_optimum",
    )
    return Report({"table-2": rows_of((*header, "deviation"), rows)})


def _title(model: str) -> str:
    return MODELS[model].title


def _values(values: Sequence[Any]) -> str:
    """Write all values, of very many the first and the last ones."""
    texts = [_value(value) for value in values]
    return ", ".join(texts if len(texts) <= MANY else [*texts[:5], "...", *texts[-2:]])


def _value(value: Any) -> str:
    """Write a value; the sizes of a network's layers are a list in results, a tuple in spaces."""
    if isinstance(value, tuple | list):
        return "-".join(map(str, value))
    return "none" if value is None else str(value)


def table_3(comparison: Path) -> Report:
    """Tabulate the times of the searches."""
    tuned = _searched(opened(comparison))
    rows: list[tuple[object, ...]] = []
    for model, theirs in paper.TUNING_SECONDS.items():
        search = tuned.get(model, {}).get("search")
        if search is None:
            rows.append((_title(model), "", float(theirs), "", "not searched"))
            continue
        ours = float(tuned[model]["times"]["search"])
        reason = why("search", done=search["fits"], nominal=search["fits_nominal"])
        if search["how"] != "whole grid":
            reason = f"{search['how']} of the grid searched; {reason}"
        rows.append((_title(model), ours, float(theirs), ratio(ours, theirs), reason))
    header = ("model", "ours_s", "paper_s", "ours_over_paper", "explanation")
    return Report({"table-3": rows_of(header, rows)})


def table_4(comparison: Path) -> Report:
    """Tabulate scores and times of all models, and how far they are from the paper's."""
    ours = opened(comparison)
    here = spread(ours)
    rows = [
        (
            _title(model),
            tables.kind_text(model, kind),
            *_scores_and_times(model, kind, result, here),
        )
        for model, kind, result in _scored(ours)
    ]
    pairs = [
        f"{n}{end}"
        for n in (*tables.SCORES.values(), "fit_s", "predict_s")
        for end in ENDS
    ]
    header = ("model", "result", *pairs, "nMAE_ratio", "unexplained_ratio", "explanation")
    return Report({"table-4": rows_of(header, rows)})


def _scores_and_times(
    model: str, kind: str, result: dict[str, Any], here: float
) -> Iterator[str]:
    """Yield the cells of a row of Table 4, ours and the paper's in turn."""
    theirs, times = paper.TEST.get(kind, {}).get(model), result.get("times") or {}
    for name in tables.SCORES:
        yield f"{result['test'][name]:.2f}"
        yield f"{getattr(theirs, name):.2f}" if theirs else ""
    for place, name in enumerate(("fit", "test")):
        yield "" if times.get(name) is None else f"{times[name]:.3g}"
        yield f"{paper.TIMES[kind][model][place]:.3g}" if theirs else ""
    if theirs is None:
        yield from ("", "", why("library"))
        return
    yield ratio(result["test"]["nmae"], theirs.nmae)
    yield ratio(100 - result["test"]["r2"], 100 - theirs.r2)
    reasons = [f"nMSE x {here / paper.SPREAD:.2g} by the areas' spread, at equal R2"]
    if abs(paper.spread_of(theirs) / paper.SPREAD - 1) > BELONG:
        reasons.insert(0, why("two-spreads"))
    search = result["search"] and SearchReport.model_validate(result["search"])
    if search and tables.winner_of(search) == NOT_SEARCHED:
        reasons.insert(0, why("few"))
    yield "; ".join(reasons)


# Times of Table 4, in its order.
TIMES = {"fit": "fit [s]", "test": "prediction of\nall test rows [s]"}


def predictions(comparison: Path) -> Report:
    """Draw predictions over truth, of baselines and of tuned models, where there are any."""
    header, folder, tables, pictures = (
        ("model", "solved", "predicted"),
        opened(comparison),
        {},
        {},
    )
    for kind in ("baseline", "tuned"):
        if shown := results(folder, kind):
            rows, pictures[f"predictions-{kind}"] = _predictions(folder, kind, shown)
            tables[f"predictions-{kind}"] = rows_of(header, rows)
    return Report(tables, pictures)


def _predictions(
    ours: Folder, kind: str, shown: Shown
) -> tuple[list[tuple[object, ...]], Any]:
    """Return rows and figure of one kind of results, tuned ones beside the baselines."""
    columns = min(3, len(shown))
    lines = -(-len(shown) // columns)
    figure = new_figure(max(3.5 * columns, 4.6), 3.1 * lines + 0.4)
    axes = figure.subplots(lines, columns, squeeze=False).ravel()
    rows: list[tuple[object, ...]] = []
    for model, axis in zip(shown, axes, strict=False):
        for each in dict.fromkeys(("baseline", kind)):
            if ours.result(each, model):
                dots = _draw_prediction(axis, ours, each, model)
                rows += dots if each == kind else []
        axis.set_title(MODELS[model].title, fontsize=10)
    for axis in axes[len(shown) :]:
        axis.set_axis_off()
    figure.supxlabel("solved area [%]", fontsize=10)
    figure.supylabel("predicted area [%]", fontsize=10)
    return rows, figure


def _draw_prediction(
    axis: Any, folder: Folder, kind: str, model: str
) -> list[tuple[object, ...]]:
    """Draw dots for a model; return its rows for the table."""
    truth, predicted = folder.prediction(kind, model)
    result = folder.result(kind, model)
    if result is None or result.test is None:
        raise InputError(f"{folder.path} has no scores of {model}, {kind}")
    colour = COLOURS[0] if kind == "baseline" else COLOURS[1]
    label = (
        f"{kind}: R² {result.test.r2:.2f} %\n(paper's {paper.TEST[kind][model].r2:.2f} %)"
    )
    if not axis.lines:
        parity_axes(axis, truth)
    draw_parity(axis, truth, predicted, label=label, color=colour, **DOTS[kind])
    axis.legend(loc="lower right", fontsize=7, markerscale=2, framealpha=0.9)
    return [(model, *few(pair)) for pair in zip(truth, predicted, strict=True)]


def bars(comparison: Path) -> Report:
    """Draw scores and times of the baselines as bars, the paper's beside ours, if there are any.

    Of R2 the rest to 100 % is drawn, for good models look alike in R2.
    """
    shown, theirs = results(opened(comparison), "baseline"), paper.TEST["baseline"]
    if not shown:
        return Report({})
    pairs: dict[str, list[tuple[Any, float]]] = {}
    for name, title in tables.SCORES.items():
        both = (
            (found["test"][name], getattr(theirs[m], name)) for m, found in shown.items()
        )
        pairs[f"{title} [%]"] = list(both)
    for place, (name, title) in enumerate(TIMES.items()):
        took = {
            model: (found.get("times") or {}).get(name) for model, found in shown.items()
        }
        pairs[title] = [(took[m], paper.TIMES["baseline"][m][place]) for m in shown]
    figure = new_figure(max(7.5, 2.2 + len(shown)), 10.5)
    axes = figure.subplots(len(pairs), 1, sharex=True)
    names = [MODELS[model].title.replace(" ", "\n") for model in shown]
    rows: list[tuple[object, ...]] = []
    for axis, (title, values) in zip(axes, pairs.items(), strict=True):
        quantity = title.replace("\n", " ")
        rows += [
            (model, quantity, *pair) for model, pair in zip(shown, values, strict=True)
        ]
        drawn = pd.DataFrame(values, names, ("ours", "the paper's"), dtype=float)
        drawn = 100 - drawn if title.startswith("R2") else drawn
        drawn.plot.bar(
            ax=axis, logy=True, rot=0, legend=axis is axes[0], color=COLOURS[:5:4]
        )
        for each in axis.containers:
            axis.bar_label(each, fmt="%.3g", fontsize=7, padding=1)
        axis.set_ylabel(title.replace("R2", "1 - R²"), fontsize=9)
        axis.margins(y=0.25)
    return Report(
        {"bars": rows_of(("model", "quantity", "ours", "paper"), rows)}, {"bars": figure}
    )


Row = tuple[str, str, str, str, str, str]

HEADER = ("quantity", "section", "paper", "ours", "deviation", "explanation")


def numbers(database: Path, comparison: Path | None = None) -> Report:
    """Collect the numbers in the paper's text that can be compared with the inputs at hand."""
    rows = [*_of_the_database(database)]
    if comparison is not None:
        rows += _of_the_comparison(comparison)
    return Report({"numbers": rows_of(HEADER, rows)})


def _of_the_database(path: Path) -> Iterator[Row]:
    rows = finished(path)
    area, seconds, done = rows["area_percent"], rows["solve_seconds"], len(rows)
    with Reader(path) as reader:
        failed = int((reader.column("status") == Status.FAILED).sum())
    yield _row("rows of the database", "3.2", PAPER_ROWS, done, "as asked for", "{:,.0f}")
    yield "failed simulations", "3.1", "some", f"{failed:,}", "", ""
    reason, solver = why("areas", largest=AREA_MAX), why("solver")
    yield _row("largest area [%]", "Table 1", AREA_MAX, float(area.max()), reason)
    below = 100 * float((area <= AREA_MAX).mean())
    yield _row(
        "rows up to the paper's largest area [%]", "Table 1", 100, below, reason, "{:.3g}"
    )
    mean, longest = float(seconds.mean()), float(seconds.max())
    yield _row("mean time of a simulation [s]", "3.2, 4.4", PAPER_SOLVE, mean, solver)
    yield _row("longest simulation [s]", "2.4", LONGEST_SOLVE, longest, solver)
    theirs, ours = PAPER_ROWS * PAPER_SOLVE, done * mean
    texts = time_of(theirs), time_of(ours), f"1/{theirs / ours:,.0f}"
    yield "all simulations, one after another", "3.2", *texts, solver


def time_of(seconds: float) -> str:
    """Write a time in a unit that suits it."""
    units = {1e-3: ("us", 1e6), 1.0: ("ms", 1e3), 600.0: ("s", 1.0), 1e6: ("h", 1 / 3600)}
    unit, number = next(
        (u for most, u in units.items() if seconds < most), ("d", 1 / 86400)
    )
    return f"{number * seconds:.3g} {unit}"


def _of_the_comparison(comparison: Path) -> Iterator[Row]:
    folder = opened(comparison)
    found = folder.record().conditions
    limit = found.area_max
    reason = (
        "as asked for" if limit is None else f"rows with areas up to {limit:g} % only"
    )
    yield _row("rows that train", "3.2", TRAIN_ROWS, found.train_rows, reason, "{:,.0f}")
    yield _row("rows that test", "3.2", PAPER_TESTS, found.test_rows, reason, "{:,.0f}")
    what, here = "variance of test areas over their mean [%]", spread(folder)
    yield _row(what, "Table 4", paper.SPREAD, here, why("spread"), "{:.3g}")


def _row(
    quantity: str,
    section: str,
    theirs: float,
    ours: float,
    reason: str,
    form: str = "{:.4g}",
) -> Row:
    """Return a row; equal numbers need no explanation."""
    texts = form.format(theirs), form.format(ours)
    apart = ("none", "") if texts[0] == texts[1] else (ratio(ours, theirs), reason)
    return quantity, section, *texts, *apart
