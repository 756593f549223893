"""The rows to learn from: what is asked for, what is read, and what cannot be used."""

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
from learn import stored
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
from learn.stored import Origin, Population, Stored, reasons_against

SMALLEST = 10
"""Usable rows at least: two of these are for testing, and a score needs two."""

MOST_ROWS = 2**40
"""More rows than a scene can have."""

DOMINANT = 1e6
"""Ratio of one number to others beyond which a model sees nothing else: of an input, where rows
have unit length and trees single precision; of a target, where errors are squared."""


@dataclass(frozen=True)
class Request:
    """A comparison or a fit to be made, of rows of one or more databases."""

    database: Path
    output: Path  # a comparison folder, or the file of a surrogate
    targets: tuple[str, ...] = ("area",)
    models: tuple[str, ...] = ()  # all nine if there are none
    area_max: float | None = None  # largest area that is kept [%]
    normalisation: str = "l2"  # one of `learn.models.NORMALISATIONS`
    features: str = "paper"  # one of `learn.features.SETS`
    seed: int = 0  # of the split and of the models
    train_rows: int | None = None  # training rows at most
    again: bool = False  # True to repeat fits whose results the folder has
    limit: float | None = None  # time for the searches [s]
    roots: bool = False  # True to learn square roots, with the features that surrogates see
    blocks: int = BLOCKS  # per side of the coarse solve of hybrid features
    calibrate_on: Path | None = None  # database whose rows calibrate the intervals
    others: tuple[Path, ...] = ()  # further databases to learn from

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


