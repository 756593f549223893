"""How commands end: memory that runs out, odd paths and arguments, streams that nobody reads."""

import csv
import errno
import io
import os
import re
import shlex
import subprocess
import sys
from unittest import mock

import command_lines
import h5py
import numpy as np
import pytest
from databases import database_of, seal, status
from launch import TIMEOUT, command, environment

from gen import cli
from gen.runtime.command_line import recorded_command_line
from gen.runtime.documents import cell, write_csv
from gen.runtime.terminal import RunProgress, echo, print_columns, printable

SCENE = 'title = "Rauheit ä€中 ±"\nsamples = 3\n[surface]\nnodes = 9\n'


@pytest.fixture
def folder(here):
    (here / "scene.toml").write_text(SCENE, encoding="utf-8")
    return here


def test_memory_that_runs_out_anywhere_is_one_line(folder, monkeypatch, refused):
    failing = mock.Mock(side_effect=MemoryError("Unable to allocate 7 TiB"))
    monkeypatch.setattr("gen.scene.Scene.parse", failing)
    line = refused(cli, "estimate", "scene.toml")
    assert line.startswith(
        "gen: this needs more memory than there is: Unable to allocate 7 TiB;"
    )
    assert "are allowed here" in line


def test_a_complaint_about_a_long_text_is_short(refused):
    line = refused(cli, "info", "x" * 5000 + ".h5")
    assert line.startswith("gen: xxx")
    assert line.endswith("File name too long\n")
    assert len(line) < 1300


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["run", "quick", "-o", "x.h5", "--rows", ""], "'' after '--rows' is empty"),
        (["run", "", "-o", "x.h5"], "'' after 'run' is empty"),
        (["run", "quick", "-o", "x.h5", "--rows", "0:x"], "'0:x': give two row numbers"),
    ],
)
def test_an_empty_argument_chooses_nothing(here, refused, arguments, said):
    """As `--rows "$ROWS"` where ROWS is not set: all rows were computed."""
    assert said in refused(cli, *arguments)
    assert not list(here.iterdir())


def test_an_option_that_is_given_twice_has_a_warning(here, capsys):
    """As `--side 200 --side 300` for an oblong map: only 300 counted, and nothing said so."""
    np.save("map.npy", np.random.default_rng(0).normal(size=(9, 9)))
    line = ["contact", "map.npy", "--side", "8", "--delta", "1"]
    twice = ["--young", "1e5", "--young", "2e5", "--poisson", "0", "--poisson", "0"]
    assert cli.main([*line, *twice]) == 0
    assert "was given" not in capsys.readouterr().err
    assert cli.main([*line, "--side", "16", "--delta", "1"]) == 0
    warnings = capsys.readouterr().err
    for option in ("--side", "--delta"):
        assert f"warning: {option} was given 2 times: the last one counts" in warnings


def test_a_number_that_is_not_the_stored_one_is_written_plainly(here, capsys):
    database_of(here, SCENE, "a")
    with h5py.File("a.h5", "r+") as file:
        file["height_mean"][:] = 5.0
    seal(here / "a.h5")
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


@pytest.mark.few(1)
@pytest.mark.parametrize("name", STREAMS)
def test_what_nobody_reads_ends_no_run(tmp_path, name):
    redirected, code = STREAMS[name]
    (tmp_path / "scene.toml").write_text("samples = 4\n[surface]\nnodes = 9\n")
    run = shlex.join(command(0, "run", "scene.toml", "-o", "rows.h5"))
    read, write = os.pipe()
    os.close(read)
    ended = subprocess.run(
        ["sh", "-c", f"exec {run} {redirected}"],
        cwd=tmp_path,
        env=environment(),
        stdout=write if name == "no reader" else subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        timeout=TIMEOUT,
        check=False,
    )
    os.close(write)
    said = ended.stderr
    assert (status(tmp_path / "rows.h5") == 1).all()
    assert ended.returncode == code, said
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
        timeout=TIMEOUT,
    )


@pytest.mark.few(1)
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


