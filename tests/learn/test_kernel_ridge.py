"""Kernel ridge beside scikit-learn's, and where that one gives up."""

from functools import partial

import numpy as np
import pytest
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, WhiteKernel
from sklearn.kernel_ridge import KernelRidge

from learn.kernel_ridge import (
    IllConditioned,
    SafeKernelRidge,
    left_out_errors,
    predictions,
)


@pytest.mark.parametrize("kernel", ["rbf", "linear", "poly"])
@pytest.mark.parametrize("alpha", [1e-5, 1e-2, 1.0])
def test_it_is_scikit_learns_where_that_is_well_conditioned(samples, kernel, alpha):
    inputs, target = samples
    settings = {"kernel": kernel, "alpha": alpha, "gamma": 0.7}
    ours = SafeKernelRidge(**settings).fit(inputs[:60], target[:60])
    theirs = KernelRidge(**settings).fit(inputs[:60], target[:60])
    np.testing.assert_allclose(ours.predict(inputs), theirs.predict(inputs), rtol=1e-9)


@pytest.mark.parametrize("alpha", [1e-15, 1e-14, 0.0])
@pytest.mark.parametrize("gamma", [1e-6, 1e-5])
def test_tiny_alphas_are_answered_with_a_warning(samples, alpha, gamma):
    inputs, target = samples
    model = SafeKernelRidge(kernel="rbf", gamma=gamma, alpha=alpha)
    with pytest.warns(
        IllConditioned, match=r"condition about \de\+\d\d\): solved with alpha ="
    ):
        model.fit(inputs, target)
    assert alpha < model.alpha_used_ < 1e-9
    # The same from eigenvalues: what rounding leaves of either is the tolerance.
    values, vectors = np.linalg.eigh(model._get_kernel(inputs))
    share = np.maximum(values, 0) / (np.maximum(values, 0) + model.alpha_used_)
    smooth = vectors @ (share * (vectors.T @ target))
    assert np.abs(model.predict(inputs) - smooth).max() < 5e-3 * np.ptp(target)


@pytest.mark.parametrize("kernel", ["rbf", "linear"])
def test_all_alphas_at_once_are_those_one_by_one(samples, kernel):
    inputs, target = samples
    train, test = inputs[:60], inputs[60:]
    alphas = [1e-5, 1e-3, 1.0]
    settings = {"kernel": kernel, "gamma": 5.0}
    together = predictions(train, target[:60], test, settings, alphas)
    for alpha, found in zip(alphas, together, strict=True):
        alone = (
            SafeKernelRidge(alpha=alpha, **settings).fit(train, target[:60]).predict(test)
        )
        np.testing.assert_allclose(found, alone, rtol=1e-9)


def test_a_singular_linear_kernel_without_alpha_gives_least_squares(samples):
    inputs, target = samples
    twins = np.hstack([inputs, inputs[:, :1]])
    with pytest.warns(IllConditioned, match="solved by singular values"):
        (found,) = predictions(twins, target, twins, {"kernel": "linear"}, [0.0])
    weights = np.linalg.lstsq(twins, target, rcond=None)[0]
    np.testing.assert_allclose(found, twins @ weights, rtol=1e-6)


@pytest.mark.parametrize("kernel", ["rbf", "poly"])
def test_errors_of_rows_left_out_are_those_of_fits_to_the_others(samples, kernel):
    inputs, target = samples
    settings = {"kernel": kernel, "gamma": 0.5, "alpha": 1e-3}
    whole = SafeKernelRidge(**settings).fit(inputs, target)
    parts = [np.arange(3), np.arange(10, 70, 7), np.array([79])]
    for part, found in zip(parts, left_out_errors(whole, parts), strict=True):
        others = np.setdiff1d(np.arange(80), part)
        alone = SafeKernelRidge(**settings).fit(inputs[others], target[others])
        wanted = target[part] - alone.predict(inputs[part])
        np.testing.assert_allclose(found, wanted, rtol=1e-6, atol=1e-9)


def test_a_gaussian_process_tells_its_errors_too(samples):
    inputs, target = samples
    made = partial(GaussianProcessRegressor, RBF(0.5) + WhiteKernel(1e-3), optimizer=None)
    whole, part = made().fit(inputs, target), np.arange(10, 70, 7)
    alone = made().fit(np.delete(inputs, part, axis=0), np.delete(target, part))
    (found,) = left_out_errors(whole, [part])
    np.testing.assert_allclose(
        found, target[part] - alone.predict(inputs[part]), rtol=1e-6
    )
