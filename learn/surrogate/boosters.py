"""XGBoost's trees as arrays, and back.

XGBoost's compiled reader trusts its files: three changed bytes end the process. A surrogate's file
therefore holds trees (`learn.surrogate.forest`) and one number instead of XGBoost's format. They
are written into an empty model of the installed version, so that XGBoost reads only text made here.
"""

import json
from typing import Any

import numpy as np

from learn.models import MODELS
from learn.surrogate import forest
from learn.surrogate.forest import LEAF, Tree
from learn.surrogate.parts import Part, number

SINGLE = "f4"
"""XGBoost computes in single precision."""

NO_PARENT = 2**31 - 1
"""XGBoost's number for the missing parent of a tree's root."""


def to_arrays(estimator: Any) -> dict[str, Any]:
    """Return trees and base score of a fitted XGBRegressor.

    Raises
    ------
    ValueError
        If it is not boosting of plain trees for squared errors.
    """
    learner = json.loads(bytes(estimator.get_booster().save_raw("json")))["learner"]
    booster = learner["gradient_booster"]
    plain = booster["name"] == "gbtree" and learner["objective"]["name"] == "reg:squarederror"
    trees = booster["model"]["trees"] if plain else []
    if not trees or any(any(tree["split_type"]) for tree in trees):
        raise ValueError("the model is none of plain trees for squared errors")
    base = np.array(learner["learner_model_param"]["base_score"].strip("[]"), dtype=SINGLE)
    return {
        "base": float(base),
        "trees": forest.packed((_tree(tree) for tree in trees), SINGLE),
    }


def _tree(tree: dict[str, Any]) -> Tree:
    """Return a tree without the nodes that pruning has cut off, numbered level by level."""
    left, right = tree["left_children"], tree["right_children"]
    order = [0]
    for node in order:  # which grows
        if left[node] != LEAF:
            order += [left[node], right[node]]
    new = np.full(len(left) + 1, LEAF, dtype="i4")  # the last stands for no child at all
    new[order] = np.arange(len(order))
    return Tree(
        new[np.array(left)[order]],
        new[np.array(right)[order]],
        np.where(np.array(left)[order] == LEAF, 0, np.array(tree["split_indices"])[order]),
        np.array(tree["split_conditions"], dtype=SINGLE)[order],
    )


def from_arrays(part: Part, width: int) -> Any:
    """Return a fitted XGBRegressor.

    Parameters
    ----------
    part : mapping
        Part of a file: from `to_arrays`, or forged.
    width : int
        Number of features.

    Raises
    ------
    ValueError
        If an array is no tree, or a number is not finite in single precision.
    """
    estimator = MODELS["xgboost"].estimator(0).set_params(n_estimators=1, max_depth=1)
    estimator.fit(np.zeros((2, width)), np.zeros(2))
    model = json.loads(bytes(estimator.get_booster().save_raw("json")))
    learner = model["learner"]
    largest = float(np.finfo(SINGLE).max)
    base = np.float32(number(part, "base", -largest, largest))
    before = learner["learner_model_param"]["base_score"]
    learner["learner_model_param"]["base_score"] = f"[{base}]" if "[" in before else str(base)
    boosted = learner["gradient_booster"]["model"]
    (pattern,) = boosted["trees"]
    trees = forest.unpacked(part.get("trees", {}), SINGLE, width)
    boosted["trees"] = [_written(pattern, tree, place) for place, tree in enumerate(trees)]
    total = len(boosted["trees"])
    boosted["gbtree_model_param"]["num_trees"] = str(total)
    boosted["tree_info"] = [0] * total
    if "iteration_indptr" in boosted:
        boosted["iteration_indptr"] = list(range(total + 1))
    estimator.load_model(bytearray(json.dumps(model).encode()))
    return estimator


def _written(pattern: dict[str, Any], tree: Tree, place: int) -> dict[str, Any]:
    """Return a tree in XGBoost's format; entries about the history of its fit are zero."""
    size = tree.left.size
    if ((tree.left != LEAF) & (tree.right != tree.left + 1)).any():  # XGBoost looks there
        raise ValueError("a right child does not follow the left one")
    split = np.flatnonzero(tree.left != LEAF)
    parents = np.full(size, NO_PARENT, dtype=np.int64)
    parents[tree.left[split]] = parents[tree.right[split]] = split
    nothing = {
        name: [type(values[0])(0)] * size if values else []
        for name, values in pattern.items()
        if isinstance(values, list)
    }
    return {
        **nothing,
        "id": place,
        "left_children": tree.left.tolist(),
        "right_children": tree.right.tolist(),
        "parents": parents.tolist(),
        "split_indices": tree.feature.tolist(),
        "split_conditions": [float(str(each)) for each in tree.number],
        "tree_param": {**pattern["tree_param"], "num_nodes": str(size), "num_deleted": "0"},
    }
