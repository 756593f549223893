"""What the simulation is fed with: costs of rows, messages, scheduling and writing, measured here.

All are processor times, so that they bear the presence of other users alike; the smallest of many
short measurements counts. Writing is to a local disk, through the kernel's cache.
"""

import resource
import tempfile
import time
import tracemalloc
from collections import deque
from collections.abc import Callable, Iterable
from concurrent.futures import Future
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import TypeAdapter, ValidationError

from bench.report import remark
from bench.scale.launch import launch
from bench.scale.probe import empty_rows, scene_of
from gen import database
from gen.generation.sample import compute_rows
from gen.runtime import farm
from gen.runtime.errors import InputError
from gen.runtime.input_file import require_file
from gen.scene import Scene, load

NODES = {129: 192, 1025: 12}  # grids of which rows are measured, and how many: k = 7 and k = 10
BLOCK_ROWS = (1, 64, 512)  # rows of the blocks of which messages and writes are measured
# Numbers of workers for which the master's bookkeeping is measured.
CROWDS = (10, 100, 1000, 10_000)

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
    """Inputs of the simulation; times of the master are for one block [s]."""

    rows: dict[int, tuple[float, ...]]
    """By nodes a side, processor time of single rows of the paper's scene [s]."""
    message: Line  # to receive a block of some rows and to send the next
    write: Line  # to write a block of some rows, flushes included
    bookkeeping: Line  # in the farm with some workers, apart from messages
    gap: float  # of a worker between two tasks of one row when the master has nothing else to do
    memory: int  # resident size of a process that has imported what a master needs [bytes]
    task_memory: int  # what a task in flight takes on the master [bytes]


def measure() -> Costs:
    """Measure all inputs on this machine, in a minute or two."""
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024  # before there are fields
    remark("rows of 129 x 129 and 1025 x 1025 nodes")
    rows = {nodes: _row_seconds(nodes, count) for nodes, count in NODES.items()}
    remark("writing")
    write = _fitted({count: measure_write(count) for count in BLOCK_ROWS})
    remark("bookkeeping of the master")
    bookkeeping = _fitted({crowd: bookkeeping_seconds(crowd) for crowd in CROWDS})
    remark("messages under mpiexec")
    own = bookkeeping(2)
    message = _fitted(
        {
            count: min(timing["master"] for timing in _probed(2, count)) / MESSAGES - own
            for count in BLOCK_ROWS
        }
    )
    gap = min(timing["gap"] for timing in _probed(1, 1))
    return Costs(rows, message, write, bookkeeping, gap, memory, _task_memory())


def read_costs(path: Path) -> Costs:
    """Read the costs that a report keeps; raises InputError for anything else."""
    try:
        return TypeAdapter(Costs).validate_json(require_file(path).read_bytes())
    except OSError as error:
        raise InputError(f"{path}: no measured costs: {error}") from None
    except ValidationError as error:
        fault = error.errors()[0]
        key = ".".join(map(str, fault["loc"]))
        raise InputError(f"{path}: no measured costs: {key} {fault['msg']}") from None


def scene_with(nodes: int) -> Scene:
    """Return the paper's scene on another grid."""
    paper = load("paper")
    surface = paper.surface.model_copy(update={"nodes": nodes})
    return paper.model_copy(update={"surface": surface})


def measure_write(count: int) -> float:
    """Measure the processor time to write a block of some rows, flushes included [s]."""
    scene = scene_of(count * WRITES)
    rows = empty_rows(scene, count)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "written.h5"
        database.create(path, scene)
        with database.Writer(path, scene) as writer:
            starts = range(0, count * WRITES, count)
            writes = (partial(writer.write_block, each, each + count, rows) for each in starts)
            return float(np.quantile(_seconds(writes), 0.1))  # the least disturbed


def bookkeeping_seconds(workers: int) -> float:
    """Measure the farm's own loop for one block, with workers that need no time [s]."""
    in_flight, blocks = farm.IN_FLIGHT * workers, max(30, min(400, 40_000 // workers))
    tasks, world = in_flight + blocks, farm.World(0, workers + 1)
    rounds = []
    for _ in range(3):
        arrivals: list[float] = []

        def take(task: int, result: None, arrivals: list[float] = arrivals) -> None:
            arrivals.append(time.process_time())

        executor, numbers = _Instant(in_flight, tasks), iter(range(tasks))
        farm._supervise(executor, lambda task: None, numbers, take, world, lambda: False)
        # While all places are taken one result comes for each task handed out.
        rounds.append(float(np.median(np.diff(arrivals[:blocks]))))
    return min(rounds)


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
    """Measure what a task in flight takes: its future, its range of rows, their places [bytes]."""
    tracemalloc.start()
    kept = {Future[None](): (number, number + 64) for number in range(10**6, 10**6 + tasks)}
    size, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return size // len(kept)


def _row_seconds(nodes: int, count: int) -> tuple[float, ...]:
    """Measure the processor time of rows of the paper's scene [s]."""
    scene = scene_with(nodes)
    compute_rows(scene, 0, 1)  # makes plans and tables
    return tuple(_seconds(partial(compute_rows, scene, row, row + 1) for row in range(count)))


def _seconds(calls: Iterable[Callable[[], object]]) -> list[float]:
    """Return the processor times of calls [s]."""
    seconds = []
    for call in calls:
        began = time.process_time()
        call()
        seconds.append(time.process_time() - began)
    return seconds


def _probed(workers: int, rows: int) -> list[dict[str, float]]:
    """Send blocks of some rows to workers that do nothing, repeatedly."""
    tasks = [((number * rows, (number + 1) * rows), 0.0) for number in range(MESSAGES)]
    arguments = {"tasks": tasks, "repeats": REPEATS}
    with tempfile.TemporaryDirectory() as folder:
        timings: list[dict[str, float]] = launch(
            workers + 1, "bench.scale.probe", arguments, Path(folder)
        )
    return timings


def _fitted(seconds: dict[int, float]) -> Line:
    """Fit a line to measured costs, with equal relative errors and no negative part."""
    from scipy.optimize import nnls

    numbers, values = np.array(list(seconds), dtype=float), np.array(list(seconds.values()))
    values = np.maximum(values, 1e-9)
    (fixed, each), _ = nnls(np.column_stack([1 / values, numbers / values]), np.ones(len(values)))
    return Line(float(fixed), float(each))
