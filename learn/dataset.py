"""The rows to learn from: what is read, and what cannot be used."""

import hashlib
import math
import os
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Indices, Values
from gen.database import Reader
from gen.quantities import QUANTITIES, Powers
from gen.runtime.errors import InputError
from gen.scene import Scene, columns_for, parameter_columns
from gen.scene.faults import shown
from gen.schema import REASONS, Column, Reason, Status
from learn.executor import Executor
from learn.features import FeatureSet, chosen
from learn.features.columns import STATISTICS
from learn.features.rows import Rows
from learn.features.scene import BY_FORCE, SCENE, load_of, numbers_of_rows
from learn.features.sets import limits_of
from learn.split import MAP, TILE, populations_of, related

# short names of the two targets that every database has, and their columns
TARGETS: dict[str, str] = {"area": "area_percent", "force": "force"}
# columns of floating numbers that are no results: inputs, and how well a row was solved
NO_TARGETS = frozenset({"delta", *STATISTICS, "load", "hardness", "residual"})
SMALLEST = 10  # usable rows at least: two of these are for testing, and a score needs two
# Ratio of one number to others beyond which a model sees nothing else: of an input, where rows have
# unit length and trees single precision; of a target, where errors are squared.
DOMINANT = 1e6


@dataclass(frozen=True)
class Request:
    """A comparison or a fit to be made, of rows of one or more databases."""

    databases: tuple[Path, ...]
    output: Path = Path()  # a comparison folder, or the file of a surrogate
    targets: tuple[str, ...] = ("area",)
    models: tuple[str, ...] = ()  # all nine if there are none
    area_max: float | None = None  # largest area that is kept [%]
    normalisation: str = "l2"  # see `learn.models.pipeline`
    features: str = "paper"  # one of `learn.features.SETS`
    seed: int = 0  # of the split and of the models
    train_rows: int | None = None  # training rows at most
    again: bool = False  # True to repeat fits whose results the folder has
    until: float = math.inf  # time of `time.time` at which searches end [s]
    roots: bool = (
        False  # True to learn square roots, with the features that surrogates see
    )
    blocks: int | None = None  # per side of the coarse solve of hybrid features
    calibrate_on: Path | None = None  # database whose rows calibrate the intervals
    source: Path | None = None  # comparison folder whose winners' settings are taken
    load: str = (
        ""  # one of `learn.features.scene.LOADS`; the scene's with its features, or Delta
    )


def short_name(column: str) -> str:
    """Return the name of a target's column in folders and on the command line."""
    return next((short for short, name in TARGETS.items() if name == column), column)


def results(scene: Scene, load: str = "delta") -> dict[str, Column]:
    """Return the columns of a scene's database that can be learnt for a load, area and force first.

    At a pressure or a force Delta is a result, and the force none.
    """
    given = NO_TARGETS | set(parameter_columns(scene).values())
    if load in BY_FORCE:
        given = (given - {"delta"}) | {"force"}
    known = {}
    for column in columns_for(scene):
        real = column.dtype == "f8" and not (column.group or column.shape_of)
        if _is_count(column) or (real and column.name not in given):
            known[column.name] = column
    return {name: known[name] for name in TARGETS.values() if name in known} | known


def _is_count(column: Column) -> bool:
    """Return whether a column counts something of a contact: it is learnt like real numbers."""
    quantity = QUANTITIES.get(column.name)
    return quantity is not None and quantity.dtype.startswith("i") and not quantity.code


class Origin(NamedTuple):
    """A database that usable rows were read from."""

    database: str
    sha256: str  # of the columns that decide the results
    scene: Scene
    rows: int
    versions: str = "{}"  # of the libraries that made it, as it states them
    damage: str = ""  # what `gen.database.Reader.damage` says of it


