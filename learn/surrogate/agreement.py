"""Checks that a surrogate's card is complete, and that its models are those of the card.

They are no protection against a forged file whose card and models agree.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from gen.scene import Scene
from gen.schema import Column
from learn.arrays import Values
from learn.columns import TARGETS, results
from learn.features import FeatureSet
from learn.features.sets import features_of, limits_of, modulus
from learn.models import MODELS, NORMALISATIONS, ROOTED_TARGETS, STEP
from learn.surrogate import calibration_text
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
    scenes = _scenes(card)
    _check_hardness(card, scenes)
    features = _features(card, scenes)
    _check_scene(card, scenes[0])
    low, high = (number({"delta": end}, "delta") for end in sequence(card, "delta", 2))
    if not 0 < low <= high:
        raise ValueError(f"delta is {low} to {high}")
    if card.get("area_max") is not None:
        number(card, "area_max", 0.0, 100.0)
    count(card, "seed")
    rows = mapping(card, "rows")
    for name in ("train", "calibration", "test"):
        count(rows, name)
    text({"split_by": "tile", **rows}, "split_by", ("tile",))
    for name in mapping(rows, "left_out"):
        count(rows["left_out"], name)
    _check_growth(card.get("grown"))
    calibration_text.check(card)
    for name in mapping(card, "versions"):
        text(card["versions"], name)
    _check_targets(mapping(card, "targets"), results(scenes[0]), len(scenes))
    return features


def _features(card: Part, scenes: list[Scene]) -> FeatureSet:
    """Return the feature set, after a check that the columns are its columns."""
    if card.get("roots", True) is not True:
        raise ValueError(f"roots is {card['roots']}")
    roots, blocks = "roots" in card, count({"blocks": 0, **card}, "blocks")
    features = features_of(scenes, text(card, "features"), roots=roots, blocks=blocks)
    if features.rooted != roots:
        raise ValueError(f"{features.name} features have no roots")
    if features.blocks != blocks:
        raise ValueError(f"{features.name} features have no coarse solve of {blocks} blocks")
    columns = [list(pair) for pair in zip(features.columns, features.units, strict=True)]
    if card.get("columns") != columns:
        raise ValueError(f"columns are not those of {features.name} features")
    return features


def _scenes(card: Part) -> list[Scene]:
    """Return the scenes of a card, after a check of the entries of several databases."""
    first = text(card, "scene")
    if "databases" not in card:
        return [Scene.from_text(first, "the card's scene")]
    scenes = []
    for entry in sequence(card, "databases"):
        for name in ("database", "sha256", "generator"):
            text(entry, name)
        count(entry, "rows", 1)
        scene = Scene.from_text(text(entry, "scene"), "a scene of the card")
        if not np.allclose(_pair(entry, "nodes"), scene.shape, rtol=1e-12, atol=0):
            raise ValueError(f"nodes are {entry['nodes']}, {scene.shape} in their scene")
        if not np.allclose(_pair(entry, "side"), scene.sides, rtol=1e-12, atol=0):
            raise ValueError(f"side is {entry['side']}, {scene.sides} in its scene")
        scenes.append(scene)
    if len(scenes) < 2 or card["databases"][0]["scene"] != first:
        raise ValueError("databases are fewer than two, or the first is not that of the scene")
    return scenes


def _check_growth(record: Any) -> None:
    """Refuse the record of a growth that lacks a number; most surrogates have none."""
    if record is None:
        return
    positive(record, "mark")
    count(record, "rows")
    if record.get("met") not in (True, False):
        raise ValueError(f"met is {record.get('met')!r}")
    for name in ("errors", "bounds"):
        for target in mapping(record, name):
            _any_number(record[name], target)


def _check_scene(card: Part, scene: Scene) -> None:
    """Refuse a card whose nodes, side, spacing, modulus or boundary are not those of its scene."""
    own = {"nodes": scene.shape, "side": scene.sides, "spacing": scene.spacing}
    for name, wanted in own.items():
        if not np.allclose(_pair(card, name), wanted, rtol=1e-12, atol=0):
            raise ValueError(f"{name} is {card[name]}, {wanted} in the scene")
    if not np.isclose(positive(card, "modulus"), modulus(scene), rtol=1e-12, atol=0):
        raise ValueError(f"modulus is {card['modulus']}, {modulus(scene)} in the scene")
    given, boundary = card.get("boundary"), scene.contact.boundary
    if given != (None if boundary == "free" else boundary):
        raise ValueError(f"boundary is {given}, {boundary} in the scene")


def _pair(card: Part, name: str) -> tuple[float, float]:
    """Return a pair of numbers above 0."""
    first, second = (positive({name: each}, name) for each in sequence(card, name, 2))
    return first, second


def _check_targets(targets: Part, known: Mapping[str, Column], databases: int) -> None:
    """Refuse targets that the scene's database does not have, or that are incomplete."""
    if not targets:
        raise ValueError("there is no target")
    for name in targets:
        _check_target(name, mapping(targets, name), known)
        if databases > 1:
            for entry in sequence(targets[name], "databases", databases):
                count(entry, "rows")
                _any_number(entry, "nmae")
                _any_number({"mae": 0.0, **entry}, "mae")
                _any_number(entry, "coverage")


def _check_target(name: str, target: Part, known: Mapping[str, Column]) -> None:
    column = known.get(TARGETS.get(name, name))
    if column is None or (target.get("column"), target.get("unit")) != (column.name, column.unit):
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


def _check_hardness(card: Part, scenes: Sequence[Scene]) -> None:
    """Refuse a card whose hardness over E* is not that of its scenes."""
    wanted = limits_of(scenes)
    if card.get("elastic", False) is not (
        len({scene.contact.hardness_limits is None for scene in scenes}) > 1
    ):
        raise ValueError("elastic is not what the scenes say")
    if wanted is None:
        if "hardness_ratio" in card:
            raise ValueError("hardness_ratio is given, the scene has no hardness")
        return
    low, high = (positive({"ends": end}, "ends") for end in sequence(card, "hardness_ratio", 2))
    if not np.allclose((low, high), wanted, rtol=1e-12, atol=0):
        raise ValueError(f"hardness_ratio is {low} to {high}, another in the scene")


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
    rows, scheme = card["rows"], card.get("calibration", {}).get("scheme", "ranges")
    for name, each in learnt.items():
        scored = sum(scores.size for scores in each.calibration.scores)
        ranges = each.calibration.borders.size + 1
        if (scored, ranges) != (rows["calibration"], card["targets"][name]["ranges_of_prediction"]):
            raise ValueError(f"{name} has intervals from {scored} rows in {ranges} ranges")
        groups = len(each.calibration.scores)
        if each.calibration.scheme != scheme or (
            scheme == "others" and groups != card["calibration"]["groups"]
        ):
            raise ValueError(f"{name} has intervals that are not calibrated as the card says")
        estimator = each.pipeline.named_steps[STEP]
        kept = getattr(estimator, "X_fit_", getattr(estimator, "X_train_", None))
        if kept is not None and len(kept) != rows["train"]:
            raise ValueError(f"{name} has a model of {len(kept)} rows")
        if len(getattr(estimator, "support_", ())) > rows["train"]:
            raise ValueError(f"{name} has more support vectors than rows")
        if each.root and not (card.get("roots") and each.column in ROOTED_TARGETS):
            raise ValueError(f"{name} is learnt as a square root")
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
