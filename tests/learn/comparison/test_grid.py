"""Grids: those of the paper's Table 2 and of features without units, and what pruning leaves."""

import numpy as np
import pytest

from learn.comparison import grid as grids
from learn.comparison import paper
from learn.comparison.paper import OPTIMA, SPACES
from learn.models import MODELS, pipeline

LEFT = {
    "decision-tree": (600, 110, 550),
    "random-forest": (19008, 5346, 2430),
    "adaboost": (2079, 2079, 945),
    "xgboost": (4480, 4480, 1600),
    "gradient-boost": (15360, 5120, 2560),
    "svm": (1728, 132, 660),
    "gaussian-process": (110, 110, 550),
    "kernel-ridge": (160, 88, 55),
    "mlp": (756, 420, 2100),
}
"""Candidates as the paper counts them, those that differ, and fits."""


def test_there_are_nine_models_and_the_paper_has_numbers_for_each():
    assert len(MODELS) == 9
    assert MODELS.keys() == SPACES.keys() == OPTIMA.keys() == paper.TUNING_SECONDS.keys()
    for table in (paper.TEST, paper.TIMES):
        assert table["baseline"].keys() == table["tuned"].keys() == MODELS.keys()
    for model, space in SPACES.items():
        assert all(OPTIMA[model][name] in values for name, values in space.items())


@pytest.mark.parametrize("model", MODELS)
def test_grids_are_those_of_scikit_learn_without_what_cannot_matter(model):
    from sklearn.model_selection import ParameterGrid

    grid = grids.Grid(MODELS[model], SPACES[model], inputs=23)
    assert list(grid.candidates) == list(ParameterGrid(SPACES[model]))
    assert (len(grid.candidates), len(grid.differing), 5 * len(grid.families)) == LEFT[
        model
    ]
    served = sorted(name for family in grid.families for name in family)
    assert served == sorted(grid.differing)
    last = grid.candidates[-1]
    assert grid.name_of(grid.first[grid.name_of(last)]) == grid.name_of(last)


@pytest.mark.parametrize("features", ["paper", "hybrid"])
@pytest.mark.parametrize("model", MODELS)
def test_kernels_have_grids_of_their_own_for_features_without_units(model, features):
    chosen = grids.space_of(model, features)
    source, space, settings = chosen.name, chosen.values, chosen.default
    if features == "paper" or model not in {"kernel-ridge", "svm", "gaussian-process"}:
        assert (source, space, settings) == ("Table 2", SPACES[model], OPTIMA[model])
        assert grids.baseline(model, features) == {}
        return
    assert source == "for features without units"
    assert space is not SPACES[model]
    accepted = pipeline(MODELS[model], tuned=True).named_steps["model"].get_params()
    for name, values in space.items():
        assert name in accepted
        assert settings[name] in values
    assert len(grids.Grid(MODELS[model], space, inputs=23).differing) <= 80


def test_the_baseline_process_has_ridges_default_length():
    from sklearn.kernel_ridge import KernelRidge

    inputs = np.random.default_rng(0).normal(size=(9, 30))
    settings = grids.baseline("gaussian-process", "hybrid")
    process = pipeline(MODELS["gaussian-process"], settings).named_steps["model"]
    expected = KernelRidge(kernel="rbf")._get_kernel(inputs)
    np.testing.assert_allclose(process.kernel(inputs), expected, rtol=1e-3)
    assert process.kernel.hyperparameters[0].fixed