EVIL = "a\x1b[2J\x1b]0;owned\x07\x9b31m\u202eb\r\nx.h5: sound"
"""Clears the screen, names the window, colours, turns the direction, and forges a line."""


def assert_harmless(text):
    assert re.search(r"a\?\[2J\?\]0;owned\?{1,2}31m\?b\?{1,2}x\.h5: sound", text)
    assert not [line for line in text.splitlines() if line.startswith("x.h5: sound")]
    assert all(character.isprintable() or character == "\n" for character in text)


def test_a_title_in_a_database_cannot_drive_the_terminal(here, capsys):
    title = EVIL.encode("unicode_escape").decode().replace("\\x", "\\u00")
    database_of(here, f'title = "{title}"\nsamples = 1\n[surface]\nnodes = 5\n', "a")
    capsys.readouterr()
    assert cli.main(["info", "a.h5"]) == 0
    assert_harmless(capsys.readouterr().out)


@pytest.mark.usefixtures("here")
def test_a_file_name_cannot_drive_the_terminal(capsys):
    name = "a\x1b[2J\nb.npy"
    np.save(name, np.random.default_rng(0).normal(size=(9, 9)))
    for arguments in (
        ["describe", name, "--side", "9"],
        ["describe", name],
        ["info", name],
    ):
        cli.main(arguments)
        said = capsys.readouterr()
        assert "a?[2J" in said.out + said.err
        assert "\x1b" not in said.out + said.err
    assert not said.out
    assert said.err.count("\n") == 1


def test_tables_are_harmless(capsys):
    print_columns([["c\x1b]0;\x07 [red] :smile:"]], [EVIL.replace("\n", " ")])
    said = capsys.readouterr().out
    assert "\x1b" not in said
    assert "c?]0; [red] :smile:" in said


def test_lines_are_harmless(capsys):
    echo(EVIL)
    echo(EVIL, err=True)
    said = capsys.readouterr()
    assert_harmless(said.out)
    assert said.out == said.err == printable(EVIL) + "\n"


class Full(io.StringIO):
    """A stream on a device that is full."""

    def write(self, text):
        raise OSError(errno.ENOSPC, "No space left on device")


@pytest.mark.parametrize("terminal", [False, True])
def test_progress_in_a_program_of_somebody_else_ends_no_run(monkeypatch, terminal):
    stream = Full()
    monkeypatch.setattr(stream, "isatty", lambda: terminal)
    monkeypatch.setattr("sys.stderr", stream)
    with RunProgress(2) as progress:
        progress.say("hello")
        progress.advance(2)


def test_progress_says_what_is_done_and_failed(capsys):
    with RunProgress(4, "fits") as progress:
        progress.advance(2, failed=1)
    said = capsys.readouterr().err
    assert said.startswith("2 of 4 fits (50.0 %), ")
    assert ", 1 failed, " in said


@pytest.mark.parametrize("text", ["=1+1", "-1", "\t=1"])
def test_a_cell_of_text_is_no_formula(tmp_path, text):
    assert cell(text) == f"'{text}"
    write_csv(
        tmp_path / "a.csv", [{"name": text, "value": -1.5, "count": -3, "plain": "a=b"}]
    )
    with (tmp_path / "a.csv").open(newline="", encoding="utf-8") as file:
        (row,) = csv.DictReader(file)
    assert row == {"name": f"'{text}", "value": "-1.5", "count": "-3", "plain": "a=b"}


@pytest.mark.parametrize("program", ["gen", "learn"])
def test_a_recorded_command_is_the_one_that_was_given(program):
    """Each command with each of its flags, and with none."""
    for name, (_, *words) in command_lines.good(program).items():
        parser = command_lines.commands(program)[name]
        flags = [each for each in parser.params if getattr(each, "is_flag", False)]
        spelled = [word for each in flags for word in (*each.opts, *each.secondary_opts)]
        for flag in ([], *([each] for each in spelled if each != "--help")):
            with parser.make_context(name, [*words, *flag]) as given:
                again = shlex.split(recorded_command_line(given, program))
            with parser.make_context(name, again[again.index(name) + 1 :]) as read:
                assert read.params == given.params, again
