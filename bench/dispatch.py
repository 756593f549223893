"""`python -m mpi4py -m bench.dispatch SPEC`: tasks that cost nothing, through the farm.

What is left is the farm's own work: to hand out, to send, to take back. Prints seconds and a sum
that holds only if every task was done once, in JSON.
"""

import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from gen.runtime import farm

SALT = 2_654_435_761
"""Multiplies numbers, so that the sum tells whether each was there."""


def work(task: int) -> int:
    """Nearly nothing, the same everywhere."""
    return task * SALT


def dispatch(tasks: int, world: farm.World) -> int:
    """Sum of all results, on the master; every process of the world has to call it."""
    total = 0

    def take(_task: int, result: int) -> None:
        nonlocal total
        total += result

    farm.run(work, iter(range(tasks)), take, world)
    return total


def expected(tasks: int) -> int:
    """The sum if every task was done once."""
    return SALT * tasks * (tasks - 1) // 2


def main(arguments: Sequence[str]) -> None:
    """Read the specification, a JSON file, and print what happened as JSON."""
    tasks = int(json.loads(Path(arguments[0]).read_text())["tasks"])
    world = farm.this_world()
    dispatch(8 * world.workers, world)  # the first tasks find their way
    began = time.perf_counter()
    total = dispatch(tasks, world)
    seconds = time.perf_counter() - began
    if world.is_master:
        found = {"seconds": seconds, "total": total, "workers": world.workers}
        sys.stdout.write(json.dumps(found) + "\n")


if __name__ == "__main__":
    main(sys.argv[1:])
    farm.leave()
