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
    """Outcome of a task, instead of its result, that was stopped at its time or not begun."""

    seconds: float = 0.0  # time that the task had run, 0 if it was not begun [s]


@dataclass(eq=False)
class Executor:
    """The workers of a job, as the code on its master sees them.

    All other processes of the world have to be in `led`, where they serve tasks.
    """

    world: farm.World = field(default_factory=farm.World)  # by default this process alone
    _shared: object = None  # data that the workers keep

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
        """Do tasks on the workers, and hand over the results as they arrive.

        Parameters
        ----------
        work : callable
            Function of the shared data and of one task, which returns a result. It has to be at the
            top of a module, because processes exchange it by its name.
        shared : object
            Data that all tasks need. The workers keep them until other data are shared: they are
            sent again only if this is another object.
        tasks : iterable
            Tasks, which are drawn as workers become free.
        on_result : callable
            Called on the master with each task and its result, in the order of arrival. The result
            is `Ended` if the task was stopped at `until`.
        stopping : callable
            Called before a task is drawn. Once it returns True no further task is begun, and those
            under way are finished.
        until : float
            Time of `time.time` at which all tasks are stopped [s]; see `within`.

        Raises
        ------
        InputError
            If `work` raises it on any process, or `on_result` does.
        """
        is_new = shared is not self._shared
        sent = shared if is_new else None
        self.world.broadcast(_Round(work, until, is_new, sent))
        self._shared = shared
        do = partial(within, work, shared, until=until)
        farm.run(do, iter(tasks), on_result, self.world, stopping=stopping)

    def call(
        self,
        work: Callable[[Shared, Task], Result],
        shared: Shared,
        task: Task,
        until: float = math.inf,
    ) -> Any:
        """Do one task while all other workers wait.

        Parameters
        ----------
        work : callable
            Function of the shared data and of the task, at the top of a module.
        shared : object
            Data that the task needs.
        task : object
            The task.
        until : float
            Time of `time.time` at which the task is stopped [s].

        Returns
        -------
        object
            Result of the task; `Ended` if it was stopped.

        Raises
        ------
        InputError
            If `work` raises it.
        """
        results: list[Any] = []

        def keep(_: Task, result: Any) -> None:
            results.append(result)

        self.run(work, shared, [task], keep, until=until)
        return results[0]


@dataclass(frozen=True)
class _Round:
    """Message of the master to all workers before the tasks of one `Executor.run`."""

    work: Callable[[Any, Any], Any]
    until: float  # time of `time.time` at which the tasks are stopped [s]
    has_shared: bool  # whether new data are shared
    shared: object  # None for the data of the round before


@contextmanager
def led() -> Iterator[Executor]:
    """Give the master the executor of its job, and let all other processes serve its tasks.

    Every process of the run has to enter this context, which is collective. Workers do not reach
    its body: they serve tasks until the master leaves it, and then end their command by typer's
    `Exit`.

    Yields
    ------
    Executor
        The workers of the run; on the master only.

    Raises
    ------
    MasterLeft
        On the workers, if the job raises an exception on the master.
    """
    world = farm.this_world()
    if world.is_master:
        yield Executor(world)
        world.broadcast(None)
        return
    _serve(world)
    raise typer.Exit


def _serve(world: farm.World) -> None:
    """Do tasks of the master on a worker, until the master broadcasts None."""
    shared: Any = None  # kept from round to round
    with Interruption(listening=False):
        while True:
            message = world.broadcast(None)
            if message is None:
                return
            if message.has_shared:
                shared = message.shared
            do = partial(within, message.work, shared, until=message.until)
            farm.run(do, iter(()), lambda *_: None, world)


UNITS = {"s": 1.0, "min": 60.0, "m": 60.0, "h": 3600.0, "d": 86400.0}
"""Units of the times that a user gives [s]."""

LONGEST = 1e10  # longest time that a user may give, three centuries [s]


def seconds(text: str) -> float:
    """Read a time.

    Parameters
    ----------
    text : str
        Value of the option `--budget`, such as "90s", "30min", "2h" or "1.5d"; seconds without a
        unit.

    Returns
    -------
    float
        The time [s].

    Raises
    ------
    InputError
        If the text is not a time, or the time is not above zero.
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
    """Write a time as `seconds` reads it.

    Parameters
    ----------
    time_needed : float
        The time [s].

    Returns
    -------
    str
        The time rounded up, such as "90s", "12min" or "2.5h".
    """
    if time_needed <= 120:
        return f"{max(math.ceil(time_needed), 1)}s"
    if time_needed <= 120 * 60:
        return f"{math.ceil(time_needed / 60)}min"
    return f"{math.ceil(time_needed / 360) / 10:g}h"


def within(
    work: Callable[[Shared, Task], Result], shared: Shared, task: Task, until: float
) -> Result | Ended:
    """Do a task until a time.

    With a finite time the task is done in a second process, which is kept for further tasks and
    killed at the time. With an infinite one it is done in this process.

    Parameters
    ----------
    work : callable
        Function of the shared data and of the task, at the top of a module.
    shared : object
        Data that the task needs.
    task : object
        The task.
    until : float
        Time of `time.time` at which the task is stopped [s].

    Returns
    -------
    object
        Result of the task; `Ended` if it was stopped, or not begun because the time was over.

    Raises
    ------
    InputError
        If `work` raises it, or the second process ends by itself.
    """
    if math.isinf(until):
        return work(shared, task)
    began = time.time()
    if until <= began:
        return Ended()
    from joblib.externals.loky import get_reusable_executor

    process = get_reusable_executor(
        1, timeout=None, initializer=_begin, initargs=(os.getpid(),)
    )
    try:
        with (
            farm.signals_blocked()
        ):  # Ctrl-C is for this process, which lets the task end
            future: Future[Result] = process.submit(work, shared, task)
        return future.result(until - time.time())
    except TimeoutError:
        process.shutdown(kill_workers=True)
        return Ended(time.time() - began)
    except BrokenProcessPool:
        raise InputError(
            "the process of a fit has ended by itself: perhaps too little memory is free: give"
            " fewer workers, or --train-rows"
        ) from None


def _begin(parent: int) -> None:
    """Detach the second process from the terminal, and reserve the buffers of BLAS.

    A thread ends it, even in the midst of a fit, once its parent, a process number, is gone.
    """

    def end_with_parent() -> None:
        while os.getppid() == parent:
            time.sleep(1.0)
        os._exit(1)

    os.setsid()
    require_blas()
    for stream in (0, 1):
        os.dup2(os.open(os.devnull, os.O_RDWR), stream)
    threading.Thread(target=end_with_parent, daemon=True).start()
