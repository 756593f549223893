"""Conformal intervals: of surfaces or maps, and where errors grow with the distance."""

import numpy as np
import pytest

from learn.surrogate.flag import Distance
from learn.surrogate.interval import GROWTH, Calibration, ErrorScale, Scores, fit_scale


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
    assert uneven.quantile(0.3) == 3.0, "three rows of a group weigh as much as the one of another"


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
    np.testing.assert_allclose(high, [half**2, half**2, (0.5 + half) ** 2, (3 + half) ** 2])


def test_intervals_widen_up_to_the_limit_of_the_flag_and_have_scores_of_the_nearest_cloud():
    centres, far = np.array([[0.0], [100.0]]), np.array([[0.0], [1.0], [2.0], [9.0], [100.0]])
    distance = Distance(centres, np.ones((2, 1, 1)), 2.0)
    scores = tuple(Scores.of(size * np.ones(99), np.arange(99)) for size in (1.0, 5.0))
    low, high = Calibration(scores, PLAIN, distance).ends(np.zeros(5), 0.9, far)
    np.testing.assert_allclose(high, [1.0, GROWTH.most ** (1 / 16), GROWTH.most, GROWTH.most, 5.0])
    np.testing.assert_array_equal(low, -high)
    lost = Calibration(scores, PLAIN, distance).ends(np.zeros(1), 0.9, np.array([[np.nan]]))
    assert lost[1] == GROWTH.most


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
