"""One target's model: scaling, estimator, intervals; fast where scikit-learn is slow."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from learn.models import STEP
from learn.surrogate import storage
from learn.surrogate.conformal import Calibration

Values = NDArray[np.float64]

PART = 2000
"""Rows that are predicted together: kernels need memory for rows times training rows."""


@dataclass(frozen=True, eq=False)
class Learnt:
    """One target's model.

    Attributes
    ----------
    column : the target's column in `gen.schema`
    unit : its unit
    pipeline : scaling and estimator, fitted to (target / scale - mean) / deviation
    mean, deviation : of the target over its scale
    calibration : of the target over its scale
    """

    column: str
    unit: str
    pipeline: Any
    mean: float
    deviation: float
    calibration: Calibration

    def raw(self, inputs: Values) -> Values:
        """Predict the target over its scale."""
        found = [self._predict(part) for part in _parts(inputs)]
        return self.mean + self.deviation * np.concatenate(found)

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
        """Centres, their squares, gamma and weights of kernel ridge with radial functions."""
        ridge = self.pipeline.named_steps[STEP]
        if getattr(ridge, "kernel", None) != "rbf" or not hasattr(ridge, "X_fit_"):
            return None
        centres = np.asarray(ridge.X_fit_, dtype=np.float64)
        gamma = 1.0 / centres.shape[1] if ridge.gamma is None else float(ridge.gamma)
        weights = np.asarray(ridge.dual_coef_, dtype=np.float64).reshape(-1)
        return centres, np.einsum("ij,ij->i", centres, centres), gamma, weights

    def spread(self, inputs: Values) -> Values | None:
        """Standard deviation of a Gaussian process, over the scale; None of other models."""
        process = self.pipeline.named_steps[STEP]
        if not hasattr(process, "log_marginal_likelihood"):
            return None
        if process.L_ is None:
            process.L_ = storage.factor(process)
        found = [self.pipeline.predict(part, return_std=True)[1] for part in _parts(inputs)]
        return np.concatenate(found).reshape(-1) * self.deviation


def _parts(inputs: Values) -> list[Values]:
    """Cut rows into parts, one at least."""
    return [inputs[start : start + PART] for start in range(0, max(len(inputs), 1), PART)]
