"""One fit for all numbers of trees; fits that fail or lack memory; files of finished fits."""

import numpy as np
import pytest

from gen.runtime.errors import InputError
from learn import models
from learn.comparison.fits import FoldRows, Trials, shared_predictions
from learn.models import MODELS, pipeline

KINDS = [
    ("random-forest", {"max_features": 0.3}),
    ("adaboost", {"loss": "square", "learning_rate": 1.0}),
    ("adaboost", {"estimator__max_depth": 18}),
    ("gradient-boost", {"loss": "huber", "max_features": "sqrt"}),
    ("xgboost", {"subsample": 0.5, "booster": "gbtree"}),
]


@pytest.mark.parametrize(("model", "settings"), KINDS)
def test_first_trees_predict_what_a_fit_of_so_many_trees_predicts(
    model, settings, samples
):
    inputs, target = samples
    rows = FoldRows(inputs[:60], target[:60], inputs[60:])
    numbers = [3, 11, 40]
    unfitted = pipeline(MODELS[model], settings, seed=4, tuned=True)
    together = shared_predictions(MODELS[model], unfitted, rows, "n_estimators", numbers)
    for number, found in zip(numbers, together, strict=True):
        alone = pipeline(
            MODELS[model], {**settings, "n_estimators": number}, seed=4, tuned=True
        )
        expected = alone.fit(rows.inputs, rows.target).predict(rows.test_inputs)
        np.testing.assert_array_equal(found, expected)


def test_a_staged_fit_that_fails_late_keeps_its_good_beginnings(searching, monkeypatch):
    from sklearn.ensemble import GradientBoostingRegressor

    whole = GradientBoostingRegressor.fit

    def limited(self, *arguments, **named):
        if self.n_estimators > 5:
            raise ValueError("diverged")
        return whole(self, *arguments, **named)

    monkeypatch.setattr(GradientBoostingRegressor, "fit", limited)
    search = searching("gradient-boost", {"n_estimators": [2, 5, 9]})
    search.fit_all()
    assert [*search.means(search.grid.differing)] == ["n_estimators=2", "n_estimators=5"]
    assert search.failures == {"diverged": 5}
    assert search.winner == "n_estimators=5"


@pytest.mark.filterwarnings("ignore:overflow encountered:RuntimeWarning")
def test_a_fit_that_diverges_is_a_failure_that_the_next_run_can_read(searching, trials):
    """Steps of 50 times the gradient: 49 times the residual after each, with other signs."""
    space = {"learning_rate": [0.1, 50.0], "n_estimators": [2, 60]}
    search = searching("gradient-boost", space)
    search.fit_all()
    assert search.failures == {"prediction diverged": 5}
    assert len(search.means(search.grid.differing)) == len(search.grid.differing) - 1
    trials.__exit__(None, None, None)
    with Trials(trials.path, {}) as again:
        assert again.finished == trials.finished


def test_a_finished_fit_is_in_its_file_at_once(searching, trials):
    searching("decision-tree", {"max_depth": [2, 3]}).fit_all()
    assert trials.path.read_bytes().count(b"\n") == 1 + len(trials.finished) > 5


def test_a_machine_without_the_memory_for_a_fit_ends_the_search(searching, monkeypatch):
    monkeypatch.setattr(models, "free", lambda: models.PROCESS)
    with pytest.raises(InputError, match=r"svm needs about .* fewer workers"):
        searching("svm", {"C": [1.0]}).fit_all()
