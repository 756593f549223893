"""Which rows calibrate intervals: those of the training, by models that have not seen them.

Surfaces are left out in turn, a fifth of them at a time, and predicted by a model of the others.
Where a part takes a further fit, and has surfaces enough, it is the only one.
Rows of one map are more alike than rows of different maps, and rows of one database where they come
from no maps. What a new map is like, only whole maps tell that a model has not seen: where there
are enough, each is left out as a whole.
"""

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any, Literal, NamedTuple

import numpy as np

from gen.arrays import Indices, Values
from gen.runtime.errors import InputError
from learn.dataset import Dataset
from learn.features.scene import SCENE
from learn.split import FOLDS
from learn.surrogate.interval import (
    GROWTH,
    Calibration,
    Distance,
    Scores,
    fit_scale,
    from_maps,
    from_surfaces,
    quadratic,
)

Scheme = Literal["surfaces", "each", "others"]
"""What intervals hold for: further surfaces of the one database; of each of the known maps or
databases; or of other maps too.
"""

FEWEST = 9
"""Smallest number of maps or databases whose intervals of 90 % hold for others too."""

SURFACE = "surface"
"""Kind of the groups of a scene's own features, of which surfaces of one population differ."""

SLIGHT = 1e-3
"""Weight of the penalty on the slopes of usual errors between surfaces."""

MOST_FITS = 20
"""Largest number of fits that leave groups out; several groups then go together."""

MOST_UNSEEN = 0.6
"""Largest share of the rows that a model may lack that predicts a part of them."""

SMALLEST = 20
"""Smallest number of rows that are nearest to a map or database with scores of their own. With
fewer, the scores of all rows count.
"""

ENOUGH = 400
"""Surfaces of a database or map that suffice where each part takes a further fit: the share of rows
inside intervals of 90 % then deviates by 1.5 %.
"""

SMALLEST_CALIBRATION = 20
"""Smallest number of rows of another database that calibrate."""


class Groups(NamedTuple):
    """The maps or databases of some rows."""

    labels: Indices  # (n,), map or database of each row, from 0 on
    number: int  # of these, or of the surfaces of one
    kind: str  # "map", "database"; of one `SURFACE`, "tile", or "row" if all share one surface
    scheme: Scheme

    def left_out(self, rows: Dataset) -> Indices:
        """Number the parts of the rows that are left out together, (n,).

        Whole groups where intervals shall hold for others, else a fifth of the surfaces or tiles,
        at random; each part gets about as many.
        """
        labels, parts = surfaces_of(rows), FOLDS
        if self.scheme == "others":
            labels, parts = self.labels, min(self.number, MOST_FITS)
        values, place = np.unique(labels, return_inverse=True)
        return np.asarray(np.random.default_rng(0).permutation(values.size)[place] % parts)


def surfaces_of(rows: Dataset) -> Indices:
    """Return the surface, or tile, of each row, (n,); the row itself where all are of one."""
    return rows.groups if np.ptp(rows.groups) else np.arange(rows.size)


def groups_of(rows: Dataset) -> Groups:
    """Return the maps or databases that calibrate intervals.

    Windows of one map are of one group, whichever databases they are in. Databases that share
    surfaces cannot be left out whole, if hardly a row is left to train on.
    """
    keys = [each.map or each.database for each in rows.populations]
    number_of = {key: number for number, key in enumerate(dict.fromkeys(keys))}
    known = np.array([number_of[key] for key in keys], dtype=np.int64)
    of_maps = all(each.map for each in rows.populations)
    surfaces, own = np.unique(rows.groups, return_inverse=True)
    unit = "tile" if rows.by_tile else SURFACE if surfaces.size > 1 else "row"
    number = surfaces.size if surfaces.size > 1 else rows.size
    alone = Groups(np.zeros(rows.size, dtype=np.int64), number, unit, "surfaces")
    if rows.features.name == SCENE and not of_maps:
        enough = surfaces.size >= FEWEST
        return Groups(own, surfaces.size, SURFACE, "others") if enough else alone
    if known.size < 2 or surfaces.size < 2:
        return alone
    used, labels = np.unique(known[rows.population], return_inverse=True)
    if used.size < 2:
        return alone
    schemes: tuple[Scheme, ...] = ("others", "each") if used.size >= FEWEST else ("each",)
    for scheme in schemes:
        groups = Groups(labels, used.size, "map" if of_maps else "database", scheme)
        unseen = [each.size for _, each in holdouts(rows, groups.left_out(rows))]
        if max(unseen) <= MOST_UNSEEN * rows.size:
            return groups
    return alone


def holdouts(rows: Dataset, parts: Indices) -> Iterator[tuple[Indices, Indices]]:
    """Yield the rows of each part, and the rows that a model must not see that predicts them.

    The latter share a surface or tile with one of the part. Parts, (n,), come from
    `Groups.left_out`.
    """
    surfaces = surfaces_of(rows)
    for part in np.unique(parts):
        mine = np.flatnonzero(parts == part)
        yield mine, np.flatnonzero(np.isin(surfaces, surfaces[mine]))


