"""Grids after pruning: the order of their points, and the candidates that differ."""

import warnings

import numpy as np
import pytest

from learn.comparison.search import pruning
from learn.comparison.search.spaces import SPACES
from learn.models import MODELS


@pytest.mark.parametrize("model", MODELS)
def test_the_order_is_scikit_learns(model):
    from sklearn.model_selection import ParameterGrid

    assert pruning.points(SPACES[model]) == list(ParameterGrid(SPACES[model]))
    assert pruning.size(SPACES[model]) == len(ParameterGrid(SPACES[model]))


@pytest.mark.parametrize(
    ("model", "nominal", "differing", "fits"),
    [
        ("decision-tree", 600, 110, 550),
        ("random-forest", 19008, 5346, 2430),
        ("adaboost", 2079, 2079, 945),
        ("xgboost", 4480, 4480, 1600),
        ("gradient-boost", 15360, 5120, 2560),
        ("svm", 1728, 132, 660),
        ("gaussian-process", 110, 110, 550),
        ("kernel-ridge", 160, 88, 55),
        ("mlp", 756, 420, 2100),
    ],
)
def test_what_is_left_of_the_full_grids(model, nominal, differing, fits):
    grid = pruning.grid(MODELS[model], SPACES[model], inputs=23)
    assert grid.nominal == nominal
    assert len(grid.differing) == differing
    assert 5 * len(grid.families) == fits
    if model in {"random-forest", "adaboost", "gradient-boost", "xgboost", "svm"}:
        assert 5 * nominal >= 10 * fits
    assert sorted(number for family in grid.families for number in family) == [*range(differing)]
    assert grid.first(grid.canonical[-1]) in grid.candidates


def test_with_as_many_inputs_that_the_root_and_the_logarithm_differ_both_are_tried():
    space = {"max_features": ["sqrt", "log2"]}
    few = pruning.grid(MODELS["decision-tree"], space, inputs=23)
    many = pruning.grid(MODELS["decision-tree"], space, inputs=100)
    assert (len(few.differing), len(many.differing)) == (1, 2)


def test_names_of_friedmans_criterion_mean_the_squared_error(samples):
    """Once scikit-learn refuses the names, there is nothing left to compare."""
    from sklearn.ensemble import GradientBoostingRegressor, RandomForestRegressor

    for kind in (RandomForestRegressor, GradientBoostingRegressor):
        predicted = []
        for criterion in ("squared_error", "friedman_mse"):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                try:
                    model = kind(n_estimators=5, random_state=0, criterion=criterion)
                    predicted.append(model.fit(*samples).predict(samples[0]))
                except (TypeError, ValueError):
                    pytest.skip("this scikit-learn has no friedman_mse any more")
        np.testing.assert_array_equal(*predicted)
