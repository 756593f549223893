"""The rows that calibrate intervals, and the calibration by them.

Intervals are calibrated by training rows, which are predicted by models that have not seen their
surfaces: a fifth of the surfaces is left out at a time. If surfaces are windows of maps, the tiles
of the maps take the place of surfaces, because windows of one tile can share nodes. Rows of one map
are more alike than rows of different maps, and so are rows of one database that come from no maps.
Only the errors on a map or database that a model has not seen show how well it predicts a new one.
If there are enough maps or databases, each of them is therefore left out as a whole. Rows of
another database can calibrate in place of training rows.
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
    distance_by_maps,
    distance_by_other_maps,
    fit_scale,
    quadratic,
    rows_measured_by_surfaces,
)

# The surfaces that intervals hold for. "surfaces": new surfaces of the training as a whole, which
# is one group. "each": new surfaces of each map or database of the training. "others": surfaces of
# other maps or databases, or of other parameters of a scene.
Scheme = Literal["surfaces", "each", "others"]

# Smallest number of maps or databases with which intervals of 90 % hold for other ones, because K
# of them reach a level of K / (K + 1).
FEWEST = 9
# Kind of the groups of a scene's own features, where each surface is a group.
SURFACE = "surface"
# Weight of the penalty on the slopes of usual errors if each surface is a group.
SLIGHT = 1e-3
# Largest number of fits that leave groups out. If there are more groups, several are left out
# together.
MOST_FITS = 20
# Largest share of the training rows that may be left out of one fit. If it were exceeded, rows are
# grouped in another way.
MOST_UNSEEN = 0.6
# A cloud of the training has scores of its own if it is the nearest one to at least this many
# calibrating rows. Otherwise it has the scores of all rows.
SMALLEST = 20
# Number of surfaces of each database or map that suffice to calibrate, if every part of them takes
# a fit of its own. The share of rows inside intervals of 90 % then has a standard deviation of
# 1.5 %.
ENOUGH = 400
# Names of the models for which all training rows calibrate: their one fit to all these rows gives
# the errors at rows that are left out. The mean of a population gives them only if each surface is
# a group; otherwise it is fitted anew for each part.
CLOSED = ("kernel-ridge", "gaussian-process", POPULATION.name)
# Smallest number of rows of another database that can calibrate.
SMALLEST_CALIBRATION = 20


@dataclass(frozen=True, eq=False)
class Groups:
    """The grouping of n rows by maps, databases or surfaces, for the calibration of intervals."""

    labels: Indices  # (n,), number of the group of each row: 0, 1, ...
    # With several groups, what each group is: "map", "database" or "surface". With one group, what
    # it consists of: "surface", "tile", or "row" if all rows share one surface.
    kind: str
    number: int  # number of different maps, databases, surfaces, tiles or rows, as `kind` says
    scheme: Scheme  # the surfaces that intervals hold for

    @property
    def are_left_out(self) -> bool:
        """True if groups are left out as a whole, so that intervals hold for other groups too.

        Otherwise a fifth of the surfaces or tiles of all groups is left out at a time.
        """
        return self.scheme == "others"

    @property
    def are_several(self) -> bool:
        """True if each map, database or surface is a group, False if all rows are one group."""
        return self.scheme != "surfaces"

    @property
    def are_populations(self) -> bool:
        """True for several maps or databases, False for surfaces, tiles or rows of one."""
        return self.kind in {"map", "database"}

    @property
    def are_surfaces(self) -> bool:
        """True if each surface is a group, as for a scene's own features."""
        return self.are_left_out and self.kind == SURFACE

    def left_out(self, rows: Dataset) -> Indices:
        """Divide rows into parts of about equal size, which are left out one after the other.

        Parameters
        ----------
        rows : Dataset
            The n rows that are grouped.

        Returns
        -------
        ndarray, shape (n,)
            Number of the part of each row. A part has one or more groups if groups are left out as
            a whole; otherwise it has about a fifth of the surfaces or tiles.
        """
        random = np.random.default_rng(0)  # A fixed seed: equal rows have equal parts.
        if self.are_left_out:
            return dealt(self.labels, min(self.number, MOST_FITS), random)
        return dealt(rows.surfaces, FOLDS, random)


