"""The search spaces of the paper's Table 2: every value that the grid search tries.

Ranges, numbers of points and optima are the table's; the points between are ours, since it prints
none. Where the table contradicts itself or today's libraries, the optimum decides:

- `auto` for `max_features` is refused by scikit-learn now; it meant all inputs, 1.0 here;
- the forest's `max_features` of 1, its optimum, is the share 1.0, not one single input;
- the perceptron's optimum has five layers and 200 nodes, the range two to four layers and 50 to
  120 nodes: three points lie in the range, the fourth is the optimum;
- the Gaussian process's optimum, 0.0374, is the fifth of 110 points 1/110 apart from 0.001; the
  last of them is moved to the range's end, 1.0.

`learn.comparison.grid` knows which values a model ignores, and which mean the same.

Kernels measure distances, and Table 2's are between rows of unit length, 2 at most. Between rows of
d standardised features they are about sqrt(2 d), 7 for 23: there gamma is some thousandths, and a
length is about 10. So kernel methods have grids of their own (`SCALED`) for features without units,
whose targets have mean 0 and deviation 1 over the training rows as well; the tables name the grid
that was searched.
"""

from math import sqrt
from typing import Any

from learn.features import SETS, chosen

Space = dict[str, list[Any]]
"""Values to try, by setting."""

SPACES: dict[str, Space] = {
    "decision-tree": {
        "max_depth": [1, 8, 15, 22, 30],
        "max_features": [1.0, "sqrt", "log2", None],  # 1.0: the paper's auto
        "min_samples_leaf": [1, 4, 7, 10, 13, 15],
        "min_samples_split": [2, 4, 6, 8, 10],
    },
    "random-forest": {
        "max_depth": [5, 10, 15, 20, 30, 40, 60, 80, 100],
        "max_features": ["sqrt", "log2", 0.3, 1.0],
        "n_estimators": [20, 50, 100, 200, 400, 600, 800, 1000, 1300, 1600, 2000],
        "criterion": ["squared_error", "absolute_error", "friedman_mse", "poisson"],
        "min_samples_split": [2, 6, 10],
        "min_samples_leaf": [1, 5, 10, 15],
    },
    "adaboost": {
        "estimator__max_depth": [3, 8, 13, 18, 23, 29, 35],
        "loss": ["linear", "square", "exponential"],
        "n_estimators": [10, 50, 100, 200, 300, 400, 600, 800, 1000, 1250, 1500],
        "learning_rate": [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 1.5, 2.0],
    },
    "gradient-boost": {
        "learning_rate": [0.001, 0.01, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0],
        "loss": ["squared_error", "absolute_error", "huber", "quantile"],
        "max_depth": [5, 10, 15, 20, 30, 50, 75, 100],
        "n_estimators": [50, 100, 200, 400, 600, 800, 1000, 1200, 1400, 1600],
        "criterion": ["friedman_mse", "squared_error"],
        "max_features": [1.0, "sqrt", "log2"],  # 1.0: the paper's auto
    },
    "xgboost": {
        "learning_rate": [0.01, 0.05, 0.1, 0.2, 0.3, 0.5, 1.0, 2.0],
        "max_depth": [3, 6, 9, 12, 15],
        "n_estimators": [10, 50, 100, 150, 200, 300, 400, 500, 600, 750, 900, 1100, 1300, 1500],
        "gamma": [0.0, 0.1, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0],
    },
    "svm": {
        "C": [0.1, 0.5, 1.0, 5.0, 10.0, 50.0, 100.0, 200.0, 400.0, 700.0, 1000.0, 1400.0],
        "degree": [3, 5, 7],
        "kernel": ["linear", "rbf", "poly", "sigmoid"],
        "gamma": ["scale", "auto"],
        "cache_size": [200, 500, 1000, 2000, 3000, 5000],  # MB
    },
    "gaussian-process": {
        "alpha": [*(round(0.001 + step / 110, 4) for step in range(109)), 1.0],
    },
    "kernel-ridge": {
        "alpha": [1e-5, 5e-5, 1e-4, 5e-4, 1e-3, 1e-2, 0.1, 1.0],
        "gamma": [0.01, 0.1, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 150.0],
        "kernel": ["rbf", "linear"],
    },
    "mlp": {
        "activation": ["logistic", "relu", "tanh"],
        "alpha": [1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 3e-3, 5e-3],
        "hidden_layer_sizes": [
            (100, 50),
            (50, 120, 50),
            (50, 100, 100, 50),
            (50, 100, 200, 100, 50),
        ],
        "learning_rate": ["constant", "invscaling", "adaptive"],
        "solver": ["sgd", "adam", "lbfgs"],
    },
}

