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
    """The announcement of tasks to the workers."""

    work: Callable[[Any, Any], Any]  # function of the shared data and of one task; sent by its name
    shared: Any  # None if the workers still hold the data of the round before
    fresh: bool  # whether `shared` replaces what the workers hold


class Executor:
    """The workers of a job, as the code on its master sees them: `workers` processes that compute.

    The world is this process alone if left out. The workers among its processes have to be in
    `lead`.
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
        """Do tasks on the workers and pass on each result, with its task, as it comes.

        `work` is a function, at the top of a module, of the shared data and of one task; the
        workers keep data that were the last to be shared. Tasks are drawn as workers become free,
        until `stopping`, which is asked before each, returns True; tasks under way are finished.
        InputError that `work` raises on any process, or `on_result` here, is raised here.
        """
        fresh = shared is not self._held
        self._world.broadcast(_Round(work, shared if fresh else None, fresh))
        self._held = shared
        farm.run(partial(work, shared), iter(tasks), on_result, self._world, stopping=stopping)

    def call(self, work: Callable[[Shared, Task], Result], shared: Shared, task: Task) -> Result:
        """Do one task while all other workers wait, and return its result; see `run`."""
        results: list[Result] = []
        self.run(work, shared, [task], lambda _, result: results.append(result))
        return results[0]

    def close(self) -> None:
        """Release the workers from `lead`."""
        self._world.broadcast(None)


def lead(job: Callable[[Executor], int], world: farm.World) -> int:
    """Run a job on the master, and serve its tasks on the workers; every process has to call it.

    The job's exit code is returned on the master, 0 on a worker. If the job raises an exception on
    the master, `gen.runtime.farm.MasterLeft` is raised on the workers.
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
