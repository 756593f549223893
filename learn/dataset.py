"""The rows to learn from: what is asked for, what is read, and what cannot be used."""

import hashlib
import math
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
from learn.features.scene import SCENE
from learn.features.sets import BLOCKS, Rows, limits_of, modulus, node_count
from learn.metrics import usual_size
from learn.stored import Origin, Population, Stored, load_drawn, reasons_against

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

    databases: tuple[Path, ...]
    output: Path = Path()  # a comparison folder, or the file of a surrogate
    targets: tuple[str, ...] = ("area",)
    models: tuple[str, ...] = ()  # all nine if there are none
    area_max: float | None = None  # largest area that is kept [%]
    normalisation: str = "l2"  # one of `learn.models.NORMALISATIONS`
    features: str = "paper"  # one of `learn.features.SETS`
    seed: int = 0  # of the split and of the models
    train_rows: int | None = None  # training rows at most
    again: bool = False  # True to repeat fits whose results the folder has
    until: float = math.inf  # time of `time.time` at which searches end [s]
    roots: bool = False  # True to learn square roots, with the features that surrogates see
    blocks: int | None = None  # per side of the coarse solve of hybrid features
    calibrate_on: Path | None = None  # database whose rows calibrate the intervals
    source: Path | None = None  # comparison folder whose winners' settings are taken
    load: str = ""  # one of `learn.features.scene.LOADS`; the scene's with its features, or Delta

    @property
    def database(self) -> Path:
        """The first database."""
        return self.databases[0]


@dataclass(frozen=True, eq=False)
class Dataset:
    """The usable rows of a database, or of several: n rows of d inputs and one target."""

    inputs: Values  # (n, d)
    target: Values  # (n,), in the unit of its column over `scale`
    rows: Indices  # (n,), numbers of the rows in their databases
    groups: Indices  # (n,), of rows that no split divides: of one surface, or tile of a map
    database: Indices  # (n,), number in `origins`
    population: Indices  # (n,), number in `populations`
    features: FeatureSet  # what the d inputs are
    target_name: str  # the column of the target
    unit: str  # of the target, "1" if it was made free of units
    dropped: dict[str, int]  # number of rows left out, by reason
    source: dict[str, str]  # origin of the rows, which is recorded beside all results
    described: Values  # (n, 23), Delta and the 22 statistics, NaN if undefined and not needed [um]
    scale: Values  # (n,), divisor of the target
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
    request: Request,
    executor: Executor | None = None,
    stopping: Callable[[], bool] = lambda: False,
) -> list[Dataset]:
    """Read the databases of a request once, and clean their rows for each of its targets.

    The executor generates surfaces for hybrid features, this process if left out; there are no
    datasets after a stop, for which `stopping` is asked meanwhile. InputError is raised if a file
    is no database or lacks a target, databases cannot be learnt together, too few rows are left, or
    a target is constant.
    """
    if request.area_max is not None and not request.area_max > 0:
        raise InputError(f"--area-max {request.area_max:g}: give a percentage above 0")
    load = request.load or (load_drawn(request.database) if request.features == SCENE else "delta")
    found = [stored.read_stored(path, request.targets, load) for path in request.databases]
    scenes = [part.scene for part in found]
    wanted = chosen(request.features, scenes, roots=request.roots, blocks=request.blocks, load=load)
    stored.require_compatible(found, scaled=wanted.scaled)
    rows: list[Rows] = []
    for part in found:
        hybrid = None
        if wanted.needs_surface:
            from learn.features.regeneration import hybrid_rows

            workers = executor or Executor()
            hybrid = hybrid_rows(part.path, workers, stopping, wanted.blocks or BLOCKS)
            if stopping():
                return []
        rows.append(_numbers(part, hybrid))
    with np.errstate(over="ignore", invalid="ignore"):
        made = [wanted.of(each) for each in rows]
    every = list(zip(found, rows, made, strict=True))
    return [
        _together([_usable(*each, number, wanted, request.area_max) for each in every])
        for number in range(len(request.targets))
    ]


def _numbers(part: Stored, hybrid: Values | None) -> Rows:
    """Return the numbers of all rows of a database, finite where they can be used."""
    ratio: Values | float | None = None
    if (limits := limits_of([part.scene])) is not None:
        ratio = limits[0] if part.hardness is None else part.hardness / modulus(part.scene)
    statistics, delta, nodes = part.inputs[:, 1:], part.inputs[:, 0], node_count(part.scene)
    return Rows(statistics, delta, part.length, ratio, nodes, hybrid, given=part.given)


def _usable(
    part: Stored,
    numbers: Rows,
    made: Values,
    number: int,
    wanted: FeatureSet,
    area_max: float | None,
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
    scale = wanted.scale(column.name, numbers, modulus(part.scene))[kept]
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
        features=wanted,
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
    names = dataset.features.columns
    constant = np.flatnonzero(np.ptp(dataset.inputs, axis=0) == 0)
    if constant.size:
        useless = ", ".join(names[index] for index in constant)
        lines.append(f"warning: constant over all rows, so of no use to a model: {useless}")
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
            f"warning: {names[place]} is {sizes[place] / max(others, 1e-300):.1e} times all other"
            " inputs: rows of unit length say nothing else; try --normalise standard"
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
