"""One master and its workers, serially or over MPI, and the signals and limits that end work.

Work is a pure function of a task. Tasks are drawn when a worker becomes free, and results reach the
master one by one in the order of completion. This is the home of mpi4py.

Python handles signals and alarms between two of its own steps. While compiled code takes minutes
for one step, a thread answers requests to stop, and an alarm waits.
"""

import io
import os
import select
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from queue import Empty, SimpleQueue
from types import FrameType
from typing import TYPE_CHECKING, Any, NoReturn, TypeVar

from gen.runtime.errors import InputError
from gen.runtime.figure import use_shipped_settings
from gen.runtime.memory import is_shortage

if TYPE_CHECKING:  # slow to import, and few commands need it
    from concurrent.futures import Future

Task = TypeVar("Task")
Result = TypeVar("Result")

IN_FLIGHT = 2
"""Tasks in the hands of each worker; the second one spares it the wait for the master."""

LAUNCHERS = ("PMI_SIZE", "PMIX_RANK", "OMPI_COMM_WORLD_SIZE", "MPI_LOCALNRANKS")
"""Environment variables that mpiexec, mpirun and srun set for the processes that they start."""

RANKS = ("PMI_RANK", "PMIX_RANK", "OMPI_COMM_WORLD_RANK")
"""Environment variables with the rank of a process that a launcher has started."""

NAMESPACE = "PMIX_NAMESPACE"
"""Environment variable of launchers that speak PMIx.

An MPICH without PMIx ends every process that starts MPI while this variable is set.
"""

QUIET = 1.0
"""Time without a result after which the master does work that can wait [s]."""

LONGEST_NAP = 0.01
"""Longest pause between two looks for a message [s]; MPI's own waiting would keep a core busy."""

SENDING_NAP = "1e-4"
"""Longest pause of a worker while it sends a result [s].

MPICH passes on some 8 kB at each look of the worker. With mpi4py's pause of 1 ms a field of
129 x 129 nodes took 18 ms (`bench writers`).
"""

FORWARDING = 0.5
"""Time for the launcher to pass on a last line, which an abort would lose [s]."""

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGUSR1)
"""Signals that stop a run: Ctrl-C, the end of a batch job, and the warning before that end."""

PATIENCE = 2.0
"""Time that Python has to handle a signal before the thread answers it [s]."""

LONGEST_LIMIT = 1e8
"""Longest time limit, three years [s]; the system's timer ends at 9.2e9 s."""

REPEATED = 1.0
"""Interval of further alarms [s], because code that catches every error may swallow the first."""

_work_of_process: ContextVar[Callable[[Any], Any]] = ContextVar("_work_of_process")
"""Function that this process applies to tasks while it is in `run`."""


class MasterLeft(BaseException):
    """The master has ended the command; raised on workers that wait for it, to end them too.

    Parameters
    ----------
    code : int
        The master's exit code.
    """

    def __init__(self, code: int) -> None:
        super().__init__(code)
        self.code = code


@dataclass(frozen=True)
class World:
    """The processes of this run.

    The master sends a value to all others (`broadcast`), or the exit code with which it ends the
    command (`end`). A master that refuses its input thus reaches the workers wherever they wait.
    """

    rank: int = 0  # number of this process; 0 is the master
    size: int = 1  # number of processes; 1 works without MPI
    communicator: Any = None  # of mpi4py, with all processes; None without MPI

    @property
    def is_master(self) -> bool:
        """Whether this process hands out the work and writes the results."""
        return self.rank == 0

    @property
    def workers(self) -> int:
        """Number of processes that compute."""
        return max(self.size - 1, 1)

    def broadcast(self, value: Any) -> Any:
        """Send the master's value to all processes; a collective call.

        Parameters
        ----------
        value : object
            The value, which can be pickled; ignored on workers.

        Returns
        -------
        object
            The master's value on every process.

        Raises
        ------
        MasterLeft
            On a worker, if the master has ended the command instead.
        """
        if self.communicator is None:
            return value
        code = self._code_of_master(None)
        if code is not None:
            raise MasterLeft(code)
        return self.communicator.bcast(value, root=0)

    def end(self, code: int) -> int:
        """End the command on all processes; a collective call, and the last one.

        Parameters
        ----------
        code : int
            Exit code of this process.

        Returns
        -------
        int
            The master's exit code.

        Raises
        ------
        RuntimeError
            On a worker, if the master goes on with the command.
        """
        if self.communicator is None:
            return code
        agreed = self._code_of_master(code)
        if agreed is None:
            raise RuntimeError(
                f"rank {self.rank} has left a command that rank 0 goes on with"
            )
        return agreed

    def _code_of_master(self, code: int | None) -> int | None:
        """Return the master's exit code on every process, or None if it goes on with the command.

        A process that waits for the master sleeps. A value of `broadcast` is sent separately: a
        worker that ends because its memory has run out must not import what a value is made of.
        """
        announced = self.communicator.Ibcast(bytearray(1), root=0)
        nap = LONGEST_NAP / 1024
        while not announced.Test():
            time.sleep(nap)
            nap = min(2 * nap, LONGEST_NAP)
        received: int | None = self.communicator.bcast(code, root=0)
        return received

    def abort(self, code: int | None = None) -> NoReturn:
        """End all processes at once, without any help of theirs.

        Parameters
        ----------
        code : int, optional
            Exit code of all processes. Without it the error that is being handled is a bug: its
            traceback is printed, and the code is 1.
        """
        if code is None:
            traceback.print_exc()
        sys.stderr.flush()
        if self.communicator is not None:
            time.sleep(FORWARDING)
            self.communicator.Abort(code or 1)
        sys.exit(code or 1)


