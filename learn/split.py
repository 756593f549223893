"""Split rows into training, test and the five folds of the grid search, the same for all models.

Rows of one surface stay together, so that no model is tested on a surface that it has seen. Of
windows of maps, rows of one tile do: two windows of a tile can share nodes.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Indices
from gen.runtime.errors import InputError
from learn.dataset import Dataset

Folds = NDArray[np.int8]
"""Fold of each training row."""

DRAWS = 20
"""Draws of a split at most, where a target is constant in a part."""

FOLDS = 5
"""Folds of the cross-validation, the paper's number."""

TILES = 4
"""Smallest number of tiles of a surrogate: to train, validate settings, calibrate and test."""

TEST_SHARE = 0.2
"""Share of the rows that test, the paper's number."""


@dataclass(frozen=True, eq=False)
class Split:
    """Positions of training and test rows in a dataset."""

    train: Indices  # (m,), in random order
    test: Indices  # (k,)
    folds: Folds  # (m,), 0 to `FOLDS` - 1
    seed: int  # of the draw
    by_surface: bool  # False if all rows share one surface; never for tiles


def draw(
    dataset: Dataset,
    seed: int = 0,
    train_rows: int | None = None,
    *,
    others: Sequence[Dataset] = (),
) -> Split:
    """Split a dataset 80:20, and the training rows into folds, for all targets of the same rows.

    A target that few rows have, as the yielded share where most bodies are elastic, may be constant
    in a part. The draw is then repeated, `DRAWS` times at most. With groups of one row, the test
    set has exactly a fifth of the rows, rounded down: 3,175 of 15,878. With `train_rows`, training
    rows are the first of the draw. InputError is raised if there are too few rows, surfaces or
    tiles, or a target is constant in every draw of a part.
    """
    groups, by_surface = dataset.groups, True
    if np.ptp(groups) == 0:
        require_tiles(dataset, 2)
        groups, by_surface = np.arange(dataset.size), False
    random = np.random.default_rng(seed)
    faults = []
    for _ in range(DRAWS):
        train, test = _drawn(random, groups, dataset.size)
        train = train if train_rows is None else train[:train_rows]
        fault = _fault([dataset, *others], train, test, train_rows)
        if not fault:
            # Folds of about the same size that share no group, of rows sorted by group.
            starts = np.flatnonzero(np.diff(groups[train], prepend=-1))
            sizes = np.diff(starts, append=train.size)
            places = FOLDS * (starts + sizes / 2) / train.size
            folds = np.minimum(places, FOLDS - 1).astype(np.int8).repeat(sizes)
            return Split(train, test, folds, seed, by_surface)
        faults.append(fault)
    raise InputError(faults[0])


def _drawn(random: np.random.Generator, groups: Indices, rows: int) -> tuple[Indices, Indices]:
    """Draw the positions of training and test rows, each by whole groups in random order."""
    order = random.permutation(np.unique(groups))
    place = np.empty(order.size, dtype=np.int64)
    place[order] = np.arange(order.size)
    shuffled = np.argsort(place[groups], kind="stable")
    # The test rows are whole surfaces, up to a fifth of the rows, and one surface at least.
    ends = np.flatnonzero(np.diff(groups[shuffled], append=-1)) + 1
    last = np.searchsorted(ends, int(TEST_SHARE * rows), side="right") - 1
    cut = int(ends[max(int(last), 0)])
    return shuffled[cut:], shuffled[:cut]


def require_tiles(dataset: Dataset, wanted: int = TILES) -> None:
    """Refuse windows that lie in fewer tiles than a split needs."""
    tiles = np.unique(dataset.groups).size
    if dataset.by_tile and tiles < wanted:
        raise InputError(
            f"{dataset.name}: its windows lie in {tiles} of the maps' tiles,"
            f" {wanted} at least are needed, as no tile may train and test: give larger maps, or"
            " more of them"
        )


def _fault(sets: Sequence[Dataset], train: Indices, test: Indices, train_rows: int | None) -> str:
    """Say which part has too few rows, or a target that is constant; "" if none."""
    if train_rows is not None and train_rows < 2:
        return f"--train-rows {train_rows}: give 2 rows at least"
    for dataset in sets:
        for name, rows in (("training", train), ("test", test)):
            if rows.size < 2 or np.ptp(dataset.target[rows]) == 0:
                return (
                    f"{dataset.name}: {dataset.target_name} does not vary over the"
                    f" {rows.size} {name} rows drawn from {np.unique(dataset.groups).size}"
                    f" {'tiles' if dataset.by_tile else 'surfaces'}: more are needed"
                )
    return ""


def check_folds(dataset: Dataset, split: Split) -> None:
    """Refuse training rows of which a fold has fewer than two, or no target that varies."""
    sizes = np.bincount(split.folds, minlength=FOLDS)
    if sizes.min() < 2:
        raise InputError(
            f"{split.train.size} training rows in folds of {', '.join(map(str, sizes))}: a search"
            f" needs {FOLDS} folds of 2 rows at least, of different surfaces or tiles"
        )
    for fold in range(FOLDS):
        rows = dataset.target[split.train[split.folds == fold]]
        if np.ptp(rows) == 0:
            raise InputError(
                f"{dataset.name}: {dataset.target_name} is {rows[0]:g} in all"
                f" {rows.size} rows of a fold of the search: more rows are needed"
            )
