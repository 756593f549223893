"""Search spaces as the paper's Table 2 prints them, and those of features without units."""

import numpy as np
import pytest

from learn.comparison import grid as grids
from learn.comparison import paper, spaces
from learn.comparison.spaces import OPTIMA, SPACES
from learn.models import MODELS, pipeline

POINTS = {
    "decision-tree": (5, 4, 6, 5),
    "random-forest": (9, 4, 11, 4, 3, 4),
    "adaboost": (7, 3, 11, 9),
    "gradient-boost": (8, 4, 8, 10, 2, 3),
    "xgboost": (8, 5, 14, 8),
    "svm": (12, 3, 4, 2, 6),
    "gaussian-process": (110,),
    "kernel-ridge": (8, 10, 2),
    "mlp": (3, 7, 4, 3, 3),
}


def test_there_are_nine_models_and_the_paper_has_numbers_for_each():
    assert len(MODELS) == 9
    assert MODELS.keys() == SPACES.keys() == OPTIMA.keys() == paper.TUNING_SECONDS.keys()
    for table in (paper.TEST, paper.TIMES):
        assert table["baseline"].keys() == table["tuned"].keys() == MODELS.keys()


@pytest.mark.parametrize("model", MODELS)
def test_spaces_are_table_2(model):
    space = SPACES[model]
    assert tuple(map(len, space.values())) == POINTS[model]
    for name, values in space.items():
        assert OPTIMA[model][name] in values


@pytest.mark.parametrize("features", ["paper", "dimensionless", "hybrid"])
@pytest.mark.parametrize("model", MODELS)
def test_kernels_have_grids_of_their_own_for_features_without_units(model, features):
    source, space = spaces.of(model, features)
    origin, settings = spaces.untuned(model, features)
    if features == "paper" or model not in {"kernel-ridge", "svm", "gaussian-process"}:
        assert (source, space) == ("Table 2", SPACES[model])
        assert (origin, settings) == ("the paper's optimum", OPTIMA[model])
        assert spaces.baseline(model, features) == {}
        return
    assert (source, origin) == ("for features without units", "built in")
    assert space is not SPACES[model]
    accepted = pipeline(MODELS[model], tuned=True).named_steps["model"].get_params()
    for name, values in space.items():
        assert name in accepted
        assert settings[name] in values
        numbers = [value for value in values if isinstance(value, float)]
        assert numbers == sorted(set(numbers))
    assert len(grids.grid(MODELS[model], space, inputs=23).differing) <= 80


def test_the_baseline_process_has_ridges_default_length():
    from sklearn.kernel_ridge import KernelRidge

    inputs = np.random.default_rng(0).normal(size=(9, 30))
    settings = spaces.baseline("gaussian-process", "hybrid")
    process = pipeline(MODELS["gaussian-process"], settings).named_steps["model"]
    expected = KernelRidge(kernel="rbf")._get_kernel(inputs)
    np.testing.assert_allclose(process.kernel(inputs), expected, rtol=1e-3)
    assert process.kernel.hyperparameters[0].fixed
