"""Feature sets: columns, units, and what a change of units leaves as it was."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import bem
from gen.quantities import stored_quantities
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


def test_the_sets_have_unique_columns_and_the_papers_are_the_23():
    assert SETS["paper"].columns == ("delta", *(column.name for column in TABLE_1))
    assert [len(each.columns) for each in SETS.values()] == [23, 23, 30, 0]
    for each in SETS.values():
        assert len(set(each.columns)) == len(each.columns) == len(each.units)
    with pytest.raises(InputError, match="paper, dimensionless, hybrid"):
        chosen("all")


@pytest.mark.parametrize(
    ("name", "blocks"),
    [("dimensionless", None), *(("hybrid", each) for each in BLOCK_COUNTS)],
)
def test_what_surrogates_see_has_no_units_either(name, blocks):
    """Unit names the columns, each once; a power of two rounds nothing."""
    wanted = chosen(name, roots=True, blocks=blocks)
    assert len(set(wanted.columns)) == len(wanted.columns) == len(wanted.units)
    assert wanted.rooted
    assert wanted.blocks == (blocks or 0)
    z, deltas = surface(4, 129), np.array([0.5, 6.0, 30.0])
    first = wanted.of(patch(z, 1000.0).rows(wanted, deltas))
    assert first.shape == (3, len(wanted.columns))
    again = wanted.of(patch(z / 1024, 8.0).rows(wanted, deltas / 1024))
    np.testing.assert_allclose(again, first, rtol=1e-12, atol=1e-13)
    roots = [name for name in wanted.columns if name.startswith("sqrt(")]
    for root in roots:
        column = wanted.columns.index(root[5:-1])
        np.testing.assert_allclose(
            first[:, wanted.columns.index(root)] ** 2, first[:, column]
        )


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


@pytest.mark.parametrize("name", [name for name, each in SETS.items() if each.scaled])
def test_elastic_bodies_have_the_feature_of_very_hard_ones(name):
    wanted = chosen(name, [scene(VARIED), scene("")])
    on_surface = patch(surface(4), 1000.0)
    elastic = wanted.of(on_surface.rows(wanted, DELTA))
    np.testing.assert_allclose(
        wanted.of(on_surface.rows(wanted, DELTA, 1e9)), elastic, rtol=1e-9, atol=1e-4
    )
    soft = wanted.of(on_surface.rows(wanted, DELTA, 0.01))
    place = wanted.columns.index(SCALED_HARDNESS)
    assert (soft[:, place] < elastic[:, place]).all()
    alone = chosen(name, [scene(VARIED)]).of(
        on_surface.rows(chosen(name, [scene(VARIED)]), DELTA, 0.01)
    )
    np.testing.assert_array_equal(soft[:, : place + 1], alone)
    if wanted.needs_surface:
        assert wanted.columns[-1] == PLASTIC
        np.testing.assert_array_equal(elastic[:, -1], 0.0)
        for row, delta in zip(soft, DELTA, strict=True):
            # 33 x 33 nodes are the blocks.
            pressed = bem.solve(surface(4), 1000.0, delta, hardness=0.01, rtol=LOOSE)
            force = pressed.force
            assert row[-1] ** 2 == pytest.approx(force / (0.01 * 1000.0**2), rel=1e-9)
    else:
        assert wanted.columns[-1] == SCALED_HARDNESS
