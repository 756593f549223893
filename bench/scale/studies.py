"""`python -m bench scale`: ranks, rows, grids, writers and block sizes simulated, and reported."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from itertools import product
from pathlib import Path
from statistics import fmean
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.picture import new_figure
from bench.report import Report, remark
from bench.scale.costs import Costs, measure, read_costs, scene_with
from bench.scale.simulation import Writer, simulate
from bench.scale.validation import TOLERANCE, compare
from bench.template import rendered
from gen.generation import plan
from gen.generation.delivery import Block
from gen.generation.run import blocks_of
from gen.runtime.farm import IN_FLIGHT
from gen.schema import row_bytes

RANKS = (10, 50, 100, 200, 500, 1000, 2000, 5000, 10_000)
# Rows by nodes a side. More of the large ones only prolong the middle of a run.
ROWS = {129: (10**4, 10**5, 10**6, 10**7), 1025: (10**4, 10**5)}

BLOCKS = {
    129: [(n, 1) for n in (16, 64, 256, 1024)]
    + [(64, 64), (128, 64), (256, 64), (256, 128), (1024, 128), (1024, 256)],
    1025: [(1, 1), (2, 1), (4, 1), (16, 1), (2, 2), (4, 2), (16, 4)],
}
"""Rows that blocks may and should have, by nodes a side."""

# Ranks, and rows by nodes a side, that scheduling is judged by.
GOAL_RANKS, GOAL_ROWS = 500, {129: 10**6, 1025: 10**5}
WANTED = 0.9  # efficiency that they have to reach
# Who writes, by the name of the writer.
WRITERS: dict[str, Writer] = {"single": "master", "parallel": "workers"}

SEED = 1


Point = dict[str, Any]  # one simulated run, by the names of its columns
FILLING = (1, 16, 64, 256, 1024)  # rows of blocks for which the master's capacity is said


def sweep(costs: Costs) -> Iterator[Point]:
    """Simulate all ranks and rows with the program's own blocks, and other blocks at the goal."""
    for nodes, numbers in ROWS.items():
        for rows in numbers:
            remark(f"{nodes} x {nodes} nodes, {rows} rows")
            seconds = row_seconds(costs, nodes, rows)
            for writer, ranks in product(WRITERS, RANKS):
                yield simulated(costs, nodes, ranks, seconds, writer)
        remark(f"{nodes} x {nodes} nodes, blocks of other sizes")
        seconds = row_seconds(costs, nodes, GOAL_ROWS[nodes])
        for writer, (largest, smallest) in product(WRITERS, BLOCKS[nodes]):
            yield simulated(costs, nodes, GOAL_RANKS, seconds, writer, largest, smallest)


def row_seconds(costs: Costs, nodes: int, rows: int) -> NDArray[np.float64]:
    """Draw the times of rows from those that were measured [s]."""
    return np.random.default_rng(SEED).choice(np.array(costs.rows[nodes]), rows)


def simulated(
    costs: Costs,
    nodes: int,
    ranks: int,
    seconds: NDArray[np.float64],
    writer: str = "single",
    largest: int = 0,
    smallest: int = 1,
) -> Point:
    """Simulate one run on a grid with some nodes a side, given the time of each row [s].

    A parallel writer, every worker its own rows, is taken to cost what the single one does. Blocks
    may and should have some rows, 0 for the program's own rule. The run's `seconds` are those from
    the first task to the last row written; its `memory` is that of the master [bytes].
    """
    rows, workers = len(seconds), ranks - 1
    cut = blocks(nodes, rows, workers, largest, smallest)
    outcome = simulate(cut, seconds, workers, costs, write=WRITERS[writer])
    in_flight = IN_FLIGHT * workers * costs.task_memory
    waiting = outcome.waiting_rows * row_bytes(scene_with(nodes))
    return {
        "nodes": nodes,
        "ranks": ranks,
        "rows": rows,
        "largest": largest,
        "smallest": smallest if largest else 0,
        "writer": writer,
        "seconds": outcome.makespan,
        "efficiency": outcome.efficiency,
        "tail": outcome.tail,
        "busy": outcome.busy,
        "blocks": outcome.blocks,
        "memory": costs.memory + in_flight + waiting,
    }


