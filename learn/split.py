"""Groups of rows that belong together, and the split of rows for training and for tests.

All models of a comparison are trained and tested on one split. It never divides a group of rows, so
that no model is tested on a surface that it has seen. Rows are in one group if

- their surfaces have equal statistics, because these are one surface;
- their surfaces have one number and one seed, because these are made of the same random numbers,
  whatever their grid and generator;
- their surfaces are windows of one tile of a map, because these can share nodes. If two databases
  cut a map into different tiles, all windows of this map are one group.
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

# Column of databases of windows: number of the map from which a surface was cut.
MAP = "map"
# Column of databases of windows: number of the tile of the map from which a surface was cut.
TILE = "tile"
# Number of digits of a file's hash in the labels of maps, which tell maps of equal names apart.
DIGITS = 8
# Type of the number of the fold of each training row.
Folds = NDArray[np.int8]
# Largest number of draws of a split. A draw is repeated if a target is constant in a part.
DRAWS = 20
# Number of folds of the cross-validation, as in the paper.
FOLDS = 5
# Smallest number of tiles for a surrogate: one each to train, validate, calibrate and test.
TILES = 4
# Share of the rows that test, as in the paper.
TEST_SHARE = 0.2


@dataclass(frozen=True, eq=False)
class Split:
    """Positions of training and test rows in a dataset."""

    train: Indices  # (m,), positions in random order
    test: Indices  # (k,), positions
    folds: Folds  # (m,), fold of each training row, 0 to `FOLDS` - 1
    seed: int  # of the draw
    # False if all rows are of one surface; they are then split one by one
    by_surface: bool


def draw(
    dataset: Dataset,
    seed: int = 0,
    train_rows: int | None = None,
    *,
    further_targets: Sequence[Dataset] = (),
    tiles: int = 2,
) -> Split:
    """Draw a split of a dataset: a fifth of the rows to test, the others to train, in folds.

    No group of rows is divided. If each group is one row, exactly a fifth of the rows, rounded
    down, are test rows. The draw is repeated, up to `DRAWS` draws in all, if a target is constant
    over a part: the yielded share, for example, if no body of the part yields.

    Parameters
    ----------
    dataset : Dataset
        The rows with one target.
    seed : int
        Seed of the draw.
    train_rows : int, optional
        Largest number of training rows; further ones are left out. All are kept by default.
    further_targets : sequence of Dataset
        Datasets of equal rows with further targets, which have to vary, too.
    tiles : int
        Smallest number of tiles from which the rows must be, if they are windows of maps.

    Returns
    -------
    Split
        Training and test rows, in both of which every target varies.

    Raises
    ------
    InputError
        If `train_rows` is below 2, there are too few rows, surfaces or tiles, or a target is
        constant in a part of every draw.
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
    """Return the positions of all rows, (n,), group by group, with the groups in random order.

    Takes the number of the group of each row, (n,), and moves the state of the generator.
    """
    values, place = np.unique(groups, return_inverse=True)
    ranks = np.argsort(random.permutation(values.size))
    return np.argsort(ranks[place], kind="stable")


def _test_size(groups: Indices) -> int:
    """Return how many of the first rows are test rows.

    Takes the number of the group of each row, (n,), with the rows of a group in succession. The
    test rows are whole groups: at most a fifth of the rows, but at least one group.
    """
    # Numbers of rows up to the end of each group; no group has the number -1.
    ends = np.flatnonzero(np.diff(groups, append=-1)) + 1
    limit = int(TEST_SHARE * groups.size)
    groups_within = int(np.searchsorted(ends, limit, side="right"))
    last_group = max(groups_within - 1, 0)
    return int(ends[last_group])


def _constant_part(datasets: Sequence[Dataset], train: Indices, test: Indices) -> str:
    """Return a message on the first target that is constant over a part; "" if all targets vary.

    Over a part of fewer than two rows every target is constant. Takes a dataset for each target,
    and the positions of their training and test rows.
    """
    for dataset in datasets:
        kind = "surfaces"
        if dataset.by_tile:
            kind = "tiles"
        for name, part in (("training", train), ("test", test)):
            if part.size >= 2 and np.ptp(dataset.target[part]) > 0:
                continue
            groups = np.unique(dataset.groups).size
            return (
                f"{dataset.name}: {dataset.target_name} does not vary over the {part.size} {name}"
                f" rows drawn from {groups} {kind}: more are needed"
            )
    return ""


