"""Conformal intervals, of surfaces or maps, and the flag of rows that no feature's range flags."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from learn.features import SETS
from learn.features.rows import Rows
from learn.surrogate.interval import (
    GROWTH,
    INSIDE,
    Calibration,
    Distance,
    ErrorScale,
    Scores,
    distance_by_maps,
    fit_scale,
    rows_measured_by_surfaces,
)
from learn.surrogate.training import Training


@pytest.mark.parametrize("groups", [9, 19])
def test_rows_of_new_groups_are_covered_as_often_as_asked(groups):
    random = np.random.default_rng(5)
    covered = []
    for _ in range(2000):
        sizes = random.lognormal(0.0, 0.7, groups + 1)  # of the errors of each group
        each = np.repeat(np.arange(groups), random.integers(5, 40, groups))
        known = Scores.of(np.abs(sizes[each] * random.normal(size=each.size)), each)
        covered.append(abs(sizes[-1] * random.normal()) <= known.quantile(0.9))
    slack = 3 * np.sqrt(0.09 / 2000)
    assert 0.9 - slack < np.mean(covered) < 0.9 + 1 / (groups + 1) + slack


def test_another_group_counts_as_one_more_than_those_that_are_known():
    known = Scores.of(np.array([4.0, 2.0, 3.0, 1.0]), np.array([1, 0, 1, 0]))
    assert known.weights.sum() == 2
    assert known.quantile(0.5) == 3.0
    assert known.quantile(0.9) == np.inf
    uneven = Scores.of(np.array([4.0, 1.0, 2.0, 3.0]), np.array([0, 1, 1, 1]))
    assert uneven.quantile(0.3) == 3.0, (
        "three rows of a group weigh as much as the one of another"
    )


def test_with_one_row_a_surface_the_quantile_is_the_usual_one():
    errors = np.arange(80.0)
    for level, place in ((0.5, 41), (0.8, 65), (0.9, 73), (0.95, 77)):  # ceil(81 level)
        assert Scores.of(errors, np.arange(80)).quantile(level) == errors[place - 1]


PLAIN = ErrorScale(np.zeros(1), 0.0, 0.0, 0.0)
"""Usual errors of 1 everywhere."""


def test_intervals_of_roots_are_those_of_the_root_squared():
    scores = (Scores.of(np.linspace(0, 1, 99), np.arange(99)),)
    nothing = np.zeros((4, 1))
    low, high = Calibration(scores, PLAIN, root=True).ends(
        np.array([-1.0, 0.0, 0.25, 9.0]), 0.9, nothing
    )
    half = 88 / 98 + 1 / 98
    np.testing.assert_allclose(low, [0, 0, 0, (3 - half) ** 2])
    np.testing.assert_allclose(
        high, [half**2, half**2, (0.5 + half) ** 2, (3 + half) ** 2]
    )


def test_intervals_widen_up_to_the_limit_of_the_flag_and_have_scores_of_the_nearest_cloud():
    centres, far = (
        np.array([[0.0], [100.0]]),
        np.array([[0.0], [1.0], [2.0], [9.0], [100.0]]),
    )
    distance = Distance(centres, np.ones((2, 1, 1)), 2.0)
    scores = tuple(Scores.of(size * np.ones(99), np.arange(99)) for size in (1.0, 5.0))
    low, high = Calibration(scores, PLAIN, distance).ends(np.zeros(5), 0.9, far)
    np.testing.assert_allclose(
        high, [1.0, GROWTH.at_limit ** (1 / 16), GROWTH.at_limit, GROWTH.at_limit, 5.0]
    )
    np.testing.assert_array_equal(low, -high)
    lost = Calibration(scores, PLAIN, distance).ends(
        np.zeros(1), 0.9, np.array([[np.nan]])
    )
    assert lost[1] == GROWTH.at_limit


def test_usual_errors_follow_the_features():
    random = np.random.default_rng(1)
    inputs = random.uniform(0.0, 3.0, size=(6000, 1))
    errors = np.abs(random.normal(size=6000)) * np.exp(inputs[:, 0])
    usual = fit_scale(inputs, errors, np.zeros(6000, int), shrinkage=0.0)
    scores = (Scores.of(errors / usual.at(inputs), np.arange(6000)),)
    new = random.uniform(0.0, 3.0, size=(6000, 1))
    _, high = Calibration(scores, usual).ends(np.zeros(6000), 0.9, new)
    inside = np.abs(random.normal(size=6000)) * np.exp(new[:, 0]) <= high
    for first in (0, 1, 2):
        there = (new[:, 0] >= first) & (new[:, 0] < first + 1)
        assert inside[there].mean() == pytest.approx(0.9, abs=0.03)


def correlated(rows, seed, size=3):
    """Rows of features of which the last is nearly the sum of the others."""
    random = np.random.default_rng(seed)
    free = random.normal(size=(rows, size - 1)) * 10.0 ** np.arange(size - 1)
    return np.column_stack([free, free.sum(axis=1) + 0.1 * random.normal(size=rows)])


def from_rows(inputs):
    """Distances from rows of one cloud, each of a surface of its own."""
    parts = np.arange(len(inputs)) % 5
    return rows_measured_by_surfaces(inputs, np.zeros(len(inputs), int), parts).training


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
    measured = rows_measured_by_surfaces(inputs, np.zeros(200, int), parts)
    distances = measured.nearest.distance
    assert measured.training.limit == np.quantile(distances, INSIDE, method="higher")
    assert (measured.nearest.cloud == 0).all()
    moved = inputs + np.where(parts == 2, 5.0, 0.0)[:, None]
    moved_distances = rows_measured_by_surfaces(
        moved, np.zeros(200, int), parts
    ).nearest.distance
    seen = parts != 2
    without = rows_measured_by_surfaces(
        inputs[seen], np.zeros(160, int), parts[seen]
    ).training
    np.testing.assert_allclose(moved_distances[~seen], without.of(moved[~seen]))


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
    inputs = (
        random.normal(size=(rows, 3)) * np.array([0.1, 1.0, 1.0]) + 5.0 * kinds[:, None]
    )
    return np.column_stack([inputs, 7.0 + kinds]), kinds


def test_rows_between_two_databases_are_far_from_both():
    inputs, kinds = clouds(1000, 0)
    between = (inputs[kinds == 0].mean(axis=0) + inputs[kinds == 1].mean(axis=0))[
        None
    ] / 2
    parts = np.random.default_rng(1).integers(0, 5, 1000)
    nearest = rows_measured_by_surfaces(inputs, kinds, parts).training
    assert nearest.of(between)[0] > 2 * nearest.limit
    assert from_rows(inputs).of(between)[0] < from_rows(inputs).limit
    fresh, _ = clouds(4000, 2)
    assert (nearest.of(fresh) <= nearest.limit).mean() == pytest.approx(INSIDE, abs=0.02)


@pytest.fixture(scope="module")
def of_maps():
    """Features of twenty maps, of which the first two are nearly equal, and their distances."""
    random = np.random.default_rng(2)
    groups = np.repeat(np.arange(20), 30)
    along = random.normal(size=600)
    inputs = np.column_stack(
        [along, along + 0.05 * random.normal(size=600), np.zeros(600)]
    )
    inputs += 0.1 * random.normal(size=(20, 3))[groups] * [1, 1, 0]
    return inputs, distance_by_maps(inputs, groups)


ODD = np.array([[1.5, -1.5, 0.0]])  # within the range of each feature


def test_hardly_any_rows_of_known_maps_are_beyond_the_limit(of_maps):
    inputs, distance = of_maps
    assert np.mean(distance.of(inputs) > distance.limit) < 0.1


def test_rows_of_another_kind_are_far_away(of_maps):
    inputs, distance = of_maps
    assert (np.abs(ODD) < np.abs(inputs).max(axis=0) + 1e-12).all()
    assert distance.of(ODD)[0] > distance.limit


def test_reasons_name_notes_distance_and_features(of_maps):
    training = Training(
        card={},
        features=replace(SETS["paper"], columns=("a", "b", "c")),
        low=np.full(3, -9.0),
        high=np.full(3, 9.0),
        distance=of_maps[1],
        modulus=1.0,
        boundary="free",
    )
    inputs = np.concatenate([ODD, np.zeros((1, 3)), np.full((1, 3), 10.0)])
    rows = Rows(np.empty((3, 0)), np.ones(3), 1.0, notes=("a note", "", ""))
    far, inside, beyond = training.reasons(rows, inputs)
    assert far.startswith("a note; distance from the training")
    assert inside == ""
    assert beyond.endswith(
        "; a 10 outside -9 to 9; b 10 outside -9 to 9; c 10 outside -9 to 9"
    )