def groups_of(rows: Dataset) -> Groups:
    """Group rows to calibrate intervals.

    Rows of maps are grouped by maps, also if rows of one map are in several databases. Other rows
    are grouped by surfaces if the features are a scene's own, otherwise by databases. All rows are
    one group if there are too few groups, or if too few rows would be left to train on.

    Parameters
    ----------
    rows : Dataset
        n rows.

    Returns
    -------
    Groups
        The groups of the rows, with one of three schemes. "others": there are `FEWEST` groups or
        more, each is left out as a whole, and enough rows remain. "each": surfaces of each map or
        database are left out. "surfaces": all rows are one group.
    """
    # Tiles of maps are treated as surfaces.
    surfaces, surface_of_row = np.unique(rows.groups, return_inverse=True)
    number_of_surfaces = surfaces.size
    if rows.features.of_scene and not rows.by_tile:
        if number_of_surfaces >= FEWEST:
            return Groups(
                labels=surface_of_row,
                number=number_of_surfaces,
                kind=SURFACE,
                scheme="others",
            )
        return _one_group(rows, number_of_surfaces)
    # A population is a map, or a database of rows that come from no maps.
    populations, population_of_row = np.unique(rows.population, return_inverse=True)
    if populations.size < 2 or number_of_surfaces < 2:
        return _one_group(rows, number_of_surfaces)
    kind = "database"
    if rows.by_tile:
        kind = "map"
    by_population_new_surfaces = Groups(
        labels=population_of_row, number=populations.size, kind=kind, scheme="each"
    )
    if populations.size >= FEWEST:
        by_population_new_populations = replace(
            by_population_new_surfaces, scheme="others"
        )
        # A database that is left out takes its surfaces out of all other databases too: too few
        # rows may remain.
        if _leaves_enough(rows, by_population_new_populations):
            return by_population_new_populations
    if _leaves_enough(rows, by_population_new_surfaces):
        return by_population_new_surfaces
    return _one_group(rows, number_of_surfaces)


def _one_group(rows: Dataset, surfaces: int) -> Groups:
    """Return all rows as one group; `surfaces` is the number of their surfaces or tiles."""
    if rows.by_tile:
        kind = "tile"
    elif surfaces > 1:
        kind = SURFACE
    else:
        kind = "row"
    number = surfaces
    if surfaces <= 1:  # Rows of a single surface are counted one by one.
        number = rows.size
    labels = np.zeros(rows.size, dtype=np.int64)
    return Groups(labels=labels, number=number, kind=kind, scheme="surfaces")


def _leaves_enough(rows: Dataset, groups: Groups) -> bool:
    """Return whether enough rows are left to train on, whichever part of the rows is left out.

    Rows that share a surface with the part are left out with it.
    """
    parts = groups.left_out(rows)
    numbers_unseen = [holdout.unseen.size for holdout in holdouts(rows, parts)]
    return max(numbers_unseen) <= MOST_UNSEEN * rows.size


@dataclass(frozen=True, eq=False)
class Holdout:
    """A part of the training rows, which is predicted by a model that has not seen it."""

    rows: Indices  # (k,), positions of the rows of the part, ascending
    # (m,), positions of all rows that the model must not see, ascending: the rows of the part, and
    # rows that share a surface or tile with one of these
    unseen: Indices


def holdouts(rows: Dataset, parts: Indices) -> Iterator[Holdout]:
    """Yield the parts of training rows that are left out one after the other.

    Parameters
    ----------
    rows : Dataset
        The n training rows.
    parts : ndarray, shape (n,)
        Number of the part of each row, from `Groups.left_out`.

    Yields
    ------
    Holdout
        One part, in the order of the numbers of the parts.
    """
    for part in np.unique(parts):
        inside = np.flatnonzero(parts == part)
        unseen = np.flatnonzero(np.isin(rows.surfaces, rows.surfaces[inside]))
        yield Holdout(rows=inside, unseen=unseen)