def this_world() -> World:
    """Join the other processes of this run, and start MPI for it.

    If no launcher of MPI has started this process, no MPI is imported.

    Returns
    -------
    World
        All processes; a world of one process has no communicator.

    Raises
    ------
    InputError
        If a launcher has started this process, but MPI cannot be imported or would end it.
    """
    launched = any(name in os.environ for name in LAUNCHERS)
    if not launched and "mpi4py" not in sys.modules:
        return World()
    _check_launcher()
    try:
        MPI = _started_mpi()
    except (ImportError, RuntimeError) as error:
        if is_shortage(error):
            raise
        from gen.runtime.installation import command_for

        reason = str(error).partition("\n")[0]
        raise InputError(
            f"started by an MPI launcher, but mpi4py does not load ({reason}): for the MPI of this"
            f" machine {command_for('mpi')}, or to bring one along {command_for('mpich')}"
        ) from None
    communicator = MPI.COMM_WORLD
    if communicator.size == 1:
        return World()
    return World(communicator.rank, communicator.size, communicator)


def without_mpi() -> World:
    """Return the world of a command of one process on a machine where MPI does not start.

    A launcher may have started several processes all the same. The variable of their rank then
    tells the first one, which works alone, from the others, which have nothing to do.
    """
    for name in RANKS:
        rank = os.environ.get(name, "")
        if rank.isdecimal():
            return World(rank=int(rank))
    return World()


def _started_mpi() -> Any:
    """Import MPI, start it and return its module; InputError if MPI would end this process."""
    import mpi4py

    if NAMESPACE in os.environ:
        mpi4py.rc.initialize = False
        mpi4py.rc.finalize = True  # MPI is started below, and ends with the process
    from mpi4py import MPI

    if MPI.Is_initialized():
        return MPI
    vendor, _ = MPI.get_vendor()
    if vendor == "MPICH" and "pmix" not in MPI.Get_library_version().lower():
        raise InputError(
            f"{NAMESPACE} in the environment is from a launcher that speaks PMIx (mpirun of Open"
            " MPI, srun --mpi=pmix), which this MPICH does not: start the command with mpiexec of"
            " this MPICH or srun --mpi=pmi2, or take mpi4py of that MPI; to run alone: unset"
            f" {NAMESPACE} PMIX_RANK"
        )
    MPI.Init_thread(MPI.THREAD_MULTIPLE)
    return MPI


def _check_launcher() -> None:
    """Raise InputError for a variable of a launcher that is gone: MPI would end the process."""
    name = _stray_variable()
    if name:
        raise InputError(
            f"{name} = {os.environ[name]!r} in the environment is not from an MPI launcher that"
            f" has started this process; to run alone: unset {name}"
        )


def _stray_variable() -> str:
    """Return the name of a launcher's variable that no launcher of this process has set, or ""."""
    size = os.environ.get("PMI_SIZE")
    if size is not None and not size.isdecimal():
        return "PMI_SIZE"
    descriptor = os.environ.get("PMI_FD")
    if descriptor is not None and not Path("/dev/fd", descriptor).exists():
        return "PMI_FD"
    if "PMIX_RANK" in os.environ and NAMESPACE not in os.environ:
        return "PMIX_RANK"
    return ""


