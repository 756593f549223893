"""Surfaces of a database, generated again for hybrid features."""

import io
import math
import shutil
import zipfile
from dataclasses import replace

import h5py
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


def coarse_solves(database, executor, stopping, blocks=BLOCKS):
    features = replace(SETS["hybrid"], blocks=blocks)
    part = dataset.stored(database, Request((database,)), "delta")
    return regeneration.coarse_solves(part, executor, stopping, features).columns


@pytest.mark.few(3)
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
        scene = reader.scene
        delta = reader.column("delta")[row]
        force = reader.column("force")[row]
    contact = scene.contact
    heights = surface_of(scene, parameters(scene, 0, scene.samples), row)
    surface = SurfaceFeatures(
        heights, scene.sides, scene.spacing, boundary=contact.boundary
    )
    loads = np.array([delta])
    if load:
        loads = np.array([force / (heights.size * math.prod(scene.spacing))])
    ratio = 0.1 if contact.hardness else None
    again = rows.features.of(surface.rows(rows.features, loads, ratio, contact.e_star))
    np.testing.assert_allclose(rows.inputs[17], again[0], rtol=1e-9 if load else 0)


@pytest.fixture(scope="module")
def computed(solved, tmp_path_factory):
    """A database beside which features are kept, and these features."""
    path = shutil.copy(solved, tmp_path_factory.mktemp("computed") / "database.h5")
    return path, coarse_solves(path, Executor(), never)


@pytest.fixture
def kept(computed, tmp_path):
    """A copy of that database, and of the file of features beside it."""
    path, _ = computed
    for file in path.parent.iterdir():
        shutil.copy(file, tmp_path / file.name)
    return tmp_path / path.name


@pytest.fixture
def computed_blocks(monkeypatch):
    """The blocks whose features are computed in a test."""
    blocks = []
    compute = regeneration.compute_block

    def counting(shared, block):
        blocks.append(block)
        return compute(shared, block)

    monkeypatch.setattr(regeneration, "compute_block", counting)
    return blocks


def features_file(database):
    return database.with_name(f"{database.name}.pressed.npz")


def test_features_that_were_computed_are_read_from_the_file(
    kept, computed, computed_blocks
):
    assert np.isfinite(computed[1]).all()
    np.testing.assert_array_equal(coarse_solves(kept, Executor(), never), computed[1])
    assert not computed_blocks


def test_only_rows_whose_inputs_changed_are_computed_again(
    kept, computed, computed_blocks
):
    with np.load(features_file(kept)) as file:
        content = dict(file)
    content["inputs"][5] += 1.0
    np.savez(features_file(kept), **content)
    np.testing.assert_array_equal(coarse_solves(kept, Executor(), never), computed[1])
    assert [block[:2] for block in computed_blocks] == [(5, 6)]


def test_a_damaged_file_is_computed_anew(kept, computed, computed_blocks):
    file = features_file(kept)
    file.write_bytes(file.read_bytes()[:1000])
    np.testing.assert_array_equal(coarse_solves(kept, Executor(), never), computed[1])
    assert len(computed_blocks) == 3
    assert not list(kept.parent.glob(".*.npz*"))


def npy(array):
    """The bytes of a .npy file of an array; bytes are such a file already."""
    if isinstance(array, bytes):
        return array
    buffer = io.BytesIO()
    np.save(buffer, array)
    return buffer.getvalue()


def huge_npy():
    """The bytes of a .npy file whose header promises more numbers than there are."""
    header = "{'descr': '<f8', 'fortran_order': False, 'shape': (4611686018427387904,), }"
    return b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header.encode()


@pytest.mark.parametrize(
    "spoil",
    [
        lambda inputs: np.float64(1.0),
        lambda inputs: np.zeros(3),
        lambda inputs: inputs.astype("S8"),
        lambda inputs: inputs[:5],
        lambda inputs: huge_npy(),
    ],
    ids=["a number", "a vector", "texts", "too few rows", "a huge header"],
)
def test_kept_features_with_inputs_of_another_form_are_not_used(kept, spoil):
    path = features_file(kept)
    with np.load(path) as file:
        key = str(file["key"])
        inputs = file["inputs"]
    assert np.isfinite(regeneration.features_in(path, key, inputs)).all()
    values = np.zeros((len(inputs), len(HYBRID)))
    content = {"key": np.array(key), "inputs": spoil(inputs), "values": values}
    with zipfile.ZipFile(path, "w") as archive:
        for name, array in content.items():
            archive.writestr(f"{name}.npy", npy(array))
    assert np.isnan(regeneration.features_in(path, key, inputs)).all()


def test_an_interrupted_run_keeps_what_was_finished(database):
    calls = iter([False, True, True])
    part = coarse_solves(database, Executor(), lambda: next(calls))
    finished = np.isfinite(part).all(axis=1)
    assert 0 < finished.sum() < 90
    with np.load(database.with_name(f"{database.name}.pressed.npz")) as file:
        np.testing.assert_array_equal(np.isfinite(file["values"]).all(axis=1), finished)
    assert np.isfinite(coarse_solves(database, Executor(), never)).all()


def test_surfaces_that_cannot_be_generated_anew_are_refused(database, change):
    """Damaged rows are to be repaired; other features would learn from them."""
    change("height_mean", [40], 1.0)
    refusal = "row 40, generated anew from its scene, is another surface: "
    with pytest.raises(InputError, match=f"{refusal}row 40 has other bytes .* --repair"):
        coarse_solves(database, Executor(), never)
    with h5py.File(database, "r+") as file:
        del file["checksum"]  # as in files of older versions
    with pytest.raises(InputError, match=f"{refusal}use --features paper"):
        coarse_solves(database, Executor(), never)
