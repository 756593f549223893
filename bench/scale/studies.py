"""What is simulated: ranks, rows, grids, writers and block sizes."""

import math
from collections.abc import Iterator
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.remarks import remark
from bench.scale.costs import Costs, scene_with
from bench.scale.simulation import Writer, simulate
from gen.generation import plan
from gen.generation.delivery import Block
from gen.generation.run import blocks_of
from gen.runtime.farm import IN_FLIGHT
from gen.schema import row_bytes

RANKS = (10, 50, 100, 200, 500, 1000, 2000, 5000, 10_000)
ROWS = {129: (10**4, 10**5, 10**6, 10**7), 1025: (10**4, 10**5)}
"""Rows by nodes a side. More of the large ones only prolong the middle of a run."""

BLOCKS = {
    129: [(n, 1) for n in (16, 64, 256, 1024)]
    + [(64, 64), (128, 64), (256, 64), (256, 128), (1024, 128), (1024, 256)],
    1025: [(1, 1), (2, 1), (4, 1), (16, 1), (2, 2), (4, 2), (16, 4)],
}
"""Rows that blocks may and should have, by nodes a side."""

GOAL_RANKS, GOAL_ROWS = 500, {129: 10**6, 1025: 10**5}
"""Ranks, and rows by nodes a side, that scheduling is judged by."""

WANTED = 0.9
"""Efficiency that they have to reach."""

WRITERS: dict[str, Writer] = {"single": "master", "parallel": "workers"}
"""Who writes, by the name of the writer."""

SEED = 1


Point = dict[str, Any]
"""One simulated run, by the names of its columns."""


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
