"""Errors and their bounds, the sizes of looks, the rows that are held out, and learning curves."""

import itertools
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from learnt_rows import read

from learn.grow import accuracy as module
from learn.grow.accuracy import (
    RISK,
    SMALLEST_SURFACES,
    Accuracy,
    Curve,
    Look,
    accuracy,
    advise,
    risk,
    size,
    size_with,
)


def test_of_equal_truths_it_is_the_mean_with_its_standard_error():
    errors = np.random.default_rng(1).uniform(0, 2, 40)
    found = accuracy(errors, np.full(40, 4.0), np.arange(40))
    assert found.nmae == pytest.approx(25 * errors.mean())
    assert found.standard_error == pytest.approx(25 * errors.std(ddof=1) / math.sqrt(40))
    assert found.groups == 40


def test_the_bound_fails_about_as_often_as_it_may():
    """Half-normal errors that grow with the truth; nMAE + t SE fails twice as often and more."""
    random, risk, trials, groups = np.random.default_rng(3), 0.0083, 4000, 12
    truth = random.lognormal(0, 0.6, (trials, groups))
    errors = np.abs(random.normal(size=truth.shape)) * truth**0.7
    # E|N(0, 1)| E[truth^0.7] / E[truth], in closed form.
    exact = 100 * math.sqrt(2 / math.pi) * math.exp(0.5 * 0.36 * (0.49 - 1))
    names = np.arange(groups)
    found = [accuracy(*each, names) for each in zip(errors, truth, strict=True)]
    failed = np.mean([each.bound(risk) < exact for each in found])
    assert failed < risk + 3 * math.sqrt(risk / trials) + 0.003


def sizes(per_surface):
    return [size(number, per_surface) for number in range(16)]


@given(st.integers(1, 400))
def test_sizes_are_whole_surfaces_that_grow_by_about_the_square_root_of_two(per_surface):
    rows = sizes(per_surface)
    assert rows[0] >= max(60, SMALLEST_SURFACES * per_surface)
    for small, large in itertools.pairwise(rows):
        assert large % per_surface == 0
        assert 1.2 < large / small < 1.65


@given(st.integers(1, 400))
def test_the_number_of_a_size_is_that_of_the_smallest_with_these_rows(per_surface):
    rows = sizes(per_surface)
    assert [size_with(number, per_surface) for number in rows] == list(range(16))
    assert size_with(rows[3] + 1, per_surface) == 4


def test_the_risks_of_all_looks_together_are_the_risk_that_is_stated():
    assert sum(risk(number) for number in range(10_000)) == pytest.approx(RISK, rel=1e-3)
    assert sum(risk(number) for number in range(10_000)) < RISK


def test_one_of_five_successive_numbers_is_drawn():
    drawn = module.drawn_for_holdout(np.arange(1000), 7)
    assert (drawn.reshape(-1, 5).sum(axis=1) == 1).all()
    places = np.flatnonzero(drawn) % 5
    assert (np.bincount(places, minlength=5) > 20).all()  # random, not every fifth


def test_a_number_is_drawn_by_the_seed_alone():
    drawn = module.drawn_for_holdout(np.arange(1000), 7)
    some = np.random.default_rng(0).permutation(1000)[:300]
    np.testing.assert_array_equal(module.drawn_for_holdout(some, 7), drawn[some])
    assert (drawn != module.drawn_for_holdout(np.arange(1000), 8)).any()


def test_a_larger_database_holds_out_the_same_rows(solved):
    whole = read(solved)
    test = module.holdout(whole)
    np.testing.assert_array_equal(module.holdout(whole.at(np.arange(61))), test[:61])
    assert test.sum() == whole.size // 5


def test_tiles_that_share_a_window_are_never_on_both_sides(populations):
    rows = read(populations / "scans.h5", "area")
    assert 0 < module.holdout(rows).sum() < rows.size
    linked = replace(rows, groups=np.repeat([0, 1], [rows.size - 1, 1]))
    assert len(set(module.holdout(linked)[:-1])) == 1


