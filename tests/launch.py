"""Start the program as a user does: alone or under mpiexec, always with a time limit."""

import os
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path

TIMEOUT = 120.0
"""Seconds after which a run counts as hanging; every one here takes a few."""


def mpiexec() -> str | None:
    """The launcher that belongs to this environment's MPI."""
    beside = Path(sys.executable).with_name("mpiexec")
    return str(beside) if beside.exists() else shutil.which("mpiexec")


@cache
def is_open_mpi() -> bool:
    """Whether the launcher is Open MPI, which kills its ranks 1 s after a SIGTERM or SIGINT."""
    version = [str(mpiexec()), "--version"]
    told = subprocess.run(version, capture_output=True, text=True, check=True).stdout
    return "Open MPI" in told or "OpenRTE" in told


def command(ranks: int, *arguments: object, module: str = "gen") -> list[str]:
    """`python -m gen ...` on one process (ranks = 0, without MPI) or under mpiexec."""
    program = [sys.executable, "-m", module]
    if ranks:
        launcher = mpiexec()
        assert launcher is not None
        program = [launcher, "-n", str(ranks), sys.executable, "-m", "mpi4py", "-m", module]
    return [*program, *(str(argument) for argument in arguments)]


def environment() -> dict[str, str]:
    """The user's, less what an outer MPI or a terminal would add; a mute Open MPI, also as root."""
    kept = {key: value for key, value in os.environ.items() if not key.startswith(("PMI", "OMPI"))}
    return kept | {
        "COLUMNS": "200",
        "OMPI_ALLOW_RUN_AS_ROOT": "1",
        "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
        "OMPI_MCA_orte_execute_quiet": "1",
        "OMPI_MCA_rmaps_base_oversubscribe": "1",
        "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
    }


def launch(
    ranks: int, *arguments: object, folder: Path, module: str = "gen"
) -> subprocess.CompletedProcess[str]:
    """Run to the end; a run that hangs raises TimeoutExpired."""
    return subprocess.run(
        command(ranks, *arguments, module=module),
        cwd=folder,
        env=environment(),
        capture_output=True,
        text=True,
        timeout=TIMEOUT,
        check=False,
    )
