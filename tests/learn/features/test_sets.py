"""Feature sets: columns, units, and what a change of units leaves as it was."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import bem
from gen.runtime.errors import InputError
from gen.surface import generate
from learn.columns import INPUTS
from learn.features import SETS, SurfaceFeatures, chosen
from learn.features.pressed import BLOCK_COUNTS
from learn.features.sets import height_unit, target_scale

FREE = [name for name, each in SETS.items() if each.scaled]


def surface(seed, nodes=33):
    return generate("diamond-square", nodes, 0.7, 12.0, np.random.default_rng(seed))


def test_the_sets_have_unique_columns_and_the_papers_are_the_23():
    assert SETS["paper"].columns == INPUTS
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
@pytest.mark.parametrize("blocks", BLOCK_COUNTS)
def test_what_surrogates_see_has_no_units_either(name, blocks):
    """Unit names the columns, each once; a power of two rounds nothing."""
    wanted = chosen(name, roots=True, blocks=blocks)
    assert len(set(wanted.columns)) == len(wanted.columns) == len(wanted.units)
    assert wanted.rooted
    assert wanted.blocks == (blocks if name == "hybrid" else 0)
    z, deltas = surface(4, 129), np.array([0.5, 6.0, 30.0])
    first = SurfaceFeatures(z, (1000.0, 1000.0)).features(wanted, deltas)
    assert first.shape == (3, len(wanted.columns))
    again = SurfaceFeatures(z / 1024, (8.0, 8.0)).features(wanted, deltas / 1024)
    np.testing.assert_allclose(again, first, rtol=1e-12, atol=1e-13)
    roots = [name for name in wanted.columns if name.startswith("sqrt(")]
    for root in roots:
        column = wanted.columns.index(root[5:-1])
        np.testing.assert_allclose(first[:, wanted.columns.index(root)] ** 2, first[:, column])


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
