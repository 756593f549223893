"""The rows to learn from: how databases are read, and which rows cannot be used."""

import hashlib
import math
import os
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Indices, Values
from gen.database import Reader
from gen.quantities import QUANTITIES, Powers
from gen.runtime.errors import InputError
from gen.scene import Scene, columns_for, parameter_columns
from gen.scene.faults import shown
from gen.schema import REASONS, Column, Reason, Status
from learn.database_rows import Dataset, Origin, Stored
from learn.executor import Executor
from learn.features import FeatureSet, chosen
from learn.features.columns import STATISTICS
from learn.features.rows import Rows
from learn.features.scene import BY_FORCE, SCENE, load_of, numbers_of_rows
from learn.features.sets import limits_of
from learn.split import MAP, TILE, populations_of, surface_groups

# short names of the two targets that every database has, and their columns
TARGETS: dict[str, str] = {"area": "area_percent", "force": "force"}
# columns of floating numbers that are no results: inputs, and how well a row was solved
NO_TARGETS = frozenset({"delta", *STATISTICS, "load", "hardness", "residual"})
# smallest number of usable rows: two of these are for testing, and a score needs two
SMALLEST = 10
# Ratio of one number to the next ones beyond which a model sees nothing else: of an input, where
# rows have unit length and trees single precision; of a target, where errors are squared.
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
    train_rows: int | None = None  # largest number of training rows
    again: bool = False  # True to repeat fits whose results the folder has
    until: float = math.inf  # time of `time.time` at which searches end [s]
    roots: bool = False  # True for square roots, with the features that surrogates see
    blocks: int | None = None  # per side of the coarse solve of hybrid features
    calibrate_on: Path | None = None  # database whose rows calibrate the intervals
    source: Path | None = None  # comparison folder whose winners' settings are taken
    # one of `learn.features.scene.LOADS`; "" for the scene's with its features, otherwise Delta
    load: str = ""


def short_name(column: str) -> str:
    """Return the name of a target's column in folders and on the command line.

    Parameters
    ----------
    column : str
        Name of the column.

    Returns
    -------
    str
        The short name if it has one, otherwise that of the column.
    """
    for short, name in TARGETS.items():
        if name == column:
            return short
    return column


def results(scene: Scene, load: str = "delta") -> dict[str, Column]:
    """Return the columns of a scene's database that can be learnt for a load.

    At a pressure or a force Delta is a result, and the force none.

    Parameters
    ----------
    scene : Scene
        The scene.
    load : str
        One of `learn.features.scene.LOADS`.

    Returns
    -------
    dict
        Columns by name, area and force first.
    """
    inputs = NO_TARGETS | set(parameter_columns(scene).values())
    if load in BY_FORCE:
        inputs = (inputs - {"delta"}) | {"force"}
    columns = {}
    for column in columns_for(scene):
        is_real = column.dtype == "f8" and not (column.group or column.shape_of)
        if _is_count(column) or (is_real and column.name not in inputs):
            columns[column.name] = column
    first = {name: columns[name] for name in TARGETS.values() if name in columns}
    return first | columns


def _is_count(column: Column) -> bool:
    """Tell whether a column counts something of a contact; counts are learnt like real numbers."""
    quantity = QUANTITIES.get(column.name)
    return quantity is not None and quantity.dtype.startswith("i") and not quantity.code


def read(
    request: Request,
    executor: Executor | None = None,
    stopping: Callable[[], bool] = lambda: False,
    *,
    common: bool = False,
) -> list[Dataset]:
    """Read the databases of a request once, and clean their rows for each of its targets.

    Hybrid features are computed anew, and kept in a file beside each database.

    Parameters
    ----------
    request : Request
        The databases, targets and features.
    executor : Executor, optional
        Processes that generate surfaces for hybrid features; this process if left out.
    stopping : callable
        Tells whether to stop; it is asked while surfaces are generated.
    common : bool
        True to keep only the rows that all targets have.

    Returns
    -------
    list of Dataset
        Usable rows for each target, in the order of the request; empty after a stop.

    Raises
    ------
    InputError
        If a file is no database or lacks a target, databases cannot be learnt together, too few
        rows are left, or a target is constant.
    """
    if request.area_max is not None and not request.area_max > 0:
        raise InputError(f"--area-max {request.area_max:g}: give a percentage above 0")
    load = request.load or _usual_load(request)
    parts = [stored(path, request, load) for path in request.databases]
    features = chosen(
        request.features,
        [part.scene for part in parts],
        roots=request.roots,
        blocks=request.blocks,
        load=load,
    )
    if len(parts) > 1:
        _require_compatible(parts, scaled=features.scaled)
    if features.needs_surface:
        parts = _with_coarse_solves(parts, features, executor or Executor(), stopping)
        if not parts:
            return []
    selection = Selection(features, request.area_max, common=common)
    return [selection.dataset(parts, number) for number in range(len(request.targets))]


