"""`python -m bench scale`: costs, simulated runs, a picture, and what follows from them."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from bench.page.content import Content, Figure, Table
from bench.picture import new_figure
from bench.report import Report
from bench.scale.costs import Costs, measure, read_costs
from bench.scale.studies import (
    GOAL_RANKS,
    GOAL_ROWS,
    WANTED,
    WRITERS,
    Point,
    saturation,
    sweep,
)
from bench.scale.validation import TOLERANCE, compare


def report(known: Path | None, *, validate: bool) -> Report:
    """Measure the costs unless they are known, compare with real runs if asked to, and simulate.

    Raises
    ------
    InputError
        If the costs cannot be read, or there is no mpiexec.
    """
    costs = measure() if known is None else read_costs(known)
    tables: dict[str, Sequence[Any]] = {}
    text = ""
    if validate:
        tables["validation"] = compare(costs)
        text = f"{verdict_on(tables['validation'])}\n"
    points = tables["scale"] = list(sweep(costs))
    return Report(
        tables,
        records={"costs": asdict(costs)},
        pictures={"scale": _picture(points)},
        text=text + summary(costs, points),
    )


def contents(folder: Path) -> list[Content]:
    """List what a page shows of a folder that holds this report."""
    return [
        Figure(
            folder / "scale.png",
            "SIMULATED, with costs of rows, messages and writes measured on this machine:"
            " efficiency of the farm on 10 to 10,000 ranks, for 1e4 to 1e7 rows, both writers.",
            data=(folder / "scale.csv",),
        ),
        Table(folder / "validation.csv", "The simulation beside real runs here."),
    ]


def summary(costs: Costs, points: Sequence[Point]) -> str:
    """Say what the simulation says, in lines; all simulated, from costs that were measured."""
    lines = ["Simulation, from costs measured on this machine:"]
    for nodes, seconds in costs.rows.items():
        mean, low, high = (1e3 * each for each in (np.mean(seconds), min(seconds), max(seconds)))
        lines.append(f"  {nodes} x {nodes} nodes: {mean:.1f} ms a row ({low:.1f} to {high:.1f})")
    for name, line, what in (
        ("message", costs.message, "row"),
        ("write", costs.write, "row"),
        ("farm's loop", costs.bookkeeping, "worker"),
    ):
        fixed, each = 1e3 * line.fixed, 1e6 * line.each
        lines.append(f"  {name}: {fixed:.2f} ms a block + {each:.2f} us a {what}")
    lines.append("Workers that keep one master busy, by rows of a block:")
    for nodes, writer in product(costs.rows, WRITERS):
        counts = ", ".join(
            f"{block}: {saturation(costs, nodes, block, write=writer == 'single'):,}"
            for block in (1, 16, 64, 256, 1024)
        )
        lines.append(f"  {nodes} nodes, {writer} writer: {counts}")
    return "\n".join([*lines, *_goal_lines(points)])


def _goal_lines(points: Sequence[Point]) -> Iterator[str]:
    """Yield the efficiency at the goal, with the program's blocks and with the best of others."""
    yield f"On {GOAL_RANKS} ranks, mark {WANTED:.0%}:"
    at_goal: dict[tuple[int, str], list[Point]] = {}
    for point in points:
        if (point["ranks"], point["rows"]) == (GOAL_RANKS, GOAL_ROWS[point["nodes"]]):
            at_goal.setdefault((point["nodes"], point["writer"]), []).append(point)
    for (nodes, writer), mine in at_goal.items():
        own = next(point for point in mine if not point["largest"])
        best = max(mine, key=lambda point: point["efficiency"])
        sizes = (
            f"{best['smallest']} to {best['largest']}" if best["largest"] else "the program's own"
        )
        yield (
            f"  {own['rows']:,} rows, {nodes} nodes, {writer} writer: {own['efficiency']:.1%},"
            f" master {own['busy']:.0%} busy, idle tail {own['tail']:.1%};"
            f" best {best['efficiency']:.1%} with blocks of {sizes} rows"
        )


def verdict_on(comparisons: Sequence[Mapping[str, Any]]) -> str:
    """Say whether the simulation agrees with real runs."""
    errors = [abs(each["relative_error"]) for each in comparisons]
    right = sum(error <= TOLERANCE for error in errors)
    return (
        f"Simulated times of {right} of {len(errors)} real runs within {TOLERANCE:.0%};"
        f" worst {max(errors):.0%}"
    )


def _picture(points: Sequence[Point]) -> Any:
    """Draw efficiency over ranks above, the busy master below; a column for each grid."""
    grids = sorted({point["nodes"] for point in points})
    figure = new_figure(5 * len(grids), 7)
    figure.suptitle("Simulation of the farm, from measured costs")
    panels = figure.subplots(2, len(grids), squeeze=False, sharex=True, sharey="row")
    for (efficiency, busy), nodes in zip(panels.T, grids, strict=True):
        here = [point for point in points if point["nodes"] == nodes and not point["largest"]]
        for number, rows in enumerate(sorted({point["rows"] for point in here})):
            for writer, style in (("single", "o-"), ("parallel", "s--")):
                mine = [p for p in here if (p["rows"], p["writer"]) == (rows, writer)]
                ranks = [point["ranks"] for point in mine]
                label = f"{rows:.0e} rows, {writer} writer"
                look = {"color": f"C{number}", "markersize": 3, "label": label}
                efficiency.plot(ranks, [point["efficiency"] for point in mine], style, **look)
                busy.plot(ranks, [point["busy"] for point in mine], style, **look)
        efficiency.axhline(WANTED, color="0.7", linewidth=0.8)
        efficiency.axvline(GOAL_RANKS, color="0.7", linewidth=0.8)
        efficiency.set(xscale="log", title=f"{nodes} × {nodes} nodes")
        busy.set(xlabel="ranks")
    panels[0, 0].set_ylabel("efficiency of the workers")
    panels[1, 0].set_ylabel("share of time the master works")
    figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure
