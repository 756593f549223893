"""Kernel ridge regression that survives tiny alphas, and all alphas of a search from one kernel."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import norm as matrix_norm
from scipy.linalg.lapack import dpocon, dpotrf, dpotri, dpotrs
from sklearn.kernel_ridge import KernelRidge

from gen.arrays import Indices, Values

EPSILON = float(np.finfo(float).eps)  # rounding of double precision

# Share of the diagonal below which kernel values are set to zero: they are far below rounding, and
# their products would become denormal numbers, which are several times slower.
NEGLIGIBLE = 1e-30
# Shift of a singular matrix, over the rounding of its entries: the result is then that of kernel
# ridge with the larger alpha, to about one part in a thousand in the weakest directions.
SHIFT = 1e3


class IllConditioned(UserWarning):
    """A kernel matrix with alpha on its diagonal is singular to working precision."""


class SafeKernelRidge(KernelRidge):  # type: ignore[misc]
    """scikit-learn's kernel ridge, solved with a shift of the diagonal where it is singular.

    Where the matrix is not singular to working precision, the coefficients are scikit-learn's, to
    rounding. Where it is singular, alpha is raised until it is not. A warning (`IllConditioned`)
    then gives an estimate of the condition and the alpha that was used, which is also in
    `alpha_used_`.
    """

    def fit(self, X: Any, y: Any) -> "SafeKernelRidge":
        """Fit the model: solve (K + alpha I) a = y by Cholesky, with a larger alpha if needed.

        Parameters
        ----------
        X : ArrayLike, shape (n, d)
            Scaled features; the kernel matrix, shape (n, n), with kernel="precomputed".
        y : ArrayLike, shape (n,)
            Targets.

        Returns
        -------
        SafeKernelRidge
            This model, with its coefficients.

        Raises
        ------
        ValueError
            If the kernel matrix is not finite.
        """
        inputs = np.asarray(X, float)
        target = np.asarray(y, float)
        alpha = float(self.alpha)
        self.X_fit_ = inputs
        self.n_features_in_ = inputs.shape[1]
        factor = _factorise(np.asarray(self._get_kernel(inputs)), alpha)
        if factor.alpha > alpha:
            condition = max(factor.condition, 1 / EPSILON)
            warnings.warn(
                f"kernel ridge with alpha = {alpha:g} is singular to working precision (condition"
                f" about {condition:.0e}): solved with alpha = {factor.alpha:.1e}",
                IllConditioned,
                stacklevel=2,
            )
        solution, _ = dpotrs(factor.matrix, target)
        self.dual_coef_ = np.asarray(solution).reshape(target.shape)
        self.alpha_used_ = factor.alpha
        return self


@dataclass(frozen=True, eq=False)
class _Factor:
    """The Cholesky factor of a kernel matrix with alpha on its diagonal."""

    matrix: Values  # (n, n), of which the upper triangle counts
    alpha: float  # the alpha that was used
    condition: float  # estimated with the alpha that was wanted; 0 if this was used


def _factorise(kernel: Values, alpha: float) -> _Factor:
    """Factorise a kernel matrix, whose negligible entries are set to 0, with a sufficient alpha.

    ValueError is raised if the matrix is not finite.
    """
    diagonal = kernel.diagonal().copy()
    _clear_negligible(kernel)
    rounding = EPSILON * max(float(diagonal.max()), np.finfo(float).tiny) * len(kernel)
    shift = alpha
    condition = 0.0
    while True:
        # The matrix is symmetric, and its transpose has the order of Fortran.
        factor = np.array(kernel.T, order="F")
        np.fill_diagonal(factor, diagonal + shift)
        norm = float(matrix_norm(factor, 1, check_finite=False))
        if not np.isfinite(norm):
            raise ValueError("the kernel matrix is not finite: the inputs are too large")
        factor, failed = dpotrf(factor, overwrite_a=1, clean=0)
        reciprocal = 0.0
        if not failed:
            reciprocal = float(dpocon(factor, anorm=norm)[0])
        if reciprocal > EPSILON:
            return _Factor(factor, shift, condition)
        if condition == 0 and reciprocal > 0:
            condition = 1 / reciprocal
        elif condition == 0:  # without a factor, estimate by the norm
            condition = norm / max(alpha, rounding)
        shift = max(SHIFT * rounding, 10 * shift)


def _clear_negligible(kernel: Values) -> None:
    """Set entries of a kernel matrix to 0, in place, that are far below rounding."""
    largest = np.abs(kernel.diagonal()).max()
    kernel[np.abs(kernel) < NEGLIGIBLE * largest] = 0.0


def predictions(
    train: Values,
    target: Values,
    test: Values,
    settings: dict[str, Any],
    alphas: Sequence[float],
) -> list[Values]:
    """Predict with several alphas from kernel matrices that are built once.

    A warning (`IllConditioned`) is given for each alpha with which the matrix is singular.

    Parameters
    ----------
    train : ndarray, shape (n, d)
        Scaled features of the training rows.
    target : ndarray, shape (n,)
        Their targets.
    test : ndarray, shape (m, d)
        Scaled features of the rows to predict.
    settings : dict of str to object
        Settings of kernel ridge other than alpha.
    alphas : sequence of float
        The alphas.

    Returns
    -------
    list of ndarray, shape (m,)
        Predictions with each alpha, equal to those of `SafeKernelRidge` to rounding.
    """
    if settings.get("kernel", "linear") == "linear" and train.shape[1] < train.shape[0]:
        return _linear_predictions(train, target, test, alphas)
    model = SafeKernelRidge(**settings)
    kernel = np.asarray(model._get_kernel(train))
    coefficients = [
        SafeKernelRidge(alpha, kernel="precomputed").fit(kernel, target).dual_coef_
        for alpha in alphas
    ]
    del kernel  # before another large matrix is built
    test_kernel = np.asarray(model._get_kernel(test, train))
    return [test_kernel @ weights for weights in coefficients]


def _linear_predictions(
    train: Values, target: Values, test: Values, alphas: Sequence[float]
) -> list[Values]:
    """Return the predictions with a linear kernel, by ridge regression in its few directions."""
    row_directions, singular, directions = np.linalg.svd(train, full_matrices=False)
    largest = singular[0]
    for alpha in alphas:
        if largest**2 * EPSILON > alpha:
            condition = largest**2 / max(alpha, EPSILON**2 * largest**2)
            warnings.warn(
                f"kernel ridge with a linear kernel and alpha = {alpha:g} is singular to"
                f" working precision (condition about {condition:.0e}): solved by singular"
                " values",
                IllConditioned,
                stacklevel=3,
            )
    kept = singular > EPSILON * len(train) * largest
    singular = singular[kept]
    weights = row_directions[:, kept].T @ target
    projected = test @ directions[kept].T
    return [projected @ (singular / (singular**2 + alpha) * weights) for alpha in alphas]


def left_out_errors(model: Any, parts: Sequence[Indices]) -> list[Values]:
    """Return the errors at rows that are left out together, from one fit to all rows.

    If rows S are left out and the kernel stays, their errors e, target less prediction, follow from
    the inverse of K + alpha I and the coefficients of all rows: inverse_SS e = coefficients_S. One
    inverse replaces a fit for each part. Source: S. An, W. Liu, S. Venkatesh (2007), Pattern
    Recognit. 40, 2154, equation 21.

    Parameters
    ----------
    model : KernelRidge or GaussianProcessRegressor
        The model, fitted to all rows.
    parts : sequence of ndarray, shape (k,)
        Positions of the rows of each part, in ascending order.

    Returns
    -------
    list of ndarray, shape (k,)
        Errors at the rows of each part, in the unit of the model's target.

    Raises
    ------
    numpy.linalg.LinAlgError
        If a matrix is singular.
    """
    equations = _equations_of(model)
    factor, failed = dpotrf(equations.matrix, lower=1, overwrite_a=1)
    if failed:
        raise np.linalg.LinAlgError("the kernel matrix is not positive definite")
    inverse, _ = dpotri(factor, lower=1, overwrite_c=1)
    errors = []
    for part in parts:
        # LAPACK fills the lower triangle only; that of the block is in it, as positions ascend.
        lower = np.tril(inverse[np.ix_(part, part)])
        block = lower + np.tril(lower, -1).T
        errors.append(np.linalg.solve(block, equations.coefficients[part]))
    return errors


@dataclass(frozen=True, eq=False)
class _Equations:
    """The equations that a fitted model solves for its coefficients."""

    matrix: Values  # (n, n), kernel matrix with alpha on its diagonal
    coefficients: Values  # (n,)


def _equations_of(model: Any) -> _Equations:
    """Return the equations of fitted kernel ridge or of a fitted Gaussian process."""
    if isinstance(model, KernelRidge):
        kernel = np.asarray(model._get_kernel(model.X_fit_), dtype=float)
        _clear_negligible(kernel)
        alpha = getattr(model, "alpha_used_", model.alpha)
        coefficients = model.dual_coef_
    else:
        kernel = np.asarray(model.kernel_(model.X_train_))
        alpha = model.alpha
        coefficients = model.alpha_
    kernel[np.diag_indices_from(kernel)] += float(alpha)
    return _Equations(kernel, np.asarray(coefficients, dtype=float).reshape(-1))
