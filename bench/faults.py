"""Kill runs at random moments and see whether anything is lost, wrong or done twice.

Each round starts or continues a database, ends one of its processes after a random time, and looks
at the file with h5py alone: it has to open, every finished row has to have the bytes of an
undisturbed run, and what was finished before must not have been computed again, which its recorded
times would show.
"""

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gen.database import Reader
from gen.errors import InputError
from gen.lock import lock
from gen.schema import COLUMNS, Status

SCENE = """samples = {samples}
samples_per_surface = 2
[surface]
nodes = 33
"""
SAMPLES = 3000
"""Rows of a campaign's database: some seconds of work, so that most kills come in its midst."""

VICTIMS = ("serial", "worker", "master", "mpiexec")
LISTENING = ("serial", "master", "mpiexec")
"""Victims that heed SIGTERM and SIGINT: workers leave that to the master."""

RANKS = ("PMI_RANK", "OMPI_COMM_WORLD_RANK")
"""Variables in which MPICH and Open MPI tell a process its rank."""

SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT)
TIMEOUT = 120.0
"""Seconds after which a run counts as hanging."""

Columns = dict[str, NDArray[Any]]


@dataclass(frozen=True)
class Round:
    """One interrupted run.

    Attributes
    ----------
    victim : which process was ended: alone, a worker, the master, or the launcher
    signal : name of the signal
    delay : from the start of the run to the signal [s]
    before, after : finished rows
    code : exit code of the run
    fault : what was wrong, "" if nothing was
    """

    victim: str
    signal: str
    delay: float
    before: int
    after: int
    code: int
    fault: str


def campaign(folder: Path, rounds: int, seed: int = 0, samples: int = SAMPLES) -> list[Round]:
    """Interrupt runs until all rounds are through; finished databases are begun anew.

    Parameters
    ----------
    folder : an empty folder to work in
    rounds : number of interruptions
    seed : of victims, signals and moments
    samples : rows of the database

    Returns
    -------
    All rounds, with their faults
    """
    random = np.random.default_rng(seed)
    (folder / "scene.toml").write_text(SCENE.format(samples=samples))
    began = time.monotonic()
    _run(folder, _command(0, "reference.h5"))
    undisturbed = time.monotonic() - began
    reference = _columns(folder / "reference.h5")
    path = folder / "disturbed.h5"
    results: list[Round] = []
    while len(results) < rounds:
        before = _columns(path) if path.exists() else None
        if before is not None and (before["status"] != Status.PENDING).all():
            path.unlink()
            before = None
        victim = str(random.choice(VICTIMS))
        signals = SIGNALS if victim in LISTENING else (signal.SIGKILL,)
        number = int(random.choice(signals))
        delay = float(random.uniform(0.2, 0.8 * undisturbed))
        code = _interrupt(folder, victim, number, delay)
        fault = _fault(path, before, reference, number, code)
        results.append(
            Round(
                victim,
                signal.Signals(number).name,
                delay,
                _finished(before),
                _finished(_columns(path) if path.exists() else None),
                code,
                fault,
            )
        )
    return [*results, *_completed(folder, path, reference)]


def _completed(folder: Path, path: Path, reference: Columns) -> Iterator[Round]:
    """Let the last database finish; it has to equal the undisturbed one."""
    before = _columns(path) if path.exists() else None
    code = _run(folder, _command(0, path.name))
    after = _columns(path)
    fault = _fault(path, before, reference, 0, code)
    if not fault and not all(
        after[name].tobytes() == reference[name].tobytes() for name in _deterministic(reference)
    ):
        fault = "the finished database differs from the undisturbed one"
    yield Round("nobody", "", 0.0, _finished(before), _finished(after), code, fault)


def _fault(path: Path, before: Columns | None, reference: Columns, number: int, code: int) -> str:
    """What is wrong with the file that an interrupted run has left."""
    if not path.exists():
        return "" if before is None else "the database has vanished"
    now = _columns(path)
    return _row_fault(now, before, reference) or _code_fault(now, before, number, code)


