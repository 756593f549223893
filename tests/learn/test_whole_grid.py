"""The estimate of a whole grid's time, on fits whose times are known exactly."""

import numpy as np
import pytest

from learn.comparison import pruning, spaces
from learn.comparison.search import Task, expected_work
from learn.comparison.trials import Trial
from learn.comparison.whole_grid import whole_grid
from learn.models import MODELS
from learn.split import FOLDS

TOTAL = 10_000


def grid_of(model):
    return pruning.grid(MODELS[model], spaces.of(model, "paper")[1], 23)


def fits(model, grid, families, rows, folds, rate):
    """Trials of whole families that take `rate(family, rows)` seconds for a unit of work."""
    for family in families:
        numbers = grid.families[family]
        settings = tuple(grid.differing[number] for number in numbers)
        work = expected_work(Task(model, settings, 0, rows))
        share = work * rate(family, rows) / len(numbers)
        for fold in range(folds):
            for candidate in settings:
                yield Trial(pruning.key(candidate), fold, rows, 0.5, seconds=share)


def exact(model, grid, rate):
    everything = fits(model, grid, range(len(grid.families)), TOTAL, FOLDS, rate)
    return sum(trial.seconds for trial in everything)


@pytest.mark.parametrize("model", sorted(MODELS))
def test_a_whole_grid_is_measured(model):
    grid = grid_of(model)
    trials = list(fits(model, grid, range(len(grid.families)), TOTAL, FOLDS, lambda f, r: 1e-6))
    found = whole_grid(MODELS[model], grid, trials, TOTAL)
    assert found.measured
    assert found.seconds == pytest.approx(sum(trial.seconds for trial in trials), rel=1e-12)


@pytest.mark.parametrize("model", sorted(MODELS))
def test_the_estimate_is_exact_where_times_follow_a_power_of_the_rows(model):
    grid = grid_of(model)
    drawn = np.random.default_rng(1).permutation(len(grid.families))

    def rate(family, rows):
        return 1e-6 * rows**0.7

    trials = [
        *fits(model, grid, drawn[:9], 400, 1, rate),
        *fits(model, grid, drawn[:3], 1200, 1, rate),
    ]
    found = whole_grid(MODELS[model], grid, trials, TOTAL)
    assert not found.measured
    assert found.seconds == pytest.approx(exact(model, grid, rate), rel=1e-9)


def test_the_estimate_knows_every_family_that_was_timed():
    model = "svm"
    grid = grid_of(model)
    factors = np.random.default_rng(2).lognormal(0, 2, len(grid.families))

    def rate(family, rows):
        return 1e-6 * factors[family] * rows**1.5

    trials = [
        *fits(model, grid, range(len(grid.families)), 400, 1, rate),
        *fits(model, grid, [5, 17, 23], TOTAL, FOLDS, rate),
    ]
    found = whole_grid(MODELS[model], grid, trials, TOTAL)
    assert found.seconds == pytest.approx(exact(model, grid, rate), rel=1e-9)


def test_survivors_of_a_family_do_not_stand_for_its_larger_members():
    """Of a family of estimator counts only the smallest goes on: the growth is that of its work."""
    model = "gradient-boost"
    grid = grid_of(model)
    small = list(fits(model, grid, [0], 400, 1, lambda f, r: 1e-6))
    first = grid.differing[grid.families[0][0]]
    work = expected_work(Task(model, (first,), 0, TOTAL))
    alone = Trial(pruning.key(first), 0, TOTAL, 0.5, seconds=2e-6 * work)
    found = whole_grid(MODELS[model], grid, [*small, alone], TOTAL)
    assert found.seconds == pytest.approx(2 * exact(model, grid, lambda f, r: 1e-6), rel=1e-9)
