"""`python -m mpi4py -m bench.scale.probe SPEC`: a farm of tasks of known length, timed.

The tasks sleep, so that more ranks than cores do not disturb each other; what they return is as
large as the rows of a block, and is written where the specification says so. Prints `Timing`.
"""

import time
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from bench.scale.launch import answer
from gen import database
from gen.arrays import Columns
from gen.generation.delivery import Block
from gen.runtime import farm
from gen.scene import Scene
from gen.schema import Status, columns_for


@dataclass(frozen=True)
class Spec:
    """What a probe does.

    Attributes
    ----------
    blocks : (start, stop) of each task's rows, in the order in which they are handed out
    seconds : how long each task takes [s]
    output : database to write, "" for none
    repeats : how often all is done
    """

    blocks: Sequence[Block]
    seconds: Sequence[float]
    output: str = ""
    repeats: int = 1


@dataclass(frozen=True)
class Timing:
    """What a probe took.

    Attributes
    ----------
    wall : from the first task handed out to the last one written [s]
    master : processor time of the master meanwhile [s]
    gap : median time of a worker between the end of a task and the start of its next [s]
    """

    wall: float
    master: float
    gap: float


def scene_of(rows: int) -> Scene:
    """A scene without fields; its grid does not matter, since nothing is computed."""
    return Scene.parse(f"samples = {rows}\n[surface]\nnodes = 9\n", "the probe's scene")


def empty_rows(scene: Scene, count: int) -> Columns:
    """Rows in which nothing stands but that they are done."""
    rows = {
        column.name: np.full(column.shape(count, scene.surface.nodes), column.fill, column.dtype)
        for column in columns_for(scene)
    }
    rows["status"][:] = Status.DONE
    return rows


def probe(spec: Spec, world: farm.World) -> list[Timing]:
    """Do the tasks; every process of the world has to call it, the master's times count."""
    scene = scene_of(max(stop for _, stop in spec.blocks))
    times: list[tuple[int, float, float]] = []
    with ExitStack() as stack:
        writer: database.Writer | None = None
        if world.is_master and spec.output:
            database.create(Path(spec.output), scene)
            writer = stack.enter_context(database.Writer(Path(spec.output), scene))

        def take(task: tuple[Block, float], result: tuple[int, float, float, Columns]) -> None:
            times.append(result[:3])
            if writer is not None:
                writer.write_block(*task[0], result[3])

        timings = []
        for _ in range(spec.repeats):
            times.clear()
            tasks = list(zip(spec.blocks, spec.seconds, strict=True))
            world.broadcast(None)  # all are there: start-up is not what is measured
            began, busy = time.perf_counter(), time.process_time()
            farm.run(partial(_sleep, scene, world.rank), iter(tasks), take, world)
            wall, master = time.perf_counter() - began, time.process_time() - busy
            timings.append(Timing(wall, master, _median_gap(times)))
    return timings


def _sleep(scene: Scene, rank: int, task: tuple[Block, float]) -> tuple[int, float, float, Columns]:
    """Take as long as the task says; say who it was, and when."""
    (start, stop), seconds = task
    began = time.perf_counter()
    if seconds:
        time.sleep(seconds)
    rows = empty_rows(scene, stop - start)
    return rank, began, time.perf_counter(), rows


def _median_gap(times: list[tuple[int, float, float]]) -> float:
    """Median time between two tasks of one worker; clocks of one machine are comparable."""
    last: dict[int, float] = {}
    gaps = []
    for rank, began, ended in sorted(times, key=lambda entry: entry[1]):
        if rank in last:
            gaps.append(began - last[rank])
        last[rank] = ended
    return float(np.median(gaps)) if gaps else 0.0


def main(arguments: dict[str, Any], world: farm.World) -> list[dict[str, float]]:
    """Do what the arguments specify."""
    arguments["blocks"] = [tuple(block) for block in arguments["blocks"]]
    return [asdict(timing) for timing in probe(Spec(**arguments), world)]


if __name__ == "__main__":
    answer(main)
