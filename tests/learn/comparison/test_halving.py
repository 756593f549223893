"""Searches within a time: how times are read, which steps are taken, which of them count."""

import math
import time
from dataclasses import replace

import numpy as np
import pytest

from learn.comparison import halving
from learn.comparison import search as searches
from learn.comparison.fits import Training, Trials
from learn.comparison.grid import canonical_settings
from learn.models import AT_BOUND


def halved(searching, space, limit=math.inf):
    search = searching("decision-tree", space)
    return search.grid, halving.within(search, time.time() + limit)


def test_a_budget_that_is_large_enough_gets_the_whole_grid(searching, trees, trials, monkeypatch):
    monkeypatch.setattr(halving, "LEAST_ROWS", 20)
    _, result = halved(searching, trees)
    assert result.how == "whole grid"
    exact = searching("decision-tree", trees).exhaustive().scores
    np.testing.assert_array_equal(result.scores.folds, exact.folds)
    assert result.seconds >= exact.seconds


@pytest.fixture
def never_whole(monkeypatch):
    """First rungs of twenty rows, after which no whole grid would ever fit into the time."""
    monkeypatch.setattr(halving, "LEAST_ROWS", 20)
    monkeypatch.setattr(halving, "_whole_fits", lambda *arguments: False)


@pytest.mark.usefixtures("never_whole")
def test_halving_tries_fewer_candidates_on_more_rows(searching, trees, trials):
    grid, result = halved(searching, trees)
    every = len(grid.differing)
    third = -(-every // 3)
    assert result.how == (
        f"successive halving: {every} candidates on 26 rows, 2 folds,"
        f" {third} candidates on 80 rows, 5 folds"
    )
    assert {trial.fold for trial in trials.finished.values() if trial.rows == 26} == {0, 1}
    assert result.scores.folds.shape == (every, 5)
    assert result.seconds == pytest.approx(sum(t.seconds for t in trials.finished.values()))
    assert np.isfinite(result.scores.means).sum() == third
    assert np.isfinite(result.scores.means[result.scores.winner])


@pytest.mark.usefixtures("never_whole")
def test_candidates_that_the_time_leaves_undone_are_told_and_done_with_more_time(
    searching, trees, trials
):
    _, both = halved(searching, trees)
    decided = [trial for trial in trials.finished.values() if trial.rows == 80]
    for trial in decided:
        del trials.finished[trial.place]
    assert halved(searching, trees, 0.0)[1] is None, "few rows and two folds decide nothing"
    for trial in decided[:5]:
        trials.finished[trial.place] = trial
    _, some = halved(searching, trees, 0.0)
    assert both.how.endswith(" 2 folds, 6 candidates on 80 rows, 5 folds")
    assert some.how.endswith(" 2 folds, 1 candidate on 80 rows, 5 folds, 5 more not finished")
    assert halved(searching, trees)[1].scores.winner == both.scores.winner


def levels(rows):
    """Two hundred random levels of one input: a tree finds them in many rows only."""
    generator = np.random.default_rng(0)
    inputs = np.c_[generator.uniform(size=rows), np.ones(rows)]
    target = generator.normal(size=200)[(200 * inputs[:, 0]).astype(int)]
    folds = (np.arange(rows) % 5).astype(np.int8)
    return Training(inputs, target, folds, inputs[:9], target[:9], normalisation="none")


SHALLOW = {"max_depth": [1, 2, 3, 30], "min_samples_leaf": [1, 40]}
"""On 26 rows of `levels` the deep trees come after all others, on all of them they are the best."""


@pytest.mark.usefixtures("never_whole")
def test_the_optimum_of_the_paper_is_judged_on_all_rows_whatever_few_rows_say(searching):
    search = replace(searching("decision-tree", SHALLOW), training=levels(720))
    settings = {"max_depth": 30, "min_samples_leaf": 1}
    deep = search.grid.number_of(canonical_settings(search.model, settings, 2))
    lost = halving.within(search, math.inf).scores
    few = search.scores(26, 2).means
    assert few[deep] < np.sort(few)[-3]
    assert not lost.of(deep), "halving alone drops the best candidate"
    found = halving.within(replace(search, optimum=deep), math.inf).scores
    assert found.winner == deep
    assert found.means[deep] > lost.means[lost.winner] + 0.3
    assert len(found.of(deep)) == 5


@pytest.mark.usefixtures("never_whole")
def test_the_baseline_is_judged_on_every_rung_and_wins_where_no_candidate_is_better(
    searching, trials
):
    space = {"max_depth": [1, 2, 3], "min_samples_leaf": [1, 40]}
    search = replace(searching("decision-tree", space), training=levels(720), baseline={})
    result = halving.within(search, math.inf)
    judged = {(rows, fold) for name, fold, rows in trials.finished if name == "baseline"}
    rungs = {(rows, fold) for rows in (26, 80, 240) for fold in (0, 1)}
    assert judged == rungs | {(720, fold) for fold in range(5)}
    assert result.scores.baseline_wins
    assert result.scores.baseline.mean() > result.scores.means[result.scores.winner]
    assert "candidate and the baseline on 720 rows, 5 folds" in result.how
    whole = replace(search, grid=searching("decision-tree", SHALLOW).grid).exhaustive().scores
    assert np.isfinite(whole.baseline).sum() == 5
    assert whole.fits == 5 * len(whole.means)
    assert whole.seconds > sum(t.seconds for t in trials.finished.values() if t.rows == 720) - 1e-9


def waves():
    """A sine that few rows do not resolve: the likelihood takes it for noise."""
    generator = np.random.default_rng(0)
    inputs = generator.uniform(0, 1, (200, 1))
    target = 3 * np.sin(8 * np.pi * inputs[:, 0]) + 0.3 * generator.normal(size=200)
    folds = (np.arange(200) % 5).astype(np.int8)
    return Training(inputs, target, folds, inputs[:9], target[:9], normalisation="none")


@pytest.mark.usefixtures("never_whole")
def test_a_collapsed_likelihood_is_not_dropped_by_its_score_on_few_rows(
    searching, trials, tmp_path, monkeypatch
):
    space = {"alpha": [0.1, 0.5, 0.7, 0.8, 1.0, 1.1]}
    search = replace(searching("gaussian-process", space), training=waves())
    result = halving.within(search, math.inf)
    few = [trials.finished["alpha=0.1", fold, 22] for fold in (0, 1)]
    assert all(AT_BOUND in trial.remark for trial in few)
    assert max(trial.r2 for trial in few) < 0.01
    assert AT_BOUND not in trials.finished["alpha=1.0", 1, 22].remark
    assert search.grid.differing[result.scores.winner] == {"alpha": 0.1}
    monkeypatch.setattr(searches, "AT_BOUND", "nothing says so")
    with Trials(tmp_path / "other.jsonl", {}) as others:
        dropped = halving.within(replace(search, trials=others), math.inf).scores
    assert not dropped.of(0), "without the rule the best candidate does not get beyond 22 rows"
    assert dropped.means[dropped.winner] < result.scores.means[0]
