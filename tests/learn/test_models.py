"""The nine models beside their libraries' defaults."""

import warnings

import numpy as np
import pytest

from gen.runtime.errors import InputError
from learn.comparison.search.spaces import OPTIMA
from learn.models import (
    AT_BOUND,
    MODELS,
    NORMALISATIONS,
    UNFINISHED,
    models_named,
    pipeline,
    remarks,
)


@pytest.mark.parametrize("model", MODELS)
def test_baselines_are_the_libraries_own_and_repeatable(model, samples):
    from sklearn.base import clone

    built = pipeline(MODELS[model], seed=4)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # 200 epochs are not enough for the perceptron
        first = built.fit(*samples).predict(samples[0])
        again = clone(built).fit(*samples).predict(samples[0])
    np.testing.assert_array_equal(first, again)
    estimator = built.named_steps["model"]
    ours = estimator.get_params(deep=False)
    # What we set beyond a bare call: seeds and threads, and what is spelled out.
    spelled = {
        "random_state",
        "seed",
        "n_jobs",
        "estimator",
        "kernel",
        "optimizer",
        "max_depth",
        "learning_rate",
        "n_estimators",
    }
    for name, value in type(estimator)().get_params(deep=False).items():
        if name not in spelled and name != "missing":
            assert ours[name] == value, name


def test_spelled_out_defaults_are_defaults(samples):
    from sklearn.ensemble import AdaBoostRegressor
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF
    from sklearn.preprocessing import normalize
    from xgboost import XGBRegressor

    inputs, target = samples
    theirs = {
        "adaboost": AdaBoostRegressor(random_state=0),
        "xgboost": XGBRegressor(n_jobs=1),
        "gaussian-process": GaussianProcessRegressor(RBF(1.0, "fixed")),
    }
    for name, estimator in theirs.items():
        ours = pipeline(MODELS[name]).fit(inputs, target).predict(inputs)
        expected = estimator.fit(normalize(inputs), target).predict(normalize(inputs))
        np.testing.assert_array_equal(ours, expected)


def test_rows_have_unit_length_by_default(samples):
    inputs, target = samples
    fitted = pipeline(MODELS["kernel-ridge"]).fit(inputs, target)
    scaled = fitted[:-1].transform(inputs)
    expected = inputs / np.sqrt((inputs**2).sum(axis=1, keepdims=True))
    np.testing.assert_allclose(scaled, expected, rtol=1e-15)
    assert NORMALISATIONS[0] == "l2"


def test_wrong_names_are_refused():
    with pytest.raises(InputError, match="decision-tree, random-forest"):
        models_named(["forest"])
    with pytest.raises(InputError, match="l2, standard, min-max, none"):
        pipeline(MODELS["svm"], normalisation="l1")
    assert [model.name for model in models_named(["svm", "mlp"])] == ["svm", "mlp"]
    assert len(models_named(None)) == 9


@pytest.mark.parametrize("model", MODELS)
def test_libraries_tell_users_nothing_in_their_own_words(model, samples):
    """Neither a setting that a library will drop, nor how its optimiser has ended."""
    settings = dict(OPTIMA[model])
    settings |= {"n_estimators": 5} if "n_estimators" in settings else {}
    for tuned in (False, True):
        built = pipeline(MODELS[model], settings if tuned else {}, tuned=tuned)
        if model == "mlp":
            built.set_params(model__max_iter=5)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            with remarks() as said:
                built.fit(*samples)
        assert all(each in {UNFINISHED, AT_BOUND} for each in said), said


def test_warnings_of_libraries_become_sentences_once():
    from sklearn.exceptions import ConvergenceWarning

    with remarks() as said:
        for _ in range(2):
            warnings.warn("Maximum iterations (200) reached", ConvergenceWarning, stacklevel=1)
            warnings.warn(
                "close to the specified lower bound 1e-05", ConvergenceWarning, stacklevel=1
            )
            warnings.warn("`criterion` is deprecated", FutureWarning, stacklevel=1)
            warnings.warn("divide by\nzero", RuntimeWarning, stacklevel=1)
    assert said == [UNFINISHED, AT_BOUND, "divide by zero"]