@dataclass(frozen=True, eq=False)
class Plan:
    """The choice of the rows that calibrate intervals, and its description."""

    # parts of the training rows that calibrate; empty if another database calibrates
    holdouts: Sequence[Holdout]
    # (k,), positions of the training rows in these parts, ascending; empty if there are no parts
    calibrating: Indices
    groups: Groups  # groups of the rows that calibrate
    measured: MeasuredRows  # distances of the rows that calibrate from the training
    # measure of distances that the surrogate keeps, with the limit of its flag
    distance: Distance
    entry: dict[str, Any]  # entry "calibration" of the card
    # line for the user on the maps or databases by which training rows calibrate; "" if there is
    # only one, or if another database calibrates
    remark: str = ""


def plan_calibration(model: str, train: Dataset, other: Dataset | None = None) -> Plan:
    """Choose the rows that calibrate intervals: training rows, or rows of another database.

    Parameters
    ----------
    model : str
        Name of the model.
    train : Dataset
        The training rows.
    other : Dataset, optional
        Rows of another database, which calibrate in place of training rows.

    Returns
    -------
    Plan
        The rows that calibrate, with their groups and their distances from the training. All rows
        of another database calibrate. All training rows calibrate a model in `CLOSED`, and any
        model if maps or databases are left out as a whole. Otherwise only as many parts of the
        training rows calibrate as have `ENOUGH` surfaces for each map or database, or all parts if
        there are fewer surfaces.
    """
    groups = groups_of(train)
    measured = _measure(train, groups)
    if other is not None:
        return _plan_by_other(train, other, measured.training)
    return _plan_by_training(model, train, groups, measured)


def _measure(train: Dataset, groups: Groups) -> MeasuredRows:
    """Make the measure of distances with the limit of the flag, and apply it to the training rows.

    Each row is measured from the rows of other parts (`Groups.left_out`), thus of other surfaces.
    If groups are left out as a whole, rows are measured from all rows, themselves included:
    `calibrate` does not use these distances, and the limit is from groups that were left out in
    turn. For a scene's own features all distances are 0, and the limit is infinite.
    """
    if train.features.of_scene:
        # Parameters are drawn independently of each other, so that their ranges suffice for the
        # flag. Whitenings of 0 make all distances 0.
        features = train.inputs.shape[1]
        distance = Distance(
            centres=np.zeros((1, features)),
            whitenings=np.zeros((1, features, features)),
            limit=np.inf,
        )
    elif groups.are_left_out:
        distance = distance_by_maps(train.inputs, groups.labels)
    else:
        return rows_measured_by_surfaces(
            train.inputs, clouds=groups.labels, parts=groups.left_out(train)
        )
    return MeasuredRows(training=distance, nearest=distance.nearest(train.inputs))


def _plan_by_other(train: Dataset, other: Dataset, distance: Distance) -> Plan:
    """Return the plan to calibrate by all rows of another database.

    `distance` measures distances from the training rows.
    """
    groups = groups_of(other)
    measured = MeasuredRows(training=distance, nearest=distance.nearest(other.inputs))
    if groups.are_left_out and not train.features.of_scene:
        # The surrogate keeps a measure whose limit comes from these maps or databases, which show
        # better than the training rows how far a new one may be.
        distance = distance_by_other_maps(train.inputs, other.inputs, groups.labels)
    origin = other.origins[-1]
    return Plan(
        holdouts=(),
        calibrating=np.arange(0),  # no training rows
        groups=groups,
        measured=measured,
        distance=distance,
        entry=_entry(groups, database=origin.database, sha256=origin.sha256),
    )


