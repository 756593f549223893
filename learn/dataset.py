"""The rows from which models learn: reading databases, and leaving out rows without use."""

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
from gen.quantities import OF_LAYERS, QUANTITIES, Powers
from gen.runtime.errors import InputError
from gen.scene import Scene, columns_for, parameter_columns
from gen.scene.faults import shown
from gen.scene.tables import Contact
from gen.schema import REASONS, Column, Reason, Status
from learn.database_rows import Dataset, Origin, Stored
from learn.executor import Executor
from learn.features import FeatureSet, chosen
from learn.features.columns import STATISTICS
from learn.features.layers import LayerKind, Layers
from learn.features.rows import Rows
from learn.features.scene import BY_FORCE, SCENE, load_of, numbers_of_rows
from learn.split import MAP, TILE, populations_of, surface_groups

# Columns of the two targets that every database has, by their short names on the command line.
TARGETS: dict[str, str] = {"area": "area_percent", "force": "force"}
# Columns of real numbers that are no targets: inputs, and the residual of the solve.
NO_TARGETS = frozenset({"delta", *STATISTICS, "load", "hardness", *OF_LAYERS, "residual"})
# Smallest number of usable rows. A fifth of them, two rows, test a model; a score needs two.
SMALLEST = 10
# Largest ratio without a warning that one number hides all others from a model. It is the ratio of
# the largest input to the others if rows are scaled to unit length, and that of the largest target
# to the median, because errors are squared.
DOMINANT = 1e6


@dataclass(frozen=True)
class Request:
    """The options of a comparison or a fit."""

    databases: tuple[Path, ...]  # databases from which models learn, one or more
    output: Path = Path()  # a comparison folder, or the file of a surrogate
    targets: tuple[str, ...] = ("area",)  # columns, or short names in `TARGETS`
    models: tuple[str, ...] = ()  # names of models; empty for all models of the features
    # rows with larger areas are left out [%]; None to keep all
    area_max: float | None = None
    normalisation: str = "l2"  # scaling of the inputs, see `learn.models.pipeline`
    features: str = "paper"  # name of a feature set, one of `learn.features.SETS`
    seed: int = 0  # of the split and of the models
    train_rows: int | None = None  # largest number of training rows; None for no limit
    again: bool = False  # True to repeat fits whose results are in the folder
    until: float = math.inf  # time of `time.time` at which searches end [s]
    # smallest number of candidates of each model that a search judges on all rows; None for whole
    # grids, or for as many as there is time for
    candidates: int | None = None
    roots: bool = False  # True for the features of surrogates, with square roots
    blocks: int | None = None  # blocks per side of hybrid features; None for the default
    calibrate_on: Path | None = None  # database whose rows calibrate the intervals
    # comparison folder from which the models' settings are taken
    source: Path | None = None
    # Load of the features, one of `learn.features.scene.LOADS`. "" is the load that the scene draws
    # for the feature set `scene`, and Delta for other sets.
    load: str = ""


def short_name(column: str) -> str:
    """Return the name of a target in folders and on the command line.

    Parameters
    ----------
    column : str
        Name of the column.

    Returns
    -------
    str
        The short name in `TARGETS`, or the name of the column if it has none.
    """
    for short, name in TARGETS.items():
        if name == column:
            return short
    return column


def results(scene: Scene, load: str = "delta") -> dict[str, Column]:
    """Return the columns of a scene's database that can be learnt under a load.

    Under a pressure or a force, Delta can be learnt, and the force cannot.

    Parameters
    ----------
    scene : Scene
        The scene.
    load : str
        One of `learn.features.scene.LOADS`.

    Returns
    -------
    dict of str to Column
        Columns by name, with area and force first.
    """
    not_learnt = NO_TARGETS | set(parameter_columns(scene).values())
    if load in BY_FORCE:
        not_learnt = (not_learnt - {"delta"}) | {"force"}
    columns = {}
    for column in columns_for(scene):
        is_field = bool(column.shape_of)
        is_real = column.dtype == "f8" and not column.group and not is_field
        if _is_count(column) or (is_real and column.name not in not_learnt):
            columns[column.name] = column
    first = {name: columns[name] for name in TARGETS.values() if name in columns}
    return first | columns


