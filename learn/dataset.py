"""Read inputs and targets from databases, and leave out the rows that cannot be used."""

import hashlib
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Indices, Values
from gen.runtime.errors import InputError
from learn import stored as pooling
from learn.executor import Executor
from learn.features import FeatureSet, chosen
from learn.features.sets import (
    BLOCKS,
    build,
    features_of,
    limits_of,
    modulus,
    node_count,
    target_scale,
)
from learn.metrics import usual_size
from learn.stored import Origin, Population, Stored, read_stored, reasons_against


@dataclass(frozen=True)
class Request:
    """A comparison or a fit to be made.

    Attributes
    ----------
    database : Path
        A database made by `gen`.
    output : Path
        The comparison folder, or the file of the surrogate.
    targets : tuple of str
        Names of targets: any of "area", "force" or further columns.
    models : tuple of str
        Names of models; all nine if there are none.
    area_max : float or None
        Largest area that is kept [%], None for all.
    normalisation : str
        One of `learn.models.NORMALISATIONS`.
    features : str
        A name of `learn.features.SETS`.
    seed : int
        Seed of the split and of the models.
    train_rows : int or None
        Number of training rows at most, None for all.
    again : bool
        True to repeat fits whose results the folder has.
    limit : float or None
        Time for the searches [s], None for whole grids.
    roots : bool
        True to learn square roots of areas, with the features that surrogates see
        (`learn.features.FeatureSet.with_roots`).
    blocks : int
        Blocks per side of the coarse solve of hybrid features, one of
        `learn.features.sets.BLOCK_COUNTS`.
    calibrate_on : Path or None
        Database whose rows calibrate the intervals; None for rows of the first ones.
    others : tuple of Path
        Further databases, whose rows are learnt together with those of the first.
    """

    database: Path
    output: Path
    targets: tuple[str, ...] = ("area",)
    models: tuple[str, ...] = ()
    area_max: float | None = None
    normalisation: str = "l2"
    features: str = "paper"
    seed: int = 0
    train_rows: int | None = None
    again: bool = False
    limit: float | None = None
    roots: bool = False
    blocks: int = BLOCKS
    calibrate_on: Path | None = None
    others: tuple[Path, ...] = ()

    @property
    def databases(self) -> tuple[Path, ...]:
        """All databases."""
        return (self.database, *self.others)


def hybrid_for(
    request: Request, executor: Executor, stopping: Callable[[], bool] = lambda: False
) -> Values | None:
    """Return the columns that the database's surfaces add, (rows, 17); None if none are asked for.

    See `learn.features.regeneration.hybrid_rows`, which takes the other arguments.
    """
    wanted = chosen(request.features, roots=request.roots, blocks=request.blocks)
    if not wanted.needs_surface:
        return None
    from learn.features.regeneration import hybrid_rows

    return hybrid_rows(request.database, executor, stopping, wanted.solved_blocks)


SMALLEST = 10
"""Usable rows at least: two of these are for testing, and a score needs two."""

MOST_ROWS = 2**40
"""More rows than a scene can have."""

DOMINANT = 1e6
"""Ratio of one input to all others together beyond which rows of unit length carry no others: they
fall below the single precision in which trees see their inputs."""


