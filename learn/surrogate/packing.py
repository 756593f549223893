"""Conversion of a surrogate to the content of its file and back, with checks on the way back."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from learn.arrays import Values
from learn.features import FeatureSet
from learn.surrogate import agreement
from learn.surrogate.conformal import Calibration, Scheme
from learn.surrogate.distance import Distance
from learn.surrogate.error_scale import ErrorScale
from learn.surrogate.estimators import put_together, taken_apart
from learn.surrogate.learnt import Learnt
from learn.surrogate.moments import Held, held
from learn.surrogate.parts import (
    Part,
    count,
    mapping,
    number,
    numbers,
    positive,
    sequence,
    text,
)
from learn.target import Scaling

LARGEST_LOGARITHM = 700.0
"""Of a usual error: its exponential is a number."""


def packed(
    card: Mapping[str, Any],
    learnt: Mapping[str, Learnt],
    low: Values,
    high: Values,
    distance: Distance | None = None,
) -> dict[str, Any]:
    """Convert the models of a surrogate to numbers.

    Raises
    ------
    ValueError
        If a model is of another kind than the card says, or has settings that are not kept.
    """
    return {
        "low": low,
        "high": high,
        **({} if distance is None else {"distance": vars(distance)}),
        "targets": {
            name: {
                **taken_apart(card["model"], each.pipeline),
                "mean": each.scaling.mean,
                "deviation": each.scaling.deviation,
                "root": int(each.root),
                "held": int(each.held is not None),
                "borders": each.calibration.borders,
                "scores": list(each.calibration.scores),
                **_usual(each.calibration),
            }
            for name, each in learnt.items()
        },
    }


def _usual(calibration: Calibration) -> dict[str, Any]:
    """Return the usual errors of a calibration by groups as a part of the file."""
    if calibration.usual is None:
        return {}
    return {"usual": {"scheme": calibration.scheme, **vars(calibration.usual)}}


def unpacked(
    card: dict[str, Any], parts: Part
) -> tuple[dict[str, Learnt], Values, Values, Distance | None]:
    """Convert the parts of a file to models, training ranges, and distances if there are any.

    Raises
    ------
    ValueError
        If card or parts are not what `packed` makes, or do not belong together.
    """
    features = agreement.check_card(card)
    width = len(features.columns)
    low, high = numbers(parts, "low", width), numbers(parts, "high", width)
    targets = mapping(parts, "targets")
    if (low > high).any() or targets.keys() != card["targets"].keys():
        raise ValueError("card and models do not belong together")
    learnt = {name: _learnt(card, name, mapping(targets, name), width) for name in targets}
    agreement.check_models(card, learnt, low, high)
    for name, each in learnt.items():
        learnt[name] = replace(each, held=_held(features, targets[name], low, high))
    return learnt, low, high, _distance(parts, width)


def _distance(parts: Part, width: int) -> Distance | None:
    """Return the distances from the training."""
    if "distance" not in parts:
        return None
    part = mapping(parts, "distance")
    centre, whitening = numbers(part, "centre", width), numbers(part, "whitening", width, width)
    return Distance(centre, whitening, number(part, "limit", 0.0))


def _held(features: FeatureSet, part: Part, low: Values, high: Values) -> Held | None:
    """Return the ranges that moments do not leave; files of formats up to 5 have none."""
    if not count({"held": 0, **part}, "held", 0, 1):
        return None
    if not features.scaled:
        raise ValueError("features with units are not held inside their ranges")
    return held(features.columns, low, high)


def _scale(part: Part, width: int) -> tuple[Scheme, ErrorScale | None]:
    """Return what scores are kept by, and the usual errors."""
    if "usual" not in part:
        return "ranges", None
    usual = mapping(part, "usual")
    scheme: Scheme = "each" if text(usual, "scheme", ("each", "others")) == "each" else "others"
    low = number(usual, "low", -LARGEST_LOGARITHM, LARGEST_LOGARITHM)
    high = number(usual, "high", low, LARGEST_LOGARITHM)
    slopes = numbers(usual, "slopes", width)
    return scheme, ErrorScale(slopes, number(usual, "offset"), low, high)


def _learnt(card: Mapping[str, Any], name: str, part: Part, width: int) -> Learnt:
    """Return the model of one target."""
    about = card["targets"][name]
    borders, (scheme, usual) = numbers(part, "borders", None), _scale(part, width)
    number_of_scores = borders.size + 1 if usual is None else None
    root = bool(count({"root": 0, **part}, "root", 0, 1))  # files of format 3 have none
    scores = [
        numbers({"scores": each}, "scores", None)
        for each in sequence(part, "scores", number_of_scores)
    ]
    rising = [borders, *scores]
    if any((np.diff(each) < 0).any() for each in rising) or any((s < 0).any() for s in scores):
        raise ValueError("the intervals' scores are not in order")
    if usual is not None and (borders.size or not scores or not all(s.size for s in scores)):
        raise ValueError("the intervals' scores are not those of groups")
    return Learnt(
        column=about["column"],
        unit=about["unit"],
        pipeline=put_together(card["model"], card["normalisation"], part, width),
        scaling=Scaling(number(part, "mean"), positive(part, "deviation"), root),
        calibration=Calibration(borders, tuple(scores), root, scheme, usual),
    )
