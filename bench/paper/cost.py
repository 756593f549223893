"""Total cost of solver and surrogate against the number of queries: section 4.4."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pandas as pd

from bench.contents import Content
from bench.files import write_table
from bench.paper.facts import TUNING_PAYS
from bench.paper.texts import picture, ratio, table
from bench.picture import new_figure
from bench.surrogates.cost import NEW, OURS, count, draw_costs
from bench.surrogates.cost import PAPER as PAPERS
from bench.surrogates.times import PAPER_BREAK_EVEN, TAKEN
from gen.runtime.errors import InputError
from gen.runtime.files import require_file
from learn.surrogate.break_even import break_even, time_of

# A row of the table of `bench cost`: its costs [s], and the contacts from which on it pays.
Costs = dict[str, Any]


def read(cost: Path) -> tuple[Costs, list[Costs]]:
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
    published, ours = read(cost)
    first = ours[0]
    data = write_table(
        folder / "total-cost.csv",
        ("cost", "paper", *(f"ours_{each['features']}" for each in ours), "ours_over_paper", "why"),
        _rows(published, ours),
    )
    said: dict[str, Any] = {"theirs": published, "ours": first, "said": PAPER_BREAK_EVEN}
    said |= {"solve": time_of(first["solve"]), "gain": first["solve"] / first["query"]}
    said |= {"gains": published["solve"] / published["query"]}
    drawn = _picture(published, ours)
    return [picture(folder, "total-cost", drawn, data, **said), table(data, "costs")]


def _rows(published: Costs, ours: list[Costs]) -> Iterator[tuple[str, ...]]:
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
    for title, name, text, why in costs:
        cells = [text(each[name]) for each in sides]
        compared = name != "rows" and "none" not in cells
        yield title, *cells, ratio(ours[0][name], published[name]) if compared else "", why
    cells = [count(break_even(each["tuning"], each["solve"], each["query"])) for each in sides]
    cells[0] += f" (it says {TUNING_PAYS})"
    yield "contacts that pay for the search", *cells, "", ""


def _searched(seconds: float) -> str:
    return time_of(seconds) if seconds > TAKEN else "none"


def _picture(published: Costs, ours: list[Costs]) -> Any:
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
