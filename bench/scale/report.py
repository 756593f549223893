"""The files and the words: costs, simulated runs, a picture, and what follows from them."""

from collections.abc import Callable, Sequence
from dataclasses import astuple, fields
from pathlib import Path

import numpy as np

from bench.page.content import Content, Figure, Table
from bench.picture import new_figure, save
from bench.scale.costs import Costs, measure, read_costs, write_costs
from bench.scale.picture import draw
from bench.scale.studies import GOAL_RANKS, GOAL_ROWS, WANTED, Point, saturation, sweep
from bench.scale.validation import TOLERANCE, Comparison, compare
from bench.table import write_table
from gen.runtime.output import check_folder


def write_report(
    folder: Path,
    known: Path | None,
    remark: Callable[[str], None],
    *,
    validate: bool,
) -> tuple[list[Path], str]:
    """Measure the costs, simulate, and write `costs.json`, `scale.csv` and `scale.png`.

    Parameters
    ----------
    folder : where to; made if there is none
    known : costs that were measured before; None to measure them
    remark : told how far it is
    validate : True to compare with real runs first, in `validation.csv`

    Returns
    -------
    The files, and a summary for people

    Raises
    ------
    InputError
        If the folder cannot be written to, the costs cannot be read, or there is no mpiexec.
    """
    figure = new_figure()
    paths = [folder / "costs.json", folder / "scale.csv", folder / "scale.png"]
    check_folder(folder, *(path.name for path in paths), "validation.csv")
    costs = measure(remark) if known is None else read_costs(known)
    write_costs(paths[0], costs)
    text = ""
    if validate:
        comparisons = compare(costs, remark=remark)
        paths.append(folder / "validation.csv")
        _write_comparisons(paths[-1], comparisons)
        text = verdict_on(comparisons) + "\n"
    points = list(sweep(costs, remark))
    _write_points(paths[1], points)
    draw(figure, points)
    save(figure, paths[2])
    return paths, text + summary(costs, points)


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


def _write_points(path: Path, points: Sequence[Point]) -> None:
    write_table(path, (field.name for field in fields(Point)), map(astuple, points))


def _write_comparisons(path: Path, comparisons: Sequence[Comparison]) -> None:
    header = ("run", "real_seconds", "simulated_seconds", "relative_error")
    write_table(path, header, ((*astuple(each), each.error) for each in comparisons))
