"""Runs of the program as processes of their own: started, watched, disturbed, bounded."""

import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from gen.runtime.errors import InputError
from gen.runtime.files import lock

BOUND = 90.0
"""Seconds within which a run has to end once it is disturbed; undisturbed it takes a few."""

RANKS = ("PMI_RANK", "OMPI_COMM_WORLD_RANK", "PMIX_RANK")
"""Variables in which the launchers tell a process its rank."""

PROGRAM = ("-m", "gen")

ENVIRONMENT = {
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    "OMPI_MCA_rmaps_base_oversubscribe": "1",
    "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
    "PYTHONDONTWRITEBYTECODE": "1",
    "PYTHONPATH": str(Path(__file__).resolve().parents[2]),
}
"""Open MPI as root and on few cores; nothing is written but the database."""


class Hang(Exception):
    """A run has not ended within `BOUND`."""


@dataclass(frozen=True)
class Ended:
    """How a run ended: its exit code and all that it printed."""

    code: int
    text: str


class Run:
    """A run under way, alone (no ranks) or under mpiexec; on leaving, no process is left behind."""

    def __init__(
        self, folder: Path, ranks: int, *arguments: str, program: tuple[str, ...] = PROGRAM
    ) -> None:
        self._log = tempfile.TemporaryFile()  # noqa: SIM115 - closed in __exit__
        # The launcher leads a session of its own: a terminal's signals are not for it.
        self._process = subprocess.Popen(
            [*_launcher(ranks), *program, *arguments],
            cwd=folder,
            env=_environment(),
            stdin=subprocess.DEVNULL,
            stdout=self._log,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )

    def __enter__(self) -> Self:
        """Leave the block to end what has not ended."""
        return self

    def __exit__(self, *error: object) -> None:
        """End every process that this run has started and that is still there."""
        if self.alive():
            for process in self.processes():
                with suppress(ProcessLookupError):
                    os.kill(process, signal.SIGKILL)
        self._process.wait(BOUND)
        self._log.close()

    def alive(self) -> bool:
        """Whether the launcher, or the run alone, has not ended yet."""
        return self._process.poll() is None

    def wait(self) -> Ended:
        """Wait for the end; raise `Hang` if it does not come."""
        try:
            code = self._process.wait(BOUND)
        except subprocess.TimeoutExpired:
            raise Hang from None
        self._log.seek(0)
        return Ended(code, self._log.read().decode(errors="replace"))

    def send(self, victim: str, number: int) -> bool:
        """Send a signal; say whether the victim was there to get it.

        The victim is "launcher" (which a run alone is, too), "everybody", or a rank as text.
        """
        targets = self._targets(victim)
        while not targets and self.alive():  # ranks take a moment to start
            time.sleep(0.02)
            targets = self._targets(victim)
        if not self.alive():
            return False
        for target in targets:
            with suppress(ProcessLookupError):
                os.kill(target, number)
        return True

    def limit_files(self, size: int) -> bool:
        """Let no file grow or be written beyond a size [bytes], as if the disk were full there."""
        hard = resource.RLIM_INFINITY
        for process in self.processes():
            with suppress(ProcessLookupError):
                resource.prlimit(process, resource.RLIMIT_FSIZE, (size, hard))
        return self.alive()

    def processes(self) -> list[int]:
        """The launcher and all that it has started."""
        return [self._process.pid, *_descendants(self._process.pid)]

    def _targets(self, victim: str) -> list[int]:
        if victim == "launcher":
            return [self._process.pid]
        if victim == "everybody":
            return self.processes()
        return [process for process in self.processes() if _rank(process) == victim]


def await_lock(path: Path) -> None:
    """Wait for ranks that outlive their killed launcher for a moment, and rightly keep the lock."""
    limit = time.monotonic() + BOUND
    while is_locked(path):
        if time.monotonic() > limit:
            raise Hang
        time.sleep(0.05)


def is_locked(path: Path) -> bool:
    """Whether some process holds the right to write a database."""
    try:
        with lock(path):
            return False
    except InputError:
        return True


def _launcher(ranks: int) -> list[str]:
    """The start of a command: Python, under mpiexec if there are to be ranks."""
    if not ranks:
        return [sys.executable]
    beside = Path(sys.executable).with_name("mpiexec")
    launcher = str(beside) if beside.exists() else shutil.which("mpiexec")
    if launcher is None:
        raise InputError("no mpiexec; install the extra 'mpich'")
    return [launcher, "-n", str(ranks), sys.executable, "-m", "mpi4py"]


def _environment() -> dict[str, str]:
    """The user's, less what an outer MPI would add."""
    prefixes = ("PMI", "OMPI", "PRTE", "SLURM")
    kept = {key: value for key, value in os.environ.items() if not key.startswith(prefixes)}
    return kept | ENVIRONMENT


def _rank(process: int) -> str:
    """The rank of a process as text; "" if it has none."""
    try:
        variables = Path(f"/proc/{process}/environ").read_text(errors="replace").split("\0")
        executable = Path(f"/proc/{process}/comm").read_text()
    except OSError:
        return ""
    if not executable.startswith("python"):  # some launchers start a rank through a shell
        return ""
    named = (variable.partition("=") for variable in variables)
    return next((value for name, _, value in named if name in RANKS), "")


def _descendants(ancestor: int) -> Iterator[int]:
    """All processes that a process has started, directly or through others."""
    parents: dict[int, list[int]] = {}
    for entry in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            fields = (entry / "stat").read_text().rpartition(")")[2].split()
            parents.setdefault(int(fields[1]), []).append(int(entry.name))
    waiting = [ancestor]
    while waiting:
        children = parents.get(waiting.pop(), [])
        yield from children
        waiting += children