def _usual_load(request: Request) -> str:
    """Return the load of a request that names none: the scene's with its features, or Delta."""
    if request.features == SCENE:
        return load_drawn(request.databases[0])
    return "delta"


def load_drawn(path: Path) -> str:
    """Return the name of the load that a database's scene draws.

    Parameters
    ----------
    path : Path
        The database.

    Returns
    -------
    str
        One of `learn.features.scene.LOADS`.

    Raises
    ------
    InputError
        If the file is no database.
    """
    with Reader(path) as reader:
        return load_of(reader.scene)


def _with_coarse_solves(
    parts: Sequence[Stored],
    features: FeatureSet,
    executor: Executor,
    stopping: Callable[[], bool],
) -> list[Stored]:
    """Return rows with the Deltas and columns of their coarse solves; none after a stop."""
    from learn.regeneration import coarse_solves

    complete = []
    for part in parts:
        coarse = coarse_solves(part, executor, stopping, features)
        if stopping():
            return []
        quantities = replace(part.quantities, delta=coarse.delta, hybrid=coarse.columns)
        complete.append(replace(part, quantities=quantities))
    return complete


def stored(path: Path, request: Request, load: str) -> Stored:
    """Read what learning needs of a database.

    Parameters
    ----------
    path : Path
        The database.
    request : Request
        The targets, all of which are read, and the name of the features.
    load : str
        The load of the features, one of `learn.features.scene.LOADS`.

    Returns
    -------
    Stored
        All rows, without columns of coarse solves. Under a pressure Delta stands for it.

    Raises
    ------
    InputError
        If the file is no database, or lacks a target.
    """
    with Reader(path) as reader:
        scene = reader.scene
        targets = _target_columns(path, scene, request.targets, load)
        names = {"status", "reason", "area_percent"}
        names |= {column.name for column in targets}
        names |= {name for name in (MAP, TILE) if name in scene.surface.PLACES}
        if scene.contact.draws_hardness:
            names.add("hardness")
        quantities = _quantities(reader, request.features, load)
        return Stored(
            path=path,
            scene=scene,
            versions=str(reader.attributes["versions"]),
            rows=np.array(reader.rows, dtype=np.int64),
            columns={name: reader.column(name) for name in names},
            quantities=quantities,
            targets=targets,
            described=np.column_stack([quantities.delta, quantities.statistics]),
            damage=reader.damage(),
        )


def _target_columns(
    path: Path, scene: Scene, targets: Sequence[str], load: str
) -> list[Column]:
    """Return the columns of targets, given by short names or their own; refuse unknown ones."""
    stored_results = results(scene, load)
    columns = []
    for target in targets:
        name = TARGETS.get(target, target)
        if name not in stored_results:
            names = ", ".join(map(short_name, stored_results))
            raise InputError(f"--target {target!r}: {path} stores {names}")
        columns.append(stored_results[name])
    return columns


def _quantities(reader: Reader, features: str, load: str) -> Rows:
    """Return what features of a name are computed from, under a load, of all rows."""
    scene = reader.scene
    scene_numbers: Mapping[str, Values] = {}
    if features == SCENE or load != "delta":
        scene_numbers = numbers_of_rows(scene, reader.column)
    quantities = Rows(
        statistics=np.stack([reader.column(name) for name in STATISTICS], axis=1),
        delta=reader.column("delta"),
        length=math.sqrt(math.prod(scene.grid.sides)),
        hardness_ratio=_hardness_ratio(reader),
        nodes=math.sqrt(math.prod(scene.grid.shape)),
        scene_numbers=scene_numbers,
    )
    if load == "pressure" and features != SCENE:
        return quantities.under(scene_numbers["pressure"], scene.contact.e_star)
    return quantities