def _row_fault(now: Columns, before: Columns | None, reference: Columns) -> str:
    """What is wrong with the finished rows."""
    done = now["status"] != Status.PENDING
    for name in _deterministic(now):
        if now[name][done].tobytes() != reference[name][done].tobytes():
            return f"a finished row has a wrong {name}"
    if before is not None:
        old = before["status"] != Status.PENDING
        if not done[old].all():
            return "a finished row is pending again"
        if now["solve_seconds"][old].tobytes() != before["solve_seconds"][old].tobytes():
            return "a finished row was computed again"
    return ""


def _code_fault(now: Columns, before: Columns | None, number: int, code: int) -> str:
    """What is wrong with the way the run ended."""
    if code in {1, 2} and code != number:  # a launcher reports a signal by its number
        return f"the run ended by itself with exit code {code}"
    listening = _finished(now) > _finished(before)  # earlier, a signal ends a run as it ends any
    if listening and number in {signal.SIGTERM, signal.SIGINT} and code not in {0, 128 + number}:
        return f"exit code {code} after {signal.Signals(number).name}"
    return ""


def _columns(path: Path) -> Columns:
    """All columns of a database, into memory."""
    with Reader(path) as reader:
        return {column.name: reader.column(column.name) for column in reader.columns()}


def _deterministic(columns: Columns) -> list[str]:
    deterministic = {column.name for column in COLUMNS if column.deterministic}
    return [name for name in columns if name in deterministic]


def _finished(columns: Columns | None) -> int:
    return 0 if columns is None else int(np.count_nonzero(columns["status"] != Status.PENDING))


def _command(ranks: int, output: str) -> list[str]:
    """The command that makes a database, alone or on several ranks."""
    run = ["-m", "gen", "run", "scene.toml", "-o", output]
    if not ranks:
        return [sys.executable, *run]
    beside = Path(sys.executable).with_name("mpiexec")
    launcher = str(beside) if beside.exists() else shutil.which("mpiexec")
    if launcher is None:
        raise FileNotFoundError("no mpiexec: install the extra 'mpich'")
    return [launcher, "-n", str(ranks), sys.executable, "-m", "mpi4py", *run]


def _run(folder: Path, command: list[str]) -> int:
    done = subprocess.run(command, cwd=folder, capture_output=True, timeout=TIMEOUT, check=False)
    return done.returncode


def _interrupt(folder: Path, victim: str, number: int, delay: float) -> int:
    """Run until the delay has passed, end the victim, wait for the rest; return the exit code."""
    command = _command(0 if victim == "serial" else 3, "disturbed.h5")
    with subprocess.Popen(
        command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    ) as run:
        time.sleep(delay)
        target = _process(run.pid, victim)
        while target is None and run.poll() is None:  # ranks take a moment to start
            time.sleep(0.02)
            target = _process(run.pid, victim)
        if target is not None and run.poll() is None:
            os.kill(target, number)
        code = run.wait(timeout=TIMEOUT)
    _await_lock(folder / "disturbed.h5")
    return code


def _await_lock(path: Path) -> None:
    """Wait for ranks that outlive their killed launcher for a moment, and rightly keep the lock."""
    limit = time.monotonic() + TIMEOUT
    while True:
        try:
            with lock(path):
                return
        except InputError:
            if time.monotonic() > limit:
                raise
            time.sleep(0.05)


def _process(launched: int, victim: str) -> int | None:
    """The victim's process id; None if it has not started yet."""
    if victim in {"serial", "mpiexec"}:
        return launched
    rank = "0" if victim == "master" else "1"
    for process in _descendants(launched):
        try:
            environment = Path(f"/proc/{process}/environ").read_bytes().split(b"\0")
        except OSError:
            continue
        if {f"{name}={rank}".encode() for name in RANKS} & set(environment):
            return process
    return None


def _descendants(ancestor: int) -> Iterator[int]:
    """All processes that a process has started, directly or through others."""
    parents: dict[int, list[int]] = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdecimal():
            try:
                fields = (entry / "stat").read_text().rpartition(")")[2].split()
            except OSError:
                continue
            parents.setdefault(int(fields[1]), []).append(int(entry.name))
    waiting = [ancestor]
    while waiting:
        children = parents.get(waiting.pop(), [])
        yield from children
        waiting += children