def _plan_by_training(
    model: str, train: Dataset, groups: Groups, measured: MeasuredRows
) -> Plan:
    """Return the plan to calibrate by training rows; see `plan_calibration` for their choice.

    `groups` and `measured` describe all training rows.
    """
    parts = list(holdouts(train, groups.left_out(train)))
    whole_populations = groups.are_populations and groups.are_left_out
    if model not in CLOSED and not whole_populations:
        # Each part takes another fit: leave away parts that are not needed.
        populations = 1
        if groups.are_populations:
            populations = groups.number
        parts = _first_with_surfaces(ENOUGH * populations, parts, train)
    calibrating = np.sort(np.concatenate([part.rows for part in parts]))
    # Rows of all maps or databases calibrate. Of surfaces, tiles or rows only some may calibrate:
    # these are counted.
    number = groups.number
    if model not in CLOSED and not groups.are_populations:
        number = np.unique(train.surfaces[calibrating]).size
    calibrating_groups = replace(groups, labels=groups.labels[calibrating], number=number)
    nearest = Nearest(
        distance=measured.nearest.distance[calibrating],
        cloud=measured.nearest.cloud[calibrating],
    )
    return Plan(
        holdouts=parts,
        calibrating=calibrating,
        groups=calibrating_groups,
        measured=MeasuredRows(training=measured.training, nearest=nearest),
        distance=measured.training,
        entry=_entry(calibrating_groups),
        remark=_remark(calibrating_groups),
    )


def _first_with_surfaces(
    enough: int, parts: Sequence[Holdout], train: Dataset
) -> list[Holdout]:
    """Return the first parts that together have `enough` surfaces or tiles.

    All parts are returned if they have fewer together.
    """
    chosen: list[Holdout] = []
    surfaces: set[int] = set()
    for part in parts:
        if len(surfaces) >= enough:
            break
        chosen.append(part)
        surfaces.update(train.surfaces[part.rows].tolist())
    return chosen


def _entry(groups: Groups, database: str = "", sha256: str = "") -> dict[str, Any]:
    """Return the entry "calibration" of the card.

    `groups` are those of the rows that calibrate. `database` and `sha256` are path and checksum of
    another database that calibrates; "" if training rows calibrate.
    """
    return {
        "scheme": groups.scheme,
        "kind": groups.kind,
        "groups": groups.number,
        "database": database,
        "sha256": sha256,
    }


def _remark(groups: Groups) -> str:
    """Return the line for the user on the groups that calibrate; "" if there is only one group.

    An example: "intervals by 17 maps, each predicted without it".
    """
    if not groups.are_several:
        return ""
    kind_of_errors = "by surfaces that the model has not seen"
    if groups.are_left_out:
        kind_of_errors = "each predicted without it"
    return f"intervals by {groups.number} {groups.kind}s, {kind_of_errors}"


def calibrate(rows: Dataset, plan: Plan, raw: Values, *, root: bool) -> Calibration:
    """Calibrate intervals by the errors of predictions.

    Errors are first divided by their growth with the distance from the training, unless groups are
    left out as a whole. Usual errors are then fitted to the results. The score of a row is its
    divided error over its usual error, which for this purpose is fitted without the row's part.

    Parameters
    ----------
    rows : Dataset
        The n rows that calibrate by `plan`.
    plan : Plan
        Groups and distances of these rows.
    raw : ndarray, shape (n,)
        Predictions over the target's scale, by models that have not seen the rows.
    root : bool
        True for errors of the square root of the target over its scale.

    Returns
    -------
    Calibration
        Scores, usual errors and, unless groups are left out as a whole, the measure of distances.
    """
    groups = plan.groups
    training = plan.measured.training
    parts = groups.left_out(rows)
    errors = _absolute_errors(raw, rows.target, root=root)
    if not groups.are_left_out:
        growth = GROWTH.at(plan.measured.nearest.distance, training.limit)
        errors = errors / growth
    # Usual errors of each part, fitted to the rows of the other parts.
    usual = np.empty(errors.size)
    for part in np.unique(parts):
        inside = parts == part
        without_part = _usual_errors(rows.inputs, errors, groups, ~inside)
        usual[inside] = without_part.at(rows.inputs[inside])
    # Usual errors of predictions, fitted to all rows.
    all_rows = np.ones(rows.size, dtype=np.bool_)
    scale = _usual_errors(rows.inputs, errors, groups, all_rows)
    if groups.are_left_out:
        # The scores of all groups are one entry, which holds for any new group.
        together = Scores.of(errors / usual, groups.labels)
        return Calibration(scores=(together,), usual=scale, distance=None, root=root)
    scores = _scores_of_clouds(errors / usual, rows, plan.measured)
    return Calibration(scores=scores, usual=scale, distance=training, root=root)


