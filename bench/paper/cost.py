"""Total cost of solver and surrogate against the number of queries: section 4.4."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from bench.page.content import Content, Figure, Table
from bench.paper.deviations import ratio
from bench.paper.facts import TUNING_PAYS
from bench.picture import new_figure, save
from bench.style import STYLES
from bench.surrogates.break_even import PAPER_BREAK_EVEN, TAKEN, break_even
from bench.surrogates.clock import time_of
from bench.surrogates.cost import NEW, OURS
from bench.surrogates.cost import PAPER as PAPERS
from bench.table import write_table
from gen.runtime.errors import InputError
from gen.runtime.input_file import require_file

Costs = dict[str, Any]
"""A row of the table of `bench cost`: its costs [s], and the contacts from which on it pays."""


def read(cost: Path) -> tuple[Costs, list[Costs]]:
    """Read from `bench cost` the paper's own costs, and ours on new surfaces by feature set."""
    try:
        table = pd.read_csv(require_file(cost / "cost.csv"))
        theirs = table[(table["solver"] == PAPERS) & (table["asked"] != NEW)]
        ours = table[(table["solver"] == OURS) & (table["asked"] == NEW)]
    except (OSError, InputError, KeyError, ValueError):
        raise InputError(f"--cost {cost}: give a folder of python -m bench cost") from None
    if theirs.empty or ours.empty:
        raise InputError(f"--cost {cost}: its cost.csv lacks rows; run python -m bench cost again")
    return theirs.to_dict("records")[0], ours.to_dict("records")


def total_cost(folder: Path, cost: Path) -> list[Content]:
    """Draw and tabulate the costs of both sides, and where they meet."""
    published, ours = read(cost)
    first = ours[0]
    table = write_table(
        folder / "total-cost.csv",
        ("cost", "paper", *(f"ours_{each['features']}" for each in ours), "ours_over_paper", "why"),
        _rows(published, ours),
    )
    picture = save(_picture(published, ours), folder / "total-cost.png")
    text = (
        "Section 4.4, total cost against the number of contacts: the solver's line starts at zero,"
        " a surrogate's at its database, search and fit. Left, the paper's own times: they meet at"
        f" {published['break_even']:,.0f} contacts (it says about {PAPER_BREAK_EVEN:,}), hardly"
        " more than its database has, for all else costs next to nothing beside it. Right, ours:"
        f" with a solve of {time_of(first['solve'])} they meet at {first['break_even']:,.0f} with"
        " the paper's features, statistics of each new surface included, and the surrogate gains"
        f" {first['solve'] / first['query']:.3g}-fold at most, the paper's"
        f" {published['solve'] / published['query']:,.0f}-fold."
    )
    return [
        Figure(picture, text, data=(table,)),
        Table(
            table,
            "Section 4.4 in numbers, t_d + t_h + t_f + t_p: ours on as many rows as `bench cost`"
            " was given, processor times of one core.",
        ),
    ]


def _rows(published: Costs, ours: list[Costs]) -> Iterator[tuple[str, ...]]:
    """Yield a row for each cost: its cells, ours over the paper's, and why."""
    solver = "the solver makes the difference"
    own_features = "ours with the features of a new surface"
    pays = "a faster solver needs no surrogate"
    costs = (
        ("rows of the database", "rows", _count, ""),
        ("a contact by the solver", "solve", time_of, solver),
        ("t_d, database", "database", time_of, solver),
        ("t_h, search for settings", "tuning", _searched, "none: the paper's optimum was taken"),
        ("t_f, fit", "fit", time_of, "another machine, one thread"),
        ("t_p, an answer", "query", time_of, own_features),
        ("contacts from which on it pays", "break_even", _count, pays),
    )
    sides = (published, *ours)
    for title, name, text, why in costs:
        cells = [text(each[name]) for each in sides]
        compared = name != "rows" and "none" not in cells
        yield title, *cells, ratio(ours[0][name], published[name]) if compared else "", why
    cells = [_count(break_even(each["tuning"], each["solve"], each["query"])) for each in sides]
    cells[0] += f" (it says {TUNING_PAYS})"
    yield "contacts that pay for the search", *cells, "", ""


def _searched(seconds: float) -> str:
    return time_of(seconds) if seconds > TAKEN else "none"


def _count(number: float) -> str:
    """Write a number of rows or contacts, or never."""
    return "never" if math.isinf(number) else f"{number:,.0f}"


def _picture(published: Costs, ours: list[Costs]) -> Any:
    """Draw a panel for the paper and one for ours."""
    figure = new_figure(10.5, 4.6)
    left, right = figure.subplots(1, 2)
    _draw(left, [published], ["surrogate (kernel ridge)"])
    _draw(right, ours, [f"{each['features']} features" for each in ours])
    left.set_title("(a) the paper's times")
    right.set_title("(b) ours, new surfaces")
    return figure


def _draw(axis: Any, sides: list[Costs], names: list[str]) -> None:
    """Draw the solver's line, each surrogate's, and where they meet."""
    finite = [each["break_even"] for each in sides if math.isfinite(each["break_even"])]
    queries = np.geomspace(1, 30 * max(finite, default=1e5), 300)
    solver = sides[0]["solve"]
    label = f"solver, {time_of(solver)} a contact"
    axis.loglog(queries, queries * solver, color="0.3", lw=2, label=label)
    for each, name, style in zip(sides, names, STYLES, strict=False):
        even = each["break_even"]
        total = each["database"] + each["tuning"] + each["fit"] + queries * each["query"]
        label = f"{name}, pays from {_count(even)}"
        axis.loglog(queries, total, color=style["color"], label=label)
        if math.isfinite(even):
            axis.plot(even, even * solver, ms=8, **style)
    axis.set(xlabel="number of contacts", ylabel="total time [s]")
    axis.grid(visible=True, which="major", color="0.9")
    axis.legend(fontsize=9, loc="upper left")
