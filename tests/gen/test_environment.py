"""Odd surroundings of a command: encodings, launchers that are not there, little memory."""

import os
import subprocess
import sys
import warnings

import numpy as np
import pytest

from gen import cli
from gen.runtime import farm
from gen.runtime.errors import InputError

SCENE = 'title = "Rauheit ä€中 ±"\nsamples = 3\n[surface]\nnodes = 9\n'


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(SCENE, encoding="utf-8")
    return tmp_path


def command(folder, *arguments, **environment):
    return subprocess.run(
        [sys.executable, "-m", "gen", *arguments],
        cwd=folder,
        env=os.environ | environment,
        check=False,
        capture_output=True,
        timeout=60,
    )


@pytest.mark.parametrize(
    "environment",
    [
        {"PYTHONIOENCODING": "ascii"},
        {"LC_ALL": "POSIX", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
    ],
)
def test_a_title_that_the_terminal_cannot_show_ends_no_command(folder, environment):
    assert cli.main(["run", "scene.toml", "-o", "rows ä.h5"]) == 0
    shown = command(folder, "info", "rows ä.h5", **environment)
    assert (shown.returncode, shown.stderr) == (0, b"")
    assert b"Rauheit ?" in shown.stdout
    refused = command(folder, "info", "nowhere ä.h5", **environment)
    assert (refused.returncode, refused.stderr.count(b"\n")) == (2, 1)


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
    cases = (
        ["run", "scene.toml", "-o", "/"],
        ["run", "scene.toml", "-o", "one"],
        ["run", "one", "-o", "rows.h5"],
        ["info", "one"],
        ["merge", "one", "-o", "rows.h5"],
        ["describe", "one", "--side", "9"],
    )
    for arguments in cases:
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


def test_a_hole_that_is_a_signalling_nan_is_a_hole(folder, capsys):
    """Found by the fuzzer: arithmetic with it makes NumPy warn."""
    heights = np.arange(81.0).reshape(9, 9)
    heights.view("u8")[3, 3] = 0x7FF0000000000001
    np.save("surface.npy", heights)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert cli.main(["describe", "surface.npy", "--side", "9", "--fill"]) == 0
    assert "1 missing" in capsys.readouterr().out
