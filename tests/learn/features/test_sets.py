"""Feature sets: columns, units, and what a change of units leaves as it was."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import bem
from gen.quantities import LIKE_PRESSURES, Powers, stored_quantities
from gen.runtime.errors import InputError
from gen.scene import Scene
from gen.schema import TABLE_1
from gen.surface import generate
from learn.features import OF_SURFACES, SETS, SurfaceFeatures, chosen
from learn.features.columns import BLOCK_COUNTS, HARDNESS, PLASTIC, SCALED_HARDNESS
from learn.features.rows import Rows
from learn.features.surface import LOOSE


def surface(seed, nodes=33):
    return generate("diamond-square", nodes, 0.7, 12.0, np.random.default_rng(seed))


def patch(heights, side):
    step = side / (len(heights) - 1)
    return SurfaceFeatures(heights, (side, side), (step, step))


def test_the_papers_features_are_delta_and_the_22_statistics():
    assert SETS["paper"].columns == ("delta", *(column.name for column in TABLE_1))


@pytest.mark.parametrize(
    ("name", "number"),
    [("paper", 23), ("dimensionless", 23), ("hybrid", 30), ("scene", 0)],
)
def test_the_sets_have_unique_columns_each_with_a_unit(name, number):
    features = SETS[name]
    assert len(set(features.columns)) == len(features.columns) == number
    assert len(features.units) == number


def test_an_unknown_set_is_refused_with_those_that_there_are():
    with pytest.raises(InputError, match="paper, dimensionless, hybrid"):
        chosen("all")


OF_SURROGATES = pytest.mark.parametrize(
    ("name", "blocks"),
    [("dimensionless", None), *(("hybrid", each) for each in BLOCK_COUNTS)],
)
DELTAS = np.array([0.5, 6.0, 30.0])


@OF_SURROGATES
def test_surrogates_see_unique_columns_each_with_a_unit(name, blocks):
    wanted = chosen(name, roots=True, blocks=blocks)
    assert len(set(wanted.columns)) == len(wanted.columns) == len(wanted.units)
    assert wanted.rooted
    assert wanted.blocks == (blocks or 0)


@OF_SURROGATES
def test_what_surrogates_see_has_no_units_either(name, blocks):
    """A power of two rounds nothing."""
    wanted = chosen(name, roots=True, blocks=blocks)
    z = surface(4, 129)
    first = wanted.of(patch(z, 1000.0).rows(wanted, DELTAS))
    again = wanted.of(patch(z / 1024, 8.0).rows(wanted, DELTAS / 1024))
    assert first.shape == (3, len(wanted.columns))
    np.testing.assert_allclose(again, first, rtol=1e-12, atol=1e-13)


@OF_SURROGATES
def test_roots_are_those_of_the_columns_that_they_name(name, blocks):
    wanted = chosen(name, roots=True, blocks=blocks)
    features = wanted.of(patch(surface(4), 1000.0).rows(wanted, DELTAS))
    values = dict(zip(wanted.columns, features.T, strict=True))
    roots = [column for column in wanted.columns if column.startswith("sqrt(")]
    for root in roots:
        np.testing.assert_allclose(values[root] ** 2, values[root[5:-1]])


def test_every_quantity_over_its_scale_has_no_unit():
    z = surface(5)
    found = []
    for up, side, e_star in ((1.0, 1000.0, 1.0), (1e-3, 4.0, 210e3)):
        contact = bem.solve(z * up, side, 8.0 * up, modulus=e_star)
        described = patch(z * up, side).description
        statistics = np.array([list(described.values.values())])
        delta = np.array([8.0 * up])
        learnt = [
            each for each in stored_quantities() if not each.per_node and not each.code
        ]
        for quantity in learnt:
            scale = SETS["hybrid"].scale(
                quantity.powers, Rows(statistics, delta, side), e_star
            )
            found.append(quantity.of(contact) / scale[0])
    half = len(found) // 2
    np.testing.assert_allclose(found[:half], found[half:], rtol=1e-6)


def test_the_height_unit_neither_overflows_nor_vanishes():
    statistics = np.zeros((3, 22))
    unit = Rows(statistics, np.array([1e-200, 3.0, 1e200]), 1000.0).height_unit
    np.testing.assert_allclose(unit, [1e-200, 3.0, 1e200], rtol=1e-15)


DELTA = np.array([6.0, 25.0])


FIXED, VARIED = "hardness_ratio = 0.01", "hardness_ratio = [0.003, 0.3]"


def scene(text):
    return Scene.parse(f"samples = 8\n[surface]\nnodes = 17\n[contact]\n{text}", "test")


@pytest.mark.parametrize("name", OF_SURFACES)
def test_the_hardness_is_a_feature_where_it_says_something(name):
    fixed, varied = (chosen(name, [scene(each)]) for each in (FIXED, VARIED))
    assert chosen(name) == chosen(name, [scene("")]) == SETS[name]
    own = SCALED_HARDNESS if SETS[name].scaled else HARDNESS
    assert varied.columns == (*SETS[name].columns, own)
    assert len(varied.units) == len(varied.columns)
    assert fixed.columns == (varied.columns if SETS[name].scaled else SETS[name].columns)


@given(
    st.integers(0, 999),
    st.floats(0.0, 1.0),
    st.sampled_from([5, 9, 17]),
    st.floats(0.5, 60.0),
)
def test_no_elastic_pressure_reaches_the_ceiling_of_the_hardness(
    seed, hurst, nodes, delta
):
    heights = generate("diamond-square", nodes, hurst, 12.0, np.random.default_rng(seed))
    contact = bem.solve(heights, (1000.0, 1000.0), delta)
    rows = Rows(np.ones((1, 22)), np.array([delta]), 1000.0, nodes=float(nodes))
    assert contact.pressure.max() < rows.capped().hardness_ratio[0]  # E* is 1 MPa


WITHOUT_UNITS = [name for name, features in SETS.items() if features.scaled]


def features_of(wanted, hardness_ratio=None):
    """Features of one surface at two displacements."""
    return wanted.of(patch(surface(4), 1000.0).rows(wanted, DELTA, hardness_ratio))


DOUBLED = {
    "heights": Powers(heights=1, lengths=0, modulus=0),
    "lengths": Powers(heights=0, lengths=1, modulus=0),
    "modulus": Powers(heights=0, lengths=0, modulus=1),
}


def features_by_pressure(name, heights, length, modulus):
    """Features of one surface at two pressures, with all numbers in other units of measurement.

    Pressures and the hardness are multiplied by the powers that `gen.quantities` declares.
    """
    powers = LIKE_PRESSURES
    factor = heights**powers.heights * length**powers.lengths * modulus**powers.modulus
    wanted = chosen(name, [scene(VARIED)], roots=True, load="pressure")
    rough = patch(heights * surface(4), length * 1000.0)
    pressures = factor * np.array([1e-4, 2e-3])
    hardness = factor * 0.01
    rows = rough.rows(wanted, pressures, hardness / modulus, e_star=modulus)
    return wanted.of(rows)


@pytest.mark.parametrize("name", WITHOUT_UNITS)
@pytest.mark.parametrize("doubled", DOUBLED)
def test_features_by_pressure_keep_when_a_unit_of_measurement_is_doubled(name, doubled):
    factors = [2.0**power for power in DOUBLED[doubled]]
    before = features_by_pressure(name, 1.0, 1.0, 1.0)
    after = features_by_pressure(name, *factors)
    np.testing.assert_allclose(after, before, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("name", WITHOUT_UNITS)
def test_elastic_bodies_have_the_features_of_very_hard_ones(name):
    wanted = chosen(name, [scene(VARIED), scene("")])
    np.testing.assert_allclose(
        features_of(wanted, 1e9), features_of(wanted), rtol=1e-9, atol=1e-4
    )


@pytest.mark.parametrize("name", WITHOUT_UNITS)
def test_the_feature_of_the_hardness_is_smaller_for_softer_bodies(name):
    wanted = chosen(name, [scene(VARIED), scene("")])
    place = wanted.columns.index(SCALED_HARDNESS)
    soft, elastic = features_of(wanted, 0.01), features_of(wanted)
    assert (soft[:, place] < elastic[:, place]).all()


@pytest.mark.parametrize("name", WITHOUT_UNITS)
def test_elastic_bodies_in_a_fit_change_no_feature_of_those_that_yield(name):
    mixed = chosen(name, [scene(VARIED), scene("")])
    place = mixed.columns.index(SCALED_HARDNESS)
    alone = features_of(chosen(name, [scene(VARIED)]), 0.01)
    np.testing.assert_array_equal(features_of(mixed, 0.01)[:, : place + 1], alone)


def test_hybrid_features_have_the_plastic_area_where_some_bodies_are_elastic():
    wanted = chosen("hybrid", [scene(VARIED), scene("")])
    assert wanted.columns[-1] == PLASTIC
    np.testing.assert_array_equal(features_of(wanted)[:, -1], 0.0)
    for row, delta in zip(features_of(wanted, 0.01), DELTA, strict=True):
        # 33 x 33 nodes are the blocks.
        pressed = bem.solve(surface(4), 1000.0, delta, hardness=0.01, rtol=LOOSE)
        share = pressed.force / (0.01 * 1000.0**2)
        assert row[-1] ** 2 == pytest.approx(share, rel=1e-9)


def test_features_without_a_coarse_solve_have_no_plastic_area():
    wanted = chosen("dimensionless", [scene(VARIED), scene("")])
    assert wanted.columns[-1] == SCALED_HARDNESS
