"""The layout of a new database: columns, attributes, contiguous space."""

import json
import resource

import crafted_databases as crafted
import h5py
import numpy as np
import pytest
from databases import small

from gen import cli, schema
from gen.database import Reader, Writer, create
from gen.runtime.errors import InputError
from gen.scene import Scene, Store
from gen.scene.columns import ALL_COLUMNS, columns_for, markdown_table
from gen.schema import DRAWN_NAMES, PHYSICS, PHYSICS_CHANGES


def test_file_is_allocated_contiguous_and_opens_after_a_kill(path):
    create(path, small(store=Store(pressure=True)))
    with h5py.File(path) as file:
        for column in columns_for(small(store=Store(pressure=True))):
            dataset = file[column.path]
            assert dataset.chunks is None
            assert dataset.id.get_offset() is not None
    # Superblocks from version 3 on mark a file as open for writing, and a kill leaves the mark.
    assert path.read_bytes()[8] == 2


def test_file_says_where_it_comes_from(path):
    scene = small(title="A title")
    create(path, scene)
    with Reader(path) as reader:
        attributes = reader.attributes
    assert Scene.from_text(attributes["scene"]) == scene
    assert attributes["scene_hash"] == scene.fingerprint()
    assert attributes["samples"] == 10
    assert attributes["title"] == "A title"
    assert attributes["schema"] == schema.SCHEMA
    assert attributes["physics"] == schema.PHYSICS
    versions = json.loads(attributes["versions"])
    assert {"python", "numpy", "scipy", "pyfftw", "h5py", "hdf5"} <= versions.keys()
    assert len(attributes["git_commit"]) in {0, 40}


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


def test_every_column_is_a_type_of_numpy_and_explained():
    for column in ALL_COLUMNS:
        assert np.array(column.fill, dtype=column.dtype).shape == ()
        assert column.long_name
        assert column.unit or column.dtype[0] == "S"


def test_every_physics_number_says_what_it_changed():
    assert list(PHYSICS_CHANGES) == list(range(11, PHYSICS + 1))
    for change in PHYSICS_CHANGES.values():
        assert change.isprintable()
        assert 20 < len(change) < 200


def test_table_has_every_column_and_table_1s_ranges():
    lines = markdown_table().splitlines()
    assert len(lines) == len(ALL_COLUMNS) + 2
    assert all(line.count("|") == 5 for line in lines)
    assert "| `area_percent` | % | effective contact area | 0.01 to 16.56 |" in lines
    assert "| `runtime/rank` | 1 | MPI rank that computed the sample |  |" in lines