Parts = list[tuple[Indices, Indices]]
"""Rows that are predicted together, and those that the model must not see; see `holdouts`."""


class Measured(NamedTuple):
    """Distances from the training, and those of its rows from models that have not seen them."""

    distance: Distance
    far: Values  # (n,)
    nearest: Indices  # (n,), number of the nearest cloud


def measured(rows: Dataset) -> Measured:
    """Measure distances from training rows, with the limit of the flag."""
    groups, size = groups_of(rows), rows.inputs.shape[1]
    if rows.features.name == SCENE:  # drawn independently of each other: ranges say all
        nothing = np.zeros(rows.size)
        distance = Distance(np.zeros((1, size)), np.zeros((1, size, size)), np.inf)
        return Measured(distance, nothing, nothing.astype(np.int64))
    if groups.scheme == "others":
        distance = from_maps(rows.inputs, groups.labels)
        return Measured(distance, *distance.measured(rows.inputs))
    return Measured(*from_surfaces(rows.inputs, groups.labels, groups.left_out(rows)))


def calibrate(
    rows: Dataset, groups: Groups, errors: Values, seen: Measured, *, root: bool
) -> Calibration:
    """Calibrate intervals with the errors, (n,), of models that have not seen these n rows.

    The errors are those of the target over its scale, or of its `root`. They are divided by their
    growth with the distance from what these models have seen, unless intervals hold for other maps,
    and by their usual size, which is fitted without the part that a row is in.
    """
    inputs, labels, parts = rows.inputs, groups.labels, groups.left_out(rows)
    by_surface = groups.kind == SURFACE and groups.scheme == "others"  # many, of few features
    terms = quadratic(inputs) if by_surface else inputs
    fit = partial(fit_scale, shrinkage=SLIGHT) if by_surface else fit_scale
    if groups.scheme != "others":
        errors = errors / GROWTH.at(seen.far, seen.distance.limit)
    usual = np.empty(errors.size)
    for part in np.unique(parts):
        own = parts == part
        usual[own] = fit(terms[~own], errors[~own], labels[~own]).at(inputs[own])
    errors, scale = errors / usual, fit(terms, errors, labels)
    if groups.scheme == "others":
        return Calibration((Scores.of(errors, labels),), scale, None, root)
    surfaces, scores = surfaces_of(rows), []
    for cloud in range(len(seen.distance.centres)):
        near = seen.nearest == cloud
        near = near if near.sum() >= SMALLEST else np.ones(rows.size, dtype=np.bool_)
        scores.append(Scores.of(errors[near], surfaces[near]))
    return Calibration(tuple(scores), scale, seen.distance, root)


class Plan(NamedTuple):
    """Which rows calibrate, and what a card and the user are told of it."""

    groups: Groups  # of the rows that calibrate
    parts: Parts  # of the training rows; none if another database's calibrate
    size: int  # number of rows that calibrate
    entry: dict[str, Any]  # "calibration" of the card
    remark: str  # maps or databases by which the training rows calibrate; "" if there is one
    seen: Measured  # distances from the training
    distance: Distance  # that of the surrogate, with the limit of its groups or of its rows


def planned(train: Dataset, others: Sequence[Dataset] | None, *, every: bool) -> Plan:
    """Say which rows calibrate the intervals of training rows: their own, or another database's.

    `others` are these rows for each target. Unless `every` part of the training rows is wanted,
    they are as many as have `ENOUGH` surfaces, or all that there are, also of whole groups.
    """
    if others is None:
        groups, surfaces = groups_of(train), surfaces_of(train)
        parts = list(holdouts(train, groups.left_out(train)))
        several = groups.kind in {"map", "database"}
        if not (every or (several and groups.scheme == "others")):
            enough, told = ENOUGH * (groups.number if several else 1), set[int]()
            whole_parts, parts = parts, []
            while len(told) < enough and len(parts) < len(whole_parts):
                parts.append(whole_parts[len(parts)])
                told.update(surfaces[parts[-1][0]].tolist())
            groups = groups if several else groups._replace(number=len(told))
        size, database, sha256 = sum(mine.size for mine, _ in parts), "", ""
    else:
        groups, size, parts = groups_of(others[0]), others[0].size, []
        database, sha256 = others[0].origins[-1][:2]
    entry = {"scheme": groups.scheme, "kind": groups.kind, "groups": groups.number}
    whole, remark, seen = groups.scheme == "others", "", measured(train)
    if groups.scheme != "surfaces" and others is None:
        how = "each predicted without it" if whole else "by surfaces that the model has not seen"
        remark = f"intervals by {groups.number} {groups.kind}s, {how}"
    if whole and others is not None and train.features.name != SCENE:
        distance = from_maps(train.inputs, groups.labels, others[0].inputs)
    else:
        distance = seen.distance
    entry |= {"database": database, "sha256": sha256}
    return Plan(groups, parts, size, entry, remark, seen, distance)


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
