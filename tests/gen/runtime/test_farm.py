"""The serial side of the farm's contract, signals that stop a run, and alarms that end a sample.

tests/mpi has the same for several ranks.
"""

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from databases import deterministic_bytes, status
from launch import environment, python

import bem
from gen import cli
from gen.generation.plan import parameters
from gen.generation.sample import compute_rows
from gen.runtime import farm
from gen.runtime.errors import InputError
from gen.runtime.farm import Interruption, Overtime, time_limit
from gen.scene import load
from gen.schema import Status


def test_every_task_is_done_once_and_drawn_lazily():
    drawn, done = [], []

    def tasks():
        for task in range(5):
            drawn.append(task)
            assert len(drawn) == len(done) + 1
            yield task

    farm.run(lambda task: task**2, tasks(), lambda *pair: done.append(pair), farm.World())
    assert done == [(task, task**2) for task in range(5)]


def test_stopping_ends_before_the_next_task():
    done = []
    farm.run(
        lambda task: task,
        iter(range(100)),
        lambda task, _: done.append(task),
        farm.World(),
        stopping=lambda: len(done) >= 3,
    )
    assert done == [0, 1, 2]


def test_the_world_is_one_process_unless_a_launcher_says_otherwise(monkeypatch):
    for name in farm.LAUNCHERS:
        monkeypatch.delenv(name, raising=False)
    for name in [name for name in sys.modules if name.partition(".")[0] == "mpi4py"]:
        monkeypatch.delitem(sys.modules, name)
    assert farm.this_world() == farm.World(0, 1, None)
    assert "mpi4py" not in sys.modules


def test_a_launcher_without_mpi4py_is_one_clear_line(monkeypatch):
    monkeypatch.setitem(os.environ, "PMI_SIZE", "2")
    monkeypatch.setitem(sys.modules, "mpi4py", None)
    with pytest.raises(InputError, match=r"to bring one along .*\[mpich\]") as caught:
        farm.this_world()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("environment", "name"),
    [
        ({"PMI_SIZE": "many"}, "PMI_SIZE"),
        ({"PMI_SIZE": "2", "PMI_FD": "977"}, "PMI_FD"),
        ({"PMI_SIZE": "2", "PMI_FD": "x"}, "PMI_FD"),
        ({"PMIX_RANK": "0"}, "PMIX_RANK"),
    ],
)
def test_variables_of_no_launcher_are_named(environment, name, monkeypatch):
    for variable in ("PMI_SIZE", "PMI_FD", "PMIX_RANK", "PMIX_NAMESPACE"):
        monkeypatch.delenv(variable, raising=False)
    for variable, value in environment.items():
        monkeypatch.setenv(variable, value)
    with pytest.raises(InputError, match=f"^{name} = .* to run alone: unset {name}$"):
        farm.this_world()


@pytest.mark.parametrize(
    ("arguments", "rank", "code", "words"),
    [
        (["gen", "--help"], 0, 0, "Usage: asperity gen"),
        (["gen", "run", "--help"], 0, 0, "Usage: asperity gen run"),
        (["gen", "columns"], 1, 0, ""),
        (["gen", "run", "quick", "-o", "rows.h5"], 0, 2, "a launcher that speaks PMIx"),
    ],
)
def test_an_mpi_that_would_end_the_process_is_not_started(
    tmp_path, arguments, rank, code, words
):
    """MPICH without PMIx, as of the extra `mpich`: one line, and only where MPI is needed."""
    pytest.importorskip("mpi4py")
    launched = environment() | {"PMIX_RANK": str(rank), "PMIX_NAMESPACE": "job"}
    told = subprocess.run(
        [sys.executable, "-m", "asperity", *arguments],
        cwd=tmp_path,
        env=launched,
        capture_output=True,
        text=True,
        check=False,
    )
    if code and "PMIx" not in told.stderr:
        pytest.skip("this MPI speaks PMIx")
    assert told.returncode == code, told.stderr
    assert words in told.stdout + told.stderr
    assert bool(told.stdout + told.stderr) == bool(words)
    assert told.stderr.count("\n") == (1 if code else 0)


TIMEOUT = 60

