"""The search beside scikit-learn's own, and what it does when fits fail or are interrupted."""

import json
import warnings
from dataclasses import replace

import numpy as np
import pytest
from sklearn.kernel_ridge import KernelRidge
from sklearn.model_selection import GridSearchCV, PredefinedSplit

from gen.runtime.errors import InputError
from gen.runtime.farm import World
from learn.comparison import budget, pruning, search, training_data
from learn.comparison.trials import Trials
from learn.models import MODELS, STEP, pipeline

# Every kind of synonym and of shared fit, small enough for a test.
REDUCED = {
    "decision-tree": {
        "max_depth": [2, 30],
        "max_features": [1.0, "sqrt", "log2", None],
        "min_samples_leaf": [1, 4],
        "min_samples_split": [2, 10],
    },
    "random-forest": {
        "max_depth": [20],
        "max_features": ["sqrt", "log2", 1.0],
        "n_estimators": [2, 3, 7],
        "criterion": ["squared_error", "poisson"],
        "min_samples_split": [2, 6],
        "min_samples_leaf": [5],
    },
    "adaboost": {
        "estimator__max_depth": [2, 18],
        "loss": ["square", "exponential"],
        "n_estimators": [1, 3, 8],
        "learning_rate": [2.0],
    },
    "gradient-boost": {
        "learning_rate": [2.0],
        "loss": ["squared_error", "huber"],
        "max_depth": [2],
        "n_estimators": [2, 5, 9],
        "max_features": [1.0, "sqrt", "log2"],
    },
    "xgboost": {
        "learning_rate": [0.1, 2.0],
        "max_depth": [2, 6],
        "n_estimators": [3, 7, 12],
        "gamma": [0.0, 1.0],
    },
    "svm": {
        "C": [0.01],
        "degree": [3, 7],
        "kernel": ["linear", "rbf", "poly", "sigmoid"],
        "gamma": ["scale", "auto"],
        "cache_size": [200, 500],
    },
    "gaussian-process": {"alpha": [1e-3, 0.0374, 1.0]},
    "kernel-ridge": {
        "alpha": [1e-5, 1e-2, 1.0],
        "gamma": [0.01, 5.0, 150.0],
        "kernel": ["rbf", "linear"],
    },
    "mlp": {
        "activation": ["tanh"],
        "alpha": [1e-3],
        "hidden_layer_sizes": [(4, 3)],
        "learning_rate": ["constant", "adaptive"],
        "solver": ["sgd", "lbfgs"],
    },
}

SCALED = {
    "svm": {"C": [10.0], "epsilon": [0.01, 0.1], "gamma": [0.01, 0.03], "kernel": ["rbf"]},
    "gaussian-process": {
        "alpha": [1e-3, 0.1],
        "kernel__length_scale": [3.0, 10.0],
        "optimizer": [None],
    },
}
"""Points of the grids for features without units."""

FOLDS = np.arange(80).astype(np.int8) % 5


@pytest.fixture
def held(samples):
    """The data of the tests, as a search holds them."""
    inputs, target = samples
    training = training_data.Training(inputs, target, FOLDS, inputs[:9], target[:9])
    training_data.hold(training, World())
    return training


@pytest.fixture
def trials(tmp_path):
    with Trials(tmp_path / "trials.jsonl", {}) as opened:
        yield opened


def searched(model, space, trials, inputs=6, rows=80):
    """Search a grid serially."""
    grid = pruning.grid(MODELS[model], space, inputs)
    todo = search.tasks(MODELS[model], grid, range(len(grid.differing)), rows, trials)
    search.work_off(todo, trials, World())
    return grid, search.rank(grid, trials, rows)


