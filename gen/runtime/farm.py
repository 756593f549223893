"""One master and its workers, serially or over MPI behind one contract, and what ends their work.

Work is a pure function of a task. Tasks are drawn when a worker becomes free, and results reach the
master one by one in the order of completion. This is the home of mpi4py. Python handles signals and
alarms between two of its own steps; while compiled code takes minutes for one step, a thread
answers requests to stop, and an alarm waits.
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

IN_FLIGHT = 2  # tasks in the hands of each worker: the second one spares it the wait for the master

LAUNCHERS = ("PMI_SIZE", "PMIX_RANK", "OMPI_COMM_WORLD_SIZE", "MPI_LOCALNRANKS")
"""Environment variables that mpiexec, mpirun and srun set for the processes that they start."""

RANKS = ("PMI_RANK", "PMIX_RANK", "OMPI_COMM_WORLD_RANK")
"""Those of them that have the rank of a process."""

NAMESPACE = "PMIX_NAMESPACE"
"""Set by launchers that speak PMIx. An MPICH without it ends every process that starts MPI then."""
QUIET = 1.0  # time without a result after which the master does what can wait [s]

LONGEST_NAP = (
    0.01  # between two looks for a message [s]; MPI's own waiting would keep a core busy
)

# Longest pause of a worker while it sends a result [s]. MPICH passes on some 8 kB at each look of
# the worker: with mpi4py's own 1 ms a field of 129 x 129 nodes took 18 ms (`bench writers`).
SENDING_NAP = "1e-4"

FORWARDING = (
    0.5  # time for the launcher to pass on a last line [s]; an abort would lose it
)

SIGNALS = (
    signal.SIGINT,
    signal.SIGTERM,
    signal.SIGUSR1,
)  # Ctrl-C, a batch job's end, its warning

PATIENCE = 2.0  # time that Python has to handle a signal before the thread answers it [s]
LONGEST_LIMIT = 1e8  # longest bound [s], three years; the system's timer ends at 9.2e9 s

REPEATED = (
    1.0  # interval of further alarms [s], as code that catches all may swallow the first
)

_own_work: ContextVar[Callable[[Any], Any]] = ContextVar("_own_work")
"""The function that this process applies to tasks while it is in `run`."""


class MasterLeft(BaseException):
    """The master has ended the command; raised on workers that wait for it, to end them too."""

    def __init__(self, code: int) -> None:
        super().__init__(code)
        self.code = code  # the master's exit code


@dataclass(frozen=True)
class World:
    """The processes of this run.

    The master sends all others values (`broadcast`), or the exit code with which it ends the
    command (`end`): a master that refuses its input reaches the workers wherever they wait.
    """

    rank: int = 0  # of this process; 0 is the master
    size: int = 1  # number of processes; 1 works without MPI
    communicator: Any = None  # of mpi4py, of all processes

    @property
    def is_master(self) -> bool:
        """Whether this process hands out the work and writes the results."""
        return self.rank == 0

    @property
    def workers(self) -> int:
        """Number of processes that compute."""
        return max(self.size - 1, 1)

    def broadcast(self, value: Any) -> Any:
        """Return the master's value everywhere; MasterLeft if it has ended the command instead."""
        if self.communicator is None:
            return value
        value, code = self._exchange((value, None))
        if code is not None:
            raise MasterLeft(code)
        return value

    def end(self, code: int) -> int:
        """End the command on all processes; return the master's exit code. It is the last call."""
        if self.communicator is None:
            return code
        _, agreed = self._exchange((None, code))
        if agreed is None:
            raise RuntimeError(
                f"rank {self.rank} has left a command that rank 0 goes on with"
            )
        return int(agreed)

    def _exchange(self, envelope: tuple[Any, int | None]) -> tuple[Any, int | None]:
        """Return the master's envelope on every process; waiting processes sleep."""
        announced = self.communicator.Ibcast(bytearray(1), root=0)
        nap = LONGEST_NAP / 1024
        while not announced.Test():
            time.sleep(nap)
            nap = min(2 * nap, LONGEST_NAP)
        received: tuple[Any, int | None] = self.communicator.bcast(envelope, root=0)
        return received

    def abort(self, code: int | None = None) -> NoReturn:
        """End all processes at once with a code, or with the traceback of a bug and 1."""
        if code is None:
            traceback.print_exc()
        sys.stderr.flush()
        if self.communicator is not None:
            time.sleep(FORWARDING)
            self.communicator.Abort(code or 1)
        sys.exit(code or 1)


