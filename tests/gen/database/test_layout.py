"""The layout of a new database: columns, attributes, contiguous space."""

import json

import h5py
import numpy as np
from small_databases import small

from gen import schema
from gen.database import Counts, Reader, create, open_or_create
from gen.scene import Scene, Store
from gen.scene.columns import columns_for


def test_new_file_has_every_column_pending(path):
    scene = small(store=Store(heights=True, mean_gap=True))
    assert open_or_create(path, scene) == ("created", 10)
    with Reader(path) as reader:
        assert reader.scene == scene
        assert reader.columns() == columns_for(scene)
        assert reader.counts() == Counts(pending=10, done=0, failed=0)
        for column in reader.columns():
            values = reader.column(column.name)
            assert values.shape == column.shape(10, (5, 5))
            assert values.dtype == column.dtype
            np.testing.assert_array_equal(values, np.full_like(values, column.fill))
    assert list(path.parent.iterdir()) == [path]


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
