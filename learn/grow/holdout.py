"""The holdout of a growth: a fixed random fifth of the surfaces, or of the maps' tiles.

Of every five successive surfaces one is drawn, and its rows never train. Whether a row is in the
holdout depends on the scene and its number alone, not on the size of the database. Surfaces that
repeat an earlier one follow that one.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gen.database import Reader
from gen.runtime.errors import InputError
from gen.scene import ScanSurface, Scene
from learn.arrays import Indices
from learn.columns import TILE
from learn.dataset import Dataset
from learn.split import FOLDS, Split

SHARE = 5
"""One of this many surfaces, or tiles, is in the holdout."""

KEY = 20_260
"""Key of the draw's stream of random numbers, which belongs to no other part of a scene."""


def drawn(numbers: Indices, seed: int, among: int = SHARE) -> NDArray[np.bool_]:
    """Tell which surfaces or tiles are in the holdout.

    Parameters
    ----------
    numbers : ndarray of int, shape (n,)
        Numbers of surfaces or tiles.
    seed : int
        Seed of the scene.
    among : int
        One of this many successive numbers is drawn.

    Returns
    -------
    ndarray of bool, shape (n,)
        A function of each number and the seed alone.
    """
    values, places = np.unique(numbers, return_inverse=True)
    chosen = [
        int(_random(seed, int(value) // among).integers(among)) == int(value) % among
        for value in values
    ]
    return np.array(chosen, dtype=bool)[places.ravel()]


def _random(seed: int, block: int) -> np.random.Generator:
    """Return the stream of one block of successive numbers."""
    return np.random.Generator(
        np.random.PCG64(np.random.SeedSequence(seed, spawn_key=(KEY, block, KEY)))
    )


def split_holdout(rows: Dataset) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Tell which rows test, and which may train.

    Parameters
    ----------
    rows : Dataset
        The usable rows of a whole database.

    Returns
    -------
    test, train : ndarray of bool, shape (n,)
        No group has rows in both. A row is in neither if it could train but shares its group with
        rows that test, as windows of two tiles do that are equal to the last bit.
    """
    scene = Scene.from_text(rows.source["scene"])
    if rows.by_tile:
        test = drawn(_tiles(rows), scene.seed, min(SHARE, _groups_of_tiles(scene)))
    elif np.ptp(rows.groups) == 0:  # one surface under many loads: its rows are drawn one by one
        test = drawn(rows.rows, scene.seed)
        return test, ~test
    else:
        surfaces = rows.rows // scene.samples_per_surface
        _, first, place = np.unique(rows.groups, return_index=True, return_inverse=True)
        test = drawn(surfaces[first], scene.seed)[place.ravel()]
    tested = np.unique(rows.groups[test])
    return test, ~np.isin(rows.groups, tested)


def _tiles(rows: Dataset) -> Indices:
    """Return the tile of each row."""
    with Reader(Path(rows.source["database"])) as reader:
        tiles = reader.column(TILE)
    return np.asarray(tiles[rows.rows], dtype=np.int64)


def _groups_of_tiles(scene: Scene) -> int:
    """Return the number of different values that the column of tiles can have."""
    assert isinstance(scene.surface, ScanSurface)
    return scene.surface.tile_groups()


def parted(sets: list[Dataset], seed: int) -> Split:
    """Divide the rows of a growing database into training rows, with their folds, and test rows.

    Parameters
    ----------
    sets : list of Dataset
        The same rows for each target.
    seed : int
        Seed of the order of the training rows.

    Returns
    -------
    Split
        Training rows in random order, groups together, and the rows of the holdout.

    Raises
    ------
    InputError
        If there are too few rows in a part, or a target does not vary there.
    """
    rows = sets[0]
    test, train = (np.flatnonzero(each) for each in split_holdout(rows))
    for each in sets:
        for name, part in (("training", train), ("test", test)):
            if part.size < 2 or np.ptp(each.target[part]) == 0:
                raise InputError(
                    f"{rows.source['database']}: {each.target_name} does not vary over the"
                    f" {part.size} {name} rows of {rows.size}: more are needed"
                )
    by_surface = rows.by_tile or bool(np.ptp(rows.groups) > 0)
    labels = rows.groups[train] if by_surface else rows.rows[train]
    groups = np.unique(labels)
    order = np.random.default_rng(seed).permutation(groups.size)
    place = order[np.searchsorted(groups, labels)]
    shuffled = np.argsort(place, kind="stable")
    folds = (place[shuffled] * FOLDS // groups.size).astype(np.int8)
    return Split(train[shuffled], test, folds, seed, by_surface)
