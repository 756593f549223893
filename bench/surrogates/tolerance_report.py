"""`python -m bench tolerance`: errors over time, and which tolerance to choose."""

from collections.abc import Iterator, Sequence
from itertools import takewhile
from pathlib import Path
from typing import Any

from bench.files import content_of
from bench.page.content import Content, Figure, Table, Words
from bench.picture import draw_curves, new_figure
from bench.report import Report
from bench.style import STYLES
from bench.surrogates.clock import time_of
from bench.surrogates.tolerance import Row
from bench.surrogates.tolerance_labels import DEFAULT, TIGHT

GOOD = 1.02
"""Test errors count as the tight labels' up to this ratio."""

SHOWN = (
    *("tolerance", "features", "seconds", "ratio", "label_nmae", "label_force", "right"),
    *("nmse", "nmae", "r2", "own_nmae"),
)
"""Columns that the page shows."""


def report(rows: Sequence[Row]) -> Report:
    """Make a report of what was measured."""
    return Report(
        {"tolerance": rows},
        pictures={"tolerance": _picture(rows)},
        text="\n".join(lines(rows)),
        text_name="tolerance",
    )


def contents(folder: Path) -> list[Content]:
    """List what a page shows of a folder that holds this report."""
    table = folder / "tolerance.csv"
    return [
        Figure(
            folder / "tolerance.png",
            "Error over the time of the database at several tolerances of the solver, written"
            " beside the crosses. Black: error of the areas that are learnt. Colours: error of"
            " kernel ridge that learnt them, on test rows solved tightly; dashed, what areas"
            " without error give. Where the black line is well below, a tighter tolerance buys"
            " nothing.",
            data=(table,),
        ),
        *map(Words, content_of(folder / "tolerance.txt").decode().splitlines()),
        Table(
            table,
            "The same as numbers [%], and the processor time of the database [s], also over that at"
            " the default tolerance. label: of the areas and forces learnt; right: rows with the"
            " exact number of contact nodes; own: tested on rows of the same tolerance.",
            columns=SHOWN,
        ),
    ]


def lines(rows: Sequence[Row]) -> Iterator[str]:
    """Yield what was measured and what to choose."""
    names = list(dict.fromkeys(row["features"] for row in rows))
    yield (
        f"Kernel ridge, {rows[0]['trained']:,} rows train, {rows[0]['judged']:,} test; areas of"
        f" {TIGHT:g} count as true."
    )
    for name in names:
        tight, default = (_at(rows, name, each)["nmae"] for each in (TIGHT, DEFAULT))
        chosen = choice(rows, name)
        yield (
            f"{name} features: nMAE {tight:.3g} % with true areas, {default:.3g} % with"
            f" those of the default tolerance, {DEFAULT:g}. The loosest tolerance within"
            f" {100 * (GOOD - 1):.0f} % of that is {chosen['tolerance']:g} (nMAE"
            f" {chosen['nmae']:.3g} %), whose areas are off by {chosen['label_nmae']:.2g} %: its"
            f" database takes {100 * chosen['ratio']:.0f} % of the default's time."
        )
    safest = min(choice(rows, name)["tolerance"] for name in names)
    default, loose = (_at(rows, names[0], each) for each in (DEFAULT, safest))
    gain = 100 * (1 - loose["ratio"])
    if safest <= DEFAULT or gain < 1:
        yield "Keep the default: nothing looser is faster and as good."
        return
    yield (
        f"Choose {safest:g} for a database that serves such surrogates alone; it saves"
        f" {gain:.0f} % of {time_of(default['seconds'])}."
    )
    yield (
        f"Keep the default where rows are used themselves: {default['right']:.4g} % of its contact"
        f" counts are exact, {loose['right']:.3g} % at {safest:g}, and forces are off by"
        f" {default['label_force']:.1g} % instead of {loose['label_force']:.1g} %."
    )


def choice(rows: Sequence[Row], features: str) -> Row:
    """Return the loosest tolerance that is as good as the tight one, as are all between them."""
    limit = GOOD * _at(rows, features, TIGHT)["nmae"]
    mine = sorted(_of(rows, features), key=lambda row: row["tolerance"])
    return [mine[0], *takewhile(lambda row: row["nmae"] <= limit, mine)][-1]


def _of(rows: Sequence[Row], features: str) -> list[Row]:
    """Return the measured tolerances of a feature set."""
    return [row for row in rows if row["features"] == features and row["tolerance"] != TIGHT]


def _at(rows: Sequence[Row], features: str, tolerance: float) -> Row:
    return next(r for r in rows if (r["features"], r["tolerance"]) == (features, tolerance))


def _picture(rows: Sequence[Row]) -> Any:
    """Draw errors over the time of the database, and over the tolerance."""
    figure = new_figure(11, 5)
    left, right = figure.subplots(1, 2, sharey=True)
    measured = [row for row in rows if row["tolerance"] != TIGHT]
    names = list(dict.fromkeys(row["features"] for row in rows))
    labels = _of(rows, names[0])
    floor = min((row["label_nmae"] for row in labels if row["label_nmae"] > 0), default=1.0) / 4
    errors = [max(row["label_nmae"], floor) for row in labels]
    for axis, quantity in ((left, "seconds"), (right, "tolerance")):
        draw_curves(axis, measured, quantity, "nmae", by="features", label="{} features".format)
        for name, style in zip(names, STYLES, strict=False):
            axis.axhline(_at(rows, name, TIGHT)["nmae"], color=style["color"], ls="--", lw=1)
        places = [row[quantity] for row in labels]
        axis.plot(places, errors, "kx-", lw=1, label="the areas themselves")
        axis.grid(visible=True, which="major", color="0.9")
    beside = {"textcoords": "offset points", "ha": "right", "va": "top", "fontsize": 8}
    for row, error in zip(labels, errors, strict=True):
        text = f"{row['tolerance']:g}" + ("" if row["label_nmae"] else ":\nexact")
        left.annotate(text, (row["seconds"], error), (-6, -3), **beside)
    left.margins(x=0.1)
    left.set_ylim(floor / 4, 2 * max(row["nmae"] for row in rows))
    left.set(
        yscale="log",
        xlabel="processor time of the database [s]",
        ylabel="nMAE [%]",
        title="(a) error over time; tolerances at the crosses",
    )
    right.set(xscale="log", xlabel="tolerance of the solver", title="(b) error over the tolerance")
    right.invert_xaxis()
    right.axvline(DEFAULT, color="0.5", ls=":", label="default tolerance")
    right.legend(fontsize=9, loc="lower left")
    return figure
