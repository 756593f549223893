"""Models and search spaces: as the paper's Table 2 prints them, and what is left after pruning."""

import warnings

import numpy as np
import pytest

from gen.runtime.errors import InputError
from learn.comparison import paper, pruning, spaces
from learn.comparison.spaces import OPTIMA, SPACES
from learn.models import MODELS, NORMALISATIONS, chosen, pipeline

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
RANGES = {
    "decision-tree": {
        "max_depth": (1, 30),
        "min_samples_leaf": (1, 15),
        "min_samples_split": (2, 10),
    },
    "random-forest": {"max_depth": (5, 100), "n_estimators": (20, 2000)},
    "adaboost": {
        "estimator__max_depth": (3, 35),
        "n_estimators": (10, 1500),
        "learning_rate": (0.01, 2),
    },
    "gradient-boost": {
        "learning_rate": (0.001, 2),
        "max_depth": (5, 100),
        "n_estimators": (50, 1600),
    },
    "xgboost": {
        "learning_rate": (0.01, 2),
        "max_depth": (3, 15),
        "n_estimators": (10, 1500),
        "gamma": (0, 2),
    },
    "svm": {"C": (0.1, 1400), "degree": (3, 7), "cache_size": (200, 5000)},
    "gaussian-process": {"alpha": (0.001, 1.0)},
    "kernel-ridge": {"alpha": (1e-5, 1.0), "gamma": (0.01, 150)},
    "mlp": {"alpha": (1e-4, 5e-3)},
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
    for name, (low, high) in RANGES[model].items():
        assert (min(space[name]), max(space[name])) == (low, high)
        assert sorted(set(space[name])) == space[name]
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
    assert len(pruning.grid(MODELS[model], space, inputs=23).differing) <= 80


def test_the_baseline_process_has_ridges_default_length():
    from sklearn.kernel_ridge import KernelRidge

    inputs = np.random.default_rng(0).normal(size=(9, 30))
    settings = spaces.baseline("gaussian-process", "hybrid")
    process = pipeline(MODELS["gaussian-process"], settings).named_steps["model"]
    expected = KernelRidge(kernel="rbf")._get_kernel(inputs)
    np.testing.assert_allclose(process.kernel(inputs), expected, rtol=1e-3)
    assert process.kernel.hyperparameters[0].fixed


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
        chosen(["forest"])
    with pytest.raises(InputError, match="l2, standard, min-max, none"):
        pipeline(MODELS["svm"], normalisation="l1")
    assert [model.name for model in chosen(["svm", "mlp"])] == ["svm", "mlp"]
    assert len(chosen(None)) == 9
