"""Intervals that widen with the distance from the training."""

from dataclasses import replace

import numpy as np
import pytest

from learn import Surrogate, dataset
from learn.executor import Executor
from learn.request import Request
from learn.surrogate import error_growth, training
from learn.surrogate.conformal import calibrate
from learn.surrogate.distance import from_rows
from learn.surrogate.error_growth import CLUSTERS, Growth, clusters_of, fit_growth


def spread_out(rows, seed, rate):
    """Features, their distances, and errors whose logarithm grows with the squared distance."""
    random = np.random.default_rng(seed)
    inputs = random.normal(size=(rows, 6))
    distance = from_rows(inputs)
    errors = np.abs(random.normal(size=rows)) * np.exp(rate * distance.of(inputs) ** 2)
    return inputs, distance, errors


def test_the_rate_of_the_growth_is_found_among_kinds_with_errors_of_their_own():
    inputs, distance, errors = spread_out(6000, 0, 0.4)
    kinds = (inputs[:, 0] > 0).astype(np.int64)
    found = fit_growth(distance, distance.of(inputs) ** 2, errors * (1 + 9 * kinds), kinds)
    assert found.rate == pytest.approx(0.4, abs=0.1)


def test_errors_that_do_not_grow_leave_intervals_as_wide_everywhere():
    inputs, distance, errors = spread_out(6000, 1, -0.4)
    found = fit_growth(distance, distance.of(inputs) ** 2, errors, np.zeros(6000, dtype=np.int64))
    assert found.rate == 0
    np.testing.assert_array_equal(found.at(inputs), 1.0)
    few = fit_growth(distance, np.ones(2), np.ones(2), np.arange(2))
    assert few.rate == 0, "nothing to compare"


def test_few_rows_say_little():
    found = []
    for seed in range(40):
        inputs, distance, errors = spread_out(20, seed, 0.0)
        kinds = np.zeros(20, dtype=np.int64)
        found.append(fit_growth(distance, distance.of(inputs) ** 2, errors, kinds))
    factors = [np.exp(each.rate * each.distance.limit**2) for each in found]
    assert np.median(factors) < 1.6


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
        found = calibrate(
            nothing[held], truth[held], nothing[held], growth=known, inputs=inputs[held]
        )
        low, high = found.ends(nothing[new], 0.9, inputs[new])
        inside = (low <= truth[new]) & (truth[new] <= high)
        assert inside.mean() == pytest.approx(0.9, abs=0.02)
        shares.append(inside[far].mean())
    assert shares[0] < 0.8
    assert shares[1] == pytest.approx(0.9, abs=0.03)
    with pytest.raises(ValueError, match="need the features"):
        found.ends(nothing[new], 0.9)


def test_rows_of_a_surface_are_of_one_cluster(solved, monkeypatch):
    rows = dataset.read(solved, "area", features="dimensionless", roots=True)
    assert np.unique(rows.groups).size < error_growth.FEWEST
    assert clusters_of(rows) is None
    monkeypatch.setattr(error_growth, "FEWEST", 20)
    twice = replace(rows, groups=rows.groups // 2)
    found = clusters_of(twice)
    assert np.unique(found).size == CLUSTERS
    for group in np.unique(twice.groups):
        assert np.unique(found[twice.groups == group]).size == 1


@pytest.mark.parametrize("model", ["kernel-ridge", "decision-tree"])
def test_intervals_of_a_file_widen_as_those_that_were_fitted(solved, tmp_path, model, monkeypatch):
    monkeypatch.setattr(error_growth, "FEWEST", 20)
    request = Request(
        solved, solved, ("area",), (model,), None, "standard", "dimensionless", roots=True
    )
    fitted = training.fit(request, Executor(), lambda line: None)
    growth = Growth(fitted.distance, 0.3)
    area = fitted.learnt["area"]
    wide = replace(area, calibration=replace(area.calibration, growth=growth))
    fitted = replace(fitted, learnt={"area": wide})
    fitted.save(tmp_path / "x.surrogate")
    read = Surrogate.load(tmp_path / "x.surrogate")
    rows = dataset.read(solved, "area", features="dimensionless", roots=True)
    raw = wide.raw(rows.inputs)
    ends = wide.ends(rows.inputs, raw, 0.9)
    np.testing.assert_array_equal(read.learnt["area"].ends(rows.inputs, raw, 0.9), ends)
    plain = replace(area, calibration=replace(area.calibration, growth=None))
    near = fitted.distance.of(rows.inputs) < 1
    widths, before = (high - low for low, high in (ends, plain.ends(rows.inputs, raw, 0.9)))
    assert (widths[near] <= before[near]).all()
    assert (widths[~near] >= before[~near]).all()
    with pytest.raises(ValueError, match="other distances"):
        replace(fitted, distance=None).save(tmp_path / "y.surrogate")