@dataclass(frozen=True, eq=False)
class Dataset:
    """The usable rows of a database, or of several: n rows of d inputs and one target."""

    inputs: Values  # (n, d)
    target: Values  # (n,), in the unit of its column over `scale`
    rows: Indices  # (n,), numbers of the rows in their databases
    groups: (
        Indices  # (n,), of rows that no split divides: of one surface, or tile of a map
    )
    database: Indices  # (n,), number in `origins`
    population: (
        Indices  # (n,), number of the map, or the database of surfaces from no map
    )
    features: FeatureSet  # what the d inputs are
    target_name: str  # the column of the target
    unit: str  # of the target, "1" if it was made free of units
    dropped: dict[str, int]  # number of rows left out, by reason
    described: Values  # (n, 23), Delta and the 22 statistics, NaN if undefined and not needed [um]
    scale: Values  # (n,), divisor of the target
    origins: tuple[Origin, ...]
    name: str  # the databases' paths
    # Of heights, lengths and E* that the target scales with; None for none, or none that is known.
    powers: Powers | None = None
    sha256: str = (
        ""  # fingerprint of the columns that decide the results, of all databases
    )
    by_tile: bool = (
        False  # whether the groups are tiles of maps, from which all surfaces come
    )

    @property
    def size(self) -> int:
        """Number of usable rows."""
        return self.target.size

    @property
    def surfaces(self) -> Indices:
        """Surface, or tile, of each row, (n,); the row itself where all are of one."""
        return self.groups if np.ptp(self.groups) else np.arange(self.size)

    def at(self, positions: Indices) -> "Dataset":
        """Return the rows at some positions, (k,), in their order; groups are numbered anew."""
        arrays: dict[str, Any] = {
            name: value[positions]
            for name, value in vars(self).items()
            if isinstance(value, np.ndarray)
        }
        _, arrays["groups"] = np.unique(arrays["groups"], return_inverse=True)
        return replace(self, **arrays)


class Stored(NamedTuple):
    """Rows of a database, usable or not."""

    path: Path
    scene: Scene
    versions: str
    rows: Indices  # (n,), their numbers
    columns: Mapping[str, NDArray[Any]]  # (n,) each, by name: all that learning needs
    numbers: Rows  # finite where they can be used, without the coarse solve's
    targets: Sequence[Column]
    inputs: Values  # (n, 23), Delta and the 22 statistics
    damage: str  # what `gen.database.Reader.damage` says of it


def read(
    request: Request,
    executor: Executor | None = None,
    stopping: Callable[[], bool] = lambda: False,
    *,
    common: bool = False,
) -> list[Dataset]:
    """Read the databases of a request once, and clean their rows for each of its targets.

    With `common`, they are the rows that all targets have. The executor generates surfaces for
    hybrid features, this process if left out; there are no datasets after a stop, for which
    `stopping` is asked meanwhile. InputError is raised if a file is no database or lacks a target,
    databases cannot be learnt together, too few rows are left, or a target is constant.
    """
    if request.area_max is not None and not request.area_max > 0:
        raise InputError(f"--area-max {request.area_max:g}: give a percentage above 0")
    load = request.load or (
        load_drawn(request.databases[0]) if request.features == SCENE else "delta"
    )
    found = [stored(path, request, load) for path in request.databases]
    scenes = [part.scene for part in found]
    wanted = chosen(
        request.features, scenes, roots=request.roots, blocks=request.blocks, load=load
    )
    if len(found) > 1:
        _require_compatible(found, scaled=wanted.scaled)
    if wanted.needs_surface:
        from learn.features.regeneration import hybrid_rows

        workers = executor or Executor()
        for place, part in enumerate(found):
            deltas, hybrid = hybrid_rows(part, workers, stopping, wanted)
            if stopping():
                return []
            numbers = replace(part.numbers, delta=deltas, hybrid=hybrid)
            found[place] = part._replace(numbers=numbers)
    targets = range(len(request.targets))
    return [
        _usable(found, each, wanted, request.area_max, common=common) for each in targets
    ]


def stored(path: Path, request: Request, load: str) -> Stored:
    """Read what learning needs of a database for a load, with all targets of a request."""
    with Reader(path) as reader:
        scene, known = reader.scene, results(reader.scene, load)
        columns = [TARGETS.get(target, target) for target in request.targets]
        for target, column in zip(request.targets, columns, strict=True):
            if column not in known:
                names = ", ".join(map(short_name, known))
                raise InputError(f"--target {target!r}: {path} stores {names}")
        places = [name for name in (MAP, TILE) if name in scene.surface.PLACES]
        drawn = ["hardness"] if scene.contact.draws_hardness else []
        wanted = {"status", "reason", "area_percent", *columns, *places, *drawn}
        statistics = np.stack([reader.column(name) for name in STATISTICS], axis=1)
        ratio: Values | float | None = None
        if (limits := limits_of([scene])) is not None:
            ratio = (
                reader.column("hardness") / scene.contact.e_star if drawn else limits[0]
            )
        size = (
            math.sqrt(math.prod(scene.grid.sides)),
            ratio,
            math.sqrt(math.prod(scene.grid.shape)),
        )
        scenic = request.features == SCENE
        given = numbers_of_rows(scene, reader.column) if scenic or load != "delta" else {}
        numbers = Rows(statistics, reader.column("delta"), *size, scene_numbers=given)
        if load == "pressure" and not scenic:
            numbers = numbers.under(given["pressure"], scene.contact.e_star)
        return Stored(
            path,
            scene,
            str(reader.attributes["versions"]),
            np.array(reader.rows, dtype=np.int64),
            {name: reader.column(name) for name in wanted},
            numbers,
            [known[column] for column in columns],
            np.column_stack([numbers.delta, statistics]),
            reader.damage(),
        )