def _absolute_errors(raw: Values, truth: Values, *, root: bool) -> Values:
    """Return absolute errors of n predictions over the target's scale, (n,).

    `raw` are the predictions and `truth` the targets, both over the target's scale, (n,). With
    `root` the errors are those of their square roots; negative numbers are first replaced by 0.
    """
    if root:
        raw = np.sqrt(np.maximum(raw, 0))
        truth = np.sqrt(np.maximum(truth, 0))
    return np.abs(raw - truth)


def _usual_errors(
    inputs: Values, errors: Values, groups: Groups, fitted: NDArray[np.bool_]
) -> ErrorScale:
    """Fit the usual error, as a function of the features, to the errors of some of n rows.

    `fitted`, (n,), is True for the rows to fit to. `inputs` are the features, (n, d). `errors`,
    (n,), are absolute errors; unless groups are left out as a whole, they are divided by their
    growth with the distance (`GROWTH`).
    """
    terms = inputs[fitted]
    shrinkage = SHRINKAGE
    if groups.are_surfaces:
        # There are many groups and few features, so that a quadratic fit is possible.
        terms = quadratic(terms)
        shrinkage = SLIGHT
    return fit_scale(terms, errors[fitted], groups.labels[fitted], shrinkage)


def _scores_of_clouds(
    errors: Values, rows: Dataset, measured: MeasuredRows
) -> tuple[Scores, ...]:
    """Return the scores of each cloud of the training, in the order of the clouds.

    A cloud has the scores of the rows to which it is the nearest cloud, or, if these are fewer than
    `SMALLEST`, the scores of all rows. `errors`, (n,), are the errors of the rows, divided by their
    growth and by their usual errors. All surfaces have an equal weight.
    """
    scores = []
    for cloud in range(len(measured.training.centres)):
        is_near = measured.nearest.cloud == cloud
        if is_near.sum() < SMALLEST:
            is_near[:] = True  # all rows
        scores.append(Scores.of(errors[is_near], rows.surfaces[is_near]))
    return tuple(scores)


def rows_of_another(
    training: Sequence[Dataset], together: Sequence[Dataset]
) -> list[Dataset]:
    """Select the rows of another database that calibrate, for each target.

    Parameters
    ----------
    training : sequence of Dataset
        For each target, the rows of the databases that train.
    together : sequence of Dataset
        For each target, the rows of these databases and of the other database, which is the last
        one.

    Returns
    -------
    list of Dataset
        For each target, the rows of the other database. Rows of surfaces or tiles that the training
        has too are left out.

    Raises
    ------
    InputError
        If the other database needs other features than the training, or has fewer than
        `SMALLEST_CALIBRATION` rows that are not left out.
    """
    columns = training[0].features.columns
    columns_together = together[0].features.columns
    path = together[0].origins[-1].database
    if columns != columns_together:
        # Nodes and hardness are features only if they differ between the rows of all databases.
        differing = sorted(set(columns) ^ set(columns_together))
        raise InputError(
            f"--calibrate-on {path}: has another grid or hardness than the training: there"
            f" {', '.join(differing)} would be a feature"
        )
    calibrating = [_rows_of_last_database(rows) for rows in together]
    number = calibrating[0].size  # equal for all targets, which have equal rows
    if number < SMALLEST_CALIBRATION:
        raise InputError(
            f"--calibrate-on {path}: {number} usable rows of surfaces that are not in the"
            f" training, {SMALLEST_CALIBRATION} at least are needed"
        )
    return calibrating


def _rows_of_last_database(rows: Dataset) -> Dataset:
    """Return the rows of the last database whose surface or tile no other database has."""
    is_last = rows.database == len(rows.origins) - 1
    shared = np.isin(rows.groups, rows.groups[~is_last])
    return rows.at(np.flatnonzero(is_last & ~shared))
