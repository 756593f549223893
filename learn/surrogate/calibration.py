"""The rows that calibrate intervals: held-out rows, the training rows by group, or a database's.

Rows of one map are more alike than rows of different maps, and rows of one database where they come
from no maps. Intervals that are calibrated on other rows of the same groups hold for these groups
only. What a new one is like, only whole groups tell that a model has not seen: each is left out in
turn, and its errors are those of a model of the others.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from gen.arrays import Indices, Values
from gen.runtime.errors import InputError
from learn.dataset import Dataset
from learn.features.scene import SCENE
from learn.split import FOLDS
from learn.surrogate import flag
from learn.surrogate.flag import Distance
from learn.surrogate.interval import Calibration, Growth, Scheme, fit_scale, quadratic

FEWEST = 9
"""Smallest number of groups whose intervals of 90 % hold for other groups too."""

SURFACE = "surface"
"""Kind of the groups of a scene's own features, of which surfaces of one population differ."""

SLIGHT = 1e-3
"""Weight of the penalty on the slopes of usual errors between surfaces."""

MOST_FITS = 20
"""Largest number of fits that leave groups out; several groups then go together."""

MOST_UNSEEN = 0.6
"""Largest share of the rows that a model may lack that predicts a part of them."""

SMALLEST = 20
"""Smallest number of rows of a group where intervals hold for each group. Smaller groups are
joined, since their intervals of 95 % would have no end.
"""

CALIBRATION_SHARE = 0.1
"""Share of the training rows that are used to calibrate the intervals instead."""

SMALLEST_CALIBRATION = 20
"""Smallest number of calibration rows, for intervals of 95 %, if there are five times as many."""

CLUSTERS = 10
"""Number of clusters of surfaces. Fewer and larger ones reach beyond the limit of the flag, where
no row counts; many and small ones lie in the midst of the others."""

FEWEST_SURFACES = 200
"""Smallest number of surfaces, or tiles, of a training that is cut into clusters."""


class Groups(NamedTuple):
    """The groups of some rows."""

    labels: Indices  # (n,), group of each row, from 0 on
    number: int  # of groups
    kind: str  # "map", "database", or `SURFACE`
    scheme: Scheme  # "others" if there are enough for intervals that hold for others, else "each"

    def left_out(self, rows: Dataset) -> Indices:
        """Number the parts of the rows that are left out together, (n,).

        Whole groups where intervals shall hold for others, else a fifth of the surfaces or tiles.
        """
        if self.scheme == "others":
            return _dealt(self.labels, min(self.number, MOST_FITS))
        return _dealt(rows.groups, FOLDS)


def _dealt(labels: Indices, parts: int) -> Indices:
    """Deal labels into parts at random; each part gets about as many labels."""
    values, place = np.unique(labels, return_inverse=True)
    return np.asarray(np.random.default_rng(0).permutation(values.size)[place] % parts)


def groups_of(rows: Dataset) -> Groups | None:
    """Return the groups that calibrate intervals; None if all rows are of one.

    Windows of one map are of one group, whichever databases they are in. Databases that share
    surfaces cannot be left out whole, if hardly a row is left to train on.
    """
    keys = [each.map or each.database for each in rows.populations]
    number_of = {key: number for number, key in enumerate(dict.fromkeys(keys))}
    known = np.array([number_of[key] for key in keys], dtype=np.int64)
    if rows.features.name == SCENE and not all(each.map for each in rows.populations):
        surfaces, labels = np.unique(rows.groups, return_inverse=True)
        return Groups(labels, surfaces.size, SURFACE, "others") if surfaces.size >= FEWEST else None
    if known.size < 2 or not rows.size:
        return None
    used, labels = np.unique(known[rows.population], return_inverse=True)
    if used.size < 2:
        return None
    kind = "map" if all(each.map for each in rows.populations) else "database"
    schemes: tuple[Scheme, ...] = ("others", "each") if used.size >= FEWEST else ("each",)
    for scheme in schemes:
        groups = Groups(labels, used.size, kind, scheme)
        unseen = [each.size for _, each in holdouts(rows, groups.left_out(rows))]
        if max(unseen) <= MOST_UNSEEN * rows.size:
            return groups
    return None