def unknown_target(
    target: str, source: str, results_by_name: Mapping[str, Column], load: str
) -> str:
    """Say why something cannot be learnt under a load, and what can.

    Parameters
    ----------
    target : str
        Name of a target that is not among the results.
    source : str
        What stores the results, such as the path of a database.
    results_by_name : mapping of str to Column
        The columns that can be learnt, as `results` returns them.
    load : str
        One of `learn.features.scene.LOADS`.

    Returns
    -------
    str
        One line, which names --target.
    """
    if target == "force" and load in BY_FORCE:
        reason = "the force is the load, or follows from it; "
    elif target == "delta" and load not in BY_FORCE:
        reason = "Delta is the load; it is a target under --load pressure; "
    else:
        reason = ""
    names = ", ".join(map(short_name, results_by_name))
    return f"--target {target!r}: {reason}{source} stores {names}"


def _is_count(column: Column) -> bool:
    """Tell whether a column counts something, such as nodes in contact.

    Counts are learnt like real numbers. Whole numbers that are codes are no counts.
    """
    quantity = QUANTITIES.get(column.name)
    return quantity is not None and quantity.dtype.startswith("i") and not quantity.code


def read(
    request: Request,
    executor: Executor | None = None,
    stopping: Callable[[], bool] = lambda: False,
    *,
    common: bool = False,
) -> list[Dataset]:
    """Read the databases of a request, and choose the usable rows for each of its targets.

    Hybrid features need a coarse solve of each surface. The results are kept in a file beside each
    database; rows without results are computed.

    Parameters
    ----------
    request : Request
        Databases, targets and features.
    executor : Executor, optional
        Processes that generate surfaces for hybrid features; this process if left out.
    stopping : callable
        Function that is called while surfaces are generated. Once it returns True, reading ends.
    common : bool
        True to keep only the rows in which all targets are finite.

    Returns
    -------
    list of Dataset
        Usable rows for each target, in the order of the request. The list is empty after a stop.

    Raises
    ------
    InputError
        If an option of the request is wrong, a file is no database or lacks a target, databases
        cannot be learnt together, too few rows are usable, or a target is constant. For hybrid
        features also if surfaces cannot be generated anew, or are other surfaces then; see
        `learn.regeneration.coarse_solves`.
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
    selection = Selection(features=features, area_max=request.area_max, common=common)
    return [selection.dataset(parts, number) for number in range(len(request.targets))]


def _usual_load(request: Request) -> str:
    """Return the load of a request that names none.

    For the feature set `scene` it is the load that the scene of the first database draws. For other
    sets it is "delta".
    """
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
    """Return the rows of each database with the Deltas and columns of their coarse solves.

    The list is empty after a stop. Reads and writes the file beside each database.
    """
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
    """Read the columns of a database that learning needs.

    Parameters
    ----------
    path : Path
        The database.
    request : Request
        The request, of which the targets and the name of the feature set are used.
    load : str
        Load of the features, one of `learn.features.scene.LOADS`.

    Returns
    -------
    Stored
        All rows, without columns of coarse solves. Under a pressure, features of surfaces have a
        length in place of Delta (`learn.features.rows.by_pressure`).

    Raises
    ------
    InputError
        If the file is no database, or a target is no column that can be learnt; see `results`.
    """
    with Reader(path) as reader:
        scene = reader.scene
        targets = _target_columns(path, scene, request.targets, load)
        names = {"status", "reason", "area_percent"}
        names |= {column.name for column in targets}
        names |= {name for name in (MAP, TILE) if name in scene.surface.PLACES}
        if scene.contact.draws_hardness:
            names.add("hardness")
        if scene.contact.layer is not None:
            names |= scene.contact.layer.drawn.keys()
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
    """Return the columns of targets, which are named by column or short name; refuse unknown ones.

    `path` is the database, for the message.
    """
    stored_results = results(scene, load)
    columns = []
    for target in targets:
        name = TARGETS.get(target, target)
        if name not in stored_results:
            raise InputError(unknown_target(target, str(path), stored_results, load))
        columns.append(stored_results[name])
    return columns


def _quantities(reader: Reader, features: str, load: str) -> Rows:
    """Read the numbers from which the features of a set are computed under a load.

    `features` is the name of the set. Return the numbers of all rows, without columns of coarse
    solves.
    """
    scene = reader.scene
    scene_numbers: Mapping[str, Values] = {}
    if features == SCENE or load != "delta":
        scene_numbers = numbers_of_rows(scene, reader.column)
    layers = Layers.of_rows(scene, reader.column)
    e_star: Values | float = scene.contact.e_star
    if layers is not None:
        e_star = layers.e_star
    # Length and nodes along a side are the geometric means over both axes.
    quantities = Rows(
        statistics=np.stack([reader.column(name) for name in STATISTICS], axis=1),
        delta=reader.column("delta"),
        length=math.sqrt(math.prod(scene.grid.sides)),
        hardness_ratio=_hardness_ratio(reader, e_star),
        nodes=math.sqrt(math.prod(scene.grid.shape)),
        scene_numbers=scene_numbers,
        layers=layers,
    )
    if load == "pressure" and features != SCENE:
        return quantities.under(scene_numbers["pressure"], e_star)
    return quantities


def _hardness_ratio(reader: Reader, e_star: Values | float) -> Values | float | None:
    """Return the hardness over E*: (n,) if the scene draws one of them, otherwise one number.

    It is None for elastic bodies. `e_star` is E* of the rows [MPa].
    """
    contact = reader.scene.contact
    if contact.hardness_limits is None:
        return None
    if contact.draws_hardness:
        return np.asarray(reader.column("hardness") / e_star)
    constant, _ = contact.hardness_limits  # equal numbers, as the scene does not draw it
    return constant / e_star


@dataclass(frozen=True, eq=False)
class UsableRows:
    """The k usable rows of one database for one target."""

    # The database: `rows`, `columns` and `described` have the k usable rows only, while
    # `quantities` still have all rows.
    part: Stored
    inputs: Values  # (k, d), features
    target: Values  # (k,), values of the target's column over `scale`
    scale: Values  # (k,), divisor of the target
    origin: Origin  # the database
    reasons: list[str]  # a reason for each row of the database that is left out


@dataclass(frozen=True)
class Selection:
    """The conditions under which rows are usable, with a method that applies them.

    Parameters
    ----------
    features : FeatureSet
        Features, which have to be finite.
    area_max : float or None
        Largest area of usable rows [%]; None for no limit.
    common : bool
        True if all targets of a usable row are finite, False if only the target of the dataset has
        to be finite.
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
            Position of the target in `Stored.targets`.

        Returns
        -------
        Dataset
            The usable rows, database by database.

        Raises
        ------
        InputError
            If too few rows are usable, a database has none, the target is constant, or windows of
            maps cannot be grouped; see `learn.split.surface_groups`.
        """
        column = parts[0].targets[number]
        powers = self._shared_powers(parts, number)
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
        unit = column.unit
        if (scale != 1).any():  # The scale has the unit of the column.
            unit = "1"
        return Dataset(
            inputs=np.concatenate([database.inputs for database in databases]),
            target=target,
            rows=np.concatenate([part.rows for part in usable]),
            groups=surface_groups(usable),
            database=np.repeat(np.arange(len(parts)), sizes),
            population=_population_numbers(usable),
            features=self.features,
            target_name=column.name,
            unit=unit,
            dropped=dict(sorted(dropped.items())),
            described=np.concatenate([part.described for part in usable]),
            scale=scale,
            origins=origins,
            name=", ".join(origin.database for origin in origins),
            powers=powers,
            sha256=_joint_fingerprint(origins),
            by_tile=all(TILE in part.columns for part in parts),
        )

    def _shared_powers(self, parts: Sequence[Stored], number: int) -> Powers | None:
        """Return the powers that a target scales with in all databases.

        They are None if the target keeps its unit. `number` is the position of the target in
        `Stored.targets`.
        """
        powers = parts[0].targets[number].powers
        # A user's outputs may have equal names in two databases, and different powers.
        if any(part.targets[number].powers != powers for part in parts):
            return None
        # Features with units have no thickness, so that their answers hold for one layer alone.
        has_layers = any(part.scene.contact.layer is not None for part in parts)
        if has_layers and not self.features.scaled:
            return None
        return powers

    def _usable(self, part: Stored, number: int, powers: Powers | None) -> UsableRows:
        """Return the usable rows of a database for one target.

        `number` is the target's position in `Stored.targets`, and `powers` are its powers of
        heights, lengths and E*. The target is divided by its scale (`FeatureSet.scale`), which is 1
        if `powers` is None.
        """
        targets = [
            np.asarray(part.columns[column.name], np.float64) for column in part.targets
        ]
        target = targets[number]
        must_be_finite = [target]
        if self.common:
            must_be_finite = targets
        finite = np.asarray(np.isfinite(must_be_finite).all(axis=0))
        # Features that overflow or are undefined are a reason to leave out their rows.
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
        """Return the reason why each row is left out, (n,); "" for usable rows.

        `inputs` are the features, (n, d). `finite`, (n,), is True for rows whose target is finite,
        or all of whose targets are finite (`common`). A later assignment replaces an earlier
        reason. A row that is done although its surface does not define all statistics is usable if
        the features do not need them.
        """
        status = part.columns["status"]
        reason = part.columns["reason"]
        no_statistics = (status == Status.DONE) & (reason == Reason.NO_STATISTICS)
        reasons = np.full(status.size, "", dtype=object)
        reasons[~finite] = "target not finite"
        # Statistics that the surface does not define are no reason here: 0 stands in for them.
        undefined = no_statistics[:, None] & np.isnan(part.described)
        described = np.where(undefined, 0.0, part.described)
        with np.errstate(over="ignore", invalid="ignore"):
            squares = np.einsum("ij,ij->i", described, described)
        reasons[~np.isfinite(squares)] = "input not finite, or too large to be squared"
        reasons[~np.isin(status, list(Status))] = "status unknown"
        reasons[status == Status.PENDING] = "not computed yet"
        failed = status == Status.FAILED
        for code in np.unique(reason[failed]):
            text = REASONS.get(int(code), f"reason {code}") or "no reason given"
            reasons[failed & (reason == code)] = f"failed: {text}"
        # The following reasons are for rows that have none of the reasons above.
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
    """Return the SHA-256 of the columns of a database that decide what a model learns.

    These are status, Delta (or the length in its place, see `Stored.described`), statistics,
    target, area and, if the scene draws them, hardness, thickness and modulus of a layer. `target`
    is the whole column, (n,).
    """
    columns = [part.columns["status"], part.described, target]
    columns.append(part.columns["area_percent"])
    of_bodies = ("hardness", *OF_LAYERS)
    columns += [part.columns[name] for name in of_bodies if name in part.columns]
    digest = hashlib.sha256()
    for column in columns:
        digest.update(np.ascontiguousarray(column).tobytes())
    return digest.hexdigest()


def _joint_fingerprint(origins: Sequence[Origin]) -> str:
    """Return the fingerprint of the only database, or a SHA-256 of the fingerprints of several."""
    if len(origins) == 1:
        return origins[0].sha256
    joint = "".join(origin.sha256 for origin in origins)
    return hashlib.sha256(joint.encode()).hexdigest()


def _population_numbers(parts: Sequence[Stored]) -> Indices:
    """Return the number of the population of each row, (n,), database by database.

    Populations with equal names (`populations_of`) are one population. They are numbered in the
    order of their first rows.
    """
    names: list[str] = []
    for part in parts:
        names += populations_of(part)
    different_names = dict.fromkeys(names)
    numbers = {name: number for number, name in enumerate(different_names)}
    return np.array([numbers[name] for name in names], dtype=np.int64)


def _require_usable(
    target: str, values: Values, origins: Sequence[Origin], dropped: Mapping[str, int]
) -> None:
    """Refuse fewer usable rows than `SMALLEST`, a database without any, and a constant target.

    Takes the name of the target, its values in the usable rows, (n,), the databases, and the number
    of rows left out by reason.
    """
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
    """Refuse databases that one surrogate cannot describe, and databases that are given twice.

    With `scaled` features, which have no units, scan lengths and E* may differ, and elastic bodies
    may be learnt together with bodies that yield: they are taken for very hard ones.
    """
    files = Counter(os.path.realpath(part.path) for part in parts)
    for file, times in files.items():
        if times > 1:
            raise InputError(f"{file}: is given twice: give each database once")
    first = _common_settings(parts[0].scene, scaled=scaled)
    for part in parts[1:]:
        settings = _common_settings(part.scene, scaled=scaled)
        for key, value in first.items():
            if settings[key] != value:
                raise InputError(
                    f"{part.path}: {key} is {shown(settings[key])}, {shown(value)} in"
                    f" {parts[0].path}: they cannot be learnt together"
                )


def _common_settings(scene: Scene, *, scaled: bool) -> dict[str, Any]:
    """Return the settings of a scene that must be equal in all scenes of a fit.

    They are returned by their keys in scenes. Sides and moduli are rounded, so that numbers that
    differ by a rounding error are equal.
    """
    contact = scene.contact
    along, across = scene.grid.sides
    common: dict[str, Any] = {
        "contact.boundary": contact.boundary,
        "contact.kernel": contact.kernel,
        "contact.far_field": contact.far_field,
        "contact.spacing": contact.spacing,
        "surface.side (x over y)": float(f"{along / across:.3g}"),
        "contact.layer": _layer_setting(contact, scaled=scaled),
    }
    if not scaled:
        common["contact.hardness"] = "given"
        if contact.hardness_limits is None:
            common["contact.hardness"] = "none"
        common["surface.side"] = float(f"{along:.6g}")
        common["contact.modulus / (1 - contact.poisson^2)"] = float(
            f"{contact.e_star:.9g}"
        )
    return common


def _layer_setting(contact: Contact, *, scaled: bool) -> str:
    """Return what layers must have in common, in words; "none" for half-spaces.

    These are all their numbers, or Poisson's ratios alone for `scaled` features, which have the
    other numbers.
    """
    body = contact.body({})
    if body is None:
        return "none"
    if scaled:
        return LayerKind.of(body).text
    return contact.layer_text


def remarks(dataset: Dataset, normalisation: str) -> list[str]:
    """List the remarks that a user should read before a model is trained on the rows.

    Parameters
    ----------
    dataset : Dataset
        The rows.
    normalisation : str
        Scaling of the inputs, as for `learn.models.pipeline`.

    Returns
    -------
    list of str
        One line for each remark: rows left out, damaged rows, and inputs or targets from which a
        model cannot learn well.
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
    """Return warnings of damaged rows, from which models learn as from any other row.

    Parameters
    ----------
    dataset : Dataset
        The rows.

    Returns
    -------
    list of str
        A warning for each database with damaged rows.
    """
    damaged = [origin for origin in dataset.origins if origin.damage]
    return [f"warning: {origin.database}: {origin.damage}" for origin in damaged]


