"""Checks that a surrogate's card is complete, and that its models are those of the card.

They are no protection against a forged file whose card and models agree.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from gen.scene import Scene
from gen.schema import COLUMNS
from learn.arrays import Values
from learn.dataset import TARGETS
from learn.features import FeatureSet, chosen
from learn.features.hardness import hardness_limits, modulus
from learn.models import MODELS, NORMALISATIONS, STEP
from learn.surrogate.learnt import Learnt
from learn.surrogate.parts import (
    Part,
    count,
    mapping,
    number,
    positive,
    sequence,
    text,
)

ROUNDING = 1e-6
"""Relative difference allowed between numbers that are computed from the same rows."""

TEXTS = ("title", "database", "database_sha256", "licence", "made")
SCORES = ("nmse", "nmae", "nmaxe", "r2")
UNITS = {column.name: column.unit for column in COLUMNS}


def check_card(card: Part) -> FeatureSet:
    """Refuse a card that is incomplete, or contradicts itself or its scene.

    Returns
    -------
    FeatureSet
        Feature set of the card.

    Raises
    ------
    ValueError
        If the card is wrong; the message names the entry.
    """
    for name in TEXTS:
        text(card, name)
    text(card, "model", MODELS)
    text(card, "normalisation", NORMALISATIONS)
    features = chosen(text(card, "features"), _hardness(card))
    columns = [list(pair) for pair in zip(features.columns, features.units, strict=True)]
    if card.get("columns") != columns:
        raise ValueError(f"columns are not those of {features.name} features")
    _check_scene(card)
    low, high = (number({"delta": end}, "delta") for end in sequence(card, "delta", 2))
    if not 0 < low <= high:
        raise ValueError(f"delta is {low} to {high}")
    if card.get("area_max") is not None:
        number(card, "area_max", 0.0, 100.0)
    count(card, "seed")
    rows = mapping(card, "rows")
    for name in ("train", "calibration", "test"):
        count(rows, name)
    for name in mapping(rows, "left_out"):
        count(rows["left_out"], name)
    for name in mapping(card, "versions"):
        text(card["versions"], name)
    targets = mapping(card, "targets")
    if not targets:
        raise ValueError("there is no target")
    for name in targets:
        _check_target(name, mapping(targets, name))
    return features


def _check_scene(card: Part) -> None:
    """Refuse a card whose nodes, side, spacing, modulus or boundary are not those of its scene."""
    scene = Scene.from_text(text(card, "scene"), "the card's scene")
    own = {
        "nodes": scene.nodes,
        "side": scene.surface.side,
        "spacing": scene.spacing,
        "modulus": modulus(scene),
    }
    for name, wanted in own.items():
        if not np.isclose(positive(card, name), wanted, rtol=1e-12, atol=0):
            raise ValueError(f"{name} is {card[name]}, {wanted} in the scene")
    given, boundary = card.get("boundary"), scene.contact.boundary
    if given != (None if boundary == "free" else boundary):
        raise ValueError(f"boundary is {given}, {boundary} in the scene")


def _check_target(name: str, target: Part) -> None:
    column = TARGETS.get(name, name)
    if column not in UNITS or (target.get("column"), target.get("unit")) != (column, UNITS[column]):
        raise ValueError(f"{name} is no target, or of another column or unit")
    low, high = (number({"range": end}, "range") for end in sequence(target, "range", 2))
    if low > high:
        raise ValueError(f"range is {low} to {high}")
    for score in SCORES:
        _any_number(mapping(target, "scores"), score)
    for interval in sequence(target, "intervals"):
        number(interval, "level", 0.0, 1.0)
        number(interval, "coverage", 0.0, 1.0)
        _any_number(interval, "mean_width")
    count(target, "ranges_of_prediction", 1)
    text(target, "settings_from")
    for setting in mapping(target, "settings"):
        text(target["settings"], setting)
    for remark in sequence(target, "remarks"):
        text({"remarks": remark}, "remarks")


def _hardness(card: Part) -> tuple[float, float] | None:
    """Return the range of the hardness over E*, None for elastic bodies, as in the card's scene."""
    scene = Scene.from_text(text(card, "scene"), "the card's scene")
    wanted = hardness_limits(scene)
    if wanted is None:
        if "hardness_ratio" in card:
            raise ValueError("hardness_ratio is given, the scene has no hardness")
        return None
    low, high = (positive({"ends": end}, "ends") for end in sequence(card, "hardness_ratio", 2))
    if not np.allclose((low, high), wanted, rtol=1e-12, atol=0):
        raise ValueError(f"hardness_ratio is {low} to {high}, another in the scene")
    return wanted


def _any_number(part: Part, name: str) -> None:
    """Refuse an entry that is no number; it may be infinite, as the widths of intervals are."""
    if not isinstance(part, dict) or type(part.get(name)) not in {int, float}:
        raise ValueError(f"{name} is no number")


def check_models(
    card: Mapping[str, Any], learnt: Mapping[str, Learnt], low: Values, high: Values
) -> None:
    """Refuse models whose numbers of training and calibration rows are not those of the card.

    Parameters
    ----------
    card : mapping of str to object
        From `check_card`.
    learnt : mapping of str to Learnt
        Models by target.
    low, high : ndarray, shape (d,)
        Training ranges of the features.

    Raises
    ------
    ValueError
        If the card is wrong; the message names the entry.
    """
    rows = card["rows"]
    for name, each in learnt.items():
        scored = sum(scores.size for scores in each.calibration.scores)
        ranges = len(each.calibration.scores)
        if (scored, ranges) != (rows["calibration"], card["targets"][name]["ranges_of_prediction"]):
            raise ValueError(f"{name} has intervals from {scored} rows in {ranges} ranges")
        estimator = each.pipeline.named_steps[STEP]
        kept = getattr(estimator, "X_fit_", getattr(estimator, "X_train_", None))
        if kept is not None and len(kept) != rows["train"]:
            raise ValueError(f"{name} has a model of {len(kept)} rows")
        if len(getattr(estimator, "support_", ())) > rows["train"]:
            raise ValueError(f"{name} has more support vectors than rows")
        _check_scaling(each.pipeline.steps[0][1], rows["train"], low, high)


def _check_scaling(scaling: Any, rows: int, low: Values, high: Values) -> None:
    """Refuse scalings that are impossible for training rows within these ranges."""
    size = np.maximum(np.abs(low), np.abs(high))
    constant = high - low <= ROUNDING * size  # scikit-learn then divides by 1
    if hasattr(scaling, "mean_"):
        inside = (scaling.mean_ >= low - ROUNDING * size) & (
            scaling.mean_ <= high + ROUNDING * size
        )
        spread = (high - low) * (1 + ROUNDING)
        least = (high - low) * (1 - ROUNDING) / np.sqrt(2 * max(rows, 1))
        fits = (scaling.scale_ <= spread) & (scaling.scale_ >= least)
        fits |= constant & (scaling.scale_ <= np.maximum(1.0, ROUNDING * size))
        if not (inside & fits).all():
            raise ValueError("the scaling is not that of the training ranges")
    elif hasattr(scaling, "min_"):
        first, last = (end * scaling.scale_ + scaling.min_ for end in (low, high))
        near = ROUNDING * (1 + np.abs(scaling.min_))
        fits = (np.abs(first) <= near) & (np.abs(last - 1) <= near)
        if not (fits | constant).all():
            raise ValueError("the scaling is not that of the training ranges")
