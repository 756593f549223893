"""Disturbances by signals: runs that are killed, asked to stop, or held up."""

import signal
import time
from signal import SIGCONT, SIGINT, SIGKILL, SIGSTOP, SIGTERM, SIGUSR1

from tests.faults.rows import count_finished, difference
from tests.faults.runs import await_lock
from tests.faults.stage import RANKS, Found, Stage, code_fault

ALONE = "alone"

VICTIMS = {
    "alone": "launcher",
    "mpiexec": "launcher",
    "master": "0",
    "worker": "1",
    "everybody": "everybody",
}
"""The victims, and who they are in a `Run`."""

STOPPED = (0.5, 2.5)
"""How long a worker is held up [s]."""


def kill_alone(stage: Stage) -> Found:
    """SIGKILL to a run without MPI."""
    return _signalled(stage, SIGKILL, ("alone",))


def kill_worker(stage: Stage) -> Found:
    """SIGKILL to a worker."""
    return _signalled(stage, SIGKILL, ("worker",))


def kill_master(stage: Stage) -> Found:
    """SIGKILL to the master."""
    return _signalled(stage, SIGKILL, ("master",))


def kill_launcher(stage: Stage) -> Found:
    """SIGKILL to mpiexec."""
    return _signalled(stage, SIGKILL, ("mpiexec",))


def interrupt(stage: Stage) -> Found:
    """SIGINT: Ctrl-C."""
    return _signalled(stage, SIGINT, tuple(VICTIMS))


def terminate(stage: Stage) -> Found:
    """SIGTERM: the end of a batch job."""
    return _signalled(stage, SIGTERM, tuple(VICTIMS))


def warn(stage: Stage) -> Found:
    """SIGUSR1: a batch job's warning before its time limit."""
    return _signalled(stage, SIGUSR1, tuple(VICTIMS))


def stop_worker(stage: Stage) -> Found:
    """SIGSTOP to a worker and, after a while, SIGCONT: the run is held up and nothing else."""
    held = float(stage.random.uniform(*STOPPED))
    with stage.run(RANKS) as run:
        stage.await_moment(run)
        hit = run.send("1", SIGSTOP)
        time.sleep(held)
        began = time.monotonic()
        run.send("1", SIGCONT)
        ended = run.wait()
        seconds = time.monotonic() - began
    fault = (
        f"exit code {ended.code}" if ended.code else difference(stage.columns(), stage.reference)
    )
    return Found(f"worker for {held:.1f} s", fault, hit, seconds)


def _signalled(stage: Stage, number: signal.Signals, victims: tuple[str, ...]) -> Found:
    """Send a signal at a random moment, and wait for the end."""
    victim = str(stage.random.choice(victims))
    before = count_finished(stage.columns())
    with stage.run(0 if victim == ALONE else RANKS) as run:
        stage.await_moment(run)
        at_work = count_finished(stage.columns()) > before
        hit = run.send(VICTIMS[victim], number)
        began = time.monotonic()
        ended = run.wait()
        await_lock(stage.path)
        seconds = time.monotonic() - began
    fault = code_fault(ended, stage.columns())
    # After its last row a run is on its way out, and a signal ends it as it ends any process.
    if hit and at_work and not fault and len(stage.pending()):
        fault = _answer_fault(victim, number, ended.code)
    return Found(f"{number.name} to {victim}", fault, hit, seconds)


def _answer_fault(victim: str, number: signal.Signals, code: int) -> str:
    """What is wrong with the exit code of a run that was at work when the signal came."""
    if number == SIGKILL:
        return f"it ended by itself with exit code {code}" if code in {1, 2} else ""
    if victim == "everybody":  # the launcher's own helpers die of it, and take the job with them
        return ""
    # A worker leaves these signals to the master; else the run stops in order, or is just done.
    right = {0} if victim == "worker" else {0, 128 + number}
    return "" if code in right else f"exit code {code} after {number.name}"
