"""Surfaces of a database, generated again for hybrid features."""

import io
import math
import zipfile
from dataclasses import replace

import numpy as np
import pytest
from learnt_rows import read

from gen.database import Reader
from gen.generation.plan import parameters
from gen.generation.sample import surface_of
from gen.runtime.errors import InputError
from learn import dataset, regeneration
from learn.dataset import Request
from learn.executor import Executor
from learn.features import SurfaceFeatures
from learn.features.columns import BLOCK_COUNTS, BLOCKS, HYBRID
from learn.features.sets import SETS


def never():
    return False


def hybrid_rows(database, executor, stopping, blocks=BLOCKS):
    features = replace(SETS["hybrid"], blocks=blocks)
    part = dataset.stored(database, Request((database,)), "delta")
    return regeneration.hybrid_rows(part, executor, stopping, features).columns


@pytest.mark.parametrize(
    ("blocks", "load"), [*((each, "") for each in BLOCK_COUNTS), (33, "pressure")]
)
def test_rows_have_what_surrogates_see_of_their_surfaces(population, blocks, load):
    """Each number of blocks, and each load, is kept in a file of its own, beside the database."""
    rows = read(population, features="hybrid", roots=True, blocks=blocks, load=load)
    kind = f"{'-65' if blocks == 65 else ''}{'-by-pressure' if load else ''}"
    assert population.with_name(f"{population.name}.pressed{kind}.npz").exists()
    row = rows.rows[17]
    with Reader(population) as reader:
        scene, delta, force = (
            reader.scene,
            reader.column("delta"),
            reader.column("force")[row],
        )
    plan, ratio = (
        parameters(scene, 0, scene.samples),
        0.1 if scene.contact.hardness else None,
    )
    heights, boundary = surface_of(scene, plan, row), scene.contact.boundary
    own = SurfaceFeatures(heights, scene.sides, scene.spacing, boundary=boundary)
    cells = heights.size * math.prod(scene.spacing)
    loads = np.array([force / cells]) if load else delta[row : row + 1]
    again = rows.features.of(own.rows(rows.features, loads, ratio, scene.contact.e_star))
    np.testing.assert_allclose(rows.inputs[17], again[0], rtol=1e-9 if load else 0)


def test_what_was_computed_is_kept_and_only_what_changed_is_computed_again(
    database, change, monkeypatch
):
    first = hybrid_rows(database, Executor(), never)
    assert np.isfinite(first).all()
    asked = []
    compute = regeneration.compute_block

    def counting(shared, block):
        asked.append(block)
        return compute(shared, block)

    monkeypatch.setattr(regeneration, "compute_block", counting)
    np.testing.assert_array_equal(hybrid_rows(database, Executor(), never), first)
    assert not asked
    kept = database.with_name(f"{database.name}.pressed.npz")
    with np.load(kept) as file:
        content = dict(file)
    content["inputs"][5] += 1.0
    np.savez(kept, **content)
    np.testing.assert_array_equal(hybrid_rows(database, Executor(), never), first)
    assert [block[:2] for block in asked] == [(5, 6)]
    kept.write_bytes(kept.read_bytes()[:1000])
    np.testing.assert_array_equal(hybrid_rows(database, Executor(), never), first)
    assert len(asked) == 4
    assert not list(kept.parent.glob(".*.npz*"))


def test_kept_features_that_somebody_else_wrote_are_computed_anew(database):
    hybrid_rows(database, Executor(), never)
    cache, names = (
        database.with_name(f"{database.name}.pressed.npz"),
        ("key", "inputs", "values"),
    )
    with np.load(cache) as file:
        key, own = str(file["key"]), file["inputs"]
    values = np.zeros((len(own), len(HYBRID)))
    assert np.isfinite(regeneration.kept(cache, key, own)).all()
    header = "{'descr': '<f8', 'fortran_order': False, 'shape': (4611686018427387904,), }"
    promise = b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header.encode()
    for inputs in (np.float64(1.0), np.zeros(3), own.astype("S8"), own[:5], promise):
        with zipfile.ZipFile(cache, "w") as archive:
            for name, content in zip(names, (np.array(key), inputs, values), strict=True):
                buffer = io.BytesIO()
                np.save(buffer, content)
                data = content if isinstance(content, bytes) else buffer.getvalue()
                archive.writestr(f"{name}.npy", data)
        assert np.isnan(regeneration.kept(cache, key, own)).all()


def test_an_interrupted_run_keeps_what_was_finished(database):
    calls = iter([False, True, True])
    part = hybrid_rows(database, Executor(), lambda: next(calls))
    finished = np.isfinite(part).all(axis=1)
    assert 0 < finished.sum() < 90
    with np.load(database.with_name(f"{database.name}.pressed.npz")) as file:
        np.testing.assert_array_equal(np.isfinite(file["values"]).all(axis=1), finished)
    assert np.isfinite(hybrid_rows(database, Executor(), never)).all()


def test_surfaces_that_cannot_be_generated_anew_are_refused(database, change):
    change("height_mean", [40], 1.0)
    with pytest.raises(
        InputError, match="row 40, generated anew from its scene, is another"
    ):
        hybrid_rows(database, Executor(), never)
