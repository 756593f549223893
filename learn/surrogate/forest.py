"""Binary trees as arrays, checked so that a walk from the root only meets nodes of its tree.

The arrays hold all trees of a model one after the other. A split sends a row to the left if its
feature is at most (scikit-learn) or below (XGBoost) the number of the split; the number of a leaf
is its prediction.
"""

from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from learn.arrays import Whole
from learn.surrogate.parts import Part, array, integers

LEAF = -1
"""Left and right child of a leaf."""

DEEPEST = 4096
"""Splits from a root to a leaf at most: more than any fit makes."""


class Tree(NamedTuple):
    """A tree of n nodes, the root first.

    Attributes
    ----------
    left, right : ndarray of int, shape (n,)
        Number of each node's children, larger than its own; `LEAF` for leaves.
    feature : ndarray of int, shape (n,)
        Index of the feature of a split, 0 for leaves.
    number : ndarray, shape (n,)
        Threshold of a split, or prediction of a leaf.
    depth : int
        Splits from the root to the deepest leaf.
    """

    left: Whole
    right: Whole
    feature: Whole
    number: NDArray[Any]
    depth: int = 0


def packed(trees: Iterable[Tree], kind: str) -> dict[str, Any]:
    """Concatenate the arrays of trees.

    Parameters
    ----------
    trees : iterable of Tree
        Trees of one model.
    kind : str
        Type of their numbers, f8 or f4.
    """
    every = list(trees)
    parts = {
        name: np.concatenate([getattr(tree, name) for tree in every]).astype("i4")
        for name in ("left", "right", "feature")
    }
    count = np.array([tree.left.size for tree in every], dtype="i4")
    return {
        "nodes": count,
        **parts,
        "number": np.concatenate([tree.number for tree in every]).astype(kind),
    }


def unpacked(part: Part, kind: str, width: int) -> Iterator[Tree]:
    """Return the trees of a file, after a check of all of them.

    Parameters
    ----------
    part : mapping
        Part of a file: from `packed`, or forged.
    kind : str
        See `packed`.
    width : int
        Number of features.

    Raises
    ------
    ValueError
        If an array is no tree: in a tree each node but the root is the child of one node before it,
        every feature exists, and every number is finite.
    """
    nodes = integers(part, "nodes", None)
    size = int(nodes.sum(dtype=np.int64))
    left, right, feature = (integers(part, name, size) for name in ("left", "right", "feature"))
    number = array(part, "number", kind, size)
    if not nodes.size or nodes.min() < 1:
        raise ValueError("there is a tree without nodes, or none at all")
    starts = np.cumsum(nodes, dtype=np.int64) - nodes
    owner = np.repeat(np.arange(nodes.size), nodes)
    split = np.flatnonzero(left != LEAF)
    if not np.array_equal(split, np.flatnonzero(right != LEAF)):
        raise ValueError("a node has one child")
    own, first = split - starts[owner[split]], starts[owner[split]]
    children = np.concatenate([left[split], right[split]]).astype(np.int64)
    if (children <= np.tile(own, 2)).any() or (children >= np.tile(nodes[owner[split]], 2)).any():
        raise ValueError("a node's child is none that follows it in its tree")
    wanted = np.ones(size, dtype=np.int64)
    wanted[starts] = 0
    if (np.bincount(children + np.tile(first, 2), minlength=size) != wanted).any():
        raise ValueError("a node is the child of several or of none")
    if ((feature < 0) | (feature >= width)).any():
        raise ValueError(f"a split asks for a feature that is none of {width}")
    depths = _depths(left, right, starts, owner)
    for place, start in enumerate(starts):
        inside = slice(start, start + nodes[place])
        own_nodes = left[inside], right[inside], feature[inside], number[inside]
        yield Tree(*own_nodes, int(depths[place]))


def _depths(
    left: Whole, right: Whole, starts: NDArray[np.int64], owner: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Compute the depth of every tree, level by level."""
    depths = np.zeros(starts.size, dtype=np.int64)
    level = starts
    for depth in range(1, DEEPEST + 2):
        level = level[left[level] != LEAF]
        if not level.size:
            return depths
        depths[owner[level]] = depth
        first = starts[owner[level]]
        level = np.concatenate([left[level] + first, right[level] + first])
    raise ValueError(f"a tree is deeper than {DEEPEST} splits")
