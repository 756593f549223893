"""What is printed: no text of a stranger's drives the terminal, no stream ends a run."""

import csv
import errno
import io
import re

import numpy as np
import pytest
from rich.table import Table

from gen import cli
from gen.runtime.documents import cell, write_csv
from gen.runtime.terminal import RunProgress, echo, print_table, printable, started_as, to_type

EVIL = "a\x1b[2J\x1b]0;owned\x07\x9b31m\u202eb\r\nx.h5: sound"
"""Clears the screen, names the window, colours, turns the direction, and forges a line."""


def assert_harmless(text: str) -> None:
    assert re.search(r"a\?\[2J\?\]0;owned\?{1,2}31m\?b\?{1,2}x\.h5: sound", text)
    assert not [line for line in text.splitlines() if line.startswith("x.h5: sound")]
    assert all(character.isprintable() or character == "\n" for character in text)


def test_a_title_in_a_database_cannot_drive_the_terminal(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    title = EVIL.encode("unicode_escape").decode().replace("\\x", "\\u00")
    (tmp_path / "scene.toml").write_text(
        f'title = "{title}"\nsamples = 1\n[surface]\nnodes = 5\n', encoding="utf-8"
    )
    assert cli.main(["run", "scene.toml", "-o", "a.h5", "--rows", "0:1"]) == 0
    capsys.readouterr()
    assert cli.main(["info", "a.h5"]) == 0
    assert_harmless(capsys.readouterr().out)


def test_a_file_name_cannot_drive_the_terminal(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    name = "a\x1b[2J\nb.npy"
    np.save(name, np.random.default_rng(0).normal(size=(9, 9)))
    for arguments in (["describe", name, "--side", "9"], ["describe", name], ["info", name]):
        cli.main(arguments)
        said = capsys.readouterr()
        assert "a?[2J" in said.out + said.err
        assert "\x1b" not in said.out + said.err
    assert not said.out
    assert said.err.count("\n") == 1


def test_lines_and_tables_are_harmless(capsys):
    table = Table(EVIL.replace("\n", " "), title="t\x1b[2J")
    table.add_row("c\x1b]0;\x07 [red] :smile:")
    print_table(table, 100)
    said = capsys.readouterr().out
    assert "\x1b" not in said
    assert "c?]0; [red] :smile:" in said
    echo(EVIL)
    echo(EVIL, err=True)
    said = capsys.readouterr()
    assert_harmless(said.out)
    assert said.out == said.err == printable(EVIL) + "\n"


def test_styles_of_our_own_stay_on_a_terminal(monkeypatch, capsys):
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    monkeypatch.setenv("TERM", "xterm")
    table = Table("x")
    table.add_row("a", style="dim")
    print_table(table)
    assert "\x1b[2m" in capsys.readouterr().out


def test_messages_name_commands_as_they_are_typed():
    started_as("asperity gen")
    assert to_type("learn card x") == "asperity learn card x"
    started_as("gen")
    assert to_type("learn card x") == "python -m learn card x"
    assert to_type("asperity gen run") == "asperity gen run", "a path that was typed stays"


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
        progress.advance(2, 0)


def test_progress_says_what_is_done_and_failed(capsys):
    with RunProgress(4, "fits") as progress:
        progress.advance(2, 1)
    said = capsys.readouterr().err
    assert said.startswith("2 of 4 fits (50.0 %), ")
    assert ", 1 failed, " in said


@pytest.mark.parametrize("text", ["=1+1", "-1", "\t=1"])
def test_a_cell_of_text_is_no_formula(tmp_path, text):
    assert cell(text) == f"'{text}"
    write_csv(tmp_path / "a.csv", [{"name": text, "value": -1.5, "count": -3, "plain": "a=b"}])
    with (tmp_path / "a.csv").open(newline="", encoding="utf-8") as file:
        (row,) = csv.DictReader(file)
    assert row == {"name": f"'{text}", "value": "-1.5", "count": "-3", "plain": "a=b"}
