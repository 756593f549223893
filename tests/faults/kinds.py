"""The kinds of disturbances: signals, disks and files, samples that ail."""

import shutil
import signal
import time
from collections.abc import Callable
from functools import partial

import numpy as np

from gen.scene import row_bytes
from gen.schema import Reason
from tests.faults.stage import (
    PROCESSES,
    Found,
    Stage,
    await_lock,
    code_fault,
    columns_of,
    difference,
    finished,
    is_locked,
    refusal_fault,
    row_fault,
)

VICTIMS = {"alone": "launcher", "mpiexec": "launcher", "master": "0", "worker": "1"}
VICTIMS |= {"everybody": "everybody"}
"""The victims of signals, and who they are in a `Run`."""

HELD = (0.5, 2.5)
"""How long a worker is held up [s]."""

SMALLEST = 64 * 1024
"""Smallest limit on the size of files: below it, the run could not even write down its output."""


AILING = 3
"""Samples that ail in one run, at most."""

FAILURES = {
    "raises": Reason.ARITHMETIC,
    "returns_nan": Reason.NOT_FINITE,
    "does_not_converge": Reason.NOT_CONVERGED,
}
"""Ailments of samples that fail, and the reason that their rows give."""


def signalled(number: signal.Signals, victims: tuple[str, ...], stage: Stage) -> Found:
    """Send a signal to one of the victims at a random moment, and wait for the end."""
    victim = str(stage.random.choice(victims))
    before = int(finished(columns_of(stage.path)).sum())
    with stage.run(0 if victim == "alone" else PROCESSES) as run:
        stage.await_moment(run)
        at_work = int(finished(columns_of(stage.path)).sum()) > before
        hit = run.send(VICTIMS[victim], number)
        ended = run.wait()
        await_lock(stage.path)
    fault = code_fault(ended, columns_of(stage.path))
    # After its last row a run is on its way out, and a signal ends it as it ends any process.
    if hit and at_work and not fault and len(stage.pending()):
        # A worker leaves these signals to the master; else the run stops in order, or is just done.
        right = {0} if victim == "worker" else {0, 128 + number}
        if number == signal.SIGKILL:
            wrong = ended.code in {1, 2}  # it has ended by itself
        else:  # helpers of a launcher die of what everybody gets, and take the job with them
            wrong = victim != "everybody" and ended.code not in right
        fault = f"exit code {ended.code} after {number.name}" if wrong else ""
    return Found(f"{number.name} to {victim}", fault, hit, ended.seconds)


def worker_held_up(stage: Stage) -> Found:
    """SIGSTOP to a worker and, after a while, SIGCONT: the run is held up and nothing else."""
    held = float(stage.random.uniform(*HELD))
    with stage.run(PROCESSES) as run:
        stage.await_moment(run)
        hit = run.send("1", signal.SIGSTOP)
        time.sleep(held)
        run.send("1", signal.SIGCONT)
        ended = run.wait()
    fault = f"exit code {ended.code}" if ended.code else ""
    fault = fault or difference(columns_of(stage.path), stage.reference)
    return Found(f"worker for {held:.1f} s", fault, hit, ended.seconds)


def files_may_not_grow(stage: Stage) -> Found:
    """From a random moment on, no file may grow beyond a size: for a run, the disk is full."""
    rows = stage.scene.samples * row_bytes(stage.scene)
    size = int(stage.random.integers(SMALLEST, max(rows, SMALLEST + 1)))
    ranks = stage.ranks()
    with stage.run(ranks) as run:
        if ranks:  # MPI needs room for its own files until it has started
            stage.await_rows(run, 1)
        stage.await_moment(run)
        hit = run.limit_files(size)
        ended = run.wait()
        await_lock(stage.path)
    hit = hit and ended.code != 0
    fault = code_fault(ended, columns_of(stage.path))
    if hit and not fault:
        fault = refusal_fault(ended, "disk is full")
    return Found(f"beyond {size} bytes", fault, hit, ended.seconds)


def file_replaced(stage: Stage) -> Found:
    """Another file takes the name of the database under a run: it ends, and says so."""
    with stage.run(stage.ranks()) as run:
        stage.await_rows(run, 1)
        run.send("everybody", signal.SIGSTOP)
        hit = is_locked(stage.path)
        complete = not len(stage.pending())
        if hit:
            copy = stage.folder / "copy.h5"
            shutil.copyfile(stage.path, copy)
            copy.replace(stage.path)
        run.send("everybody", signal.SIGCONT)
        ended = run.wait()
    fault = ""
    if hit and not (
        complete and ended.code == 0
    ):  # after its last row, nothing is missing
        fault = refusal_fault(ended, "replaced by another file")
    return Found("", fault, hit, ended.seconds)


def samples_fail(stage: Stage) -> Found:
    """Samples fail; they say why, and are computed again when that is asked for."""
    ailment = str(stage.random.choice(list(FAILURES)))
    pending, before = stage.pending(), columns_of(stage.path)
    number = min(int(stage.random.integers(1, AILING, endpoint=True)), len(pending))
    rows = [
        int(row) for row in np.sort(stage.random.choice(pending, number, replace=False))
    ]
    with stage.run(stage.ranks(), ailments=dict.fromkeys(rows, ailment)) as run:
        ended = run.wait()
    now = columns_of(stage.path)
    if ended.code or not finished(now).all():
        fault = f"exit code {ended.code}, or pending rows, because of failed samples"
    else:
        failed = dict.fromkeys(rows, int(FAILURES[ailment]))
        fault = row_fault(before, now, stage.reference, failed)
    with stage.run(stage.ranks(), "--retry-failed") as run:
        again = run.wait()
    if not fault and again.code:
        fault = f"exit code {again.code} of --retry-failed"
    fault = fault or difference(columns_of(stage.path), stage.reference)
    return Found(f"{ailment}, rows {rows}", fault, seconds=ended.seconds)


KINDS: dict[str, Callable[[Stage], Found]] = {
    "SIGKILL to a run alone": partial(signalled, signal.SIGKILL, ("alone",)),
    "SIGKILL to a worker": partial(signalled, signal.SIGKILL, ("worker",)),
    "SIGKILL to the master": partial(signalled, signal.SIGKILL, ("master",)),
    "SIGKILL to mpiexec": partial(signalled, signal.SIGKILL, ("mpiexec",)),
    "SIGTERM": partial(signalled, signal.SIGTERM, tuple(VICTIMS)),
    "SIGINT": partial(signalled, signal.SIGINT, tuple(VICTIMS)),
    "SIGUSR1": partial(signalled, signal.SIGUSR1, tuple(VICTIMS)),
    "SIGSTOP, then SIGCONT": worker_held_up,
    "files may not grow": files_may_not_grow,
    "file replaced": file_replaced,
    "samples fail": samples_fail,
}
"""The kinds of disturbances, by the names in the report."""