def holdouts(rows: Dataset, parts: Indices) -> Iterator[tuple[Indices, Indices]]:
    """Yield the rows of each part, and the rows that a model must not see that predicts them.

    The latter share a surface or tile with one of the part. Parts, (n,), come from
    `Groups.left_out` or `clusters_of`.
    """
    for part in np.unique(parts):
        mine = np.flatnonzero(parts == part)
        yield mine, np.flatnonzero(np.isin(rows.groups, rows.groups[mine]))


def clusters_of(rows: Dataset) -> Indices | None:
    """Return the cluster of each row, (n,), by k-means; None if there are too few surfaces.

    Rows of one surface, or tile, are of one cluster: that of their mean features.
    """
    _, place, sizes = np.unique(rows.groups, return_inverse=True, return_counts=True)
    if sizes.size < FEWEST_SURFACES:
        return None
    from sklearn.cluster import KMeans

    deviation = rows.inputs.std(axis=0)
    scaled = (rows.inputs - rows.inputs.mean(axis=0)) / np.where(deviation > 0, deviation, 1.0)
    means = np.zeros((sizes.size, scaled.shape[1]))
    np.add.at(means, place, scaled)
    found = KMeans(CLUSTERS, n_init=3, random_state=0).fit_predict(means / sizes[:, None])
    return np.asarray(found[place], dtype=np.int64)


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
        return flag.from_rows(rows.inputs)
    return flag.from_groups(rows.inputs, groups.labels, groups.left_out(rows))


def holdout_squares(rows: Dataset, parts: Sequence[tuple[Indices, Indices]]) -> Values:
    """Return squared distances of n training rows from those that their model has seen, (n,).

    The parts come from `holdouts`.
    """
    labels, found = near_labels(rows), np.empty(rows.size)
    for mine, unseen in parts:
        found[mine] = flag.squares_from(rows.inputs, labels, unseen, mine)
    return found


def calibrate_by_groups(
    rows: Dataset,
    errors: Values,
    groups: Groups,
    *,
    root: bool,
    growth: Growth | None = None,
    squares: Values | None = None,
) -> Calibration:
    """Calibrate intervals with the errors, (n,), of models that have not seen these n rows.

    The errors are those of the target over its scale, or of its `root`. They are divided by their
    growth with the squared distance, (n,), from the rows that these models were fitted to, where it
    is known, and by their usual size, which is fitted without the part that a row is in.
    """
    inputs, labels, parts = rows.inputs, groups.labels, groups.left_out(rows)
    by_surface = groups.kind == SURFACE  # of which there are many, and few features
    terms = quadratic(inputs) if by_surface else inputs
    fit = partial(fit_scale, shrinkage=SLIGHT) if by_surface else fit_scale
    if growth is not None and squares is not None:
        errors = errors / growth.of_squares(squares)
    usual = np.empty(errors.size)
    for part in np.unique(parts):
        own = parts == part
        usual[own] = fit(terms[~own], errors[~own], labels[~own]).at(inputs[own])
    if groups.scheme == "each":
        labels = _large(labels)
    scores = tuple(np.sort((errors / usual)[labels == each]) for each in np.unique(labels))
    scale = fit(terms, errors, groups.labels)
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


