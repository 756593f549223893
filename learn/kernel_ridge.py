"""Kernel ridge regression for any alpha, and fast predictions for several alphas.

Kernel ridge solves (K + alpha I) a = y for the coefficients a, with the kernel matrix K of the
training rows and their targets y. With a tiny alpha this matrix can be singular to working
precision, and scikit-learn's solution is then wrong or fails.
"""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import norm as matrix_norm
from scipy.linalg.lapack import dpocon, dpotrf, dpotri, dpotrs
from sklearn.kernel_ridge import KernelRidge

from gen.arrays import Indices, Values

# Relative rounding of double precision.
EPSILON = float(np.finfo(float).eps)
# Largest kernel value, over the largest one of the diagonal, that is set to zero. Such values are
# far below rounding, and their products would be denormal numbers, which are several times slower.
NEGLIGIBLE = 1e-30
# Smallest alpha for a singular matrix, over the rounding of its entries. Rounding then changes the
# result by about one part in a thousand in the weakest directions.
SHIFT = 1e3


class IllConditioned(UserWarning):
    """Warning that K + alpha I is singular to working precision."""


class SafeKernelRidge(KernelRidge):  # type: ignore[misc]
    """scikit-learn's kernel ridge, with a larger alpha if the matrix is singular.

    If K + alpha I is not singular to working precision, the coefficients are those of scikit-learn
    but for rounding. Otherwise alpha is raised until it is not, and a warning (`IllConditioned`)
    states the condition number and the larger alpha. The attribute `alpha_used_` is the alpha with
    which the equations were solved.
    """

    def fit(self, X: Any, y: Any) -> "SafeKernelRidge":
        """Solve (K + alpha I) a = y by Cholesky's method, with a larger alpha if needed.

        Parameters
        ----------
        X : array_like, shape (n, d)
            Scaled features. With kernel="precomputed" it is the kernel matrix, shape (n, n), in
            which negligible values are set to 0.
        y : array_like, shape (n,)
            Targets.

        Returns
        -------
        SafeKernelRidge
            This model, with the coefficients in `dual_coef_`.

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
        is_singular = factor.alpha > alpha
        if is_singular:
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
    """The Cholesky factor of K + alpha I."""

    matrix: Values  # (n, n), the factor in the upper triangle; the lower one is not used
    alpha: float  # the alpha of the factor, at least the requested one
    # estimate of the condition number with the requested alpha; 0 if the factor has this alpha
    condition: float


def _factorise(kernel: Values, alpha: float) -> _Factor:
    """Factorise K + alpha I, (n, n), with the smallest tried alpha for which it is not singular.

    The requested alpha is tried first, then larger ones. Sets negligible entries of the kernel
    matrix K, (n, n), to 0, in place. Raises ValueError if the matrix is not finite.
    """
    diagonal = kernel.diagonal().copy()
    _clear_negligible(kernel)
    largest = max(float(diagonal.max()), np.finfo(float).tiny)
    rounding = EPSILON * largest * len(kernel)
    shift = alpha  # the alpha of this attempt
    condition = 0.0  # 0 in the first attempt
    while True:
        # The matrix is symmetric, and its transpose has the order of Fortran.
        factor = np.array(kernel.T, order="F")
        np.fill_diagonal(factor, diagonal + shift)
        norm = float(matrix_norm(factor, 1, check_finite=False))
        if not np.isfinite(norm):
            raise ValueError("the kernel matrix is not finite: the inputs are too large")
        # `clean=0` leaves the lower triangle, which is not used, as it is.
        factor, failed = dpotrf(factor, overwrite_a=1, clean=0)
        reciprocal = 0.0  # of the condition number; 0 without a factor
        if not failed:
            reciprocal = float(dpocon(factor, anorm=norm)[0])
        if reciprocal > EPSILON:
            return _Factor(matrix=factor, alpha=shift, condition=condition)
        is_first_attempt = condition == 0
        if is_first_attempt and reciprocal > 0:
            condition = 1 / reciprocal
        elif is_first_attempt:
            # There is no factor: estimate the smallest eigenvalue by alpha or rounding.
            condition = norm / max(alpha, rounding)
        shift = max(SHIFT * rounding, 10 * shift)


def _clear_negligible(kernel: Values) -> None:
    """Set the entries of a kernel matrix, (n, n), that are far below rounding to 0, in place."""
    largest = np.abs(kernel.diagonal()).max()
    kernel[np.abs(kernel) < NEGLIGIBLE * largest] = 0.0


def predictions(
    train: Values,
    target: Values,
    test: Values,
    settings: dict[str, Any],
    alphas: Sequence[float],
) -> list[Values]:
    """Predict with several alphas; the kernel matrices are built once.

    Warns (`IllConditioned`) for each alpha with which K + alpha I is singular.

    Parameters
    ----------
    train : ndarray, shape (n, d)
        Scaled features of the training rows.
    target : ndarray, shape (n,)
        Targets of the training rows.
    test : ndarray, shape (m, d)
        Scaled features of the rows to predict.
    settings : dict of str to object
        Settings of kernel ridge other than alpha.
    alphas : sequence of float
        Regularisations.

    Returns
    -------
    list of ndarray, shape (m,)
        Predictions with each alpha, equal to those of `SafeKernelRidge` but for rounding.
    """
    is_linear = settings.get("kernel", "linear") == "linear"
    rows, features = train.shape
    if is_linear and features < rows:
        return _linear_predictions(train, target, test, alphas)
    model = SafeKernelRidge(**settings)
    kernel = np.asarray(model._get_kernel(train))
    coefficients = [
        SafeKernelRidge(alpha, kernel="precomputed").fit(kernel, target).dual_coef_
        for alpha in alphas
    ]
    del kernel  # to free its memory before a second large matrix is built
    test_kernel = np.asarray(model._get_kernel(test, train))
    return [test_kernel @ weights for weights in coefficients]


def _linear_predictions(
    train: Values, target: Values, test: Values, alphas: Sequence[float]
) -> list[Values]:
    """Return the predictions with a linear kernel, (m,) for each alpha, from singular values.

    With fewer features than rows, the singular values of the features, (n, d), replace the kernel
    matrix. Directions whose singular value is only rounding are left out. Warns as `predictions`.
    """
    row_directions, singular, directions = np.linalg.svd(train, full_matrices=False)
    largest = singular[0]
    largest_square = largest**2  # the largest eigenvalue of the kernel matrix
    for alpha in alphas:
        if largest_square * EPSILON > alpha:
            # The smallest eigenvalue is 0 or more, so that alpha bounds that of K + alpha I; for an
            # alpha of 0 the condition number is stated as 1 / EPSILON^2.
            condition = largest_square / max(alpha, EPSILON**2 * largest_square)
            warnings.warn(
                f"kernel ridge with a linear kernel and alpha = {alpha:g} is singular to"
                f" working precision (condition about {condition:.0e}): solved by singular"
                " values",
                IllConditioned,
                stacklevel=3,
            )
    kept = singular > EPSILON * len(train) * largest
    kept_singular = singular[kept]
    weights = row_directions[:, kept].T @ target
    projected = test @ directions[kept].T
    results = []
    for alpha in alphas:
        filters = kept_singular / (kept_singular**2 + alpha)
        results.append(projected @ (filters * weights))
    return results


def left_out_errors(model: Any, parts: Sequence[Indices]) -> list[Values]:
    """Return the errors at parts of the rows if each part is left out, from one fit to all rows.

    If rows S are left out and the kernel is not changed, their errors e follow from the inverse of
    K + alpha I and the coefficients of all rows: inverse_SS e = coefficients_S. One inverse
    replaces one fit for each part.

    Source: S. An, W. Liu, S. Venkatesh (2007), Pattern Recognit. 40, 2154, equation 21.

    Parameters
    ----------
    model : KernelRidge or GaussianProcessRegressor
        The model, fitted to all rows.
    parts : sequence of ndarray, shape (k,)
        Positions of the rows of each part, in ascending order.

    Returns
    -------
    list of ndarray, shape (k,)
        Errors (target less prediction) at the rows of each part, in the unit of the model's
        target.

    Raises
    ------
    numpy.linalg.LinAlgError
        If K + alpha I, or the block of its inverse for a part, is singular.
    """
    equations = _equations_of(model)
    factor, failed = dpotrf(equations.matrix, lower=1, overwrite_a=1)
    if failed:
        raise np.linalg.LinAlgError("the kernel matrix is not positive definite")
    inverse, _ = dpotri(factor, lower=1, overwrite_c=1)
    errors = []
    for part in parts:
        # LAPACK computes the lower triangle of the inverse only. The positions ascend, so that this
        # contains the lower triangle of the part's block.
        lower = np.tril(inverse[np.ix_(part, part)])
        block = lower + np.tril(lower, -1).T
        errors.append(np.linalg.solve(block, equations.coefficients[part]))
    return errors


@dataclass(frozen=True, eq=False)
class _Equations:
    """The solved equations of a fitted model."""

    matrix: Values  # (n, n), K + alpha I
    coefficients: Values  # (n,), the solution


def _equations_of(model: Any) -> _Equations:
    """Return the equations of a fitted kernel ridge or a fitted Gaussian process.

    A Gaussian process solves (K + alpha I) a = y, too. The variance of its noise is alpha, or a
    part of its kernel.
    """
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
    return _Equations(
        matrix=kernel, coefficients=np.asarray(coefficients, dtype=float).reshape(-1)
    )
