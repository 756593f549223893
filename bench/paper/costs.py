"""Total cost against the number of queries (section 4.4), and the numbers in the paper's text."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pandas as pd

from bench.contents import Content
from bench.files import write_table
from bench.paper import database as databases
from bench.paper import models
from bench.paper.facts import (
    AREA_MAX,
    LONGEST_SOLVE,
    TRAIN_ROWS,
    TUNING_PAYS,
    picture,
    ratio,
    table,
    why,
)
from bench.picture import new_figure
from bench.surrogates.cost import (
    NEW,
    OURS,
    PAPER_BREAK_EVEN,
    PAPER_ROWS,
    PAPER_SOLVE,
    PAPER_TESTS,
    PAPERS,
    TAKEN,
    count,
    draw_costs,
)
from gen.database import Reader
from gen.runtime.errors import InputError
from gen.runtime.files import require_file
from gen.schema import Status
from learn.comparison import paper
from learn.surrogate.break_even import break_even, time_of

# A row of the table of `bench cost`: its costs [s], and the contacts from which on it pays.
Costs = dict[str, Any]


def read_costs(cost: Path) -> tuple[Costs, list[Costs]]:
    """Read from `bench cost` the paper's own costs, and ours on new surfaces by feature set."""
    try:
        rows = pd.read_csv(require_file(cost / "cost.csv"))
        theirs = rows[(rows["solver"] == PAPERS) & (rows["asked"] != NEW)]
        ours = rows[(rows["solver"] == OURS) & (rows["asked"] == NEW)]
    except (OSError, InputError, KeyError, ValueError):
        raise InputError(f"--cost {cost}: give a folder of python -m bench cost") from None
    if theirs.empty or ours.empty:
        raise InputError(f"--cost {cost}: its cost.csv lacks rows; run python -m bench cost again")
    return theirs.to_dict("records")[0], ours.to_dict("records")


def total_cost(folder: Path, cost: Path) -> list[Content]:
    """Draw and tabulate the costs of both sides, and where they meet."""
    published, ours = read_costs(cost)
    first = ours[0]
    data = write_table(
        folder / "total-cost.csv",
        ("cost", "paper", *(f"ours_{each['features']}" for each in ours), "ours_over_paper", "why"),
        _cost_rows(published, ours),
    )
    said: dict[str, Any] = {"theirs": published, "ours": first, "said": PAPER_BREAK_EVEN}
    said |= {"solve": time_of(first["solve"]), "gain": first["solve"] / first["query"]}
    said |= {"gains": published["solve"] / published["query"]}
    drawn = _cost_picture(published, ours)
    return [picture(folder, "total-cost", drawn, data, **said), table(data, "costs")]


def _cost_rows(published: Costs, ours: list[Costs]) -> Iterator[tuple[str, ...]]:
    """Yield a row for each cost: its cells, ours over the paper's, and why."""
    solver = "the solver makes the difference"
    own_features = "ours with the features of a new surface"
    pays = "a faster solver needs no surrogate"
    costs = (
        ("rows of the database", "rows", count, ""),
        ("a contact by the solver", "solve", time_of, solver),
        ("t_d, database", "database", time_of, solver),
        ("t_h, search for settings", "tuning", _searched, "none: the paper's optimum was taken"),
        ("t_f, fit", "fit", time_of, "another machine, one thread"),
        ("t_p, an answer", "query", time_of, own_features),
        ("contacts from which on it pays", "break_even", count, pays),
    )
    sides = (published, *ours)
    for title, name, text, reason in costs:
        cells = [text(each[name]) for each in sides]
        compared = name != "rows" and "none" not in cells
        yield title, *cells, ratio(ours[0][name], published[name]) if compared else "", reason
    cells = [count(break_even(each["tuning"], each["solve"], each["query"])) for each in sides]
    cells[0] += f" (it says {TUNING_PAYS})"
    yield "contacts that pay for the search", *cells, "", ""


def _searched(seconds: float) -> str:
    return time_of(seconds) if seconds > TAKEN else "none"


