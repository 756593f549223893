"""Searches within a time: how times are read, which steps are taken, which of them count."""

from dataclasses import replace

import numpy as np
import pytest

from gen.runtime.errors import InputError
from learn.comparison.search import budget, pruning
from learn.comparison.search.scores import rank


@pytest.mark.parametrize(("text", "expected"), [("90s", 90), ("2h", 7200), ("1.5min", 90)])
def test_budgets_are_read(text, expected):
    assert budget.seconds(text) == expected


@pytest.mark.parametrize("text", ["", "2", "-1h", "0s", "nan", "inf", "2 weeks", "h"])
def test_budgets_that_are_none_are_refused(text):
    if text == "2":
        assert budget.seconds(text) == 2
        return
    with pytest.raises(InputError, match="--budget"):
        budget.seconds(text)


def test_steps_triple_and_end_with_all_rows():
    assert budget.steps(10162) == [376, 1129, 3387, 10162]
    assert budget.steps(200) == [200]


def halved(searching, space, limit):
    search = searching("decision-tree", space)
    return search.grid, budget.search(search, limit)


def test_a_budget_that_is_large_enough_gets_the_whole_grid(searching, trees, trials, monkeypatch):
    monkeypatch.setattr(budget, "LEAST_ROWS", 20)
    _, result = halved(searching, trees, 1e6)
    assert result.how == "whole grid"
    exact = searching("decision-tree", trees).whole().scores
    np.testing.assert_array_equal(result.scores.folds, exact.folds)
    assert result.seconds >= exact.seconds


def test_halving_tries_fewer_candidates_on_more_rows(searching, trees, trials, monkeypatch):
    monkeypatch.setattr(budget, "LEAST_ROWS", 20)
    monkeypatch.setitem(budget.GROWTH, "decision-tree", 99.0)  # nothing would ever fit
    grid, result = halved(searching, trees, 1e6)
    every = len(grid.differing)
    third = -(-every // 3)
    assert result.how == (
        f"successive halving: {every} candidates on 26 rows, 1 fold, {third} candidates on 80 rows"
    )
    assert {trial.fold for trial in trials.finished.values() if trial.rows == 26} == {0}
    assert result.scores.folds.shape == (every, 5)
    assert result.seconds == pytest.approx(sum(t.seconds for t in trials.finished.values()))
    assert result.rows == 80
    assert np.isfinite(result.scores.means).sum() == third
    assert np.isfinite(result.scores.means[result.scores.winner])


def test_a_step_without_the_best_candidate_so_far_is_dropped(searching, trees, trials, monkeypatch):
    monkeypatch.setattr(budget, "LEAST_ROWS", 20)
    monkeypatch.setitem(budget.GROWTH, "decision-tree", 99.0)  # nothing would ever fit
    grid, both = halved(searching, trees, 1e6)
    first = rank(grid, trials.finished, 26, folds=1)
    best = pruning.key(grid.differing[first.winner])
    del trials.finished[best, 0, 80]
    _, result = halved(searching, trees, 1e-9)
    assert both.rows == 80
    assert result.rows == 26
    assert result.how == both.how.split(", 1 fold, ")[0] + ", 1 fold"
    assert result.scores.winner == first.winner


def test_cheap_families_tend_to_be_drawn_before_expensive_ones(searching, training):
    space = {"n_estimators": [50], "max_depth": [1, 2, 4, 8, 16]}
    search = searching("gradient-boost", space)
    grid = search.grid
    places = np.zeros((200, 5))
    for seed in range(200):
        order = budget.drawn_order(replace(search, training=replace(training, seed=seed)), 100)
        assert sorted(order) == list(range(5))
        places[seed, order] = range(5)
    depths = [grid.differing[family[0]]["max_depth"] for family in grid.families]
    assert depths == sorted(depths)
    mean = places.mean(axis=0)
    assert np.all(np.diff(mean) > 0)  # 0.6 to 3.2, standard errors below 0.1
    assert mean[0] < 1.2
    assert mean[-1] > 2.8


def test_a_budget_of_next_to_nothing_ends_at_once(searching, trees):
    _, result = halved(searching, trees, 1e-9)
    assert result is None
