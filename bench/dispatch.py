"""`python -m mpi4py -m bench.dispatch SPEC`: tasks that cost nothing, through the farm.

What is left is the farm's own work: to hand out, to send, to take back. Prints seconds and a sum
that holds only if every task was done once, in JSON.
"""

import time

from bench.scale.launch import answer
from gen.runtime import farm

SALT = 2_654_435_761  # multiplies numbers, so that the sum tells whether each was there


def work(task: int) -> int:
    """Do nearly nothing, the same everywhere."""
    return task * SALT


def dispatch(tasks: int, world: farm.World) -> int:
    """Sum the results of all tasks on the master; every process of the world has to call it."""
    results: list[int] = []
    farm.run(work, iter(range(tasks)), lambda _task, result: results.append(result), world)
    return sum(results)


def expected(tasks: int) -> int:
    """Return the sum of the results if every task is done once."""
    return SALT * tasks * (tasks - 1) // 2


def main(arguments: dict[str, int], world: farm.World) -> dict[str, float]:
    """Time as many tasks as the arguments say."""
    dispatch(8 * world.workers, world)  # the first tasks find their way
    began = time.perf_counter()
    total = dispatch(arguments["tasks"], world)
    seconds = time.perf_counter() - began
    return {"seconds": seconds, "total": total, "workers": world.workers}


if __name__ == "__main__":
    answer(main)