def load_drawn(path: Path) -> str:
    """Return the name of the load that a database's scene draws."""
    with Reader(path) as reader:
        return load_of(reader.scene)


def _usable(
    parts: Sequence[Stored],
    number: int,
    wanted: FeatureSet,
    area_max: float | None,
    *,
    common: bool,
) -> Dataset:
    """Join the rows that can be used for a target by its number, or for all, and group them."""
    column, dropped, origins, usable, arrays = (
        parts[0].targets[number],
        Counter[str](),
        [],
        [],
        [],
    )
    powers = column.powers
    if any(part.targets[number].powers != powers for part in parts):
        powers = None
    for part in parts:
        values = [
            np.asarray(part.columns[each.name], np.float64) for each in part.targets
        ]
        with np.errstate(over="ignore", invalid="ignore"):
            made = wanted.of(part.numbers)
            decide = (
                np.sum(values, axis=0) if common else values[number]
            )  # finite where all are
        reasons = _reasons_against(part, made, decide, wanted.name, area_max)
        dropped.update(reasons[reasons != ""].tolist())
        kept = np.flatnonzero(reasons == "")
        scale = wanted.scale(powers, part.numbers, part.scene.contact.e_star)[kept]
        target, inputs = values[number], part.inputs
        arrays.append(
            (made[kept], target[kept] / scale, part.rows[kept], inputs[kept], scale)
        )
        drawn = [part.columns[name] for name in ("hardness",) if name in part.columns]
        digest = hashlib.sha256()
        for each in (
            part.columns["status"],
            inputs,
            target,
            part.columns["area_percent"],
            *drawn,
        ):
            digest.update(np.ascontiguousarray(each).tobytes())
        known = digest.hexdigest(), part.scene, kept.size, part.versions, part.damage
        origins.append(Origin(str(part.path), *known))
        columns = {name: each[kept] for name, each in part.columns.items()}
        usable.append(
            part._replace(rows=part.rows[kept], columns=columns, inputs=inputs[kept])
        )
    made, target, rows, described, scale = map(np.concatenate, zip(*arrays, strict=True))
    _require_usable(column.name, target * scale, origins, dropped)
    first, *others = (origin.sha256 for origin in origins)
    names = [each for part in usable for each in populations_of(part)]
    numbers = {name: place for place, name in enumerate(dict.fromkeys(names))}
    return Dataset(
        inputs=made,
        target=target,
        rows=rows,
        groups=related(usable),
        database=np.repeat(np.arange(len(parts)), [part.rows.size for part in usable]),
        population=np.array([numbers[name] for name in names], dtype=np.int64),
        features=wanted,
        target_name=column.name,
        unit=column.unit if (scale == 1).all() else "1",
        dropped=dict(sorted(dropped.items())),
        described=described,
        scale=scale,
        origins=tuple(origins),
        name=", ".join(origin.database for origin in origins),
        powers=powers,
        sha256=hashlib.sha256("".join([first, *others]).encode()).hexdigest()
        if others
        else first,
        by_tile=all(TILE in part.columns for part in parts),
    )


def _reasons_against(
    part: Stored, made: Values, target: Values, name: str, area_max: float | None
) -> NDArray[np.object_]:
    """Return why each row cannot be used for a target with features of a name, "" if it can.

    Rows whose surfaces do not define all statistics are done, and of use to some features.
    """
    status, reason, area = (
        part.columns[each] for each in ("status", "reason", "area_percent")
    )
    lacking = np.asarray((status == Status.DONE) & (reason == Reason.NO_STATISTICS))
    reasons = np.full(status.size, "", dtype=object)
    inputs = np.where(lacking[:, None] & np.isnan(part.inputs), 0.0, part.inputs)
    with np.errstate(over="ignore", invalid="ignore"):
        square = np.einsum("ij,ij->i", inputs, inputs)
    reasons[~np.isfinite(target)] = "target not finite"
    reasons[~np.isfinite(square)] = "input not finite, or too large to be squared"
    reasons[~np.isin(status, list(Status))] = "status unknown"
    reasons[status == Status.PENDING] = "not computed yet"
    for code in np.unique(reason[status == Status.FAILED]):
        text = REASONS.get(int(code), f"reason {code}") or "no reason given"
        reasons[(status == Status.FAILED) & (reason == code)] = f"failed: {text}"
    if area_max is not None:
        reasons[(reasons == "") & (area > area_max)] = f"area above {area_max:g} %"
    odd = (reasons == "") & ~np.isfinite(made).all(axis=1)
    reasons[odd] = f"{name} features not finite"
    reasons[odd & lacking] = (
        f"{name} features need statistics that the surface does not define"
    )
    return reasons


