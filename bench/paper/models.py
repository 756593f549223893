"""The paper's nine models beside ours: Tables 2 to 4, their pictures, and numbers in the text.

Our scores, times and optima are read from the folder of `learn compare` and `learn tune`. The
paper's are in `learn.comparison.paper`.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from bench.files import Row
from bench.paper.database import finished
from bench.paper.facts import AREA_MAX, LONGEST_SOLVE, TRAIN_ROWS, ratio, rounded, why
from bench.picture import COLOURS, new_figure
from bench.report import Report
from bench.surrogates.cost import PAPER_ROWS, PAPER_SOLVE, PAPER_TESTS
from gen.database import Reader
from gen.runtime.errors import InputError
from gen.runtime.figure import draw_parity, parity_axes
from gen.schema import Status
from learn.comparison import paper, tables
from learn.comparison.folder import Folder, Result, SearchReport, StoredScores, Times
from learn.comparison.paper import OPTIMA, SPACES
from learn.comparison.plots import DOTS
from learn.comparison.tables import NOT_SEARCHED
from learn.metrics import Scores
from learn.models import MODELS

BELONG = 0.15
"""Largest relative distance at which the paper's nMSE and R2 of a model may belong to one test set
[1]. The two scores give the variance of the test areas over their mean. Its distance is taken from
`paper.SPREAD`, the median over the models."""

MANY = 20
"""Number of values of a hyperparameter above which not all of them are listed."""


@dataclass(frozen=True)
class ScoredResult:
    """A result of a comparison that has scores."""

    model: str  # name of the model
    kind: str  # "baseline", "library" or "tuned"
    result: Result
    test: StoredScores  # scores on the test rows [%]
    times: Times  # times of the fit, the prediction and the search [s]


def area_folder(comparison: Path) -> Folder:
    """Open the part of a comparison that is about the area and has the paper's features.

    Parameters
    ----------
    comparison : Path
        Folder of `learn compare` and `learn tune`.

    Returns
    -------
    Folder
        The folder of the area's results.

    Raises
    ------
    InputError
        If the folder has no results for the area, or they are for other features.
    """
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


def _scored(folder: Folder) -> list[ScoredResult]:
    """Return the results that have scores and times, in the order of Table 4."""
    scored = []
    for stored in folder.results():
        result = stored.result
        if result.test is not None and result.times is not None:
            scored.append(
                ScoredResult(
                    model=stored.model,
                    kind=stored.kind,
                    result=result,
                    test=result.test,
                    times=result.times,
                )
            )
    return scored


def _of_kind(folder: Folder, kind: str) -> dict[str, ScoredResult]:
    """Return the results of one kind that have scores, by model, in the order of Table 4."""
    return {scored.model: scored for scored in _scored(folder) if scored.kind == kind}


def _searched(folder: Folder) -> dict[str, ScoredResult]:
    """Return the results of searches, by model.

    Searches that judged too few candidates to name a winner are left out.
    """
    return {
        model: scored
        for model, scored in _of_kind(folder, "tuned").items()
        if scored.result.search is not None
        and tables.winner_of(scored.result.search) != NOT_SEARCHED
    }


def spread(folder: Folder) -> float:
    """Compute the variance of our test areas over their mean; the paper's is `paper.SPREAD`.

    Parameters
    ----------
    folder : Folder
        A folder with at least one result that has scores.

    Returns
    -------
    float
        Variance over mean [%].
    """
    first = _scored(folder)[0]
    truth = folder.prediction(first.kind, first.model).truth
    return float(truth.var() / truth.mean())


def table_2(comparison: Path | None = None) -> Report:
    """Tabulate search spaces and optima (Table 2).

    Parameters
    ----------
    comparison : Path or None
        Folder of `learn tune`, which has our optima; None for the paper's optima alone.

    Returns
    -------
    Report
        Table `table-2`: one row for each model and hyperparameter.

    Raises
    ------
    InputError
        If the folder is refused by `area_folder`.
    """
    searched: dict[str, ScoredResult] = {}  # by the model
    if comparison is not None:
        searched = _searched(area_folder(comparison))
    rows: list[Row] = []
    for model, space in SPACES.items():
        for name, values in space.items():
            theirs = _in_words(OPTIMA[model][name])
            ours = _our_optimum(searched.get(model), name)
            rows.append(
                {
                    "model": MODELS[model].title,
                    "hyperparameter": name.removeprefix("estimator__"),
                    "points": len(values),
                    "values_tried": _list_in_words(values),
                    "paper_optimum": theirs,
                    "our_optimum": ours,
                    "deviation": _compared(searched.get(model), ours, theirs),
                }
            )
    return Report({"table-2": rows})


def _baseline_won(winner: ScoredResult) -> bool:
    """Return whether no candidate of a search was better than the settings of the baseline."""
    search = winner.result.search
    return search is not None and search.winner == "baseline"


def _our_optimum(winner: ScoredResult | None, name: str) -> str:
    """Return our value of a hyperparameter, by the result of the model's search.

    It is "" if the model was not searched (`winner` is None), or the result does not have the
    hyperparameter. If the baseline won and does not set it, it is "the library's".
    """
    if winner is None:
        return ""
    settings = winner.result.settings
    if name in settings:
        return _in_words(settings[name])
    if _baseline_won(winner):
        return "the library's"
    return ""


def _compared(winner: ScoredResult | None, ours: str, theirs: str) -> str:
    """Return "same" or "another", by the texts of our optimum and the paper's.

    It is "" if the model was not searched (`winner` is None), or its search has no optimum.
    """
    if winner is None:
        return ""
    has_optimum = winner.result.settings or _baseline_won(winner)
    if not has_optimum:
        return ""
    return "same" if ours == theirs else "another"


def _list_in_words(values: Sequence[Any]) -> str:
    """Write the values of a hyperparameter; of more than `MANY`, the first five and last two."""
    texts = [_in_words(value) for value in values]
    if len(texts) > MANY:
        texts = [*texts[:5], "...", *texts[-2:]]
    return ", ".join(texts)


def _in_words(value: Any) -> str:
    """Write the value of a hyperparameter as a text: numbers of a list are joined by hyphens."""
    # The sizes of a network's layers are a list in results, and a tuple in search spaces.
    if isinstance(value, tuple | list):
        return "-".join(map(str, value))
    if value is None:
        return "none"
    return str(value)


def table_3(comparison: Path) -> Report:
    """Tabulate the times of the searches (Table 3).

    Parameters
    ----------
    comparison : Path
        Folder of `learn tune`.

    Returns
    -------
    Report
        Table `table-3`: one row for each model. Our times of models that were not searched are
        empty.

    Raises
    ------
    InputError
        If the folder is refused by `area_folder`.
    """
    searched = _searched(area_folder(comparison))
    rows: list[Row] = []
    for model, theirs in paper.TUNING_SECONDS.items():
        ours: float | str = ""
        times_theirs = ""
        reason = "not searched"
        if model in searched:
            ours = float(searched[model].times.search)
            times_theirs = ratio(ours, theirs)
            reason = _reason_for_time(searched[model])
        rows.append(
            {
                "model": MODELS[model].title,
                "ours_s": ours,
                "paper_s": float(theirs),
                "ours_over_paper": times_theirs,
                "explanation": reason,
            }
        )
    return Report({"table-3": rows})


def _reason_for_time(searched: ScoredResult) -> str:
    """Return the reason why the time of a search differs from the paper's.

    The result is one of `_searched`.
    """
    search = searched.result.search
    assert search is not None  # all results of `_searched` have a search
    reason = why("search", done=search.fits, nominal=search.fits_nominal)
    if search.how != "whole grid":
        reason = f"{search.how} of the grid searched; {reason}"
    return reason


def table_4(comparison: Path) -> Report:
    """Tabulate scores and times of all models, ours beside the paper's (Table 4).

    Parameters
    ----------
    comparison : Path
        Folder of `learn compare` and `learn tune`.

    Returns
    -------
    Report
        Table `table-4`: one row for each result that has scores.

    Raises
    ------
    InputError
        If the folder is refused by `area_folder`.
    """
    folder = area_folder(comparison)
    our_spread = spread(folder)
    return Report(
        {"table-4": [_row_of_4(scored, our_spread) for scored in _scored(folder)]}
    )


def _row_of_4(scored: ScoredResult, our_spread: float) -> Row:
    """Return the row of Table 4 for a result: scores [%] and times [s], as texts.

    `our_spread` is from `spread` [%]. Columns of the paper and of ratios are empty for results with
    the library's settings, which the paper does not have.
    """
    theirs = paper.TEST.get(scored.kind, {}).get(scored.model)
    row: Row = {
        "model": MODELS[scored.model].title,
        "result": tables.kind_text(scored.model, scored.kind),
    }
    for name, title in tables.SCORES.items():
        row[title] = f"{getattr(scored.test, name):.2f}"
        row[f"{title}_paper"] = ""
        if theirs is not None:
            row[f"{title}_paper"] = f"{getattr(theirs, name):.2f}"
    row |= {
        "fit_s": _short(scored.times.fit),
        "fit_s_paper": "",
        "predict_s": _short(scored.times.test),
        "predict_s_paper": "",
        "nMAE_ratio": "",
        "unexplained_ratio": "",
        "explanation": why("library"),
    }
    if theirs is not None:
        fit_seconds, test_seconds = paper.TIMES[scored.kind][scored.model]
        row["fit_s_paper"] = _short(fit_seconds)
        row["predict_s_paper"] = _short(test_seconds)
        row["nMAE_ratio"] = ratio(scored.test.nmae, theirs.nmae)
        row["unexplained_ratio"] = ratio(100 - scored.test.r2, 100 - theirs.r2)
        row["explanation"] = _reason_for_scores(scored.result.search, theirs, our_spread)
    return row


def _short(seconds: float | None) -> str:
    """Write a time [s] with three digits; "" for None."""
    if seconds is None:
        return ""
    return f"{seconds:.3g}"


def _reason_for_scores(
    search: SearchReport | None, theirs: Scores, our_spread: float
) -> str:
    """Return the reasons why the scores of a model differ from the paper's scores `theirs`.

    The reasons are separated by semicolons. `search` is None for a baseline. `our_spread` is from
    `spread` [%].
    """
    reasons = []
    if search is not None and tables.winner_of(search) == NOT_SEARCHED:
        reasons.append(why("few"))
    distance = abs(paper.spread_of(theirs) / paper.SPREAD - 1)
    if distance > BELONG:
        reasons.append(why("two-spreads"))
    # nMSE is (1 - R2) times the spread of the test areas.
    factor = our_spread / paper.SPREAD
    reasons.append(f"nMSE x {factor:.2g} by the areas' spread, at equal R2")
    return "; ".join(reasons)


def predictions(comparison: Path) -> Report:
    """Draw predicted over solved areas, of baselines and of tuned models (sections 4.1 and 4.2).

    Parameters
    ----------
    comparison : Path
        Folder of `learn compare` and `learn tune`.

    Returns
    -------
    Report
        Tables and pictures `predictions-baseline` and `predictions-tuned`. A table and its picture
        are left out if the folder has no scores of this kind.

    Raises
    ------
    InputError
        If the folder is refused by `area_folder`, or a tuned model's baseline has no scores.
    """
    folder = area_folder(comparison)
    rows: dict[str, list[Row]] = {}
    pictures: dict[str, Any] = {}
    for kind in ("baseline", "tuned"):
        models = list(_of_kind(folder, kind))
        if models:
            name = f"predictions-{kind}"
            rows[name] = _predicted_rows(folder, kind, models)
            pictures[name] = _draw_predictions(folder, kind, models)
    return Report(rows, pictures)


def _predicted_rows(folder: Folder, kind: str, models: list[str]) -> list[Row]:
    """Return a row for each model and test row, with the solved and the predicted area [%]."""
    rows: list[Row] = []
    for model in models:
        for pair in zip(*folder.prediction(kind, model), strict=True):
            solved, predicted = rounded(pair)
            rows.append({"model": model, "solved": solved, "predicted": predicted})
    return rows


def _draw_predictions(folder: Folder, kind: str, models: list[str]) -> Any:
    """Return a figure with a panel for each model, three beside each other.

    The panel of a tuned model has the predictions of its baseline, too, if there are any. Raises
    InputError if this baseline has no scores.
    """
    columns = min(3, len(models))
    lines = math.ceil(len(models) / columns)
    figure = new_figure(max(3.5 * columns, 4.6), 3.1 * lines + 0.4)
    axes = figure.subplots(lines, columns, squeeze=False).ravel()
    kinds = dict.fromkeys(["baseline", kind])  # only one key if the kind is "baseline"
    for model, axis in zip(models, axes, strict=False):
        for drawn_kind in kinds:
            if folder.result(drawn_kind, model):
                _draw_prediction(axis, folder, drawn_kind, model)
        axis.set_title(MODELS[model].title, fontsize=10)
    for axis in axes[len(models) :]:  # empty places of the last line
        axis.set_axis_off()
    figure.supxlabel("solved area [%]", fontsize=10)
    figure.supylabel("predicted area [%]", fontsize=10)
    return figure


def _draw_prediction(axis: Any, folder: Folder, kind: str, model: str) -> None:
    """Draw the predictions of one result as dots; raise InputError if it has no scores."""
    truth, predicted = folder.prediction(kind, model)
    result = folder.result(kind, model)
    if result is None or result.test is None:
        raise InputError(f"{folder.path} has no scores of {model}, {kind}")
    colour = COLOURS[0] if kind == "baseline" else COLOURS[1]
    theirs = paper.TEST[kind][model]
    label = f"{kind}: R² {result.test.r2:.2f} %\n(paper's {theirs.r2:.2f} %)"
    if not axis.lines:  # the first predictions of this panel
        parity_axes(axis, truth)
    draw_parity(axis, truth, predicted, label=label, color=colour, **DOTS[kind])
    axis.legend(loc="lower right", fontsize=7, markerscale=2, framealpha=0.9)


FIT = "fit [s]"
"""Label of the panel with the times of the fits."""

PREDICTION = "prediction of\nall test rows [s]"
"""Label of the panel with the times of the predictions."""


def bars(comparison: Path) -> Report:
    """Draw scores and times of the baselines as bars, ours beside the paper's (section 4.1).

    Parameters
    ----------
    comparison : Path
        Folder of `learn compare`.

    Returns
    -------
    Report
        Table and picture `bars`; neither if there is no baseline.

    Raises
    ------
    InputError
        If the folder is refused by `area_folder`.
    """
    shown = _of_kind(area_folder(comparison), "baseline")
    if not shown:
        return Report({})
    panels = _panels_of_bars(shown)
    figure = new_figure(max(7.5, 2.2 + len(shown)), 10.5)
    axes = figure.subplots(len(panels), 1, sharex=True)
    names = [MODELS[model].title.replace(" ", "\n") for model in shown]
    rows: list[Row] = []
    for axis, (label, pairs) in zip(axes, panels.items(), strict=True):
        _draw_bars(axis, label, pairs, names, legend=axis is axes[0])
        for model, pair in zip(shown, pairs, strict=True):
            rows.append(
                {
                    "model": model,
                    "quantity": label.replace("\n", " "),
                    "ours": pair.ours,
                    "paper": pair.paper,
                }
            )
    return Report({"bars": rows}, pictures={"bars": figure})


@dataclass(frozen=True)
class Pair:
    """Our number and the paper's, in the same unit."""

    ours: float | None  # None for a time if the fit failed
    paper: float


