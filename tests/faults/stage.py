"""Runs of the program as processes of their own, and the databases that campaigns disturb."""

import json
import os
import resource
import signal
import subprocess
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from gen.database import Reader
from gen.generation.plan import parameters
from gen.runtime.errors import InputError
from gen.runtime.files import lock
from gen.scene import ALL_COLUMNS, Scene
from gen.schema import Status
from tests.launch import command, environment

ROOT = Path(__file__).resolve().parents[2]

BOUND = 90.0
"""Seconds within which a run has to end once it is disturbed; undisturbed it takes a few."""

RANKS = ("PMI_RANK", "OMPI_COMM_WORLD_RANK", "PMIX_RANK")
"""Variables in which the launchers tell a process its rank."""


class Hang(Exception):
    """A run has not ended within `BOUND`."""


@dataclass(frozen=True)
class Ended:
    """How a run ended: its exit code, all that it printed, and how long it was waited for [s]."""

    code: int
    text: str
    seconds: float = 0.0


class Run:
    """A run under way, alone (no ranks) or under mpiexec; on leaving, no process is left behind."""

    def __init__(
        self, folder: Path, ranks: int, *arguments: str, module: str = "gen"
    ) -> None:
        self._log = tempfile.TemporaryFile()  # noqa: SIM115 - closed in __exit__
        # The launcher leads a session of its own: a terminal's signals are not for it.
        self._process = subprocess.Popen(
            command(ranks, *arguments, module=module),
            cwd=folder,
            env=environment() | {"PYTHONDONTWRITEBYTECODE": "1", "PYTHONPATH": str(ROOT)},
            stdin=subprocess.DEVNULL,
            stdout=self._log,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        """End every process that this run has started and that is still there."""
        if self.alive():
            self.send("everybody", signal.SIGKILL)
        self._process.wait(BOUND)
        self._log.close()

    def alive(self) -> bool:
        """Whether the launcher, or the run alone, has not ended yet."""
        return self._process.poll() is None

    def wait(self) -> Ended:
        """Wait for the end; raise `Hang` if it does not come."""
        began = time.monotonic()
        try:
            code = self._process.wait(BOUND)
        except subprocess.TimeoutExpired:
            raise Hang from None
        seconds = time.monotonic() - began
        self._log.seek(0)
        return Ended(code, self._log.read().decode(errors="replace"), seconds)

    def send(self, victim: str, number: int) -> bool:
        """Send a signal to "launcher", "everybody" or a rank; say whether it was there."""
        while (
            not (targets := self._targets(victim)) and self.alive()
        ):  # ranks take a moment
            time.sleep(0.02)
        if not self.alive():
            return False
        for target in targets:
            with suppress(ProcessLookupError):
                os.kill(target, number)
        return True

    def limit_files(self, size: int) -> bool:
        """Let no file grow or be written beyond a size [bytes], as if the disk were full there."""
        hard = resource.RLIM_INFINITY
        for process in self._targets("everybody"):
            with suppress(ProcessLookupError):
                resource.prlimit(process, resource.RLIMIT_FSIZE, (size, hard))
        return self.alive()

    def _targets(self, victim: str) -> list[int]:
        """The launcher, or it and all that it has started, or those of a rank."""
        started = [self._process.pid, *_descendants(self._process.pid)]
        if victim in {"launcher", "everybody"}:
            return started if victim == "everybody" else started[:1]
        return [process for process in started if _rank(process) == victim]


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


def _rank(process: int) -> str:
    """The rank of a process as text; "" if it has none."""
    try:
        variables = (
            Path(f"/proc/{process}/environ").read_text(errors="replace").split("\0")
        )
        executable = Path(f"/proc/{process}/comm").read_text()
    except OSError:
        return ""
    if not executable.startswith("python"):  # some launchers start a rank through a shell
        return ""
    named = (variable.partition("=") for variable in variables)
    return next((value for name, _, value in named if name in RANKS), "")


def _descendants(ancestor: int) -> Iterator[int]:
    """All processes that a process has started, directly or through others."""
    with suppress(OSError):
        for started in Path(f"/proc/{ancestor}/task").glob("*/children"):
            for child in map(int, started.read_text().split()):
                yield child
                yield from _descendants(child)


SCENE = "samples = {samples}\nsamples_per_surface = 2\n[surface]\nnodes = 17\n"
SAMPLES = 600
"""Rows of a campaign's database: some seconds of work, so that most strikes come in its midst."""

PROCESSES = 3
"""Processes of a run under mpiexec: a master and two workers."""

EARLY = 0.25
"""Share of the strikes at any moment from the start on; the others find a run at work."""

Columns = dict[str, NDArray[Any]]


@dataclass(frozen=True)
class Found:
    """What was done, what was wrong, whether it hit a run, and the seconds to its end.

    The campaign adds the kind ("" if a run was only finished), and finished rows before and after.
    """

    detail: str
    fault: str = ""
    hit: bool = True
    seconds: float = 0.0
    kind: str = ""
    before: int = 0
    after: int = 0

    def line(self) -> str:
        """The round in one line."""
        verdict = self.fault or ("ok" if self.hit or not self.kind else "came too late")
        return (
            f"{self.kind or 'nothing':24} {self.detail:32} {self.before:5} -> {self.after:5} rows,"
            f" end after {self.seconds:4.1f} s: {verdict}"
        )


class Stage:
    """A folder with a scene, the columns of an undisturbed run, and the database under attack."""

    def __init__(self, folder: Path, samples: int, random: np.random.Generator) -> None:
        self.folder, self.random = folder, random
        text = SCENE.format(samples=samples)
        (folder / "scene.toml").write_text(text)
        self.scene = Scene.parse(text, "scene.toml")
        self.path = folder / "disturbed.h5"
        with self.run(0, output="reference.h5") as run:
            ended = run.wait()
        reference = columns_of(folder / "reference.h5")
        if ended.code or reference is None:
            raise InputError(f"an undisturbed run fails: {ended.text.strip()}")
        self.reference: Columns = reference

    def pending(self) -> NDArray[np.intp]:
        """Rows that the database under attack lacks."""
        columns = columns_of(self.path)
        rows = self.scene.samples
        return np.arange(rows) if columns is None else np.flatnonzero(~finished(columns))

    def ranks(self) -> int:
        """Alone or under mpiexec, as it comes."""
        return int(self.random.choice((0, PROCESSES)))

    def run(
        self,
        ranks: int,
        *options: str,
        output: str = "disturbed.h5",
        ailments: Mapping[int, str] | None = None,
    ) -> Run:
        """Start a run; `ailments` are rows, and what they suffer from: see `program`."""
        known = {
            repr(float(parameters(self.scene, row, row + 1).load[0])): name
            for row, name in (ailments or {}).items()
        }
        (self.folder / "ailments.json").write_text(json.dumps(known))
        arguments = ("ailments.json", "run", "scene.toml", "-o", output, *options)
        return Run(self.folder, ranks, *arguments, module="tests.faults.program")

    def await_moment(self, run: Run) -> None:
        """Wait for a random moment of a run, or for its end if that is sooner."""
        if self.random.random() < EARLY:
            time.sleep(self.random.uniform(0.0, 2.0))
        else:
            share = self.random.uniform(0.0, 0.8)
            self.await_rows(run, 1 + int(share * len(self.pending())))
            time.sleep(self.random.uniform(0.0, 0.05))

    def await_rows(self, run: Run, number: int) -> None:
        """Wait until a run has finished some rows, or has ended."""
        wanted = len(self.pending()) - number
        limit = time.monotonic() + BOUND
        while run.alive() and len(self.pending()) > wanted:
            if time.monotonic() > limit:
                raise Hang
            time.sleep(0.05)


def columns_of(path: Path) -> Columns | None:
    """All columns of a database, into memory; None where there is no file yet."""
    if not path.exists():
        return None
    with Reader(path) as reader:
        return {column.name: reader.column(column.name) for column in reader.columns()}


def finished(columns: Columns | None) -> NDArray[np.bool_]:
    """(rows,) whether a row is done or failed; no rows in no file."""
    if columns is None:
        return np.zeros(0, dtype=bool)
    return np.asarray(columns["status"] != Status.PENDING)


def row_fault(
    before: Columns | None,
    now: Columns | None,
    reference: Columns,
    failed: Mapping[int, int] | None = None,
) -> str:
    """What is wrong with the finished rows of a database after a disturbance, "" if nothing is.

    `failed` are the rows that have to have failed, and the code of the reason that they give.
    """
    if now is None:
        return "" if before is None else "the database has vanished"
    expected = failed or {}
    for row, reason in expected.items():
        if (now["status"][row], now["reason"][row]) != (Status.FAILED, reason):
            return f"row {row} should have failed for reason {reason}"
    done = finished(now)
    done[list(expected)] = False
    for name in (column.name for column in ALL_COLUMNS if column.deterministic):
        if name in now and now[name][done].tobytes() != reference[name][done].tobytes():
            return f"a finished row has a wrong {name}"
    if before is not None:
        old = finished(before)
        if not finished(now)[old].all():
            return "a finished row is pending again"
        if now["solve_seconds"][old].tobytes() != before["solve_seconds"][old].tobytes():
            return "a finished row was computed again"
    return ""


def difference(now: Columns | None, reference: Columns) -> str:
    """How a finished database differs from the undisturbed one, "" if it does not."""
    if now is None or not finished(now).all():
        return "the database that should be finished has pending rows"
    return row_fault(None, now, reference)


def code_fault(ended: Ended, now: Columns | None) -> str:
    """What is wrong with an exit code and a text, whatever has happened."""
    if ended.code == 0 and (now is None or not finished(now).all()):
        return "exit code 0 although rows are pending"
    if ended.code == 2 and "Traceback" in ended.text:
        return "a traceback in place of one clear line"
    return ""


def refusal_fault(ended: Ended, words: str) -> str:
    """What is wrong with the way in which a run refused: exit code 2 and one line, these words."""
    lines = [line for line in ended.text.splitlines() if line.startswith("gen: ")]
    if ended.code != 2:
        return f"exit code {ended.code} in place of a refusal"
    if len(lines) != 1 or "Traceback" in ended.text:
        return "a refusal that is not one clear line"
    return "" if words in lines[0] else f"a refusal without {words!r}: {lines[0]}"
