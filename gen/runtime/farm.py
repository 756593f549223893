"""Run one master and its workers, serially or over MPI, and end their work by signals and limits.

Work is a pure function of a task. A task is drawn when a worker becomes free, and results reach the
master one by one in the order of completion. No other module of `gen` or `learn` imports mpi4py.

Python handles signals and alarms only between two of its own steps. A step of compiled code can
take minutes. During such a step, a thread answers requests to stop, and an alarm waits.
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
"""Number of tasks that each worker has: one to compute, and one to begin without waiting."""

LAUNCHERS = ("PMI_SIZE", "PMIX_RANK", "OMPI_COMM_WORLD_SIZE", "MPI_LOCALNRANKS")
"""Environment variables that mpiexec, mpirun and srun set for the processes that they start."""

RANKS = ("PMI_RANK", "PMIX_RANK", "OMPI_COMM_WORLD_RANK")
"""Environment variables with the rank of a process that a launcher has started."""

NAMESPACE = "PMIX_NAMESPACE"
"""Environment variable that launchers with the protocol PMIx set.

An MPICH without PMIx ends every process that starts MPI while this variable is set.
"""

QUIET = 1.0
"""Time without a result after which the master calls `when_quiet` of `run` [s]."""

LONGEST_NAP = 0.01
"""Longest pause between two checks for a message [s]; MPI's own wait would keep a core busy."""

SENDING_NAP = "1e-4"
"""Longest pause of a worker between two checks of a result that it sends [s].

MPICH sends about 8 kB at each check. With mpi4py's pause of 1 ms, a field of 129 x 129 nodes took
18 ms (`bench writers`).
"""

FORWARDING = 0.5
"""Time in which the launcher forwards the last printed line; an abort loses later output [s]."""

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGUSR1)
"""Signals that stop a run: Ctrl-C, the end of a batch job, and the warning before that end."""

PATIENCE = 2.0
"""Time that Python has to handle a signal before the watching thread answers it [s]."""

LONGEST_LIMIT = 1e8
"""Largest time limit that is accepted, three years [s]; the system's timer allows 9.2e9 s."""

REPEATED = 1.0
"""Interval at which the alarm is repeated [s], in case some code catches the first Overtime."""

_work_of_process: ContextVar[Callable[[Any], Any]] = ContextVar("_work_of_process")
"""Function that this process applies to tasks while it is in `run`."""


class MasterLeft(BaseException):
    """The master has ended the command, so a worker that waits for the master ends too.

    Parameters
    ----------
    code : int
        The master's exit code, with which the worker ends.
    """

    def __init__(self, code: int) -> None:
        super().__init__(code)
        self.code = code


