"""The grid search beside scikit-learn's own, beyond its grid, within a time, and how it resumes."""

import json
import math
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from sklearn.kernel_ridge import KernelRidge
from sklearn.model_selection import GridSearchCV, PredefinedSplit

from learn.comparison import search as searches
from learn.comparison.fits import Training, Trial, Trials
from learn.comparison.grid import Grid, reach
from learn.comparison.search import GridSearch
from learn.executor import Executor, budget_of, seconds
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


class Searched(NamedTuple):
    """A search of a grid, and the results of scikit-learn's GridSearchCV on the same folds."""

    search: GridSearch
    results: dict[str, Any]

    @property
    def names(self):
        """Name of each candidate, in the order of scikit-learn's."""
        return [*map(self.search.grid.name_of, self.search.grid.candidates)]


@pytest.fixture(
    scope="module",
    params=[*REDUCED.items(), *SCALED.items()],
    ids=[*REDUCED, *(f"{model}-scaled" for model in SCALED)],
)
def searched(request, training, tmp_path_factory):
    model, space = request.param
    grid = Grid(MODELS[model], space, training.inputs.shape[1])
    with Trials(tmp_path_factory.mktemp(model) / "trials.jsonl", {}) as trials:
        search = GridSearch(MODELS[model], grid, training, trials, Executor())
        search.fit_all()
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
    return Searched(search, reference.cv_results_)


@pytest.mark.few(1)
def test_scores_are_those_of_scikit_learns_grid_search(searched):
    results = searched.results
    expected = np.stack([results[f"split{fold}_test_score"] for fold in range(5)], axis=1)
    assert np.isfinite(expected).all()
    folds = [*map(searched.search.folds, searched.names)]
    np.testing.assert_allclose(folds, expected, rtol=0, atol=1e-10)


@pytest.mark.few(1)
def test_means_are_those_of_scikit_learns_grid_search(searched):
    means = searched.search.means(searched.search.grid.differing)
    ours = [means[name] for name in searched.names]
    np.testing.assert_allclose(ours, searched.results["mean_test_score"], atol=1e-10)


@pytest.mark.few(1)
def test_the_winner_is_that_of_scikit_learns_grid_search(searched):
    search, results = searched
    best = results["params"][int(np.argmin(results["rank_test_score"]))]
    assert search.grid.first[search.winner] == {
        key.partition("__")[2]: best[key] for key in best
    }


@pytest.mark.few(1)
def test_each_family_of_candidates_takes_five_fits(searched):
    grid = searched.search.grid
    assert searched.search.report().fits == 5 * len(grid.families)
    if grid.space is REDUCED[grid.model.name] and grid.model.name != "gaussian-process":
        assert len(grid.families) < len(grid.candidates)


class Resumed(NamedTuple):
    """A search that was killed in the midst of a line of its file, and goes on."""

    whole: GridSearch  # the same search that was not killed
    kept: int  # trials that the file of the killed search still has
    to_do: int  # candidates on single folds that the search has to fit when it goes on
    search: GridSearch  # the search that went on
    path: Path  # the file in the end


@pytest.fixture
def resumed(searching, tmp_path):
    trees = REDUCED["decision-tree"]
    path = tmp_path / "cut.jsonl"
    with Trials(path, {"seed": 0}) as opened:
        whole = searching("decision-tree", trees, opened)
        whole.fit_all()
    content = path.read_bytes()
    path.write_bytes(content[: int(0.6 * len(content))])
    with Trials(path, {"seed": 0}) as opened:
        kept = len(opened.finished)
        search = searching("decision-tree", trees, opened)
        tasks = search.tasks(search.grid.families, 80)
        search.fit_all()
    to_do = sum(len(task.candidates) for task in tasks)
    return Resumed(whole, kept, to_do, search, path)