@pytest.mark.parametrize(("model", "space"), [*REDUCED.items(), *SCALED.items()])
def test_scores_and_winner_are_those_of_scikit_learns_grid_search(model, space, held, trials):
    grid, found = searched(model, space, trials)
    theirs = pipeline(MODELS[model], tuned=True)
    if model == "kernel-ridge":
        theirs.set_params(**{STEP: KernelRidge()})
    named = {f"{STEP}__{name}": values for name, values in space.items()}
    reference = GridSearchCV(theirs, named, cv=PredefinedSplit(FOLDS), scoring="r2", refit=False)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of perceptrons that have not converged
        reference.fit(held.inputs, held.target)
    results = reference.cv_results_
    expected = np.stack([results[f"split{fold}_test_score"] for fold in range(5)], axis=1)
    assert np.isfinite(expected).all()
    canonical = list(grid.canonical)
    np.testing.assert_allclose(found.scores[canonical], expected, rtol=0, atol=1e-10)
    np.testing.assert_allclose(found.means[canonical], results["mean_test_score"], atol=1e-10)
    best = results["params"][int(np.argmin(results["rank_test_score"]))]
    assert grid.first(found.winner) == {key.partition("__")[2]: best[key] for key in best}
    assert found.fits == 5 * len(grid.families)
    if space is REDUCED[model] and model != "gaussian-process":
        assert len(grid.families) < grid.nominal


def test_adaboost_that_ends_early_has_the_same_model_for_all_larger_numbers(held, trials):
    # A tree that fits perfectly ends the boosting.
    space = {"estimator__max_depth": [18], "n_estimators": [1, 2, 50], "learning_rate": [2.0]}
    _, found = searched("adaboost", space, trials)
    assert np.isfinite(found.means).all()


def test_ties_go_to_the_first_in_the_grid(held, trials):
    space = {"min_samples_split": [2, 3, 4], "min_samples_leaf": [2], "max_depth": [3]}
    grid, found = searched("decision-tree", space, trials)
    assert len(grid.differing) == 1
    assert grid.first(found.winner)["min_samples_split"] == 2


def test_candidates_that_fail_come_last_with_their_reason(held, trials):
    grid, found = searched("svm", {"C": [-1.0, 1.0], "kernel": ["rbf"]}, trials)
    assert np.isnan(found.means[0])
    assert grid.first(found.winner)["C"] == 1.0
    (reason,) = found.failures
    assert "'C' parameter" in reason
    assert found.failures[reason] == 5


def test_a_grid_on_which_all_fail_has_no_winner(held, trials):
    _, found = searched("svm", {"C": [-1.0, -2.0]}, trials)
    assert found.winner == -1


def test_a_staged_fit_that_fails_late_keeps_its_good_beginnings(held, trials, monkeypatch):
    from sklearn.ensemble import GradientBoostingRegressor

    whole = GradientBoostingRegressor.fit

    def limited(self, *arguments, **named):
        if self.n_estimators > 5:
            raise ValueError("diverged")
        return whole(self, *arguments, **named)

    monkeypatch.setattr(GradientBoostingRegressor, "fit", limited)
    grid, found = searched("gradient-boost", {"n_estimators": [2, 5, 9]}, trials)
    assert np.isfinite(found.means[:2]).all()
    assert np.isnan(found.means[2])
    assert found.failures == {"diverged": 5}
    assert grid.first(found.winner)["n_estimators"] == 5


def test_tiny_alphas_have_scores_and_a_warning_that_is_kept(held, trials):
    space = {"alpha": [1e-15, 1e-5], "gamma": [1e-5], "kernel": ["rbf"]}
    _, found = searched("kernel-ridge", space, trials)
    assert np.isfinite(found.scores).all()
    assert any("condition about" in remark for remark in found.remarks)


def test_finished_fits_are_not_done_again(held, tmp_path):
    space = REDUCED["decision-tree"]
    path = tmp_path / "trials.jsonl"
    with Trials(path, {"seed": 0}) as opened:
        _, first = searched("decision-tree", space, opened)
    whole = path.read_bytes()
    # A kill in the midst of a line.
    path.write_bytes(whole[: int(0.6 * len(whole))])
    with Trials(path, {"seed": 0}) as opened:
        left = len(opened.finished)
        assert 0 < left < first.scores.size
        grid = pruning.grid(MODELS["decision-tree"], space, 6)
        everything = range(len(grid.differing))
        todo = search.tasks(MODELS["decision-tree"], grid, everything, 80, opened)
        assert sum(len(task.candidates) for task in todo) == first.scores.size - left
        _, again = searched("decision-tree", space, opened)
    np.testing.assert_array_equal(first.scores, again.scores)
    for line in path.read_text().splitlines():
        json.loads(line)