@dataclass(frozen=True)
class World:
    """The processes of this run.

    A worker that waits for the master gets either a value (`broadcast`) or the exit code with which
    the master ends the command (`end`). A master that refuses its input therefore ends the workers
    too, wherever they wait.
    """

    rank: int = 0  # number of this process; 0 is the master
    size: int = 1  # number of processes
    # mpi4py's communicator of all processes; None if there is one process, or MPI does not start
    communicator: Any = None

    @property
    def is_master(self) -> bool:
        """Whether this process hands out the work and writes the results."""
        return self.rank == 0

    @property
    def workers(self) -> int:
        """Number of processes that compute: all but the master, or the master if it is alone."""
        return max(self.size - 1, 1)

    def broadcast(self, value: Any) -> Any:
        """Send the master's value to all processes; a collective call.

        Parameters
        ----------
        value : object
            On the master, a value that can be pickled. Workers' values are ignored.

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
        """Agree with all processes that the command has ended; a collective call, the last one.

        Parameters
        ----------
        code : int
            Exit code that this process has come to.

        Returns
        -------
        int
            The master's exit code, on every process.

        Raises
        ------
        RuntimeError
            On a worker, if the master is still running the command.
        """
        if self.communicator is None:
            return code
        code_of_master = self._code_of_master(code)
        if code_of_master is None:
            raise RuntimeError(
                f"rank {self.rank} has left a command that rank 0 goes on with"
            )
        return code_of_master

    def _code_of_master(self, code: int | None) -> int | None:
        """Send the master's `code` to all processes, and return it; a collective call.

        The code of a worker is ignored. None means that the master is still running the command.
        `broadcast` sends its value in a second message: a worker that ends because its memory has
        run out must not import the modules that unpickling the value needs.
        """
        # Sleep until the master sends, because the waiting of `bcast` would keep a core busy.
        announcement = self.communicator.Ibcast(bytearray(1), root=0)
        nap = LONGEST_NAP / 1024  # short at first, because most messages come soon [s]
        while not announcement.Test():
            time.sleep(nap)
            nap = min(2 * nap, LONGEST_NAP)
        received: int | None = self.communicator.bcast(code, root=0)
        return received

    def abort(self, code: int | None = None) -> NoReturn:
        """End all processes at once, whatever the other ones are doing.

        Parameters
        ----------
        code : int, optional
            Exit code of all processes; 0 is replaced by 1. If it is left out, the exception that is
            being handled is a bug: its traceback is printed, and the exit code is 1.
        """
        if code is None:
            traceback.print_exc()
        sys.stderr.flush()
        if self.communicator is not None:
            time.sleep(FORWARDING)
            self.communicator.Abort(code or 1)
        sys.exit(code or 1)


def this_world() -> World:
    """Join the other processes of this run, and start MPI unless it is running.

    MPI is neither imported nor started if no launcher of MPI has started this process and mpi4py
    has not been imported before.

    Returns
    -------
    World
        All processes; a world of one process has no communicator.

    Raises
    ------
    InputError
        If a launcher has started this process, but MPI cannot be imported or would end it.
    ImportError or RuntimeError
        If memory is too short to start MPI.
    """
    launched = any(name in os.environ for name in LAUNCHERS)
    if not launched and "mpi4py" not in sys.modules:
        return World()
    _check_launcher()
    try:
        MPI = _started_mpi()
    except (ImportError, RuntimeError) as error:
        if is_shortage(error):  # another installation would not help
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
    return World(
        rank=communicator.rank, size=communicator.size, communicator=communicator
    )


def without_mpi() -> World:
    """Return the world of a command that one process runs because MPI does not start.

    Returns
    -------
    World
        A world of size 1 without a communicator. Its rank is the one that a launcher has set in the
        environment (`RANKS`), or 0. If a launcher has started several processes, the process of
        rank 0 therefore runs the command as its master, and the other processes do nothing.
    """
    for name in RANKS:
        rank = os.environ.get(name, "")
        if rank.isdecimal():
            return World(rank=int(rank))
    return World()


def _started_mpi() -> Any:
    """Import mpi4py.MPI, start MPI unless it is running, and return the module.

    Raises InputError if MPI would end this process instead of raising an error.
    """
    import mpi4py

    if NAMESPACE in os.environ:
        # The import must not start MPI before its library has been checked below.
        mpi4py.rc.initialize = False
        mpi4py.rc.finalize = True  # MPI ends with the process
    from mpi4py import MPI

    if MPI.Is_initialized():
        return MPI
    vendor, _ = MPI.get_vendor()
    speaks_pmix = "pmix" in MPI.Get_library_version().lower()
    if vendor == "MPICH" and not speaks_pmix:
        raise InputError(
            f"{NAMESPACE} in the environment is from a launcher that speaks PMIx (mpirun of Open"
            " MPI, srun --mpi=pmix), which this MPICH does not: start the command with mpiexec of"
            " this MPICH or srun --mpi=pmi2, or take mpi4py of that MPI; to run alone: unset"
            f" {NAMESPACE} PMIX_RANK"
        )
    MPI.Init_thread(MPI.THREAD_MULTIPLE)
    return MPI


def _check_launcher() -> None:
    """Raise InputError for a launcher's variable that no launcher of this process has set.

    MPI would end the process because of such a variable.
    """
    name = _stray_variable()
    if name:
        raise InputError(
            f"{name} = {os.environ[name]!r} in the environment is not from an MPI launcher that"
            f" has started this process; to run alone: unset {name}"
        )


def _stray_variable() -> str:
    """Return the name of a launcher's variable that no launcher of this process has set.

    Such a variable comes from the surrounding shell or job. Returns "" if there is none.
    """
    size = os.environ.get("PMI_SIZE")
    if size is not None and not size.isdecimal():  # a launcher sets a number
        return "PMI_SIZE"
    descriptor = os.environ.get("PMI_FD")
    if descriptor is not None and not Path("/dev/fd", descriptor).exists():
        return "PMI_FD"  # the connection to a launcher that has ended
    if "PMIX_RANK" in os.environ and NAMESPACE not in os.environ:
        return "PMIX_RANK"  # a launcher sets both
    return ""


@contextmanager
def process() -> Iterator[None]:
    """Prepare this process for the command that the block runs, and end MPI after it.

    This sets environment variables of Python, BLAS and matplotlib. The caller must not have
    imported NumPy before, which reads some of them at its import. If the block raises an error, it
    is a bug: its traceback is printed, and all processes end at once with exit code 1, as under
    `python -m mpi4py`.

    Yields
    ------
    None
    """
    # Otherwise processes that this one starts could import modules of the current folder.
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
        with suppress(InputError):  # MPI does not start, so this process ends alone
            communicator = this_world().communicator
        World(communicator=communicator).abort()
    _end_mpi()


def _end_mpi() -> None:
    """End MPI if this process has started it.

    Otherwise `python -m mpi4py` would abort all processes if the exit code is above 0.
    """
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

    Only the master uses `tasks`, `on_result`, `stopping` and `when_quiet`. In a world of one
    process, the master does the tasks itself, one after another, and never calls `when_quiet`.

    Parameters
    ----------
    work : callable
        Function that takes a task and returns its result. Every process passes its own function,
        which is not sent and may hold an open file.
    tasks : iterator
        Tasks, none of them None. A task is drawn when a worker can take it. Tasks are pickled to
        be sent.
    on_result : callable
        Called on the master with a task and its result, in the order of completion. Results are
        pickled to be sent.
    world : World
        All processes.
    stopping : callable
        Called without arguments before a task is handed out. Once it returns True, no more tasks
        are handed out, and the tasks that workers have are finished.
    when_quiet : callable
        Called without arguments whenever the master has waited `QUIET` seconds for a result.

    Raises
    ------
    InputError
        On the master, if `work` raises it on any process. The tasks that workers have are finished
        first, but their results are lost. Any other error of `work` on a worker is a bug: it ends
        all processes. Errors of `tasks` and of the other functions are raised on the master too.
    MasterLeft
        On a worker, if the master has ended the command instead of calling this function.
    """
    if world.size == 1:
        for task in tasks:
            if stopping():
                return
            on_result(task, work(task))
        return
    from mpi4py.futures import MPICommExecutor

    world.broadcast(None)  # raises MasterLeft, which the executor cannot do
    previous = _work_of_process.set(work)
    if not world.is_master:
        os.environ.setdefault("MPI4PY_FUTURES_BACKOFF", SENDING_NAP)
    try:
        # On a worker, entering the `with` does all of its tasks, and gives None for the executor.
        with MPICommExecutor(world.communicator, root=0) as executor:
            if executor is not None:
                upcoming = _until(stopping, tasks)
                _supervise(executor, upcoming, on_result, world, when_quiet)
    finally:
        _work_of_process.reset(previous)


