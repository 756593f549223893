"""Total cost of solver and surrogate against the number of queries: section 4.4."""

import csv
import math
from pathlib import Path
from typing import Any

import numpy as np

from bench.page.content import Content, Figure, Table
from bench.paper.deviations import ratio
from bench.paper.facts import TUNING_PAYS
from bench.picture import new_figure, save
from bench.style import STYLES
from bench.surrogates.break_even import PAPER_BREAK_EVEN, TAKEN
from bench.surrogates.clock import time_of
from bench.surrogates.cost import NEW, OURS
from bench.surrogates.cost import PAPER as PAPERS
from bench.table import write_table
from gen.runtime.errors import InputError
from gen.runtime.input_file import require_file

Question = dict[str, Any]

NUMBERS = ("rows", "database", "tuning", "fit", "solve", "query", "break_even")


def read(cost: Path) -> tuple[Question, list[Question]]:
    """Read what `bench cost` measured.

    Returns
    -------
    The paper's own costs, and ours on new surfaces, one of each feature set

    Raises
    ------
    InputError
        If the folder has no such table.
    """
    path = require_file(cost / "cost.csv")
    try:
        with path.open(encoding="utf-8") as file:
            rows: list[Question] = [
                {**row, **{name: float(row[name]) for name in NUMBERS}}
                for row in csv.DictReader(file)
            ]
    except (OSError, KeyError, ValueError, TypeError):
        raise InputError(f"--cost {cost}: give a folder of python -m bench cost") from None
    published = [row for row in rows if row["solver"] == PAPERS and row["asked"] != NEW]
    ours = [row for row in rows if (row["solver"], row["asked"]) == (OURS, NEW)]
    if not published or not ours:
        raise InputError(f"--cost {cost}: its cost.csv lacks rows; run python -m bench cost again")
    return published[0], ours


def build(question: Question) -> float:
    """What is paid before the first answer [s]."""
    return float(question["database"] + question["tuning"] + question["fit"])


def total_cost(folder: Path, cost: Path) -> list[Content]:
    """Both sides' costs, and where they meet."""
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


def _rows(published: Question, ours: list[Question]) -> list[tuple[str, ...]]:
    """One row a cost."""
    names = {
        "rows": ("rows of the database", ""),
        "solve": ("a contact by the solver", "the solver makes the difference"),
        "database": ("t_d, database", "the solver makes the difference"),
        "tuning": ("t_h, search for settings", "none: the paper's optimum was taken"),
        "fit": ("t_f, fit", "another machine, one thread"),
        "query": ("t_p, an answer", "ours with the features of a new surface"),
        "break_even": ("contacts from which on it pays", "a faster solver needs no surrogate"),
    }
    found = []
    for name, (title, why) in names.items():
        cells = [_cell(name, each[name]) for each in (published, *ours)]
        times = "" if name == "rows" or "none" in cells else ratio(ours[0][name], published[name])
        found.append((title, *cells, times, why))
    pays = [each["tuning"] / (each["solve"] - each["query"]) for each in (published, *ours)]
    cells = [f"{math.ceil(value):,}" if 0 <= value < math.inf else "never" for value in pays]
    cells[0] += f" (it says {TUNING_PAYS})"
    found.append(("contacts that pay for the search", *cells, "", ""))
    return found


def _cell(name: str, value: float) -> str:
    if math.isinf(value):
        return "never"
    if name in {"rows", "break_even"}:
        return f"{value:,.0f}"
    return time_of(value) if name != "tuning" or value > TAKEN else "none"


def _picture(published: Question, ours: list[Question]) -> Any:
    """A panel for the paper, one for ours."""
    figure = new_figure(10.5, 4.6)
    left, right = figure.subplots(1, 2)
    _draw(left, [published], ["surrogate (kernel ridge)"])
    _draw(right, ours, [f"{each['features']} features" for each in ours])
    left.set_title("(a) the paper's times")
    right.set_title("(b) ours, new surfaces")
    return figure


def _draw(axis: Any, questions: list[Question], names: list[str]) -> None:
    """The solver's line, each surrogate's, and where they meet."""
    finite = [each["break_even"] for each in questions if math.isfinite(each["break_even"])]
    queries = np.geomspace(1, 30 * max(finite, default=1e5), 300)
    solver = questions[0]["solve"]
    label = f"solver, {time_of(solver)} a contact"
    axis.loglog(queries, queries * solver, color="0.3", lw=2, label=label)
    for each, name, style in zip(questions, names, STYLES, strict=False):
        meets = f"{each['break_even']:,.0f}" if math.isfinite(each["break_even"]) else "never"
        total = build(each) + queries * each["query"]
        axis.loglog(queries, total, color=style["color"], label=f"{name}, pays from {meets}")
        if math.isfinite(each["break_even"]):
            axis.plot(each["break_even"], each["break_even"] * solver, ms=8, **style)
    axis.set(xlabel="number of contacts", ylabel="total time [s]")
    axis.grid(visible=True, which="major", color="0.9")
    axis.legend(fontsize=9, loc="upper left")
