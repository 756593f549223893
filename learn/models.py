"""The nine models of the paper's section 3.3, in one table, as scikit-learn pipelines.

Baselines are the libraries' defaults with the paper's kernels: the Gaussian process has a radial
basis function of length 1 that is not fitted (Appendix A), kernel ridge a linear kernel. Features
without units need another length: `learn.comparison.search.spaces.baseline`.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from gen.runtime.errors import InputError

NORMALISATIONS = ("l2", "standard", "min-max", "none")
"""How rows are scaled: each to unit length (the paper's), each input to mean 0 and deviation 1,
each input to 0..1, or not at all."""

LONG_TRAINING = 20_000
"""Epochs of the tuned multi-layer perceptron; its search and its baseline have 200, the default."""


@dataclass(frozen=True)
class Model:
    """One kind of surrogate.

    Attributes
    ----------
    name : on the command line and in files
    title : in tables and pictures, as the paper writes it
    estimator : makes the baseline from a seed
    tuned : settings of the search that differ from the baseline
    refit : settings of the winner's last fit that differ from the search
    staged : the number of estimators, where one fit yields the predictions of all smaller numbers
    """

    name: str
    title: str
    estimator: Callable[[int], Any]
    tuned: Mapping[str, Any] = field(default_factory=dict)
    refit: Mapping[str, Any] = field(default_factory=dict)
    staged: str = ""


def _tree(seed: int) -> Any:
    from sklearn.tree import DecisionTreeRegressor

    return DecisionTreeRegressor(random_state=seed)


def _forest(seed: int) -> Any:
    from sklearn.ensemble import RandomForestRegressor

    return RandomForestRegressor(random_state=seed)


def _ada_boost(seed: int) -> Any:
    from sklearn.ensemble import AdaBoostRegressor
    from sklearn.tree import DecisionTreeRegressor

    # The default's tree, written out so that its depth can be set.
    return AdaBoostRegressor(DecisionTreeRegressor(max_depth=3), random_state=seed)


def _gradient_boost(seed: int) -> Any:
    from sklearn.ensemble import GradientBoostingRegressor

    return GradientBoostingRegressor(random_state=seed)


def _xgboost(seed: int) -> Any:
    try:
        from xgboost import XGBRegressor
    except ImportError:
        raise InputError("XGBoost is not installed: pip install xgboost-cpu") from None
    # Its defaults, written out because a search has to know where they stand.
    return XGBRegressor(n_estimators=100, max_depth=6, learning_rate=0.3, n_jobs=1, seed=seed)


def _support_vectors(seed: int) -> Any:
    from sklearn.svm import SVR

    return SVR()


def _gaussian_process(seed: int) -> Any:
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF

    return GaussianProcessRegressor(RBF(1.0, "fixed"), optimizer=None, random_state=seed)


def _kernel_ridge(seed: int) -> Any:
    from learn.kernel_ridge import SafeKernelRidge

    return SafeKernelRidge()


def _perceptron(seed: int) -> Any:
    from sklearn.neural_network import MLPRegressor

    return MLPRegressor(random_state=seed)


def _fitted_length() -> Any:
    """Kernel of the tuned Gaussian process: its length maximises the likelihood."""
    from sklearn.gaussian_process.kernels import RBF

    return RBF(1.0)


MODELS: dict[str, Model] = {
    model.name: model
    for model in (
        Model("decision-tree", "Decision Tree", _tree),
        Model("random-forest", "Random Forest", _forest, staged="n_estimators"),
        Model("adaboost", "AdaBoost", _ada_boost, staged="n_estimators"),
        Model("xgboost", "XGBoost", _xgboost, staged="n_estimators"),
        Model("gradient-boost", "Gradient Boost", _gradient_boost, staged="n_estimators"),
        Model("svm", "SVM Regressor", _support_vectors),
        Model(
            "gaussian-process",
            "GP Regressor",
            _gaussian_process,
            tuned={"kernel": _fitted_length, "optimizer": "fmin_l_bfgs_b"},
        ),
        Model("kernel-ridge", "Kernel Ridge", _kernel_ridge),
        Model(
            "mlp",
            "MLP Regressor",
            _perceptron,
            # L-BFGS counts evaluations too, and its default would end the training before.
            refit={"max_iter": LONG_TRAINING, "max_fun": 2 * LONG_TRAINING},
        ),
    )
}
"""All nine, in the order of the paper's Table 4."""

STEP = "model"
"""Name of the estimator in its pipeline; its settings are `model__alpha` and so on."""


def chosen(names: list[str] | None) -> list[Model]:
    """Find models by name; all nine for none.

    Raises
    ------
    InputError
        If there is no such model.
    """
    for name in names or ():
        if name not in MODELS:
            raise InputError(f"--model {name!r}: give one of {', '.join(MODELS)}")
    return [model for model in MODELS.values() if not names or model.name in names]


def pipeline(
    model: Model,
    settings: Mapping[str, Any] | None = None,
    *,
    normalisation: str = "l2",
    seed: int = 0,
    tuned: bool = False,
) -> Any:
    """Build an unfitted pipeline: scaling, then the model.

    Parameters
    ----------
    model : from `MODELS`
    settings : of the estimator, on top of the baseline's
    normalisation : one of `NORMALISATIONS`
    seed : of whatever the model draws
    tuned : True for the settings that all candidates of a search share

    Returns
    -------
    sklearn.pipeline.Pipeline
    """
    from sklearn.pipeline import Pipeline

    estimator = model.estimator(seed)
    shared = {
        name: value() if callable(value) else value
        for name, value in (model.tuned if tuned else {}).items()
    }
    estimator.set_params(**{**shared, **(settings or {})})
    return Pipeline([("scaling", _scaling(normalisation)), (STEP, estimator)])


def _scaling(normalisation: str) -> Any:
    from sklearn.preprocessing import MinMaxScaler, Normalizer, StandardScaler

    if normalisation not in NORMALISATIONS:
        known = ", ".join(NORMALISATIONS)
        raise InputError(f"--normalise {normalisation!r}: give one of {known}")
    scalings = {"l2": Normalizer, "standard": StandardScaler, "min-max": MinMaxScaler}
    return scalings[normalisation]() if normalisation in scalings else "passthrough"
