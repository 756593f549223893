"""Databases from anywhere, given to the commands that learn from them."""

from pathlib import Path

import crafted_databases as crafted
import pytest
from comparisons import run

from learn import cli


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("crafted")
    crafted.prepare(folder)
    sample = Path(__file__).parents[2] / "examples" / "sample.h5"
    assert (
        run("fit", sample, "--model", "decision-tree", "-o", folder / "x.surrogate") == 0
    )
    return folder


@pytest.mark.few(2)
@pytest.mark.parametrize(
    "command", [name for name in crafted.COMMANDS if name[:3] != "gen"]
)
def test_every_command_refuses_what_gen_cannot_have_laid_out(
    folder, command, monkeypatch, capsys
):
    monkeypatch.chdir(folder)
    crafted.refuse(cli.main, command, crafted.KINDS, capsys)