@dataclass(frozen=True, eq=False)
class Plan:
    """Which rows train, and which calibrate."""

    train: Indices  # positions of the rows that train
    holdout: Indices  # of those that calibrate: the training rows themselves by groups, or others
    groups: Groups | None  # of the rows that calibrate; None if they are of one
    others: list[Dataset] | None = None  # rows of another database that calibrate, by target

    @property
    def size(self) -> int:
        """Number of rows that calibrate."""
        return self.holdout.size if self.others is None else self.others[0].size

    def rows(self, rows: Dataset, target: int) -> Dataset | None:
        """Return the rows that calibrate a target; None for the training rows by their groups."""
        if self.others is not None:
            return self.others[target]
        return None if self.groups is not None else rows.at(self.holdout)

    def entry(self) -> dict[str, Any]:
        """Return the card's entry "calibration"; nothing for held-out rows of one group."""
        groups, others = self.groups, self.others
        if others is None and groups is None:
            return {}
        scheme, kind, number = (
            ("ranges", "database", 1)
            if groups is None
            else (groups.scheme, groups.kind, groups.number)
        )
        origin = None if others is None else others[0].origins[-1]
        database, sha256 = ("", "") if origin is None else (origin.database, origin.sha256)
        entry = {"scheme": scheme, "kind": kind, "groups": number}
        return {"calibration": entry | {"database": database, "sha256": sha256}}

    def distance(self, rows: Dataset) -> Distance:
        """Return distances from the training, with the limit of its groups or of its rows."""
        inputs = rows.inputs[self.train]
        if rows.features.name == SCENE:  # drawn independently of each other: ranges say all
            return flag.nowhere(inputs.shape[1])
        if self.groups is None or self.groups.scheme != "others":
            return near(rows.at(self.train))
        if self.others is None:
            return flag.from_training(inputs, self.groups.labels)
        return flag.from_others(inputs, self.others[0].inputs, self.groups.labels)

    def remark(self) -> str:
        """Name the groups by which the training rows calibrate; "" if they do not."""
        if self.groups is None or self.others is not None:
            return ""
        groups = self.groups
        whole = groups.scheme == "others"
        how = "each predicted without it" if whole else "by rows that the model has not seen"
        return f"intervals by {groups.number} {groups.kind}s, {how}"


def planned(rows: Dataset, train: Indices, others: list[Dataset] | None = None) -> Plan:
    """Decide which of the training rows, in random order, train, and which calibrate.

    `others` are rows of another database that calibrate, for each target. InputError is raised if
    too few rows are left to train on.
    """
    if others is not None:
        return Plan(train, np.empty(0, dtype=np.int64), groups_of(others[0]), others)
    groups = groups_of(rows.at(train))
    if groups is not None:
        return Plan(train, train, groups)
    return Plan(*without_calibration(rows, train), None)


def without_calibration(rows: Dataset, train: Indices) -> tuple[Indices, Indices]:
    """Split the last rows, by whole groups, off the training rows, which are in random order.

    The positions of both are returned. InputError is raised if too few rows are left to train on.
    """
    wanted = max(int(CALIBRATION_SHARE * train.size), min(SMALLEST_CALIBRATION, train.size // 5))
    groups = rows.groups[train]
    starts = np.flatnonzero(np.diff(groups, prepend=-1))
    if starts.size == 1:  # all rows share one surface
        starts = np.arange(train.size)
    before = int(np.searchsorted(starts, train.size - wanted, side="right")) - 1
    cut = int(starts[max(before, 1)])
    inside = train[:cut]
    if inside.size < 2 or np.ptp(rows.target[inside]) == 0:
        raise InputError(
            f"{rows.name}: {inside.size} rows of {starts.size}"
            f" {'tiles' if rows.by_tile else 'surfaces'} are left to train on: more are needed"
        )
    return inside, train[cut:]


def of_another(sets: list[Dataset], together: list[Dataset]) -> list[Dataset]:
    """Return the rows of another database that calibrate, for each target.

    It is the last of those in `together`; rows of surfaces, or tiles, that the training in `sets`
    has too are left out. InputError is raised if it has other features, or too few rows of its own.
    """
    first, whole = sets[0], together[0]
    path = whole.origins[-1].database
    if first.features.columns != whole.features.columns:
        differing = sorted(set(first.features.columns) ^ set(whole.features.columns))
        raise InputError(
            f"--calibrate-on {path}: has another grid or hardness than the training: there"
            f" {', '.join(differing)} would be a feature"
        )
    own = []
    for rows in together:
        last = rows.database == len(rows.origins) - 1
        shared = np.isin(rows.groups, rows.groups[~last])
        own.append(rows.at(np.flatnonzero(last & ~shared)))
    if own[0].size < SMALLEST_CALIBRATION:
        raise InputError(
            f"--calibrate-on {path}: {own[0].size} usable rows of surfaces that are not in the"
            f" training, {SMALLEST_CALIBRATION} at least are needed"
        )
    return own
