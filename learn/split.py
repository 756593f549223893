"""Which rows belong together, and how they are split, the same for all models.

Rows of one surface are never on both sides of a split, whichever databases they are in, so that no
model is tested on a surface that it has seen. Related are surfaces with the same statistics,
surfaces of one number and one seed, whatever their grid and generator (they are made of the same
random numbers), and windows of one tile of a map, which can share nodes; where two databases cut a
map into other tiles, all windows of that map.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Indices
from gen.generators.scans import ScanSurface
from gen.runtime.errors import InputError
from gen.scene import Scene

if TYPE_CHECKING:
    from learn.dataset import Dataset, Stored

MAP, TILE = (
    "map",
    "tile",
)  # columns of the map and of its tile that a surface was cut out of
DIGITS = (
    8  # digits of a file's hash in the labels of maps, so that maps of one name differ
)
Folds = NDArray[np.int8]  # fold of each training row
DRAWS = 20  # draws of a split at most, where a target is constant in a part
FOLDS = 5  # folds of the cross-validation, the paper's number
TILES = 4  # least number of tiles of a surrogate: to train, validate, calibrate and test
TEST_SHARE = 0.2  # share of the rows that test, the paper's number


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
    tiles: int = 2,
) -> Split:
    """Split a dataset 80:20, and the training rows into folds, for all targets of the same rows.

    A target that few rows have, as the yielded share where most bodies are elastic, may be constant
    in a part. The draw is then repeated, `DRAWS` times at most. With groups of one row, the test
    set has exactly a fifth of the rows, rounded down: 3,175 of 15,878. With `train_rows`, training
    rows are the first of the draw. InputError is raised if there are too few rows, surfaces or
    `tiles` of maps, or a target is constant in every draw of a part.
    """
    if train_rows is not None and train_rows < 2:
        raise InputError(f"--train-rows {train_rows}: give 2 rows at least")
    if dataset.by_tile:
        require_tiles(dataset, tiles)
    by_surface, groups = bool(np.ptp(dataset.groups) > 0), dataset.surfaces
    values, place = np.unique(groups, return_inverse=True)
    random, faults = np.random.default_rng(seed), []
    for _ in range(DRAWS):
        shuffled = np.argsort(
            np.argsort(random.permutation(values.size))[place], kind="stable"
        )
        # The test rows are whole surfaces, up to a fifth of the rows, and one surface at least.
        ends = np.flatnonzero(np.diff(groups[shuffled], append=-1)) + 1
        last = np.searchsorted(ends, int(TEST_SHARE * dataset.size), side="right") - 1
        cut = int(ends[max(int(last), 0)])
        train, test = shuffled[cut:][:train_rows], shuffled[:cut]
        fault = [
            f"{each.name}: {each.target_name} does not vary over the {part.size} {name} rows drawn"
            f" from {np.unique(each.groups).size} {'tiles' if each.by_tile else 'surfaces'}:"
            " more are needed"
            for each in (dataset, *others)
            for name, part in (("training", train), ("test", test))
            if part.size < 2 or np.ptp(each.target[part]) == 0
        ]
        if not fault:
            # Folds of about the same size that share no group, of rows sorted by group.
            starts = np.flatnonzero(np.diff(groups[train], prepend=-1))
            sizes = np.diff(starts, append=train.size)
            places = FOLDS * (starts + sizes / 2) / train.size
            folds = np.minimum(places, FOLDS - 1).astype(np.int8).repeat(sizes)
            return Split(train, test, folds, seed, by_surface)
        faults += fault
    raise InputError(faults[0])


def require_tiles(dataset: Dataset, wanted: int = TILES) -> None:
    """Refuse windows that lie in fewer tiles than a split needs."""
    tiles = np.unique(dataset.groups).size
    if dataset.by_tile and tiles < wanted:
        raise InputError(
            f"{dataset.name}: its windows lie in {tiles} of the maps' tiles,"
            f" {wanted} at least are needed, as no tile may train and test: give larger maps, or"
            " more of them"
        )


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


def dealt(labels: Indices, parts: int, random: np.random.Generator) -> Indices:
    """Deal groups, by the labels of their rows, (n,), at random into parts of about one size."""
    values, place = np.unique(labels, return_inverse=True)
    return np.asarray(random.permutation(values.size)[place] % parts)


def populations_of(part: Stored) -> Iterator[str]:
    """Yield where the surface of each row is from: its map, or the database if there is none."""
    surface = part.scene.surface
    if MAP not in part.columns or not isinstance(surface, ScanSurface):
        yield from [str(part.path)] * part.rows.size
        return
    maps = [
        f"{Path(each.file).name} {each.sha256[:DIGITS]}"
        for each in surface.recorded_maps().maps
    ]
    yield from (maps[index] for index in part.columns[MAP])


def related(parts: Sequence[Stored]) -> Indices:
    """Number the groups of rows that every split keeps together, (n,), database by database.

    Rows of one surface have its 22 statistics in common, bit for bit; the column `surface` does not
    tell, where all surfaces are read from one file.
    """
    statistics = np.concatenate([part.inputs[:, 1:] for part in parts])
    # No statistic is minus infinity, which stands for NaN: that differs from itself.
    defined = np.where(np.isnan(statistics), -np.inf, statistics)
    surfaces = np.unique(defined, axis=0, return_inverse=True)[1].ravel()
    if len(parts) == 1 and TILE not in parts[0].columns:
        return np.asarray(surfaces, dtype=np.int64)
    kinds: dict[object, int] = {}
    pairs = []
    for part in parts:
        kind, numbers = _alike(part, parts)
        same = np.full(numbers.size, kinds.setdefault(kind, len(kinds)))
        pairs.append(np.column_stack([same, numbers]))
    labels = np.unique(np.concatenate(pairs), axis=0, return_inverse=True)[1].ravel()
    return _linked(surfaces, labels)


def _alike(part: Stored, parts: Sequence[Stored]) -> tuple[object, Indices]:
    """Return the kind of a database's groups, and the group of each row, (n,).

    Surfaces are of the random numbers that made them; windows of their tiles, or of their maps
    where another database has other tiles of these.
    """
    surface = part.scene.surface
    if TILE not in part.columns or not isinstance(surface, ScanSurface):
        return ("seed", part.scene.seed), part.rows // part.scene.samples_per_surface
    own, tiling = _hashes(part.scene), _tiling(part.scene)
    others = [each for each in parts if each is not part and own & _hashes(each.scene)]
    if all(_tiling(other.scene) == tiling for other in others):
        return ("tiles", tiling), part.columns[TILE]
    if any(each.scene.surface.against is not None for each in (part, *others)):
        raise InputError(
            f"{part.path}: has windows of maps of {others[0].path} in other tiles, and a second"
            " rough body: no split of both would keep their nodes apart"
        )
    numbers = np.array(
        [int(each.sha256[:15], 16) for each in surface.recorded_maps().maps]
    )
    return "maps", numbers[part.columns[MAP]]


def _tiling(scene: Scene) -> str:
    """Return the table of surfaces of a scene, which decides the tiles of its maps."""
    content = scene.surface.model_dump(exclude_none=True)
    return str(sorted(scene.surface.relevant(content).items()))


def _hashes(scene: Scene) -> set[str]:
    """Return the hashes of a scene's maps."""
    surface = scene.surface
    if not isinstance(surface, ScanSurface):
        return set()
    found = [surface.recorded_maps(), *filter(None, (surface.against_found,))]
    return {each.sha256 for maps in found for each in maps.maps}


def _linked(first: Indices, second: Indices) -> Indices:
    """Number the groups, (n,), of rows that share one of two labels, directly or by other rows.

    Groups are numbered in the order of their first rows, labels from 0 on.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    size = int(first.max()) + 1 + int(second.max()) + 1
    ends = first, second + int(first.max()) + 1
    graph = coo_array((np.ones(first.size), ends), shape=(size, size))
    component = connected_components(graph, directed=False)[1][first]
    _, start, place = np.unique(component, return_index=True, return_inverse=True)
    return np.asarray(np.argsort(np.argsort(start))[place.ravel()], dtype=np.int64)