HEARING = """
import os, signal, time
from gen.runtime.farm import Interruption

signal.signal(signal.SIGINT, signal.default_int_handler)
with Interruption(listening=True) as interruption:
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(0.01)
    assert interruption.signal == signal.SIGINT
    try:
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(5)
    except KeyboardInterrupt:
        print("as ever")
assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
"""

DEAF = """
import hashlib
from gen.runtime.farm import Interruption

with Interruption(listening=True):
    print("begun", flush=True)
    hashlib.pbkdf2_hmac("sha256", b"", b"", 2**31 - 1)  # compiled, without Python's lock: hours
"""


def _open_files():
    return sum(1 for _ in Path("/dev/fd").iterdir())


def test_the_first_signal_is_noted_and_the_second_is_as_ever():
    done = python("-c", HEARING)
    assert (done.returncode, done.stdout) == (0, "as ever\n"), done.stderr


def test_the_wakeup_is_given_back_and_nothing_is_left_open():
    before = _open_files()
    for _ in range(20):
        with Interruption(listening=True), Interruption(listening=False):
            pass
    deadline = time.monotonic() + TIMEOUT
    while _open_files() > before and time.monotonic() < deadline:
        time.sleep(0.01)
    assert _open_files() <= before
    assert signal.set_wakeup_fd(-1) == -1


@pytest.mark.long
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_compiled_code_is_ended_by_the_second_signal(number):
    with subprocess.Popen(
        [sys.executable, "-c", DEAF],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout.readline() == "begun\n"
        time.sleep(0.5)
        process.send_signal(number)
        said = "stopping after the step under way; again, to stop now\n"
        assert process.stderr.readline() == said
        time.sleep(0.5)
        assert process.poll() is None
        process.send_signal(number)
        assert process.wait(TIMEOUT) == 128 + number


SCENE = "samples = 20\nsamples_per_surface = 2\n[surface]\nnodes = 17\n"


@pytest.fixture
def folder(here):
    (here / "scene.toml").write_text(SCENE)
    return here


def test_a_block_that_takes_too_long_ends_and_leaves_nothing_behind():
    before = signal.getsignal(signal.SIGALRM)
    began = time.monotonic()
    with pytest.raises(Overtime), time_limit(0.05):
        time.sleep(600.0)
    assert time.monotonic() - began < 300.0
    assert signal.getsignal(signal.SIGALRM) is before
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


def test_an_alarm_that_is_swallowed_rings_again():
    def swallow():
        with suppress(Overtime):
            time.sleep(600.0)
        time.sleep(600.0)

    with pytest.raises(Overtime), time_limit(0.05):
        swallow()


@pytest.mark.long
def test_late_samples_stay_pending_and_the_next_run_does_them(
    folder, monkeypatch, capsys
):
    assert cli.main(["run", "scene.toml", "-o", "whole.h5"]) == 0
    healthy, late = bem.solve, parameters(load("scene.toml"), 0, 20).load[[3, 8, 9]]

    def solve(heights, sides, delta, **settings):
        if delta in late:
            time.sleep(600.0)
        return healthy(heights, sides, delta, **settings)

    with monkeypatch.context() as patched:
        patched.setattr(bem, "solve", solve)
        limited = ["run", "scene.toml", "-o", "rows.h5", "--sample-limit", "2"]
        assert cli.main(limited) == 0
    assert "warning: 3 rows took longer than --sample-limit" in capsys.readouterr().out
    np.testing.assert_array_equal(
        np.flatnonzero(status(folder / "rows.h5") == 0), [3, 8, 9]
    )
    assert cli.main(["run", "scene.toml", "-o", "rows.h5", "--sample-limit", "60"]) == 0
    assert deterministic_bytes(folder / "rows.h5") == deterministic_bytes(
        folder / "whole.h5"
    )


def test_a_late_surface_leaves_all_its_samples_pending(folder, monkeypatch):
    monkeypatch.setattr("gen.generation.sample.describe", lambda *_: time.sleep(600.0))
    rows = compute_rows(load("scene.toml"), 0, 4, limit=0.05)
    assert set(rows["status"]) == {Status.PENDING}
