"""Databases from anywhere: nothing outside them is written, nothing they declare is believed."""

import resource

import crafted_databases as crafted
import h5py
import numpy as np
import pytest

from gen import cli
from gen.database import Reader, Writer
from gen.runtime.errors import InputError
from gen.scene import Scene
from gen.schema import DRAWN_NAMES

SPECTRAL = """
samples = 8
[surface]
generator = "spectral"
nodes = 16
roll_off = 500.0
cut_off = 200.0
RMS = [0.5, 2.0]
[load]
quantity = "delta/height_rms"
range = [0.5, 1.0]
"""


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


@pytest.mark.parametrize(("older", "drawn"), DRAWN_NAMES.items())
def test_files_with_older_names_are_read_continued_extended_and_merged(tmp_path, older, drawn):
    """The columns of drawn heights and slopes had the names of the parameters."""
    scene = SPECTRAL.replace("RMS", older)

    def asperity(*arguments):
        assert cli.main([str(argument) for argument in arguments]) == 0

    def columns(name):
        with Reader(tmp_path / name) as reader:
            wanted = [each.name for each in reader.columns() if each.deterministic]
            np.testing.assert_array_equal(reader.column(older), reader.column(drawn))
            low, high = reader.ranges()[drawn]
            assert 0.5 <= low <= high <= 2.0
            return {each: reader.column(each) for each in wanted}

    (tmp_path / "scene.toml").write_text(scene)
    (tmp_path / "more.toml").write_text(scene.replace("8", "12", 1))
    asperity("run", tmp_path / "more.toml", "-o", tmp_path / "whole.h5")
    asperity("run", tmp_path / "scene.toml", "-o", tmp_path / "old.h5", "--rows", "0:5")
    with h5py.File(tmp_path / "old.h5", "r+") as file:
        file.move(drawn, older)
    columns("old.h5")
    asperity("run", tmp_path / "scene.toml", "-o", tmp_path / "old.h5")
    asperity("info", tmp_path / "old.h5")
    asperity("check", tmp_path / "old.h5", "--recompute", "2")
    asperity("merge", tmp_path / "old.h5", tmp_path / "whole.h5", "-o", tmp_path / "merged.h5")
    asperity("run", tmp_path / "more.toml", "-o", tmp_path / "old.h5")
    whole = columns("whole.h5")
    for name in ("merged.h5", "old.h5"):
        again = columns(name)
        assert again.keys() == whole.keys()
        for column, values in whole.items():
            np.testing.assert_array_equal(again[column], values, err_msg=column)
