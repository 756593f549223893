"""The numbers in the paper's text, outside its tables, beside ours."""

from collections.abc import Iterator
from pathlib import Path

from bench.page.content import Content, Table
from bench.paper import cost as costs
from bench.paper import database as databases
from bench.paper import deviations, models
from bench.paper.deviations import ratio
from bench.paper.facts import AREA_MAX, LONGEST_SOLVE, SPREAD, TRAIN_ROWS, TUNING_PAYS
from bench.surrogates.break_even import (
    PAPER_BREAK_EVEN,
    PAPER_ROWS,
    PAPER_SOLVE,
    PAPER_TESTS,
    TAKEN,
)
from bench.surrogates.clock import time_of
from bench.table import write_table
from gen.database import Reader
from gen.schema import Status

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
    table = write_table(folder / "numbers.csv", HEADER, rows)
    text = "Numbers in the paper's text beside ours, with what is known about why they differ."
    return [Table(table, text)]


def _of_the_database(path: Path) -> Iterator[Row]:
    rows = databases.read(path)
    area, seconds, done = rows["area_percent"], rows["solve_seconds"], len(rows)
    with Reader(path) as reader:
        failed = int((reader.column("status") == Status.FAILED).sum())
    asked = "" if done == PAPER_ROWS else "as asked for"
    yield _row("rows of the database", "3.2", PAPER_ROWS, done, asked, "{:,.0f}")
    yield "failed simulations", "3.1", "some", f"{failed:,}", "", ""
    why = deviations.AREAS.format(AREA_MAX)
    yield _row("largest area [%]", "Table 1", AREA_MAX, float(area.max()), why)
    below = 100 * float((area <= AREA_MAX).mean())
    yield _row("rows up to the paper's largest area [%]", "Table 1", 100.0, below, why, "{:.3g}")
    mean, longest = float(seconds.mean()), float(seconds.max())
    solver = deviations.SOLVER
    yield _row("mean time of a simulation [s]", "3.2, 4.4", PAPER_SOLVE, mean, solver)
    yield _row("longest simulation [s]", "2.4", LONGEST_SOLVE, longest, solver)
    theirs, ours = PAPER_ROWS * PAPER_SOLVE, done * mean
    times = f"1/{theirs / ours:,.0f}"
    yield "all simulations, one after another", "3.2", time_of(theirs), time_of(ours), times, solver


def _of_the_comparison(comparison: Path) -> Iterator[Row]:
    folder = models.opened(comparison)
    found = folder.record()["conditions"]
    limit = found["area_max"]
    why = "as asked for" if limit is None else f"rows with areas up to {limit:g} % only"
    yield _row("rows that train", "3.2", TRAIN_ROWS, found["train_rows"], why, "{:,.0f}")
    yield _row("rows that test", "3.2", PAPER_TESTS, found["test_rows"], why, "{:,.0f}")
    here = models.spread(folder)
    why = (
        "ours have another distribution of areas (the paper's follows from its nMSE and R2);"
        " so nMSE differs at equal R2"
    )
    yield _row("variance of test areas over their mean [%]", "Table 4", SPREAD, here, why, "{:.3g}")


def _of_the_cost(cost: Path) -> Iterator[Row]:
    published, (first, *_) = costs.read(cost)
    theirs, ours = published["query"], first["query"]
    why = "ours with the statistics of a new surface, which take most of it"
    yield "time of an answer", "4.4", time_of(theirs), time_of(ours), ratio(ours, theirs), why
    if first["tuning"] > TAKEN:
        pays = first["tuning"] / (first["solve"] - ours)
        why = "a faster solver makes the search dearer in contacts"
        yield _row("contacts that pay for the search", "4.4", TUNING_PAYS, pays, why, "{:,.0f}")
    why = "statistics included; the database is cheaper here, and so is what it is compared with"
    even = first["break_even"]
    yield _row("break-even [contacts]", "4.4", PAPER_BREAK_EVEN, even, why, "{:,.0f}")


def _row(
    quantity: str, section: str, theirs: float, ours: float, why: str, form: str = "{:.4g}"
) -> Row:
    """Return a row; equal numbers need no explanation."""
    texts = form.format(theirs), form.format(ours)
    apart = ("none", "") if texts[0] == texts[1] else (ratio(ours, theirs), why)
    return quantity, section, *texts, *apart
