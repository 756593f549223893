"""Databases from anywhere, given to the commands that learn from them."""

import crafted_databases as crafted
import crafted_surrogates
import pytest

from learn import cli


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("crafted")
    crafted.prepare(folder)
    (folder / "x.surrogate").write_bytes(crafted_surrogates.whole("decision-tree"))
    return folder


@pytest.mark.parametrize("command", [name for name in crafted.COMMANDS if name[:3] != "gen"])
def test_every_command_refuses_what_gen_cannot_have_laid_out(folder, command, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    crafted.refuse(cli.main, command, crafted.KINDS, capsys)
