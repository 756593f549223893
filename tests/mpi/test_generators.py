"""Scenes of every generator on three ranks: the bytes of a serial run, killed, resumed, merged."""

import signal
import subprocess
import sys
import time

import pytest
import user_functions
from databases import deterministic_bytes, has_begun, status
from launch import TIMEOUT, command, environment, launch, mpiexec
from walk import walk

from gen import cli

pytestmark = [
    pytest.mark.mpi,
    pytest.mark.skipif(mpiexec() is None, reason="no mpiexec: install the extra 'mpich'"),
]

ROWS = 100
SPECTRAL = """[surface]
generator = "spectral"
nodes = [32, 40]
side = [100.0, 160.0]
hurst = { normal = [0.7, 0.1], range = [0.4, 1.0] }
roll_off = { log_uniform = [40.0, 80.0] }
cut_off = [10.0, 20.0]
rms_slope = [0.05, 0.1]
stretch = { choice = [1.0, 1.5] }
[load]
quantity = "pressure/(E* slope_rms)"
range = { log_uniform = [0.01, 0.2] }
[contact]
boundary = "mirror"
hardness_ratio = [0.05, 0.5]
"""
DISPLACED = """[surface]
generator = "midpoint"
nodes = 33
hurst = { choice = [0.5, 0.6, 0.8], shares = [0.5, 0.25, 0.25] }
[load]
quantity = "delta/height_rms"
range = [0.1, 2.0]
"""
SCENES = {
    "displaced": DISPLACED,
    "spectral": SPECTRAL,
    "python": user_functions.SURFACE + user_functions.STORE,
}
PRINTING = user_functions.MODULE.replace("    x = np", "    print('a word')\n    x = np", 1)
HANGING = """import time
def waves(shape, spacing, rng, amplitude, length):
    if amplitude > {}:
        open("hanging", "w").close()
        while True:
            time.sleep(0.01)
    return rng.standard_normal(shape)
"""


def text(name, rows=ROWS):
    return f"samples = {rows}\nsamples_per_surface = 3\n{SCENES[name]}"


