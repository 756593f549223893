"""The model of one target: scaling, estimator and intervals, with a fast kernel ridge."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from gen.arrays import Values
from gen.runtime.errors import InputError
from learn.dataset import Dataset
from learn.features.sets import PURE
from learn.models import STEP, Scaling
from learn.surrogate.interval import Calibration

PART = 2000
"""Rows that are predicted together: a kernel needs memory for rows times training rows."""

MOMENTS = frozenset(name for name in PURE if "skewness" in name or "kurtosis" in name)
"""Features of which models see the nearest value of the training.

Moments of third and fourth order have heavy tails. A window of a honed map with a groove at its
border may have a kurtosis of its peaks forty deviations from the mean. A radial basis function of
long reach extrapolates like a polynomial there, and a few rows of this kind have had most of the
squared error of all rows (`bench scans`). How large a moment is beyond those of the training
decides little about the contact, so that the end of its range is a better input. The other features
are left as they are: areas and forces of the coarse solve tell most where they are extrapolated.
Flags see the moments as they are, and predictions for other rows do not change.
"""

Clip = tuple[Values, Values]
"""Ends, each (d,), of the ranges that features are clipped to; infinite for those that are not."""


def clip_of(train: Dataset) -> Clip | None:
    """Return the training ranges of the moments among the features; None for sets with units."""
    if not train.features.scaled:
        return None
    moment = np.array([name in MOMENTS for name in train.features.columns])
    low, high = train.inputs.min(axis=0), train.inputs.max(axis=0)
    return np.where(moment, low, -np.inf), np.where(moment, high, np.inf)


@dataclass(frozen=True, eq=False)
class Learnt:
    """The fitted model of one target."""

    column: str  # in `gen.schema`
    unit: str  # of the column
    pipeline: Any  # of scikit-learn: scaling and estimator of the scaled target over its scale
    scaling: Scaling  # of the target over its scale
    calibration: Calibration  # intervals of the target over its scale
    clip: Clip | None = None  # ranges that the inputs do not leave; None for sets with units
    bounds: tuple[float, float] = (-np.inf, np.inf)  # least and largest value of the column

    def within(self, values: Values) -> Values:
        """Cut predictions, or ends of their intervals, at the bounds of the column, (n,)."""
        return np.clip(values, *self.bounds)

    def raw(self, inputs: Values) -> Values:
        """Predict the target over its scale, (n,), at the features, (n, d); NaN where one is."""
        if self.clip is not None:
            inputs = np.clip(inputs, *self.clip)
        with np.errstate(over="ignore", invalid="ignore"):  # said by `predict_rows`, row by row
            return self.scaling.restored(_by_parts(self._predict, inputs))

    def ends(self, inputs: Values, raw: Values, level: float) -> tuple[Values, Values]:
        """Return both ends, each (n,), of the interval over the scale around `raw` predictions."""
        return self.calibration.ends(raw, level, inputs)

    def mean_ends(self, inputs: Values, raw: Values, level: float) -> tuple[Values, Values]:
        """Return both ends, each (n,), of the interval of the mean over all surfaces.

        InputError is raised if the model does not know how uncertain the mean is.
        """
        model = self.pipeline.named_steps[STEP]
        if not hasattr(model, "coefficients_"):
            raise InputError("the mean has an interval with --model population alone: fit one")
        errors = _by_parts(lambda part: model.error(self.pipeline[:-1].transform(part)), inputs)
        half = model.quantile(level) * errors * self.scaling.deviation
        return raw - half, raw + half

    def _predict(self, inputs: Values) -> Values:
        """Predict some rows, kernel ridge without scikit-learn's checks of its training rows."""
        (_, scaling), (_, estimator) = self.pipeline.steps
        without_factor = getattr(estimator, "L_", estimator) is None
        if self._expansion is None and not without_factor:
            return np.asarray(self.pipeline.predict(inputs), dtype=np.float64).reshape(-1)
        scaled = inputs if scaling == "passthrough" else scaling.transform(inputs)
        if self._expansion is None:  # scikit-learn 1.7 asks for the factor also for the mean
            kernel = estimator.kernel_(scaled, estimator.X_train_)
            return np.asarray(kernel @ estimator.alpha_, dtype=np.float64).reshape(-1)
        centres, squares, gamma, weights = self._expansion
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


def _by_parts(predict: Callable[[Values], Values], inputs: Values) -> Values:
    """Predict rows without NaN, (n,), some at a time; NaN for the others."""
    found = np.full(len(inputs), np.nan)
    known = np.flatnonzero(~np.isnan(inputs).any(axis=1))
    for start in range(0, known.size, PART):
        rows = known[start : start + PART]
        found[rows] = predict(inputs[rows])
    return found
