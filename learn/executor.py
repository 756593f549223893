"""Tasks of a job on the processes of an MPI run, and tasks with a time limit.

`Executor` works as the pools of mpi4py.futures and schwimmbad do. Only the master runs the code of
a job: it hands tasks to an executor, and receives their results. The workers serve tasks until the
job ends. In a run of one process, the executor does the tasks itself.

A fit cannot be interrupted, because compiled code runs to its end. A task with a time limit is
therefore done in a second process, which each process of the run starts by loky when it needs it
(`within`). The second process is kept for further tasks, and killed if a task takes too long. MPI
is not needed for this.
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
    """Outcome of a task that was stopped at its time limit, or not begun, instead of its result."""

    seconds: float = 0.0  # time from the beginning of the task; 0 if it was not begun [s]


@dataclass(eq=False)
class Executor:
    """The workers of a job, to which the code on the master gives tasks.

    All other processes of the world have to be in `led`, where they serve tasks.
    """

    world: farm.World = field(default_factory=farm.World)  # this process alone by default
    _shared: object = None  # shared data of the last tasks, which the workers keep

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
        """Do tasks on the workers, and pass on each result when it arrives.

        Parameters
        ----------
        work : callable
            Function of the shared data and of one task, which returns a result. It must be defined
            at the top of a module, because processes exchange it by its name.
        shared : object
            Data that all tasks need. The workers keep the object: the next call sends its `shared`
            only if that is a different object.
        tasks : iterable
            Tasks. The next one is taken when a worker is free.
        on_result : callable
            Function that the master calls with each task and its result, in order of arrival. The
            result is `Ended` if the task was stopped at `until`, or not begun before.
        stopping : callable
            Function that is called before a task is taken. Once it returns True, no further task is
            begun; the tasks that have begun are finished.
        until : float
            Time of `time.time` at which all tasks are stopped [s]; see `within`.

        Raises
        ------
        InputError
            If `work` raises it on any process, `on_result` raises it, or the second process of a
            task with a time limit ends unexpectedly.
        """
        is_new = shared is not self._shared
        sent = shared if is_new else None
        message = _Round(work=work, until=until, has_shared=is_new, shared=sent)
        self.world.broadcast(message)
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
        """Do one task, while all workers but one wait.

        Parameters
        ----------
        work : callable
            Function of the shared data and of the task, defined at the top of a module.
        shared : object
            Data that the task needs; see `run`.
        task : object
            The task.
        until : float
            Time of `time.time` at which the task is stopped [s].

        Returns
        -------
        object
            Result of the task; `Ended` if it was stopped, or not begun.

        Raises
        ------
        InputError
            If `work` raises it, or the second process of a task with a time limit ends
            unexpectedly.
        """
        results: list[Any] = []

        def keep(_: Task, result: Any) -> None:
            """Keep the only result."""
            results.append(result)

        self.run(work, shared, [task], keep, until=until)
        return results[0]


@dataclass(frozen=True)
class _Round:
    """Message of the master to all workers before the tasks of one call of `Executor.run`."""

    work: Callable[[Any, Any], Any]  # function of the shared data and of one task
    until: float  # time of `time.time` at which the tasks are stopped [s]
    has_shared: bool  # False if the tasks need the shared data of the round before
    shared: object  # new shared data; None if `has_shared` is False


@contextmanager
def led() -> Iterator[Executor]:
    """Give the master the executor of its job, and let all other processes serve its tasks.

    The context is collective: each process of the run has to enter it. Workers do not reach its
    body. They serve tasks until the master leaves the context, and then raise `typer.Exit`, which
    ends their command.

    Yields
    ------
    Executor
        The workers of the run, on the master only.

    Raises
    ------
    typer.Exit
        On the workers, at the end of the job.
    MasterLeft
        On the workers, if the job raises an exception on the master.
    """
    world = farm.this_world()
    if world.is_master:
        yield Executor(world)
        world.broadcast(None)  # tells the workers that the job has ended
        return
    _serve(world)
    raise typer.Exit


def _serve(world: farm.World) -> None:
    """Do tasks of the master on this worker, until the master broadcasts None."""
    shared: Any = None  # shared data of the latest round
    # Workers ignore signals: the master handles them.
    with Interruption(listening=False):
        while True:
            # On a worker this waits for the master's message and returns it; its argument is not
            # used.
            message = world.broadcast(None)
            if message is None:  # the end of the job
                return
            if message.has_shared:
                shared = message.shared
            do = partial(within, message.work, shared, until=message.until)
            # Tasks come from the master, and results go to it: a worker has none to give.
            farm.run(do, iter(()), lambda *_: None, world)


UNITS = {"s": 1.0, "min": 60.0, "m": 60.0, "h": 3600.0, "d": 86400.0}
"""Seconds of each unit in which a user may give a time."""

# Largest time that a user may give, about three centuries [s].
LONGEST = 1e10


def seconds(text: str) -> float:
    """Read a time from the text of a user.

    Parameters
    ----------
    text : str
        Value of the option `--budget`, such as "90s", "30min", "2h" or "1.5d". Without a unit it is
        in seconds.

    Returns
    -------
    float
        The time [s].

    Raises
    ------
    InputError
        If the text is no time, or the time is not above zero and at most `LONGEST`.
    """
    number = text.rstrip("abcdefghijklmnopqrstuvwxyz")
    unit = text[len(number) :] or "s"
    try:
        value = float(number) * UNITS[unit]
    except (ValueError, KeyError):
        value = 0.0  # which is refused
    if not 0 < value <= LONGEST:
        raise InputError(
            f"--budget {text!r}: give a time above zero, as 90s, 30min, 2h or 1.5d"
        )
    return value


def budget_of(time_needed: float) -> str:
    """Write a time as a text that `seconds` can read.

    Parameters
    ----------
    time_needed : float
        The time [s].

    Returns
    -------
    str
        The time, rounded up: up to two minutes in seconds, such as "90s", up to two hours in
        minutes, such as "12min", and longer ones in tenths of hours, such as "2.5h".
    """
    if time_needed <= 2 * UNITS["min"]:
        return f"{max(math.ceil(time_needed), 1)}s"
    if time_needed <= 2 * UNITS["h"]:
        return f"{math.ceil(time_needed / UNITS['min'])}min"
    tenths_of_hours = math.ceil(time_needed / (UNITS["h"] / 10))
    return f"{tenths_of_hours / 10:g}h"


def within(
    work: Callable[[Shared, Task], Result], shared: Shared, task: Task, until: float
) -> Result | Ended:
    """Do a task, and stop it at a given time.

    With a finite time the task is done in a second process. This is killed if the task has not
    ended by then, and kept for further tasks if it has. With an infinite time the task is done in
    this process, and nothing stops it.

    Parameters
    ----------
    work : callable
        Function of the shared data and of the task, defined at the top of a module.
    shared : object
        Data that the task needs.
    task : object
        The task.
    until : float
        Time of `time.time` at which the task is stopped [s]; infinite for no limit.

    Returns
    -------
    object
        Result of the task; `Ended` if it was stopped, or not begun because the time was over.

    Raises
    ------
    InputError
        If `work` raises it, or the second process ends unexpectedly. Other errors of `work` pass
        through.
    """
    if math.isinf(until):
        return work(shared, task)
    start = time.time()
    if until <= start:
        return Ended()
    from joblib.externals.loky import get_reusable_executor

    # loky returns the second process of an earlier task, or prepares a new one, which begins with
    # `_begin`. It ends when this process no longer exists; `timeout=None`: not for lack of tasks.
    process = get_reusable_executor(
        max_workers=1, timeout=None, initializer=_begin, initargs=(os.getpid(),)
    )
    try:
        # Signals are blocked while the second process starts, so that it ignores Ctrl-C. This
        # process handles the signal, and lets the task end.
        with farm.signals_blocked():
            future: Future[Result] = process.submit(work, shared, task)
        return future.result(until - time.time())
    except TimeoutError:
        process.shutdown(kill_workers=True)
        return Ended(seconds=time.time() - start)
    except BrokenProcessPool:
        raise InputError(
            "the process of a fit has ended by itself: perhaps too little memory is free: give"
            " fewer workers, or --train-rows"
        ) from None


def _begin(parent: int) -> None:
    """Prepare this process, which is the second process of the process with number `parent`.

    Detach it from the terminal, with nothing as standard input and output. Reserve the buffers of
    BLAS. Start a thread that ends the process, even during a fit, when its parent no longer exists.
    """

    def end_with_parent() -> None:
        """End this process within a second after its parent."""
        # A process whose parent has ended gets another parent.
        while os.getppid() == parent:
            time.sleep(1.0)
        os._exit(1)

    os.setsid()  # a session of its own, without a terminal
    require_blas()
    for stream in (0, 1):  # standard input and output
        os.dup2(os.open(os.devnull, os.O_RDWR), stream)
    threading.Thread(target=end_with_parent, daemon=True).start()
