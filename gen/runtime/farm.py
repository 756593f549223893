"""One master and its workers: serially or over MPI behind one contract; the home of mpi4py.

The work is a pure function of its task, the tasks come from an iterator that is drawn from only
as fast as they are worked off, and results reach the master one by one in the order in which they
are finished: the master holds a few tasks per worker, however long the plan is.
"""

import os
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextvars import ContextVar
from dataclasses import dataclass
from queue import SimpleQueue
from typing import Any, NoReturn, TypeVar

from gen.runtime.errors import InputError

Task = TypeVar("Task")
Result = TypeVar("Result")

IN_FLIGHT = 2
"""Tasks handed out per worker: one at work, one waiting, so that no worker waits for the master."""

LAUNCHERS = ("PMI_SIZE", "PMIX_RANK", "OMPI_COMM_WORLD_SIZE", "MPI_LOCALNRANKS")
"""Variables that mpiexec, mpirun and srun set for the processes that they start."""

LONGEST_NAP = 0.01
"""Time at most between two looks of a process that waits for the master [s]: MPI itself would keep
a core busy, for as long as the master works alone."""

_own_work: ContextVar[Callable[[Any], Any]] = ContextVar("_own_work")
"""What this process does with a task, while it is in `run`."""


class MasterLeft(SystemExit):
    """Raised on a worker that waits for a master which has ended the command: the worker ends too.

    Attributes
    ----------
    code : exit code of the master
    """

    code: int


@dataclass(frozen=True)
class World:
    """The processes of this run.

    What the master has for all processes travels in envelopes: either a value (`broadcast`) or the
    exit code with which the master ends the command (`end`). A master that refuses its input
    therefore always meets the workers, wherever they wait.

    Attributes
    ----------
    rank : of this process; 0 is the master
    size : number of processes; 1 works without MPI
    """

    rank: int = 0
    size: int = 1
    communicator: Any = None

    @property
    def is_master(self) -> bool:
        """Whether this process hands out the work and writes the results."""
        return self.rank == 0

    @property
    def workers(self) -> int:
        """Number of processes that compute."""
        return max(self.size - 1, 1)

    def broadcast(self, value: Any) -> Any:
        """Give the master's value to every process; all of them have to call it.

        Raises
        ------
        MasterLeft
            On the workers, if the master has ended the command instead.
        """
        value, code = self._exchange((value, None))
        if code is not None:
            raise MasterLeft(code)
        return value

    def end(self, code: int) -> int:
        """End the command: the last that every process calls, unless it has raised `MasterLeft`.

        Parameters
        ----------
        code : exit code of this process's own command; only the master's counts

        Returns
        -------
        The master's exit code

        Raises
        ------
        RuntimeError
            On a worker whose command has ended although the master goes on with it.
        """
        _, agreed = self._exchange((None, code))
        if agreed is None:
            raise RuntimeError(f"rank {self.rank} has left a command that rank 0 goes on with")
        return int(agreed)

    def _exchange(self, envelope: tuple[Any, int | None]) -> tuple[Any, int | None]:
        """Return the master's envelope on every process; those that wait for it sleep."""
        if self.communicator is None:
            return envelope
        announced = self.communicator.Ibcast(bytearray(1), root=0)
        nap = LONGEST_NAP / 1024
        while not announced.Test():
            time.sleep(nap)
            nap = min(2 * nap, LONGEST_NAP)
        found: tuple[Any, int | None] = self.communicator.bcast(envelope, root=0)
        return found

    def abort(self) -> NoReturn:
        """End all processes at once after a bug, with its traceback."""
        traceback.print_exc()
        sys.stderr.flush()
        if self.communicator is not None:
            self.communicator.Abort(1)
        sys.exit(1)


def this_world() -> World:
    """Join the other processes if an MPI launcher started this one; import no MPI otherwise.

    Raises
    ------
    InputError
        If a launcher started it but mpi4py is not installed or of another MPI.
    """
    launched = any(name in os.environ for name in LAUNCHERS)
    if not launched and "mpi4py" not in sys.modules:
        return World()
    _check_launcher()
    try:
        from mpi4py import MPI
    except (ImportError, RuntimeError) as error:
        reason = str(error).partition("\n")[0]
        raise InputError(
            f"started by an MPI launcher, but mpi4py does not load ({reason}): install the extra"
            " 'mpi' for the MPI of this machine, or 'mpich' to bring one along"
        ) from None
    communicator = MPI.COMM_WORLD
    if communicator.size == 1:
        return World()
    return World(communicator.rank, communicator.size, communicator)


