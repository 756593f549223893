"""The model of one target: kernel ridge is scikit-learn's, and moments keep to their ranges.

Moments beyond those of the training are taken for the nearest ones; other features are not.
"""

from dataclasses import replace

import numpy as np
import pytest

from learn.dataset import Request
from learn.executor import Executor
from learn.surrogate import fitting
from learn.surrogate.flag import reasons_of


def fitted(path, features):
    scaling = "l2" if features == "paper" else "standard"
    request = Request((path,), path, ("area",), ("kernel-ridge",), None, scaling, features)
    return fitting.fit(request, Executor(), lambda line: None)


@pytest.fixture(scope="module")
def surrogate(solved):
    return fitted(solved, "hybrid")


@pytest.fixture
def middle(surrogate):
    return (surrogate.low + surrogate.high) / 2


@pytest.mark.parametrize(("name", "times"), [("peak_kurtosis_pearson", 40.0)])
def test_a_moment_beyond_the_training_is_that_at_the_end_of_its_range(
    surrogate, middle, name, times
):
    place = surrogate.features.columns.index(name)
    end, beyond, further = middle.copy(), middle.copy(), middle.copy()
    span = surrogate.high[place] - surrogate.low[place]
    end[place] = surrogate.high[place]
    beyond[place] = surrogate.high[place] + times * span
    further[place] = surrogate.low[place] - times * span
    inputs = np.array([end, beyond, further, middle])
    found, ranges = surrogate.learnt["area"].raw(inputs), (surrogate.low, surrogate.high)
    assert found[0] == found[1]
    assert found[2] != found[3], "the other end is another place"
    reasons = reasons_of(inputs, [""] * 4, surrogate.features, ranges, surrogate.distance)
    assert [name in reason for reason in reasons] == [False, True, True, False]


@pytest.mark.parametrize("features", ["paper", "dimensionless"])
def test_kernel_ridge_is_scikit_learns(solved, features):
    learnt = replace(fitted(solved, features).learnt["area"], clip=None)
    ridge = learnt.pipeline.named_steps["model"]
    inputs = learnt.pipeline.steps[0][1].transform(
        np.abs(np.random.default_rng(0).normal(size=(5000, 23)))
    )
    assert learnt._expansion is not None
    learnt.pipeline.steps[0] = ("scaling", "passthrough")
    theirs = learnt.scaling.restored(ridge.predict(inputs))
    np.testing.assert_allclose(learnt.raw(inputs), theirs, rtol=1e-6, atol=1e-9)
