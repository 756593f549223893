"""Which rows belong together, and how they are split, the same for all models.

Rows of one surface are never on both sides of a split, whichever databases they are in, so that no
model is tested on a surface that it has seen. Three kinds of surfaces count as one: surfaces with
the same statistics; surfaces of one number and one seed, whatever their grid and generator, because
they are made of the same random numbers; and windows of one tile of a map, which can share nodes.
Where two databases cut a map into different tiles, all windows of that map belong together.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Indices
from gen.generators.scans import ScanSurface
from gen.runtime.errors import InputError
from gen.scene import Scene
from learn.database_rows import Dataset, Stored

MAP = "map"  # column of the map that a surface was cut out of
TILE = "tile"  # column of the tile of that map
# digits of a file's hash in the labels of maps, so that maps of one name differ
DIGITS = 8
Folds = NDArray[np.int8]  # fold of each training row
DRAWS = 20  # largest number of draws of a split, where a target is constant in a part
FOLDS = 5  # folds of the cross-validation, the paper's number
TILES = 4  # tiles that a surrogate needs: to train, validate, calibrate and test
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
    further_targets: Sequence[Dataset] = (),
    tiles: int = 2,
) -> Split:
    """Split a dataset 80:20, and the training rows into folds, for all targets of the same rows.

    A target that few rows have, as the yielded share where most bodies are elastic, may be constant
    in a part. The draw is then repeated, `DRAWS` times at most. With groups of one row, the test
    set has exactly a fifth of the rows, rounded down: 3,175 of 15,878.

    Parameters
    ----------
    dataset : Dataset
        The rows with one target.
    seed : int
        Seed of the draw.
    train_rows : int, optional
        Largest number of training rows, which are the first of the draw; all if left out.
    further_targets : sequence of Dataset
        The same rows with further targets.
    tiles : int
        Number of tiles of maps that the rows have to lie in, if they are windows of maps.

    Returns
    -------
    Split
        Training and test rows, in which every target varies.

    Raises
    ------
    InputError
        If there are too few rows, surfaces or tiles, or a target is constant in a part of every
        draw.
    """
    if train_rows is not None and train_rows < 2:
        raise InputError(f"--train-rows {train_rows}: give 2 rows at least")
    if dataset.by_tile:
        require_tiles(dataset, tiles)
    groups = dataset.surfaces
    random = np.random.default_rng(seed)
    first_fault = ""
    for _ in range(DRAWS):
        shuffled = _shuffled(groups, random)
        cut = _test_size(groups[shuffled])
        train = shuffled[cut:][:train_rows]
        test = shuffled[:cut]
        fault = _constant_part((dataset, *further_targets), train, test)
        if not fault:
            return Split(
                train=train,
                test=test,
                folds=_folds(groups[train]),
                seed=seed,
                by_surface=bool(np.ptp(dataset.groups) > 0),
            )
        first_fault = first_fault or fault
    raise InputError(first_fault)


def _shuffled(groups: Indices, random: np.random.Generator) -> Indices:
    """Return positions of all rows, (n,), group by group, with the groups in random order."""
    values, place = np.unique(groups, return_inverse=True)
    ranks = np.argsort(random.permutation(values.size))
    return np.argsort(ranks[place], kind="stable")


def _test_size(groups: Indices) -> int:
    """Return how many of the first rows test, of rows that are sorted by group.

    They are whole groups, a fifth of the rows at most, but one group at least.
    """
    ends = np.flatnonzero(np.diff(groups, append=-1)) + 1
    limit = int(TEST_SHARE * groups.size)
    inside = int(np.searchsorted(ends, limit, side="right"))
    last = max(inside - 1, 0)
    return int(ends[last])


def _constant_part(datasets: Sequence[Dataset], train: Indices, test: Indices) -> str:
    """Say which target does not vary over the training or the test rows; "" if all do."""
    for dataset in datasets:
        for name, part in (("training", train), ("test", test)):
            if part.size >= 2 and np.ptp(dataset.target[part]) > 0:
                continue
            groups = np.unique(dataset.groups).size
            kind = "tiles" if dataset.by_tile else "surfaces"
            return (
                f"{dataset.name}: {dataset.target_name} does not vary over the {part.size} {name}"
                f" rows drawn from {groups} {kind}: more are needed"
            )
    return ""


def _folds(groups: Indices) -> Folds:
    """Return folds of about the same size that share no group, of rows sorted by group, (m,)."""
    starts = np.flatnonzero(np.diff(groups, prepend=-1))
    sizes = np.diff(starts, append=groups.size)
    middles = starts + sizes / 2
    folds = np.minimum(FOLDS * middles / groups.size, FOLDS - 1)
    return folds.astype(np.int8).repeat(sizes)


def require_tiles(dataset: Dataset, required: int = TILES) -> None:
    """Refuse windows of maps that lie in fewer tiles than a split needs.

    Parameters
    ----------
    dataset : Dataset
        The rows; those that are no windows of maps are never refused.
    required : int
        Number of tiles that the split needs.

    Raises
    ------
    InputError
        If the windows lie in fewer tiles.
    """
    tiles = np.unique(dataset.groups).size
    if dataset.by_tile and tiles < required:
        raise InputError(
            f"{dataset.name}: its windows lie in {tiles} of the maps' tiles,"
            f" {required} at least are needed, as no tile may train and test: give larger maps, or"
            " more of them"
        )


def check_folds(dataset: Dataset, split: Split) -> None:
    """Refuse a split of whose folds one has fewer than two rows, or a target that is constant.

    Parameters
    ----------
    dataset : Dataset
        The rows.
    split : Split
        Their split.

    Raises
    ------
    InputError
        If a fold cannot be used for a search.
    """
    sizes = np.bincount(split.folds, minlength=FOLDS)
    if sizes.min() < 2:
        raise InputError(
            f"{split.train.size} training rows in folds of {', '.join(map(str, sizes))}: a search"
            f" needs {FOLDS} folds of 2 rows at least, of different surfaces or tiles"
        )
    for fold in range(FOLDS):
        target = dataset.target[split.train[split.folds == fold]]
        if np.ptp(target) == 0:
            raise InputError(
                f"{dataset.name}: {dataset.target_name} is {target[0]:g} in all"
                f" {target.size} rows of a fold of the search: more rows are needed"
            )


def dealt(labels: Indices, parts: int, random: np.random.Generator) -> Indices:
    """Deal groups of rows at random into parts of about the same number of groups.

    Parameters
    ----------
    labels : ndarray, shape (n,)
        Group of each row.
    parts : int
        Number of parts.
    random : Generator
        Source of random numbers, whose state moves on.

    Returns
    -------
    ndarray, shape (n,)
        Part of each row, from 0 on.
    """
    values, place = np.unique(labels, return_inverse=True)
    return np.asarray(random.permutation(values.size)[place] % parts)


def populations_of(part: Stored) -> list[str]:
    """Return the population that the surface of each row is from.

    Parameters
    ----------
    part : Stored
        n rows of a database.

    Returns
    -------
    list of str
        For each row the name of its map with the beginning of the file's hash, or the path of the
        database if its surfaces are from no map.
    """
    surface = part.scene.surface
    if MAP not in part.columns or not isinstance(surface, ScanSurface):
        return [str(part.path)] * part.rows.size
    maps = [
        f"{Path(recorded.file).name} {recorded.sha256[:DIGITS]}"
        for recorded in surface.recorded_maps().maps
    ]
    return [maps[number] for number in part.columns[MAP]]


@dataclass(frozen=True, eq=False)
class Grouping:
    """Groups of the rows of a database, beside those of the same statistics."""

    kind: tuple[str, object]  # groups of databases are the same if kind and number agree
    numbers: Indices  # (n,), group of each row


def surface_groups(parts: Sequence[Stored]) -> Indices:
    """Number the groups of rows that every split keeps together.

    Rows of one surface have its 22 statistics in common, bit for bit. The column `surface` does not
    tell, where all surfaces are read from one file.

    Parameters
    ----------
    parts : sequence of Stored
        Rows of each database.

    Returns
    -------
    ndarray, shape (n,)
        Group of each row, database by database.

    Raises
    ------
    InputError
        If two databases cut the same maps into different tiles, and have a second rough body.
    """
    statistics = np.concatenate([part.described[:, 1:] for part in parts])
    # NaN differs from itself. Minus infinity stands for it, which no statistic is.
    defined = np.where(np.isnan(statistics), -np.inf, statistics)
    surfaces = np.unique(defined, axis=0, return_inverse=True)[1].ravel()
    if len(parts) == 1 and TILE not in parts[0].columns:
        return np.asarray(surfaces, dtype=np.int64)
    numbers_of_kinds: dict[object, int] = {}
    pairs = []
    for part in parts:
        grouping = _grouping(part, parts)
        kind = numbers_of_kinds.setdefault(grouping.kind, len(numbers_of_kinds))
        kinds = np.full(grouping.numbers.size, kind)
        pairs.append(np.column_stack([kinds, grouping.numbers]))
    labels = np.unique(np.concatenate(pairs), axis=0, return_inverse=True)[1].ravel()
    return _linked(surfaces, labels)


def _grouping(part: Stored, parts: Sequence[Stored]) -> Grouping:
    """Return the groups of a database among all databases.

    Rows belong together if the same random numbers made their surfaces. Windows of maps do if they
    are of one tile, or of one map where another database has different tiles of these maps.
    """
    scene = part.scene
    surface = scene.surface
    if TILE not in part.columns or not isinstance(surface, ScanSurface):
        numbers = part.rows // scene.samples_per_surface
        return Grouping(("seed", scene.seed), numbers)
    hashes = _hashes(scene)
    sharing = [
        other for other in parts if other is not part and hashes & _hashes(other.scene)
    ]
    tiling = _tiling(scene)
    if all(_tiling(other.scene) == tiling for other in sharing):
        return Grouping(("tiles", tiling), part.columns[TILE])
    if any(other.scene.surface.against is not None for other in (part, *sharing)):
        raise InputError(
            f"{part.path}: has windows of maps of {sharing[0].path} in other tiles, and a second"
            " rough body: no split of both would keep their nodes apart"
        )
    maps = surface.recorded_maps().maps
    numbers_of_maps = np.array([int(recorded.sha256[:15], 16) for recorded in maps])
    return Grouping(("maps", None), numbers_of_maps[part.columns[MAP]])


def _tiling(scene: Scene) -> str:
    """Return the table of surfaces of a scene, which decides the tiles of its maps, as a text."""
    content = scene.surface.model_dump(exclude_none=True)
    return str(sorted(scene.surface.relevant(content).items()))


def _hashes(scene: Scene) -> set[str]:
    """Return the hashes of a scene's maps, with those of its second bodies."""
    surface = scene.surface
    if not isinstance(surface, ScanSurface):
        return set()
    maps = list(surface.recorded_maps().maps)
    if surface.against_found:
        maps += surface.against_found.maps
    return {recorded.sha256 for recorded in maps}


def _linked(first: Indices, second: Indices) -> Indices:
    """Number the groups, (n,), of rows that share one of two labels, directly or by other rows.

    Groups are numbered in the order of their first rows. Both labels, (n,), are numbers from 0 on.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    # The nodes of the graph are the first labels and, numbered after them, the second ones.
    shift = int(first.max()) + 1
    size = shift + int(second.max()) + 1
    edges = (first, second + shift)
    graph = coo_array((np.ones(first.size), edges), shape=(size, size))
    component = connected_components(graph, directed=False)[1][first]
    _, start, place = np.unique(component, return_index=True, return_inverse=True)
    return np.asarray(np.argsort(np.argsort(start))[place.ravel()], dtype=np.int64)
