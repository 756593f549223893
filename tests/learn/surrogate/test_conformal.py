"""Split-conformal intervals."""

import numpy as np
import pytest
from mapie.regression import SplitConformalRegressor
from sklearn.linear_model import LinearRegression

from learn.surrogate import conformal, quantiles


def test_intervals_are_mapies():
    random = np.random.default_rng(0)
    inputs = random.normal(size=(300, 3))
    target = inputs.sum(axis=1) + random.normal(size=300)
    model = LinearRegression().fit(inputs[:100], target[:100])
    held, new = slice(100, 180), slice(180, None)
    found = conformal.calibrate(model.predict(inputs[held]), target[held], target[:100])
    assert found.borders.size == 0
    for level in (0.5, 0.8, 0.9, 0.95):
        theirs = SplitConformalRegressor(model, level, prefit=True)
        theirs.conformalize(inputs[held], target[held])
        predicted, ends = theirs.predict_interval(inputs[new])
        half = found.half_width(predicted, level)
        np.testing.assert_allclose(predicted + half, ends[:, 1, 0], rtol=1e-12)
        np.testing.assert_allclose(predicted - half, ends[:, 0, 0], rtol=1e-12)


def test_intervals_hold_where_errors_grow():
    random = np.random.default_rng(1)
    inputs = random.uniform(0.0, 10.0, size=(6000, 1))
    target = inputs[:, 0] * (1 + 0.2 * random.normal(size=6000))
    model = LinearRegression().fit(inputs[:1000], target[:1000])
    held = slice(1000, 3000)
    found = conformal.calibrate(model.predict(inputs[held]), target[held], target[:1000])
    assert found.borders.size == conformal.RANGES - 1
    predicted, truth = model.predict(inputs[3000:]), target[3000:]
    for level, share, low, high in conformal.coverage(found, predicted, truth, (0.5, 0.9, 0.95)):
        assert share == pytest.approx(level, abs=0.03)
        small = predicted < np.quantile(predicted, 0.2)
        inside = ((low <= truth) & (truth <= high))[small]
        assert inside.mean() == pytest.approx(level, abs=0.06)


def test_too_few_rows_for_a_level_make_an_infinite_interval():
    scores = np.arange(1.0, 10.0)
    assert quantiles.quantile(scores, 0.9) == 9.0
    assert quantiles.quantile(scores, 0.91) == np.inf


def test_intervals_of_roots_are_those_of_the_root_squared():
    random = np.random.default_rng(2)
    root = random.uniform(0.0, 4.0, size=4000)
    predicted = np.maximum(root + 0.1 * random.normal(size=4000), 0.0) ** 2
    held, new = slice(0, 2000), slice(2000, None)
    truth = root**2
    found = conformal.calibrate(predicted[held], truth[held], truth, root=True)
    low, high = found.ends(predicted[new], 0.9)
    assert (low >= 0).all()
    inside = (low <= truth[new]) & (truth[new] <= high)
    for first, last in ((0, 1), (1, 2), (2, 3), (3, 4)):  # absolute errors grow with the root
        there = (root[new] >= first) & (root[new] < last)
        assert inside[there].mean() == pytest.approx(0.9, abs=0.05)
