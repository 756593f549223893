"""Errors of surrogates, their standard errors, and how often their bounds fail."""

import math

import numpy as np
import pytest

from learn.grow.accuracy import accuracy


def test_of_equal_truths_it_is_the_mean_with_its_standard_error():
    errors = np.random.default_rng(1).uniform(0, 2, 40)
    found = accuracy(errors, np.full(40, 4.0), np.arange(40))
    assert found.nmae == pytest.approx(25 * errors.mean())
    assert found.error == pytest.approx(25 * errors.std(ddof=1) / math.sqrt(40))
    assert found.groups == 40


def test_rows_of_one_surface_count_once():
    random = np.random.default_rng(2)
    errors, truth = random.uniform(0, 1, 20), random.uniform(1, 2, 20)
    alone = accuracy(errors, truth, np.arange(20))
    repeated = accuracy(np.repeat(errors, 7), np.repeat(truth, 7), np.repeat(np.arange(20), 7))
    assert repeated == pytest.approx(alone)


def test_a_single_surface_bounds_nothing():
    found = accuracy(np.ones(5), np.full(5, 10.0), np.zeros(5, dtype=np.int64))
    assert found.nmae == pytest.approx(10.0)
    assert found.bound(0.05) == math.inf


def test_without_errors_the_bound_is_zero():
    assert accuracy(np.zeros(5), np.ones(5), np.arange(5)).bound(0.001) == 0.0


@pytest.mark.parametrize("groups", [12, 60])
def test_the_bound_fails_about_as_often_as_it_may(groups):
    """Half-normal errors that grow with the truth; nMAE + t SE fails twice as often and more."""
    random, risk, trials = np.random.default_rng(3), 0.0083, 4000
    truth = random.lognormal(0, 0.6, (trials, groups))
    errors = np.abs(random.normal(size=truth.shape)) * truth**0.7
    # E|N(0, 1)| E[truth^0.7] / E[truth], in closed form.
    exact = 100 * math.sqrt(2 / math.pi) * math.exp(0.5 * 0.36 * (0.49 - 1))
    names = np.arange(groups)
    found = [accuracy(*each, names) for each in zip(errors, truth, strict=True)]
    failed = np.mean([each.bound(risk) < exact for each in found])
    assert failed < risk + 3 * math.sqrt(risk / trials) + 0.003


def test_errors_are_measured_by_magnitudes():
    """A negative target has no negative error, and a signed one of mean 0 has an error at all."""
    random = np.random.default_rng(5)
    errors, truth, groups = random.uniform(0, 1, 30), random.uniform(1, 2, 30), np.arange(30)
    wanted = accuracy(errors, truth, groups)
    assert accuracy(errors, -truth, groups) == wanted
    assert accuracy(errors, truth * (-1.0) ** groups, groups) == wanted
