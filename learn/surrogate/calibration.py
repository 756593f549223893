"""Which rows calibrate intervals: training rows, by models that have not seen them.

Surfaces are left out in turn, a fifth of them at a time, and predicted by a model of the others.
Rows of one map are more alike than rows of different maps. So are rows of one database, where they
come from no maps. Only maps or databases that a model has not seen show how it predicts a new one:
where there are enough of them, each is left out as a whole.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Indices, Values
from gen.runtime.errors import InputError
from learn.database_rows import Dataset
from learn.models import POPULATION
from learn.split import FOLDS, dealt
from learn.surrogate.interval import (
    GROWTH,
    SHRINKAGE,
    Calibration,
    Distance,
    ErrorScale,
    MeasuredRows,
    Nearest,
    Scores,
    fit_scale,
    from_maps,
    from_surfaces,
    from_training,
    quadratic,
)

# What intervals hold for: further surfaces of the one database ("surfaces"), further surfaces of
# each of the known maps or databases ("each"), or other maps or databases ("others").
Scheme = Literal["surfaces", "each", "others"]

# smallest number of maps or databases whose intervals of 90 % hold for other ones too
FEWEST = 9
# kind of the groups of a scene's own features, where each surface is a group
SURFACE = "surface"
# weight of the penalty on the slopes of usual errors where each surface is a group
SLIGHT = 1e-3
# largest number of fits that leave groups out; with more groups, several are left out together
MOST_FITS = 20
# largest share of the rows that a model may lack which predicts a part of them
MOST_UNSEEN = 0.6
# smallest number of rows nearest to a map or database that give it scores of its own; with fewer,
# it has the scores of all rows
SMALLEST = 20
# surfaces of a database or map that suffice where each part takes a further fit: the share of rows
# inside intervals of 90 % then deviates by 1.5 %
ENOUGH = 400
# models of which one fit gives the errors at all rows that are left out
CLOSED = ("kernel-ridge", "gaussian-process", POPULATION.name)
# smallest number of rows of another database that calibrate
SMALLEST_CALIBRATION = 20


@dataclass(frozen=True, eq=False)
class Groups:
    """The maps, databases or surfaces that some rows are grouped by to calibrate intervals."""

    labels: Indices  # (n,), group of each row, from 0 on
    # number of groups; of its surfaces, tiles or rows if there is one group
    number: int
    # what `number` counts: "map", "database", "surface", "tile", or "row" if all share one surface
    kind: str
    scheme: Scheme

    @property
    def are_left_out(self) -> bool:
        """True if whole groups are left out, so that intervals hold for other groups too."""
        return self.scheme == "others"

    @property
    def are_populations(self) -> bool:
        """True for several maps or databases, False for the surfaces of one."""
        return self.kind in {"map", "database"}

    @property
    def are_surfaces(self) -> bool:
        """True if each surface is a group, as for a scene's own features."""
        return self.are_left_out and self.kind == SURFACE

    def left_out(self, rows: Dataset) -> Indices:
        """Deal rows into parts of about one size, each of which is left out together.

        Parameters
        ----------
        rows : Dataset
            The n rows that are grouped.

        Returns
        -------
        ndarray, shape (n,)
            Number of the part of each row. A part has whole groups where these are left out,
            otherwise a fifth of the surfaces or tiles, drawn with a fixed seed.
        """
        random = np.random.default_rng(0)
        if self.are_left_out:
            return dealt(self.labels, min(self.number, MOST_FITS), random)
        return dealt(rows.surfaces, FOLDS, random)


