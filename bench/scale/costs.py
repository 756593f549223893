"""What the simulation is fed with: costs of rows, messages, scheduling and writing, measured here.

All are processor times, so that they bear the presence of other users alike; the smallest of many
short measurements counts. Writing is to a local disk, through the kernel's cache.
"""

import json
import resource
import tempfile
import time
import tracemalloc
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from bench.scale.launch import launch
from bench.scale.probe import empty_rows, scene_of
from gen import database
from gen.generation.sample import compute_rows
from gen.runtime import farm
from gen.runtime.errors import InputError
from gen.runtime.input_file import require_file
from gen.scene import Scene, load

NODES = {129: 192, 1025: 12}
"""Grids of which rows are measured, and how many: k = 7 and k = 10."""

BLOCK_ROWS = (1, 64, 512)
"""Rows of the blocks of which messages and writes are measured."""

CROWDS = (10, 100, 1000, 10_000)
"""Numbers of workers for which the master's bookkeeping is measured."""

MESSAGES, WRITES, REPEATS = 60, 60, 9


@dataclass(frozen=True)
class Line:
    """A cost that grows linearly: seconds = fixed + each * number."""

    fixed: float
    each: float

    def __call__(self, number: float) -> float:
        """Cost of a number of them [s]."""
        return self.fixed + self.each * number


@dataclass(frozen=True)
class Costs:
    """Inputs of the simulation.

    Attributes
    ----------
    rows : by nodes a side, processor time of single rows of the paper's scene [s]
    message : master's time to receive a block of some rows and to send the next [s]
    write : master's time to write a block of some rows, flushes included [s]
    bookkeeping : master's time for one block in the farm with some workers, apart from messages [s]
    gap : a worker's time between two tasks of one row when the master has nothing else to do [s]
    memory : resident size of a process that has imported what a master needs [bytes]
    task_memory : what a task in flight takes on the master [bytes]
    """

    rows: dict[int, tuple[float, ...]]
    message: Line
    write: Line
    bookkeeping: Line
    gap: float
    memory: int
    task_memory: int


def measure(remark: Callable[[str], None] = lambda line: None) -> Costs:
    """Measure all inputs on this machine, in a minute or two.

    Parameters
    ----------
    remark : told what is being measured
    """
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024  # before there are fields
    remark("rows of 129 x 129 and 1025 x 1025 nodes")
    rows = {nodes: _row_seconds(nodes, count) for nodes, count in NODES.items()}
    remark("writing")
    write = _fitted({count: measure_write(count) for count in BLOCK_ROWS})
    remark("bookkeeping of the master")
    bookkeeping = _fitted({crowd: bookkeeping_seconds(crowd) for crowd in CROWDS})
    remark("messages under mpiexec")
    own = bookkeeping(2)
    message = _fitted({count: _message_seconds(count) - own for count in BLOCK_ROWS})
    gap = min(timing["gap"] for timing in _probed(workers=1, rows=1))
    return Costs(rows, message, write, bookkeeping, gap, memory, _task_memory())


def read_costs(path: Path) -> Costs:
    """Read the costs that a report keeps; raises InputError for anything else."""
    require_file(path)
    try:
        content: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        rows = {int(nodes): tuple(seconds) for nodes, seconds in content.pop("rows").items()}
        for name in ("message", "write", "bookkeeping"):
            content[name] = Line(**content[name])
        return Costs(rows=rows, **content)
    except (OSError, ValueError, TypeError, KeyError, AttributeError) as error:
        raise InputError(f"{path}: no measured costs: {error}") from None


def scene_with(nodes: int) -> Scene:
    """The paper's scene on another grid."""
    paper = load("paper")
    surface = paper.surface.model_copy(update={"nodes": nodes})
    return paper.model_copy(update={"surface": surface})


def measure_write(count: int) -> float:
    """Processor time to write a block of some rows, flushes included [s]."""
    scene = scene_of(count * WRITES)
    rows = empty_rows(scene, count)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "written.h5"
        database.create(path, scene)
        with database.Writer(path, scene) as writer:
            return _least(
                partial(writer.write_block, start, start + count, rows)
                for start in range(0, count * WRITES, count)
            )


