"""The end of a growth in one screen: how it ended, errors, learning curve, and when it pays."""

import math
from collections.abc import Iterator

import numpy as np

from gen.runtime.terminal import echo, print_table, printable
from learn.dataset import Dataset
from learn.grow.appraisal import LEVEL, Appraisal
from learn.grow.generation import stock
from learn.grow.rounds import Ending, Grown, asked_for
from learn.grow.sizes import RISK
from learn.request import Request
from learn.surrogate.break_even import Payback, answer_seconds

WIDTH = 110
"""Width of the tables without a terminal [characters]."""

WORDS: dict[Ending, str] = {
    "met": "The mark is met",
    "budget": "The budget is used up before the mark is met",
    "rows": "The allowed rows are used up before the mark is met",
    "hopeless": "The mark is out of reach of this model with these features",
    "interrupted": "Interrupted",
}
"""Why a growth has ended."""


def show(request: Request, grown: Grown, found: Appraisal, most: int) -> None:
    """Print the end of a growth.

    Parameters
    ----------
    request : Request
        Database, surrogate and options.
    grown : Grown
        The growth.
    found : Appraisal
        Its last surrogate.
    most : int
        Largest number of rows that was allowed.
    """
    card = found.surrogate.card
    rows = card["rows"]
    by = rows.get("split_by", "surface")
    about = (
        f"{request.output}: {card['title']}, {card['features']} features; {found.rows} rows of"
        f" {request.database}: {rows['train']} train, {rows['calibration']} calibrate,"
        f" {rows['test']} held out by {by}, {sum(rows['left_out'].values())} left out"
    )
    for line in (about, *_verdict(grown, found, most)):
        echo(line)
    print_table(_errors(found), WIDTH)
    if grown.curve is not None:
        floor, scale, exponent = grown.curve.fit
        points = ", ".join(
            f"{error:.3g} % of {size:.0f}"
            for size, error in zip(grown.curve.rows, grown.curve.nmae, strict=True)
        )
        said = f"learning curve of {grown.curve.target}: nMAE {points} rows;"
        said += f" {floor:.2g} + {scale:.3g} n^-{exponent:.2g} %"
        echo(said)
    echo(payback(request, grown, found).in_words())


def _verdict(grown: Grown, found: Appraisal, most: int) -> Iterator[str]:
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
    advice = grown.advice
    if grown.ending == "hopeless":
        yield (
            f"Within {most} rows, the most that are allowed, the learning curve does not come to"
            " it: ask for less, allow more --rows, or try other --features."
        )
    elif advice is not None:
        said = asked_for(found, advice)
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
        inside = (judged.low <= judged.truth) & (judged.truth <= judged.high)
        width = float(np.mean(judged.high - judged.low))
        table.add_row(
            printable(name),
            f"{judged.accuracy.nmae:.2f}",
            f"{judged.accuracy.error:.2f}",
            f"{found.bound(name):.2f}",
            f"{about['scores']['r2']:.2f}",
            f"{100 * inside.mean():.1f} %",
            f"{width:.3g} {printable(about['unit'])}",
        )
    return table


def payback(request: Request, grown: Grown, found: Appraisal) -> Payback:
    """Return the times of the surrogate's making, of one of its answers and of a solve."""
    from gen.scene import Scene

    test: Dataset = found.sets[0].at(found.parts.test)
    scene = Scene.from_text(test.source["scene"])
    query = answer_seconds(found.surrogate, scene, test.rows, test.described[:, 0])
    there = stock(request.database)
    again = 0.0 if math.isnan(query) else there.rows * query
    return Payback(there.seconds + again + grown.fitting, there.solving, query)