def _do(task: Any) -> Any:
    """Do a task by the function that this process has passed to `run`, and return its result.

    The master sends only the task and the name of `_do` to a worker, not its own `work`.
    """
    return _work_of_process.get()(task)


def _until(stopping: Callable[[], bool], tasks: Iterator[Task]) -> Iterator[Task]:
    """Yield tasks until none is left, or until `stopping` returns True.

    `stopping` is called before each task is drawn.
    """
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
    """Keep every worker busy until the tasks run out, and pass each result to `on_result`.

    The master's time per task does not grow with the number of workers. Ctrl-C ends all processes
    with exit code 130, because the user does not want to wait for the tasks that workers have.
    """
    in_flight: dict[Future[Result], Task] = {}
    finished: SimpleQueue[Future[Result]] = SimpleQueue()
    try:
        while True:
            vacancies = IN_FLIGHT * world.workers - len(in_flight)
            for task in islice(tasks, vacancies):
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
    """Return the result of a finished task, or raise the InputError that its work has raised.

    Any other error of the work is a bug: its traceback is printed, and all processes end.
    """
    try:
        return future.result()
    except InputError:  # for example because memory has run out
        raise
    except Exception:
        world.abort()


class Interruption(ExitStack):
    """A context manager that records the first signal of `SIGNALS`, so that a run can stop.

    The handlers are installed when the object is made. The previous handlers are restored at the
    first signal or when the block ends. The second signal therefore ends the process.

    Parameters
    ----------
    listening : bool
        Whether this process records signals, as the master does. A process that does not, such as
        a worker, ignores the signals and works until the master has no more tasks.
    """

    def __init__(self, *, listening: bool) -> None:
        super().__init__()
        self.signal = 0  # number of the recorded signal; 0 before it has come
        if listening:
            self._start_watch()
        handler = self._note if listening else signal.SIG_IGN
        for number in SIGNALS:
            previous = signal.signal(number, handler)
            self.callback(signal.signal, number, previous)

    def requested(self) -> bool:
        """Tell whether a signal has been recorded."""
        return self.signal != 0

    def _start_watch(self) -> None:
        """Start the thread `_watch`; closing this context manager ends it.

        Python writes the number of each signal to a pipe at once, also during compiled code.
        """
        read, write = os.pipe()
        os.set_blocking(write, False)
        self.callback(os.close, write)  # ends the thread, which reads the other end
        previous = signal.set_wakeup_fd(write, warn_on_full_buffer=False)
        self.callback(signal.set_wakeup_fd, previous)
        threading.Thread(target=self._watch, args=(read,), daemon=True).start()

    def _note(self, number: int, frame: FrameType | None) -> None:
        """Record a signal, and restore the previous handlers, so that the next one ends the run.

        This is the handler of `SIGNALS`; Python calls it between two of its steps.
        """
        self.signal = number
        self.close()

    def _watch(self, read: int) -> None:
        """Answer signals while Python is inside compiled code.

        The first signal that Python does not handle in time is acknowledged by a line on standard
        error, and the next one ends the process. Signals that come together count as one. `read` is
        the end of the pipe that gives the numbers of signals; the thread ends when the other end is
        closed.
        """
        acknowledged = False
        while numbers := os.read(read, 1024):  # one byte for each signal; waits for them
            stop_signals = [number for number in numbers if number in SIGNALS]
            if not stop_signals:
                continue
            if not acknowledged:
                time.sleep(PATIENCE)
            if self.signal:  # Python has handled the signal by `_note`
                continue
            # The second request ends the process without cleaning up, with the exit code that a
            # shell gives. Rows that were synced are on the disk already.
            if acknowledged:
                os._exit(128 + stop_signals[-1])
            acknowledged = True
            with suppress(OSError, ValueError):  # standard error is closed
                sys.stderr.write(
                    "stopping after the step under way; again, to stop now\n"
                )
            # Signals that came before the line was printed do not end the process.
            readable, _, _ = select.select([read], [], [], 0)
            if readable:
                os.read(read, 1024)
        os.close(read)


@contextmanager
def signals_blocked() -> Iterator[None]:
    """Block `SIGNALS` while the block of this context manager starts processes.

    The new processes inherit this, so that the signals of a terminal or a batch job never reach
    them; only SIGKILL ends them. Signals that come during the block reach this process after it.

    Yields
    ------
    None
    """
    from multiprocessing import resource_tracker

    resource_tracker.ensure_running()  # before blocking, because its start unblocks signals
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

    The block must run on the main thread. Compiled code is not interrupted; Overtime is raised
    after it. The alarm is repeated every second, in case code of the block catches the error.

    Parameters
    ----------
    seconds : float or None
        Time limit, above 0 and up to `LONGEST_LIMIT` [s]; None for no limit.

    Yields
    ------
    None

    Raises
    ------
    Overtime
        If the block takes longer than `seconds`.
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
    finally:  # also if an alarm has raised Overtime in the `finally` above
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, previous)


def _raise_overtime(number: int, frame: FrameType | None) -> None:
    """Handle the alarm of `time_limit` by raising Overtime."""
    raise Overtime
