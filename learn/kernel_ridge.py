"""Kernel ridge regression that survives tiny alphas, and all alphas of a search from one kernel."""

import warnings
from collections.abc import Sequence
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

    Where the matrix is not singular to working precision the coefficients are scikit-learn's, to
    rounding. Where it is, alpha is raised until it is not, and a warning (`IllConditioned`) gives
    the estimate of the condition and the alpha that was used instead, also in `alpha_used_`.
    """

    def fit(self, X: Any, y: Any) -> "SafeKernelRidge":
        """Fit the model to inputs, (n, d), and one target, (n,).

        (K + alpha I) a = y is solved by Cholesky, with a larger alpha where that is singular.
        ValueError is raised if the kernel matrix is not finite.
        """
        inputs, target, alpha = (
            np.asarray(X, float),
            np.asarray(y, float),
            float(self.alpha),
        )
        self.X_fit_, self.n_features_in_ = inputs, inputs.shape[1]
        kernel = np.asarray(self._get_kernel(inputs))
        diagonal = kernel.diagonal().copy()
        kernel[np.abs(kernel) < NEGLIGIBLE * np.abs(diagonal).max()] = 0.0
        rounding = (
            EPSILON * max(float(diagonal.max()), np.finfo(float).tiny) * len(kernel)
        )
        shift, estimate = alpha, 0.0
        while True:
            factor = np.array(
                kernel.T, order="F"
            )  # symmetric; the transpose is Fortran's order
            np.fill_diagonal(factor, diagonal + shift)
            norm = float(matrix_norm(factor, 1, check_finite=False))
            if not np.isfinite(norm):
                raise ValueError(
                    "the kernel matrix is not finite: the inputs are too large"
                )
            factor, failed = dpotrf(factor, overwrite_a=1, clean=0)
            reciprocal = 0.0 if failed else float(dpocon(factor, anorm=norm)[0])
            if reciprocal > EPSILON:
                break
            # A failed factorisation gives no estimate: take the norm over alpha or the rounding.
            estimate = estimate or (
                1 / reciprocal if reciprocal else norm / max(alpha, rounding)
            )
            shift = max(SHIFT * rounding, 10 * shift)
        if shift > alpha:
            warnings.warn(
                f"kernel ridge with alpha = {alpha:g} is singular to working precision (condition"
                f" about {max(estimate, 1 / EPSILON):.0e}): solved with alpha = {shift:.1e}",
                IllConditioned,
                stacklevel=2,
            )
        solution, _ = dpotrs(factor, target)
        self.dual_coef_, self.alpha_used_ = (
            np.asarray(solution).reshape(target.shape),
            shift,
        )
        return self


def predictions(
    train: Values,
    target: Values,
    test: Values,
    settings: dict[str, Any],
    alphas: Sequence[float],
) -> list[Values]:
    """Predict with several alphas from kernel matrices that are built once.

    Training and test rows have scaled inputs, (n, d) and (m, d), and a target, (n,); `settings` are
    those of kernel ridge other than alpha. There is a prediction, (m,), for each alpha, equal to
    that of `SafeKernelRidge` to rounding.
    """
    if settings.get("kernel", "linear") == "linear" and train.shape[1] < train.shape[0]:
        # Ridge regression in the basis of the few eigenvectors.
        left, singular, basis = np.linalg.svd(train, full_matrices=False)
        for alpha in alphas:
            if singular[0] ** 2 * EPSILON > alpha:
                condition = singular[0] ** 2 / max(alpha, EPSILON**2 * singular[0] ** 2)
                warnings.warn(
                    f"kernel ridge with a linear kernel and alpha = {alpha:g} is singular to"
                    f" working precision (condition about {condition:.0e}): solved by singular"
                    " values",
                    IllConditioned,
                    stacklevel=2,
                )
        kept = singular > EPSILON * len(train) * singular[0]
        singular, basis = singular[kept], basis[kept]
        weights, projected = left[:, kept].T @ target, test @ basis.T
        return [
            projected @ (singular / (singular**2 + alpha) * weights) for alpha in alphas
        ]
    model = SafeKernelRidge(**settings)
    kernel = np.asarray(model._get_kernel(train))
    given = [SafeKernelRidge(alpha, kernel="precomputed") for alpha in alphas]
    coefficients = [each.fit(kernel, target).dual_coef_ for each in given]
    del kernel, given
    between = np.asarray(model._get_kernel(test, train))
    return [between @ dual for dual in coefficients]


def left_out_errors(model: Any, parts: Sequence[Indices]) -> list[Values]:
    """Return the errors at rows that are left out together, part by part, from one fit to all rows.

    The model is kernel ridge or a Gaussian process, of which the kernel stays. Of the inverse of
    the matrix K + alpha I, the rows and columns S of those left out give their errors e, target
    less prediction: inverse_SS e = coefficients_S. One inverse replaces a fit for each part, whose
    positions rise. Source: S. An, W. Liu, S. Venkatesh (2007), Pattern Recognit. 40, 2154, equation
    21.
    """
    if isinstance(model, KernelRidge):
        kernel = np.asarray(model._get_kernel(model.X_fit_), dtype=float)
        kernel[np.abs(kernel) < NEGLIGIBLE * np.abs(kernel.diagonal()).max()] = 0.0
        alpha, coefficients = getattr(model, "alpha_used_", model.alpha), model.dual_coef_
    else:
        kernel = np.asarray(model.kernel_(model.X_train_))
        alpha, coefficients = model.alpha, model.alpha_
    kernel[np.diag_indices_from(kernel)] += float(alpha)
    factor, fault = dpotrf(kernel, lower=1, overwrite_a=1)
    if fault:
        raise np.linalg.LinAlgError("the kernel matrix is not positive definite")
    inverse, _ = dpotri(factor, lower=1, overwrite_c=1)
    coefficients = np.asarray(coefficients, dtype=float).reshape(-1)
    found = []
    for part in parts:
        lower = np.tril(inverse[np.ix_(part, part)])  # the indices rise
        block = lower + np.tril(lower, -1).T
        found.append(np.linalg.solve(block, coefficients[part]))
    return found