def _folds(groups: Indices) -> Folds:
    """Return the fold of each row, (m,); folds are of about equal size and share no group.

    Takes the number of the group of each row, (m,), with the rows of a group in succession.
    """
    # Position of the first row of each group; no group has the number -1.
    starts = np.flatnonzero(np.diff(groups, prepend=-1))
    sizes = np.diff(starts, append=groups.size)  # rows of each group
    # The middle of a group among all rows decides its fold.
    middles = starts + sizes / 2
    folds = (FOLDS * middles / groups.size).astype(np.int8)  # rounded down
    return folds.repeat(sizes)


def require_tiles(dataset: Dataset, required: int = TILES) -> None:
    """Refuse windows of maps if they are from fewer tiles than a split needs.

    Parameters
    ----------
    dataset : Dataset
        The rows. Rows that are not windows of maps are accepted.
    required : int
        Number of tiles that the split needs.

    Raises
    ------
    InputError
        If the windows are from fewer tiles.
    """
    tiles = np.unique(dataset.groups).size
    if dataset.by_tile and tiles < required:
        raise InputError(
            f"{dataset.name}: its windows lie in {tiles} of the maps' tiles,"
            f" {required} at least are needed, as no tile may have both training and test rows:"
            " give larger maps, or more of them"
        )


def check_folds(dataset: Dataset, split: Split) -> None:
    """Refuse a split with which a search cannot cross-validate.

    Parameters
    ----------
    dataset : Dataset
        The rows with one target.
    split : Split
        Their split.

    Raises
    ------
    InputError
        If a fold has fewer than two rows, or the target is constant over a fold.
    """
    sizes = np.bincount(split.folds, minlength=FOLDS)
    if sizes.min() < 2:
        raise InputError(
            f"{split.train.size} training rows in folds of {', '.join(map(str, sizes))}: a search"
            f" needs {FOLDS} folds of 2 rows at least, of different surfaces or tiles"
        )
    for fold in range(FOLDS):
        rows = split.train[split.folds == fold]
        target = dataset.target[rows]
        if np.ptp(target) == 0:
            raise InputError(
                f"{dataset.name}: {dataset.target_name} is {target[0]:g} in all"
                f" {target.size} rows of a fold of the search: more rows are needed"
            )


def dealt(labels: Indices, parts: int, random: np.random.Generator) -> Indices:
    """Deal groups of rows at random into parts of about equal numbers of groups.

    Parameters
    ----------
    labels : ndarray, shape (n,)
        Group of each row, any numbers.
    parts : int
        Number of parts.
    random : Generator
        Source of random numbers, whose state moves.

    Returns
    -------
    ndarray, shape (n,)
        Number of the part of each row, 0 to `parts` - 1.
    """
    groups, group_of_row = np.unique(labels, return_inverse=True)
    places = random.permutation(groups.size)
    return np.asarray(places[group_of_row] % parts)


def populations_of(part: Stored) -> list[str]:
    """Return the name of the population from which the surface of each row comes.

    Parameters
    ----------
    part : Stored
        n rows of a database.

    Returns
    -------
    list of str
        n names. The name of a window is that of its map, with the first digits of the file's hash;
        the name of any other surface is the path of the database.
    """
    surface = part.scene.surface
    if MAP not in part.columns or not isinstance(surface, ScanSurface):
        return [str(part.path)] * part.rows.size
    names = [
        f"{Path(recorded.file).name} {recorded.sha256[:DIGITS]}"
        for recorded in surface.recorded_maps().maps
    ]
    return [names[number] for number in part.columns[MAP]]


@dataclass(frozen=True, eq=False)
class Grouping:
    """Groups of the rows of a database: by seed and number of the surface, by tile, or by map.

    Rows of two databases are in one group if both `kind` and number are equal.
    """

    kind: tuple[str, object]  # ("seed", seed), ("tiles", tiling) or ("maps", None)
    numbers: Indices  # (n,), number of the group of each row


