"""One executor for a whole job: the master runs the job's code, the workers do its tasks.

The contract is that of mpi4py.futures and schwimmbad. The code of a job is written as if there were
one process: it hands tasks to an executor and receives their results on the master. The workers run
none of it; they serve tasks until the executor closes. On one process the executor does the tasks
itself.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

from gen.runtime import farm
from gen.runtime.signals import Interruption

Shared = TypeVar("Shared")
Task = TypeVar("Task")
Result = TypeVar("Result")

ALONE = farm.World()
"""The world of a process that works without MPI."""


@dataclass(frozen=True)
class _Round:
    """The announcement of tasks to the workers.

    Attributes
    ----------
    work : callable
        Function of the shared data and of one task; sent by its name.
    shared : object
        The shared data, or None if the workers still hold them from the round before.
    fresh : bool
        Whether `shared` replaces the data that the workers hold.
    """

    work: Callable[[Any, Any], Any]
    shared: Any
    fresh: bool


class Executor:
    """The workers of a job, as the code on its master sees them.

    Parameters
    ----------
    world : gen.runtime.farm.World
        The processes, this one alone if left out. The workers among them have to be in `lead`.

    Attributes
    ----------
    workers : int
        Number of processes that compute.
    """

    def __init__(self, world: farm.World = ALONE) -> None:
        self.workers = world.workers
        self._world = world
        self._held: object = None

    def run(
        self,
        work: Callable[[Shared, Task], Result],
        shared: Shared,
        tasks: Iterable[Task],
        on_result: Callable[[Task, Result], None],
        *,
        stopping: Callable[[], bool] = lambda: False,
    ) -> None:
        """Do tasks on the workers and pass each result on as soon as it is there.

        Parameters
        ----------
        work : callable
            Function of the shared data and of one task, defined at the top of a module.
        shared : object
            Data that all tasks work on. The workers keep them: data that were the last to be shared
            are not sent again.
        tasks : iterable
            Arguments of `work`, drawn as workers become free.
        on_result : callable
            Called here with a task and its result, in the order of completion.
        stopping : callable
            Asked before a task is handed out. Once it returns True, no further task is begun, and
            tasks under way are finished.

        Raises
        ------
        InputError
            If `work` raises it on any process, or `on_result` raises it here.
        """
        fresh = shared is not self._held
        self._world.broadcast(_Round(work, shared if fresh else None, fresh))
        self._held = shared
        farm.run(partial(work, shared), iter(tasks), on_result, self._world, stopping=stopping)

    def call(self, work: Callable[[Shared, Task], Result], shared: Shared, task: Task) -> Result:
        """Do one task while all other workers wait, and return its result.

        Parameters
        ----------
        work, shared, task
            See `run`.
        """
        results: list[Result] = []
        self.run(work, shared, [task], lambda _, result: results.append(result))
        return results[0]

    def close(self) -> None:
        """Release the workers from `lead`."""
        self._world.broadcast(None)


def lead(job: Callable[[Executor], int], world: farm.World) -> int:
    """Run a job on the master, and serve its tasks on the workers; every process has to call it.

    Parameters
    ----------
    job : callable
        The job's code. It is called on the master only, and returns the exit code.
    world : gen.runtime.farm.World
        The processes of this run.

    Returns
    -------
    int
        The exit code of the job; 0 on a worker, whose own code does not count.

    Raises
    ------
    gen.runtime.farm.MasterLeft
        On the workers, if the job raised an exception on the master.
    """
    if world.is_master:
        executor = Executor(world)
        code = job(executor)
        executor.close()
        return code
    with Interruption(listening=False):
        _serve(world)
    return 0


def _serve(world: farm.World) -> None:
    """Do the tasks of one round after the other until the master closes its executor."""
    shared: Any = None
    while (announced := world.broadcast(None)) is not None:
        if announced.fresh:
            shared = announced.shared
        farm.run(partial(announced.work, shared), iter(()), _receive_nothing, world)


def _receive_nothing(task: Any, result: Any) -> None:
    """Stand for the handler of results on a worker, which receives none."""
