"""The grid search beside scikit-learn's own, beyond its grid, within a time, and how it resumes."""

import json
import math
import warnings
from dataclasses import replace

import numpy as np
import pytest
from sklearn.kernel_ridge import KernelRidge
from sklearn.model_selection import GridSearchCV, PredefinedSplit

from learn.comparison import search as searches
from learn.comparison.fits import Training, Trial, Trials
from learn.comparison.grid import reach
from learn.executor import budget_of, seconds
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
        "alpha": [1e-5, 1.0],
        "gamma": [0.01, 5.0],
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
    "svm": {
        "C": [10.0],
        "epsilon": [0.01, 0.1],
        "gamma": [0.01, 0.03],
        "kernel": ["rbf"],
    },
    "gaussian-process": {
        "alpha": [1e-3, 0.1],
        "kernel__length_scale": [3.0, 10.0],
        "optimizer": [None],
    },
}
"""Points of the grids for features without units."""


@pytest.mark.few(1)
@pytest.mark.parametrize(("model", "space"), [*REDUCED.items(), *SCALED.items()])
def test_scores_and_winner_are_those_of_scikit_learns_grid_search(
    model, space, training, searching
):
    search = searching(model, space)
    search.fit_all()
    grid, report = search.grid, search.report()
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
    names = [*map(grid.name_of, grid.candidates)]
    folds, means = [*map(search.folds, names)], search.means(grid.differing)
    np.testing.assert_allclose(folds, expected, rtol=0, atol=1e-10)
    means = [means[name] for name in names]
    np.testing.assert_allclose(means, results["mean_test_score"], atol=1e-10)
    best = results["params"][int(np.argmin(results["rank_test_score"]))]
    assert grid.first[search.winner] == {
        key.partition("__")[2]: best[key] for key in best
    }
    assert report.fits == 5 * len(grid.families)
    if space is REDUCED[model] and model != "gaussian-process":
        assert len(grid.families) < len(grid.candidates)


def test_finished_fits_are_not_done_again(searching, tmp_path):
    trees = REDUCED["decision-tree"]
    path = tmp_path / "cut.jsonl"
    with Trials(path, {"seed": 0}) as opened:
        first = searching("decision-tree", trees, opened)
        first.fit_all()
    done = len(first.trials.finished)
    whole = path.read_bytes()
    # A kill in the midst of a line.
    path.write_bytes(whole[: int(0.6 * len(whole))])
    with Trials(path, {"seed": 0}) as opened:
        left = len(opened.finished)
        assert 0 < left < done
        search = searching("decision-tree", trees, opened)
        tasks = search.tasks(search.grid.families, 80)
        assert sum(len(task.candidates) for task in tasks) == done - left
        search.fit_all()
    names = search.grid.differing
    assert [*map(first.folds, names)] == [*map(search.folds, names)]
    for line in path.read_text().splitlines():
        json.loads(line)


def levels(rows):
    """Two hundred random levels of one input: a tree finds them in many rows only."""
    generator = np.random.default_rng(0)
    inputs = np.c_[generator.uniform(size=rows), np.ones(rows)]
    target = generator.normal(size=200)[(200 * inputs[:, 0]).astype(int)]
    folds = (np.arange(rows) % 5).astype(np.int8)
    return Training(inputs, target, folds, inputs[:9], target[:9], normalisation="none")


def limited(search, fits):
    """A search that is stopped after a number of fits of all rows."""
    total = search.training.rows
    finished = search.trials.finished
    return replace(search, stopping=lambda: sum(n == total for *_, n in finished) >= fits)


