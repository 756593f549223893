"""`python -m bench tolerance`: errors over time, and which tolerance to choose."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from bench.page.content import Absent, Content, Figure, Table, Words
from bench.picture import new_figure
from bench.report import Report
from bench.style import STYLES
from bench.surrogates.clock import time_of
from bench.surrogates.tolerance import Row
from bench.surrogates.tolerance_labels import DEFAULT, TIGHT

GOOD = 1.02
"""Test errors count as the tight labels' up to this ratio."""

TABLE, PICTURE, TEXT = "tolerance.csv", "tolerance.png", "tolerance.txt"


def report(rows: Sequence[Row]) -> Report:
    """Make a report of what was measured."""
    return Report(
        {"tolerance": rows},
        pictures={"tolerance": _picture(rows)},
        text="\n".join(lines(rows)),
        text_name="tolerance",
    )


def contents(folder: Path) -> list[Content]:
    """What a folder of this report holds."""
    table, picture, words = folder / TABLE, folder / PICTURE, folder / TEXT
    if not all(path.is_file() for path in (table, picture, words)):
        return [
            Absent(
                "what the solver's tolerance does to a surrogate",
                "python -m bench tolerance -o DIR",
            )
        ]
    caption = (
        "Error over the time of the database at several tolerances of the solver, written beside"
        " the crosses. Black: error of the areas that are learnt. Colours: error of kernel ridge"
        " that learnt them, on test rows solved tightly; dashed, what areas without error give."
        " Where the black line is well below, a tighter tolerance buys nothing."
    )
    shown = (
        "tolerance", "features", "seconds", "ratio", "label_nmae", "label_force", "right", "nmse",
        "nmae", "r2", "own_nmae",
    )  # fmt: skip
    return [
        Figure(picture, caption, data=(table,)),
        *(Words(line) for line in words.read_text(encoding="utf-8").splitlines()),
        Table(
            table,
            "The same as numbers [%], and the processor time of the database [s], also over that at"
            " the default tolerance. label: of the areas and forces learnt; right: rows with the"
            " exact number of contact nodes; own: tested on rows of the same tolerance.",
            columns=shown,
        ),
    ]


def lines(rows: Sequence[Row]) -> Iterator[str]:
    """What was measured and what to choose."""
    names = list(dict.fromkeys(row.features for row in rows))
    some = rows[0]
    yield (
        f"Kernel ridge, {some.trained:,} rows train, {some.judged:,} test; areas of {TIGHT:g} count"
        " as true."
    )
    for name in names:
        tight = _tight(rows, name)
        chosen, default = choice(rows, name), _at(rows, name, DEFAULT)
        yield (
            f"{name} features: nMAE {tight.nmae:.3g} % with true areas, {default.nmae:.3g} % with"
            f" those of the default tolerance, {DEFAULT:g}. The loosest tolerance within"
            f" {100 * (GOOD - 1):.0f} % of that is {chosen.tolerance:g} (nMAE {chosen.nmae:.3g} %),"
            f" whose areas are off by {chosen.label_nmae:.2g} %: its database takes"
            f" {_share(chosen.ratio)} of the default's time."
        )
    safest = min((choice(rows, name) for name in names), key=lambda row: row.tolerance)
    default, loose = (_at(rows, names[0], each) for each in (DEFAULT, safest.tolerance))
    gain = 100 * (1 - loose.ratio)
    if loose.tolerance <= DEFAULT or gain < 1:
        yield "Keep the default: nothing looser is faster and as good."
        return
    yield (
        f"Choose {loose.tolerance:g} for a database that serves such surrogates alone; it saves"
        f" {gain:.0f} % of {time_of(default.seconds)}."
    )
    yield (
        f"Keep the default where rows are used themselves: {default.right:.4g} % of its contact"
        f" counts are exact, {loose.right:.3g} % at {loose.tolerance:g}, and forces are off by"
        f" {default.label_force:.1g} % instead of {loose.label_force:.1g} %."
    )


def choice(rows: Sequence[Row], features: str) -> Row:
    """The loosest tolerance that is as good as the tight one, as are all between them."""
    limit = GOOD * _tight(rows, features).nmae
    mine = sorted(_of(rows, features), key=lambda row: row.tolerance)
    good = mine[0]
    for row in mine:
        if row.nmae > limit:
            break
        good = row
    return good


def _of(rows: Sequence[Row], features: str) -> list[Row]:
    """The measured tolerances of a feature set."""
    return [row for row in rows if row.features == features and row.tolerance != TIGHT]


def _tight(rows: Sequence[Row], features: str) -> Row:
    return _at(rows, features, TIGHT)


def _at(rows: Sequence[Row], features: str, tolerance: float) -> Row:
    return next(row for row in rows if (row.features, row.tolerance) == (features, tolerance))


def _share(ratio: float) -> str:
    return f"{100 * ratio:.0f} %"


def _picture(rows: Sequence[Row]) -> Any:
    """Errors over the time of the database, and over the tolerance."""
    figure = new_figure(11, 5)
    left, right = figure.subplots(1, 2, sharey=True)
    names = list(dict.fromkeys(row.features for row in rows))
    labels = _of(rows, names[0])
    known = [row.label_nmae for row in labels if row.label_nmae > 0]
    floor = min(known, default=1.0) / 4
    errors = [max(row.label_nmae, floor) for row in labels]
    for axis, quantity in ((left, "seconds"), (right, "tolerance")):
        for name, style in zip(names, STYLES, strict=False):
            mine = _of(rows, name)
            places = [getattr(row, quantity) for row in mine]
            axis.plot(places, [row.nmae for row in mine], **style, label=f"{name} features")
            axis.axhline(_tight(rows, name).nmae, color=style["color"], ls="--", lw=1)
        places = [getattr(row, quantity) for row in labels]
        axis.plot(places, errors, "kx-", lw=1, label="the areas themselves")
        axis.grid(visible=True, which="major", color="0.9")
    _annotate(left, labels, errors)
    left.margins(x=0.1)
    left.set_ylim(floor / 4, 2 * max(row.nmae for row in rows))
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


def _annotate(axis: Any, rows: Sequence[Row], errors: Sequence[float]) -> None:
    """Write tolerances beside the crosses of the areas' own errors."""
    for row, error in zip(rows, errors, strict=True):
        axis.annotate(
            f"{row.tolerance:g}" + ("" if row.label_nmae else ":\nexact"),
            (row.seconds, error),
            (-6, -3),
            textcoords="offset points",
            ha="right",
            va="top",
            fontsize=8,
        )
