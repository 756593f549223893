"""How commands end: memory that runs out, odd paths and arguments, streams that nobody reads."""

import os
import shlex
import subprocess
import sys

import h5py
import pytest
from databases import status
from launch import TIMEOUT, command, environment

from gen import cli

SCENE = 'title = "Rauheit ä€中 ±"\nsamples = 3\n[surface]\nnodes = 9\n'


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(SCENE, encoding="utf-8")
    return tmp_path


def test_memory_that_runs_out_anywhere_is_one_line(folder, monkeypatch, capsys):
    def out_of_memory(*_):
        raise MemoryError("Unable to allocate 7 TiB")

    monkeypatch.setattr("gen.scene.load", out_of_memory)
    assert cli.main(["estimate", "scene.toml"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("gen: this needs more memory than there is: Unable to allocate 7 TiB;")
    assert "are allowed here" in line


def test_loops_of_links_and_the_root_are_no_files(folder, capsys):
    (folder / "one").symlink_to("other")
    (folder / "other").symlink_to("one")
    for arguments in (["run", "scene.toml", "-o", "/"], ["info", "one"], ["describe", "one"]):
        assert cli.main(arguments) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert "/" in line or "one" in line


def test_a_complaint_about_a_long_text_is_short(folder, capsys):
    assert cli.main(["info", "x" * 5000 + ".h5"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("gen: xxx")
    assert " ... xxx" in line
    assert line.endswith("File name too long")
    assert len(line) < 1300


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["run", "quick", "-o", "x.h5", "--rows", ""], "'' after '--rows' is empty"),
        (["run", "quick", "-o", "x.h5", "--rows="], "'--rows=' is empty"),
        (["run", "", "-o", "x.h5"], "'' after 'run' is empty"),
        (["run", "quick", "-o", "x.h5", "--rows", "0:x"], "'0:x': give two row numbers"),
    ],
)
def test_an_empty_argument_chooses_nothing(tmp_path, monkeypatch, capsys, arguments, said):
    """As `--rows "$ROWS"` where ROWS is not set: all rows were computed."""
    monkeypatch.chdir(tmp_path)
    assert cli.main(arguments) == 2
    assert said in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_a_number_that_is_not_the_stored_one_is_written_plainly(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "s.toml").write_text(SCENE, encoding="utf-8")
    assert cli.main(["run", "s.toml", "-o", "a.h5"]) == 0
    with h5py.File("a.h5", "r+") as file:
        file["height_mean"][:] = 5.0
    assert cli.main(["check", "a.h5"]) == 1
    assert "height_mean is not what this machine and these versions compute: 5.0 in" in (
        capsys.readouterr().out
    )


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