@contextmanager
def process() -> Iterator[None]:
    """Prepare this process for the command that the block runs, and end MPI after it.

    The environment is changed, so the block is the first to import NumPy. A bug in the block prints
    its traceback and ends all processes at once with code 1, as `python -m mpi4py` does.

    Yields
    ------
    None
    """
    # Python would let the processes that this one starts import modules of the current folder.
    os.environ["PYTHONSAFEPATH"] = "1"
    # More threads would compete for the cores, and sums could depend on their number.
    for library in ("OMP", "OPENBLAS", "MKL", "BLIS", "VECLIB_MAXIMUM"):
        os.environ[f"{library}_NUM_THREADS"] = "1"
    if isinstance(sys.stdout, io.TextIOWrapper):
        # A title may have characters that the encoding of the terminal lacks.
        sys.stdout.reconfigure(errors="replace")
    use_shipped_settings()
    try:
        yield
    except Exception:
        communicator = None
        with suppress(InputError):  # this process may not have joined MPI
            communicator = this_world().communicator
        World(communicator=communicator).abort()
    _end_mpi()


def _end_mpi() -> None:
    """End MPI if this process has started it; `python -m mpi4py` would abort at a code above 0."""
    if "mpi4py.MPI" not in sys.modules:
        return
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
    when_quiet: Callable[[], None] = lambda: None,
) -> None:
    """Do all tasks on the workers; a collective call.

    The master alone uses `tasks`, `on_result`, `stopping` and `when_quiet`. In a world of one
    process, the master does the tasks itself, one after another.

    Parameters
    ----------
    work : callable
        Function of a task that returns its result. Each process has its own copy, which is never
        sent and may hold an open file.
    tasks : iterator
        Tasks, none of them None. A task is drawn when a worker can take it, and is pickled.
    on_result : callable
        Called with a task and its result, which is pickled, in the order of completion.
    world : World
        All processes.
    stopping : callable
        Asked before a task is handed out. Once it returns True, the tasks in flight are finished,
        and no more are handed out.
    when_quiet : callable
        Called now and then while the master waits for its workers.

    Raises
    ------
    InputError
        On the master, after the tasks in flight, if `work` raises it on any process. Any other
        error of `work` on a worker is a bug: it ends all processes. An error of the other functions
        or of `tasks` is raised on the master too.
    MasterLeft
        On a worker, if the master has ended the command instead of calling this.
    """
    if world.size == 1:
        for task in tasks:
            if stopping():
                return
            on_result(task, work(task))
        return
    from mpi4py.futures import MPICommExecutor

    world.broadcast(None)  # raises MasterLeft here, as the executor could not
    previous = _work_of_process.set(work)
    if not world.is_master:
        os.environ.setdefault("MPI4PY_FUTURES_BACKOFF", SENDING_NAP)
    try:
        with MPICommExecutor(world.communicator, root=0) as executor:
            if (
                executor is not None
            ):  # on the master; a worker does tasks in the `with` itself
                upcoming = _until(stopping, tasks)
                _supervise(executor, upcoming, on_result, world, when_quiet)
    finally:
        _work_of_process.reset(previous)


def _do(task: Any) -> Any:
    """Return the result of a task by this process's own work.

    MPI sends no more than the name of this function and the task.
    """
    return _work_of_process.get()(task)


def _until(stopping: Callable[[], bool], tasks: Iterator[Task]) -> Iterator[Task]:
    """Yield tasks until `stopping`, which is asked before each is drawn, returns True."""
    while not stopping():
        task = next(tasks, None)
        if task is None:
            return
        yield task


def _supervise(
    executor: Any,
    tasks: Iterator[Task],
    on_result: Callable[[Task, Result], None],
    world: World,
    when_quiet: Callable[[], None],
) -> None:
    """Keep every worker busy until the tasks run out, at a constant cost per task.

    Ctrl-C ends all processes with code 130, because the user does not want to wait for the tasks in
    flight.
    """
    in_flight: dict[Future[Result], Task] = {}
    finished: SimpleQueue[Future[Result]] = SimpleQueue()
    try:
        while True:
            vacant = IN_FLIGHT * world.workers - len(in_flight)
            for task in islice(tasks, vacant):
                future = executor.submit(_do, task)
                in_flight[future] = task
                future.add_done_callback(finished.put)
            if not in_flight:
                return
            try:
                future = finished.get(timeout=QUIET)
            except Empty:
                when_quiet()
                continue
            result = _result_of(future, world)
            on_result(in_flight.pop(future), result)
    except KeyboardInterrupt:
        world.communicator.Abort(130)


