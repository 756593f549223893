"""Start the program as a user does: alone or under mpiexec, always with a time limit."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

TIMEOUT = 600.0
"""Seconds after which a run counts as hanging; every one here takes a few, on a quiet machine."""


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
        program = [
            launcher,
            "-n",
            str(ranks),
            sys.executable,
            "-m",
            "mpi4py",
            "-m",
            module,
        ]
    return [*program, *(str(argument) for argument in arguments)]


def environment() -> dict[str, str]:
    """The user's, less what an outer MPI or a terminal would add; a mute Open MPI, also as root."""
    outer = ("PMI", "OMPI", "PRTE", "SLURM")
    kept = {key: value for key, value in os.environ.items() if not key.startswith(outer)}
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
    return ended(command(ranks, *arguments, module=module), folder, environment())


def ended(
    words: list[str], folder: Path | None, variables: dict[str, str]
) -> subprocess.CompletedProcess[str]:
    """Run a command line to its end, in a folder and with an environment."""
    settings: dict[str, Any] = {"capture_output": True, "text": True, "timeout": TIMEOUT}
    return subprocess.run(words, cwd=folder, env=variables, check=False, **settings)


def begin(
    ranks: int, *arguments: object, folder: Path, module: str = "gen"
) -> subprocess.Popen[str]:
    """Start a run that a test disturbs; `communicate` of what it returns waits for its end."""
    return subprocess.Popen(
        command(ranks, *arguments, module=module),
        cwd=folder,
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def python(
    *words: object, folder: Path | None = None, **variables: str
) -> subprocess.CompletedProcess[str]:
    """Run this Python to its end, with further variables of the environment."""
    return ended([sys.executable, *map(str, words)], folder, os.environ | variables)


SECONDS = 120
"""Seconds after which a command line counts as hanging; each one here takes a second or two."""

WALK = """
import contextlib, faulthandler, io, json
from mpi4py import MPI
from bench import commands as bench
from gen import cli as gen
from learn import cli as learn
PROGRAMS = {"gen": gen.main, "learn": learn.main, "bench": bench.main}
world = MPI.COMM_WORLD
for program, arguments, seconds in json.load(open("walk.json")):
    faulthandler.dump_traceback_later(seconds, exit=True)
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = PROGRAMS[program](arguments)
    ends = world.gather((code, err.getvalue(), out.getvalue()))
    faulthandler.cancel_dump_traceback_later()
    if world.rank == 0:
        print(json.dumps(ends), flush=True)
"""


class End(NamedTuple):
    """How a command line ended on one rank.

    Attributes
    ----------
    code : exit code
    errors : standard error
    output : standard output
    """

    code: int
    errors: str
    output: str


def walk(ranks: int, lines: Iterable[Sequence[str]], folder: Path) -> list[list[End]]:
    """Run command lines one after the other on the same ranks.

    Parameters
    ----------
    ranks : number of ranks
    lines : command lines, the program's name (gen, learn or bench) first
    folder : where they run; the script is written into it

    Returns
    -------
    For each command line its end on every rank
    """
    listed = [(program, arguments, SECONDS) for program, *arguments in lines]
    (folder / "walk.json").write_text(json.dumps(listed))
    (folder / "walking.py").write_text(WALK)
    done = launch(ranks, folder=folder, module="walking")
    assert done.returncode == 0, f"{done.stdout[-500:]} {done.stderr[-3000:]}"
    return [[End(*end) for end in json.loads(said)] for said in done.stdout.splitlines()]
