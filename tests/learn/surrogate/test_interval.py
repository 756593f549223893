"""Conformal intervals: of rows, of groups, and where errors grow with the distance."""

import numpy as np
import pytest
from sklearn.linear_model import LinearRegression

from learn.surrogate.flag import from_rows
from learn.surrogate.interval import (
    RANGES,
    Growth,
    calibrate,
    fit_growth,
    quantile,
    quantile_over_groups,
)


def test_intervals_are_the_quantiles_of_the_errors():
    random = np.random.default_rng(0)
    inputs = random.normal(size=(300, 3))
    target = inputs.sum(axis=1) + random.normal(size=300)
    predicted = LinearRegression().fit(inputs[:100], target[:100]).predict(inputs)
    held, new = slice(100, 180), slice(180, None)
    found = calibrate(predicted[held], target[held], target[:100], inputs[held])
    assert found.borders.size == 0
    errors = np.sort(np.abs(predicted - target)[held])
    for level, place in ((0.5, 41), (0.8, 65), (0.9, 73), (0.95, 77)):  # ceil(81 level)
        low, high = found.ends(predicted[new], level, inputs[new])
        np.testing.assert_allclose((high - low) / 2, errors[place - 1], rtol=1e-12)
        np.testing.assert_allclose((high + low) / 2, predicted[new], rtol=1e-12)


def test_intervals_hold_where_errors_grow():
    random = np.random.default_rng(1)
    inputs = random.uniform(0.0, 10.0, size=(6000, 1))
    target = inputs[:, 0] * (1 + 0.2 * random.normal(size=6000))
    model = LinearRegression().fit(inputs[:1000], target[:1000])
    held = slice(1000, 3000)
    found = calibrate(model.predict(inputs[held]), target[held], target[:1000], inputs[held])
    assert found.borders.size == RANGES - 1
    predicted, truth = model.predict(inputs[3000:]), target[3000:]
    for level in (0.5, 0.9, 0.95):
        share, low, high = found.coverage(predicted, truth, level, inputs[3000:])
        assert share == pytest.approx(level, abs=0.03)
        small = predicted < np.quantile(predicted, 0.2)
        inside = ((low <= truth) & (truth <= high))[small]
        assert inside.mean() == pytest.approx(level, abs=0.06)


def test_too_few_rows_for_a_level_make_an_infinite_interval():
    scores = np.arange(1.0, 10.0)
    assert quantile(scores, 0.9) == 9.0
    assert quantile(scores, 0.91) == np.inf


def test_intervals_of_roots_are_those_of_the_root_squared():
    random = np.random.default_rng(2)
    root = random.uniform(0.0, 4.0, size=4000)
    predicted = np.maximum(root + 0.1 * random.normal(size=4000), 0.0) ** 2
    held, new = slice(0, 2000), slice(2000, None)
    truth = root**2
    nothing = np.empty((2000, 0))
    found = calibrate(predicted[held], truth[held], truth, nothing, root=True)
    low, high = found.ends(predicted[new], 0.9, nothing)
    assert (low >= 0).all()
    inside = (low <= truth[new]) & (truth[new] <= high)
    for first, last in ((0, 1), (1, 2), (2, 3), (3, 4)):  # absolute errors grow with the root
        there = (root[new] >= first) & (root[new] < last)
        assert inside[there].mean() == pytest.approx(0.9, abs=0.05)


def spread_out(rows, seed, rate):
    """Features, their distances, and errors whose logarithm grows with the squared distance."""
    random = np.random.default_rng(seed)
    inputs = random.normal(size=(rows, 6))
    distance = from_rows(inputs)
    errors = np.abs(random.normal(size=rows)) * np.exp(rate * distance.of(inputs) ** 2)
    return inputs, distance, errors


def test_no_error_grows_beyond_the_limit_of_the_flag():
    inputs, distance, _ = spread_out(500, 2, 0.0)
    growth = Growth(distance, 0.5)
    near, far, lost = growth.at(np.array([np.zeros(6), np.full(6, 1e200), np.full(6, np.nan)]))
    assert near < 1 < far == lost == pytest.approx(np.exp(0.5 * (distance.limit**2 - 1)))
    assert np.mean(np.log(growth.at(inputs))) == pytest.approx(0.0, abs=0.05)


def test_far_rows_are_covered_as_often_as_near_ones():
    inputs, distance, errors = spread_out(60_000, 3, 0.5)
    random = np.random.default_rng(4)
    truth = random.choice([-1.0, 1.0], 60_000) * errors
    held, new = slice(0, 30_000), slice(30_000, None)
    nothing = np.zeros(60_000)
    squares = distance.of(inputs) ** 2
    growth = fit_growth(distance, squares[held], errors[held], np.zeros(30_000, dtype=np.int64))
    far = (squares[new] > np.quantile(squares, 0.9)) & (squares[new] <= distance.limit**2)
    shares = []
    for known in (None, growth):
        found = calibrate(nothing[held], truth[held], nothing[held], inputs[held], growth=known)
        low, high = found.ends(nothing[new], 0.9, inputs[new])
        inside = (low <= truth[new]) & (truth[new] <= high)
        assert inside.mean() == pytest.approx(0.9, abs=0.02)
        shares.append(inside[far].mean())
    assert shares[0] < 0.8
    assert shares[1] == pytest.approx(0.9, abs=0.03)


@pytest.mark.parametrize("groups", [9, 19])
def test_rows_of_new_groups_are_covered_as_often_as_asked(groups):
    random = np.random.default_rng(5)
    covered = []
    for _ in range(2000):
        sizes = random.lognormal(0.0, 0.7, groups + 1)  # of the errors of each group
        known = tuple(
            np.sort(np.abs(size * random.normal(size=random.integers(5, 40))))
            for size in sizes[:-1]
        )
        covered.append(abs(sizes[-1] * random.normal()) <= quantile_over_groups(known, 0.9))
    slack = 3 * np.sqrt(0.09 / 2000)
    assert 0.9 - slack < np.mean(covered) < 0.9 + 1 / (groups + 1) + slack


def test_another_group_counts_as_one_more_than_those_that_are_known():
    known = np.array([1.0, 2.0]), np.array([3.0, 4.0])
    assert quantile_over_groups(known, 0.5) == 3.0
    assert quantile_over_groups(known, 0.9) == np.inf