def _check_launcher() -> None:
    """Refuse variables of a launcher that is not there: MPI would end this process from inside.

    Raises
    ------
    InputError
        With the variable to take out of the environment.
    """
    size, descriptor = (os.environ.get(name) for name in ("PMI_SIZE", "PMI_FD"))
    fault = ""
    if size is not None and not size.isdecimal():
        fault = "PMI_SIZE"
    elif descriptor is not None and not _is_open(descriptor):
        fault = "PMI_FD"
    elif "PMIX_RANK" in os.environ and "PMIX_NAMESPACE" not in os.environ:
        fault = "PMIX_RANK"
    if fault:
        raise InputError(
            f"{fault} = {os.environ[fault]!r} in the environment is not from an MPI launcher that"
            f" has started this process; to run alone: unset {fault}"
        )


def _is_open(descriptor: str) -> bool:
    """Whether a text is the number of an open file."""
    try:
        os.fstat(int(descriptor))
    except (OSError, ValueError, OverflowError):
        return False
    return True


def leave() -> None:
    """Finalise MPI if this process has joined it: the last thing before its exit code.

    `python -m mpi4py` aborts all ranks for a code other than 0 unless MPI is finalised by then,
    and the launcher would report the abort instead of the code.
    """
    if "mpi4py.MPI" in sys.modules:
        from mpi4py import MPI

        if MPI.Is_initialized() and not MPI.Is_finalized():
            MPI.Finalize()


def run(
    work: Callable[[Task], Result],
    tasks: Iterator[Task],
    on_result: Callable[[Task, Result], None],
    world: World,
    *,
    stopping: Callable[[], bool] = lambda: False,
) -> None:
    """Do all tasks; every process of the world has to call it, with its own copy of the work.

    Parameters
    ----------
    work : what this process does with a task if it is a worker; it stays here and may hold what
        cannot be sent, an open file say, while tasks and results are picklable
    tasks : drawn from on the master only, as workers become free
    on_result : called on the master with each task and its result, in the order of completion
    world : from `this_world`
    stopping : asked on the master before a task is handed out; once true no more are, and the
        ones in flight are finished

    Raises
    ------
    Exception
        What `on_result` or `tasks` raise, on the master, after the tasks in flight have ended; so
        does an InputError of `work`. What else `work` raises is a bug: it ends all processes.
    MasterLeft
        On the workers, if the master has ended the command instead of calling this.
    """
    if world.size == 1:
        for task in tasks:
            if stopping():
                return
            on_result(task, work(task))
        return
    from mpi4py.futures import MPICommExecutor

    world.broadcast(None)  # a master that never comes is heard of here, not inside the executor
    own = _own_work.set(work)
    try:
        with MPICommExecutor(world.communicator, root=0) as executor:
            if executor is not None:
                try:
                    _supervise(executor, _do, tasks, on_result, world, stopping)
                except KeyboardInterrupt:  # the user does not want to wait for what is in flight
                    world.communicator.Abort(130)
    finally:
        _own_work.reset(own)


def _do(task: Any) -> Any:
    """Do a task with the work of the process that this is called on; only its name is sent."""
    return _own_work.get()(task)


def _supervise(
    executor: Any,
    work: Callable[[Task], Result],
    tasks: Iterator[Task],
    on_result: Callable[[Task, Result], None],
    world: World,
    stopping: Callable[[], bool],
) -> None:
    """Keep every worker busy until the tasks run out, at a cost that no number of them raises."""
    in_flight: dict[Future[Result], Task] = {}
    finished: SimpleQueue[Future[Result]] = SimpleQueue()
    drained = False
    while in_flight or not drained:
        while not drained and len(in_flight) < IN_FLIGHT * world.workers:
            task = None if stopping() else next(tasks, None)
            drained = task is None
            if task is not None:
                future = executor.submit(work, task)
                in_flight[future] = task
                future.add_done_callback(finished.put)
        if in_flight:
            future = finished.get()
            error = future.exception()
            if isinstance(error, InputError):  # memory that has run out, say: no bug
                raise error
            if error is not None:
                _abort_with(future, world)
            on_result(in_flight.pop(future), future.result())


def _abort_with(future: "Future[Any]", world: World) -> NoReturn:
    """A worker's bug: show it as if it had been raised here, and end every process."""
    try:
        future.result()
    except Exception:
        world.abort()
    raise AssertionError("a future with an exception did not raise it")