def blocks(
    nodes: int, rows: int, workers: int, largest: int = 0, smallest: int = 1
) -> Iterator[Block]:
    """Cut a run of the paper's scene on a grid into the program's blocks, or of another size."""
    scene = scene_with(nodes).model_copy(update={"samples": rows})
    if not largest:
        return blocks_of(scene, [(0, rows)], workers)
    return plan.blocks(
        [(0, rows)],
        samples=rows,
        samples_per_surface=scene.samples_per_surface,
        workers=workers,
        largest=largest,
        smallest=smallest,
    )


def saturation(costs: Costs, nodes: int, block: int, *, write: bool) -> int:
    """Return how many workers keep the master busy all the time with blocks of some rows.

    The smallest w with w blocks in the time of one block: each needs a message, a turn of the
    farm's loop, which grows with w, and a write where the master writes.
    """
    time = block * float(np.mean(costs.rows[nodes]))
    fixed = costs.message(block) + costs.bookkeeping.fixed + (costs.write(block) if write else 0.0)
    each = costs.bookkeeping.each
    if not each:
        return round(time / fixed)
    return round((math.sqrt(fixed**2 + 4 * each * time) - fixed) / (2 * each))


def report(known: Path | None, *, validate: bool) -> Report:
    """Measure the costs unless they are known, compare with real runs if asked to, and simulate.

    Raises
    ------
    InputError
        If the costs cannot be read, or there is no mpiexec.
    """
    costs = measure() if known is None else read_costs(known)
    validation = {"validation": compare(costs)} if validate else {}
    points = list(sweep(costs))
    errors = [abs(row["relative_error"]) for rows in validation.values() for row in rows]
    return Report(
        {**validation, "scale": points},
        records={"costs": asdict(costs)},
        pictures={"scale": _picture(points)},
        text=summary(costs, points, errors),
    )


def summary(costs: Costs, points: Sequence[Point], errors: Sequence[float] = ()) -> str:
    """Say what the simulation says, and by how much it is off in real runs [1]."""

    def workers(nodes: int, writer: str) -> dict[int, int]:
        write = writer == "single"
        return {block: saturation(costs, nodes, block, write=write) for block in FILLING}

    said = {"errors": errors, "tolerance": TOLERANCE, "costs": costs, "goal": GOAL_RANKS}
    said |= {"wanted": WANTED, "mean": fmean, "min": min, "max": max}
    said |= {"busy": {pair: workers(*pair) for pair in product(costs.rows, WRITERS)}}
    said |= {"goals": list(_at_goal(points))}
    return rendered("scale/scale.txt.jinja", said).rstrip()


def _at_goal(points: Sequence[Point]) -> Iterator[tuple[Point, Point]]:
    """Yield the runs at the goal with the program's blocks, and with the best of others."""
    for nodes, writer in product(GOAL_ROWS, WRITERS):
        goal = {"ranks": GOAL_RANKS, "rows": GOAL_ROWS[nodes], "nodes": nodes, "writer": writer}
        mine = [point for point in points if goal.items() <= point.items()]
        own = [point for point in mine if not point["largest"]]
        yield from ((each, max(mine, key=lambda point: point["efficiency"])) for each in own[:1])


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
                for panel, column in ((efficiency, "efficiency"), (busy, "busy")):
                    panel.plot(ranks, [point[column] for point in mine], style, **look)
        efficiency.axhline(WANTED, color="0.7", linewidth=0.8)
        efficiency.axvline(GOAL_RANKS, color="0.7", linewidth=0.8)
        efficiency.set(xscale="log", title=f"{nodes} × {nodes} nodes")
        busy.set(xlabel="ranks")
    panels[0, 0].set_ylabel("efficiency of the workers")
    panels[1, 0].set_ylabel("share of time the master works")
    figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure
