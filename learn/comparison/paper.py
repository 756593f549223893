"""The paper's own numbers, which stand beside ours: Tables 3 and 4."""

from statistics import median

from learn.metrics import Scores

TEST: dict[str, dict[str, Scores]] = {
    "baseline": {
        "decision-tree": Scores(8.99, 8.17, 24.62, 96.31),
        "random-forest": Scores(3.39, 5.05, 17.81, 98.56),
        "adaboost": Scores(16.71, 12.80, 25.03, 90.71),
        "xgboost": Scores(3.01, 4.86, 17.59, 98.75),
        "gradient-boost": Scores(3.95, 5.68, 17.55, 98.30),
        "svm": Scores(5.47, 6.50, 22.30, 97.61),
        "gaussian-process": Scores(1.15, 3.05, 11.76, 99.52),
        "kernel-ridge": Scores(19.11, 13.02, 34.45, 91.24),
        "mlp": Scores(3.24, 5.32, 16.34, 98.64),
    },
    "tuned": {
        "decision-tree": Scores(8.51, 8.03, 27.66, 96.51),
        "random-forest": Scores(3.34, 5.01, 18.58, 98.58),
        "adaboost": Scores(2.92, 4.77, 16.34, 98.76),
        "xgboost": Scores(1.95, 4.03, 10.34, 99.19),
        "gradient-boost": Scores(2.03, 4.03, 11.55, 99.15),
        "svm": Scores(1.20, 3.09, 10.62, 99.50),
        "gaussian-process": Scores(1.12, 3.02, 8.98, 99.54),
        "kernel-ridge": Scores(1.16, 3.07, 9.84, 99.52),
        "mlp": Scores(1.19, 3.09, 9.95, 99.51),
    },
}
"""Scores on the test rows, Table 4 [%]."""


def spread_of(scores: Scores) -> float:
    """Return variance over mean of the test areas, by nMSE and R2 of a model [%].

    Parameters
    ----------
    scores : Scores
        Scores of the model, whose R2 is not 100 %.
    """
    return scores.nmse / (100 - scores.r2)


SPREAD = median(spread_of(each) for kind in TEST.values() for each in kind.values())
"""That of the paper's test rows, the median over Table 4 [%]."""

TIMES: dict[str, dict[str, tuple[float, float]]] = {
    "baseline": {
        "decision-tree": (0.48, 0.003),
        "random-forest": (19.99, 0.094),
        "adaboost": (3.08, 0.020),
        "xgboost": (0.77, 0.002),
        "gradient-boost": (9.57, 0.006),
        "svm": (9.17, 3.408),
        "gaussian-process": (11.76, 1.994),
        "kernel-ridge": (5.68, 0.091),
        "mlp": (12.88, 0.007),
    },
    "tuned": {
        "decision-tree": (0.42, 0.003),
        "random-forest": (298.58, 1.364),
        "adaboost": (230.11, 1.174),
        "xgboost": (4.13, 0.005),
        "gradient-boost": (197.10, 0.067),
        "svm": (2550.27, 0.624),
        "gaussian-process": (853.23, 1.965),
        "kernel-ridge": (9.18, 0.827),
        "mlp": (3435.54, 0.049),
    },
}
"""Times of the fit and of predicting the whole test set, Table 4 [s]."""

TUNING_SECONDS: dict[str, float] = {
    "decision-tree": 16,
    "random-forest": 1_628_304,
    "adaboost": 42_814,
    "xgboost": 120_845,
    "gradient-boost": 900_946,
    "svm": 25_120,
    "gaussian-process": 61_494,
    "kernel-ridge": 2_599,
    "mlp": 44_325,
}
"""Times of the grid searches, Table 3 [s]."""