def _require_usable(
    target: str, values: Values, origins: Sequence[Origin], dropped: Mapping[str, int]
) -> None:
    """Refuse rows that are too few, of a database without any, or of a constant target."""
    name = ", ".join(origin.database for origin in origins)
    if values.size < SMALLEST:
        left_out = "; ".join(
            f"{number} {text}" for text, number in sorted(dropped.items())
        )
        raise InputError(
            f"{name}: {values.size} usable rows, {SMALLEST} at least are needed"
            + (f" (left out: {left_out})" if left_out else "")
        )
    for origin in origins:
        if not origin.rows:
            raise InputError(f"{origin.database}: has no usable rows: leave it out")
    if np.allclose(values, values[0], rtol=1e-14, atol=0):
        raise InputError(
            f"{name}: {target} is {values[0]:g} in all {values.size} usable rows"
        )


def _require_compatible(parts: Sequence[Stored], *, scaled: bool) -> None:
    """Refuse databases that no single surrogate describes, or that are given twice.

    With `scaled` features, which have no units, scan length and E* make no difference, and elastic
    bodies are very hard ones.
    """
    files = Counter(os.path.realpath(part.path) for part in parts)
    for file in [file for file, times in files.items() if times > 1]:
        raise InputError(f"{file}: is given twice: give each database once")
    for part in parts[1:]:
        first, other = (
            _must_agree(each.scene, scaled=scaled) for each in (parts[0], part)
        )
        for key in [key for key in first if first[key] != other[key]]:
            raise InputError(
                f"{part.path}: {key} is {shown(other[key])}, {shown(first[key])} in"
                f" {parts[0].path}: they cannot be learnt together"
            )


def _must_agree(scene: Scene, *, scaled: bool) -> dict[str, Any]:
    """Return what all scenes of a fit have in common, by the keys of the scene that decide it."""
    contact, (along, across) = scene.contact, scene.grid.sides
    common: dict[str, Any] = {
        "contact.boundary": contact.boundary,
        "contact.kernel": contact.kernel,
        "contact.far_field": contact.far_field,
        "contact.spacing": contact.spacing,
        "surface.side (x over y)": float(f"{along / across:.3g}"),
    }
    if not scaled:
        common |= {
            "contact.hardness": "none" if contact.hardness_limits is None else "given",
            "surface.side": float(f"{along:.6g}"),
            "contact.modulus / (1 - contact.poisson^2)": float(
                f"{scene.contact.e_star:.9g}"
            ),
        }
    return common


def remarks(dataset: Dataset, normalisation: str) -> list[str]:
    """List what a user should know of the rows before a model is trained on them.

    The normalisation is one of `learn.models.pipeline`.
    """
    lines = [
        f"left out {number} rows: {why}"
        for why, number in sorted(dataset.dropped.items())
    ]
    lines += damage_of(dataset)
    names = dataset.features.columns
    constant = np.flatnonzero(np.ptp(dataset.inputs, axis=0) == 0)
    if constant.size:
        useless = ", ".join(names[index] for index in constant)
        lines.append(
            f"warning: constant over all rows, so of no use to a model: {useless}"
        )
    whole = np.unique(np.column_stack([dataset.inputs, dataset.target]), axis=0)
    if len(whole) < dataset.size:
        lines.append(f"warning: {dataset.size - len(whole)} rows repeat others exactly")
    magnitudes = np.abs(dataset.target)
    largest, usual = magnitudes.max(), np.median(magnitudes[magnitudes > 0])
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


def damage_of(dataset: Dataset) -> list[str]:
    """List the databases of a dataset with damaged rows, which are learnt like all others."""
    damaged = [origin for origin in dataset.origins if origin.damage]
    return [f"warning: {origin.database}: {origin.damage}" for origin in damaged]