def _hardness_ratio(reader: Reader) -> Values | float | None:
    """Return the hardness over E*, (n,) if the scene draws it; None for elastic bodies."""
    contact = reader.scene.contact
    limits = limits_of([reader.scene])
    if limits is None:
        return None
    if contact.draws_hardness:
        return np.asarray(reader.column("hardness") / contact.e_star)
    smallest, _ = limits
    return smallest


@dataclass(frozen=True, eq=False)
class UsableRows:
    """The k rows of one database that can be used for a target."""

    # these rows alone, but for its `quantities`, which are still those of all rows of the database
    part: Stored
    inputs: Values  # (k, d), features
    target: Values  # (k,), in the unit of its column over `scale`
    scale: Values  # (k,), divisor of the target
    origin: Origin
    reasons: list[
        str
    ]  # why rows of the database are left out, one each for those that are


@dataclass(frozen=True)
class Selection:
    """Which rows can be used for targets.

    Parameters
    ----------
    features : FeatureSet
        Features that have to be defined.
    area_max : float or None
        Largest area that is kept [%].
    common : bool
        True to keep only the rows that all targets have.
    """

    features: FeatureSet
    area_max: float | None
    common: bool

    def dataset(self, parts: Sequence[Stored], number: int) -> Dataset:
        """Return the usable rows of all databases for one target.

        Parameters
        ----------
        parts : sequence of Stored
            Rows of each database, with the columns that the features need.
        number : int
            Number of the target among those that were read.

        Returns
        -------
        Dataset
            The rows, database by database, in groups.

        Raises
        ------
        InputError
            If too few rows are left, in all or of a database, or the target is constant.
        """
        column = parts[0].targets[number]
        powers = column.powers
        if any(part.targets[number].powers != powers for part in parts):
            powers = None
        databases = [self._usable(part, number, powers) for part in parts]
        dropped = Counter[str]()
        for database in databases:
            dropped.update(database.reasons)
        origins = tuple(database.origin for database in databases)
        target = np.concatenate([database.target for database in databases])
        scale = np.concatenate([database.scale for database in databases])
        _require_usable(column.name, target * scale, origins, dropped)
        usable = [database.part for database in databases]
        sizes = [database.target.size for database in databases]
        return Dataset(
            inputs=np.concatenate([database.inputs for database in databases]),
            target=target,
            rows=np.concatenate([part.rows for part in usable]),
            groups=surface_groups(usable),
            database=np.repeat(np.arange(len(parts)), sizes),
            population=_population_numbers(usable),
            features=self.features,
            target_name=column.name,
            unit=column.unit if (scale == 1).all() else "1",
            dropped=dict(sorted(dropped.items())),
            described=np.concatenate([part.described for part in usable]),
            scale=scale,
            origins=origins,
            name=", ".join(origin.database for origin in origins),
            powers=powers,
            sha256=_joint_fingerprint(origins),
            by_tile=all(TILE in part.columns for part in parts),
        )

    def _usable(self, part: Stored, number: int, powers: Powers | None) -> UsableRows:
        """Return the rows of a database that can be used for a target."""
        targets = [
            np.asarray(part.columns[column.name], np.float64) for column in part.targets
        ]
        target = targets[number]
        deciding = targets if self.common else [target]
        finite = np.asarray(np.isfinite(deciding).all(axis=0))
        with np.errstate(over="ignore", invalid="ignore"):
            inputs = self.features.of(part.quantities)
        reasons = self._reasons_against(part, inputs, finite)
        kept = np.flatnonzero(reasons == "")
        scale = self.features.scale(powers, part.quantities, part.scene.contact.e_star)
        columns = {name: values[kept] for name, values in part.columns.items()}
        origin = Origin(
            database=str(part.path),
            sha256=_fingerprint(part, target),
            scene=part.scene,
            rows=kept.size,
            versions=part.versions,
            damage=part.damage,
        )
        return UsableRows(
            part=replace(
                part,
                rows=part.rows[kept],
                columns=columns,
                described=part.described[kept],
            ),
            inputs=inputs[kept],
            target=target[kept] / scale[kept],
            scale=scale[kept],
            origin=origin,
            reasons=reasons[reasons != ""].tolist(),
        )

    def _reasons_against(
        self, part: Stored, inputs: Values, finite: NDArray[np.bool_]
    ) -> NDArray[np.object_]:
        """Return why each row cannot be used, (n,), "" if it can.

        Takes the features, (n, d), and which targets are finite, (n,). Rows whose surfaces do not
        define all statistics are done, and of use to features that do not need them.
        """
        status = part.columns["status"]
        reason = part.columns["reason"]
        no_statistics = (status == Status.DONE) & (reason == Reason.NO_STATISTICS)
        reasons = np.full(status.size, "", dtype=object)
        reasons[~finite] = "target not finite"
        undefined = no_statistics[:, None] & np.isnan(part.described)
        described = np.where(undefined, 0.0, part.described)
        with np.errstate(over="ignore", invalid="ignore"):
            square = np.einsum("ij,ij->i", described, described)
        reasons[~np.isfinite(square)] = "input not finite, or too large to be squared"
        reasons[~np.isin(status, list(Status))] = "status unknown"
        reasons[status == Status.PENDING] = "not computed yet"
        failed = status == Status.FAILED
        for code in np.unique(reason[failed]):
            text = REASONS.get(int(code), f"reason {code}") or "no reason given"
            reasons[failed & (reason == code)] = f"failed: {text}"
        if self.area_max is not None:
            too_large = part.columns["area_percent"] > self.area_max
            reasons[(reasons == "") & too_large] = f"area above {self.area_max:g} %"
        name = self.features.name
        infinite = (reasons == "") & ~np.isfinite(inputs).all(axis=1)
        reasons[infinite] = f"{name} features not finite"
        reasons[infinite & no_statistics] = (
            f"{name} features need statistics that the surface does not define"
        )
        return reasons


