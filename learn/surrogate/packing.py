"""A surrogate as what its file holds: numbers, texts, arrays, pipelines; checked on return."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from learn.features import chosen
from learn.models import STEP
from learn.surrogate import storage
from learn.surrogate.conformal import Calibration
from learn.surrogate.learnt import Learnt

Values = NDArray[np.float64]

CARD_NUMBERS = ("nodes", "side", "spacing", "modulus")
"""Of the card, what predictions need."""


def packed(
    card: Mapping[str, Any], learnt: Mapping[str, Learnt], low: Values, high: Values
) -> dict[str, Any]:
    """Take a surrogate apart."""
    return {
        "card": card,
        "low": low,
        "high": high,
        "targets": {
            name: {
                "column": each.column,
                "unit": each.unit,
                "pipeline": each.pipeline,
                "mean": each.mean,
                "deviation": each.deviation,
                "borders": each.calibration.borders,
                "scores": list(each.calibration.scores),
            }
            for name, each in learnt.items()
        },
    }


@contextmanager
def lightened(learnt: Mapping[str, Learnt]) -> Iterator[None]:
    """Leave out of Gaussian processes what can be computed again, as long as they are written."""
    factors = {}
    for name, each in learnt.items():
        process = each.pipeline.named_steps[STEP]
        if hasattr(process, "L_"):
            factors[name] = storage.without_factor(process)
    try:
        yield
    finally:
        for name, kept in factors.items():
            learnt[name].pipeline.named_steps[STEP].L_ = kept


def unpacked(
    content: Mapping[str, Any],
) -> tuple[dict[str, Any], dict[str, Learnt], Values, Values]:
    """Put a surrogate's parts together: card, models, lowest and highest features.

    Raises
    ------
    Exception
        Nearly any, where the parts are not what `packed` makes or do not belong together.
    """
    card, low, high = content["card"], content["low"], content["high"]
    learnt = {
        str(name): Learnt(
            column=str(each["column"]),
            unit=str(each["unit"]),
            pipeline=each["pipeline"],
            mean=float(each["mean"]),
            deviation=float(each["deviation"]),
            calibration=Calibration(each["borders"], tuple(each["scores"])),
        )
        for name, each in content["targets"].items()
    }
    _check(card, learnt, low, high)
    return card, learnt, low, high


def _check(card: Mapping[str, Any], learnt: Mapping[str, Learnt], low: Any, high: Any) -> None:
    """Refuse parts that do not belong together."""
    width = len(chosen(str(card["features"])).columns)
    if low.shape != (width,) or high.shape != (width,):
        raise ValueError(f"{width} features have ranges of {low.shape}")
    for each in learnt.values():
        if int(each.pipeline.named_steps[STEP].n_features_in_) != width:
            raise ValueError(f"the model of {each.column} has other inputs")
    if not learnt:
        raise ValueError("no target")
    for name in CARD_NUMBERS:
        if not 0 < float(card[name]) < np.inf:
            raise ValueError(f"{name} is {card[name]}")