def this_world() -> World:
    """Join the other processes if an MPI launcher started this one; otherwise import no MPI."""
    if not any(name in os.environ for name in LAUNCHERS) and "mpi4py" not in sys.modules:
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
    """Return the world of a command of one process where MPI does not start.

    A launcher may have started several processes all the same: the variable of their rank tells the
    first one, which works alone, from the others, which have nothing to do.
    """
    ranks = (os.environ.get(name, "") for name in RANKS)
    return World(rank=next((int(rank) for rank in ranks if rank.isdecimal()), 0))


def _started_mpi() -> Any:
    """Import MPI and start it, unless it is one that would end this process: InputError then."""
    import mpi4py

    if NAMESPACE in os.environ:
        mpi4py.rc.initialize = False
        mpi4py.rc.finalize = True  # at the end of the process, as MPI is started below
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
    """Refuse variables of a launcher that does not exist, for which MPI would end the process."""
    size, descriptor = (os.environ.get(name) for name in ("PMI_SIZE", "PMI_FD"))
    faults = {
        "PMI_SIZE": size is not None and not size.isdecimal(),
        "PMI_FD": descriptor is not None and not Path("/dev/fd", descriptor).exists(),
        "PMIX_RANK": "PMIX_RANK" in os.environ and NAMESPACE not in os.environ,
    }
    for name, at_fault in faults.items():
        if at_fault:
            raise InputError(
                f"{name} = {os.environ[name]!r} in the environment is not from an MPI launcher that"
                f" has started this process; to run alone: unset {name}"
            )


@contextmanager
def process() -> Iterator[None]:
    """Prepare this process for a command, before NumPy is imported, and end MPI after it.

    A bug ends all processes at once, as `python -m mpi4py` does.
    """
    # Python would let what this process starts import modules of the current folder.
    os.environ["PYTHONSAFEPATH"] = "1"
    # More threads would compete for the cores, and sums could depend on their number.
    for library in ("OMP", "OPENBLAS", "MKL", "BLIS", "VECLIB_MAXIMUM"):
        os.environ[f"{library}_NUM_THREADS"] = "1"
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(
            errors="replace"
        )  # characters that the encoding lacks, in a title
    use_shipped_settings()
    try:
        yield
    except Exception:
        communicator = None
        with suppress(InputError):  # also if this process has not joined MPI
            communicator = this_world().communicator
        World(communicator=communicator).abort()
    if "mpi4py.MPI" in sys.modules:
        from mpi4py import MPI

        if MPI.Is_initialized() and not MPI.Is_finalized():
            MPI.Finalize()  # `python -m mpi4py` would abort for exit codes above 0 otherwise


def run(
    work: Callable[[Task], Result],
    tasks: Iterator[Task],
    on_result: Callable[[Task, Result], None],
    world: World,
    *,
    stopping: Callable[[], bool] = lambda: False,
    when_quiet: Callable[[], None] = lambda: None,
) -> None:
    """Do all tasks; a collective call, each process with its own copy of the work.

    `work` is never sent and may hold an open file; tasks and results are pickled. `on_result` is
    called on the master, and `when_quiet` now and then while it waits for workers. Once `stopping`
    returns True, the tasks in flight are finished and no more are handed out. An exception of one
    of these functions or of `tasks`, or an InputError of `work`, is raised on
    the master after the tasks in flight; any other one of `work` is a bug and ends all processes.
    Workers raise MasterLeft if the master has ended the command instead of calling this.
    """
    if world.size == 1:
        for task in tasks:
            if stopping():
                return
            on_result(task, work(task))
        return
    from mpi4py.futures import MPICommExecutor

    world.broadcast(None)  # raises MasterLeft here, as the executor could not
    own = _own_work.set(work)
    if not world.is_master:
        os.environ.setdefault("MPI4PY_FUTURES_BACKOFF", SENDING_NAP)
    try:
        with MPICommExecutor(world.communicator, root=0) as executor:
            if executor is not None:
                try:
                    _supervise(executor, tasks, on_result, world, stopping, when_quiet)
                except (
                    KeyboardInterrupt
                ):  # the user does not want to wait for the tasks in flight
                    world.communicator.Abort(130)
    finally:
        _own_work.reset(own)