def _fingerprint(part: Stored, target: Values) -> str:
    """Return the SHA-256 of the columns of a database that decide the results for a target."""
    columns = [part.columns["status"], part.described, target]
    columns.append(part.columns["area_percent"])
    if "hardness" in part.columns:
        columns.append(part.columns["hardness"])
    digest = hashlib.sha256()
    for column in columns:
        digest.update(np.ascontiguousarray(column).tobytes())
    return digest.hexdigest()


def _joint_fingerprint(origins: Sequence[Origin]) -> str:
    """Return the fingerprint of one database, or the SHA-256 of those of several."""
    if len(origins) == 1:
        return origins[0].sha256
    joint = "".join(origin.sha256 for origin in origins)
    return hashlib.sha256(joint.encode()).hexdigest()


def _population_numbers(parts: Sequence[Stored]) -> Indices:
    """Number the map, or the database, that the surface of each row is from, (n,)."""
    names: list[str] = []
    for part in parts:
        names += populations_of(part)
    numbers = {name: number for number, name in enumerate(dict.fromkeys(names))}
    return np.array([numbers[name] for name in names], dtype=np.int64)


def _require_usable(
    target: str, values: Values, origins: Sequence[Origin], dropped: Mapping[str, int]
) -> None:
    """Refuse rows that are too few, a database without any, and a constant target."""
    name = ", ".join(origin.database for origin in origins)
    if values.size < SMALLEST:
        fault = f"{name}: {values.size} usable rows, {SMALLEST} at least are needed"
        reasons = [f"{number} {reason}" for reason, number in sorted(dropped.items())]
        if reasons:
            fault += f" (left out: {'; '.join(reasons)})"
        raise InputError(fault)
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
    for file, times in files.items():
        if times > 1:
            raise InputError(f"{file}: is given twice: give each database once")
    first = _must_agree(parts[0].scene, scaled=scaled)
    for part in parts[1:]:
        settings = _must_agree(part.scene, scaled=scaled)
        for key, value in first.items():
            if settings[key] != value:
                raise InputError(
                    f"{part.path}: {key} is {shown(settings[key])}, {shown(value)} in"
                    f" {parts[0].path}: they cannot be learnt together"
                )