def _panels_of_bars(shown: dict[str, ScoredResult]) -> dict[str, list[Pair]]:
    """Return the pairs of all baselines, by the label of their panel: scores [%] and times [s].

    The pairs of a panel are in the order of `shown`.
    """
    theirs = paper.TEST["baseline"]
    panels: dict[str, list[Pair]] = {}
    for name, title in tables.SCORES.items():
        panels[f"{title} [%]"] = [
            Pair(ours=getattr(scored.test, name), paper=getattr(theirs[model], name))
            for model, scored in shown.items()
        ]
    panels[FIT] = []
    panels[PREDICTION] = []
    for model, scored in shown.items():
        fit_seconds, test_seconds = paper.TIMES["baseline"][model]
        panels[FIT].append(Pair(ours=scored.times.fit, paper=fit_seconds))
        panels[PREDICTION].append(Pair(ours=scored.times.test, paper=test_seconds))
    return panels


def _draw_bars(
    axis: Any, label: str, pairs: list[Pair], names: list[str], *, legend: bool
) -> None:
    """Draw one panel with a pair of bars for each model, on a logarithmic axis.

    `names` are the texts below the pairs. For R2 the difference to 100 % is drawn, which shows how
    good models differ.
    """
    drawn = pd.DataFrame(
        [(pair.ours, pair.paper) for pair in pairs],
        index=names,
        columns=["ours", "the paper's"],
        dtype=float,
    )
    if label.startswith("R2"):
        drawn = 100 - drawn
    colours = (COLOURS[0], COLOURS[4])
    drawn.plot.bar(ax=axis, logy=True, rot=0, legend=legend, color=colours)
    for container in axis.containers:
        axis.bar_label(container, fmt="%.3g", fontsize=7, padding=1)
    axis.set_ylabel(label.replace("R2", "1 - R²"), fontsize=9)
    axis.margins(y=0.25)