def groups_of(rows: Dataset) -> Groups:
    """Group rows by the maps or databases that calibrate intervals.

    Windows of one map are in one group, whichever databases they are in. Databases that share
    surfaces are not left out as a whole if too few rows would be left to train on.

    Parameters
    ----------
    rows : Dataset
        n rows.

    Returns
    -------
    Groups
        Their groups.
    """
    surfaces, surface = np.unique(rows.groups, return_inverse=True)
    if rows.features.of_scene and not rows.by_tile:
        if surfaces.size >= FEWEST:
            return Groups(surface, surfaces.size, SURFACE, "others")
        return _one_group(rows, surfaces.size)
    populations, labels = np.unique(rows.population, return_inverse=True)
    if populations.size < 2 or surfaces.size < 2:
        return _one_group(rows, surfaces.size)
    kind = "map" if rows.by_tile else "database"
    if populations.size >= FEWEST:
        left_out_whole = Groups(labels, populations.size, kind, "others")
        if _leaves_enough(rows, left_out_whole):
            return left_out_whole
    divided = Groups(labels, populations.size, kind, "each")
    if _leaves_enough(rows, divided):
        return divided
    return _one_group(rows, surfaces.size)


def _one_group(rows: Dataset, surfaces: int) -> Groups:
    """Return rows of a number of surfaces or tiles as one group."""
    labels = np.zeros(rows.size, dtype=np.int64)
    if rows.by_tile:
        kind = "tile"
    elif surfaces > 1:
        kind = SURFACE
    else:
        kind = "row"
    number = surfaces if surfaces > 1 else rows.size
    return Groups(labels, number, kind, "surfaces")


def _leaves_enough(rows: Dataset, groups: Groups) -> bool:
    """Return whether each model that lacks a part of the rows has enough of them to train on."""
    unseen = [holdout.unseen.size for holdout in holdouts(rows, groups.left_out(rows))]
    return max(unseen) <= MOST_UNSEEN * rows.size


@dataclass(frozen=True, eq=False)
class Holdout:
    """A part of the training rows that a model without them predicts."""

    rows: Indices  # (k,), positions of the part, ascending
    # (m,), ascending positions of all rows that this model must not see: those of the part, and
    # those that share a surface or tile with one of them
    unseen: Indices


def holdouts(rows: Dataset, parts: Indices) -> Iterator[Holdout]:
    """Yield the parts of training rows that are left out in turn.

    Parameters
    ----------
    rows : Dataset
        The n training rows.
    parts : ndarray, shape (n,)
        Number of the part of each row, from `Groups.left_out`.

    Yields
    ------
    Holdout
        A part, with the rows that a model which predicts it must not see.
    """
    for part in np.unique(parts):
        inside = np.flatnonzero(parts == part)
        unseen = np.flatnonzero(np.isin(rows.surfaces, rows.surfaces[inside]))
        yield Holdout(inside, unseen)


@dataclass(frozen=True, eq=False)
class Plan:
    """Which rows calibrate intervals, and what the card and the user are told of them."""

    # parts of the training rows that calibrate; empty if another database calibrates
    holdouts: Sequence[Holdout]
    # (k,), ascending positions of the training rows that calibrate, which are those of the parts
    calibrating: Indices
    groups: Groups  # of the rows that calibrate
    measured: MeasuredRows  # their distances from the training
    # distances of the surrogate, with a limit by the groups that calibrate or by the training
    distance: Distance
    entry: dict[str, Any]  # "calibration" of the card
    # by which maps or databases the training rows calibrate; "" if there is only one
    remark: str = ""


def plan_calibration(model: str, train: Dataset, other: Dataset | None = None) -> Plan:
    """Choose the rows that calibrate intervals: training rows, or those of another database.

    All training rows calibrate models in `CLOSED`, and all models where whole maps or databases are
    left out. Otherwise as many parts of them calibrate as have `ENOUGH` surfaces, or all parts.

    Parameters
    ----------
    model : str
        Name of the model.
    train : Dataset
        The training rows.
    other : Dataset, optional
        Rows of another database, which calibrate instead.

    Returns
    -------
    Plan
        The rows that calibrate, their groups, and their distances from the training.
    """
    groups = groups_of(train)
    measured = _measure(train, groups)
    if other is not None:
        return _plan_by_other(train, other, measured.training)
    return _plan_by_training(model, train, groups, measured)


