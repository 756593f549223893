"""What a growth tells in the end: one screen of words and numbers, and one picture.

The screen says how it ended, errors, coverage and the learning curve; the picture has the learning
curve, and predictions with their intervals over the truth.
"""

from typing import Any

import numpy as np

from gen.runtime.figure import draw_parity, log_axis, parity_axes
from gen.runtime.terminal import echo, print_table, printable
from learn.features.scene import SCENE
from learn.grow.accuracy import LEVEL, RISK, Look, Order
from learn.grow.rounds import Ending

TABLE_WIDTH = 110
"""Width of the tables without a terminal [characters]."""

WIDTH, HEIGHT = 10.0, 4.6
"""Size of the picture [inches]."""

COLOUR, MARK = "tab:blue", "tab:red"

WORDS: dict[Ending, str] = {
    "met": "The mark is met",
    "budget": "The budget is used up before the mark is met",
    "rows": "The allowed rows are used up before the mark is met",
    "hopeless": "The mark is out of reach of this model with these features",
}
"""Why a growth has ended."""


def show(order: Order, ending: Ending, found: Look) -> None:
    """Print the end of a growth with its last surrogate."""
    from rich.table import Table

    card, request = found.surrogate.card, order.request
    rows, worst = card["rows"], found.worst
    echo(
        f"{request.output}: {card['title']}, {card['features']} features; {found.rows} rows of"
        f" {request.databases[0]}: {rows['train']} train, {rows['calibration']} calibrate,"
        f" {rows['test']} held out by {rows.get('split_by', 'surface')},"
        f" {sum(rows['left_out'].values())} left out"
    )
    accuracy, bound = found.judged[worst].accuracy, found.bound(worst)
    said = f"{WORDS[ending]}: nMAE of {worst} {accuracy.nmae:.2f} %, at most {bound:.2f} %,"
    said += f" asked: {found.mark:g} %."
    if found.met:
        said += (
            " However often a growth looks, it accepts too large an error with a probability of"
            f" {100 * RISK:g} % at most."
        )
    echo(said)
    if ending == "hopeless":
        echo(
            f"Within {order.most} rows, the most that are allowed, the learning curve does not come"
            " to it: ask for less, allow more --rows, or try other --features."
        )
    elif not found.met and found.asked_for():
        asked = found.asked_for()
        echo(f"{asked[0].upper()}{asked[1:]}. The same command goes on.")
    if card["features"] == SCENE:
        echo("Errors are those of the mean over surfaces, intervals those of a new surface.")
    table = Table(box=None, pad_edge=False)
    table.add_column("target")
    for name in (
        "nMAE %",
        "its SE",
        "at most",
        "R2 %",
        f"in {100 * LEVEL:g} % interval",
        "mean width",
    ):
        table.add_column(name, justify="right")
    for name, judged in found.judged.items():
        about = card["targets"][name]
        numbers = judged.accuracy.nmae, judged.accuracy.error, found.bound(name)
        inside, width = 100 * judged.inside.mean(), np.mean(judged.high - judged.low)
        cells = [f"{each:.2f}" for each in (*numbers, about["scores"]["r2"])]
        cells += [f"{inside:.1f} %", f"{width:.3g} {printable(about['unit'])}"]
        table.add_row(printable(name), *cells)
    print_table(table, TABLE_WIDTH)
    if (curve := found.curve) is not None:
        pairs = zip(curve.rows, curve.nmae, strict=True)
        points = ", ".join(f"{error:.3g} % of {size:.0f}" for size, error in pairs)
        echo(f"learning curve of {worst}: nMAE {points} rows; falls as n^-{curve.exponent:.2f}")


def draw(figure: Any, found: Look) -> None:
    """Draw the worst target, with its learning curve if there is one, into an empty figure.

    The figure is of `WIDTH` x `HEIGHT`.
    """
    learning, parity = figure.subplots(1, 2)
    _draw_learning(learning, found)
    _draw_parity(parity, found)


def _draw_learning(axis: Any, found: Look) -> None:
    """Draw errors over rows, the curve, and the mark."""
    if (curve := found.curve) is not None:
        axis.plot(curve.rows, curve.nmae, "o", color="0.4", ms=4, label="looks")
        rows = np.geomspace(curve.rows[0], 8 * curve.rows[-1], 100)
        axis.plot(rows, curve.at(rows), color=COLOUR, label="n$^{-c}$")
    nmae = found.judged[found.worst].accuracy.nmae
    bound = np.nan_to_num(found.bound(found.worst) - nmae, posinf=0.0)
    look = {"fmt": "s", "color": "black", "capsize": 4, "label": "all rows, with their bound"}
    axis.errorbar([found.rows], [nmae], [[0.0], [bound]], **look)
    axis.axhline(found.mark, color=MARK, ls="--", label=f"asked for, {found.mark:g} %")
    axis.set(xlabel="rows of the database", ylabel="nMAE [%]")
    axis.set_title(f"Learning curve, {found.worst}")
    log_axis(axis.xaxis)
    log_axis(axis.yaxis)
    axis.grid(visible=True, which="major", color="0.9")
    axis.legend(fontsize=8)


def _draw_parity(axis: Any, found: Look) -> None:
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