def test_trials_of_other_conditions_are_refused(tmp_path):
    path = tmp_path / "trials.jsonl"
    common = {"seed": 0, "versions": {"a": "1"}}
    with Trials(path, common), pytest.raises(InputError, match="is being written by"):
        Trials(path, common)
    with pytest.raises(InputError, match=r"holds trials with seed 0, not 1"):
        Trials(path, {"seed": 1, "versions": {"a": "1"}})
    path.write_text("nonsense\n")
    with pytest.raises(InputError, match="damaged"):
        Trials(path, {})
    with pytest.raises(InputError, match="cannot be"):
        Trials(path / "below" / "trials.jsonl", {})


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


def halved(trials, limit, monkeypatch=None):
    grid = pruning.grid(MODELS["decision-tree"], REDUCED["decision-tree"], 6)
    model = MODELS["decision-tree"]
    return grid, budget.search(model, grid, trials, World(), limit, lambda: False)


def test_a_budget_that_is_large_enough_gets_the_whole_grid(held, trials, monkeypatch):
    monkeypatch.setattr(budget, "LEAST_ROWS", 20)
    _, found = halved(trials, 1e6)
    assert found.how == "whole grid"
    _, exact = searched("decision-tree", REDUCED["decision-tree"], trials)
    np.testing.assert_array_equal(found.found.scores, exact.scores)
    assert found.seconds >= exact.seconds


def test_halving_tries_fewer_candidates_on_more_rows(held, trials, monkeypatch):
    monkeypatch.setattr(budget, "LEAST_ROWS", 20)
    monkeypatch.setitem(budget.GROWTH, "decision-tree", 99.0)  # nothing would ever fit
    grid, found = halved(trials, 1e6)
    every = len(grid.differing)
    third = -(-every // 3)
    assert found.how == (
        f"successive halving: {every} candidates on 26 rows, 1 fold, {third} candidates on 80 rows"
    )
    assert {trial.fold for trial in trials.finished.values() if trial.rows == 26} == {0}
    assert found.found.scores.shape == (every, 5)
    assert found.seconds == pytest.approx(sum(t.seconds for t in trials.finished.values()))
    assert found.rows == 80
    assert np.isfinite(found.found.means).sum() == third
    assert np.isfinite(found.found.means[found.found.winner])


def test_a_step_without_the_best_candidate_so_far_is_dropped(held, trials, monkeypatch):
    monkeypatch.setattr(budget, "LEAST_ROWS", 20)
    monkeypatch.setitem(budget.GROWTH, "decision-tree", 99.0)  # nothing would ever fit
    grid, both = halved(trials, 1e6)
    first = search.rank(grid, trials, 26, folds=1)
    best = pruning.key(grid.differing[first.winner])
    del trials.finished[best, 0, 80]
    _, found = halved(trials, 1e-9)
    assert both.rows == 80
    assert found.rows == 26
    assert found.how == both.how.split(", 1 fold, ")[0] + ", 1 fold"
    assert found.found.winner == first.winner


def test_cheap_families_tend_to_be_drawn_before_dear_ones(held):
    space = {"n_estimators": [50], "max_depth": [1, 2, 4, 8, 16]}
    model = MODELS["gradient-boost"]
    grid = pruning.grid(model, space, 6)
    places = np.zeros((200, 5))
    for seed in range(200):
        training_data.hold(replace(training_data.held(), seed=seed), World())
        order = budget.drawn_order(model, grid, 100)
        assert sorted(order) == list(range(5))
        places[seed, order] = range(5)
    depths = [grid.differing[family[0]]["max_depth"] for family in grid.families]
    assert depths == sorted(depths)
    mean = places.mean(axis=0)
    assert np.all(np.diff(mean) > 0)  # 0.6 to 3.2, standard errors below 0.1
    assert mean[0] < 1.2
    assert mean[-1] > 2.8


def test_a_budget_of_next_to_nothing_ends_at_once(held, trials):
    _, found = halved(trials, 1e-9)
    assert found is None