def _measure(train: Dataset, groups: Groups) -> MeasuredRows:
    """Measure training rows from the training, without the groups or surfaces that they are in."""
    if train.features.of_scene:
        # Parameters are drawn independently of each other: their ranges say all.
        features = train.inputs.shape[1]
        whitening = np.zeros((1, features, features))
        distance = Distance(np.zeros((1, features)), whitening, np.inf)
    elif groups.are_left_out:
        distance = from_maps(train.inputs, groups.labels)
    else:
        return from_surfaces(train.inputs, groups.labels, groups.left_out(train))
    return MeasuredRows(distance, distance.nearest(train.inputs))


def _plan_by_other(train: Dataset, other: Dataset, distance: Distance) -> Plan:
    """Plan to calibrate by the rows of another database, by their distances from the training."""
    groups = groups_of(other)
    measured = MeasuredRows(distance, distance.nearest(other.inputs))
    if groups.are_left_out and not train.features.of_scene:
        distance = from_training(train.inputs, other.inputs, groups.labels)
    origin = other.origins[-1]
    return Plan(
        holdouts=(),
        calibrating=np.arange(0),
        groups=groups,
        measured=measured,
        distance=distance,
        entry=_entry(groups, origin.database, origin.sha256),
    )


def _plan_by_training(
    model: str, train: Dataset, groups: Groups, measured: MeasuredRows
) -> Plan:
    """Plan to calibrate by training rows, whose distances from the training are measured."""
    parts = list(holdouts(train, groups.left_out(train)))
    whole_populations = groups.are_populations and groups.are_left_out
    if model not in CLOSED and not whole_populations:
        populations = groups.number if groups.are_populations else 1
        parts = _first_with_surfaces(ENOUGH * populations, parts, train)
    calibrating = np.sort(np.concatenate([part.rows for part in parts]))
    number = groups.number
    if model not in CLOSED and not groups.are_populations:
        number = np.unique(train.surfaces[calibrating]).size
    groups = replace(groups, labels=groups.labels[calibrating], number=number)
    nearest = Nearest(
        measured.nearest.distance[calibrating], measured.nearest.cloud[calibrating]
    )
    return Plan(
        holdouts=parts,
        calibrating=calibrating,
        groups=groups,
        measured=MeasuredRows(measured.training, nearest),
        distance=measured.training,
        entry=_entry(groups),
        remark=_remark(groups),
    )


def _first_with_surfaces(
    enough: int, parts: Sequence[Holdout], train: Dataset
) -> list[Holdout]:
    """Return the first parts of training rows that have enough surfaces together, or all parts."""
    chosen: list[Holdout] = []
    surfaces: set[int] = set()
    for part in parts:
        if len(surfaces) >= enough:
            break
        chosen.append(part)
        surfaces.update(train.surfaces[part.rows].tolist())
    return chosen


def _entry(groups: Groups, database: str = "", sha256: str = "") -> dict[str, Any]:
    """Return "calibration" of the card, with the path and fingerprint of another database."""
    return {
        "scheme": groups.scheme,
        "kind": groups.kind,
        "groups": groups.number,
        "database": database,
        "sha256": sha256,
    }


def _remark(groups: Groups) -> str:
    """Return the line for the user on the maps or databases that calibrate; "" for one of them."""
    if groups.scheme == "surfaces":
        return ""
    how = "by surfaces that the model has not seen"
    if groups.are_left_out:
        how = "each predicted without it"
    return f"intervals by {groups.number} {groups.kind}s, {how}"


