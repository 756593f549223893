"""`python -m bench cost`: tables, curves, and when to use a surrogate."""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bench.files import content_of
from bench.page.content import Content, Figure, Table, Words
from bench.picture import draw_curves, new_figure
from bench.report import Report
from bench.surrogates.answer_times import LOADS, LOOSE
from bench.surrogates.break_even import PAPER_BREAK_EVEN, TAKEN, break_even
from bench.surrogates.clock import time_of
from bench.surrogates.cost import LADDER, NEW, OURS, PAPER, Costs, Question
from bench.table import record

GOALS = (10.0, 5.0, 3.0, 2.0, 1.0)
"""Errors (nMAE) that a user may want [%]."""

NOT_SEARCHED = "none (the paper's optimum)"

LINE = "{:21} {:12} {:20} {:>10} {:>8} {:>8} {:>13}"
"""Form of the printed table's lines."""


def report(costs: Costs) -> Report:
    """Make a report of what was measured."""
    questions = [{**record(each), "break_even": each.break_even} for each in costs.questions]
    return Report(
        {"cost": questions, "learning": costs.points},
        pictures={"cost": _picture(costs)},
        text="\n".join([*_times(costs), "", *_table(costs.questions), "", *_advice(costs)]),
        text_name="cost",
    )


def contents(folder: Path) -> list[Content]:
    """List what a page shows of a folder that holds this report."""
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
        Words(content_of(folder / "cost.txt").decode(), typed=True),
    ]


def _times(costs: Costs) -> Iterator[str]:
    """Yield what was measured of the solver and of each feature set."""
    solver = costs.solver
    yield (
        f"Solver, mean processor times: {time_of(solver.solve)} a contact on a new surface,"
        f" {time_of(solver.ladder)} among {LOADS} loads on one surface; a row of a database"
        f" {time_of(solver.row)}, of which the surface {time_of(solver.surface)}"
    )
    for name, answer in costs.answers.items():
        yield (
            f"{name} features: {time_of(answer.surface)} on a new surface,"
            f" {time_of(answer.load)} for a further load; prediction"
            f" {time_of(answer.single)} alone, {time_of(answer.batched)} in a batch"
        )
    for each in _new(costs, OURS):
        build = each.build
        yield (
            f"{each.features} features, {each.rows:,} rows: t_d {time_of(build.database)}, t_h"
            f" {time_of(build.tuning) if build.tuning > TAKEN else NOT_SEARCHED}, t_f"
            f" {time_of(build.fit)}"
        )


def _table(questions: Sequence[Question]) -> Iterator[str]:
    """Yield the lines of the table of all situations."""
    yield LINE.format("asked", "solver", "features", "built in", "solve", "answer", "break-even")
    for each in questions:
        times = map(time_of, (each.build.total, each.solve, each.query))
        who = each.asked, each.solver, each.features
        yield LINE.format(*who, *times, _count(each.break_even))
    yield f"(the paper itself says about {PAPER_BREAK_EVEN:,})"


def _new(costs: Costs, solver: str) -> list[Question]:
    """Return what new surfaces cost, beside a solver."""
    return [each for each in costs.questions if (each.asked, each.solver) == (NEW, solver)]


def _advice(costs: Costs) -> Iterator[str]:
    """Yield when to use a surrogate, and when not."""
    solver, points = costs.solver, costs.points
    yield "Cheapest surrogate for an error, on new surfaces, beside our solver:"
    for goal in GOALS:
        good = [point for point in points if point["nmae"] <= goal]
        best = min(good, key=lambda point: point["break_even"], default=None)
        if best is None:
            yield f"  nMAE {goal:g} %: none of those fitted; solve"
        elif math.isinf(best["break_even"]):
            yield f"  nMAE {goal:g} %: never, its answer takes as long as a solve"
        else:
            yield (
                f"  nMAE {goal:g} %: {best['features']} features, {best['trained']:,} training"
                f" rows, built in {time_of(best['build'])}; pays from"
                f" {_count(best['break_even'])} queries on"
            )
    least = min(point["break_even"] for point in points)
    yield (
        f"Do not use a surrogate for fewer than {_count(least)} contacts (the smallest one fitted"
        f" here pays no earlier), nor where an error of {min(p['nmae'] for p in points):.2g} % in"
        " the mean (nMAE, the best of them) is too much."
    )
    for each in costs.questions:
        if each.solver == OURS and each.asked in {NEW, LADDER}:
            where = f"{each.asked}, {each.features} features"
            if math.isinf(each.break_even):
                yield f"Never with {where}: an answer costs {each.query / each.solve:.2g} solves."
            else:
                yield f"With {where}: an answer is {each.solve / each.query:.3g} times cheaper."
    beside = ", ".join(
        f"{each.features} from {_count(break_even(each.build.total, solver.loose, each.query))}"
        for each in _new(costs, OURS)
    )
    yield (
        f"A loose solve (residual {LOOSE:g}) takes {time_of(solver.loose)} and is off by"
        f" {solver.loose_nmae:.2g} % (nMAE), without any training. Beside it, queries from which on"
        f" surrogates on new surfaces pay: {beside}."
    )


def _picture(costs: Costs) -> Any:
    """Draw costs over queries for both solvers, and errors over samples and over costs."""
    figure = new_figure(11, 8)
    (theirs, ours), (samples, seconds) = figure.subplots(2, 2)
    for axis, solver, title in ((theirs, PAPER, "the paper's solver"), (ours, OURS, "our solver")):
        _draw_costs(axis, _new(costs, solver))
        axis.set(title=f"New surfaces, {title}", xlabel="queries", ylabel="total cost [s]")
    for axis, column in ((samples, "trained"), (seconds, "build")):
        axis.set(xscale="log", yscale="log", ylabel="nMAE [%]")
        draw_curves(axis, costs.points, column, "nmae", by="features", marker="o")
        axis.yaxis.set_major_formatter("{x:g}")
        axis.yaxis.set_minor_formatter("{x:g}")
    samples.set(title="Learning curves", xlabel="training samples")
    seconds.set(title="... against what they cost", xlabel="t_d + t_h + t_f [s]")
    for axis in (theirs, ours, samples, seconds):
        axis.grid(visible=True, which="major", color="0.9")
        axis.legend()
    return figure


def _draw_costs(axis: Any, questions: Sequence[Question]) -> None:
    """Draw a line for the solver, one for each surrogate, and dots where they cross."""
    finite = [q.break_even for q in questions if math.isfinite(q.break_even)]
    queries = np.geomspace(1, 30 * max(finite, default=1e5), 200)
    axis.loglog(queries, queries * questions[0].solve, color="0.3", label="solver")
    for number, each in enumerate(questions):
        style = {"color": f"C{number}", "label": f"{each.features} ({_count(each.break_even)})"}
        axis.loglog(queries, each.build.total + queries * each.query, **style)
        if math.isfinite(each.break_even):
            axis.plot(each.break_even, each.break_even * each.solve, "o", color=style["color"])


def _count(number: float) -> str:
    """Write a number of queries, or never."""
    return "never" if math.isinf(number) else f"{number:,.0f}"
