"""Merging: the best of every row, and refusals of files that do not fit."""

import numpy as np
import pytest
from small_databases import PHYSICS, block, filled, raise_physics, small

from gen import database
from gen.database import Reader, Writer, merge
from gen.runtime.errors import InputError
from gen.scene import Store
from gen.schema import Status


def test_merge_takes_the_best_of_every_row(tmp_path, monkeypatch):
    monkeypatch.setattr(database.disk, "CHUNK_BYTES", 3 * 8 * 25)
    store = Store(heights=True)
    one = filled(tmp_path / "one.h5", small(10, store=store), (0, 4, 1), (6, 8, 2))
    two = filled(tmp_path / "two.h5", small(15, store=store), (2, 7, 1), (8, 9, 2), (14, 15, 1))
    target = tmp_path / "both.h5"
    assert merge(target, [one, two]) == (5, 8, 2)
    scene = small(15, store=store)
    wanted = block(scene, 0, 15)
    with Reader(target) as reader:
        assert reader.scene == scene
        statuses = [1, 1, 1, 1, 1, 1, 1, 2, 2, 0, 0, 0, 0, 0, 1]
        assert reader.column("status").tolist() == statuses
        for column in reader.columns()[2:]:
            known = np.flatnonzero(statuses)
            values = reader.column(column.name)[known]
            np.testing.assert_array_equal(values, wanted[column.name][known])
    with Writer(target, scene) as writer:
        assert writer.pending() == [(9, 14)]
    assert sorted(tmp_path.iterdir()) == sorted([one, two, target])


def test_merge_does_not_mind_other_times_and_hosts(tmp_path):
    scene = small()
    one = filled(tmp_path / "one.h5", scene, (0, 4, Status.DONE))
    two = filled(tmp_path / "two.h5", scene)
    values = block(scene, 0, 4)
    values["solve_seconds"] += 1.0
    values["host"][:] = b"elsewhere"
    with Writer(two, scene) as writer:
        writer.write_block(0, 4, values)
    assert merge(tmp_path / "both.h5", [one, two]) == (6, 4, 0)


def test_merge_refuses_rows_that_differ_in_one_bit(tmp_path):
    scene = small()
    one = filled(tmp_path / "one.h5", scene, (0, 4, Status.DONE))
    two = filled(tmp_path / "two.h5", scene)
    values = block(scene, 0, 4)
    values["force"][2] = np.nextafter(values["force"][2], np.inf)
    with Writer(two, scene) as writer:
        writer.write_block(0, 4, values)
    with pytest.raises(InputError, match=r"row 2: force differs between .*one\.h5 and .*two\.h5"):
        merge(tmp_path / "both.h5", [one, two])
    assert sorted(tmp_path.iterdir()) == [one, two]


def test_merge_refuses_other_scenes_physics_and_targets(tmp_path, monkeypatch):
    one = filled(tmp_path / "one.h5", small(seed=1))
    two = filled(tmp_path / "two.h5", small(seed=2))
    target = tmp_path / "both.h5"
    with pytest.raises(InputError, match=r"different scenes .seed: 1"):
        merge(target, [one, two])
    with pytest.raises(InputError, match="nothing to merge"):
        merge(target, [])
    with pytest.raises(InputError, match="exists"):
        merge(two, [one])
    raise_physics(monkeypatch)
    three = filled(tmp_path / "three.h5", small(seed=1))
    with pytest.raises(InputError, match=rf"physics {PHYSICS}, .* of physics {PHYSICS + 1}"):
        merge(target, [one, three])
    assert not target.exists()
