"""The files and the words of `python -m bench cost`."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import astuple, fields
from pathlib import Path
from typing import Any

import numpy as np

from bench.page.content import Content, Figure, Table, Words
from bench.picture import new_figure, save
from bench.surrogates.cost import LADDER, NEW, OURS, PAPER, Costs, Question
from bench.surrogates.costs import LOADS, LOOSE, PAPER_BREAK_EVEN, break_even
from bench.surrogates.learning import Point
from bench.table import write_table
from gen.runtime.output import write

GOALS = (10.0, 5.0, 3.0, 2.0, 1.0)
"""Errors (nMAE) that a user may want [%]."""


TAKEN = 1e-3
"""Seconds below which settings were taken from a table, not searched."""

NOT_SEARCHED = "none (the paper's optimum)"


def write_report(folder: Path, costs: Costs) -> tuple[list[Path], str]:
    """Write `cost.csv`, `learning.csv`, `cost.txt` and `cost.png`.

    Returns
    -------
    The files, and the text

    Raises
    ------
    InputError
        If the folder cannot be written to.
    """
    text = "\n".join(lines(costs))
    tables = [
        write_table(
            folder / f"{name}.csv", [each.name for each in fields(kind)], map(astuple, rows)
        )
        for name, kind, rows in (
            ("cost", Question, costs.questions),
            ("learning", Point, costs.points),
        )
    ]
    words = folder / "cost.txt"
    write(words, text + "\n")
    return [*tables, words, save(_picture(costs), folder / "cost.png")], text


def contents(folder: Path) -> list[Content]:
    """List what a page shows of a folder that `write_report` has written."""
    words = folder / "cost.txt"
    return [
        Figure(
            folder / "cost.png",
            "Above, total cost against queries, with the paper's solver (190 s a solve) and with"
            " ours: dots mark where a surrogate starts to pay. Below, test error against training"
            " samples and against the seconds that database, tuning and fit took.",
            data=(folder / "cost.csv", folder / "learning.csv"),
        ),
        Table(
            folder / "cost.csv",
            "Database, tuning, fit, a solve and an answer [s]; break-even in queries.",
        ),
        *([Words(words.read_text(encoding="utf-8"), typed=True)] if words.exists() else []),
    ]


def lines(costs: Costs) -> Iterator[str]:
    """What was measured and what follows from it."""
    solver = costs.solver
    yield (
        f"Solver, mean processor times: {time_of(solver.solve)} a contact on a new surface,"
        f" {time_of(solver.ladder)} among {LOADS} loads on one surface; a row of a database"
        f" {time_of(solver.row)}, of which the surface {time_of(solver.surface)}"
    )
    for name, query in costs.queries.items():
        yield (
            f"{name} features: {time_of(query.surface)} on a new surface,"
            f" {time_of(query.load)} for a further load; prediction {time_of(query.single)} alone,"
            f" {time_of(query.batched)} in a batch"
        )
    for each in costs.questions:
        if (each.asked, each.solver) == (NEW, OURS):
            yield (
                f"{each.features} features, {each.rows:,} rows: t_d {time_of(each.database)}, t_h"
                f" {time_of(each.tuning) if each.tuning > TAKEN else NOT_SEARCHED}, t_f"
                f" {time_of(each.fit)}"
            )
    yield ""
    yield (
        f"{'asked':21} {'solver':12} {'features':20} {'built in':>10} {'solve':>8} {'answer':>8}"
        f" {'break-even':>13}"
    )
    for each in costs.questions:
        build = time_of(_build(each))
        yield (
            f"{each.asked:21} {each.solver:12} {each.features:20} {build:>10}"
            f" {time_of(each.solve):>8} {time_of(each.query):>8} {_count(each.break_even):>13}"
        )
    yield f"(the paper itself says about {PAPER_BREAK_EVEN:,})"
    yield ""
    yield from _advice(costs)


def _advice(costs: Costs) -> Iterator[str]:
    """When to use a surrogate, and when not."""
    solver = costs.solver
    yield "Cheapest surrogate for an error, on new surfaces, beside our solver:"
    for goal in GOALS:
        good = [point for point in costs.points if point.nmae <= goal]
        best = min(good, key=lambda point: point.break_even, default=None)
        if best is None:
            yield f"  nMAE {goal:g} %: none of those fitted; solve"
        elif math.isinf(best.break_even):
            yield f"  nMAE {goal:g} %: never, its answer takes as long as a solve"
        else:
            yield (
                f"  nMAE {goal:g} %: {best.features} features, {best.trained:,} training rows,"
                f" built in {time_of(best.build)}; pays from {_count(best.break_even)} queries on"
            )
    finite = [point.break_even for point in costs.points if math.isfinite(point.break_even)]
    least = min(finite, default=math.inf)
    best = min(costs.points, key=lambda point: point.nmae)
    yield (
        f"Do not use a surrogate for fewer than {_count(least)} contacts (the smallest one fitted"
        f" here pays no earlier), nor where an error of {best.nmae:.2g} % in the mean"
        f" (nMAE, the best of them) is too much."
    )
    yield from _competitors(costs)
    beside = ", ".join(
        f"{each.features} from {_count(break_even(_build(each), solver.loose, each.query))}"
        for each in costs.questions
        if (each.asked, each.solver) == (NEW, OURS)
    )
    yield (
        f"A loose solve (residual {LOOSE:g}) takes {time_of(solver.loose)} and is off by"
        f" {solver.loose_nmae:.2g} % (nMAE), without any training. Beside it, queries from which on"
        f" surrogates on new surfaces pay: {beside}."
    )


def _build(question: Question) -> float:
    """What is paid before the first answer [s]."""
    return question.database + question.tuning + question.fit


def _competitors(costs: Costs) -> Iterator[str]:
    """Situations in which a surrogate is never cheaper, or hardly."""
    for each in costs.questions:
        if each.solver != OURS or each.asked not in {NEW, LADDER}:
            continue
        where = f"{each.asked}, {each.features} features"
        if math.isinf(each.break_even):
            yield f"Never with {where}: an answer costs {each.query / each.solve:.2g} solves."
        else:
            yield f"With {where}: an answer is {each.solve / each.query:.3g} times cheaper."


def _picture(costs: Costs) -> Any:
    """Costs over queries for both solvers, and errors over samples and over costs."""
    figure = new_figure(11, 8)
    (theirs, ours), (samples, seconds) = figure.subplots(2, 2)
    for axis, solver, title in ((theirs, PAPER, "the paper's solver"), (ours, OURS, "our solver")):
        _draw_costs(axis, [q for q in costs.questions if (q.solver, q.asked) == (solver, NEW)])
        axis.set(title=f"New surfaces, {title}", xlabel="queries", ylabel="total cost [s]")
    for features in costs.queries:
        points = [point for point in costs.points if point.features == features]
        errors = [point.nmae for point in points]
        samples.loglog([point.trained for point in points], errors, "o-", label=features)
        seconds.loglog([point.build for point in points], errors, "o-", label=features)
    samples.set(title="Learning curves", xlabel="training samples", ylabel="nMAE [%]")
    seconds.set(title="... against what they cost", xlabel="t_d + t_h + t_f [s]", ylabel="nMAE [%]")
    for axis in (samples.yaxis, seconds.yaxis):
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter("{x:g}")
    for axis in (theirs, ours, samples, seconds):
        axis.grid(visible=True, which="major", color="0.9")
        axis.legend()
    return figure


def _draw_costs(axis: Any, questions: Sequence[Question]) -> None:
    """A line for the solver, one for each surrogate, and dots where they cross."""
    finite = [q.break_even for q in questions if math.isfinite(q.break_even)]
    queries = np.geomspace(1, 30 * max(finite, default=1e5), 200)
    axis.loglog(queries, queries * questions[0].solve, color="0.3", label="solver")
    for number, each in enumerate(questions):
        label = f"{each.features} ({_count(each.break_even)})"
        axis.loglog(queries, _build(each) + queries * each.query, color=f"C{number}", label=label)
        if math.isfinite(each.break_even):
            axis.plot(each.break_even, each.break_even * each.solve, "o", color=f"C{number}")


def time_of(seconds: float) -> str:
    """A time in a unit that suits it."""
    if seconds < 1e-3:
        return f"{1e6 * seconds:.3g} us"
    if seconds < 1:
        return f"{1e3 * seconds:.3g} ms"
    if seconds < 600:
        return f"{seconds:.3g} s"
    return f"{seconds / 3600:.3g} h" if seconds < 1e6 else f"{seconds / 86400:.3g} d"


def _count(number: float) -> str:
    """A number of queries, or never."""
    return "never" if math.isinf(number) else f"{number:,.0f}"