def test_the_best_on_few_rows_are_judged_first_after_the_optimum(
    searching, trials, monkeypatch
):
    """On 26 rows of `levels` the deep trees come after all others, on all of them they are best."""
    monkeypatch.setattr(searches, "LEAST_ROWS", 20)
    space = {"max_depth": [1, 2, 3, 4, 30], "min_samples_leaf": [1, 40, 80]}
    search = replace(searching("decision-tree", space), training=levels(720), baseline={})
    settings = {"max_depth": 30, "min_samples_leaf": 1}
    deep = search.grid.name_of(settings)
    found = limited(replace(search, optimum=deep), 11 * 5)
    found.halve(math.inf)
    few = search.means(search.grid.differing, 26, 2)
    assert few[deep] < sorted(few.values())[-3]
    assert found.fault == ""
    assert (found.judged, found.best) == (10, deep)
    assert found.how.startswith("successive halving: 15 candidates on 26 rows, 2 folds, ")
    assert found.how.endswith(" 2 folds, 10 candidates on 720 rows, 5 folds")
    assert {trial.fold for trial in trials.finished.values() if trial.rows == 26} == {
        0,
        1,
    }
    assert found.seconds == pytest.approx(
        sum(t.seconds for t in trials.finished.values())
    )


@pytest.mark.parametrize(
    ("fits", "words"),
    [
        (3, "the baseline was not finished"),
        (25, "4 of 15 candidates were judged over 5 folds"),
    ],
)
def test_a_model_of_which_too_few_candidates_were_judged_is_not_searched(
    fits, words, searching, monkeypatch
):
    monkeypatch.setattr(searches, "LEAST_ROWS", 20)
    space = {"max_depth": [1, 2, 3, 4, 30], "min_samples_leaf": [1, 40, 80]}
    search = replace(searching("decision-tree", space), training=levels(720), baseline={})
    found = limited(search, fits)
    found.halve(math.inf)
    assert found.fault.startswith("not searched: ")
    assert words in found.fault
    search.halve(math.inf)
    assert search.fault == "", "with more time it goes on"


def test_a_search_without_time_says_how_long_a_fit_takes_and_which_budget_would_do(
    searching, trials
):
    """Five folds of ten candidates, each fitted alone, and of the baseline; two searches share."""
    space = {"max_depth": [1, 2, 3, 4, 30], "min_samples_leaf": [1, 40, 80]}
    search = replace(searching("decision-tree", space), baseline={}, searches=2)
    assert search.advice == "give a larger --budget", "nothing was begun"
    (name,) = search.baseline_family
    trials.add([Trial(candidate=name, fold=0, rows=80, r2=0.5, seconds=30.0)])
    needed = 2 * 5 * (10 + 1) * 30.0 / searches.JUDGED
    wanted = f"--budget {budget_of(needed)}"
    assert (
        search.advice
        == f"a fit to 80 rows takes 30 s, so that 10 candidates need {wanted}"
    )
    assert seconds(budget_of(needed)) >= needed
    search.ended.append(300.0)
    assert (
        "a fit to 80 rows was not finished in 300 s, so that 10 candidates"
        in search.advice
    )
    assert search.advice.endswith("h or more")
    assert search.advice in search.fault


def test_a_search_goes_on_beyond_the_end_at_which_its_winner_lies(searching, trials):
    """The smallest trees of the grid are too small: deeper ones are tried, and only the needed."""
    space = {"max_depth": [1, 2, 3], "min_samples_leaf": [1, 2, 4]}
    search = replace(
        searching("decision-tree", space), training=levels(720), baseline=None
    )
    found = replace(search)
    found.exhaust()
    added = found.grid.candidates[9:]
    best = found.grid.first[found.winner]
    assert [each["max_depth"] for each in added if each["min_samples_leaf"] == 1][:3] == [
        4,
        5,
        6,
    ]
    assert best["max_depth"] == 6
    assert search.grid.first[search.best]["max_depth"] == 3
    before = dict(trials.finished)
    search.exhaust()
    assert search.means(search.grid.differing) == found.means(found.grid.differing)
    assert trials.finished == before, "the next call finds the fits beyond the grid done"


@pytest.mark.parametrize(
    ("name", "values", "wider"),
    [
        ("C", [1e-4, 1e-3, 1e-2], [1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1, 1.0, 10.0]),
        ("min_samples_leaf", [1, 4, 7], [1, 4, 7, 12, 21, 37]),
        ("gamma", [0.0, 1.0, 2.0], [0.0, 1.0, 2.0, 4.0, 8.0, 16.0]),
        ("max_features", [1.0, "sqrt", None], [1.0, "sqrt", None]),
    ],
)
def test_numbers_go_on_beyond_both_ends_unless_nothing_lies_there(name, values, wider):
    assert reach(name, values) == wider