def surface_groups(parts: Sequence[Stored]) -> Indices:
    """Number the groups of rows that no split divides; the module's docstring defines them.

    Rows of one surface are recognised by their 22 statistics, which are equal to the last bit. The
    column `surface` would not do: it has different numbers for surfaces that are read from one
    file.

    Parameters
    ----------
    parts : sequence of Stored
        Rows of each database.

    Returns
    -------
    ndarray, shape (n,)
        Number of the group of each row, database by database.

    Raises
    ------
    InputError
        If two databases cut one map into different tiles, and one of them has a second rough body.
    """
    statistics = np.concatenate([part.described[:, 1:] for part in parts])
    # NaN is not equal to NaN. No statistic is minus infinity, which replaces it.
    comparable = np.where(np.isnan(statistics), -np.inf, statistics)
    surfaces = np.unique(comparable, axis=0, return_inverse=True)[1].ravel()
    if len(parts) == 1 and TILE not in parts[0].columns:
        # In one database, rows of one seed and number have equal statistics.
        return np.asarray(surfaces, dtype=np.int64)
    numbers_of_kinds: dict[object, int] = {}
    pairs = []  # for each database the kind and number of the group of each row, (n, 2)
    for part in parts:
        grouping = _grouping(part, parts)
        kind = numbers_of_kinds.setdefault(grouping.kind, len(numbers_of_kinds))
        kinds = np.full(grouping.numbers.size, kind)
        pairs.append(np.column_stack([kinds, grouping.numbers]))
    joint = np.concatenate(pairs)
    labels = np.unique(joint, axis=0, return_inverse=True)[1].ravel()
    return _linked(surfaces, labels)


def _grouping(part: Stored, parts: Sequence[Stored]) -> Grouping:
    """Return the groups of the rows of `part`, which is one of the databases `parts`.

    Surfaces that are no windows are grouped by seed and number. Windows are grouped by tile, or by
    map if another database cuts one of the maps into different tiles. Raises InputError in this
    last case if one of these databases has a second rough body.
    """
    scene = part.scene
    surface = scene.surface
    if TILE not in part.columns or not isinstance(surface, ScanSurface):
        numbers = part.rows // scene.samples_per_surface
        return Grouping(kind=("seed", scene.seed), numbers=numbers)
    hashes = _hashes(scene)
    # Further databases with windows of one of these maps.
    sharing = [
        database
        for database in parts
        if database is not part and hashes & _hashes(database.scene)
    ]
    tiling = _tiling(scene)
    if all(_tiling(database.scene) == tiling for database in sharing):
        return Grouping(kind=("tiles", tiling), numbers=part.columns[TILE])
    # A window of two bodies is from two maps, and would be in the groups of both.
    if any(database.scene.surface.against is not None for database in (part, *sharing)):
        raise InputError(
            f"{part.path}: has windows of maps of {sharing[0].path} in other tiles, and a second"
            " rough body: no split of both would keep their nodes apart"
        )
    maps = surface.recorded_maps().maps
    # 15 hexadecimal digits of the hash fit into 64 bits.
    numbers_of_maps = np.array([int(recorded.sha256[:15], 16) for recorded in maps])
    return Grouping(kind=("maps", None), numbers=numbers_of_maps[part.columns[MAP]])


def _tiling(scene: Scene) -> str:
    """Return as a text the keys and values of a scene that decide the tiles of its maps.

    Scenes with equal texts cut their maps into equal tiles.
    """
    content = scene.surface.model_dump(exclude_none=True)
    return str(sorted(scene.surface.relevant(content).items()))


def _hashes(scene: Scene) -> set[str]:
    """Return the hashes of all maps of a scene, of both bodies; empty for generated surfaces."""
    surface = scene.surface
    if not isinstance(surface, ScanSurface):
        return set()
    maps = list(surface.recorded_maps().maps)
    if surface.against_found:
        maps += surface.against_found.maps
    return {recorded.sha256 for recorded in maps}


def _linked(first: Indices, second: Indices) -> Indices:
    """Join rows that have equal first or equal second labels; return the group of each row, (n,).

    Rows are also joined if a chain of joined pairs of rows connects them. Labels, (n,) each, are
    numbers not below 0. Groups are numbered in the order of their first rows.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    # The nodes of the graph are the first labels and, numbered after them, the second labels. Each
    # row is an edge between its two labels.
    shift = int(first.max()) + 1
    size = shift + int(second.max()) + 1
    edges = (first, second + shift)
    graph = coo_array((np.ones(first.size), edges), shape=(size, size))
    component = connected_components(graph, directed=False)[1][first]
    _, first_row, place = np.unique(component, return_index=True, return_inverse=True)
    ranks = np.argsort(np.argsort(first_row))  # rank of each component by its first row
    return np.asarray(ranks[place.ravel()], dtype=np.int64)
