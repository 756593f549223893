"""Time limits: how users give them, and work that is stopped at its time.

Libraries cannot be asked to end a fit: compiled code runs to its end. Each process that computes
therefore starts a second one as soon as a task has a time limit, keeps it for further tasks, and
kills it if one takes longer. It needs no MPI. It ends with the process that started it, whatever
ends that one.
"""

import atexit
import math
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from multiprocessing.connection import Connection, Pipe
from typing import Any, TypeVar

from gen.runtime.errors import InputError

Shared = TypeVar("Shared")
Task = TypeVar("Task")
Result = TypeVar("Result")

UNITS = {"s": 1.0, "min": 60.0, "m": 60.0, "h": 3600.0, "d": 86400.0}
"""Seconds of the units in which a time may be given."""

LONGEST = 36500 * UNITS["d"]
"""Longest time that may be given, a century [s]."""


def seconds(text: str) -> float:
    """Read a time such as 90s, 30min, 2h or 1.5d [s].

    InputError is raised if the text is not a time, or the time is not above zero.
    """
    number = text.rstrip("abcdefghijklmnopqrstuvwxyz").strip()
    unit = text[len(number) :].strip() or "s"
    try:
        value = float(number) * UNITS[unit]
    except (ValueError, KeyError):
        value = 0.0
    if not 0 < value <= LONGEST:
        raise InputError(
            f"--budget {text!r}: give a time above zero, as 90s, 30min, 2h or 1.5d, and at most"
            f" {LONGEST / UNITS['d']:g}d"
        )
    return value


def call(
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
    helper = _helpers[-1]
    if not helper.is_ready(until):
        return None
    result: Result | None = helper.call(work, shared, task, min(until, time.time() + longest))
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

    def is_ready(self, until: float) -> bool:
        """Wait for the process to have started, until a time; tell whether it has."""
        if not self._ready and self._connection.poll(max(until - time.time(), 0.0)):
            self._connection.recv()
            self._ready = True
        return self._ready

    def call(self, work: Callable[..., Any], shared: object, task: object, until: float) -> Any:
        """Send a task, and return its result, None if its time is over before."""
        fresh = shared is not self._held
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
