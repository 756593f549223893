"""A folder with a database, and searches in this process, for the tests of the comparison."""

import numpy as np
import pytest

from learn.comparison import grid as grids
from learn.comparison.fits import Training, Trials
from learn.comparison.search import GridSearch
from learn.executor import Executor
from learn.models import MODELS


@pytest.fixture
def work(database, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def training(samples):
    """Eighty training rows in five folds."""
    inputs, target = samples
    folds = np.arange(80).astype(np.int8) % 5
    return Training(inputs, target, folds, inputs[:9], target[:9])


@pytest.fixture
def trials(tmp_path):
    with Trials(tmp_path / "trials.jsonl", {}) as opened:
        yield opened


@pytest.fixture
def searching(training, trials):
    """Make a search of a grid in this process: searching(model, space)."""

    def begin(model, space, trials=trials):
        grid = grids.grid(MODELS[model], space, training.columns)
        return GridSearch(MODELS[model], grid, training, trials, Executor())

    return begin


@pytest.fixture
def trees():
    """A grid of decision trees with every kind of synonym."""
    return {
        "max_depth": [2, 30],
        "max_features": [1.0, "sqrt", "log2", None],
        "min_samples_leaf": [1, 4],
        "min_samples_split": [2, 10],
    }
