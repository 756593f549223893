"""Databases from anywhere: nothing outside them is written, nothing they declare is believed."""

import resource

import crafted_databases as crafted
import pytest

from gen import cli
from gen.database import Reader, Writer
from gen.runtime.errors import InputError
from gen.scene import Scene


@pytest.fixture(scope="module")
def paths(tmp_path_factory):
    return crafted.prepare(tmp_path_factory.mktemp("crafted"))


@pytest.mark.parametrize("command", [name for name in crafted.COMMANDS if name[:3] == "gen"])
def test_every_command_refuses_what_gen_cannot_have_laid_out(paths, command, monkeypatch, capsys):
    monkeypatch.chdir(paths["huge"].parent)
    names = list(crafted.CRAFTED) if command in {"gen run", "gen info"} else crafted.KINDS
    crafted.refuse(cli.main, command, names, capsys)


def writer(path):
    return Writer(path, Scene.parse(crafted.SCENE, "scene"))


@pytest.mark.parametrize("opening", [Reader, writer])
def test_refusing_asks_for_no_memory(paths, opening):
    with pytest.raises(InputError):  # HDF5's own memory, once
        opening(paths["soft-link"])
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(InputError):
        opening(paths["huge"])
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 20_000  # kB


def test_what_gen_wrote_passes(paths):
    with Reader(paths["huge"].parent / "whole.h5") as reader:
        assert reader.counts().pending == 24
