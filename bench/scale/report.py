"""`python -m bench scale`: costs, simulated runs, a picture, and what follows from them."""

from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from bench.page.content import Content, Figure, Table
from bench.picture import new_figure
from bench.report import Report
from bench.scale.costs import Costs, measure, read_costs
from bench.scale.studies import GOAL_RANKS, GOAL_ROWS, WANTED, Point, saturation, sweep
from bench.scale.validation import TOLERANCE, Comparison, compare
from bench.table import record


def report(known: Path | None, remark: Callable[[str], None], *, validate: bool) -> Report:
    """Measure the costs, and simulate.

    Parameters
    ----------
    known : costs that were measured before; None to measure them
    remark : told how far it is
    validate : True to compare with real runs first

    Raises
    ------
    InputError
        If the costs cannot be read, or there is no mpiexec.
    """
    costs = measure(remark) if known is None else read_costs(known)
    comparisons = compare(costs, remark=remark) if validate else []
    points = list(sweep(costs, remark))
    tables: dict[str, Sequence[Any]] = {"scale": points}
    text = summary(costs, points)
    if validate:
        tables["validation"] = [
            {**record(each), "relative_error": each.error} for each in comparisons
        ]
        text = f"{verdict_on(comparisons)}\n{text}"
    return Report(
        tables, records={"costs": asdict(costs)}, pictures={"scale": _picture(points)}, text=text
    )


def contents(folder: Path) -> list[Content]:
    """List what a page shows of a folder that `write_report` has written."""
    shown: list[Content] = [
        Figure(
            folder / "scale.png",
            "SIMULATED, with costs of rows, messages and writes measured on this machine:"
            " efficiency of the farm on 10 to 10,000 ranks, for 1e4 to 1e7 rows, both writers.",
            data=(folder / "scale.csv",),
        )
    ]
    if (folder / "validation.csv").exists():
        shown.append(Table(folder / "validation.csv", "The simulation beside real runs here."))
    return shown


def summary(costs: Costs, points: Sequence[Point]) -> str:
    """What the simulation says, in lines; all of it simulated, from costs that were measured."""
    lines = ["Simulation, from costs measured on this machine:"]
    for nodes, seconds in costs.rows.items():
        lines.append(
            f"  {nodes} x {nodes} nodes: {1e3 * np.mean(seconds):.1f} ms a row"
            f" ({1e3 * min(seconds):.1f} to {1e3 * max(seconds):.1f})"
        )
    for name, line in (("message", costs.message), ("write", costs.write)):
        lines.append(
            f"  {name}: {1e3 * line.fixed:.2f} ms a block + {1e6 * line.each:.2f} us a row"
        )
    loop = costs.bookkeeping
    lines.append(
        f"  farm's loop: {1e3 * loop.fixed:.2f} ms a block + {1e6 * loop.each:.2f} us a worker"
    )
    lines.append("Workers that keep one master busy, by rows of a block:")
    for nodes in costs.rows:
        for writer in ("single", "parallel"):
            counts = ", ".join(
                f"{block}: {saturation(costs, nodes, block, write=writer == 'single'):,}"
                for block in (1, 16, 64, 256, 1024)
            )
            lines.append(f"  {nodes} nodes, {writer} writer: {counts}")
    return "\n".join([*lines, *_goal_lines(points)])


def _goal_lines(points: Sequence[Point]) -> list[str]:
    """Efficiency at the goal, with the program's blocks and with the best of the others."""
    lines = [f"On {GOAL_RANKS} ranks, mark {WANTED:.0%}:"]
    at_goal = [
        point
        for point in points
        if point.ranks == GOAL_RANKS and point.rows == GOAL_ROWS[point.nodes]
    ]
    for nodes, writer in dict.fromkeys((p.nodes, p.writer) for p in at_goal):
        mine = [p for p in at_goal if (p.nodes, p.writer) == (nodes, writer)]
        own = next(point for point in mine if not point.largest)
        best = max(mine, key=lambda point: point.efficiency)
        best_blocks = f"{best.smallest} to {best.largest}" if best.largest else "the program's own"
        lines.append(
            f"  {own.rows:,} rows, {nodes} nodes, {writer} writer:"
            f" {own.efficiency:.1%}, master {own.busy:.0%} busy, idle tail {own.tail:.1%};"
            f" best {best.efficiency:.1%} with blocks of {best_blocks} rows"
        )
    return lines


def verdict_on(comparisons: Sequence[Comparison]) -> str:
    """Whether the simulation agrees with real runs."""
    errors = [abs(comparison.error) for comparison in comparisons]
    right = sum(error <= TOLERANCE for error in errors)
    return (
        f"Simulated times of {right} of {len(errors)} real runs within {TOLERANCE:.0%};"
        f" worst {max(errors):.0%}"
    )


def _picture(points: Sequence[Point]) -> Any:
    """Draw efficiency over ranks above, the busy master below; a column for each grid."""
    grids = sorted({point.nodes for point in points})
    figure = new_figure(5 * len(grids), 7)
    figure.suptitle("Simulation of the farm, from measured costs")
    panels = figure.subplots(2, len(grids), squeeze=False, sharex=True, sharey="row")
    own = [point for point in points if not point.largest]
    for column, nodes in enumerate(grids):
        efficiency, busy = panels[:, column]
        here = [point for point in own if point.nodes == nodes]
        for number, rows in enumerate(sorted({point.rows for point in here})):
            for writer, style in (("single", "o-"), ("parallel", "s--")):
                mine = [p for p in here if p.rows == rows and p.writer == writer]
                ranks = [point.ranks for point in mine]
                label = f"{rows:.0e} rows, {writer} writer"
                look = {"color": f"C{number}", "markersize": 3, "label": label}
                efficiency.plot(ranks, [point.efficiency for point in mine], style, **look)
                busy.plot(ranks, [point.busy for point in mine], style, **look)
        efficiency.axhline(WANTED, color="0.7", linewidth=0.8)
        efficiency.axvline(GOAL_RANKS, color="0.7", linewidth=0.8)
        efficiency.set(xscale="log", title=f"{nodes} × {nodes} nodes")
        busy.set(xlabel="ranks")
    panels[0, 0].set_ylabel("efficiency of the workers")
    panels[1, 0].set_ylabel("share of time the master works")
    figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure
