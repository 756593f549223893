"""Conversion of a surrogate to the content of its file and back, with checks on the way back."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from learn.arrays import Values
from learn.surrogate import agreement
from learn.surrogate.conformal import Calibration
from learn.surrogate.estimators import put_together, taken_apart
from learn.surrogate.learnt import Learnt
from learn.surrogate.parts import Part, mapping, number, numbers, positive, sequence


def packed(
    card: Mapping[str, Any], learnt: Mapping[str, Learnt], low: Values, high: Values
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
        "targets": {
            name: {
                **taken_apart(card["model"], each.pipeline),
                "mean": each.mean,
                "deviation": each.deviation,
                "borders": each.calibration.borders,
                "scores": list(each.calibration.scores),
            }
            for name, each in learnt.items()
        },
    }


def unpacked(card: dict[str, Any], parts: Part) -> tuple[dict[str, Learnt], Values, Values]:
    """Convert the parts of a file to models and the training ranges of the features.

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
    return learnt, low, high


def _learnt(card: Mapping[str, Any], name: str, part: Part, width: int) -> Learnt:
    """Return the model of one target."""
    about = card["targets"][name]
    borders = numbers(part, "borders", None)
    scores = [
        numbers({"scores": each}, "scores", None)
        for each in sequence(part, "scores", borders.size + 1)
    ]
    rising = [borders, *scores]
    if any((np.diff(each) < 0).any() for each in rising) or any((s < 0).any() for s in scores):
        raise ValueError("the intervals' scores are not in order")
    return Learnt(
        column=about["column"],
        unit=about["unit"],
        pipeline=put_together(card["model"], card["normalisation"], part, width),
        mean=number(part, "mean"),
        deviation=positive(part, "deviation"),
        calibration=Calibration(borders, tuple(scores)),
    )
