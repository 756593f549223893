"""Programs of this package under mpiexec, each with a time limit: how they start and answer.

`python -m mpi4py -m bench.farm.launch SPEC` is the smallest of them: tasks that cost nothing,
through the farm. What is left is the farm's own work: to hand out, to send, to take back. It prints
seconds and a sum that holds only if every task was done once, in JSON.
"""

import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from gen.runtime import farm
from gen.runtime.errors import InputError
from gen.runtime.installation import command_for

TIMEOUT = 300.0  # seconds after which a measurement counts as hanging

ENVIRONMENT = {
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    "OMPI_MCA_rmaps_base_oversubscribe": "1",
    "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
    "PYTHONPATH": str(Path(__file__).resolve().parents[2]),
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
}
"""Open MPI as root and on few cores; one thread a rank."""


def launch(ranks: int, module: str, arguments: dict[str, Any], folder: Path) -> Any:
    """Run a module in a folder and return what it prints in its last line, in JSON.

    Its arguments are written down for it in JSON. 0 ranks run alone, without MPI.

    Raises
    ------
    InputError
        If there is no mpiexec, or the program fails.
    """
    specification = folder / "specification.json"
    specification.write_text(json.dumps(arguments))
    command = [sys.executable, "-m", module, str(specification)]
    if ranks:
        command = [_mpiexec(), "-n", str(ranks), sys.executable, "-m", "mpi4py", *command[1:]]
    kept = {key: value for key, value in os.environ.items() if not key.startswith(("PMI", "OMPI"))}
    done = subprocess.run(
        command,
        cwd=folder,
        env=kept | ENVIRONMENT,
        capture_output=True,
        text=True,
        timeout=TIMEOUT,
        check=False,
    )
    if done.returncode:
        reason = f"exit code {done.returncode}: {done.stderr.strip()[-500:]}"
        raise InputError(f"scale: {module} on {ranks} ranks fails with {reason}")
    return json.loads(done.stdout.splitlines()[-1])


def answer(work: Callable[[dict[str, Any], farm.World], Any]) -> None:
    """Run this program's work, started by `launch`, and print the master's result as JSON.

    Every process calls it with the arguments that were written down, and the world.
    """
    world = farm.this_world()
    result = work(json.loads(Path(sys.argv[1]).read_text(encoding="utf-8")), world)
    if world.is_master:
        sys.stdout.write(json.dumps(result) + "\n")
    farm.leave()


def _mpiexec() -> str:
    """Find the launcher that belongs to this environment's MPI."""
    beside = Path(sys.executable).with_name("mpiexec")
    found = str(beside) if beside.exists() else shutil.which("mpiexec")
    if found is None:
        raise InputError(f"scale: no mpiexec: {command_for('mpich')}")
    return found


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


def timed_dispatch(arguments: dict[str, int], world: farm.World) -> dict[str, float]:
    """Time as many tasks as the arguments say."""
    dispatch(8 * world.workers, world)  # the first tasks find their way
    began = time.perf_counter()
    total = dispatch(arguments["tasks"], world)
    seconds = time.perf_counter() - began
    return {"seconds": seconds, "total": total, "workers": world.workers}


if __name__ == "__main__":
    answer(timed_dispatch)