OPTIMA: dict[str, dict[str, Any]] = {
    "decision-tree": {
        "max_depth": 30,
        "max_features": None,
        "min_samples_leaf": 7,
        "min_samples_split": 10,
    },
    "random-forest": {
        "max_depth": 20,
        "max_features": 1.0,
        "n_estimators": 1000,
        "criterion": "squared_error",
        "min_samples_split": 2,
        "min_samples_leaf": 1,
    },
    "adaboost": {
        "estimator__max_depth": 18,
        "loss": "square",
        "n_estimators": 1500,
        "learning_rate": 1.0,
    },
    "gradient-boost": {
        "learning_rate": 0.05,
        "loss": "squared_error",
        "max_depth": 5,
        "n_estimators": 1600,
        "criterion": "friedman_mse",
        "max_features": 1.0,
    },
    "xgboost": {"learning_rate": 0.1, "max_depth": 3, "n_estimators": 1500, "gamma": 0.0},
    "svm": {"C": 1400.0, "degree": 7, "kernel": "poly", "gamma": "scale", "cache_size": 200},
    "gaussian-process": {"alpha": 0.0374},
    "kernel-ridge": {"alpha": 1e-5, "gamma": 5.0, "kernel": "rbf"},
    "mlp": {
        "activation": "tanh",
        "alpha": 1e-3,
        "hidden_layer_sizes": (50, 100, 200, 100, 50),
        "learning_rate": "adaptive",
        "solver": "lbfgs",
    },
}
"""The winners of the paper's search: points of the spaces above."""

SCALED: dict[str, Space] = {
    "svm": {
        "C": [1.0, 10.0, 100.0, 1000.0],
        "epsilon": [0.01, 0.1],
        "gamma": [3e-4, 1e-3, 3e-3, 1e-2, 3e-2],
        "kernel": ["rbf"],
    },
    "gaussian-process": {
        "alpha": [1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1],
        "kernel__length_scale": [3.0, 5.0, 10.0, 20.0, 30.0],
        # Lengths are chosen by cross-validation, not by likelihood: at unit amplitude and for small
        # alphas the likelihood is largest at a length of 0.
        "optimizer": [None],
    },
    "kernel-ridge": {
        "alpha": [1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1],
        "gamma": [1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2, 0.1],
        "kernel": ["rbf", "linear"],
    },
}
"""Grids for features without units where Table 2's do not fit; the other models keep theirs."""

SCALED_OPTIMA: dict[str, dict[str, Any]] = {
    "svm": {"C": 100.0, "epsilon": 0.01, "gamma": 0.01, "kernel": "rbf"},
    "gaussian-process": {"alpha": 1e-5, "kernel__length_scale": 10.0, "optimizer": None},
    "kernel-ridge": {"alpha": 1e-4, "gamma": 3e-3, "kernel": "rbf"},
}
"""Points of these grids that serve where nothing was searched."""

WHOLE = "whole grid"
"""The words in a result for a search that left no candidate out."""

TABLE_2 = "Table 2"
"""Name of the paper's grids in results and tables."""

SCALED_GRID = "for features without units"
"""Name of the grids `SCALED` in results and tables."""


def of(model: str, features: str) -> tuple[str, Space]:
    """Return the name in tables, and the grid, of a model for a feature set."""
    if chosen(features).scaled and model in SCALED:
        return SCALED_GRID, SCALED[model]
    return TABLE_2, SPACES[model]


def untuned(model: str, features: str) -> tuple[str, dict[str, Any]]:
    """Return the origin, for tables, and settings for a model that was not searched."""
    if chosen(features).scaled and model in SCALED_OPTIMA:
        return "built in", dict(SCALED_OPTIMA[model])
    return "the paper's optimum", dict(OPTIMA[model])


def baseline(model: str, features: str) -> dict[str, Any]:
    """Return settings of a baseline that differ from its library's and the paper's.

    The paper's Gaussian process has a kernel of length 1, over which standardised rows are not
    correlated at all (R2 below 0). There it gets the length that gamma = 1 / d means, which is
    scikit-learn's choice for the same kernel in kernel ridge.
    """
    if model == "gaussian-process" and chosen(features).scaled:
        return {"kernel__length_scale": round(sqrt(len(SETS[features].columns) / 2), 4)}
    return {}