def _do(task: Any) -> Any:
    """Do a task with this process's own work; MPI sends only the name of this function."""
    return _own_work.get()(task)


def _supervise(
    executor: Any,
    tasks: Iterator[Task],
    on_result: Callable[[Task, Result], None],
    world: World,
    stopping: Callable[[], bool],
    when_quiet: Callable[[], None],
) -> None:
    """Keep every worker busy until the tasks run out, at a constant cost per task."""
    in_flight: dict[Future[Result], Task] = {}
    finished: SimpleQueue[Future[Result]] = SimpleQueue()
    drained = False
    while in_flight or not drained:
        while not drained and len(in_flight) < IN_FLIGHT * world.workers:
            task = None if stopping() else next(tasks, None)
            drained = task is None
            if task is not None:
                future = executor.submit(_do, task)
                in_flight[future] = task
                future.add_done_callback(finished.put)
        if in_flight:
            try:
                future = finished.get(timeout=QUIET)
            except Empty:
                when_quiet()
                continue
            try:
                result = future.result()
            except InputError:  # for example memory that has run out
                raise
            except Exception:  # a worker's bug, whose traceback is printed here
                world.abort()
            on_result(in_flight.pop(future), result)


class Interruption(ExitStack):
    """A context manager that records the first `signal`, 0 before it; the second ends the process.

    The master is `listening` and stops the run in order; a worker ignores signals until the master
    has no more tasks. Handlers are installed as it is made, and the previous ones given back.
    """

    def __init__(self, *, listening: bool) -> None:
        super().__init__()
        self.signal = 0
        if listening:
            read, write = os.pipe()
            os.set_blocking(write, False)
            self.callback(os.close, write)
            previous = signal.set_wakeup_fd(write, warn_on_full_buffer=False)
            self.callback(signal.set_wakeup_fd, previous)
            threading.Thread(target=self._watch, args=(read,), daemon=True).start()
        for number in SIGNALS:
            handler = self._note if listening else signal.SIG_IGN
            self.callback(signal.signal, number, signal.signal(number, handler))

    def requested(self) -> bool:
        """Tell whether a signal has come."""
        return self.signal != 0

    def _note(self, number: int, frame: FrameType | None) -> None:
        """Record a signal and restore the previous handlers, so that the next one ends the run."""
        self.signal = number
        self.close()

    def _watch(self, read: int) -> None:
        """Answer signals while Python is inside compiled code; those that come together are one."""
        said = False
        while numbers := os.read(read, 1024):
            if not set(numbers) & set(SIGNALS):
                continue
            if not said:
                time.sleep(PATIENCE)
            if self.signal:
                continue
            if said:  # what was synced is on the disk already
                os._exit(128 + numbers[-1])
            with suppress(OSError, ValueError):
                sys.stderr.write(
                    "stopping after the step under way; again, to stop now\n"
                )
            said = True
            if select.select([read], [], [], 0)[0]:
                os.read(read, 1024)
        os.close(read)


@contextmanager
def signals_blocked() -> Iterator[None]:
    """Let the block start processes that the signals of a terminal or a batch job never reach.

    A process that computes for this one inherits the blocked signals, and is ended by a kill. What
    comes during the block reaches this process behind it.
    """
    from multiprocessing import resource_tracker

    resource_tracker.ensure_running()  # as it starts, it unblocks signals
    before = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


class Overtime(Exception):
    """A calculation has taken longer than its bound, and is pending, not failed: times differ."""


@contextmanager
def time_limit(seconds: float | None) -> Iterator[None]:
    """Raise Overtime once a block on the main thread has taken so long [s], if there is a bound."""
    if seconds is None:
        yield
        return
    previous = signal.signal(signal.SIGALRM, _end)
    try:
        signal.setitimer(signal.ITIMER_REAL, seconds, REPEATED)
        try:
            yield
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
    finally:  # an alarm during the first `finally` is overtime too
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, previous)


def _end(number: int, frame: FrameType | None) -> None:
    """Handle the alarm."""
    raise Overtime