def calibrate(rows: Dataset, plan: Plan, raw: Values, *, root: bool) -> Calibration:
    """Calibrate intervals with predictions of models that have not seen the rows.

    Errors are divided by their growth with the distance from the training, unless intervals hold
    for other maps, and by the usual error, which is fitted without the part that a row is in.

    Parameters
    ----------
    rows : Dataset
        n rows, those that `plan` calibrates by.
    plan : Plan
        Their groups and distances.
    raw : ndarray, shape (n,)
        Predictions over the target's scale.
    root : bool
        True for errors of the square root of the target.

    Returns
    -------
    Calibration
        Scores and usual errors.
    """
    groups = plan.groups
    training = plan.measured.training
    parts = groups.left_out(rows)
    errors = _absolute_errors(raw, rows.target, root=root)
    if not groups.are_left_out:
        errors = errors / GROWTH.at(plan.measured.nearest.distance, training.limit)
    usual = np.empty(errors.size)
    for part in np.unique(parts):
        inside = parts == part
        scale = _usual_errors(rows.inputs, errors, groups, ~inside)
        usual[inside] = scale.at(rows.inputs[inside])
    everywhere = np.ones(rows.size, dtype=np.bool_)
    scale = _usual_errors(rows.inputs, errors, groups, everywhere)
    if groups.are_left_out:
        together = Scores.of(errors / usual, groups.labels)
        return Calibration((together,), scale, distance=None, root=root)
    scores = _scores_of_clouds(errors / usual, rows, plan.measured)
    return Calibration(scores, scale, distance=training, root=root)


def _absolute_errors(raw: Values, truth: Values, *, root: bool) -> Values:
    """Return the distances of predictions from the truth, or of their roots, (n,)."""
    if root:
        raw = np.sqrt(np.maximum(raw, 0))
        truth = np.sqrt(np.maximum(truth, 0))
    return np.abs(raw - truth)


def _usual_errors(
    inputs: Values, errors: Values, groups: Groups, fitted: NDArray[np.bool_]
) -> ErrorScale:
    """Fit usual errors to some of n rows with features (n, d).

    Where each surface is a group, there are many of them and few features: the fit is quadratic.
    """
    terms = inputs[fitted]
    shrinkage = SHRINKAGE
    if groups.are_surfaces:
        terms = quadratic(terms)
        shrinkage = SLIGHT
    return fit_scale(terms, errors[fitted], groups.labels[fitted], shrinkage)


def _scores_of_clouds(
    errors: Values, rows: Dataset, measured: MeasuredRows
) -> tuple[Scores, ...]:
    """Return the scores of the rows nearest to each cloud; of all rows for clouds with few."""
    scores = []
    for cloud in range(len(measured.training.centres)):
        near = measured.nearest.cloud == cloud
        if near.sum() < SMALLEST:
            near[:] = True
        scores.append(Scores.of(errors[near], rows.surfaces[near]))
    return tuple(scores)


def rows_of_another(
    training: Sequence[Dataset], together: Sequence[Dataset]
) -> list[Dataset]:
    """Return the rows of another database that calibrate, for each target.

    Rows of surfaces, or tiles, that the training has too are left out.

    Parameters
    ----------
    training : sequence of Dataset
        Rows of the databases that train, for each target.
    together : sequence of Dataset
        The same, and behind them the rows of the other database.

    Returns
    -------
    list of Dataset
        The rows of the other database, for each target.

    Raises
    ------
    InputError
        If the other database has other features, or too few rows that the training lacks.
    """
    columns = training[0].features.columns
    columns_together = together[0].features.columns
    path = together[0].origins[-1].database
    if columns != columns_together:
        differing = sorted(set(columns) ^ set(columns_together))
        raise InputError(
            f"--calibrate-on {path}: has another grid or hardness than the training: there"
            f" {', '.join(differing)} would be a feature"
        )
    calibrating = [_rows_of_the_last(rows) for rows in together]
    number = calibrating[0].size
    if number < SMALLEST_CALIBRATION:
        raise InputError(
            f"--calibrate-on {path}: {number} usable rows of surfaces that are not in the"
            f" training, {SMALLEST_CALIBRATION} at least are needed"
        )
    return calibrating


def _rows_of_the_last(rows: Dataset) -> Dataset:
    """Return the rows of the last database whose surfaces or tiles no other database has."""
    is_last = rows.database == len(rows.origins) - 1
    shared = np.isin(rows.groups, rows.groups[~is_last])
    return rows.at(np.flatnonzero(is_last & ~shared))
