"""Standard streams: full, closed, without a reader, or of an encoding without some characters."""

import os
import shlex
import subprocess
import sys

import pytest
from databases import status
from launch import TIMEOUT, command, environment

from gen import cli

SCENE = 'title = "Rauheit ä€中 ±"\nsamples = 3\n[surface]\nnodes = 9\n'

STREAMS = {
    "full": ("2>/dev/full", 0),
    "closed": (">&- 2>&- <&-", 0),
    "closed errors": ("2>&-", 0),
    "no reader": ("2>&1", 141),
    "full output": (">/dev/full", 2),
}
"""How a shell is told, and the exit code: what a run prints last is its output."""


@pytest.fixture(scope="module")
def ended(tmp_path_factory):
    """Folder, and (code, standard error) of all runs, which take their start-up side by side."""
    folder = tmp_path_factory.mktemp("streams")
    (folder / "scene.toml").write_text("samples = 4\n[surface]\nnodes = 9\n")
    runs = {}
    for name, (redirected, _) in STREAMS.items():
        read, write = os.pipe()
        os.close(read)
        run = shlex.join(command(0, "run", "scene.toml", "-o", f"{name}.h5"))
        runs[name] = subprocess.Popen(
            ["sh", "-c", f"exec {run} {redirected}"],
            cwd=folder,
            env=environment(),
            stdout=write if name == "no reader" else subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        os.close(write)
    said = {name: run.communicate(timeout=TIMEOUT)[1] for name, run in runs.items()}
    return folder, {name: (runs[name].returncode, said[name]) for name in runs}


@pytest.mark.parametrize("name", STREAMS)
def test_what_nobody_reads_ends_no_run(ended, name):
    folder, ends = ended
    code, said = ends[name]
    assert (status(folder / f"{name}.h5") == 1).all()
    assert code == STREAMS[name][1], said
    assert "Traceback" not in said
    assert "Exception" not in said
    if name == "full output":
        assert said.splitlines()[-1] == "gen: standard output: No space left on device"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(SCENE, encoding="utf-8")
    return tmp_path


def started(folder, *arguments, **variables):
    return subprocess.run(
        [sys.executable, "-m", "gen", *arguments],
        cwd=folder,
        env=os.environ | variables,
        check=False,
        capture_output=True,
        timeout=60,
    )


@pytest.mark.parametrize(
    "variables",
    [
        {"PYTHONIOENCODING": "ascii"},
        {"LC_ALL": "POSIX", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
    ],
)
def test_a_title_that_the_terminal_cannot_show_ends_no_started(folder, variables):
    assert cli.main(["run", "scene.toml", "-o", "rows ä.h5"]) == 0
    shown = started(folder, "info", "rows ä.h5", **variables)
    assert (shown.returncode, shown.stderr) == (0, b"")
    assert b"Rauheit ?" in shown.stdout
    refused = started(folder, "info", "nowhere ä.h5", **variables)
    assert (refused.returncode, refused.stderr.count(b"\n")) == (2, 1)
