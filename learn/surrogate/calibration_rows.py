"""The rows that calibrate intervals: held-out rows, the training rows, or another database's."""

from dataclasses import dataclass

import numpy as np

from gen.runtime.errors import InputError
from learn.arrays import Indices
from learn.dataset import Dataset
from learn.surrogate.calibration_text import Calibrated
from learn.surrogate.distance import Distance, from_others, from_training
from learn.surrogate.groups import Groups, groups_of, near

CALIBRATION_SHARE = 0.1
"""Share of the training rows that are used to calibrate the intervals instead."""

SMALLEST_CALIBRATION = 20
"""Smallest number of calibration rows, for intervals of 95 %, if there are five times as many."""


@dataclass(frozen=True, eq=False)
class Plan:
    """Which rows train, and which calibrate.

    Attributes
    ----------
    train : ndarray of int
        Positions of the rows that train.
    holdout : ndarray of int
        Positions of the rows that calibrate: the training rows themselves, by their groups, if the
        two are the same; none if another database calibrates.
    groups : Groups or None
        Groups of the rows that calibrate; None if they are of one.
    others : list of Dataset or None
        Rows of another database that calibrate, one set for each target.
    """

    train: Indices
    holdout: Indices
    groups: Groups | None
    others: list[Dataset] | None = None

    @property
    def size(self) -> int:
        """Number of rows that calibrate."""
        return self.holdout.size if self.others is None else self.others[0].size

    def rows(self, rows: Dataset, target: int) -> Dataset | None:
        """Return the rows that calibrate a target; None for the training rows by their groups."""
        if self.others is not None:
            return self.others[target]
        return None if self.groups is not None else rows.at(self.holdout)

    def entry(self) -> dict[str, object] | None:
        """Return the card's entry; None for held-out rows of one group."""
        groups, others = self.groups, self.others
        if others is None and groups is None:
            return None
        scheme, kind, number = ("ranges", "database", 1) if groups is None else _of(groups)
        origin = None if others is None else others[0].origins[-1]
        database, sha256 = ("", "") if origin is None else (origin.database, origin.sha256)
        return Calibrated(scheme, kind, number, database, sha256)._asdict()

    def distance(self, rows: Dataset) -> Distance:
        """Return distances from the training, with the limit of its groups or of its rows."""
        inputs = rows.inputs[self.train]
        if self.groups is None or self.groups.scheme != "others":
            return near(rows.at(self.train))
        if self.others is None:
            return from_training(inputs, self.groups.labels)
        return from_others(inputs, self.others[0].inputs, self.groups.labels)

    def remark(self) -> str:
        """Name the groups by which the training rows calibrate; "" if they do not."""
        if self.groups is None or self.others is not None:
            return ""
        groups = self.groups
        whole = groups.scheme == "others"
        how = "each predicted without it" if whole else "by rows that the model has not seen"
        return f"intervals by {groups.number} {groups.kind}s, {how}"


def _of(groups: Groups) -> tuple[str, str, int]:
    return groups.scheme, groups.kind, groups.number


def planned(rows: Dataset, train: Indices, others: list[Dataset] | None = None) -> Plan:
    """Decide which rows train, and which calibrate.

    Parameters
    ----------
    rows : Dataset
        The usable rows.
    train : ndarray of int
        Positions of the training rows, from `learn.split.draw`.
    others : list of Dataset, optional
        Rows of another database that calibrate, for each target.

    Raises
    ------
    InputError
        If too few rows are left to train on.
    """
    if others is not None:
        return Plan(train, np.empty(0, dtype=np.int64), groups_of(others[0]), others)
    groups = groups_of(rows.at(train))
    if groups is not None:
        return Plan(train, train, groups)
    return Plan(*without_calibration(rows, train), None)


def without_calibration(rows: Dataset, train: Indices) -> tuple[Indices, Indices]:
    """Split the last rows, by whole groups, off the training rows, which are in random order.

    Parameters
    ----------
    rows : Dataset
        The usable rows.
    train : ndarray of int
        Positions of the training rows, from `learn.split.draw`.

    Returns
    -------
    train, calibration : ndarray of int
        Positions of the rows that train, and of those that calibrate.

    Raises
    ------
    InputError
        If too few rows are left to train on.
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
            f"{rows.source['database']}: {inside.size} rows of {starts.size}"
            f" {'tiles' if rows.by_tile else 'surfaces'} are left to train on: more are needed"
        )
    return inside, train[cut:]


def of_another(sets: list[Dataset], together: list[Dataset]) -> list[Dataset]:
    """Return the rows of another database that calibrate, for each target.

    Rows of surfaces, or tiles, that the training has too are left out.

    Parameters
    ----------
    sets : list of Dataset
        The rows of the training's databases, for each target.
    together : list of Dataset
        The same, with those of the other database, which is the last.

    Raises
    ------
    InputError
        If the other database has other features, or no rows of its own.
    """
    first, whole = sets[0], together[0]
    path = whole.origins[-1].database
    if first.names != whole.names:
        differing = sorted(set(first.names) ^ set(whole.names))
        raise InputError(
            f"--calibrate-on {path}: has another grid or hardness than the training: there"
            f" {', '.join(differing)} would be a feature"
        )
    own = [_own(each) for each in together]
    if own[0].size < SMALLEST_CALIBRATION:
        raise InputError(
            f"--calibrate-on {path}: {own[0].size} usable rows of surfaces that are not in the"
            f" training, {SMALLEST_CALIBRATION} at least are needed"
        )
    return own


def _own(rows: Dataset) -> Dataset:
    """Return the rows of the last database whose groups no other database has."""
    last = rows.database == rows.database.max()
    last &= rows.database == len(rows.origins) - 1
    shared = np.isin(rows.groups, rows.groups[rows.database < len(rows.origins) - 1])
    return rows.at(np.flatnonzero(last & ~shared))
