"""The Gaussian process with a fast likelihood beside scikit-learn's."""

import numpy as np
import pytest
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, WhiteKernel

from learn.gaussian_process import LengthProcess


@pytest.mark.filterwarnings("ignore::sklearn.exceptions.ConvergenceWarning")
@pytest.mark.parametrize("alpha", [1e-3, 0.0374, 1.0])
def test_the_length_is_that_of_scikit_learn(samples, alpha):
    ours = LengthProcess(RBF(0.5), alpha=alpha).fit(*samples)
    theirs = GaussianProcessRegressor(RBF(0.5), alpha=alpha).fit(*samples)
    assert ours.kernel_.length_scale == pytest.approx(
        theirs.kernel_.length_scale, rel=1e-8
    )
    value = theirs.log_marginal_likelihood_value_
    assert ours.log_marginal_likelihood_value_ == pytest.approx(value, rel=1e-12)


@pytest.mark.filterwarnings("ignore::sklearn.exceptions.ConvergenceWarning")
@pytest.mark.parametrize(
    "kernel", [RBF(np.ones(6)), RBF(0.5) + WhiteKernel(1e-3), RBF(1.0, "fixed")]
)
def test_other_kernels_are_left_to_scikit_learn(samples, kernel):
    inputs, target = samples
    ours = LengthProcess(kernel, alpha=1e-2).fit(inputs, target)
    theirs = GaussianProcessRegressor(kernel, alpha=1e-2).fit(inputs, target)
    np.testing.assert_array_equal(ours.predict(inputs), theirs.predict(inputs))


@pytest.mark.filterwarnings("ignore::sklearn.exceptions.ConvergenceWarning")
def test_a_fitted_process_keeps_no_distances(samples):
    assert "_squares" not in vars(LengthProcess(RBF(0.5)).fit(*samples))