def test_finished_fits_are_not_done_again(resumed):
    done = len(resumed.whole.trials.finished)
    assert 0 < resumed.kept < done
    assert resumed.to_do == done - resumed.kept


def test_a_search_that_goes_on_ends_with_the_scores_of_one_that_was_not_killed(resumed):
    names = resumed.search.grid.differing
    scores = [*map(resumed.search.folds, names)]
    assert scores == [*map(resumed.whole.folds, names)]
    for line in resumed.path.read_text().splitlines():
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


SPACE = {"max_depth": [1, 2, 3, 4, 30], "min_samples_leaf": [1, 40, 80]}


@pytest.fixture
def halved(searching, monkeypatch):
    """A search by halving of `SPACE` on `levels`, which is stopped after ten judged candidates.

    On 26 rows deep trees come after all others, on all rows they are best. They are the optimum.
    """
    monkeypatch.setattr(searches, "LEAST_ROWS", 20)
    search = replace(searching("decision-tree", SPACE), training=levels(720), baseline={})
    deep = search.grid.name_of({"max_depth": 30, "min_samples_leaf": 1})
    found = limited(replace(search, optimum=deep), 11 * 5)
    found.halve(math.inf)
    few = found.means(found.grid.differing, 26, 2)
    assert few[deep] < sorted(few.values())[-3]
    return found


def test_the_optimum_is_judged_even_if_it_is_not_among_the_best_on_few_rows(halved):
    assert halved.fault == ""
    assert (halved.judged, halved.best) == (10, halved.optimum)


def test_a_search_by_halving_says_its_steps(halved):
    how = halved.how
    assert how.startswith("successive halving: 15 candidates on 26 rows, 2 folds, ")
    assert how.endswith(" 2 folds, 10 candidates on 720 rows, 5 folds")


def test_steps_of_halving_rank_on_two_folds(halved):
    trials = halved.trials.finished.values()
    assert {trial.fold for trial in trials if trial.rows == 26} == {0, 1}


def test_the_time_of_a_search_is_that_of_all_its_fits(halved):
    trials = halved.trials.finished.values()
    assert halved.seconds == pytest.approx(sum(trial.seconds for trial in trials))


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
    search = replace(searching("decision-tree", SPACE), training=levels(720), baseline={})
    found = limited(search, fits)
    found.halve(math.inf)
    assert found.fault.startswith("not searched: ")
    assert words in found.fault
    search.halve(math.inf)
    assert search.fault == "", "with more time it goes on"


@pytest.fixture
def chosen(searching, monkeypatch):
    """A search of `SPACE` on `levels` that judges ten candidates besides the optimum."""
    monkeypatch.setattr(searches, "LEAST_ROWS", 80)
    search = replace(searching("decision-tree", SPACE), training=levels(720), baseline={})
    poor = search.grid.name_of({"max_depth": 1, "min_samples_leaf": 80})
    search = replace(search, optimum=poor)
    search.choose(10)
    return search


def test_a_choice_judges_so_many_candidates_besides_the_optimum(chosen):
    assert chosen.fault == ""
    assert chosen.how == (
        "successive halving: 15 candidates on 80 rows, 2 folds, 15 candidates on 240 rows,"
        " 2 folds, 11 candidates on 720 rows, 5 folds"
    )


def test_a_choice_is_made_again_by_the_finished_fits(chosen):
    again = replace(chosen)
    finished = dict(chosen.trials.finished)
    again.choose(10)
    assert again.trials.finished == finished
    assert again.report() == chosen.report()


def test_of_long_candidates_a_choice_judges_the_optimum_and_the_best_other_one_only(
    chosen, monkeypatch
):
    monkeypatch.setattr(searches, "LONGEST", 0.0)
    search = replace(chosen)
    search.choose(10)
    assert "2 candidates on 240 rows" in search.how
    assert (search.fault, search.report().enough) == ("", 2)