def bookkeeping_seconds(workers: int) -> float:
    """Time of the farm's own loop for one block, with an executor that needs none [s].

    Parameters
    ----------
    workers : how many the farm believes to have
    """
    in_flight = farm.IN_FLIGHT * workers
    blocks = max(30, min(400, 40_000 // workers))
    rounds = [_bookkeeping_round(in_flight, blocks, workers) for _ in range(3)]
    return min(rounds)


def _bookkeeping_round(in_flight: int, blocks: int, workers: int) -> float:
    arrivals: list[float] = []

    def take(task: int, result: None) -> None:
        arrivals.append(time.process_time())

    tasks = in_flight + blocks
    farm._supervise(
        _Instant(in_flight, tasks),
        _nothing,
        iter(range(tasks)),
        take,
        farm.World(0, workers + 1),
        lambda: False,
    )
    # While all places are taken one result comes for each task handed out: time apart is the cost.
    return float(np.median(np.diff(arrivals[:blocks])))


class _Instant:
    """An executor whose oldest task is done as soon as all places are taken."""

    def __init__(self, places: int, tasks: int) -> None:
        self._places, self._tasks = places, tasks
        self._waiting: deque[Future[None]] = deque()

    def submit(self, work: Callable[[Any], None], task: int) -> "Future[None]":
        future: Future[None] = Future()
        self._waiting.append(future)
        if len(self._waiting) == self._places:
            self._waiting.popleft().set_result(None)
        if task == self._tasks - 1:  # nothing more comes to set one off
            for left in self._waiting:
                left.set_result(None)
        return future


def _task_memory(tasks: int = 1000) -> int:
    """Memory that a task in flight takes: its future, its range of rows, their places [bytes]."""
    tracemalloc.start()
    kept = {Future[None](): (number, number + 64) for number in range(10**6, 10**6 + tasks)}
    size, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return size // len(kept)


def _nothing(task: Any) -> None:
    """Do nothing."""


def _row_seconds(nodes: int, count: int) -> tuple[float, ...]:
    """Processor time of rows of the paper's scene [s]; a first one makes plans and tables."""
    scene = scene_with(nodes)
    compute_rows(scene, 0, 1)
    seconds = []
    for row in range(count):
        began = time.process_time()
        compute_rows(scene, row, row + 1)
        seconds.append(time.process_time() - began)
    return tuple(seconds)


def _least(calls: Iterator[Callable[[], None]]) -> float:
    """Tenth percentile of the processor time of calls [s]: the least disturbed."""
    seconds = []
    for call in calls:
        began = time.process_time()
        call()
        seconds.append(time.process_time() - began)
    return float(np.quantile(seconds, 0.1))


def _message_seconds(rows: int) -> float:
    """Master's processor time for one block that nobody computes or writes [s]."""
    return min(timing["master"] for timing in _probed(workers=2, rows=rows)) / MESSAGES


def _probed(workers: int, rows: int) -> list[dict[str, float]]:
    blocks = [(number * rows, (number + 1) * rows) for number in range(MESSAGES)]
    arguments = {"blocks": blocks, "seconds": [0.0] * MESSAGES, "repeats": REPEATS}
    with tempfile.TemporaryDirectory() as folder:
        timings: list[dict[str, float]] = launch(
            workers + 1, "bench.scale.probe", arguments, Path(folder)
        )
    return timings


def _fitted(seconds: dict[int, float]) -> Line:
    """The line through measured costs, with equal relative errors and no negative part."""
    from scipy.optimize import nnls

    numbers, values = np.array(list(seconds), dtype=float), np.array(list(seconds.values()))
    values = np.maximum(values, 1e-9)
    (fixed, each), _ = nnls(np.column_stack([1 / values, numbers / values]), np.ones(len(values)))
    return Line(float(fixed), float(each))
