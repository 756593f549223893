"""Calibration of intervals by groups of rows: maps, or databases where rows come from no maps.

Rows of one map are more alike than rows of different maps. Intervals that are calibrated on other
rows of the same maps hold for these maps only. What a new map is like, only whole maps tell that a
model has not seen: each is left out in turn, and its errors are those of a model of the others.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from learn.arrays import Indices, Values
from learn.dataset import Dataset
from learn.split import FOLDS
from learn.surrogate.calibration_text import FEWEST
from learn.surrogate.conformal import Calibration, Scheme
from learn.surrogate.distance import Distance, from_groups, from_rows, squares_from
from learn.surrogate.error_growth import Growth
from learn.surrogate.error_scale import fit_scale

MOST_FITS = 20
"""Largest number of fits that leave groups out; several groups then go together."""

MOST_UNSEEN = 0.6
"""Largest share of the rows that a model may lack that predicts a part of them."""

SMALLEST = 20
"""Smallest number of rows of a group where intervals hold for each group. Smaller groups are
joined, since their intervals of 95 % would have no end.
"""


class Groups(NamedTuple):
    """The groups of some rows.

    Attributes
    ----------
    labels : ndarray of int, shape (n,)
        Group of each row, from 0 on.
    number : int
        Number of groups.
    kind : str
        "map" or "database".
    scheme : {"others", "each"}
        Whether there are enough of them for intervals that hold for others.
    """

    labels: Indices
    number: int
    kind: str
    scheme: Scheme


def groups_of(rows: Dataset) -> Groups | None:
    """Return the groups that calibrate intervals; None if all rows are of one.

    Windows of one map are of one group, whichever databases they are in. Databases that share
    surfaces cannot be left out whole, if hardly a row is left to train on.
    """
    keys = [each.map or each.database for each in rows.populations]
    number_of = {key: number for number, key in enumerate(dict.fromkeys(keys))}
    known = np.array([number_of[key] for key in keys], dtype=np.int64)
    if known.size < 2 or not rows.size:
        return None
    used, labels = np.unique(known[rows.population], return_inverse=True)
    if used.size < 2:
        return None
    kind = "map" if all(each.map for each in rows.populations) else "database"
    schemes: tuple[Scheme, ...] = ("others", "each") if used.size >= FEWEST else ("each",)
    for scheme in schemes:
        groups = Groups(labels, used.size, kind, scheme)
        unseen = [each.size for _, each in holdouts(rows, left_out(rows, groups))]
        if max(unseen) <= MOST_UNSEEN * rows.size:
            return groups
    return None


def near_labels(rows: Dataset) -> Indices:
    """Return the groups whose nearest one distances are measured from, (n,); 0 for a single one.

    Where there are enough groups for intervals that hold for others, they are one population.
    """
    groups = groups_of(rows)
    if groups is None or groups.scheme == "others":
        return np.zeros(rows.size, dtype=np.int64)
    return groups.labels


def near(rows: Dataset) -> Distance:
    """Measure distances from training rows, with a limit that most of them keep."""
    groups = groups_of(rows)
    if groups is None or groups.scheme == "others":
        return from_rows(rows.inputs)
    return from_groups(rows.inputs, groups.labels, left_out(rows, groups))


def left_out(rows: Dataset, groups: Groups) -> Indices:
    """Number the parts of the rows that are left out together, (n,).

    Whole groups where intervals shall hold for others, else a fifth of the surfaces or tiles.
    """
    if groups.scheme == "others":
        return _dealt(groups.labels, min(groups.number, MOST_FITS))
    return _dealt(rows.groups, FOLDS)


def _dealt(labels: Indices, parts: int) -> Indices:
    """Deal labels into parts at random; each part gets about as many labels."""
    values, place = np.unique(labels, return_inverse=True)
    return np.asarray(np.random.default_rng(0).permutation(values.size)[place] % parts)


def holdouts(rows: Dataset, parts: Indices) -> Iterator[tuple[Indices, Indices]]:
    """Yield the rows of each part, and the rows that a model must not see that predicts them.

    The latter are those of the part, and those that share a surface or tile with one of them.

    Parameters
    ----------
    rows : Dataset
        n rows.
    parts : ndarray of int, shape (n,)
        From `left_out`.
    """
    for part in np.unique(parts):
        mine = np.flatnonzero(parts == part)
        yield mine, np.flatnonzero(np.isin(rows.groups, rows.groups[mine]))


def holdout_squares(rows: Dataset, parts: Sequence[tuple[Indices, Indices]]) -> Values:
    """Return the squared distance of each training row from those that its model has seen, (n,).

    Parameters
    ----------
    rows : Dataset
        n training rows.
    parts : sequence of pairs of ndarray of int
        From `holdouts`.
    """
    labels, found = near_labels(rows), np.empty(rows.size)
    for mine, unseen in parts:
        found[mine] = squares_from(rows.inputs, labels, unseen, mine)
    return found


def calibrate_by_groups(
    rows: Dataset,
    predicted: Values,
    groups: Groups,
    parts: Indices,
    *,
    root: bool,
    growth: Growth | None = None,
    squares: Values | None = None,
) -> Calibration:
    """Calibrate intervals with predictions by models that have not seen these rows.

    Errors are divided by their usual size, which is fitted without the part that a row is in.

    Parameters
    ----------
    rows : Dataset
        n rows.
    predicted : ndarray, shape (n,)
        Their predictions by models that have not seen their part.
    groups : Groups
        Their groups.
    parts : ndarray of int, shape (n,)
        From `left_out`.
    root : bool
        True for errors of the square root.
    growth : Growth, optional
        Growth of the errors with the distance, where it is known.
    squares : ndarray, shape (n,), optional
        Squared distances from the rows that these models were fitted to, for the growth.
    """
    inputs, labels = rows.inputs, groups.labels
    change = np.sqrt if root else np.asarray
    errors = np.abs(change(predicted) - change(rows.target))
    if growth is not None and squares is not None:
        errors /= growth.of_squares(squares)
    usual = np.empty(errors.size)
    for part in np.unique(parts):
        own = parts == part
        usual[own] = fit_scale(inputs[~own], errors[~own], labels[~own]).at(inputs[own])
    if groups.scheme == "each":
        labels = _large(labels)
    scores = tuple(np.sort((errors / usual)[labels == each]) for each in np.unique(labels))
    scale = fit_scale(inputs, errors, groups.labels)
    return Calibration(np.empty(0), scores, root, groups.scheme, scale, growth)


def _large(labels: Indices) -> Indices:
    """Join the smallest groups until all have `SMALLEST` rows, or one is left."""
    labels = labels.copy()
    while True:
        values, sizes = np.unique(labels, return_counts=True)
        order = np.argsort(sizes, kind="stable")
        if values.size < 2 or sizes[order[0]] >= SMALLEST:
            return labels
        labels[labels == values[order[0]]] = values[order[1]]
