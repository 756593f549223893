"""The numbers in the paper's text, outside its tables, beside ours."""

from collections.abc import Iterator
from pathlib import Path

from bench.contents import Content
from bench.files import write_table
from bench.paper import cost as costs
from bench.paper import database as databases
from bench.paper import models
from bench.paper.facts import AREA_MAX, LONGEST_SOLVE, TRAIN_ROWS, TUNING_PAYS
from bench.paper.texts import ratio, table, why
from bench.surrogates import times
from bench.surrogates.times import PAPER_ROWS, PAPER_SOLVE
from gen.database import Reader
from gen.schema import Status
from learn.comparison import paper
from learn.surrogate.break_even import time_of

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
    rows = databases.read(path)
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
    yield _row("rows that test", "3.2", times.PAPER_TESTS, found["test_rows"], reason, "{:,.0f}")
    what, here = "variance of test areas over their mean [%]", models.spread(folder)
    yield _row(what, "Table 4", paper.SPREAD, here, why("spread"), "{:.3g}")


def _of_the_cost(cost: Path) -> Iterator[Row]:
    published, (first, *_) = costs.read(cost)
    theirs, ours = published["query"], first["query"]
    reason = "ours with the statistics of a new surface, which take most of it"
    texts = time_of(theirs), time_of(ours), ratio(ours, theirs)
    yield "time of an answer", "4.4", *texts, reason
    if first["tuning"] > times.TAKEN:
        pays = first["tuning"] / (first["solve"] - ours)
        reason = "a faster solver makes the search dearer in contacts"
        what = "contacts that pay for the search"
        yield _row(what, "4.4", TUNING_PAYS, pays, reason, "{:,.0f}")
    reason = "statistics included; both the database and the solves beside it are cheaper here"
    even = first["break_even"]
    yield _row("break-even [contacts]", "4.4", times.PAPER_BREAK_EVEN, even, reason, "{:,.0f}")


def _row(
    quantity: str, section: str, theirs: float, ours: float, reason: str, form: str = "{:.4g}"
) -> Row:
    """Return a row; equal numbers need no explanation."""
    texts = form.format(theirs), form.format(ours)
    apart = ("none", "") if texts[0] == texts[1] else (ratio(ours, theirs), reason)
    return quantity, section, *texts, *apart