@pytest.mark.parametrize(("longest", "is_followed"), [(300.0, True), (0.0, False)])
def test_a_choice_follows_its_winner_beyond_an_end_unless_its_fits_are_long(
    longest, is_followed, searching, monkeypatch
):
    monkeypatch.setattr(searches, "LONGEST", longest)
    search = searching("decision-tree", SPACE)
    search = replace(search, training=levels(720), baseline={"max_depth": 1})
    deep = search.grid.name_of({"max_depth": 30, "min_samples_leaf": 1})
    search = replace(search, optimum=deep)
    search.choose(10)
    assert (len(search.grid.candidates) > 15) is is_followed
    assert ("max_depth" in search.report().ends) is not is_followed


def test_steps_on_few_rows_train_perceptrons_for_fewer_epochs(searching, monkeypatch):
    from sklearn.neural_network import MLPRegressor

    epochs = []
    fit = MLPRegressor.fit

    def watched(self, inputs, target):
        epochs.append((len(target), self.max_iter))
        return fit(self, inputs, target)

    monkeypatch.setattr(MLPRegressor, "fit", watched)
    space = {"hidden_layer_sizes": [(2,)], "solver": ["lbfgs"], "max_iter": [30]}
    search = searching("mlp", space)
    for rows in (20, 80):
        search.run(search.tasks(search.grid.families, rows, 1), "fits")
    assert epochs == [(20, 8), (64, 30)]


@pytest.fixture
def begun(searching, trials):
    """One of two searches of `SPACE`, of which a fit of the baseline, of 30 s, is finished."""
    search = replace(searching("decision-tree", SPACE), baseline={}, searches=2)
    assert search.advice == "give a larger --budget", "nothing was begun"
    (name,) = search.baseline_family
    trials.add([Trial(candidate=name, fold=0, rows=80, r2=0.5, seconds=30.0)])
    return search


def test_a_search_without_time_says_how_long_a_fit_takes_and_which_budget_would_do(begun):
    """Five folds of ten candidates, each fitted alone, and of the baseline; two searches share."""
    needed = 2 * 5 * (10 + 1) * 30.0 / searches.JUDGED
    assert begun.advice == (
        "a fit to 80 rows takes 30 s, so that 10 candidates need --budget"
        f" {budget_of(needed)}"
    )
    assert seconds(budget_of(needed)) >= needed


def test_a_search_whose_fits_were_stopped_says_which_budget_is_the_least(begun):
    begun.ended.append(300.0)
    stopped = "a fit to 80 rows was not finished in 300 s, so that 10 candidates"
    assert stopped in begun.advice
    assert begun.advice.endswith("h or more")


def test_the_reason_of_a_search_without_a_winner_has_the_advice(begun):
    assert begun.advice in begun.fault


@pytest.fixture
def of_shallow_trees(searching):
    """A search of trees that are too shallow."""
    space = {"max_depth": [1, 2, 3], "min_samples_leaf": [1, 2, 4]}
    search = searching("decision-tree", space)
    return replace(search, training=levels(720), baseline=None)


@pytest.fixture
def extended(of_shallow_trees):
    """The same search after it went on beyond its grid; both have the same trials."""
    search = replace(of_shallow_trees)
    search.exhaust()
    return search


def test_a_search_goes_on_beyond_the_end_at_which_its_winner_lies(extended):
    added = extended.grid.candidates[9:]
    depths = [each["max_depth"] for each in added if each["min_samples_leaf"] == 1]
    assert depths[:3] == [4, 5, 6]
    assert extended.grid.first[extended.winner]["max_depth"] == 6


def test_a_second_search_finds_the_fits_beyond_the_grid_done(extended, of_shallow_trees):
    search = of_shallow_trees
    assert search.grid.first[search.best]["max_depth"] == 3
    before = dict(search.trials.finished)
    search.exhaust()
    assert search.trials.finished == before
    assert search.means(search.grid.differing) == extended.means(extended.grid.differing)


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
