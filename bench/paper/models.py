"""The paper's nine models beside ours: Tables 2 to 4."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from bench.contents import Content
from bench.files import write_table
from bench.paper.facts import TRAIN_ROWS
from bench.paper.texts import DIGITS, ratio, table, why
from gen.runtime.errors import InputError
from learn.comparison import paper, tables
from learn.comparison.folder import Folder
from learn.comparison.spaces import OPTIMA, SPACES
from learn.metrics import Scores
from learn.models import MODELS

ALIKE = 1.3  # unexplained variances count as alike up to this ratio
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
    features = folder.record()["conditions"].get("features", "paper")
    if features != "paper":
        raise InputError(f"--comparison {comparison}: is on {features} features, not the paper's")
    return folder


def results(folder: Folder, kind: str) -> Shown:
    """Return the results that have scores, by model, in the order of Table 4."""
    return {model: result for model, found, result in _scored(folder) if found == kind}


def _scored(folder: Folder) -> list[tuple[str, str, dict[str, Any]]]:
    """Return model, kind and result of all that have scores."""
    return [each for each in folder.results() if each[2].get("test") is not None]


def spread(folder: Folder) -> float:
    """Return variance over mean of the test areas [%], as in `paper.SPREAD`."""
    model, kind, _ = _scored(folder)[0]
    truth, _ = folder.prediction(kind, model)
    return float(truth.var() / truth.mean())


def table_2(folder: Path, comparison: Path | None = None) -> list[Content]:
    """Tabulate search spaces and optima."""
    tuned = {} if comparison is None else results(opened(comparison), "tuned")
    rows: list[tuple[object, ...]] = []
    for model, space in SPACES.items():
        search, found = (tuned.get(model, {}).get(name, {}) for name in ("search", "settings"))
        default = "the library's" if search.get("winner") == "baseline" else ""
        for name, values in space.items():
            theirs = _value(OPTIMA[model][name])
            ours = _value(found[name]) if name in found else default
            same = "" if not (found or default) else "same" if ours == theirs else "another"
            parameter, tried = name.removeprefix("estimator__"), _values(values)
            rows.append((_title(model), parameter, len(values), tried, theirs, ours, same))
    header = ("model", "hyperparameter", "points", "values_tried", "paper_optimum", "our_optimum")
    path = write_table(folder / "table-2.csv", (*header, "deviation"), rows)
    missing = ", ".join(_title(model) for model in SPACES if model not in tuned)
    said = f" Not searched here: {missing}; learn tune does that." if missing else ""
    return [table(path, missing=said)]


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


def table_3(folder: Path, comparison: Path) -> list[Content]:
    """Tabulate the times of the searches."""
    tuned = results(opened(comparison), "tuned")
    rows: list[tuple[object, ...]] = []
    for model, theirs in paper.TUNING_SECONDS.items():
        search = tuned.get(model, {}).get("search")
        if search is None:
            rows.append((_title(model), "", float(theirs), "", "not searched here"))
            continue
        ours = float(tuned[model]["times"]["search"])
        reason = why("search", done=search["fits"], nominal=search["fits_nominal"])
        if search["how"] != "whole grid":
            reason = f"{search['how']} of the grid searched; {reason}"
        rows.append((_title(model), ours, float(theirs), ratio(ours, theirs), reason))
    header = ("model", "ours_s", "paper_s", "ours_over_paper", "explanation")
    return [table(write_table(folder / "table-3.csv", header, rows, DIGITS))]


def table_4(folder: Path, comparison: Path) -> list[Content]:
    """Tabulate scores and times of all models, and how far they are from the paper's."""
    ours = opened(comparison)
    here = spread(ours)
    rows = [
        (_title(model), kind, *_scores_and_times(model, kind, result, here))
        for model, kind, result in _scored(ours)
    ]
    pairs = [f"{n}{end}" for n in (*tables.SCORES.values(), "fit_s", "predict_s") for end in ENDS]
    header = ("model", "result", *pairs, "nMAE_ratio", "unexplained_ratio", "explanation")
    path = write_table(folder / "table-4.csv", header, rows)
    trained = ours.record()["conditions"]["train_rows"]
    return [table(path, rows=trained, papers=TRAIN_ROWS, here=here, there=paper.SPREAD)]


def _scores_and_times(model: str, kind: str, result: dict[str, Any], here: float) -> Iterator[str]:
    """Yield the cells of a row of Table 4, ours and the paper's in turn."""
    theirs, times = paper.TEST[kind][model], result.get("times") or {}
    for name in tables.SCORES:
        yield f"{result['test'][name]:.2f}"
        yield f"{getattr(theirs, name):.2f}"
    for name, published in zip(("fit", "test"), paper.TIMES[kind][model], strict=True):
        yield "" if times.get(name) is None else f"{times[name]:.3g}"
        yield f"{published:.3g}"
    unexplained = (100 - result["test"]["r2"]) / (100 - theirs.r2)
    yield ratio(result["test"]["nmae"], theirs.nmae)
    yield ratio(unexplained, 1.0)
    yield _why(theirs, unexplained, here)


def _why(theirs: Scores, unexplained: float, here: float) -> str:
    """Explain the distance of a row from the paper's, as far as it is known."""
    reasons = [] if unexplained <= ALIKE else ["worse R2: not explained"]
    if abs(paper.spread_of(theirs) / paper.SPREAD - 1) > BELONG:
        reasons.append(why("two-spreads"))
    if unexplained <= ALIKE:
        reasons.append(f"R2 alike; nMSE x {here / paper.SPREAD:.2g} by the areas' spread")
    return "; ".join(reasons)
