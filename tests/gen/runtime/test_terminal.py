"""What stands in a stranger's file drives neither a terminal nor a spreadsheet."""

import csv
import io
import re

import numpy as np
import pytest
from rich.progress import Progress
from rich.table import Table

from gen import cli
from gen.runtime.console import console
from gen.runtime.table import cell, write_csv
from gen.runtime.terminal import echo, printable

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


def test_lines_tables_and_bars_of_a_console_are_harmless(capsys):
    file = io.StringIO()
    made = console(file=file, width=100, markup=False, highlight=False)
    made.print(EVIL)
    table = Table(EVIL.replace("\n", " "), title="t\x1b[2J")
    table.add_row("c\x1b]0;\x07")
    made.print(table)
    with Progress(console=made) as progress:
        progress.add_task("bar", total=1)
        progress.console.print(EVIL)
    assert file.getvalue().count("\nx.h5") == 0
    assert "\x1b" not in file.getvalue()
    assert "c?]0;" in file.getvalue()
    echo(EVIL)
    echo(EVIL, err=True)
    said = capsys.readouterr()
    assert_harmless(said.out)
    assert said.out == said.err == printable(EVIL) + "\n"


def test_styles_of_our_own_stay():
    file = io.StringIO()
    console(file=file, force_terminal=True, color_system="standard").print("x", style="dim")
    assert file.getvalue() == "\x1b[2mx\x1b[0m\n"


@pytest.mark.parametrize("text", ["=1+1", "+1", "-1", "@SUM(A1)", "\t=1", "\r=1", "\n=1"])
def test_a_cell_of_text_is_no_formula(tmp_path, text):
    assert cell(text) == f"'{text}"
    write_csv(tmp_path / "a.csv", [{"name": text, "value": -1.5, "count": -3, "plain": "a=b"}])
    with (tmp_path / "a.csv").open(newline="", encoding="utf-8") as file:
        (row,) = csv.DictReader(file)
    assert row == {"name": f"'{text}", "value": "-1.5", "count": "-3", "plain": "a=b"}
