"""Signals to a run on three ranks, what fails on one alone, files that become others: it ends."""

import json
import signal
import time

import h5py
import pytest
from databases import deterministic_bytes, has_begun, status
from launch import TIMEOUT, begin, is_open_mpi, launch

from gen import cli

pytestmark = pytest.mark.mpi

SCENE = "samples = {}\n[surface]\nnodes = 33\n"
ROWS = 100_000
"""Rows of a run that takes minutes: it is in its midst when its signal comes, however late."""

SHORT = 300
"""Rows of a run that is soon done, wherever in its start a signal has met it."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with the scenes, and the first rows of both from a serial run."""
    folder = tmp_path_factory.mktemp("interruption")
    for name, samples in (("scene", ROWS), ("short", SHORT)):
        (folder / f"{name}.toml").write_text(SCENE.format(samples))
    assert run_here(folder, "whole.h5", "short") == 0
    return folder


def run_here(folder, output, scene="scene"):
    """Go on with the first rows of a database in this process; return the exit code."""
    line = ["run", str(folder / f"{scene}.toml"), "-o", str(folder / output)]
    return cli.main([*line, "--rows", f"0:{SHORT}"])


def go_on_here(folder, output, scene="scene"):
    """Go on in this process, once the last rank is gone: Open MPI's launcher ends before it."""
    limit = time.monotonic() + TIMEOUT
    while (code := run_here(folder, output, scene)) == 2 and time.monotonic() < limit:
        time.sleep(0.2)
    return code


def assert_first_rows_are_right(path):
    """Compare the bytes of the first rows with those of the serial run."""
    made = deterministic_bytes(path)
    for name, expected in deterministic_bytes(path.with_name("whole.h5")).items():
        assert made[name].startswith(expected), name


def start(folder, ranks, output):
    """A run that is surely in its midst: some rows are finished, others are not."""
    run = begin(ranks, "run", "scene.toml", "-o", output, folder=folder)
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
def test_a_signal_stops_in_order_and_the_same_command_goes_on(
    folder, ranks, number, capsys
):
    output = f"{ranks}-{number}.h5"
    run = start(folder, ranks, output)
    run.send_signal(number)
    out, err = run.communicate(timeout=TIMEOUT)
    assert "Traceback" not in err
    finished = status(folder / output) != 0
    assert 0 < finished.sum() < ROWS
    if (
        ranks and number != signal.SIGUSR1 and is_open_mpi()
    ):  # it may kill before all is in order
        assert run.returncode
    else:
        assert run.returncode == 128 + number, err
        assert f"stopped by {number.name}; the same command goes on" in out
        assert not (folder / f"{output}.lock").exists()
    # Any number of ranks goes on with the rows of any other: here one, without a new start.
    assert go_on_here(folder, output) == 0
    assert f"{SHORT - finished[:SHORT].sum()} to do" in capsys.readouterr().err
    assert_first_rows_are_right(folder / output)


def test_a_second_writer_is_refused_and_readers_are_welcome(folder, capsys):
    run = start(folder, 3, "busy.h5")
    try:
        assert run_here(folder, "busy.h5") == 2
        refusal = capsys.readouterr().err
        assert cli.main(["info", str(folder / "busy.h5")]) == 0
    finally:
        run.send_signal(signal.SIGTERM)
        run.communicate(timeout=TIMEOUT)
    assert "is being written by host" in refusal
    assert refusal.count("\n") == 1
    assert "pending" in capsys.readouterr().out


@pytest.mark.long
def test_the_lock_does_not_outlive_a_killed_run(folder):
    run = start(folder, 0, "killed.h5")
    run.kill()
    run.communicate(timeout=TIMEOUT)
    assert run_here(folder, "killed.h5") == 0
    assert_first_rows_are_right(folder / "killed.h5")


@pytest.mark.long
@pytest.mark.parametrize("delay", [0.1, 0.5, 0.9, 1.3])
def test_an_early_signal_leaves_no_rank_waiting(folder, delay):
    run = begin(3, "run", "short.toml", "-o", f"early-{delay}.h5", folder=folder)
    time.sleep(delay)
    run.send_signal(signal.SIGINT)
    try:
        run.communicate(timeout=TIMEOUT)
    finally:
        run.kill()
    assert go_on_here(folder, f"early-{delay}.h5", "short") == 0


FAILING = """
import contextlib, errno, faulthandler, io, json, os, sys
from unittest.mock import patch
from mpi4py import MPI
from gen import cli
from gen.database import Writer
from gen.generation import run
from gen.runtime.errors import InputError
faulthandler.dump_traceback_later(300, exit=True)
world = MPI.COMM_WORLD
full = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "disk")
missing = ModuleNotFoundError("No module named 'matplotlib'", name="matplotlib")
FAULTS = {
    "a disk full while rows come in": (0, Writer, "write_block", full),
    "a package that is missing": (0, run, "blocks_of", missing),
    "an error of the system at the start": (0, run, "completed", full),
    "a refusal after the start": (0, run, "open_sink", InputError("no file")),
    "a worker alone": (1, run, "open_sink", InputError("no file")),
}
for name, (rank, home, attribute, error) in FAULTS.items():
    err = io.StringIO() if name != "a worker alone" else sys.stderr
    with contextlib.ExitStack() as stack:
        stack.enter_context(contextlib.redirect_stderr(err))
        if world.rank == rank:
            stack.enter_context(patch.object(home, attribute, side_effect=error))
        code = cli.main(["run", "scene.toml", "-o", "rows.h5", "--writer", "single"])
    ends = world.gather((code, err.getvalue()))
    if world.rank == 0:
        print(json.dumps([name, ends]), flush=True)
"""


