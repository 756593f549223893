"""Signals to a run on three ranks: it stops in order, says how to go on, and goes on."""

import signal
import subprocess
import time

import pytest
from databases import deterministic_bytes, has_begun, status
from launch import TIMEOUT, command, environment, is_open_mpi, mpiexec

from gen import cli

pytestmark = [
    pytest.mark.mpi,
    pytest.mark.skipif(mpiexec() is None, reason="no mpiexec: install the extra 'mpich'"),
]

SCENE = "samples = {}\n[surface]\nnodes = 33\n"
ROWS = 2000
"""Rows of a run that is not at its end when its signal comes, on a machine that is busy too."""

SHORT = 300
"""Rows of a run that is soon done, wherever in its start a signal has met it."""

LONG = 200_000
"""Rows of a run that is not at its end when a second process has at last started."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with the scenes, and a database that a serial run has made undisturbed."""
    folder = tmp_path_factory.mktemp("interruption")
    for name, samples in (("scene", ROWS), ("short", SHORT), ("long", LONG)):
        (folder / f"{name}.toml").write_text(SCENE.format(samples))
    assert run_here(folder, "scene", "whole.h5") == 0
    return folder


def run_here(folder, scene, output):
    """Run a scene, or go on with it, in this process; return the exit code."""
    return cli.main(["run", str(folder / f"{scene}.toml"), "-o", str(folder / output)])


def go_on_here(folder, scene, output):
    """Go on in this process, once the last rank is gone: Open MPI's launcher ends before it."""
    limit = time.monotonic() + TIMEOUT
    while (code := run_here(folder, scene, output)) == 2 and time.monotonic() < limit:
        time.sleep(0.2)
    return code


def start(folder, ranks, output, scene="scene.toml"):
    """A run that is surely in its midst: some rows are finished, others are not."""
    run = subprocess.Popen(
        command(ranks, "run", scene, "-o", output),
        cwd=folder,
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    limit = time.monotonic() + TIMEOUT
    while not has_begun(folder / output):
        assert time.monotonic() < limit
        assert run.poll() is None
        time.sleep(0.02)
    return run


@pytest.mark.parametrize(
    ("ranks", "number"),
    [
        (3, signal.SIGTERM),
        *(
            pytest.param(*case, marks=pytest.mark.long)
            for case in ((0, signal.SIGINT), (0, signal.SIGUSR1), (3, signal.SIGINT))
        ),
    ],
)
def test_a_signal_stops_in_order_and_the_same_command_goes_on(folder, ranks, number, capsys):
    output = f"{ranks}-{number}.h5"
    run = start(folder, ranks, output)
    run.send_signal(number)
    out, err = run.communicate(timeout=TIMEOUT)
    assert "Traceback" not in err
    finished = status(folder / output) != 0
    assert 0 < finished.sum() < ROWS
    if ranks and number != signal.SIGUSR1 and is_open_mpi():  # it may kill before all is in order
        assert run.returncode
    else:
        assert run.returncode == 128 + number, err
        assert f"stopped by {number.name}; the same command goes on" in out
        assert not (folder / f"{output}.lock").exists()
    # Any number of ranks goes on with the rows of any other: here one, without a new start.
    assert go_on_here(folder, "scene", output) == 0
    said = capsys.readouterr().err
    assert f"{ROWS - finished.sum()} to do" in said
    assert deterministic_bytes(folder / output) == deterministic_bytes(folder / "whole.h5")


def test_a_second_writer_is_refused_and_readers_are_welcome(folder, capsys):
    run = start(folder, 3, "busy.h5", "long.toml")
    try:
        assert run_here(folder, "long", "busy.h5") == 2
        refusal = capsys.readouterr().err
        assert cli.main(["info", str(folder / "busy.h5")]) == 0
    finally:
        run.send_signal(signal.SIGTERM)
        run.communicate(timeout=TIMEOUT)
    assert "is being written by host" in refusal
    assert refusal.count("\n") == 1
    assert "pending" in capsys.readouterr().out


def test_the_lock_does_not_outlive_a_killed_run(folder):
    run = start(folder, 0, "killed.h5")
    run.kill()
    run.communicate(timeout=TIMEOUT)
    assert run_here(folder, "scene", "killed.h5") == 0
    assert deterministic_bytes(folder / "killed.h5") == deterministic_bytes(folder / "whole.h5")


@pytest.mark.long
@pytest.mark.parametrize("delay", [0.1, 0.5, 0.9, 1.3])
def test_an_early_signal_leaves_no_rank_waiting(folder, delay):
    run = subprocess.Popen(
        command(3, "run", "short.toml", "-o", f"early-{delay}.h5"),
        cwd=folder,
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    time.sleep(delay)
    run.send_signal(signal.SIGINT)
    try:
        run.communicate(timeout=30)
    finally:
        run.kill()
    assert go_on_here(folder, "short", f"early-{delay}.h5") == 0
