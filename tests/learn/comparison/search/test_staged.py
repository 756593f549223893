"""One fit for all numbers of trees: its predictions, and the boosting that it does not serve."""

import numpy as np
import pytest

from gen.runtime.errors import InputError
from learn.comparison.search import pruning
from learn.comparison.search.staged import shared_predictions
from learn.models import MODELS, STEP, pipeline

KINDS = {
    "random-forest": [{"max_features": 0.3}, {"criterion": "poisson", "min_samples_leaf": 5}],
    "adaboost": [{"loss": "square", "learning_rate": 1.0}, {"estimator__max_depth": 18}],
    "gradient-boost": [{"learning_rate": 0.5}, {"loss": "huber", "max_features": "sqrt"}],
    "xgboost": [{"learning_rate": 1.0, "gamma": 0.1}, {"subsample": 0.5, "booster": "gbtree"}],
}


@pytest.mark.parametrize(
    ("model", "settings"), [(name, each) for name, kinds in KINDS.items() for each in kinds]
)
def test_first_trees_predict_what_a_fit_of_so_many_trees_predicts(model, settings, samples):
    inputs, target = samples
    data = inputs[:60], target[:60], inputs[60:]
    numbers = [3, 11, 40]
    unfitted = pipeline(MODELS[model], settings, seed=4, tuned=True)
    together = shared_predictions(MODELS[model], unfitted, data, "n_estimators", numbers)
    for number, found in zip(numbers, together, strict=True):
        alone = pipeline(MODELS[model], {**settings, "n_estimators": number}, seed=4, tuned=True)
        expected = alone.fit(*data[:2]).predict(data[2])
        np.testing.assert_array_equal(found, expected)


REFUSED = [
    ("xgboost", "booster", "dart"),
    ("xgboost", "booster", "gblinear"),
    ("xgboost", "early_stopping_rounds", 5),
    ("gradient-boost", "n_iter_no_change", 5),
]


@pytest.mark.parametrize(("model", "setting", "value"), REFUSED)
def test_boosting_that_staged_fits_do_not_serve_is_refused_in_one_line(model, setting, value):
    space = {"n_estimators": [10, 50], setting: [None, value]}
    with pytest.raises(InputError, match=f"{model}: {setting}={value!r} cannot be") as refusal:
        pruning.grid(MODELS[model], space, 6)
    assert "\n" not in str(refusal.value)


def test_first_trees_of_dart_are_no_model_of_their_own(samples):
    """Why it is refused."""
    inputs, target = samples
    settings = {"booster": "dart", "rate_drop": 0.5, "one_drop": 1, "n_estimators": 40}
    whole = pipeline(MODELS["xgboost"], settings, tuned=True).fit(inputs, target)
    few = pipeline(MODELS["xgboost"], {**settings, "n_estimators": 10}, tuned=True)
    scaled = whole.named_steps["scaling"].transform(inputs)
    first = whole.named_steps[STEP].predict(scaled, iteration_range=(0, 10))
    assert np.abs(first - few.fit(inputs, target).predict(inputs)).max() > 0.01
