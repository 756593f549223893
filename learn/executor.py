"""Tasks of a job in other processes: on the workers of an MPI run, or until a time.

The contract of `Executor` is that of mpi4py.futures and schwimmbad. The code of a job is written as
if there were one process: it hands tasks to an executor and receives their results on the master.
The workers run none of it; they serve tasks until the job has ended. On one process the executor
does the tasks itself.

Libraries cannot be asked to end a fit: compiled code runs to its end. A process that computes
therefore starts a second one as soon as a task has a time limit, keeps it for further tasks, and
kills it if one takes longer (`within`). It needs no MPI. It ends with the process that started it,
whatever ends that one.
"""

import atexit
import math
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from multiprocessing.connection import Connection, Pipe
from typing import Any, TypeVar

import typer

from gen.runtime import farm
from gen.runtime.errors import InputError
from gen.runtime.farm import Interruption

Shared = TypeVar("Shared")
Task = TypeVar("Task")
Result = TypeVar("Result")

ALONE = farm.World()
"""The world of a process that works without MPI."""


@dataclass(eq=False)
class Executor:
    """The workers of a job, as the code on its master sees them.

    The world is this process alone if left out. The workers among its processes have to be in
    `led`.
    """

    world: farm.World = ALONE
    _held: object = None

    @property
    def workers(self) -> int:
        """Number of processes that compute."""
        return self.world.workers

    def run(
        self,
        work: Callable[[Shared, Task], Result],
        shared: Shared,
        tasks: Iterable[Task],
        on_result: Callable[[Task, Result], None],
        *,
        stopping: Callable[[], bool] = lambda: False,
    ) -> None:
        """Do tasks on the workers and pass on each result, with its task, as it comes.

        `work` is a function, at the top of a module, of the shared data and of one task; the
        workers keep data that were the last to be shared. Tasks are drawn as workers become free,
        until `stopping`, which is asked before each, returns True; tasks under way are finished.
        InputError that `work` raises on any process, or `on_result` here, is raised here.
        """
        fresh = shared is not self._held
        self.world.broadcast((work, fresh, shared if fresh else None))
        self._held = shared
        farm.run(partial(work, shared), iter(tasks), on_result, self.world, stopping=stopping)

    def call(self, work: Callable[[Shared, Task], Result], shared: Shared, task: Task) -> Result:
        """Do one task while all other workers wait, and return its result; see `run`."""
        results: list[Result] = []
        self.run(work, shared, [task], lambda _, result: results.append(result))
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
            work, fresh, sent = announced
            shared = sent if fresh else shared
            farm.run(partial(work, shared), iter(()), lambda *_: None, world)
    raise typer.Exit


UNITS = {"s": 1.0, "min": 60.0, "m": 60.0, "h": 3600.0, "d": 86400.0}
"""Seconds of the units in which a time may be given."""

LONGEST = 1e10
"""Longest time that may be given, three centuries [s]."""


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
        raise InputError(f"--budget {text!r}: give a time above zero, as 90s, 30min, 2h or 1.5d")
    return value


def within(
    work: Callable[[Shared, Task], Result],
    shared: Shared,
    task: Task,
    until: float,
    longest: float = math.inf,
) -> Result | None:
    """Do a task, a function of shared data and of the task at the top of a module, until a time.

    Shared data are sent to the process only if they are not those of the task before. The work is
    stopped at `until`, a time of `time.time`, or after `longest`, which does not count the start of
    the process [s]; the result is None then. With an infinite `until` it is done here. InputError
    is raised if `work` raises it, or its process ends by itself.
    """
    if math.isinf(until):
        return work(shared, task)
    if until <= time.time():
        return None
    if not _helpers:
        _helpers.append(_Helper(work.__module__))
    result: Result | None = _helpers[-1].call(work, shared, task, until, longest)
    return result


class _Helper:
    """The second process, as the first one sees it."""

    def __init__(self, module: str) -> None:
        self._connection, theirs = Pipe()
        number = theirs.fileno()
        code = f"import {module}\nfrom {__name__} import serve\nserve({number})"
        self._process = subprocess.Popen(
            [sys.executable, "-c", code],
            pass_fds=[number],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            start_new_session=True,  # Ctrl-C is for the first process, which lets the task end
            env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        )
        theirs.close()
        self._held: object = None
        self._ready = False

    def call(
        self, work: Callable[..., Any], shared: object, task: object, until: float, longest: float
    ) -> Any:
        """Send a task once the process has started; return its result, None if time is over."""
        if not self._ready:
            if not self._connection.poll(max(until - time.time(), 0.0)):
                return None
            self._ready = bool(self._connection.recv())
        until, fresh = min(until, time.time() + longest), shared is not self._held
        self._held, result, fault = shared, None, None
        try:
            self._connection.send((work, fresh, shared if fresh else None, task))
            if not self._connection.poll(max(until - time.time(), 0.0)):
                self.end()
                return None
            result, fault = self._connection.recv()
        except (EOFError, OSError):
            self.end()
            fault = InputError(
                f"the process of a fit has ended by itself (code {self._process.returncode}):"
                " perhaps too little memory is free: give fewer workers, or --train-rows"
            )
        if fault is not None:
            raise fault
        return result

    def end(self) -> None:
        """Kill the process, in the midst of a task too; another one does the next task."""
        _helpers.remove(self)
        self._process.kill()
        self._process.wait()
        self._connection.close()


_helpers: list[_Helper] = []
"""The second process, if there is one."""


@atexit.register
def _end_helpers() -> None:
    for helper in [*_helpers]:
        helper.end()


def serve(descriptor: int) -> None:
    """Do the tasks that arrive on a connection's descriptor until the first process closes it."""
    threading.Thread(target=_end_with, args=(os.getppid(),), daemon=True).start()
    connection: Connection[Any, Any] = Connection(descriptor)
    held: object = None
    connection.send("ready")
    while True:
        try:
            work, fresh, shared, task = connection.recv()
        except EOFError:
            return
        held = shared if fresh else held
        answer: tuple[Any, InputError | None]
        try:
            answer = work(held, task), None
        except InputError as error:
            answer = None, error
        connection.send(answer)


def _end_with(parent: int) -> None:
    """End this process, in the midst of a fit too, once the one that started it is gone."""
    while os.getppid() == parent:
        time.sleep(1.0)
    os._exit(1)
