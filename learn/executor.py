"""Tasks of a job in other processes: on the workers of an MPI run, or until a time.

The contract of `Executor` is that of mpi4py.futures and schwimmbad. The code of a job, on the
master, hands tasks to an executor and receives their results. The workers run none of it; they
serve tasks until the job has ended. On one process the executor does the tasks itself.

Libraries cannot be asked to end a fit: compiled code runs to its end. A process that computes
therefore starts a second one, by loky, as soon as a task has a time limit, keeps it for further
tasks, and kills it if one takes longer (`within`). It needs no MPI.
"""

import math
import os
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from typing import Any, TypeVar

import typer

from gen.runtime import farm
from gen.runtime.errors import InputError
from gen.runtime.farm import Interruption
from gen.runtime.memory import require_blas

Shared = TypeVar("Shared")
Task = TypeVar("Task")
Result = TypeVar("Result")


@dataclass(frozen=True)
class Ended:
    """What comes of a task that was stopped at its time, or not begun, instead of a result."""

    seconds: float = 0.0  # how long it had run


@dataclass(eq=False)
class Executor:
    """The workers of a job, as the code on its master sees them.

    The world is this process alone if left out. The workers among its processes have to be in
    `led`.
    """

    world: farm.World = field(default_factory=farm.World)
    _held: object = None

    def run(
        self,
        work: Callable[[Shared, Task], Result],
        shared: Shared,
        tasks: Iterable[Task],
        on_result: Callable[[Task, Any], None],
        *,
        stopping: Callable[[], bool] = lambda: False,
        until: float = math.inf,
    ) -> None:
        """Do tasks on the workers and pass on each result, with its task, as it comes.

        `work` is a function, at the top of a module, of the shared data and of one task; the
        workers keep data that were the last to be shared. Tasks are drawn as workers become free,
        until `stopping`, which is asked before each, returns True; tasks under way are finished, or
        have the result `Ended` at a time (`within`). InputError that `work` raises on any process,
        or `on_result` here, is raised here.
        """
        fresh = shared is not self._held
        self.world.broadcast((work, until, fresh, shared if fresh else None))
        self._held = shared
        do = partial(within, work, shared, until=until)
        farm.run(do, iter(tasks), on_result, self.world, stopping=stopping)

    def call(
        self,
        work: Callable[[Shared, Task], Result],
        shared: Shared,
        task: Task,
        until: float = math.inf,
    ) -> Any:
        """Do one task while all other workers wait, and return its result; see `run`."""
        results: list[Any] = []
        self.run(
            work, shared, [task], lambda _, result: results.append(result), until=until
        )
        return results[0]


@contextmanager
def led() -> Iterator[Executor]:
    """Give the master the executor of its job; every process has to come here.

    Workers serve the job's tasks and then end their command, by typer's `Exit`. If the job raises
    an exception on the master, `gen.runtime.farm.MasterLeft` is raised on the workers.
    """
    world = farm.this_world()
    if world.is_master:
        yield Executor(world)
        world.broadcast(None)
        return
    shared: Any = None  # the workers keep it from round to round
    with Interruption(listening=False):
        while (announced := world.broadcast(None)) is not None:
            work, until, fresh, sent = announced
            shared = sent if fresh else shared
            farm.run(
                partial(within, work, shared, until=until),
                iter(()),
                lambda *_: None,
                world,
            )
    raise typer.Exit


UNITS = {
    "s": 1.0,
    "min": 60.0,
    "m": 60.0,
    "h": 3600.0,
    "d": 86400.0,
}  # [s], of given times
LONGEST = 1e10  # longest time that may be given, three centuries [s]


def seconds(text: str) -> float:
    """Read a time such as 90s, 30min, 2h or 1.5d [s].

    InputError is raised if the text is not a time, or the time is not above zero.
    """
    number = text.rstrip("abcdefghijklmnopqrstuvwxyz")
    try:
        value = float(number) * UNITS[text[len(number) :] or "s"]
    except (ValueError, KeyError):
        value = 0.0
    if not 0 < value <= LONGEST:
        raise InputError(
            f"--budget {text!r}: give a time above zero, as 90s, 30min, 2h or 1.5d"
        )
    return value


def budget_of(time_needed: float) -> str:
    """Write a time [s] as `seconds` reads it, rounded up: "90s", "12min" or "2.5h"."""
    if time_needed <= 120:
        return f"{max(math.ceil(time_needed), 1)}s"
    if time_needed <= 120 * 60:
        return f"{math.ceil(time_needed / 60)}min"
    return f"{math.ceil(time_needed / 360) / 10:g}h"


def within(
    work: Callable[[Shared, Task], Result], shared: Shared, task: Task, until: float
) -> Result | Ended:
    """Do a task, a function of shared data and of the task at the top of a module, until a time.

    The work is stopped at `until`, a time of `time.time` [s]; the result is `Ended` then. With an
    infinite `until` it is done here. InputError is raised if `work` raises it, or its process ends
    by itself.
    """
    if math.isinf(until):
        return work(shared, task)
    began = time.time()
    if until <= began:
        return Ended()
    from joblib.externals.loky import get_reusable_executor

    own = {"initializer": _begin, "initargs": (os.getpid(),)}
    process = get_reusable_executor(1, timeout=None, **own)
    try:
        with (
            farm.signals_blocked()
        ):  # Ctrl-C is for this process, which lets the task end
            ended: Future[Result] = process.submit(work, shared, task)
        return ended.result(until - time.time())
    except TimeoutError:
        process.shutdown(kill_workers=True)
        return Ended(time.time() - began)
    except BrokenProcessPool:
        raise InputError(
            "the process of a fit has ended by itself: perhaps too little memory is free: give"
            " fewer workers, or --train-rows"
        ) from None


def _begin(parent: int) -> None:
    """Begin the second process, which the terminal's streams do not reach.

    Once the first one is gone this one ends too, in the midst of a fit.
    """

    def end() -> None:
        while os.getppid() == parent:
            time.sleep(1.0)
        os._exit(1)

    os.setsid()
    require_blas()
    for stream in (0, 1):
        os.dup2(os.open(os.devnull, os.O_RDWR), stream)
    threading.Thread(target=end, daemon=True).start()
