"""Which rows calibrate intervals: those of the training, by models that have not seen them.

Surfaces are left out in turn, a fifth of them at a time, and predicted by a model of the others.
Rows of one map are more alike than rows of different maps, and rows of one database where they come
from no maps. What a new map is like, only whole maps tell that a model has not seen: where there
are enough, each is left out as a whole.
"""

from collections.abc import Iterator
from functools import partial
from typing import Any, Literal, NamedTuple

import numpy as np

from gen.arrays import Indices, Values
from gen.runtime.errors import InputError
from learn.database_rows import Dataset
from learn.models import POPULATION
from learn.split import FOLDS, dealt
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

# what intervals hold for: further surfaces of the one database; of each of the known maps or
# databases; or of other maps too
Scheme = Literal["surfaces", "each", "others"]

FEWEST = (
    9  # smallest number of maps or databases whose intervals of 90 % hold for others too
)
SURFACE = (
    "surface"  # kind of a scene's own groups, of which surfaces of one population differ
)
SLIGHT = 1e-3  # weight of the penalty on the slopes of usual errors between surfaces
MOST_FITS = (
    20  # largest number of fits that leave groups out; several groups then go together
)
MOST_UNSEEN = (
    0.6  # largest share of the rows that a model may lack that predicts a part of them
)
# rows nearest to a map or database from which on it has scores of its own; else those of all count
SMALLEST = 20
# surfaces of a database or map that suffice where each part takes a further fit: the share of rows
# inside intervals of 90 % then deviates by 1.5 %
ENOUGH = 400
# models of which one fit tells the errors at rows that are left out
CLOSED = ("kernel-ridge", "gaussian-process", POPULATION.name)
SMALLEST_CALIBRATION = 20  # smallest number of rows of another database that calibrate


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
        labels, parts = rows.surfaces, FOLDS
        if self.scheme == "others":
            labels, parts = self.labels, min(self.number, MOST_FITS)
        return dealt(labels, parts, np.random.default_rng(0))


def groups_of(rows: Dataset) -> Groups:
    """Return the maps or databases that calibrate intervals.

    Windows of one map are of one group, whichever databases they are in. Databases that share
    surfaces cannot be left out whole, if hardly a row is left to train on.
    """
    surfaces, own = np.unique(rows.groups, return_inverse=True)
    unit = "tile" if rows.by_tile else SURFACE if surfaces.size > 1 else "row"
    number = surfaces.size if surfaces.size > 1 else rows.size
    alone = Groups(np.zeros(rows.size, dtype=np.int64), number, unit, "surfaces")
    if rows.features.of_scene and not rows.by_tile:
        enough = surfaces.size >= FEWEST
        return Groups(own, surfaces.size, SURFACE, "others") if enough else alone
    used, labels = np.unique(rows.population, return_inverse=True)
    if used.size < 2 or surfaces.size < 2:
        return alone
    schemes: tuple[Scheme, ...] = ("others", "each") if used.size >= FEWEST else ("each",)
    for scheme in schemes:
        groups = Groups(labels, used.size, "map" if rows.by_tile else "database", scheme)
        unseen = [each.size for _, each in holdouts(rows, groups.left_out(rows))]
        if max(unseen) <= MOST_UNSEEN * rows.size:
            return groups
    return alone


def holdouts(rows: Dataset, parts: Indices) -> Iterator[tuple[Indices, Indices]]:
    """Yield the rows of each part, and the rows that a model must not see that predicts them.

    The latter share a surface or tile with one of the part. Parts, (n,), come from
    `Groups.left_out`.
    """
    for part in np.unique(parts):
        mine = np.flatnonzero(parts == part)
        yield mine, np.flatnonzero(np.isin(rows.surfaces, rows.surfaces[mine]))


Parts = list[tuple[Indices, Indices]]  # each by `holdouts`


class Measured(NamedTuple):
    """Distances from the training, and those of its rows from models that have not seen them."""

    distance: Distance
    far: Values  # (n,)
    nearest: Indices  # (n,), number of the nearest cloud


