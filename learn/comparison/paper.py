"""The paper's own numbers: search spaces and optima (Table 2), times and scores (Tables 3 and 4).

Ranges, numbers of points and optima of Table 2 are the paper's. It does not print the points
between the ends of a range, which are ours. If the table contradicts itself or today's libraries,
we follow its optimum:

- `auto` for `max_features`, which scikit-learn refuses now, meant all inputs: the share 1.0 here;
- the forest's optimum for `max_features`, 1, is the share 1.0 and not a single input;
- the perceptron's optimum has five layers and up to 200 nodes, although the range has two to four
  layers and 50 to 120 nodes: three of our points are in the range, and the fourth is the optimum;
- the Gaussian process's optimum, 0.0374, is the fifth of 110 points that start at 0.001 and are
  1/110 apart; the last of our points is moved to the end of the range, 1.0.

`learn.comparison.grid` leaves out values that a model ignores, and values that are equal to others.
"""

from statistics import median
from typing import Any

from learn.metrics import Scores

Space = dict[str, list[Any]]
"""Values that a search tries, by the names of scikit-learn's settings."""

# The grids of Table 2, by model.
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
        "n_estimators": [
            10,
            50,
            100,
            150,
            200,
            300,
            400,
            500,
            600,
            750,
            900,
            1100,
            1300,
            1500,
        ],
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
        "alpha": [*(round(0.001 + step / 110, 4) for step in range(109)), 1.0]
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
    "svm": {
        "C": 1400.0,
        "degree": 7,
        "kernel": "poly",
        "gamma": "scale",
        "cache_size": 200,
    },
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
"""The winners of the paper's searches, by model: points of `SPACES`."""

PUBLISHED = """
decision-tree     8.99  8.17 24.62 96.31  0.48 0.003 8.51 8.03 27.66 96.51    0.42 0.003      16
random-forest     3.39  5.05 17.81 98.56 19.99 0.094 3.34 5.01 18.58 98.58  298.58 1.364 1628304
adaboost         16.71 12.80 25.03 90.71  3.08 0.020 2.92 4.77 16.34 98.76  230.11 1.174   42814
xgboost           3.01  4.86 17.59 98.75  0.77 0.002 1.95 4.03 10.34 99.19    4.13 0.005  120845
gradient-boost    3.95  5.68 17.55 98.30  9.57 0.006 2.03 4.03 11.55 99.15  197.10 0.067  900946
svm               5.47  6.50 22.30 97.61  9.17 3.408 1.20 3.09 10.62 99.50 2550.27 0.624   25120
gaussian-process  1.15  3.05 11.76 99.52 11.76 1.994 1.12 3.02  8.98 99.54  853.23 1.965   61494
kernel-ridge     19.11 13.02 34.45 91.24  5.68 0.091 1.16 3.07  9.84 99.52    9.18 0.827    2599
mlp               3.24  5.32 16.34 98.64 12.88 0.007 1.19 3.09  9.95 99.51 3435.54 0.049   44325
"""
"""The numbers of Tables 4 and 3, with a line for each model.

After the name of the model there are six numbers of the baseline, and then these six of the tuned
model: nMSE, nMAE, nMaxE and R2 on the test rows [%], time of the fit [s], and time of predicting
the whole test set [s]. The last number is the time of the grid search [s].
"""

TEST: dict[str, dict[str, Scores]] = {"baseline": {}, "tuned": {}}
"""Scores on the test rows, by kind of result and model [%]."""

TIMES: dict[str, dict[str, tuple[float, float]]] = {"baseline": {}, "tuned": {}}
"""Time of the fit, then time of predicting the whole test set [s], by kind of result and model."""

TUNING_SECONDS: dict[str, float] = {}
"""Times of the grid searches, by model [s]."""

for _line in PUBLISHED.strip().split("\n"):
    _model, *_cells = _line.split()
    _numbers = [float(cell) for cell in _cells]
    _numbers_by_kind = {"baseline": _numbers[:6], "tuned": _numbers[6:12]}
    for _kind, _six in _numbers_by_kind.items():
        TEST[_kind][_model] = Scores(*_six[:4])
        TIMES[_kind][_model] = _six[4], _six[5]
    TUNING_SECONDS[_model] = int(_cells[12])


def spread_of(scores: Scores) -> float:
    """Return the variance of the test areas over their mean, from the scores of any model.

    Parameters
    ----------
    scores : Scores
        Scores of a model on the test rows [%]. The nMSE is (1 - R2) times variance over mean.

    Returns
    -------
    float
        Variance over mean [% of area].
    """
    return scores.nmse / (100 - scores.r2)


SPREAD = median(
    spread_of(scores) for by_model in TEST.values() for scores in by_model.values()
)
"""Variance over mean of the areas of the paper's test rows: the median over Table 4 [% of area]."""
