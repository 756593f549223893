"""Programs of this package under mpiexec, each with a time limit: how they start and answer."""

import json
import os
import shutil
import subprocess
import sys
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
