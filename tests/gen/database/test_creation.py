"""Extension of databases: all rows are kept, whatever interrupts it."""

import signal

import numpy as np
import pytest
from small_databases import NO_ROOM, block, filled, run, small

from gen import database
from gen.database import Reader, Writer, open_or_create
from gen.scene import Scene, Store
from gen.schema import Status

KILLED_WHILE_EXTENDING = """
    import os, signal, sys
    from pathlib import Path
    from gen import database
    path = Path(sys.argv[1])
    with database.Reader(path) as reader:
        scene = reader.scene
    database.creation.fill = lambda *_, **__: os.kill(os.getpid(), signal.SIGKILL)
    database.open_or_create(path, scene.model_copy(update={"samples": 15}))
"""


def test_more_samples_extend_the_file(path):
    scene = small(store=Store(heights=True))
    filled(path, scene, (2, 5, Status.DONE), (7, 8, Status.FAILED))
    with Reader(path) as reader:
        created = reader.attributes["created"]
    more = small(15, store=Store(heights=True))
    assert open_or_create(path, more) == ("extended", 15)
    with Writer(path, more) as writer:
        assert writer.pending() == [(0, 2), (5, 7), (8, 15)]
    wanted = block(scene, 2, 5)
    with Reader(path) as reader:
        assert reader.scene == more
        assert reader.attributes["samples"] == 15
        assert reader.attributes["created"] == created
        for column in reader.columns():
            np.testing.assert_array_equal(reader.column(column.name, 2, 5), wanted[column.name])
            rest = reader.column(column.name, 10)
            np.testing.assert_array_equal(rest, np.full_like(rest, column.fill))
    assert list(path.parent.iterdir()) == [path]


def test_extended_file_is_the_same_as_a_large_one(path, tmp_path):
    runs = (0, 6, Status.DONE), (6, 8, Status.FAILED)
    filled(path, small(10), *runs)
    open_or_create(path, small(30))
    large = filled(tmp_path / "large.h5", small(30), *runs)
    with Reader(path) as one, Reader(large) as other:
        for column in one.columns():
            assert one.column(column.name).tobytes() == other.column(column.name).tobytes()


def test_failed_extension_leaves_the_old_file(path, monkeypatch):
    filled(path, small(), (0, 3, Status.DONE))
    before = path.read_bytes()

    def interrupt(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(database.creation, "fill", interrupt)
    with pytest.raises(KeyboardInterrupt):
        open_or_create(path, small(15))
    assert path.read_bytes() == before
    assert list(path.parent.iterdir()) == [path]


def test_kill_while_extending_leaves_the_old_file(path):
    filled(path, small(), (0, 3, Status.DONE))
    before = path.read_bytes()
    assert run(KILLED_WHILE_EXTENDING, path).returncode == -signal.SIGKILL
    assert path.read_bytes() == before
    assert open_or_create(path, small(15)) == ("extended", 15)
    assert list(path.parent.iterdir()) == [path]


def test_extension_keeps_a_link(path, tmp_path):
    link = tmp_path / "link.h5"
    link.symlink_to(path)
    filled(path, small(), (0, 3, Status.DONE))
    assert open_or_create(link, small(15)) == ("extended", 15)
    assert link.is_symlink()
    with Reader(path) as reader:
        assert reader.counts() == (12, 3, 0)


def test_fewer_samples_keep_the_larger_file(path):
    filled(path, small(10), (0, 3, Status.DONE))
    before = path.read_bytes()
    assert open_or_create(path, small(5)) == ("resumed", 10)
    assert path.read_bytes() == before
    with Writer(path, small(5)) as writer:
        assert writer.scene.samples == 10
        assert writer.pending(last=5) == [(3, 5)]


def test_extension_without_room_leaves_the_old_file(path):
    filled(path, Scene(samples=100), (0, 100, Status.DONE))
    action = "forbid_growth_beyond(200_000); open_or_create(path, Scene(samples=10_000))"
    result = run(NO_ROOM.format(action=action), path)
    assert "disk is full" in result.stdout
    assert (result.returncode, result.stderr) == (0, "")
    with Reader(path) as reader:
        assert reader.counts() == (0, 100, 0)
    assert list(path.parent.iterdir()) == [path]