def _cost_picture(published: Costs, ours: list[Costs]) -> Any:
    """Draw a panel for the paper and one for ours."""
    figure = new_figure(10.5, 4.6)
    left, right = figure.subplots(1, 2)
    for axis, sides, names, title in (
        (left, [published], ["surrogate (kernel ridge)"], "(a) the paper's times"),
        (right, ours, [f"{e['features']} features" for e in ours], "(b) ours, new surfaces"),
    ):
        pays = [
            f"{name}, pays from {count(each['break_even'])}"
            for each, name in zip(sides, names, strict=True)
        ]
        draw_costs(axis, sides, pays, f"solver, {time_of(sides[0]['solve'])} a contact")
        axis.set(title=title, xlabel="number of contacts", ylabel="total time [s]")
    return figure


Row = tuple[str, str, str, str, str, str]

HEADER = ("quantity", "section", "paper", "ours", "deviation", "explanation")


def numbers(
    folder: Path, database: Path, comparison: Path | None = None, cost: Path | None = None
) -> list[Content]:
    """Collect the numbers that can be compared with the inputs at hand."""
    rows = [*_of_the_database(database)]
    if comparison is not None:
        rows += _of_the_comparison(comparison)
    if cost is not None:
        rows += _of_the_cost(cost)
    return [table(write_table(folder / "numbers.csv", HEADER, rows))]


def _of_the_database(path: Path) -> Iterator[Row]:
    rows = databases.finished(path)
    area, seconds, done = rows["area_percent"], rows["solve_seconds"], len(rows)
    with Reader(path) as reader:
        failed = int((reader.column("status") == Status.FAILED).sum())
    yield _row("rows of the database", "3.2", PAPER_ROWS, done, "as asked for", "{:,.0f}")
    yield "failed simulations", "3.1", "some", f"{failed:,}", "", ""
    reason, solver = why("areas", largest=AREA_MAX), why("solver")
    yield _row("largest area [%]", "Table 1", AREA_MAX, float(area.max()), reason)
    below = 100 * float((area <= AREA_MAX).mean())
    yield _row("rows up to the paper's largest area [%]", "Table 1", 100, below, reason, "{:.3g}")
    mean, longest = float(seconds.mean()), float(seconds.max())
    yield _row("mean time of a simulation [s]", "3.2, 4.4", PAPER_SOLVE, mean, solver)
    yield _row("longest simulation [s]", "2.4", LONGEST_SOLVE, longest, solver)
    theirs, ours = PAPER_ROWS * PAPER_SOLVE, done * mean
    texts = time_of(theirs), time_of(ours), f"1/{theirs / ours:,.0f}"
    yield "all simulations, one after another", "3.2", *texts, solver


def _of_the_comparison(comparison: Path) -> Iterator[Row]:
    folder = models.opened(comparison)
    found = folder.record()["conditions"]
    limit = found["area_max"]
    reason = "as asked for" if limit is None else f"rows with areas up to {limit:g} % only"
    yield _row("rows that train", "3.2", TRAIN_ROWS, found["train_rows"], reason, "{:,.0f}")
    yield _row("rows that test", "3.2", PAPER_TESTS, found["test_rows"], reason, "{:,.0f}")
    what, here = "variance of test areas over their mean [%]", models.spread(folder)
    yield _row(what, "Table 4", paper.SPREAD, here, why("spread"), "{:.3g}")


def _of_the_cost(cost: Path) -> Iterator[Row]:
    published, (first, *_) = read_costs(cost)
    theirs, ours = published["query"], first["query"]
    reason = "ours with the statistics of a new surface, which take most of it"
    texts = time_of(theirs), time_of(ours), ratio(ours, theirs)
    yield "time of an answer", "4.4", *texts, reason
    if first["tuning"] > TAKEN:
        pays = first["tuning"] / (first["solve"] - ours)
        reason = "a faster solver makes the search dearer in contacts"
        what = "contacts that pay for the search"
        yield _row(what, "4.4", TUNING_PAYS, pays, reason, "{:,.0f}")
    reason = "statistics included; both the database and the solves beside it are cheaper here"
    even = first["break_even"]
    yield _row("break-even [contacts]", "4.4", PAPER_BREAK_EVEN, even, reason, "{:,.0f}")


def _row(
    quantity: str, section: str, theirs: float, ours: float, reason: str, form: str = "{:.4g}"
) -> Row:
    """Return a row; equal numbers need no explanation."""
    texts = form.format(theirs), form.format(ours)
    apart = ("none", "") if texts[0] == texts[1] else (ratio(ours, theirs), reason)
    return quantity, section, *texts, *apart
