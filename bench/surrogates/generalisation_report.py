"""`python -m bench generalisation`: scores and verdicts, and predictions over truth."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from bench.picture import new_figure
from bench.report import Report
from bench.surrogates.cases import HOME
from bench.surrogates.generalisation import LEVEL, Judged
from bench.table import formatted
from gen.runtime.figure import draw_parity, parity_axes

PRINTED = {
    "tested on": "{tested_on}",
    "model": "{model}",
    "features": "{features}",
    "rows": "{judged}",
    "nMSE": "{nmse:.2f}",
    "nMAE": "{nmae:.2f}",
    "nMaxE": "{nmaxe:.2f}",
    "R2": "{r2:.2f}",
    "flagged": "{flagged:.0%}",
    "in 90 %": "{covered:.0%}",
    "verdict": "{verdict}",
}
Row = Mapping[str, Any]  # a case as `bench.surrogates.generalisation.judge` describes it
# Times the reference's error up to which a surrogate is as good as where it was trained.
HOLDS = 1.5
# Times the reference's error, and R2 [%], within which it is worse but not useless.
USABLE, USABLE_R2 = 4.0, 95.0
WARNED = 0.5  # share of flagged rows above which a user would notice
MENDS = 0.7  # times the error that is left, at most, by what is called a cure


def report(found: Sequence[Judged]) -> Report:
    """Make a report of what was measured, with a picture for each model."""
    rows = [judged.row for judged in found]
    judged = [{**row, "verdict": verdict(row, rows)} for row in rows]
    models = dict.fromkeys(row["model"] for row in rows)
    return Report(
        {"generalisation": judged},
        pictures={f"generalisation-{model}": _picture(model, found) for model in models},
        text=f"Trained on the paper preset, tested elsewhere [%]:\n\n{formatted(PRINTED, judged)}",
    )


def _picture(model: str, found: Sequence[Judged]) -> Any:
    """Draw prediction over truth, as in section 4.3: a row a feature set, a column a case."""
    mine = [judged for judged in found if judged.row["model"] == model]
    features = list(dict.fromkeys(judged.row["features"] for judged in mine))
    cases = list(dict.fromkeys(judged.row["tested_on"] for judged in mine))
    figure = new_figure(2.3 * len(cases), 2.5 * len(features))
    axes = figure.subplots(len(features), len(cases), squeeze=False, sharex=True, sharey=True)
    areas = np.concatenate([judged.truth for judged in mine])
    for judged in mine:
        row = judged.row
        axis = axes[features.index(row["features"]), cases.index(row["tested_on"])]
        parity_axes(axis, areas)
        draw_parity(axis, judged.truth, judged.prediction, marker=".", ms=2, ls="none")
        axis.annotate(f"R² {row['r2']:.2f} %", (0.05, 0.9), xycoords="axes fraction", fontsize=8)
    for axis, case in zip(axes[0], cases, strict=True):
        axis.set_title(case, fontsize=9)
    for axis, name in zip(axes[:, 0], features, strict=True):
        axis.set_ylabel(f"{name}: predicted [%]")
    figure.supxlabel("effective contact area by the solver [%]")
    return figure


def verdict(row: Row, rows: Sequence[Row]) -> str:
    """Judge a row among all rows of a table."""
    state, flagged = state_of(row), row["flagged"]
    parts = [f"{state}: {row['nmae'] / row['reference']:.3g} x the error at home"]
    if row["tested_on"] == HOME:
        parts = ["the measure for the others"]
    narrow = f"intervals too narrow ({row['covered']:.0%} inside)"
    parts.append("intervals hold" if covers(row) else narrow)
    if state != "holds" and flagged > WARNED:
        parts.append(f"says so ({flagged:.0%} of rows flagged)")
    elif state != "holds":
        parts.append(f"does not say so (only {flagged:.0%} of rows flagged)")
    if row["grid_nmae"] > row["reference"]:
        parts.append(f"the solved area itself changes by {row['grid_nmae']:.3g} % with the grid")
    if state != "holds" or not covers(row):
        parts.extend(_cures(row, rows))
    return "; ".join(parts)


def state_of(row: Row) -> str:
    """Say whether it "holds", is "worse" but of use, or "fails"."""
    ratio = row["nmae"] / row["reference"]
    if ratio <= HOLDS:
        return "holds"
    return "worse" if ratio <= USABLE and row["r2"] >= USABLE_R2 else "fails"


def covers(row: Row) -> bool:
    """Say whether as many truths lie in the intervals as should, or more."""
    return bool(row["covered"] >= LEVEL - row["slack"])


def _cures(row: Row, rows: Sequence[Row]) -> Iterator[str]:
    """Yield what was seen to mend it, or to help at least, by the errors it leaves."""
    better = {words: error for error, words in _tried(row, rows) if error <= MENDS * row["nmae"]}
    mended = [words for words, error in better.items() if error <= USABLE * row["reference"]]
    helped = [words for words in better if words not in mended]
    if not better:
        yield "nothing tried here mends its error"
    if mended:
        yield f"mended by {', or '.join(mended)}"
    if helped:
        yield f"helped by {', or '.join(helped)}"
    inside = row["mended_covered"]
    if not covers(row) and row["mending"] and inside >= LEVEL - row["slack"]:
        yield f"intervals calibrated on such rows hold ({inside:.0%} inside)"


def _tried(row: Row, rows: Sequence[Row]) -> Iterator[tuple[float, str]]:
    """Yield what was tried: the error that it leaves [%], in words."""
    same, nmae = ("tested_on", "model"), row["nmae"]
    alike = [each for each in rows if all(each[name] == row[name] for name in same)]
    others = [each for each in alike if each["features"] != row["features"]]
    if others:
        best = min(others, key=lambda other: other["nmae"])
        instead = f"(nMAE {best['nmae']:.3g} instead of {nmae:.3g} %)"
        yield best["nmae"], f"{best['features']} features {instead}"
    if row["mending"]:
        yield row["mended_nmae"], f"{row['mending']} rows of it (nMAE {row['mended_nmae']:.3g} %)"
    resampled = row["resampled_nmae"]
    if not math.isnan(resampled):
        yield resampled, f"features of every second node (nMAE {resampled:.3g} %)"