def _result_of(future: "Future[Result]", world: World) -> Result:
    """Return the result of a task that a worker has ended, or raise the InputError of its work.

    Any other error is a bug in the work: its traceback is printed, and all processes end.
    """
    try:
        return future.result()
    except InputError:  # for example memory that has run out
        raise
    except Exception:
        world.abort()


class Interruption(ExitStack):
    """A context manager that stops a run in order at the first signal of `SIGNALS`.

    A process that listens records the number of the signal in `signal`, which is 0 before it; the
    run asks `requested`. The second signal ends the process. A process that does not listen, as a
    worker, ignores the signals: it goes on until the master has no more tasks. The handlers are
    installed when the object is made, and the previous ones are restored when the block ends.

    Parameters
    ----------
    listening : bool
        Whether this process answers signals, as the master does.
    """

    def __init__(self, *, listening: bool) -> None:
        super().__init__()
        self.signal = 0
        if listening:
            self._start_watch()
        handler = self._note if listening else signal.SIG_IGN
        for number in SIGNALS:
            previous = signal.signal(number, handler)
            self.callback(signal.signal, number, previous)

    def requested(self) -> bool:
        """Tell whether a signal has come."""
        return self.signal != 0

    def _start_watch(self) -> None:
        """Start the thread that watches for signals; closing this context manager ends it."""
        read, write = os.pipe()
        os.set_blocking(write, False)
        self.callback(os.close, write)
        previous = signal.set_wakeup_fd(write, warn_on_full_buffer=False)
        self.callback(signal.set_wakeup_fd, previous)
        threading.Thread(target=self._watch, args=(read,), daemon=True).start()

    def _note(self, number: int, frame: FrameType | None) -> None:
        """Record a signal and restore the previous handlers, so that the next one ends the run."""
        self.signal = number
        self.close()

    def _watch(self, read: int) -> None:
        """Answer signals while Python is inside compiled code, until the pipe `read` is closed.

        The first signal that Python does not handle in time is acknowledged by a line, the next one
        ends the process. Signals that come together count as one.
        """
        acknowledged = False
        while numbers := os.read(read, 1024):
            stops = [number for number in numbers if number in SIGNALS]
            if not stops:
                continue
            if not acknowledged:
                time.sleep(PATIENCE)
            if self.signal:  # Python has handled it
                continue
            if acknowledged:  # what was synced is on the disk already
                os._exit(128 + stops[-1])
            acknowledged = True
            with suppress(OSError, ValueError):
                sys.stderr.write(
                    "stopping after the step under way; again, to stop now\n"
                )
            readable, _, _ = select.select([read], [], [], 0)
            if readable:
                os.read(read, 1024)
        os.close(read)


@contextmanager
def signals_blocked() -> Iterator[None]:
    """Let the block start processes that the signals of a terminal or a batch job never reach.

    A process that the block starts inherits the blocked `SIGNALS`, and can be ended by SIGKILL
    alone. Signals that come during the block reach this process after it.

    Yields
    ------
    None
    """
    from multiprocessing import resource_tracker

    resource_tracker.ensure_running()  # as it starts, it unblocks signals
    before = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


class Overtime(Exception):
    """A calculation exceeded its time limit.

    Its rows stay pending and do not count as failed, because another machine may be faster.
    """


@contextmanager
def time_limit(seconds: float | None) -> Iterator[None]:
    """Raise Overtime in a block that takes longer than a time limit.

    The block runs on the main thread. A step of compiled code is finished first. The alarm is
    repeated, in case code of the block catches the error.

    Parameters
    ----------
    seconds : float or None
        The limit, above 0 and up to `LONGEST_LIMIT` [s]; None for no limit.

    Yields
    ------
    None

    Raises
    ------
    Overtime
        Once the limit is exceeded.
    """
    if seconds is None:
        yield
        return
    previous = signal.signal(signal.SIGALRM, _raise_overtime)
    try:
        signal.setitimer(signal.ITIMER_REAL, seconds, REPEATED)
        try:
            yield
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
    finally:  # an alarm during the first `finally` is overtime too
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, previous)


def _raise_overtime(number: int, frame: FrameType | None) -> None:
    """Handle the alarm of `time_limit`."""
    raise Overtime