def _must_agree(scene: Scene, *, scaled: bool) -> dict[str, Any]:
    """Return what all scenes of a fit have in common, by the keys of the scene that decide it."""
    contact = scene.contact
    along, across = scene.grid.sides
    common: dict[str, Any] = {
        "contact.boundary": contact.boundary,
        "contact.kernel": contact.kernel,
        "contact.far_field": contact.far_field,
        "contact.spacing": contact.spacing,
        "surface.side (x over y)": float(f"{along / across:.3g}"),
    }
    if not scaled:
        is_elastic = contact.hardness_limits is None
        common["contact.hardness"] = "none" if is_elastic else "given"
        common["surface.side"] = float(f"{along:.6g}")
        common["contact.modulus / (1 - contact.poisson^2)"] = float(
            f"{contact.e_star:.9g}"
        )
    return common


def remarks(dataset: Dataset, normalisation: str) -> list[str]:
    """List what a user should know of the rows before a model is trained on them.

    Parameters
    ----------
    dataset : Dataset
        The rows.
    normalisation : str
        One of `learn.models.pipeline`.

    Returns
    -------
    list of str
        One line for each remark.
    """
    lines = [
        f"left out {number} rows: {reason}"
        for reason, number in sorted(dataset.dropped.items())
    ]
    lines += damage_of(dataset)
    lines += [
        _constant_inputs(dataset),
        _repeated_rows(dataset),
        _dominant_target(dataset),
    ]
    if normalisation == "l2":
        lines.append(_dominant_input(dataset))
    return [line for line in lines if line]


def damage_of(dataset: Dataset) -> list[str]:
    """List the databases of a dataset with damaged rows, which are learnt like all others.

    Parameters
    ----------
    dataset : Dataset
        The rows.

    Returns
    -------
    list of str
        A warning for each such database.
    """
    damaged = [origin for origin in dataset.origins if origin.damage]
    return [f"warning: {origin.database}: {origin.damage}" for origin in damaged]


def _constant_inputs(dataset: Dataset) -> str:
    """Warn of inputs that are the same in all rows; "" without any."""
    constant = np.flatnonzero(np.ptp(dataset.inputs, axis=0) == 0)
    if not constant.size:
        return ""
    names = ", ".join(dataset.features.columns[place] for place in constant)
    return f"warning: constant over all rows, so of no use to a model: {names}"


def _repeated_rows(dataset: Dataset) -> str:
    """Warn of rows that have the inputs and the target of an earlier one; "" without any."""
    rows = np.column_stack([dataset.inputs, dataset.target])
    repeated = dataset.size - len(np.unique(rows, axis=0))
    if not repeated:
        return ""
    return f"warning: {repeated} rows repeat others exactly"


def _dominant_target(dataset: Dataset) -> str:
    """Warn of a largest target that hides the usual ones in squared errors; "" if it does not."""
    magnitudes = np.abs(dataset.target)
    largest = magnitudes.max()
    usual = np.median(magnitudes[magnitudes > 0])
    if not largest > DOMINANT * usual:
        return ""
    return (
        f"warning: the largest {dataset.target_name} is {largest:.1e}, the median {usual:.1e}:"
        " squared errors see nothing else"
    )


def _dominant_input(dataset: Dataset) -> str:
    """Warn of an input that hides the other ones in rows of unit length; "" without any."""
    sizes = np.median(np.abs(dataset.inputs), axis=0)
    place = int(np.argmax(sizes))
    size_of_rest = float(np.linalg.norm(np.delete(sizes, place)))
    if not sizes[place] > DOMINANT * size_of_rest:
        return ""
    ratio = sizes[place] / max(size_of_rest, 1e-300)
    return (
        f"warning: {dataset.features.columns[place]} is {ratio:.1e} times all other inputs: rows"
        " of unit length say nothing else; try --normalise standard"
    )