def numbers(database: Path, comparison: Path | None = None) -> Report:
    """Collect the numbers in the paper's text, beside ours.

    Parameters
    ----------
    database : Path
        A database of the paper preset.
    comparison : Path or None
        Folder of `learn compare`; None to leave out the numbers about it.

    Returns
    -------
    Report
        Table `numbers`.

    Raises
    ------
    InputError
        If fewer than two rows are finished, or the folder is refused by `area_folder`.
    """
    rows = _of_the_database(database)
    if comparison is not None:
        rows += _of_the_comparison(comparison)
    return Report({"numbers": rows})


def _of_the_database(path: Path) -> list[Row]:
    """Return the rows of `numbers` about a database and its solve times."""
    rows = finished(path)
    areas = rows["area_percent"]
    seconds = rows["solve_seconds"]
    mean_seconds = float(seconds.mean())
    with Reader(path) as reader:
        failed = int((reader.column("status") == Status.FAILED).sum())
    our_total = len(rows) * mean_seconds
    paper_total = PAPER_ROWS * PAPER_SOLVE
    reason_for_areas = why("areas", largest=AREA_MAX)
    reason_for_times = why("solver")
    return [
        _number(
            "rows of the database",
            "3.2",
            PAPER_ROWS,
            len(rows),
            reason="as asked for",
            form="{:,.0f}",
        ),
        {
            "quantity": "failed simulations",
            "section": "3.1",
            "paper": "some",
            "ours": f"{failed:,}",
            "deviation": "",
            "explanation": "",
        },
        _number(
            "largest area [%]",
            "Table 1",
            AREA_MAX,
            float(areas.max()),
            reason=reason_for_areas,
        ),
        _number(
            "rows up to the paper's largest area [%]",
            "Table 1",
            100,
            100 * float((areas <= AREA_MAX).mean()),
            reason=reason_for_areas,
            form="{:.3g}",
        ),
        _number(
            "mean time of a simulation [s]",
            "3.2, 4.4",
            PAPER_SOLVE,
            mean_seconds,
            reason=reason_for_times,
        ),
        _number(
            "longest simulation [s]",
            "2.4",
            LONGEST_SOLVE,
            float(seconds.max()),
            reason=reason_for_times,
        ),
        {
            "quantity": "all simulations, one after another",
            "section": "3.2",
            "paper": _duration(paper_total),
            "ours": _duration(our_total),
            "deviation": f"1/{paper_total / our_total:,.0f}",
            "explanation": reason_for_times,
        },
    ]


