"""Time searches, fits and predictions of models, features of a surface, and a surrogate's answers.

The pruned search is timed beside scikit-learn's own. Each benchmark asserts its answer.

    pytest bench/suites/test_learn.py --benchmark-only
"""

import warnings
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from bench.stability.models import SIDE as MADE_SIDE
from bench.stability.models import fitted, ordinary
from gen.runtime.errors import InputError
from gen.surface import generate
from learn.comparison.fits import Training, Trials
from learn.comparison.grid import Grid
from learn.comparison.paper import Space
from learn.comparison.search import GridSearch
from learn.executor import Executor
from learn.features import OF_SURFACES, SurfaceFeatures, chosen
from learn.features.columns import HYBRID
from learn.models import MODELS, STEP, check_memory, pipeline

ROWS = {"smoke": 250, "paper": 12_703}
"""Number of training rows by size of the benchmark. The paper's size runs only if times are taken
and memory suffices."""

NUMBERS = {"smoke": [4, 8], "paper": [10, 20, 30, 40, 50, 60, 70, 80]}
"""Searched numbers of estimators by size of the benchmark. In our search one fit of the largest
number serves all of them. The time falls by a factor of at most their sum over their maximum."""

SEARCHED = 250
"""Number of rows of the searches."""

Samples = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Inputs, shape (rows, 23), and target, shape (rows,), of a fit."""

Folds = NDArray[np.int8]
"""Fold of each row, 0 to 4."""

SPACES: dict[str, Space] = {
    "random-forest": {"max_features": ["sqrt", 1.0], "criterion": ["squared_error"]},
    "adaboost": {"estimator__max_depth": [3, 8], "learning_rate": [0.5]},
    "gradient-boost": {"learning_rate": [0.1], "max_depth": [3, 6]},
    "xgboost": {"learning_rate": [0.1], "max_depth": [3, 6]},
}
"""Searched values of each setting except for the numbers of estimators, by model."""


def samples_of(rows: int) -> Samples:
    """Draw random inputs, and compute a smooth function of them with a little noise."""
    generator = np.random.default_rng(0)
    inputs = generator.uniform(0.2, 1.0, (rows, 23))
    target = 1 + inputs[:, 0] ** 2 + np.sin(3 * inputs[:, 1]) * inputs[:, 2]
    return inputs, target + 0.01 * generator.normal(size=rows)


def space_of(name: str, size: str) -> Space:
    """Return the searched values of all settings of a model."""
    return {**SPACES[name], "n_estimators": NUMBERS[size]}


def best_of_scikit_learn(name: str, size: str, samples: Samples, folds: Folds) -> float:
    """Search by scikit-learn, and return the best mean R2 over the folds [1]."""
    from sklearn.model_selection import GridSearchCV, PredefinedSplit

    space = {f"{STEP}__{key}": values for key, values in space_of(name, size).items()}
    model = pipeline(MODELS[name], tuned=True)
    done = GridSearchCV(
        model, space, cv=PredefinedSplit(folds), scoring="r2", refit=False
    )
    done.fit(*samples)
    return float(np.max(done.cv_results_["mean_test_score"]))


def best_of_ours(
    name: str, size: str, samples: Samples, folds: Folds, path: Path
) -> float:
    """Search by `learn`, and return the best mean R2 over the folds [1].

    `path` is the file of the search's fits. It is deleted first, so that none of them is reused.
    """
    inputs, target = samples
    # The last two fields are test rows, which a search does not use.
    training = Training(inputs, target, folds, inputs[:2], target[:2])
    model = MODELS[name]
    grid = Grid(model, space_of(name, size), inputs.shape[1])
    path.unlink(missing_ok=True)
    with Trials(path, {}) as trials:
        search = GridSearch(model, grid, training, trials, Executor())
        search.fit_all()
        return max(search.means(grid.differing).values())


@pytest.mark.parametrize("size", NUMBERS)
@pytest.mark.parametrize("name", SPACES)
def test_search(benchmark: Any, name: str, size: str, tmp_path: Path) -> None:
    """Search with the best R2 of scikit-learn's search; record scikit-learn's time over ours."""
    if size == "paper" and not benchmark.enabled:
        pytest.skip("the smoke size asserts the same; this one is for times")
    samples = samples_of(SEARCHED)
    folds = (np.arange(SEARCHED) % 5).astype(np.int8)
    path = tmp_path / "trials.jsonl"
    ours = benchmark.pedantic(
        best_of_ours, args=(name, size, samples, folds, path), rounds=3
    )
    began = perf_counter()
    theirs = best_of_scikit_learn(name, size, samples, folds)
    seconds = perf_counter() - began
    assert ours == pytest.approx(theirs, abs=1e-10)
    benchmark.extra_info["best R2"] = ours
    if benchmark.enabled:
        benchmark.extra_info["scikit_learn_over_ours"] = (
            seconds / benchmark.stats.stats.median
        )


@pytest.mark.parametrize("size", ROWS)
@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("work", ["fit", "predict"])
def test_baseline(benchmark: Any, name: str, work: str, size: str) -> None:
    """Time the fit or the prediction of a baseline, whose R2 on training rows has to be high."""
    rows = ROWS[size]
    if size == "paper":
        if not benchmark.enabled:
            pytest.skip("the smoke size asserts the same; this one is for times")
        try:
            check_memory(name, rows)
        except InputError as error:
            pytest.skip(str(error))
    samples = samples_of(rows)
    model = pipeline(MODELS[name])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of perceptrons that have not converged
        if work == "fit":
            benchmark.pedantic(
                model.fit, args=samples, rounds=2 if size == "smoke" else 1
            )
        else:
            model.fit(*samples)
            benchmark.pedantic(model.predict, args=samples[:1], rounds=5, warmup_rounds=1)
    # Predicting all rows of the paper's size again would take long.
    first_rows = slice(2000)
    score = model.score(samples[0][first_rows], samples[1][first_rows])
    # On the few rows of the smoke size, 200 epochs make a perceptron only as good as the mean.
    lowest = -0.1 if name == "mlp" else 0.5
    assert score > lowest
    benchmark.extra_info["R2"] = score


NODES = {"smoke": 33, "paper": 129, "large": 513}
"""Nodes a side of the surface, by size of the benchmark."""

QUESTIONS = {"smoke": 1, "paper": 1000, "large": 100_000}
"""Number of questions that are answered together, by size of the benchmark."""

SIDE = 1000.0
"""Scan length [um]."""

DELTA = 12.0
"""Far-field displacement [um]."""


@pytest.mark.parametrize("size", NODES)
@pytest.mark.parametrize("name", OF_SURFACES)
def test_features(benchmark: Any, name: str, size: str) -> None:
    """Compute the features of a surface, of which no earlier round has kept anything."""
    random = np.random.default_rng(7)
    heights = generate(
        "diamond-square", NODES[size], hurst=0.65, sigma0=12.0, random=random
    )
    feature_set = chosen(name)
    step = SIDE / (NODES[size] - 1)

    def features(scale: float = 1.0) -> NDArray[np.float64]:
        """Return the features, shape (1, columns), of the surface with all lengths multiplied."""
        sides = (scale * SIDE, scale * SIDE)
        steps = (scale * step, scale * step)
        surface = SurfaceFeatures(scale * heights, sides, steps)
        return feature_set.of(surface.rows(feature_set, np.array([scale * DELTA])))

    row = benchmark(features)
    assert row.shape == (1, len(feature_set.columns))
    if feature_set.needs_surface:
        # The first two hybrid features are the share of nodes in rigid overlap, and the mean
        # interference over Delta.
        above = np.maximum(heights - (heights.max() - DELTA), 0.0)
        expected = [np.mean(above > 0), above.mean() / DELTA]
        places = [feature_set.columns.index(column) for column in HYBRID[:2]]
        assert row[0, places] == pytest.approx(expected, rel=1e-12)
    # The first feature is the displacement. If the features have no units, it is divided by the rms
    # height, so that it does not change with the scale.
    factor = 1.0 if feature_set.scaled else 2.0
    assert features(2.0)[0, 0] == pytest.approx(factor * row[0, 0], rel=1e-12)


@pytest.mark.parametrize("size", QUESTIONS)
@pytest.mark.parametrize("name", ["kernel-ridge", "xgboost", "gaussian-process"])
def test_surrogate(benchmark: Any, name: str, size: str) -> None:
    """Answer with intervals; an answer does not depend on the number of questions."""
    fit = fitted(name, "tuned", ordinary("dimensionless"))
    surrogate = fit.surrogate
    described = fit.test.described  # columns: the displacement, then the statistics
    order = np.arange(QUESTIONS[size]) % fit.test.size  # repeats the test rows
    repeated = described[order]
    questions = surrogate.of_statistics(repeated[:, 1:], repeated[:, 0], MADE_SIDE)
    answer = benchmark(surrogate.predict_rows, questions)
    test_rows = surrogate.of_statistics(described[:, 1:], described[:, 0], MADE_SIDE)
    expected = surrogate.predict_rows(test_rows)
    first = order[:40]
    values = answer.values["target"][:40]
    assert values == pytest.approx(expected.values["target"][first], rel=1e-9)
    low = answer.low["target"][:40]
    assert low == pytest.approx(expected.low["target"][first], rel=1e-9)
    if benchmark.enabled:
        answers_per_second = QUESTIONS[size] / benchmark.stats["median"]
        benchmark.extra_info["answers_per_second"] = answers_per_second
