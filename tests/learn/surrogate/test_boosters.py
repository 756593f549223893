"""XGBoost's trees as arrays."""

import numpy as np

from learn.executor import Executor
from learn.models import MODELS, pipeline
from learn.request import Request
from learn.surrogate import training
from learn.surrogate.estimators import from_arrays, to_arrays


def say(line):
    """Hear nothing."""


def fitted(path, model="kernel-ridge", features="dimensionless", **options):
    targets = options.pop("targets", ("area", "force"))
    scaling = "l2" if features == "paper" else "standard"
    request = Request(path, path, targets, (model,), None, scaling, features, **options)
    return training.fit(request, Executor(), say)


def test_pruned_deep_trees_of_xgboost_come_back(tmp_path):
    inputs = np.random.default_rng(0).normal(size=(400, 5))
    target = inputs[:, 0] ** 2 + inputs[:, 1]
    settings = {"n_estimators": 20, "max_depth": 12, "gamma": 1.0}
    fitted = pipeline(MODELS["xgboost"], settings).fit(inputs, target)
    again = from_arrays("xgboost", "l2", to_arrays("xgboost", fitted), 5)
    asked = np.random.default_rng(1).normal(size=(2000, 5))
    np.testing.assert_array_equal(again.predict(asked), fitted.predict(asked))
