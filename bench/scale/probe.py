"""`python -m mpi4py -m bench.scale.probe SPEC`: a farm of tasks of known length, timed.

The tasks sleep, so that more ranks than cores do not disturb each other; what they return is as
large as the rows of a block, and is written where the specification says so. Prints times in JSON.
"""

import time
from collections.abc import Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path

import numpy as np

from bench.scale.launch import answer
from gen import database
from gen.arrays import Columns
from gen.generation.delivery import Block
from gen.runtime import farm
from gen.scene import Scene
from gen.schema import Status, columns_for

Task = tuple[Block, float]  # a block of rows, and how long it takes [s]


def scene_of(rows: int) -> Scene:
    """Return a scene without fields; its grid does not matter, since nothing is computed."""
    return Scene.parse(f"samples = {rows}\n[surface]\nnodes = 9\n", "the probe's scene")


def empty_rows(scene: Scene, count: int) -> Columns:
    """Return rows in which nothing stands but that they are done."""
    rows = {
        column.name: np.full(column.shape(count, scene.shape), column.fill, column.dtype)
        for column in columns_for(scene)
    }
    rows["status"][:] = Status.DONE
    return rows


def probe(
    world: farm.World, tasks: Sequence[Task], output: str = "", repeats: int = 1
) -> list[dict[str, float]]:
    """Do the tasks repeatedly, and write their rows into a database if one is named.

    Every process of the world has to call it. Times of each repetition are those from the first
    task handed out to the last one written (`wall`), of the master's processor meanwhile
    (`master`), and a worker's median between the end of a task and the start of its next (`gap`).
    """
    scene = scene_of(max(stop for (_, stop), _ in tasks))
    times: list[tuple[int, float, float]] = []
    with ExitStack() as stack:
        writer: database.Writer | None = None
        if world.is_master and output:
            database.create(Path(output), scene)
            writer = stack.enter_context(database.Writer(Path(output), scene))

        def take(task: Task, result: tuple[int, float, float, Columns]) -> None:
            times.append(result[:3])
            if writer is not None:
                writer.write_block(*task[0], result[3])

        timings = []
        for _ in range(repeats):
            times.clear()
            world.broadcast(None)  # all are there: start-up is not what is measured
            began, busy = time.perf_counter(), time.process_time()
            farm.run(partial(_sleep, scene, world.rank), iter(tasks), take, world)
            wall, master = time.perf_counter() - began, time.process_time() - busy
            timings.append({"wall": wall, "master": master, "gap": _median_gap(times)})
    return timings


def _sleep(scene: Scene, rank: int, task: Task) -> tuple[int, float, float, Columns]:
    """Take as long as the task says; say who it was, and when."""
    (start, stop), seconds = task
    began = time.perf_counter()
    if seconds:
        time.sleep(seconds)
    rows = empty_rows(scene, stop - start)
    return rank, began, time.perf_counter(), rows


def _median_gap(times: list[tuple[int, float, float]]) -> float:
    """Return the median time between two tasks of a worker; clocks of one machine are alike."""
    last: dict[int, float] = {}
    gaps = []
    for rank, began, ended in sorted(times, key=lambda entry: entry[1]):
        if rank in last:
            gaps.append(began - last[rank])
        last[rank] = ended
    return float(np.median(gaps)) if gaps else 0.0


if __name__ == "__main__":
    answer(lambda arguments, world: probe(world, **arguments))