@dataclass(frozen=True, eq=False)
class Dataset:
    """The usable rows of a database, or of several.

    Attributes
    ----------
    inputs : ndarray, shape (n, d)
        Inputs, in the units of `gen.schema`.
    target : ndarray, shape (n,)
        The quantity to predict, in the unit of its column over `scale`.
    rows : ndarray, shape (n,)
        Row of each sample in its database.
    groups : ndarray, shape (n,)
        Number of the surface of each sample; samples of one surface share it. Where surfaces are
        windows of maps, all samples of one tile share it.
    database : ndarray, shape (n,)
        Number of each sample's database in `origins`.
    population : ndarray, shape (n,)
        Number of each sample's population in `populations`: its database, generator and map.
    names : tuple of str
        Columns of the d inputs.
    target_name : str
        Column of the target.
    unit : str
        Unit of the target, "1" if it was made free of units.
    dropped : dict
        Number of rows left out, by reason.
    source : dict
        Origin of the rows, which is recorded beside all results.
    described : ndarray, shape (n, 23)
        Delta and the 22 statistics, independent of the feature set, in um; NaN for statistics that
        the features do not need and the surface does not define.
    scale : ndarray, shape (n,)
        Divisor of the target, 1 unless the features are free of units.
    features : str
        Name of the feature set.
    by_tile : bool
        True if the groups are tiles of maps, which no split may divide.
    origins : tuple of Origin
        The databases.
    populations : tuple of Population
        The populations.
    """

    inputs: Values
    target: Values
    rows: Indices
    groups: Indices
    database: Indices
    population: Indices
    names: tuple[str, ...]
    target_name: str
    unit: str
    dropped: dict[str, int]
    source: dict[str, str]
    described: Values
    scale: Values
    features: str = "paper"
    by_tile: bool = False
    origins: tuple[Origin, ...] = ()
    populations: tuple[Population, ...] = ()

    @property
    def size(self) -> int:
        """Number of usable rows."""
        return self.target.size

    @property
    def keys(self) -> Indices:
        """Number of each sample, (n,), that no other sample of the databases has."""
        return self.database * MOST_ROWS + self.rows

    def keeping(self, names: tuple[str, ...]) -> "Dataset":
        """Return the same rows with the inputs of some columns only, in their order."""
        columns = [self.names.index(name) for name in names]
        return replace(self, inputs=self.inputs[:, columns], names=names)

    def at(self, positions: Indices) -> "Dataset":
        """Return the rows at some positions, (k,), in their order; groups are numbered anew."""
        _, groups = np.unique(self.groups[positions], return_inverse=True)
        return replace(
            self,
            inputs=self.inputs[positions],
            target=self.target[positions],
            rows=self.rows[positions],
            groups=groups,
            database=self.database[positions],
            population=self.population[positions],
            described=self.described[positions],
            scale=self.scale[positions],
        )


def read(
    path: Path,
    target: str = "area",
    area_max: float | None = None,
    features: str = "paper",
    hybrid: Values | None = None,
    *,
    roots: bool = False,
    blocks: int = BLOCKS,
) -> Dataset:
    """Read one database for one target; see `read_together`."""
    (rows,) = read_together(
        (path,), (target,), area_max, features, (hybrid,), roots=roots, blocks=blocks
    )
    return rows


def read_together(
    paths: Sequence[Path],
    targets: Sequence[str],
    area_max: float | None = None,
    features: str = "paper",
    hybrids: Sequence[Values | None] = (None,),
    *,
    roots: bool = False,
    blocks: int = BLOCKS,
) -> list[Dataset]:
    """Read databases once, and clean their rows for each of several targets.

    Parameters
    ----------
    paths : sequence of Path
        Databases made by `gen`. The number of nodes becomes a feature if it differs.
    targets : sequence of str
        Any of "area", "force", and the columns of other results that the databases store: those of
        floating numbers, among them the user's own outputs, and `WHOLE_TARGETS`.
    area_max : float, optional
        Largest area that is kept [%]; 16.56 is the paper's range.
    features : str
        A name of `learn.features.SETS`. If it is free of units, so are the targets.
    hybrids : sequence of ndarray, each of shape (rows of the database, 17), or None
        For each database, the columns that its surfaces add to hybrid features, from
        `learn.features.regeneration`.
    roots : bool
        True for the features that surrogates see (`learn.features.FeatureSet.with_roots`).
    blocks : int
        Blocks per side of their coarse solve; those of `hybrids`.

    Returns
    -------
    list of Dataset
        The usable rows for each target.

    Raises
    ------
    InputError
        If a file is no database or lacks a target, databases cannot be learnt together, too few
        rows are left, or a target is constant.
    """
    scaled = chosen(features).scaled
    if area_max is not None and not area_max > 0:
        raise InputError(f"--area-max {area_max:g}: give a percentage above 0")
    pooling.require_different(paths)
    stored = [read_stored(path, targets) for path in paths]
    pooling.require_compatible([(each.path, each.scene) for each in stored], scaled=scaled)
    wanted = features_of([each.scene for each in stored], features, roots=roots, blocks=blocks)
    parts = [
        (each, _features(wanted, each, hybrid))
        for each, hybrid in zip(stored, hybrids, strict=True)
    ]
    return [
        _together([_usable(each, values, number, wanted, area_max) for each, values in parts])
        for number in range(len(targets))
    ]


