"""What a growth tells in the end: one screen of words and numbers, and one picture.

The screen says how it ended, errors, coverage and the learning curve; the picture has the learning
curve, and predictions with their intervals over the truth.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from gen.runtime.figure import draw_parity, log_axis, parity_axes
from gen.runtime.terminal import echo, print_table, printable
from learn.grow.accuracy import LEVEL, RISK, Appraisal, Curve, values
from learn.grow.rounds import Ending, Growth, asked_for

TABLE_WIDTH = 110
"""Width of the tables without a terminal [characters]."""

WIDTH, HEIGHT = 10.0, 4.6
"""Size of the picture [inches]."""

COLOUR, MARK = "tab:blue", "tab:red"

WORDS: dict[Ending | None, str] = {
    "met": "The mark is met",
    "budget": "The budget is used up before the mark is met",
    "rows": "The allowed rows are used up before the mark is met",
    "hopeless": "The mark is out of reach of this model with these features",
    "interrupted": "Interrupted",
}
"""Why a growth has ended."""


def show(grown: Growth, found: Appraisal) -> None:
    """Print the end of a growth with its last surrogate."""
    card, request = found.surrogate.card, grown.order.request
    rows = card["rows"]
    by = rows.get("split_by", "surface")
    about = (
        f"{request.output}: {card['title']}, {card['features']} features; {found.rows} rows of"
        f" {request.databases[0]}: {rows['train']} train, {rows['calibration']} calibrate,"
        f" {rows['test']} held out by {by}, {sum(rows['left_out'].values())} left out"
    )
    for line in (about, *_verdict(grown, found)):
        echo(line)
    print_table(_errors(found), TABLE_WIDTH)
    if grown.curve is not None:
        floor, scale, exponent = grown.curve.fit
        points = ", ".join(
            f"{error:.3g} % of {size:.0f}"
            for size, error in zip(grown.curve.rows, grown.curve.nmae, strict=True)
        )
        said = f"learning curve of {grown.curve.target}: nMAE {points} rows;"
        said += f" {floor:.2g} + {scale:.3g} n^-{exponent:.2g} %"
        echo(said)


def _verdict(grown: Growth, found: Appraisal) -> Iterator[str]:
    """Say how the growth has ended, and what can be done."""
    bound = found.bound(found.worst)
    worst = f"nMAE of {found.worst} {found.judged[found.worst].accuracy.nmae:.2f} %"
    if found.met:
        yield (
            f"{WORDS['met']}: {worst}, at most {bound:.2f} %, asked: {found.mark:g} %. However"
            f" often a growth looks, it accepts too large an error with a probability of {RISK:.0%}"
            " at most."
        )
        return
    yield f"{WORDS[grown.ending]}: {worst}, at most {bound:.2f} %, asked: {found.mark:g} %."
    if grown.ending == "hopeless":
        yield (
            f"Within {grown.order.most} rows, the most that are allowed, the learning curve does"
            " not come to it: ask for less, allow more --rows, or try other --features."
        )
    elif grown.advice is not None:
        said = asked_for(found, grown.advice)
        yield f"{said[0].upper()}{said[1:]}. The same command goes on."


def _errors(found: Appraisal) -> object:
    """Return a table of errors, bounds and intervals of each target."""
    from rich.table import Table

    table = Table(box=None, pad_edge=False)
    table.add_column("target")
    for name in ("nMAE %", "its SE", "at most", "R2 %", f"in {LEVEL:.0%} interval", "mean width"):
        table.add_column(name, justify="right")
    for name, judged in found.judged.items():
        about = found.surrogate.card["targets"][name]
        width = float(np.mean(judged.high - judged.low))
        table.add_row(
            printable(name),
            f"{judged.accuracy.nmae:.2f}",
            f"{judged.accuracy.error:.2f}",
            f"{found.bound(name):.2f}",
            f"{about['scores']['r2']:.2f}",
            f"{100 * judged.inside.mean():.1f} %",
            f"{width:.3g} {printable(about['unit'])}",
        )
    return table


def draw(figure: Any, found: Appraisal, curve: Curve | None) -> None:
    """Draw the worst target, with its learning curve if there is one, into an empty figure.

    The figure is of `WIDTH` x `HEIGHT`.
    """
    learning, parity = figure.subplots(1, 2)
    _draw_learning(learning, found, curve)
    _draw_parity(parity, found)


def _draw_learning(axis: Any, found: Appraisal, curve: Curve | None) -> None:
    """Draw errors over rows, the curve, and the mark."""
    judged = found.judged[found.worst].accuracy
    if curve is not None:
        spread = curve.nmae - curve.lowest, curve.highest - curve.nmae
        axis.errorbar(curve.rows, curve.nmae, spread, fmt="o", color="0.4", ms=4, label="parts")
        rows = np.geomspace(curve.rows[0], 8 * curve.rows[-1], 100)
        axis.plot(rows, values(curve.fit, rows), color=COLOUR, label="a + b n$^{-c}$")
    bound = found.bound(found.worst) - judged.nmae
    axis.errorbar(
        [found.rows],
        [judged.nmae],
        [[0.0], [bound if np.isfinite(bound) else 0.0]],
        fmt="s",
        color="black",
        capsize=4,
        label="all rows, with their bound",
    )
    axis.axhline(found.mark, color=MARK, ls="--", label=f"asked for, {found.mark:g} %")
    axis.set(xlabel="rows of the database", ylabel="nMAE [%]")
    axis.set_title(f"Learning curve, {found.worst}")
    log_axis(axis.xaxis)
    log_axis(axis.yaxis)
    axis.grid(visible=True, which="major", color="0.9")
    axis.legend(fontsize=8)


def _draw_parity(axis: Any, found: Appraisal) -> None:
    """Draw predictions with their intervals over the truth."""
    judged, unit = found.judged[found.worst], found.surrogate.learnt[found.worst].unit
    parity_axes(axis, judged.truth)
    for chosen, colour, name in (
        (judged.inside, COLOUR, "inside its interval"),
        (~judged.inside, MARK, "outside"),
    ):
        truth, prediction = judged.truth[chosen], judged.prediction[chosen]
        ends = np.clip([judged.low[chosen], judged.high[chosen]], *axis.get_ylim())
        axis.vlines(truth, ends[0], ends[1], color=colour, alpha=0.25, lw=1)
        label, look = f"{name} ({truth.size})", {"marker": ".", "ms": 4, "ls": "none"}
        draw_parity(axis, truth, prediction, label=label, color=colour, **look)
    quantity = found.worst if unit == "1" else f"{found.worst} [{unit}]"
    axis.set(xlabel=f"solved {quantity}", ylabel="predicted")
    axis.set_title(f"{judged.truth.size} rows held out for tests")
    axis.legend(fontsize=8, loc="upper left")
