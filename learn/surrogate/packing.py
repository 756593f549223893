"""Conversion of a surrogate to the content of its file and back, with checks on the way back."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from gen.scene import Scene
from learn.arrays import Values
from learn.columns import results
from learn.features import FeatureSet
from learn.models import Scaling
from learn.surrogate import agreement
from learn.surrogate.conformal import Calibration, Scheme
from learn.surrogate.distance import Distance
from learn.surrogate.error_growth import Growth
from learn.surrogate.error_scale import ErrorScale
from learn.surrogate.estimators import from_arrays, to_arrays
from learn.surrogate.learnt import Learnt
from learn.surrogate.moments import Clipped, clipped
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
                **to_arrays(card["model"], each.pipeline),
                "mean": each.scaling.mean,
                "deviation": each.scaling.deviation,
                "root": int(each.root),
                "held": int(each.clipped is not None),
                "borders": each.calibration.borders,
                "scores": list(each.calibration.scores),
                **_usual(each.calibration),
                **_growth(each.calibration, distance),
            }
            for name, each in learnt.items()
        },
    }


def _usual(calibration: Calibration) -> dict[str, Any]:
    """Return the usual errors of a calibration by groups as a part of the file."""
    if calibration.usual is None:
        return {}
    return {"usual": {"scheme": calibration.scheme, **vars(calibration.usual)}}


def _growth(calibration: Calibration, distance: Distance | None) -> dict[str, Any]:
    """Return the growth of the errors as a part of the file, whose distances stand there once."""
    growth = calibration.growth
    if growth is None:
        return {}
    if distance is None or not np.array_equal(distance.centres, growth.distance.centres):
        raise ValueError("errors grow with other distances than those of the surrogate")
    return {"growth": growth.rate}


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
    distance = _distance(parts, width)
    learnt = {
        name: _learnt(card, name, mapping(targets, name), width, distance) for name in targets
    }
    agreement.check_models(card, learnt, low, high)
    known = results(Scene.from_text(card["scene"]))
    for name, each in learnt.items():
        own, bounds = _clipped(features, targets[name], low, high), known[each.column].bounds
        learnt[name] = replace(each, clipped=own, bounds=bounds)
    return learnt, low, high, distance


def _distance(parts: Part, width: int) -> Distance | None:
    """Return the distances from the training."""
    if "distance" not in parts:
        return None
    part = mapping(parts, "distance")
    if "centre" in part:  # formats up to 6, which measure from one mean
        centre, whitening = numbers(part, "centre", width), numbers(part, "whitening", width, width)
        return Distance(centre[None], whitening[None], number(part, "limit", 0.0))
    centres = numbers(part, "centres", None, width)
    if not len(centres):
        raise ValueError("distances from nothing")
    whitenings = numbers(part, "whitenings", len(centres), width, width)
    return Distance(centres, whitenings, number(part, "limit", 0.0))


def _rate(part: Part, distance: Distance | None) -> Growth | None:
    """Return the growth of the errors with the distance."""
    if "growth" not in part:
        return None
    if distance is None:
        raise ValueError("errors grow with distances that are missing")
    # Beyond the limit no error grows: the exponential there is a number.
    most = LARGEST_LOGARITHM / max(distance.limit**2, 1.0)
    return Growth(distance, number(part, "growth", 0.0, most))


def _clipped(features: FeatureSet, part: Part, low: Values, high: Values) -> Clipped | None:
    """Return the ranges that moments do not leave; files of formats up to 5 have none."""
    if not count({"held": 0, **part}, "held", 0, 1):
        return None
    if not features.scaled:
        raise ValueError("features with units are not held inside their ranges")
    return clipped(features.columns, low, high)


def _scale(part: Part, width: int) -> tuple[Scheme, ErrorScale | None]:
    """Return the scale of the stored scores, and the usual errors."""
    if "usual" not in part:
        return "ranges", None
    usual = mapping(part, "usual")
    scheme: Scheme = "each" if text(usual, "scheme", ("each", "others")) == "each" else "others"
    low = number(usual, "low", -LARGEST_LOGARITHM, LARGEST_LOGARITHM)
    high = number(usual, "high", low, LARGEST_LOGARITHM)
    slopes = numbers(usual, "slopes", width)
    return scheme, ErrorScale(slopes, number(usual, "offset"), low, high)


def _learnt(
    card: Mapping[str, Any], name: str, part: Part, width: int, distance: Distance | None
) -> Learnt:
    """Return the model of one target."""
    about = card["targets"][name]
    borders, (scheme, usual) = numbers(part, "borders", None), _scale(part, width)
    growth = _rate(part, distance)
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
        pipeline=from_arrays(card["model"], card["normalisation"], part, width),
        scaling=Scaling(number(part, "mean"), positive(part, "deviation"), root),
        calibration=Calibration(borders, tuple(scores), root, scheme, usual, growth),
    )
