"""Searches within a time: how times are read, which steps are taken, which of them count."""

import json
from dataclasses import replace

import numpy as np
import pytest

from gen.runtime.errors import InputError
from learn.comparison.search import budget, fits
from learn.comparison.search.budget import Share
from learn.comparison.search.pruning import canonical_settings
from learn.comparison.search.trials import Trials
from learn.comparison.training_data import Training
from learn.models import MODELS


@pytest.mark.parametrize(("text", "expected"), [("90s", 90), ("2h", 7200), ("1.5min", 90)])
def test_budgets_are_read(text, expected):
    assert budget.seconds(text) == expected


@pytest.mark.parametrize("text", ["", "2", "-1h", "0s", "nan", "inf", "2 weeks", "h", "1e18s"])
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
    return search.grid, budget.search(search, Share(limit))


def test_a_budget_that_is_large_enough_gets_the_whole_grid(searching, trees, trials, monkeypatch):
    monkeypatch.setattr(budget, "LEAST_ROWS", 20)
    _, result = halved(searching, trees, 1e6)
    assert result.how == "whole grid"
    exact = searching("decision-tree", trees).exhaustive().scores
    np.testing.assert_array_equal(result.scores.folds, exact.folds)
    assert result.seconds >= exact.seconds


@pytest.fixture
def never_whole(monkeypatch):
    """First rungs of twenty rows, after which no whole grid would ever fit into the time."""
    monkeypatch.setattr(budget, "LEAST_ROWS", 20)
    for model in MODELS:
        monkeypatch.setitem(budget.GROWTH, model, 99.0)


@pytest.mark.usefixtures("never_whole")
def test_an_interrupted_search_keeps_the_schedule_of_its_share(searching, trees, trials):
    search = searching("decision-tree", trees)
    budget.search(search, Share(1e6))
    for place in [*trials.finished][12:]:  # the first rung was interrupted after six candidates
        del trials.finished[place]
    result = budget.search(search, Share(1e6, spent=6e5))
    assert result.how == (
        "successive halving: 6 candidates on 26 rows, 2 folds, 2 candidates on 80 rows, 5 folds"
    )
    assert budget.search(search, Share(1e6, spent=1e6)).how == result.how


def test_a_whole_grid_that_was_interrupted_is_still_searched_whole(
    searching, trees, trials, monkeypatch
):
    monkeypatch.setattr(budget, "LEAST_ROWS", 20)
    search = searching("decision-tree", trees)
    exact = budget.search(search, Share(1e6))
    first = [trial for trial in trials.finished.values() if trial.rows == 26]
    done = [trial for trial in trials.finished.values() if trial.rows == 80]
    for trial in first:  # ten thousand seconds for each fit, of which all but ten are done
        trials.finished[trial.place] = replace(trial, seconds=1e4)
    for number, trial in enumerate(done):
        del trials.finished[trial.place]
        if number >= 10:
            trials.finished[trial.place] = replace(trial, seconds=1e5)
    result = budget.search(search, Share(1e6))
    assert result.how == exact.how == "whole grid"
    np.testing.assert_array_equal(result.scores.folds, exact.scores.folds)


