"""Signals to a run on three ranks: it stops in order, says how to go on, and goes on."""

import signal
import subprocess
import time

import pytest
from databases import deterministic_bytes, status
from launch import TIMEOUT, command, environment, is_open_mpi, launch, mpiexec

pytestmark = [
    pytest.mark.mpi,
    pytest.mark.skipif(mpiexec() is None, reason="no mpiexec: install the extra 'mpich'"),
]

SCENE = "samples = {}\n[surface]\nnodes = 33\n"
LONG = 200_000
"""Rows of a run that is not at its end when a second process has at last started."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("interruption")
    (folder / "scene.toml").write_text(SCENE.format(1200))
    (folder / "long.toml").write_text(SCENE.format(LONG))
    done = launch(3, "run", "scene.toml", "-o", "whole.h5", folder=folder)
    assert done.returncode == 0, done.stderr
    return folder


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
    while not (folder / output).exists() or not (status(folder / output) != 0).any():
        assert time.monotonic() < limit
        assert run.poll() is None
        time.sleep(0.02)
    return run


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGUSR1])
@pytest.mark.parametrize("ranks", [0, 3])
def test_a_signal_stops_in_order_and_the_same_command_goes_on(folder, ranks, number):
    output = f"{ranks}-{number}.h5"
    run = start(folder, ranks, output)
    run.send_signal(number)
    out, err = run.communicate(timeout=TIMEOUT)
    assert "Traceback" not in err
    finished = status(folder / output) != 0
    assert 0 < finished.sum() < 1200
    if ranks and number != signal.SIGUSR1 and is_open_mpi():  # it may kill before all is in order
        assert run.returncode
    else:
        assert run.returncode == 128 + number, err
        assert f"stopped by {number.name}; the same command goes on" in out
        assert not (folder / f"{output}.lock").exists()
    again = launch(ranks, "run", "scene.toml", "-o", output, folder=folder)
    assert again.returncode == 0, again.stderr
    assert f"{1200 - finished.sum()} to do" in again.stderr
    assert deterministic_bytes(folder / output) == deterministic_bytes(folder / "whole.h5")


def test_a_second_writer_is_refused_and_readers_are_welcome(folder):
    run = start(folder, 3, "busy.h5", "long.toml")
    try:
        second = launch(0, "run", "long.toml", "-o", "busy.h5", folder=folder)
        reader = launch(0, "info", "busy.h5", folder=folder)
    finally:
        run.send_signal(signal.SIGTERM)
        run.communicate(timeout=TIMEOUT)
    assert second.returncode == 2
    assert "is being written by host" in second.stderr
    assert second.stderr.count("\n") == 1
    assert reader.returncode == 0, reader.stderr
    assert "pending" in reader.stdout


def test_the_lock_does_not_outlive_a_killed_run(folder):
    run = start(folder, 0, "killed.h5")
    run.kill()
    run.communicate(timeout=TIMEOUT)
    again = launch(0, "run", "scene.toml", "-o", "killed.h5", folder=folder)
    assert again.returncode == 0, again.stderr
    assert deterministic_bytes(folder / "killed.h5") == deterministic_bytes(folder / "whole.h5")


@pytest.mark.parametrize("delay", [0.1, 0.5, 0.9, 1.3])
def test_an_early_signal_leaves_no_rank_waiting(folder, delay):
    run = subprocess.Popen(
        command(3, "run", "scene.toml", "-o", f"early-{delay}.h5"),
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
    again = launch(3, "run", "scene.toml", "-o", f"early-{delay}.h5", folder=folder)
    assert again.returncode == 0, again.stderr
