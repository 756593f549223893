"""The model of one target: scaling, estimator and intervals, with a fast kernel ridge."""

import warnings
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from gen.runtime.errors import InputError
from learn import memory
from learn.arrays import Values
from learn.models import STEP, Scaling
from learn.surrogate.conformal import Calibration
from learn.surrogate.moments import Clipped

PART = 2000
"""Rows that are predicted together: a kernel needs memory for rows times training rows."""


@dataclass(frozen=True, eq=False)
class Learnt:
    """The fitted model of one target.

    Attributes
    ----------
    column : str
        Column of the target in `gen.schema`.
    unit : str
        Unit of the target.
    pipeline : object
        Scaling and estimator, fitted to the scaled target over its scale.
    scaling : Scaling
        Scaling of the target over its scale.
    calibration : Calibration
        Intervals of the target over its scale.
    clipped : Clipped, optional
        Ranges that the model's inputs do not leave; None for features with units.
    bounds : tuple of float
        Least and largest value of the target's column.
    """

    column: str
    unit: str
    pipeline: Any
    scaling: Scaling
    calibration: Calibration
    clipped: Clipped | None = None
    bounds: tuple[float, float] = (-np.inf, np.inf)

    def within(self, values: Values) -> Values:
        """Cut predictions, or ends of their intervals, at the bounds of the column, (n,)."""
        return np.clip(values, *self.bounds)

    @property
    def root(self) -> bool:
        """True if the model predicts the square root of the target."""
        return self.scaling.root

    def raw(self, inputs: Values) -> Values:
        """Predict the target over its scale."""
        if self.clipped is not None:
            inputs = self.clipped.of(inputs)
        with np.errstate(over="ignore", invalid="ignore"):  # said by `predict_rows`, row by row
            predicted = [self._predict(part) for part in _parts(inputs)]
            return self.scaling.restored(np.concatenate(predicted))

    def ends(self, inputs: Values, raw: Values, level: float) -> tuple[Values, Values]:
        """Return both ends of the interval over the scale, each (n,).

        Parameters
        ----------
        inputs : ndarray, shape (n, d)
            Features.
        raw : ndarray, shape (n,)
            Predictions from `raw`.
        level : float
            Wanted coverage.
        """
        return self.calibration.ends(raw, level, inputs)

    def _predict(self, inputs: Values) -> Values:
        """Predict some rows, kernel ridge without scikit-learn's checks of its training rows."""
        if self._expansion is None:
            return np.asarray(self.pipeline.predict(inputs), dtype=np.float64).reshape(-1)
        centres, squares, gamma, weights = self._expansion
        scaling = self.pipeline.steps[0][1]
        scaled = inputs if scaling == "passthrough" else scaling.transform(inputs)
        distances = squares - 2.0 * (scaled @ centres.T)
        distances += np.einsum("ij,ij->i", scaled, scaled)[:, None]
        np.maximum(distances, 0.0, out=distances)
        distances *= -gamma
        return np.asarray(np.exp(distances, out=distances) @ weights)

    @cached_property
    def _expansion(self) -> tuple[Values, Values, float, Values] | None:
        """Centres, their squares, gamma and weights of kernel ridge with radial basis functions."""
        ridge = self.pipeline.named_steps[STEP]
        if getattr(ridge, "kernel", None) != "rbf" or not hasattr(ridge, "X_fit_"):
            return None
        centres = np.asarray(ridge.X_fit_, dtype=np.float64)
        gamma = 1.0 / centres.shape[1] if ridge.gamma is None else float(ridge.gamma)
        weights = np.asarray(ridge.dual_coef_, dtype=np.float64).reshape(-1)
        return centres, np.einsum("ij,ij->i", centres, centres), gamma, weights

    @property
    def has_spread(self) -> bool:
        """Whether the model is a Gaussian process, which knows the deviation of its predictions."""
        return hasattr(self.pipeline.named_steps[STEP], "log_marginal_likelihood")

    def spread(self, inputs: Values) -> Values | None:
        """Return the deviation of a Gaussian process, over the scale; None for other models."""
        if not self.has_spread:
            return None
        process = self.pipeline.named_steps[STEP]
        if process.L_ is None:
            process.L_ = _factor(process)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # variances below 0 by rounding become 0
            deviations = [
                self.pipeline.predict(part, return_std=True)[1] for part in _parts(inputs)
            ]
        spread = np.concatenate(deviations).reshape(-1) * self.scaling.deviation
        if not self.root:
            return spread
        # The deviation of the square of a normally distributed number with this spread.
        squares = 4.0 * self.raw(inputs) * spread**2 + 2.0 * spread**4
        return np.asarray(np.sqrt(squares))


def _factor(process: Any) -> Values:
    """Compute the Cholesky factor of a Gaussian process's kernel matrix, as its fit does.

    Raises
    ------
    InputError
        If it needs more memory than this machine has, or the matrix is not positive definite.
    """
    from scipy.linalg import LinAlgError, cholesky

    rows = len(process.X_train_)
    need, limit = 3 * 8 * rows**2, memory.available()  # distances, kernel, factor
    if need > limit:
        raise InputError(
            f"deviations of a Gaussian process with {rows} rows need {need / 2**30:.1f} GiB, this"
            f" machine has {limit / 2**30:.1f} to give"
        )
    kernel = process.kernel_(process.X_train_)
    kernel[np.diag_indices_from(kernel)] += process.alpha
    try:
        return np.asarray(cholesky(kernel, lower=True, check_finite=False))
    except LinAlgError as error:
        raise InputError(f"the surrogate's Gaussian process is none: {error}") from None


def _parts(inputs: Values) -> list[Values]:
    """Cut rows into one or more parts."""
    return [inputs[start : start + PART] for start in range(0, max(len(inputs), 1), PART)]