def _usable(
    stored: Stored, made: Values, number: int, wanted: FeatureSet, area_max: float | None
) -> tuple[Dataset, pooling.Placed]:
    """Keep the rows that can be used for one target, by its number; groups are not known yet."""
    inputs, (column, values) = stored.inputs, stored.targets[number]
    reasons = reasons_against(stored, values)
    if area_max is not None:
        reasons[(reasons == "") & (stored.area > area_max)] = f"area above {area_max:g} %"
    _exclude_without_features(reasons, stored, wanted, made)
    kept = np.flatnonzero(reasons == "")
    scene, described = stored.scene, inputs[kept]
    hardness = () if stored.hardness is None else (stored.hardness,)
    statistics, delta = described[:, 1:], described[:, 0]
    scale = target_scale(wanted, column.name, statistics, delta, stored.length, modulus(scene))
    digest = _digest(stored.status, inputs, values, stored.area, *hardness)
    unknown = np.zeros(kept.size, dtype=np.int64)
    rows = Dataset(
        inputs=made[kept],
        target=values[kept] / scale,
        rows=stored.first + kept,
        groups=unknown,
        database=unknown,
        population=unknown,
        names=wanted.columns,
        target_name=column.name,
        unit=column.unit if (scale == 1).all() else "1",
        dropped={why: count for why, count in sorted(Counter(reasons).items()) if why},
        source={
            "database": str(stored.path),
            "database_sha256": digest,
            "scene": scene.text(),
            "versions": stored.versions,
        },
        described=described,
        scale=scale,
        features=wanted.name,
        by_tile=stored.tile is not None,
        origins=(Origin(str(stored.path), digest, scene.text(), kept.size),),
    )
    map_, tile = (None if each is None else each[kept] for each in (stored.map, stored.tile))
    return rows, pooling.Placed(stored.path, scene, rows.rows, statistics, map_, tile)


def _together(parts: Sequence[tuple[Dataset, pooling.Placed]]) -> Dataset:
    """Join the usable rows of databases, and find the groups that every split keeps together."""
    sets, placed = [rows for rows, _ in parts], [place for _, place in parts]
    population, populations = pooling.populations(placed)
    whole = joined(sets) if len(sets) > 1 else sets[0]
    require_usable(whole)
    return replace(
        whole,
        groups=pooling.related(placed),
        database=np.repeat(np.arange(len(sets)), [rows.size for rows in sets]),
        population=population,
        populations=populations,
        by_tile=all(rows.by_tile for rows in sets),
    )


def joined(sets: Sequence[Dataset]) -> Dataset:
    """Return the rows of several datasets with the same inputs and target as one, in their order.

    Groups and populations keep their numbers.
    """
    first = sets[0]
    arrays: dict[str, Any] = {
        name: np.concatenate([getattr(rows, name) for rows in sets])
        for name, value in vars(first).items()
        if isinstance(value, np.ndarray)
    }
    dropped: Counter[str] = Counter()
    for rows in sets:
        dropped.update(rows.dropped)
    origins = tuple(origin for rows in sets for origin in rows.origins)
    digests = "".join(origin.sha256 for origin in origins)
    source = first.source | {
        "database": ", ".join(origin.database for origin in origins),
        "database_sha256": hashlib.sha256(digests.encode()).hexdigest(),
    }
    unit = first.unit if all(rows.unit == first.unit for rows in sets) else "1"
    return replace(
        first, **arrays, dropped=dict(dropped), origins=origins, source=source, unit=unit
    )


