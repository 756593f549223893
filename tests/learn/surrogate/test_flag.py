"""Rows that no feature's range flags, and that are unusual all the same."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from learn.features import SETS
from learn.features.sets import Rows
from learn.surrogate.flag import INSIDE, from_maps, from_surfaces, reasons_of


def correlated(rows, seed, size=3):
    """Rows of features of which the last is nearly the sum of the others."""
    random = np.random.default_rng(seed)
    free = random.normal(size=(rows, size - 1)) * 10.0 ** np.arange(size - 1)
    return np.column_stack([free, free.sum(axis=1) + 0.1 * random.normal(size=rows)])


def from_rows(inputs):
    """Distances from rows of one cloud, each of a surface of its own."""
    return from_surfaces(inputs, np.zeros(len(inputs), int), np.arange(len(inputs)) % 5)[0]


def test_rows_against_the_correlation_are_outside_though_in_every_range():
    distance = from_rows(correlated(2000, 0))
    inputs = correlated(2000, 0)
    odd = np.array([[1.0, 5.0, -6.0]])
    assert ((inputs.min(axis=0) < odd) & (odd < inputs.max(axis=0))).all()
    assert distance.of(odd)[0] > 2 * distance.limit
    fresh = distance.of(correlated(4000, 1)) <= distance.limit
    assert fresh.mean() == pytest.approx(INSIDE, abs=0.01)


def test_the_limit_is_a_distance_of_each_row_from_other_parts():
    inputs, parts = correlated(200, 0), np.arange(200) % 5
    found, far, nearest = from_surfaces(inputs, np.zeros(200, int), parts)
    assert found.limit == np.quantile(far, INSIDE, method="higher")
    assert (nearest == 0).all()
    moved = inputs + np.where(parts == 2, 5.0, 0.0)[:, None]
    _, others, _ = from_surfaces(moved, np.zeros(200, int), parts)
    alone = from_surfaces(inputs[parts != 2], np.zeros(160, int), parts[parts != 2])[0]
    np.testing.assert_allclose(others[parts == 2], alone.of(moved[parts == 2]))


@given(st.floats(1e-6, 1e6), st.floats(-1e3, 1e3))
def test_units_and_zeros_of_features_make_no_difference(factor, shift):
    inputs, fresh = correlated(100, 2), correlated(50, 3)
    one, other = from_rows(inputs), from_rows(inputs * factor + shift * factor)
    assert other.limit == pytest.approx(one.limit, rel=1e-4)
    np.testing.assert_allclose(
        other.of(fresh * factor + shift * factor), one.of(fresh), rtol=1e-4, atol=1e-6
    )


def clouds(rows, seed):
    """Rows of two kinds with nothing between them, of which the second has few, and their kinds."""
    random = np.random.default_rng(seed)
    kinds = (np.arange(rows) % 10 == 0).astype(np.int64)
    inputs = random.normal(size=(rows, 3)) * np.array([0.1, 1.0, 1.0]) + 5.0 * kinds[:, None]
    return np.column_stack([inputs, 7.0 + kinds]), kinds


def test_rows_between_two_databases_are_far_from_both():
    inputs, kinds = clouds(1000, 0)
    between = (inputs[kinds == 0].mean(axis=0) + inputs[kinds == 1].mean(axis=0))[None] / 2
    parts = np.random.default_rng(1).integers(0, 5, 1000)
    nearest, _, _ = from_surfaces(inputs, kinds, parts)
    assert nearest.of(between)[0] > 2 * nearest.limit
    assert from_rows(inputs).of(between)[0] < from_rows(inputs).limit
    fresh, _ = clouds(4000, 2)
    assert (nearest.of(fresh) <= nearest.limit).mean() == pytest.approx(INSIDE, abs=0.02)


def test_rows_of_another_kind_are_far_away():
    random = np.random.default_rng(2)
    groups = np.repeat(np.arange(20), 30)
    along = random.normal(size=600)
    inputs = np.column_stack([along, along + 0.05 * random.normal(size=600), np.zeros(600)])
    inputs += 0.1 * random.normal(size=(20, 3))[groups] * [1, 1, 0]
    found = from_maps(inputs, groups)
    assert np.mean(found.of(inputs) > found.limit) < 0.1
    odd = np.array([[1.5, -1.5, 0.0]])
    assert (np.abs(odd) < np.abs(inputs).max(axis=0) + 1e-12).all(), "in the range of each feature"
    named = replace(SETS["paper"], columns=("a", "b", "c"))
    known = SimpleNamespace(
        features=named, distance=found, low=np.full(3, -9.0), high=np.full(3, 9.0)
    )
    known.hardness_limits = None
    both = np.concatenate([odd, np.zeros((1, 3)), np.full((1, 3), 10.0)])
    rows = Rows(np.empty((3, 0)), np.ones(3), 1.0, notes=("a note", "", ""))
    first, inside, beyond = reasons_of(known, rows, both)
    assert first.startswith("a note; distance from the training")
    assert inside == ""
    assert beyond.endswith("; a 10 outside -9 to 9; b 10 outside -9 to 9; c 10 outside -9 to 9")