class Plan(NamedTuple):
    """Which rows calibrate, and what a card and the user are told of it."""

    parts: Parts  # of the training rows; none if another database's calibrate
    kept: Indices  # training rows that calibrate, those of the parts
    groups: Groups  # of the rows that calibrate
    seen: Measured  # their distances from the training
    distance: (
        Distance  # that of the surrogate, with the limit of the groups or of the training
    )
    entry: dict[str, Any]  # "calibration" of the card
    remark: (
        str  # maps or databases by which the training rows calibrate; "" if there is one
    )


def planned(model: str, train: Dataset, other: Dataset | None) -> Plan:
    """Say which rows calibrate the intervals of training rows: their own, or another database's.

    For models in `CLOSED` every part of the training rows does. For others as many do as have
    `ENOUGH` surfaces, or all that there are, also of whole groups.
    """
    own, size, parts = (
        groups_of(train),
        train.inputs.shape[1],
        list[tuple[Indices, Indices]](),
    )
    kept, remark, database, sha256 = np.arange(0), "", "", ""
    if train.features.of_scene:  # drawn independently of each other: ranges say all
        distance = Distance(np.zeros((1, size)), np.zeros((1, size, size)), np.inf)
        seen = Measured(distance, *distance.measured(train.inputs))
    elif own.scheme == "others":
        distance = from_maps(train.inputs, own.labels)
        seen = Measured(distance, *distance.measured(train.inputs))
    else:
        seen = Measured(*from_surfaces(train.inputs, own.labels, own.left_out(train)))
    if other is not None:
        groups, (database, sha256, *_) = groups_of(other), other.origins[-1]
        distance, whole = seen.distance, groups.scheme == "others"
        seen = Measured(distance, *distance.measured(other.inputs))
        if whole and not train.features.of_scene:
            distance = from_maps(train.inputs, groups.labels, other.inputs)
    else:
        groups, distance = own, seen.distance
        parts, whole = (
            list(holdouts(train, groups.left_out(train))),
            groups.scheme == "others",
        )
        several = groups.kind in {"map", "database"}
        if not (model in CLOSED or (several and whole)):
            enough, told = ENOUGH * (groups.number if several else 1), set[int]()
            whole_parts, parts = parts, []
            while len(told) < enough and len(parts) < len(whole_parts):
                parts.append(whole_parts[len(parts)])
                told.update(train.surfaces[parts[-1][0]].tolist())
            groups = groups if several else groups._replace(number=len(told))
        kept = np.sort(np.concatenate([mine for mine, _ in parts]))
        groups = groups._replace(labels=groups.labels[kept])
        seen = Measured(distance, seen.far[kept], seen.nearest[kept])
        if groups.scheme != "surfaces":
            how = (
                "each predicted without it"
                if whole
                else "by surfaces that the model has not seen"
            )
            remark = f"intervals by {groups.number} {groups.kind}s, {how}"
    entry = {"scheme": groups.scheme, "kind": groups.kind, "groups": groups.number}
    entry |= {"database": database, "sha256": sha256}
    return Plan(parts, kept, groups, seen, distance, entry, remark)


def calibrate(rows: Dataset, plan: Plan, raw: Values, *, root: bool) -> Calibration:
    """Calibrate intervals with the predictions, (n,), of models that have not seen these n rows.

    They are over the target's scale, and their errors those of it, or of its `root`. Errors are
    divided by their growth with the distance from what these models have seen, unless intervals
    hold for other maps, and by their usual size, which is fitted without the part that a row is in.
    """
    groups, seen, truth = plan.groups, plan.seen, rows.target
    raw, truth = (np.sqrt(np.maximum(each, 0)) if root else each for each in (raw, truth))
    inputs, labels, parts = rows.inputs, groups.labels, groups.left_out(rows)
    by_surface = (
        groups.kind == SURFACE and groups.scheme == "others"
    )  # many, of few features
    terms, errors = quadratic(inputs) if by_surface else inputs, np.abs(raw - truth)
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
    scores = []
    for cloud in range(len(seen.distance.centres)):
        near = seen.nearest == cloud
        near = near if near.sum() >= SMALLEST else np.ones(rows.size, dtype=np.bool_)
        scores.append(Scores.of(errors[near], rows.surfaces[near]))
    return Calibration(tuple(scores), scale, seen.distance, root)


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