def run_here(folder, *arguments):
    """A command in this process and in the folder of its files."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setattr(sys, "path", list(sys.path))
        try:
            return cli.main([str(argument) for argument in arguments])
        finally:
            sys.modules.pop("mine", None)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with the scenes, and the database of each from a serial run."""
    folder = tmp_path_factory.mktemp("generators")
    (folder / "mine.py").write_text(user_functions.MODULE)
    for name in SCENES:
        (folder / f"{name}.toml").write_text(text(name))
        (folder / f"{name}-small.toml").write_text(text(name, ROWS // 2 + 1))
        assert run_here(folder, "run", f"{name}.toml", "--trust", "-o", f"{name}.h5") == 0
    return folder


@pytest.fixture(scope="module")
def on_three_ranks(folder):
    """The databases with half of the rows, grown to all, by three ranks in one launch."""
    lines = [
        ["gen", "run", f"{name}{size}.toml", "--trust", "-o", f"{name}-3.h5"]
        for name in SCENES
        for size in ("-small", "")
    ]
    walked = walk(3, lines, folder)
    assert [[end.code for end in ends] for ends in walked] == len(lines) * [3 * [0]]


@pytest.mark.parametrize("name", SCENES)
def test_three_ranks_give_the_bytes_of_one_grown_and_merged(folder, on_three_ranks, name):
    """Half of the rows on three ranks, grown to all on three ranks; two parts merged."""
    expected = deterministic_bytes(folder / f"{name}.h5")
    assert deterministic_bytes(folder / f"{name}-3.h5") == expected
    for part, rows in (("first", f"0:{ROWS // 3}"), ("rest", f"{ROWS // 3}:{ROWS}")):
        output = f"{name}-{part}.h5"
        assert run_here(folder, "run", f"{name}.toml", "--trust", "-o", output, "--rows", rows) == 0
    parts = [f"{name}-{part}.h5" for part in ("first", "rest")]
    assert run_here(folder, "merge", *parts, "-o", f"{name}-both.h5") == 0
    assert deterministic_bytes(folder / f"{name}-both.h5") == expected
    assert run_here(folder, "check", f"{name}-3.h5", "--trust", "--recompute", "20") == 0


@pytest.mark.parametrize("name", SCENES)
def test_a_killed_run_goes_on(folder, name):
    output = folder / f"{name}-killed.h5"
    run = subprocess.Popen(
        command(0, "run", f"{name}.toml", "--trust", "-o", output.name),
        cwd=folder,
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    limit = time.monotonic() + TIMEOUT
    while not has_begun(output):
        assert time.monotonic() < limit
        assert run.poll() is None
        time.sleep(0.005)
    run.kill()
    run.communicate(timeout=TIMEOUT)
    assert run_here(folder, "run", f"{name}.toml", "--trust", "-o", output.name) == 0
    assert deterministic_bytes(output) == deterministic_bytes(folder / f"{name}.h5")


def test_a_function_may_print_and_a_changed_one_is_another_scene(folder, tmp_path):
    user_functions.write(tmp_path, text("python"), PRINTING)
    done = launch(3, "run", "mine.toml", "--trust", "-o", "a.h5", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "a word" in done.stdout
    assert f"runs mine:spots of {tmp_path / 'mine.py'}" in done.stderr
    assert f"{ROWS} rows done" in done.stdout
    made, expected = (
        deterministic_bytes(path) for path in (tmp_path / "a.h5", folder / "python.h5")
    )
    assert made == expected
    (tmp_path / "mine.py").write_text(user_functions.MODULE)
    refused = launch(3, "run", "mine.toml", "--trust", "-o", "a.h5", folder=tmp_path)
    assert refused.returncode == 2
    assert refused.stderr.count("\n") == 1
    assert "surface.source" in refused.stderr


def test_a_function_that_fails_late_ends_all_ranks_with_its_row(tmp_path):
    late = "def spots(contact):\n    return {'a' if contact.delta < 0.9 else 'b': 1.0}\n"
    module = user_functions.MODULE.partition("def spots")[0] + late
    user_functions.write(tmp_path, text("python"), module)
    done = launch(3, "run", "mine.toml", "--trust", "-o", "a.h5", folder=tmp_path)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    *_, said = done.stderr.splitlines()
    assert said.startswith("gen: mine:spots, row ")
    assert said.endswith(": returned b; the database has a")


@pytest.mark.parametrize("ranks", [0, 3])
def test_a_function_that_hangs_is_left_pending_or_interrupted(tmp_path, ranks):
    """A bound on the time leaves its rows pending; without one, a second Ctrl-C ends the run."""
    scene = text("python", 15).replace(user_functions.STORE, "")
    user_functions.write(tmp_path, scene, HANGING.format(1.2))
    limited = launch(
        ranks, "run", "mine.toml", "--trust", "-o", "a.h5", "--sample-limit", "0.2", folder=tmp_path
    )
    assert limited.returncode == 0, limited.stderr
    assert "took longer than --sample-limit and are pending" in limited.stdout
    done = int((status(tmp_path / "a.h5") == 1).sum())
    assert 0 < done < 15
    (tmp_path / "hanging").unlink()
    run = subprocess.Popen(
        command(ranks, "run", "mine.toml", "--trust", "-o", "a.h5"),
        cwd=tmp_path,
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    limit = time.monotonic() + TIMEOUT
    while not (tmp_path / "hanging").exists():
        assert time.monotonic() < limit
        time.sleep(0.02)
    time.sleep(0.5)
    for _ in range(2):
        run.send_signal(signal.SIGINT)
        time.sleep(0.5)
    _, err = run.communicate(timeout=TIMEOUT)
    assert ranks or run.returncode  # MPICH's launcher may say 0 of ranks that it has killed
    assert "Traceback" not in err
    assert int((status(tmp_path / "a.h5") == 1).sum()) >= done
