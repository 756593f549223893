"""Processes that commands start: nothing is imported from the current folder, Ctrl-C is ours."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from contextlib import suppress
from pathlib import Path

import pytest
from databases import database_of
from launch import SECONDS, ended, environment, mpiexec

SCENE = "samples = 60\nsamples_per_surface = 2\n[surface]\nnodes = 17\n"
DECOY = """
with open({ran!r}, "a") as file:
    file.write(__name__ + " ")
raise ImportError("a decoy")
"""
NAMES = sys.stdlib_module_names | {
    "sitecustomize",
    "numpy",
    "joblib",
    "asperity",
    "gen",
    "learn",
}

LINES = {
    "fit": "learn fit rows.h5 --model kernel-ridge -o fitted.surrogate",
    "tune": "learn tune rows.h5 --model kernel-ridge --budget 90s -o tuned",
    "grow": "learn grow rows.toml --nmae 900 --rows 60 --budget 90s -o grown.surrogate",
    "compare": "learn compare rows.h5 --model kernel-ridge -o compared",
    "bench": "bench run hertz -o benched",
}
"""Commands that start processes, or fit as those do that start them."""

QUESTION = {"name": "rows", "input": [[0.7, 15.0], [2.0]]}


def asperity(*words):
    """The command as it is installed, which has no current folder on its path."""
    call = "import sys; from asperity.command import main; sys.exit(main())"
    return [sys.executable, "-P", "-c", call, *words]


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """A database and its scene."""
    return database_of(tmp_path_factory.mktemp("small"), SCENE, "rows")


@pytest.fixture
def decoys(small, here):
    """A folder with a module of every standard name, each of which says if it is imported."""
    for name in ("rows.h5", "rows.toml"):
        (here / name).write_bytes((small.parent / name).read_bytes())
    for name in NAMES:
        (here / f"{name}.py").write_text(DECOY.format(ran=str(here / "ran")))
    return here


def imported(folder):
    """Names of the decoys that have been imported."""
    ran = folder / "ran"
    return sorted(set(ran.read_text().split())) if ran.exists() else []


@pytest.mark.few(1)
@pytest.mark.parametrize("name", LINES)
def test_no_process_imports_from_the_current_folder(name, decoys):
    done = subprocess.run(
        asperity(*LINES[name].split()),
        capture_output=True,
        text=True,
        timeout=SECONDS,
        check=False,
    )
    assert imported(decoys) == []
    assert done.returncode == 0, done.stderr


@pytest.mark.mpi
@pytest.mark.long
def test_no_process_of_three_ranks_imports_from_the_current_folder(decoys):
    words = asperity(*LINES["tune"].split())
    done = ended([str(mpiexec()), "-n", "3", *words], decoys, environment())
    assert imported(decoys) == []
    assert done.returncode == 0, done.stderr


def test_the_servers_processes_import_nothing_from_the_current_folder(decoys):
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    server = subprocess.Popen(
        asperity("serve", "rows.toml", "--port", str(port), "--processes", "1"),
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert server.stdout.readline().startswith("serving")
        address, body = f"http://127.0.0.1:{port}/Evaluate", json.dumps(QUESTION).encode()
        with urllib.request.urlopen(address, body, timeout=SECONDS) as answer:
            assert "output" in json.load(answer)
    finally:
        server.send_signal(signal.SIGTERM)
        server.communicate(timeout=SECONDS)
    assert imported(decoys) == []


def started(pid):
    """Whether a process has started one that is going to fit."""
    with suppress(OSError):
        for listed in Path(f"/proc/{pid}/task").glob("*/children"):
            for child in listed.read_text().split():
                if b"popen_loky" in Path(f"/proc/{child}/cmdline").read_bytes():
                    return True
    return False


@pytest.mark.long
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_while_the_process_of_fits_starts_is_no_lack_of_memory(
    number, small, here
):
    """A terminal sends Ctrl-C, and a batch system its warning, to all processes."""
    words = f"learn tune {small} --model kernel-ridge --budget 90s -o tuned".split()
    tune = subprocess.Popen(
        asperity(*words), stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    limit = time.monotonic() + SECONDS
    while not started(tune.pid):
        assert tune.poll() is None
        assert time.monotonic() < limit
        time.sleep(0.005)
    os.killpg(tune.pid, number)
    _, errors = tune.communicate(timeout=SECONDS)
    assert tune.returncode == 128 + number, errors
    assert "Traceback" not in errors
    assert "memory" not in errors


INTERRUPTED = """
import os, signal, sys
from importlib.machinery import PathFinder

class Interrupting(PathFinder):
    @classmethod
    def find_spec(cls, name, path=None, target=None):
        if name == {name!r}:
            os.kill(os.getpid(), signal.SIGINT)
        return None

sys.meta_path.insert(0, Interrupting)
sys.argv[1:] = {words!r}
{start}
"""
SCRIPT = "from asperity.command import main; sys.exit(main())"
MODULE = "import runpy; runpy.run_module({!r}, run_name='__main__', alter_sys=True)"


@pytest.mark.parametrize(
    ("start", "words", "name"),
    [
        (SCRIPT, "gen columns", "typer"),
        (SCRIPT, "gen columns", "gen.runtime.farm"),
        (SCRIPT, "bench run --plan -o new", "bench.commands"),
        (MODULE.format("gen"), "columns", "gen.runtime.farm"),
        (MODULE.format("learn"), "show none", "typer"),
        (MODULE.format("bench"), "run --plan -o new", "bench.commands"),
    ],
)
def test_ctrl_c_during_the_first_imports_leaves_no_traceback(start, words, name, here):
    code = INTERRUPTED.format(name=name, words=words.split(), start=start)
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        timeout=SECONDS,
        check=False,
    )
    assert (done.returncode, done.stdout, done.stderr) == (-signal.SIGINT, "", "")