def test_training_rows_are_all_that_do_not_test_in_random_order(solved):
    rows = read(solved)
    parts = module.split_by_holdout([rows], seed=3)
    assert sorted([*parts.train, *parts.test]) == list(range(rows.size))
    assert list(parts.train) != sorted(parts.train)


def test_training_rows_are_sorted_into_five_folds(solved):
    parts = module.split_by_holdout([read(solved)], seed=3)
    assert set(parts.folds) == set(range(5))
    assert (np.diff(parts.folds) >= 0).all()


def test_a_seed_changes_the_order_of_the_training_rows_alone(solved):
    rows = read(solved)
    first, other = (module.split_by_holdout([rows], seed=seed) for seed in (3, 4))
    np.testing.assert_array_equal(other.test, first.test)
    assert list(other.train) != list(first.train)


def test_errors_are_measured_by_magnitudes():
    """A negative target has no negative error, and a signed one of mean 0 has an error at all."""
    random = np.random.default_rng(5)
    errors, truth, groups = (
        random.uniform(0, 1, 30),
        random.uniform(1, 2, 30),
        np.arange(30),
    )
    wanted = accuracy(errors, truth, groups)
    assert accuracy(errors, -truth, groups) == wanted
    assert accuracy(errors, truth * (-1.0) ** groups, groups) == wanted


def test_rows_that_repeat_a_surface_follow_its_first_row(populations):
    rows = read(populations / "python.h5", "area")
    repeated = replace(rows, groups=np.arange(rows.size) % 20)
    test = module.holdout(repeated)
    for group in range(20):
        assert len(set(test[repeated.groups == group])) == 1


@pytest.mark.parametrize("exponent", [0.3, 0.9])
def test_the_curve_is_the_power_of_the_rows_that_errors_follow(exponent):
    rows = np.array([100.0, 200.0, 400.0])
    curve = Curve(rows, 50 * rows**-exponent)
    assert curve.at(np.array([6400.0])) == pytest.approx(50 * 6400.0**-exponent)


@pytest.mark.parametrize(
    ("nmae", "error", "mark", "exponent", "rows"),
    [(4.0, 0.0, 2.001, 0.5, 960), (4.0, 0.1, 2.0, 0.1, math.inf)],
)
def test_the_rows_that_are_advised_are_those_of_the_curve(
    nmae, error, mark, exponent, rows
):
    """nMAE 4 % at 240 rows, halved by four times the rows; or it falls too little."""
    assert advised(240, 20_000, Accuracy(nmae, error, 48), mark, exponent) == rows


def advised(rows, row_limit, present, mark, exponent):
    """Advice of a look at `rows` rows with the accuracy `present`, by a curve of an exponent."""
    judged = {"area": SimpleNamespace(accuracy=present)}
    last = Look(
        rows=rows,
        number=size_with(rows, 1),
        row_limit=row_limit,
        mark=mark,
        surrogate=None,
        judged=judged,
        parts=None,
    )
    at = np.array([rows / 2, rows])
    curve = Curve(at, present.nmae * (at / rows) ** -exponent)
    origins = [SimpleNamespace(scene=SimpleNamespace(samples_per_surface=1))]
    return advise(last, curve, SimpleNamespace(by_tile=False, origins=origins))


def test_the_advice_after_a_look_between_two_sizes_begins_with_the_next_size():
    """Sizes are 60, 85, 120, ... rows. The row limit is the last one."""
    present = Accuracy(nmae=4.0, standard_error=0.0, groups=20)
    assert advised(100, 20_000, present, mark=3.7, exponent=0.5) == 120
    assert advised(100, 120, present, mark=3.7, exponent=0.5) == 120
    assert advised(100, 110, present, mark=3.9, exponent=0.5) == 110
