"""The pruned search beside scikit-learn's own, fits and predictions of all nine models, features of
a surface and a surrogate's answers; each asserts its answer.

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
"""Training rows; the paper's are fitted only where time is taken and memory suffices."""

NUMBERS = {"smoke": [4, 8], "paper": [10, 20, 30, 40, 50, 60, 70, 80]}
"""Of estimators: their sum over their maximum is the most that one fit for all can save."""

SEARCHED = 250
"""Rows of the searches."""

Samples = tuple[NDArray[np.float64], NDArray[np.float64]]
Folds = NDArray[np.int8]

SPACES: dict[str, Space] = {  # besides the numbers of estimators
    "random-forest": {"max_features": ["sqrt", 1.0], "criterion": ["squared_error"]},
    "adaboost": {"estimator__max_depth": [3, 8], "learning_rate": [0.5]},
    "gradient-boost": {"learning_rate": [0.1], "max_depth": [3, 6]},
    "xgboost": {"learning_rate": [0.1], "max_depth": [3, 6]},
}


def samples_of(rows: int) -> Samples:
    """Smooth, with a little noise."""
    generator = np.random.default_rng(0)
    inputs = generator.uniform(0.2, 1.0, (rows, 23))
    target = 1 + inputs[:, 0] ** 2 + np.sin(3 * inputs[:, 1]) * inputs[:, 2]
    return inputs, target + 0.01 * generator.normal(size=rows)


def space_of(name: str, size: str) -> Space:
    return {**SPACES[name], "n_estimators": NUMBERS[size]}


def best_of_scikit_learn(name: str, size: str, samples: Samples, folds: Folds) -> float:
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
    inputs, target = samples
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
    """Ours is to take a third of scikit-learn's time at most, on the same single core."""
    if size == "paper" and not benchmark.enabled:
        pytest.skip("the smoke size asserts the same; this one is for times")
    samples, folds = samples_of(SEARCHED), (np.arange(SEARCHED) % 5).astype(np.int8)
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
@pytest.mark.parametrize("what", ["fit", "predict"])
def test_baseline(benchmark: Any, name: str, what: str, size: str) -> None:
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
        if what == "fit":
            benchmark.pedantic(
                model.fit, args=samples, rounds=2 if size == "smoke" else 1
            )
        else:
            model.fit(*samples)
            benchmark.pedantic(model.predict, args=samples[:1], rounds=5, warmup_rounds=1)
    few = slice(2000)
    score = model.score(samples[0][few], samples[1][few])
    # The perceptron's 200 epochs do no better than the mean on so few rows, not worse either.
    assert score > (-0.1 if name == "mlp" else 0.5)
    benchmark.extra_info["R2"] = score


NODES = {"smoke": 33, "paper": 129, "large": 513}
ASKED_ROWS = {"smoke": 1, "paper": 1000, "large": 100_000}
SIDE, DELTA = 1000.0, 12.0


@pytest.mark.parametrize("size", NODES)
@pytest.mark.parametrize("name", OF_SURFACES)
def test_features(benchmark: Any, name: str, size: str) -> None:
    """Cold: statistics, and all else that a surface is asked for, anew in every round."""
    heights = generate(
        "diamond-square", NODES[size], 0.65, 12.0, np.random.default_rng(7)
    )
    wanted, deltas, step = chosen(name), np.array([DELTA]), SIDE / (NODES[size] - 1)

    def features() -> NDArray[np.float64]:
        surface = SurfaceFeatures(heights, (SIDE, SIDE), (step, step))
        return wanted.of(surface.rows(wanted, deltas))

    found = benchmark(features)
    assert found.shape == (1, len(wanted.columns))
    if wanted.needs_surface:
        above = np.maximum(heights - (heights.max() - DELTA), 0.0)
        places = [wanted.columns.index(column) for column in HYBRID[:2]]
        bearing = found[0, places]
        assert bearing == pytest.approx(
            [np.mean(above > 0), above.mean() / DELTA], rel=1e-12
        )
    lengths = 1.0 if wanted.scaled else 2.0
    large = SurfaceFeatures(2 * heights, (2 * SIDE, 2 * SIDE), (2 * step, 2 * step))
    doubled = wanted.of(large.rows(wanted, 2 * deltas))
    assert doubled[0, 0] == pytest.approx(lengths * found[0, 0], rel=1e-12)


@pytest.mark.parametrize("size", ASKED_ROWS)
@pytest.mark.parametrize("name", ["kernel-ridge", "xgboost", "gaussian-process"])
def test_surrogate(benchmark: Any, name: str, size: str) -> None:
    """Answers with intervals; each row's must not depend on how many are asked."""
    asked = fitted(name, "tuned", ordinary("dimensionless"))
    order = np.arange(ASKED_ROWS[size]) % asked.test.size
    described, side = asked.test.described, MADE_SIDE
    every, rows = (
        asked.surrogate.of_statistics(each[:, 1:], each[:, 0], side)
        for each in (described[order], described)
    )
    answer = benchmark(asked.surrogate.predict_rows, every)
    alone = asked.surrogate.predict_rows(rows)
    few = order[:40]
    assert answer.values["target"][:40] == pytest.approx(
        alone.values["target"][few], rel=1e-9
    )
    assert answer.low["target"][:40] == pytest.approx(alone.low["target"][few], rel=1e-9)
    if benchmark.enabled:
        benchmark.extra_info["answers_per_second"] = (
            ASKED_ROWS[size] / benchmark.stats["median"]
        )
