"""The grid search beside scikit-learn's own, its winner, and how it resumes."""

import json
import warnings

import numpy as np
import pytest
from sklearn.kernel_ridge import KernelRidge
from sklearn.model_selection import GridSearchCV, PredefinedSplit

from learn.comparison.fits import Trials
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


@pytest.mark.few(4)
@pytest.mark.parametrize(("model", "space"), [*REDUCED.items(), *SCALED.items()])
def test_scores_and_winner_are_those_of_scikit_learns_grid_search(
    model, space, training, searching
):
    search = searching(model, space)
    grid, scores = search.grid, search.exhaustive().scores
    theirs = pipeline(MODELS[model], tuned=True)
    if model == "kernel-ridge":
        theirs.set_params(**{STEP: KernelRidge()})
    named = {f"{STEP}__{name}": values for name, values in space.items()}
    reference = GridSearchCV(
        theirs, named, cv=PredefinedSplit(training.folds), scoring="r2", refit=False
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of perceptrons that have not converged
        reference.fit(training.inputs, training.target)
    results = reference.cv_results_
    expected = np.stack([results[f"split{fold}_test_score"] for fold in range(5)], axis=1)
    assert np.isfinite(expected).all()
    canonical = list(grid.canonical)
    np.testing.assert_allclose(scores.folds[canonical], expected, rtol=0, atol=1e-10)
    np.testing.assert_allclose(scores.means[canonical], results["mean_test_score"], atol=1e-10)
    best = results["params"][int(np.argmin(results["rank_test_score"]))]
    assert grid.first(scores.winner) == {key.partition("__")[2]: best[key] for key in best}
    assert scores.fits == 5 * len(grid.families)
    if space is REDUCED[model] and model != "gaussian-process":
        assert len(grid.families) < grid.nominal


def test_ties_go_to_the_first_in_the_grid(searching):
    space = {"min_samples_split": [2, 3, 4], "min_samples_leaf": [2], "max_depth": [3]}
    search = searching("decision-tree", space)
    assert len(search.grid.differing) == 1
    assert search.grid.first(search.exhaustive().scores.winner)["min_samples_split"] == 2


def test_finished_fits_are_not_done_again(searching, trees, tmp_path):
    path = tmp_path / "cut.jsonl"
    with Trials(path, {"seed": 0}) as opened:
        first = searching("decision-tree", trees, opened).exhaustive().scores
    whole = path.read_bytes()
    # A kill in the midst of a line.
    path.write_bytes(whole[: int(0.6 * len(whole))])
    with Trials(path, {"seed": 0}) as opened:
        left = len(opened.finished)
        assert 0 < left < first.folds.size
        search = searching("decision-tree", trees, opened)
        tasks = search.tasks(range(len(search.grid.families)), 80)
        assert sum(len(task.candidates) for task in tasks) == first.folds.size - left
        again = search.exhaustive().scores
    np.testing.assert_array_equal(first.folds, again.folds)
    for line in path.read_text().splitlines():
        json.loads(line)
