"""What a fit and its predictions have to be, whatever the rows were like."""

from collections.abc import Callable, Iterator
from functools import lru_cache
from typing import Any

import numpy as np

from bench.stability.case import Finding
from bench.stability.models.fitted import Asked, fitted, loaded, rows_of
from bench.stability.models.samples import Values, ordinary, scene
from gen.runtime.errors import InputError
from learn.models import MODELS

Check = Callable[[Asked], Iterator[Finding]]

SCALE_FREE = frozenset(MODELS) - {"svm", "mlp"}
"""Models whose predictions follow the unit of the target, with their libraries' settings."""

SINGLE = 1e-5
"""What rows rounded to single precision may change, over the largest prediction."""

SINGLE_INSIDE = 1e-6
"""XGBoost sums in single precision."""


@lru_cache(maxsize=64)
def fitted_ordinarily(name: str, way: str, features: str, target: str) -> Asked:
    """Fitted to ordinary rows, once for all cases."""
    return fitted(name, way, ordinary(features, target))


def sound(asked: Asked) -> Iterator[Finding]:
    """Numbers, never worse than the mean without saying so."""
    everything = asked.surrogate.predict_rows(rows_of(asked.test)).values["target"]
    numbers = np.concatenate((everything, asked.predicted(asked.train)))
    yield Finding("not finite", int(np.count_nonzero(~np.isfinite(numbers))), 0)
    unsaid = int(asked.worse_than_constant() and not asked.remarks)
    yield Finding("worse than a constant, unsaid", unsaid, 0)


def saved(asked: Asked) -> Iterator[Finding]:
    """The file gives the same bits, intervals too."""
    rows = rows_of(asked.test)
    before, after = (
        [getattr(each.predict_rows(rows), part)["target"] for part in ("values", "low", "high")]
        for each in (asked.surrogate, loaded(asked))
    )
    differ = int(np.count_nonzero(np.not_equal(before, after)))
    yield Finding("numbers unlike after loading", differ, 0)


def constant(asked: Asked) -> Iterator[Finding]:
    """A constant target is predicted, by models that can."""
    unable = {"kernel-ridge", "gaussian-process", "mlp"}
    if asked.name in unable and asked.train.features == "paper":
        return
    value = float(asked.train.target[0])
    allowed = asked.estimator.epsilon / abs(value) if asked.name == "svm" else 1e-6
    error = np.abs(asked.predicted(asked.test) - value).max() / abs(value)
    yield Finding("off the constant", float(error), allowed)


def same_in_other_units(asked: Asked, target: float = 1.0) -> Iterator[Finding]:
    """Predictions are those of ordinary rows, times the factor of the target's unit.

    Other units of the target may change a fit without scaling, or of a model that is not free of
    scales.
    """
    train = asked.train
    free = asked.name in SCALE_FREE and asked.way == "default"
    if target != 1.0 and train.features == "paper" and not free:
        return
    other = fitted_ordinarily(asked.name, asked.way, train.features, train.target_name)
    expected = other.predicted(other.test) * target
    allowed = SINGLE_INSIDE if asked.name == "xgboost" else 0.0
    error = _over_largest(asked.predicted(asked.test), expected)
    yield Finding("off the same in other units", error, allowed)


def flagged(asked: Asked) -> Iterator[Finding]:
    """Rows far outside the training are said to be, or refused; values are possible ones."""
    side = scene().surface.side
    for factor in (1e-12, 1e-3, 1e3, 1e12, 1e150, 1e300):
        statistics, delta = asked.test.described[:, 1:] * factor, asked.test.described[:, 0]
        try:
            rows = asked.surrogate.of_statistics(statistics, delta, side)
            found = asked.surrogate.predict_rows(rows)
        except InputError:
            continue
        unsaid = sum(not reason for reason in found.reasons)
        yield Finding(f"statistics times {factor:g} unflagged", unsaid, 0)
        values = np.concatenate([found.values["target"], found.low["target"], found.high["target"]])
        impossible = np.count_nonzero(~((values >= 0) & (values <= 100)))
        yield Finding(f"statistics times {factor:g} impossible", int(impossible), 0)


def single(asked: Asked) -> Iterator[Finding]:
    """Rows in single precision are answered as the same rows in double."""
    short: Any = asked.test.inputs.astype(np.float32)
    learnt = asked.fit.learnt
    error = _over_largest(learnt.raw(short), learnt.raw(short.astype(np.float64)))
    yield Finding("off double precision", error, SINGLE)


def _over_largest(found: Values, expected: Values) -> float:
    """Largest deviation over the largest expected number."""
    return float(np.abs(found - expected).max()) / (float(np.abs(expected).max()) or 1.0)
