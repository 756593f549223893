"""A folder with a database, and searches in this process, for the tests of the comparison."""

import numpy as np
import pytest

from learn.comparison.fits import Training, Trials
from learn.comparison.grid import Grid
from learn.comparison.search import GridSearch
from learn.executor import Executor
from learn.models import MODELS


@pytest.fixture
def work(database, here):
    """A folder with a database of its own."""
    return here


@pytest.fixture(scope="session")
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
        grid = Grid(MODELS[model], space, training.inputs.shape[1])
        return GridSearch(MODELS[model], grid, training, trials, Executor())

    return begin