@pytest.mark.usefixtures("never_whole")
def test_halving_tries_fewer_candidates_on_more_rows(searching, trees, trials):
    grid, result = halved(searching, trees, 1e6)
    every = len(grid.differing)
    third = -(-every // 3)
    assert result.how == (
        f"successive halving: {every} candidates on 26 rows, 2 folds,"
        f" {third} candidates on 80 rows, 5 folds"
    )
    assert {trial.fold for trial in trials.finished.values() if trial.rows == 26} == {0, 1}
    assert result.scores.folds.shape == (every, 5)
    assert result.seconds == pytest.approx(sum(t.seconds for t in trials.finished.values()))
    assert result.rows == 80
    assert np.isfinite(result.scores.means).sum() == third
    assert np.isfinite(result.scores.means[result.scores.winner])


@pytest.mark.usefixtures("never_whole")
def test_candidates_that_the_time_leaves_undone_are_told_and_done_with_more_time(
    searching, trees, trials
):
    _, both = halved(searching, trees, 1e6)
    decided = [trial for trial in trials.finished.values() if trial.rows == 80]
    for trial in decided:
        del trials.finished[trial.place]
    assert halved(searching, trees, 1e-9)[1] is None, "few rows and two folds decide nothing"
    for trial in decided[:5]:
        trials.finished[trial.place] = trial
    _, some = halved(searching, trees, 1e-9)
    assert both.how.endswith(" 2 folds, 6 candidates on 80 rows, 5 folds")
    assert some.how.endswith(" 2 folds, 1 candidate on 80 rows, 5 folds, 5 more not finished")
    assert halved(searching, trees, 1e6)[1].scores.winner == both.scores.winner


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
    lost = budget.search(search, Share(1e6)).scores
    few = search.scores(26, 2).means
    assert few[deep] < np.sort(few)[-3]
    assert not lost.of(deep), "halving alone drops the best candidate"
    found = budget.search(replace(search, optimum=deep), Share(1e6)).scores
    assert found.winner == deep
    assert found.means[deep] > lost.means[lost.winner] + 0.3
    assert len(found.of(deep)) == 5


@pytest.mark.usefixtures("never_whole")
def test_the_baseline_is_judged_on_every_rung_and_wins_where_no_candidate_is_better(
    searching, trials
):
    space = {"max_depth": [1, 2, 3], "min_samples_leaf": [1, 40]}
    search = replace(searching("decision-tree", space), training=levels(720), baseline={})
    result = budget.search(search, Share(1e6))
    judged = {(rows, fold) for name, fold, rows in trials.finished if name == "baseline"}
    rungs = {(rows, fold) for rows in (26, 80, 240) for fold in (0, 1)}
    assert judged == rungs | {(720, fold) for fold in range(5)}
    assert result.scores.baseline_wins
    assert result.scores.baseline.mean() > result.scores.means[result.scores.winner]
    assert "candidate and the baseline on 720 rows, 5 folds" in result.how
    whole = replace(search, grid=searching("decision-tree", SHALLOW).grid).exhaustive().scores
    assert whole.baseline_fits == 5
    assert whole.fits == 5 * len(whole.means)
    assert whole.seconds > sum(t.seconds for t in trials.finished.values() if t.rows == 720) - 1e-9


def test_without_the_baselines_five_folds_there_is_no_result(searching, trees, trials):
    search = replace(searching("decision-tree", trees), baseline={})
    assert budget.search(search, Share(1e-9)) is None
    assert not trials.finished, "no fit is begun after the time"


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
    result = budget.search(search, Share(1e6))
    few = [trials.finished["alpha=0.1", fold, 22] for fold in (0, 1)]
    assert [trial.collapsed for trial in few] == [True, True]
    assert max(trial.r2 for trial in few) < 0.01
    assert not trials.finished["alpha=1.0", 1, 22].collapsed
    assert search.grid.differing[result.scores.winner] == {"alpha": 0.1}
    monkeypatch.setattr(fits, "collapsed", lambda truth, fitted: False)
    with Trials(tmp_path / "other.jsonl", {}) as others:
        dropped = budget.search(replace(search, trials=others), Share(1e6)).scores
    assert not dropped.of(0), "without the rule the best candidate does not get beyond 22 rows"
    assert dropped.means[dropped.winner] < result.scores.means[0]


def test_older_files_tell_collapsed_likelihoods_by_their_warning(tmp_path):
    said = "The optimal value found for dimension 0 of parameter length_scale is close to the"
    line = {"candidate": "alpha=0.1", "fold": 0, "rows": 9, "r2": -1.6}
    line["remark"] = f"{said} specified lower bound 1e-05."
    (tmp_path / "old.jsonl").write_text("{}\n" + json.dumps(line) + "\n")
    with Trials(tmp_path / "old.jsonl", {}) as trials:
        assert trials.finished["alpha=0.1", 0, 9].collapsed


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