def _duration(seconds: float) -> str:
    """Write a time [s] with three digits, in us, ms, s, hours (h) or days (d)."""
    if seconds < 1e-3:
        return f"{1e6 * seconds:.3g} us"
    if seconds < 1.0:
        return f"{1e3 * seconds:.3g} ms"
    if seconds < 600.0:
        return f"{seconds:.3g} s"
    if seconds < 1e6:
        return f"{seconds / 3600:.3g} h"
    return f"{seconds / 86400:.3g} d"


def _of_the_comparison(comparison: Path) -> list[Row]:
    """Return the rows of `numbers` about the rows that train and test the models."""
    folder = area_folder(comparison)
    conditions = folder.record().conditions
    reason = "as asked for"
    if conditions.area_max is not None:
        reason = f"rows with areas up to {conditions.area_max:g} % only"
    return [
        _number(
            "rows that train",
            "3.2",
            TRAIN_ROWS,
            conditions.train_rows,
            reason=reason,
            form="{:,.0f}",
        ),
        _number(
            "rows that test",
            "3.2",
            PAPER_TESTS,
            conditions.test_rows,
            reason=reason,
            form="{:,.0f}",
        ),
        _number(
            "variance of test areas over their mean [%]",
            "Table 4",
            paper.SPREAD,
            spread(folder),
            reason=why("spread"),
            form="{:.3g}",
        ),
    ]


def _number(
    quantity: str,
    section: str,
    theirs: float,
    ours: float,
    *,
    reason: str,
    form: str = "{:.4g}",
) -> Row:
    """Return a row of `numbers` that compares our number with the paper's, `theirs`.

    `section` is a section or table of the paper. `form` is the format of both numbers. If both
    texts are equal, the deviation is "none", and the explanation "" instead of `reason`.
    """
    paper_text = form.format(theirs)
    our_text = form.format(ours)
    row: Row = {
        "quantity": quantity,
        "section": section,
        "paper": paper_text,
        "ours": our_text,
        "deviation": "none",
        "explanation": "",
    }
    if paper_text != our_text:
        row["deviation"] = ratio(ours, theirs)
        row["explanation"] = reason
    return row