def _exclude_without_features(
    reasons: NDArray[np.object_], stored: Stored, wanted: FeatureSet, made: Values
) -> None:
    """Add the reasons why the features of further rows cannot be used."""
    odd = (reasons == "") & ~np.isfinite(made).all(axis=1)
    reasons[odd] = f"{wanted.name} features not finite"
    reasons[odd & stored.undefined] = (
        f"{wanted.name} features need statistics that the surface does not define"
    )


def _features(wanted: FeatureSet, stored: Stored, hybrid: Values | None) -> Values:
    """Return the features of all rows of a database, finite where they can be used."""
    scene, inputs = stored.scene, stored.inputs
    ratio: Values | float | None = None
    if wanted.needs_hardness and (limits := limits_of([scene])) is not None:
        ratio = limits[0] if stored.hardness is None else stored.hardness / modulus(scene)
    with np.errstate(over="ignore", invalid="ignore"):
        return build(
            wanted,
            inputs[:, 1:],
            inputs[:, 0],
            stored.length,
            hybrid,
            hardness_ratio=ratio,
            nodes=node_count(scene),
        )


def remarks(dataset: Dataset, normalisation: str) -> list[str]:
    """List remarks and warnings about the rows that a user should read before training on them.

    The normalisation is one of `learn.models.NORMALISATIONS`.
    """
    lines = [f"left out {number} rows: {why}" for why, number in sorted(dataset.dropped.items())]
    constant = np.flatnonzero(np.ptp(dataset.inputs, axis=0) == 0)
    if constant.size:
        names = ", ".join(dataset.names[index] for index in constant)
        lines.append(f"warning: constant over all rows, so of no use to a model: {names}")
    whole = np.unique(np.column_stack([dataset.inputs, dataset.target]), axis=0)
    if len(whole) < dataset.size:
        lines.append(f"warning: {dataset.size - len(whole)} rows repeat others exactly")
    target = np.abs(dataset.target)
    if target.max() > DOMINANT * usual_size(target):
        lines.append(
            f"warning: the largest {dataset.target_name} is {target.max():.1e}, the median"
            f" {usual_size(target):.1e}: squared errors see nothing else"
        )
    sizes = np.median(np.abs(dataset.inputs), axis=0)
    largest = int(np.argmax(sizes))
    others = float(np.linalg.norm(np.delete(sizes, largest)))
    if normalisation == "l2" and sizes[largest] > DOMINANT * others:
        lines.append(
            f"warning: {dataset.names[largest]} is {sizes[largest] / max(others, 1e-300):.1e} times"
            " all other inputs: scaled to unit length, rows say nothing else; try --normalise"
            " standard"
        )
    return lines


def require_usable(rows: Dataset) -> None:
    """Refuse rows that are too few, of a database without any, or of a constant target."""
    name = rows.source["database"]
    if rows.size < SMALLEST:
        left_out = "; ".join(f"{number} {text}" for text, number in sorted(rows.dropped.items()))
        raise InputError(
            f"{name}: {rows.size} usable rows, {SMALLEST} at least are needed"
            + (f" (left out: {left_out})" if left_out else "")
        )
    for origin in rows.origins:
        if not origin.rows:
            raise InputError(f"{origin.database}: has no usable rows: leave it out")
    values = rows.target * rows.scale
    if np.allclose(values, values[0], rtol=1e-14, atol=0):
        raise InputError(
            f"{name}: {rows.target_name} is {values[0]:g} in all {rows.size} usable rows"
        )


def _digest(*columns: NDArray[np.generic]) -> str:
    """Return a fingerprint of the columns that decide the results."""
    digest = hashlib.sha256()
    for column in columns:
        digest.update(np.ascontiguousarray(column).tobytes())
    return digest.hexdigest()