@dataclass(frozen=True, eq=False)
class Dataset:
    """The usable rows of a database, or of several: n rows of d inputs and one target."""

    inputs: Values  # (n, d)
    target: Values  # (n,), in the unit of its column over `scale`
    rows: Indices  # (n,), numbers of the rows in their databases
    groups: Indices  # (n,), of rows that no split divides: of one surface, or tile of a map
    database: Indices  # (n,), number in `origins`
    population: Indices  # (n,), number in `populations`
    names: tuple[str, ...]  # of the d inputs
    target_name: str  # the column of the target
    unit: str  # of the target, "1" if it was made free of units
    dropped: dict[str, int]  # number of rows left out, by reason
    source: dict[str, str]  # origin of the rows, which is recorded beside all results
    described: Values  # (n, 23), Delta and the 22 statistics, NaN if undefined and not needed [um]
    scale: Values  # (n,), divisor of the target
    features: str = "paper"
    by_tile: bool = False  # whether the groups are tiles of maps
    origins: tuple[Origin, ...] = ()
    populations: tuple[Population, ...] = ()

    @property
    def size(self) -> int:
        """Number of usable rows."""
        return self.target.size

    @property
    def keys(self) -> Indices:
        """Number of each row, (n,), that no other row of the databases has."""
        return self.database * MOST_ROWS + self.rows

    def at(self, positions: Indices) -> "Dataset":
        """Return the rows at some positions, (k,), in their order; groups are numbered anew."""
        arrays: dict[str, Any] = {
            name: value[positions]
            for name, value in vars(self).items()
            if isinstance(value, np.ndarray)
        }
        _, arrays["groups"] = np.unique(arrays["groups"], return_inverse=True)
        return replace(self, **arrays)


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

    Targets are any of "area", "force", and the columns of other results; the largest area that is
    kept is in percent. Hybrid features need the columns of `learn.features.regeneration`, (rows,
    17), of each database; see `Request` for the others. InputError is raised if a file is no
    database or lacks a target, databases cannot be learnt together, too few rows are left, or a
    target is constant.
    """
    scaled = chosen(features).scaled
    if area_max is not None and not area_max > 0:
        raise InputError(f"--area-max {area_max:g}: give a percentage above 0")
    found = [stored.read_stored(path, targets) for path in paths]
    stored.require_compatible(found, scaled=scaled)
    wanted = features_of([each.scene for each in found], features, roots=roots, blocks=blocks)
    parts = [
        (each, _features(wanted, each, hybrid)) for each, hybrid in zip(found, hybrids, strict=True)
    ]
    return [
        _together([_usable(each, values, number, wanted, area_max) for each, values in parts])
        for number in range(len(targets))
    ]


def _features(wanted: FeatureSet, part: Stored, hybrid: Values | None) -> Values:
    """Return the features of all rows of a database, finite where they can be used."""
    ratio: Values | float | None = None
    if wanted.needs_hardness and (limits := limits_of([part.scene])) is not None:
        ratio = limits[0] if part.hardness is None else part.hardness / modulus(part.scene)
    statistics, delta, nodes = part.inputs[:, 1:], part.inputs[:, 0], node_count(part.scene)
    with np.errstate(over="ignore", invalid="ignore"):
        return build(wanted, statistics, delta, part.length, hybrid, ratio, nodes)


def _usable(
    part: Stored, made: Values, number: int, wanted: FeatureSet, area_max: float | None
) -> tuple[Dataset, Stored]:
    """Keep the rows that can be used for one target, by its number; groups are not known yet."""
    column, values = part.targets[number]
    reasons = reasons_against(part, values)
    if area_max is not None:
        reasons[(reasons == "") & (part.area > area_max)] = f"area above {area_max:g} %"
    odd = (reasons == "") & ~np.isfinite(made).all(axis=1)
    reasons[odd] = f"{wanted.name} features not finite"
    needs = "features need statistics that the surface does not define"
    reasons[odd & part.undefined] = f"{wanted.name} {needs}"
    kept = np.flatnonzero(reasons == "")
    usable, scene = part.at(kept), part.scene.text()
    statistics, delta, e_star = usable.inputs[:, 1:], usable.inputs[:, 0], modulus(part.scene)
    scale = target_scale(wanted, column.name, statistics, delta, part.length, e_star)
    hardness = () if part.hardness is None else (part.hardness,)
    digest = _digest(part.status, part.inputs, values, part.area, *hardness)
    unknown = np.zeros(kept.size, dtype=np.int64)
    rows = Dataset(
        inputs=made[kept],
        target=values[kept] / scale,
        rows=usable.rows,
        groups=unknown,
        database=unknown,
        population=unknown,
        names=wanted.columns,
        target_name=column.name,
        unit=column.unit if (scale == 1).all() else "1",
        dropped={why: count for why, count in sorted(Counter(reasons).items()) if why},
        source={
            "database": str(part.path),
            "database_sha256": digest,
            "scene": scene,
            "versions": part.versions,
        },
        described=usable.inputs,
        scale=scale,
        features=wanted.name,
        by_tile=part.tile is not None,
        origins=(Origin(str(part.path), digest, scene, kept.size),),
    )
    return rows, usable


def _digest(*columns: NDArray[np.generic]) -> str:
    """Return a fingerprint of the columns that decide the results."""
    digest = hashlib.sha256()
    for column in columns:
        digest.update(np.ascontiguousarray(column).tobytes())
    return digest.hexdigest()


def _together(parts: Sequence[tuple[Dataset, Stored]]) -> Dataset:
    """Join the usable rows of databases, and find the groups that every split keeps together."""
    sets, usable = [rows for rows, _ in parts], [part for _, part in parts]
    population, populations = stored.populations(usable)
    whole = joined(sets) if len(sets) > 1 else sets[0]
    require_usable(whole)
    return replace(
        whole,
        groups=stored.related(usable),
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


def remarks(dataset: Dataset, normalisation: str) -> list[str]:
    """List what a user should know of the rows before a model is trained on them.

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
    largest, usual = np.abs(dataset.target).max(), usual_size(dataset.target)
    if largest > DOMINANT * usual:
        lines.append(
            f"warning: the largest {dataset.target_name} is {largest:.1e}, the median {usual:.1e}:"
            " squared errors see nothing else"
        )
    sizes = np.median(np.abs(dataset.inputs), axis=0)
    place = int(np.argmax(sizes))
    others = float(np.linalg.norm(np.delete(sizes, place)))
    if normalisation == "l2" and sizes[place] > DOMINANT * others:
        lines.append(
            f"warning: {dataset.names[place]} is {sizes[place] / max(others, 1e-300):.1e} times all"
            " other inputs: rows of unit length say nothing else; try --normalise standard"
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
