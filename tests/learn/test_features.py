"""Feature sets: the paper's as they were, the others without units, one code at both ends."""

import io
import zipfile

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import bem
from gen.cli import main as gen_main
from gen.database import Reader
from gen.generation.plan import parameters
from gen.generation.sample import surface_of
from gen.runtime.errors import InputError
from gen.surface import generate
from learn import dataset
from learn.executor import Executor
from learn.features import SETS, SurfaceFeatures, chosen, regeneration
from learn.features.regeneration import pressed_rows
from learn.features.sets import PRESSED, STATISTICS, height_unit, target_scale

FREE = [name for name, each in SETS.items() if each.scaled]


def never():
    return False


def surface(seed, nodes=33):
    return generate("diamond-square", nodes, 0.7, 12.0, np.random.default_rng(seed))


def test_the_sets_have_unique_columns_and_the_papers_are_the_23():
    assert SETS["paper"].columns == dataset.INPUTS
    assert [len(each.columns) for each in SETS.values()] == [23, 23, 30]
    for each in SETS.values():
        assert len(set(each.columns)) == len(each.columns) == len(each.units)
    with pytest.raises(InputError, match="paper, dimensionless, hybrid"):
        chosen("all")


@pytest.mark.parametrize("name", FREE)
@given(
    seed=st.integers(0, 99),
    delta=st.floats(0.5, 40.0),
    heights=st.integers(-40, 40),
    length=st.integers(-40, 40),
)
@settings(max_examples=20, deadline=None)
def test_scaling_heights_and_delta_or_the_length_changes_nothing(
    name, seed, delta, heights, length
):
    z = surface(seed)
    first = SurfaceFeatures(z, (1000.0, 1000.0)).features(SETS[name], np.array([delta]))
    up, side = 2.0**heights, 1000.0 * 2.0**length
    again = SurfaceFeatures(z * up, (side, side)).features(SETS[name], np.array([delta * up]))
    # Powers of two round nothing: what remains is the rounding inside the logarithm and solver.
    np.testing.assert_allclose(again, first, rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("name", FREE)
def test_units_other_than_powers_of_two_change_no_more_than_rounding(name):
    z, deltas = surface(3, 129), np.array([2.0, 11.0, 40.0])
    micrometres = SurfaceFeatures(z, (1000.0, 1000.0)).features(SETS[name], deltas)
    millimetres = SurfaceFeatures(z / 1000, (1.0, 1.0)).features(SETS[name], deltas / 1000)
    other_length = SurfaceFeatures(z, (0.3, 0.3)).features(SETS[name], deltas)
    np.testing.assert_allclose(millimetres, micrometres, rtol=1e-9)
    np.testing.assert_allclose(other_length, micrometres, rtol=1e-9)


def test_the_papers_features_know_their_units():
    z = surface(3)
    small = SurfaceFeatures(z / 1000, (1.0, 1.0)).features(SETS["paper"], np.array([0.01]))
    large = SurfaceFeatures(z, (1000.0, 1000.0)).features(SETS["paper"], np.array([10.0]))
    assert not np.allclose(small, large)


def test_force_over_its_scale_has_no_unit():
    z = surface(5)
    found = []
    for up, side, modulus in ((1.0, 1000.0, 1.0), (1e-3, 4.0, 210e3)):
        contact = bem.solve(z * up, side, 8.0 * up, modulus=modulus)
        statistics = SurfaceFeatures(z * up, (side, side)).statistics[None]
        delta = np.array([8.0 * up])
        for target, value in (
            ("force", contact.force),
            ("mean_gap", contact.mean_gap),
            ("largest_pressure", contact.largest_pressure),
            ("perimeter", contact.perimeter),
            ("area_percent", contact.area_percent),
        ):
            scale = target_scale(SETS["hybrid"], target, statistics, delta, side, modulus)
            found.append(value / scale[0])
    np.testing.assert_allclose(found[:5], found[5:], rtol=1e-6)


def test_the_height_unit_neither_overflows_nor_vanishes():
    statistics = np.zeros((3, 22))
    unit = height_unit(statistics, np.array([1e-200, 3.0, 1e200]))
    np.testing.assert_allclose(unit, [1e-200, 3.0, 1e200], rtol=1e-15)


@pytest.mark.parametrize("shape", [(33, 33), (20, 20), (40, 57), (129, 129), (130, 130), (34, 100)])
def test_any_grid_has_features_and_few_nodes_are_their_own_blocks(shape):
    z = np.random.default_rng(0).normal(size=shape).cumsum(axis=0)
    sides = (float(shape[0] - 1), float(shape[1] - 1))
    pressed = SurfaceFeatures(z, sides)
    deltas = np.array([0.2, 3.0, 30.0])
    found = pressed.features(SETS["hybrid"], deltas)
    assert np.isfinite(found).all()
    values = dict(zip(PRESSED, pressed.pressed(3.0), strict=True))
    assert values["bearing_share"] == np.mean(z > z.max() - 3.0)
    assert values["refined_share"] <= values["bearing_share"]
    if max(shape) <= 33:  # nothing stands above its own solution, whatever that leaves there
        assert values["refined_share"] == values["refined_interference/delta"] == 0
        solved = bem.solve(z, sides, 3.0)
        assert values["coarse_area_percent"] == pytest.approx(solved.area_percent, abs=0.5)
        assert values["coarse_force/(E*.L.delta)"] == pytest.approx(
            solved.force / (pressed.length * 3.0), rel=0.02
        )
    else:
        assert values["refined_share"] > 0


def test_a_delta_that_reaches_no_block_still_has_features():
    z = np.zeros((66, 66))
    z[30, 30] = 10.0
    z += np.random.default_rng(0).uniform(0, 1e-3, z.shape)
    values = SurfaceFeatures(z, (65.0, 65.0)).pressed(0.5)
    assert values == (1 / 66**2, 0.5 / 66**2 / 0.5, 0.0, 0.0, 0.0, 1 / 66**2, 0.5 / 66**2 / 0.5)


def test_the_mean_displacement_follows_from_the_force():
    z = surface(7, 129)
    for delta in (5.0, 15.0, 40.0):
        solved = bem.solve(z, 1000.0, delta)
        predicted = SurfaceFeatures(z, (1000.0, 1000.0)).compliance(delta) * solved.force / 1000.0
        assert predicted == pytest.approx(float(solved.displacement.mean()), rel=0.03)


@pytest.mark.parametrize("delta", [0.0, -1.0, np.nan, np.inf])
def test_a_delta_that_no_contact_has_is_refused(delta):
    with pytest.raises(InputError, match="above 0"):
        SurfaceFeatures(surface(0), (1.0, 1.0)).features(SETS["paper"], np.array([delta]))


def test_a_flat_surface_is_refused_with_its_reason():
    with pytest.raises(InputError, match="flat surface"):
        SurfaceFeatures(np.ones((9, 9)), (1.0, 1.0)).features(SETS["paper"], np.array([1.0]))


@pytest.mark.parametrize("name", list(SETS))
def test_rows_of_a_database_and_their_surfaces_have_the_same_features(solved, name):
    pressed = pressed_rows(solved, Executor(), never) if SETS[name].needs_surface else None
    rows = dataset.read(solved, "area", features=name, pressed=pressed)
    assert rows.names == SETS[name].columns
    with Reader(solved) as reader:
        scene = reader.scene
    plan = parameters(scene, 0, scene.samples)
    for row in (0, 17, 89):
        own = SurfaceFeatures(surface_of(scene, plan, row), (scene.surface.side,) * 2)
        again = own.features(SETS[name], plan.delta[row : row + 1])
        np.testing.assert_array_equal(rows.inputs[row], again[0])


def test_what_was_computed_is_kept_and_only_what_changed_is_computed_again(
    database, change, monkeypatch
):
    first = pressed_rows(database, Executor(), never)
    assert np.isfinite(first).all()
    asked = []
    compute = regeneration.compute_block

    def counting(scene, block):
        asked.append(block)
        return compute(scene, block)

    monkeypatch.setattr(regeneration, "compute_block", counting)
    np.testing.assert_array_equal(pressed_rows(database, Executor(), never), first)
    assert not asked
    kept = database.with_name(f"{database.name}.pressed.npz")
    with np.load(kept) as file:
        content = dict(file)
    content["inputs"][5] += 1.0
    np.savez(kept, **content)
    np.testing.assert_array_equal(pressed_rows(database, Executor(), never), first)
    assert asked == [(5, 6)]
    kept.write_bytes(kept.read_bytes()[:1000])
    np.testing.assert_array_equal(pressed_rows(database, Executor(), never), first)
    assert len(asked) == 4
    assert not list(kept.parent.glob(".*.npz*"))


def test_kept_features_that_somebody_else_wrote_are_computed_anew(database):
    job = regeneration._Job(database)
    values, names = np.zeros((len(job.inputs), len(PRESSED))), ("key", "inputs", "values")
    header = "{'descr': '<f8', 'fortran_order': False, 'shape': (4611686018427387904,), }"
    promise = b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header.encode()
    for inputs in (np.float64(1.0), np.zeros(3), job.inputs.astype("S8"), job.inputs[:5], promise):
        with zipfile.ZipFile(job.cache, "w") as archive:
            for name, content in zip(names, (np.array(job.key), inputs, values), strict=True):
                buffer = io.BytesIO()
                np.save(buffer, content)
                data = content if isinstance(content, bytes) else buffer.getvalue()
                archive.writestr(f"{name}.npy", data)
        assert np.isnan(job._kept()).all()


def test_an_interrupted_run_keeps_what_was_finished(database):
    calls = iter([False, True, True])
    part = pressed_rows(database, Executor(), lambda: next(calls))
    finished = np.isfinite(part).all(axis=1)
    assert 0 < finished.sum() < 90
    with np.load(database.with_name(f"{database.name}.pressed.npz")) as file:
        np.testing.assert_array_equal(np.isfinite(file["values"]).all(axis=1), finished)
    assert np.isfinite(pressed_rows(database, Executor(), never)).all()


def test_surfaces_that_cannot_be_generated_anew_are_refused(database, change):
    change("height_mean", [40], 1.0)
    with pytest.raises(InputError, match="row 40, generated anew from its scene, is another"):
        pressed_rows(database, Executor(), never)


def test_samples_that_share_a_surface_share_its_generation(tmp_path):
    (tmp_path / "s.toml").write_text(
        "samples = 20\nsamples_per_surface = 5\n[surface]\nnodes = 17\n"
    )
    assert gen_main(["run", str(tmp_path / "s.toml"), "-o", str(tmp_path / "s.h5")]) == 0
    pressed = pressed_rows(tmp_path / "s.h5", Executor(), never)
    rows = dataset.read(tmp_path / "s.h5", "force", features="hybrid", pressed=pressed)
    assert rows.size == 20
    assert np.unique(rows.groups).size == 4
    assert rows.unit == "1"
    np.testing.assert_allclose(rows.scale, 1000.0 * rows.described[:, 0])
    assert len(STATISTICS) == 22
