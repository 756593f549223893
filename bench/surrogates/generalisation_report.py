"""`python -m bench generalisation`: scores and verdicts, and predictions over truth."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from bench.page.content import Content, Figure, Table
from bench.picture import new_figure
from bench.report import Report
from bench.surrogates.generalisation import Judged
from bench.surrogates.verdict import verdict
from bench.table import formatted

SHOWN = (
    *("tested_on", "features", "trained", "judged", "nmse", "nmae", "r2", "flagged", "covered"),
    "verdict",
)
"""Columns that the page shows."""

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


def contents(folder: Path) -> list[Content]:
    """List what a page shows of a folder that holds this report."""
    table = folder / "generalisation.csv"
    caption = (
        "Prediction over truth where the surrogate was not trained: a row for each feature"
        " set, a column for each case; dots off the diagonal are wrong. Statistics such as"
        " curvatures depend on the spacing of the nodes, a loose solve among the features"
        " does not."
    )
    pictures = sorted(folder.glob("generalisation-*.png"))
    return [
        *(Figure(picture, caption, data=(table,)) for picture in pictures),
        Table(
            table,
            "Scores [%]; shares (0 to 1) of rows flagged as outside the training ranges, and"
            " covered by the 90 % intervals; and what follows.",
            columns=SHOWN,
        ),
    ]


def _picture(model: str, found: Sequence[Judged]) -> Any:
    """Draw prediction over truth, as in section 4.3: a row a feature set, a column a case."""
    mine = [judged for judged in found if judged.row["model"] == model]
    features = list(dict.fromkeys(judged.row["features"] for judged in mine))
    cases = list(dict.fromkeys(judged.row["tested_on"] for judged in mine))
    figure = new_figure(2.3 * len(cases), 2.5 * len(features))
    axes = figure.subplots(len(features), len(cases), squeeze=False, sharex=True, sharey=True)
    ends = [0.0, max(float(judged.truth.max()) for judged in mine)]
    for judged in mine:
        row = judged.row
        axis = axes[features.index(row["features"]), cases.index(row["tested_on"])]
        axis.plot(ends, ends, "-", lw=0.8, color="0.4")
        axis.plot(judged.truth, judged.prediction, ".", ms=2)
        axis.annotate(f"R² {row['r2']:.2f} %", (0.05, 0.9), xycoords="axes fraction", fontsize=8)
        axis.set_ylim(-0.05 * ends[1], 1.25 * ends[1])
    for axis, case in zip(axes[0], cases, strict=True):
        axis.set_title(case, fontsize=9)
    for axis, name in zip(axes[:, 0], features, strict=True):
        axis.set_ylabel(f"{name}: predicted [%]")
    figure.supxlabel("effective contact area by the solver [%]")
    return figure
