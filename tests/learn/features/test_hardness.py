"""Hardness over E*: a feature of bodies that yield, and of no other."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import bem
from gen.scene import Scene
from gen.surface import generate
from learn import dataset
from learn.features import SETS, SurfaceFeatures, chosen
from learn.features.hardness import hardness_limits, hardness_ratios, modulus
from learn.features.regeneration import compute_block
from learn.features.sets import HARDNESS, PLASTIC, SCALED_HARDNESS, no_yield

DELTA = np.array([6.0, 25.0])


def scene(text):
    return Scene.parse(f"samples = 8\n[surface]\nnodes = 17\n[contact]\n{text}", "test")


def surface(nodes=33):
    return generate("diamond-square", nodes, 0.7, 12.0, np.random.default_rng(4))


def test_limits_are_those_of_the_scene_over_its_modulus():
    assert hardness_limits(scene("")) is None
    assert hardness_limits(scene("hardness_ratio = 0.01")) == pytest.approx((0.01, 0.01))
    steel = scene("modulus = 210e3\npoisson = 0.3\nhardness = [1000.0, 4000.0]")
    e_star = 210e3 / 0.91
    assert modulus(steel) == pytest.approx(e_star)
    assert hardness_limits(steel) == pytest.approx((1000 / e_star, 4000 / e_star))
    assert hardness_ratios(steel, np.array([e_star])).tolist() == pytest.approx([1.0])
    assert hardness_ratios(steel, None) is None


@pytest.mark.parametrize("name", list(SETS))
def test_the_hardness_is_a_feature_where_it_says_something(name):
    fixed, varied = chosen(name, (0.01, 0.01)), chosen(name, (0.01, 0.1))
    assert chosen(name) is SETS[name]
    assert not SETS[name].needs_hardness
    own = SCALED_HARDNESS if SETS[name].scaled else HARDNESS
    assert varied.columns == (*SETS[name].columns, own)
    assert len(varied.units) == len(varied.columns)
    assert fixed.columns == (varied.columns if SETS[name].scaled else SETS[name].columns)


@pytest.mark.parametrize("name", [name for name, each in SETS.items() if each.scaled])
def test_areas_at_the_same_features_are_the_same(name):
    """Heights times 2 at the same length have twice the pressures: so has the hardness."""
    wanted, z = chosen(name, (0.001, 1.0)), surface()
    first = SurfaceFeatures(z, (1000.0, 1000.0)).features(wanted, DELTA, 0.01)
    higher = SurfaceFeatures(2 * z, (1000.0, 1000.0)).features(wanted, 2 * DELTA, 0.02)
    longer = SurfaceFeatures(z, (2000.0, 2000.0)).features(wanted, DELTA, 0.005)
    np.testing.assert_allclose(higher, first, rtol=1e-9)
    np.testing.assert_allclose(longer, first, rtol=1e-9)


def test_the_coarse_contact_is_capped_by_the_hardness():
    rough = SurfaceFeatures(surface(65), (1000.0, 1000.0))
    elastic = rough.coarse_contact(20.0)
    capped = rough.coarse_contact(20.0, 0.01)
    assert elastic.largest_pressure > 0.01
    assert capped.largest_pressure <= 0.01
    assert capped.area_percent > elastic.area_percent
    again = rough.coarse_contact(20.0, 2 * elastic.largest_pressure)
    assert again.pressure.tobytes() == elastic.pressure.tobytes()
    assert rough.coarse_means(20.0, 0.01)[1] > 0


def test_features_without_a_hardness_are_a_bug():
    with pytest.raises(ValueError, match="need the hardness"):
        SurfaceFeatures(surface(), (1.0, 1.0)).features(chosen("paper", (0.1, 0.2)), DELTA)


def test_rows_of_a_database_have_the_features_of_their_own_hardness(yielding):
    rows = dataset.read(yielding, features="dimensionless")
    assert rows.names[-1] == SCALED_HARDNESS
    raw = dataset.read(yielding, features="paper")
    assert raw.names[-1] == HARDNESS
    assert np.exp(np.ptp(np.log(raw.inputs[:, -1]))) > 10
    assert raw.inputs[:, -1].min() >= 0.003
    inputs, values = compute_block(Scene.from_text(rows.source["scene"]), (0, 4, (0.0,) * 4))
    assert inputs.shape == (4, 24)
    np.testing.assert_allclose(inputs[:, -1], raw.inputs[:4, -1], rtol=1e-12)
    softer = Scene.from_text(rows.source["scene"].replace("0.003, 0.1", "0.003, 0.004"))
    assert (compute_block(softer, (0, 4, (0.0,) * 4))[1] != values).any()
    assert dataset.read(yielding, target="yielded_percent").target.max() > 0


@given(
    st.integers(0, 999),
    st.floats(0.0, 1.0),
    st.sampled_from([5, 9, 17]),
    st.floats(0.5, 60.0),
)
def test_no_elastic_pressure_reaches_the_ceiling_of_the_hardness(seed, hurst, nodes, delta):
    heights = generate("diamond-square", nodes, hurst, 12.0, np.random.default_rng(seed))
    contact = bem.solve(heights, (1000.0, 1000.0), delta)
    ceiling = float(no_yield(np.array([delta]), 1000.0, float(nodes))[0, 0])
    assert contact.pressure.max() < ceiling  # E* is 1 MPa


@pytest.mark.parametrize("name", [name for name, each in SETS.items() if each.scaled])
def test_elastic_bodies_have_the_feature_of_very_hard_ones(name):
    wanted = chosen(name, (0.003, 0.3), elastic=True)
    on_surface = SurfaceFeatures(surface(), (1000.0, 1000.0))
    elastic = on_surface.features(wanted, DELTA)
    np.testing.assert_allclose(
        on_surface.features(wanted, DELTA, 1e9), elastic, rtol=1e-9, atol=1e-4
    )
    soft = on_surface.features(wanted, DELTA, 0.01)
    place = wanted.columns.index(SCALED_HARDNESS)
    assert (soft[:, place] < elastic[:, place]).all()
    alone = on_surface.features(chosen(name, (0.003, 0.3)), DELTA, 0.01)
    np.testing.assert_array_equal(soft[:, : place + 1], alone)
    if wanted.needs_surface:
        assert wanted.columns[-1] == PLASTIC
        np.testing.assert_array_equal(elastic[:, -1], 0.0)
        for row, delta in zip(soft, DELTA, strict=True):
            force = on_surface.coarse_contact(delta, 0.01).force  # 33 x 33 nodes are the blocks
            assert row[-1] ** 2 == pytest.approx(force / (0.01 * 1000.0**2), rel=1e-9)
    else:
        assert wanted.columns[-1] == SCALED_HARDNESS