SLOW = """
import os, sys, time
import h5py
from gen import cli
from gen.database import writer
from gen.generation import run
from gen.runtime import farm
run.BLOCK_ROWS, run.ANSWER_NODES, farm.QUIET, writer.SYNC_SECONDS = 1, 0, 0.1, 1.0
compute_rows, limit = run.compute_rows, time.monotonic() + 60
def finished():
    with h5py.File("rows.h5", locking=False) as file:
        return (file["status"][:] != 0).sum()
def compute_last_row_when_others_are_done(scene, start, stop, **more):
    while stop == 12 and finished() < 11:
        if time.monotonic() > limit:
            raise TimeoutError("the other rows are pending")
        time.sleep(0.05)
    return compute_rows(scene, start, stop, **more)
run.compute_rows = compute_last_row_when_others_are_done
sys.exit(cli.main(["run", "scene.toml", "-o", "rows.h5", "--writer", "single"]))
"""


@pytest.mark.long
def test_rows_are_finished_while_a_worker_takes_long(tmp_path):
    (tmp_path / "scene.toml").write_text("samples = 12\n[surface]\nnodes = 9\n")
    (tmp_path / "slow.py").write_text(SLOW)
    done = launch(3, folder=tmp_path, module="slow")
    assert done.returncode == 0, done.stderr


FATES = ("replaced", "moved", "overwritten", "linked")

SUDDENLY = """
import contextlib, json, os, shutil, sys
from pathlib import Path
from gen import cli, database
from gen.generation import run
from gen.scene import load
from mpi4py import MPI
world, master = MPI.COMM_WORLD, MPI.COMM_WORLD.rank == 0
run.BLOCK_ROWS, run.ANSWER_NODES = 1, 0
write = database.Writer.write_block
def happen(path):  # on each rank that writes, perhaps at the same moment
    if path.name == "replaced.h5":
        os.replace(shutil.copy("other.h5", f"new-{world.rank}"), path)
    if path.name == "moved.h5":
        with contextlib.suppress(FileNotFoundError):
            path.rename("away.h5")
    if path.name == "overwritten.h5":
        shutil.copyfile("other.h5", path)
current, count = [], []
def write_then_happen(*arguments):
    write(*arguments)
    count.append(1)
    if len(count) == 3:
        happen(current[-1])
database.Writer.write_block = write_then_happen
for fate in sys.argv[1:]:
    current.append(Path(fate + ".h5"))
    count.clear()
    held = None
    if fate == "linked" and master:
        database.create(Path("linked.h5"), load("scene.toml"))
        os.symlink("linked.h5", "other-name.h5")
        held = database.lock(Path("other-name.h5"))
        held.__enter__()
    world.Barrier()
    codes = world.gather(cli.main(["run", "scene.toml", "-o", fate + ".h5"]))
    if master:
        sys.stderr.flush()
        print(json.dumps(codes), flush=True)
"""


@pytest.mark.few(1)
def test_what_fails_on_one_rank_ends_all(tmp_path):
    (tmp_path / "scene.toml").write_text("samples = 200\n[surface]\nnodes = 9\n")
    (tmp_path / "failing.py").write_text(FAILING)
    done = launch(3, folder=tmp_path, module="failing")
    ended = [
        json.loads(line) for line in done.stdout.splitlines() if line.startswith("[")
    ]
    assert len(ended) == 4, done.stderr
    for name, ends in ended:
        (_, said), *others = ends
        assert [code for code, _ in ends] == [2, 2, 2], (name, ends)
        assert [words for _, words in others] == ["", ""], (name, ends)
        assert sum(line.startswith("gen: ") for line in said.splitlines()) == 1, (
            name,
            said,
        )
    # A worker that fails where the others go on: nobody waits for it.
    assert done.returncode not in {0, 1}
    assert "gen: no file (rank 1)" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.long
def test_the_run_ends_on_all_ranks_and_the_newcomer_stays(tmp_path):
    text = "samples = 40\nseed = {}\n[surface]\nnodes = 17\n"
    for name, seed in (("scene", 0), ("other", 7)):
        (tmp_path / f"{name}.toml").write_text(text.format(seed))
    assert (
        launch(0, "run", "other.toml", "-o", "other.h5", folder=tmp_path).returncode == 0
    )
    (tmp_path / "suddenly.py").write_text(SUDDENLY)
    done = launch(3, *FATES, folder=tmp_path, module="suddenly")
    assert done.returncode == 0, done.stderr
    assert [json.loads(line) for line in done.stdout.splitlines()] == len(FATES) * [
        [2, 2, 2]
    ]
    said = [line for line in done.stderr.splitlines() if line.startswith("gen: ")]
    words = (
        "replaced by another file",
        "moved or deleted",
        "overwritten",
        "is being written",
    )
    for line, fate, word in zip(said, FATES, words, strict=True):
        assert line.startswith(f"gen: {fate}.h5 ")
        assert word in line
    assert "Traceback" not in done.stderr
    other = (tmp_path / "other.h5").read_bytes()
    assert (tmp_path / "replaced.h5").read_bytes() == other
    if not h5py.get_config().mpi:  # MPI-IO writes a file's first bytes when it is closed
        assert (tmp_path / "overwritten.h5").read_bytes() == other
