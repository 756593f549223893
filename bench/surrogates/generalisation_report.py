"""`python -m bench generalisation`: scores and verdicts, and predictions over truth."""

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from bench.page import content
from bench.picture import new_figure
from bench.report import Report
from bench.surrogates.generalisation import Judged
from bench.surrogates.verdict import covers, verdict
from bench.table import record

WIDTH = 190
"""Letters of a line of the printed table."""


def report(found: Sequence[Judged]) -> Report:
    """Make a report of what was measured, with a picture for each model."""
    rows = [judged.row for judged in found]
    models = dict.fromkeys(row.model for row in rows)
    return Report(
        {"generalisation": [{**record(row), "verdict": verdict(row, rows)} for row in rows]},
        pictures={f"generalisation-{model}": _picture(model, found) for model in models},
        text=_table(found),
    )


def contents(folder: Path) -> list[content.Content]:
    """List what a folder of this report holds, with what to see in it."""
    table = folder / "generalisation.csv"
    return [
        *(
            content.Figure(
                picture,
                "Prediction over truth where the surrogate was not trained: a row for each feature"
                " set, a column for each case; dots off the diagonal are wrong. Statistics such as"
                " curvatures depend on the spacing of the nodes, a loose solve among the features"
                " does not.",
                data=(table,),
            )
            for picture in sorted(folder.glob("generalisation-*.png"))
        ),
        content.Table(
            table,
            "Scores [%]; shares (0 to 1) of rows flagged as outside the training ranges, and"
            " covered by the 90 % intervals; and what follows.",
            columns=(
                "tested_on", "features", "trained", "judged", "nmse", "nmae", "r2", "flagged",
                "covered", "verdict",
            ),
        ),
    ]  # fmt: skip


def _table(found: Sequence[Judged]) -> str:
    """Return the table for people."""
    rows = [judged.row for judged in found]
    table = Table(title="Trained on the paper preset, tested elsewhere [%]")
    for name in ("Tested on", "Features"):
        table.add_column(name)
    for name in ("rows", "nMSE", "nMAE", "nMaxE", "R2", "flagged", "in 90 %"):
        table.add_column(name, justify="right")
    table.add_column("Verdict", overflow="fold")
    several = len({row.model for row in rows}) > 1
    last = ""
    for row in rows:
        what = f"{row.tested_on}, {row.model}" if several else row.tested_on
        if row.features != last and last:
            table.add_section()
        last = row.features
        numbers = (f"{row.nmse:.2f}", f"{row.nmae:.2f}", f"{row.nmaxe:.2f}", f"{row.r2:.2f}")
        shares = (
            f"{100 * row.flagged:.0f}",
            f"{100 * row.covered:.0f}{'' if covers(row) else '!'}",
        )
        table.add_row(what, row.features, str(row.judged), *numbers, *shares, verdict(row, rows))
    text = io.StringIO()
    Console(file=text, width=WIDTH).print(table)
    return text.getvalue()


def _picture(model: str, found: Sequence[Judged]) -> Any:
    """Draw prediction over truth, as in section 4.3: a row a feature set, a column a case."""
    mine = [judged for judged in found if judged.row.model == model]
    features = list(dict.fromkeys(judged.row.features for judged in mine))
    cases = list(dict.fromkeys(judged.row.tested_on for judged in mine))
    figure = new_figure(2.3 * len(cases), 2.5 * len(features))
    axes = figure.subplots(len(features), len(cases), squeeze=False, sharex=True, sharey=True)
    ends = [0.0, max(float(judged.truth.max()) for judged in mine)]
    for judged in mine:
        axis = axes[features.index(judged.row.features), cases.index(judged.row.tested_on)]
        axis.plot(ends, ends, "-", lw=0.8, color="0.4")
        axis.plot(judged.truth, judged.prediction, ".", ms=2)
        axis.annotate(
            f"R² {judged.row.r2:.2f} %", (0.05, 0.9), xycoords="axes fraction", fontsize=8
        )
        axis.set_ylim(-0.05 * ends[1], 1.25 * ends[1])
    for axis, case in zip(axes[0], cases, strict=True):
        axis.set_title(case, fontsize=9)
    for row, name in zip(axes, features, strict=True):
        row[0].set_ylabel(f"{name}: predicted [%]")
    figure.supxlabel("effective contact area by the solver [%]")
    return figure
