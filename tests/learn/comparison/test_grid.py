"""Grids after pruning: the order of their points, and the candidates that differ."""

import pytest

from learn.comparison import grid as grids
from learn.comparison.spaces import SPACES
from learn.models import MODELS


@pytest.mark.parametrize("model", MODELS)
def test_the_order_is_scikit_learns(model):
    from sklearn.model_selection import ParameterGrid

    assert grids.points(SPACES[model]) == list(ParameterGrid(SPACES[model]))
    assert grids.size(SPACES[model]) == len(ParameterGrid(SPACES[model]))


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
    grid = grids.grid(MODELS[model], SPACES[model], inputs=23)
    assert grid.nominal == nominal
    assert len(grid.differing) == differing
    assert 5 * len(grid.families) == fits
    if model in {"random-forest", "adaboost", "gradient-boost", "xgboost", "svm"}:
        assert 5 * nominal >= 10 * fits
    assert sorted(number for family in grid.families for number in family) == [*range(differing)]
    assert grid.first(grid.canonical[-1]) in grid.candidates
