"""What a whole grid takes, on fits whose times are known exactly, and by the command."""

import math

import numpy as np
import pytest

from learn.comparison import grid as grids
from learn.comparison.estimate import cost, drawn
from learn.comparison.grid import Task, expected_work
from learn.comparison.trials import Trial
from learn.models import MODELS
from learn.split import FOLDS

ROWS = 10_000


def grid_of(model):
    return grids.grid(MODELS[model], grids.space_of(model, "paper")[1], 23)


def fits(model, grid, places, rate):
    """Finished trials of whole families that take `rate(family)` seconds for a unit of work."""
    found = {}
    for family, fold in places:
        settings = tuple(grid.differing[number] for number in grid.families[family])
        seconds = rate(family) * expected_work(Task(model, settings, 0, ROWS))
        for candidate in settings:
            share = seconds / len(settings)
            name = grids.key(candidate)
            trial = Trial(candidate=name, fold=fold, rows=ROWS, r2=0.5, seconds=share)
            found[trial.place] = trial
    return found


def grown(trials, rows, growth):
    """The same fits on fewer rows, where they take less by a factor."""
    fewer = (
        trial.model_copy(update={"rows": rows, "seconds": trial.seconds / growth})
        for trial in trials.values()
    )
    return {trial.place: trial for trial in fewer}


def everywhere(grid):
    return [(family, fold) for family in range(len(grid.families)) for fold in range(FOLDS)]


def seconds_of(trials):
    return math.fsum(trial.seconds for trial in trials.values())


@pytest.mark.parametrize("model", ["svm", "random-forest", "kernel-ridge"])
def test_a_whole_grid_is_added_up(model):
    grid = grid_of(model)
    trials = fits(model, grid, everywhere(grid), lambda family: 1e-6 * (family + 1))
    found = cost(MODELS[model], grid, trials, ROWS, 0)
    assert found.fits == found.of == FOLDS * len(grid.families)
    assert (found.seconds, found.error) == (pytest.approx(seconds_of(trials), rel=1e-12), 0.0)


@pytest.mark.parametrize("model", ["svm", "random-forest", "kernel-ridge"])
def test_the_estimate_is_exact_where_times_follow_the_expected_work(model):
    grid = grid_of(model)
    whole = fits(model, grid, everywhere(grid), lambda family: 2e-6)
    some = fits(model, grid, drawn(grid, 3)[:7], lambda family: 2e-6)
    found = cost(MODELS[model], grid, some, ROWS, 3)
    assert found.fits == 7
    assert found.seconds == pytest.approx(seconds_of(whole), rel=1e-9)
    assert found.error == pytest.approx(0.0, abs=1e-9 * found.seconds)
    alone = cost(MODELS[model], grid, fits(model, grid, drawn(grid, 3)[:1], lambda f: 1.0), ROWS, 3)
    assert (alone.fits, alone.error) == (1, None)


def test_the_error_is_that_of_many_draws():
    """Scatter of 300 estimates about the truth beside the errors that they state."""
    model = "svm"
    grid = grid_of(model)
    scatter = np.random.default_rng(0).lognormal(0.0, 0.5, len(grid.families))
    whole = fits(model, grid, everywhere(grid), lambda family: scatter[family])
    truth = seconds_of(whole)
    found = []
    for seed in range(300):
        some = fits(model, grid, drawn(grid, seed)[:12], lambda family: scatter[family])
        found.append(cost(MODELS[model], grid, some, ROWS, seed))
    ratios = np.array([each.seconds / truth for each in found])
    stated = np.sqrt(np.mean([(each.error / truth) ** 2 for each in found]))
    assert ratios.mean() == pytest.approx(1.0, abs=0.05)
    assert stated == pytest.approx(ratios.std(), rel=0.25)


def test_winners_of_a_search_do_not_bias_the_estimate():
    model = "svm"
    grid = grid_of(model)
    first = fits(model, grid, drawn(grid, 0)[:4], lambda family: 1.0)
    best = fits(model, grid, everywhere(grid)[-10:], lambda family: 1e-3)
    ends_early = cost(MODELS[model], grid, best | first, ROWS, 0)
    assert ends_early.seconds == pytest.approx(cost(MODELS[model], grid, first, ROWS, 0).seconds)
    assert cost(MODELS[model], grid, {}, ROWS, 0) is None


@pytest.mark.parametrize("model", ["svm", "random-forest", "kernel-ridge"])
def test_cheap_fits_on_few_rows_stand_for_those_that_take_too_long_on_all(model):
    grid = grid_of(model)
    whole = fits(model, grid, everywhere(grid), lambda family: 2e-6)
    every = fits(model, grid, drawn(grid, 3), lambda family: 2e-6)
    few = fits(model, grid, drawn(grid, 3)[2:5], lambda family: 2e-6)
    known = grown(every, 123, 900.0) | grown(every, 370, 100.0)
    found = cost(MODELS[model], grid, known | few, ROWS, 3)
    assert (found.fits, found.rows) == (3, ROWS)
    # From 370 to 3,333 rows nothing was timed, then three fits: their times stand for the growth.
    assert found.seconds == pytest.approx(seconds_of(whole), rel=1e-9)