def _constant_inputs(dataset: Dataset) -> str:
    """Return a warning of inputs that are constant over all rows; "" if there are none."""
    constant = np.flatnonzero(np.ptp(dataset.inputs, axis=0) == 0)
    if not constant.size:
        return ""
    names = ", ".join(dataset.features.columns[place] for place in constant)
    return f"warning: constant over all rows, so of no use to a model: {names}"


def _repeated_rows(dataset: Dataset) -> str:
    """Return a warning of rows with inputs and target of another row; "" if there are none."""
    rows = np.column_stack([dataset.inputs, dataset.target])
    repeated = dataset.size - len(np.unique(rows, axis=0))
    if not repeated:
        return ""
    return f"warning: {repeated} rows repeat others exactly"


def _dominant_target(dataset: Dataset) -> str:
    """Return a warning if the largest target hides the median one in squared errors; else ""."""
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
    """Return a warning if one input hides all others in rows of unit length; else ""."""
    sizes = np.median(np.abs(dataset.inputs), axis=0)
    place = int(np.argmax(sizes))
    size_without = float(np.linalg.norm(np.delete(sizes, place)))
    if not sizes[place] > DOMINANT * size_without:
        return ""
    # All other inputs may be 0.
    ratio = sizes[place] / max(size_without, 1e-300)
    return (
        f"warning: {dataset.features.columns[place]} is {ratio:.1e} times all other inputs: rows"
        " of unit length say nothing else; try --normalise standard"
    )
