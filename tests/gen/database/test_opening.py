"""Opening: other scenes, layouts, results and troubles of the disk are refused in one line."""

import errno
import json
import os
from pathlib import Path

import h5py
import pytest
from databases import PHYSICS, database_of, raise_physics, small

from gen import cli, database, schema
from gen.database import Reader, Writer, create, open_or_create
from gen.runtime.errors import InputError
from gen.scene import Scene
from gen.surface import DisplacedSurface


def test_other_scene_is_refused_key_by_key(path):
    create(path, small(seed=1))
    before = path.read_bytes()
    other = Scene(samples=20, seed=2, surface=DisplacedSurface(nodes=9))
    with pytest.raises(InputError) as raised:
        open_or_create(path, other, force=True)
    assert "seed: 1 in the file, 2 asked for" in str(raised.value)
    assert "surface.nodes: 5 in the file, 9 asked for" in str(raised.value)
    with pytest.raises(InputError, match="seed"):
        Writer(path, other)
    assert path.read_bytes() == before


def test_other_layout_is_refused(path, monkeypatch):
    create(path, small())
    monkeypatch.setattr(database.opening, "SCHEMA", schema.SCHEMA + 1)
    for opening in (Reader, lambda old: open_or_create(old, small(), force=True)):
        with pytest.raises(InputError, match=r"layout 1, this version reads layout 2"):
            opening(path)


def test_a_scene_that_no_version_makes_any_more_says_how_the_database_is_made_anew(path):
    """As with `store.corrected_area_percent` of 1.0.0rc1."""
    create(path, small())
    with h5py.File(path, "r+") as file:
        scene = json.loads(file.attrs["scene"])
        scene["store"]["corrected_area_percent"] = True
        text = json.dumps(scene, sort_keys=True).encode()
        file.attrs.create("scene", text, dtype=h5py.string_dtype("utf-8", len(text)))
    known = "the closest known key is store.continuum_area_percent"
    with pytest.raises(
        InputError, match=rf"{known}: .* make the database anew: .* gen run SCENE"
    ):
        Reader(path)


@pytest.fixture
def of_lower_physics(path, monkeypatch):
    """A database that this version, which computes other results, is to continue."""
    create(path, small())
    raise_physics(monkeypatch)
    return path


def test_a_run_of_other_physics_is_refused(of_lower_physics):
    before = of_lower_physics.read_bytes()
    stored, computed = f"physics {PHYSICS}", f"physics {PHYSICS + 1}"
    words = (
        rf"{stored}, this version computes {computed}; make it anew: .* gen run --force"
    )
    with pytest.raises(InputError, match=words):
        open_or_create(of_lower_physics, small())
    assert of_lower_physics.read_bytes() == before


def test_a_writer_of_other_physics_is_refused(of_lower_physics):
    before = of_lower_physics.read_bytes()
    with pytest.raises(InputError, match="physics"):
        Writer(of_lower_physics, small())
    assert of_lower_physics.read_bytes() == before


def test_other_physics_can_be_forced_and_is_recorded(of_lower_physics):
    assert open_or_create(of_lower_physics, small(), force=True) == "resumed"
    with Writer(of_lower_physics, small(), force=True):
        pass
    with Reader(of_lower_physics) as reader:
        assert reader.attributes["physics"] == PHYSICS
        assert reader.attributes["physics_forced"] == PHYSICS + 1


LINES = (
    "info rows.h5",
    "check rows.h5",
    "plot rows.h5 -o new.png",
    "export rows.h5 -o new",
    "merge rows.h5 rows.h5 -o new.h5",
    "run rows.toml -o rows.h5",
    "run rows.toml -o new.h5",
)
"""Commands that read a database, or make one."""


def fails_after(opened, monkeypatch):
    """Let the system answer EIO to every read and write of a database, once some are opened.

    The memory of a process is a file in which nothing is at the places of a small file.
    """
    from gen.database import creation, reader, writer

    opening, count = reader.open_file, []

    def open_failing(*arguments, **settings):
        file = opening(*arguments, **settings)
        count.append(file)
        if len(count) > opened:
            memory = os.open("/proc/self/mem", os.O_RDWR)
            os.dup2(memory, file.id.get_vfd_handle())
            os.close(memory)
        return file

    for module in (creation, reader, writer):
        monkeypatch.setattr(module, "open_file", open_failing)
    return count


@pytest.mark.skipif(not Path("/proc/self/mem").exists(), reason="needs Linux")
@pytest.mark.parametrize("line", LINES)
def test_trouble_of_the_disk_is_not_called_damage(line, here, monkeypatch, refused):
    original = database_of(
        here, "samples = 9\n[surface]\nnodes = 9\n", "rows"
    ).read_bytes()
    opened = fails_after(0, monkeypatch)
    message = refused(cli, *line.split())
    assert opened
    assert os.strerror(errno.EIO) in message
    assert "damaged" not in message
    assert "restore" not in message
    assert (here / "rows.h5").read_bytes() == original


@pytest.mark.skipif(not Path("/proc/self/mem").exists(), reason="needs Linux")
@pytest.mark.parametrize("opened", [1, 2])
def test_trouble_while_a_database_is_made_is_one_line(opened, here, monkeypatch, capsys):
    (here / "rows.toml").write_text("samples = 9\n[surface]\nnodes = 9\n")
    fails_after(opened, monkeypatch)
    assert cli.main(["run", "rows.toml", "-o", "rows.h5"]) == 2
    assert os.strerror(errno.EIO) in capsys.readouterr().err.splitlines()[-1]
