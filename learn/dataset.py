"""Read inputs and targets from a database, and leave out the rows that cannot be used."""

import hashlib
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gen.database import Reader
from gen.runtime.errors import InputError
from gen.scene import Scene
from gen.schema import REASONS, Column, Status, statistics_columns
from learn.arrays import Indices, Values
from learn.features import FeatureSet, chosen
from learn.features.hardness import hardness_limits, modulus
from learn.features.sets import build, target_scale

INPUTS: tuple[str, ...] = ("delta", *(column.name for column in statistics_columns()))
"""The 23 inputs: Delta and the 22 statistics, in the order of the paper's Table 1."""

TARGETS: dict[str, str] = {"area": "area_percent", "force": "force"}
"""Short names of the two targets that every database has, and their columns."""

FURTHER_TARGETS = (
    "contact_nodes",
    "yielded_percent",
    "mean_gap",
    "largest_pressure",
    "perimeter",
)
"""Further results that can be learnt, where the database stores them."""

SMALLEST = 10
"""Usable rows at least: two of these are for testing, and a score needs two."""

DOMINANT = 1e6
"""Ratio of one input to all others together beyond which rows of unit length carry no others: they
fall below the single precision in which trees see their inputs."""


@dataclass(frozen=True, eq=False)
class Dataset:
    """The usable rows of a database.

    Attributes
    ----------
    inputs : ndarray, shape (n, d)
        Inputs, in the units of `gen.schema`.
    target : ndarray, shape (n,)
        The quantity to predict, in the unit of its column over `scale`.
    rows : ndarray, shape (n,)
        Row of each sample in the database.
    groups : ndarray, shape (n,)
        Number of the surface of each sample; samples of one surface share it.
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
        Delta and the 22 statistics, independent of the feature set, in um.
    scale : ndarray, shape (n,)
        Divisor of the target, 1 unless the features are free of units.
    features : str
        Name of the feature set.
    """

    inputs: Values
    target: Values
    rows: Indices
    groups: Indices
    names: tuple[str, ...]
    target_name: str
    unit: str
    dropped: dict[str, int]
    source: dict[str, str]
    described: Values
    scale: Values
    features: str = "paper"

    @property
    def size(self) -> int:
        """Number of usable rows."""
        return self.target.size

    def keeping(self, names: tuple[str, ...]) -> "Dataset":
        """Return the same rows with some of the inputs only.

        Parameters
        ----------
        names : tuple of str
            Columns of these inputs, in the wanted order.
        """
        columns = [self.names.index(name) for name in names]
        return replace(self, inputs=self.inputs[:, columns], names=names)

    def at(self, positions: Indices) -> "Dataset":
        """Return some of the rows only; their surfaces are numbered anew.

        Parameters
        ----------
        positions : ndarray, shape (k,)
            Positions of these rows, in the wanted order.
        """
        _, groups = np.unique(self.groups[positions], return_inverse=True)
        return replace(
            self,
            inputs=self.inputs[positions],
            target=self.target[positions],
            rows=self.rows[positions],
            groups=groups,
            described=self.described[positions],
            scale=self.scale[positions],
        )


def read(
    path: Path,
    target: str = "area",
    area_max: float | None = None,
    features: str = "paper",
    hybrid: Values | None = None,
) -> Dataset:
    """Read and clean a database for one target; see `read_targets`.

    Parameters
    ----------
    path : Path
        A database made by `gen`.
    target : str
        "area", "force", or one of `FURTHER_TARGETS` that the database stores.
    area_max : float, optional
        Largest area that is kept [%]; 16.56 is the paper's range.
    features : str
        A name of `learn.features.SETS`.
    hybrid : ndarray, shape (rows of the database, 7), optional
        The features that the surfaces add to hybrid features.

    Raises
    ------
    InputError
        See `read_targets`.
    """
    (dataset,) = read_targets(path, (target,), area_max, features, hybrid)
    return dataset


def read_targets(
    path: Path,
    targets: Sequence[str],
    area_max: float | None = None,
    features: str = "paper",
    hybrid: Values | None = None,
) -> list[Dataset]:
    """Read a database once, and clean it for each of several targets.

    Parameters
    ----------
    path : Path
        A database made by `gen`.
    targets : sequence of str
        Any of "area", "force", and those of `FURTHER_TARGETS` that the database stores.
    area_max : float, optional
        Largest area that is kept [%]; 16.56 is the paper's range.
    features : str
        A name of `learn.features.SETS`. If it is free of units, so are the targets.
    hybrid : ndarray, shape (rows of the database, 7), optional
        The features that the surfaces add to hybrid features, from `learn.features.regeneration`.

    Returns
    -------
    list of Dataset
        The usable rows for each target.

    Raises
    ------
    InputError
        If the file is no database or lacks a target, too few rows are left, or a target is
        constant.
    """
    chosen(features)
    if area_max is not None and not area_max > 0:
        raise InputError(f"--area-max {area_max:g}: give a percentage above 0")
    stored = _stored(path, targets)
    wanted = chosen(features, hardness_limits(stored.scene))
    made = _features(wanted, stored, hybrid)
    return [_usable(stored, *target, wanted, made, area_max) for target in stored.targets]


@dataclass(frozen=True, eq=False)
class _Stored:
    """The columns of a database that learning needs.

    Attributes
    ----------
    path : Path
        The database.
    scene : Scene
        Its scene.
    versions : str
        The versions that made it.
    first : int
        Its first row.
    status, reason : ndarray, shape (n,)
        Status of each row, and the reason of its failure.
    inputs : ndarray, shape (n, 23)
        Delta and the 22 statistics.
    hardness : ndarray, shape (n,), or None
        Hardness, where it varies [MPa].
    area : ndarray, shape (n,)
        Contact area [%].
    targets : list of tuple
        Column and values, shape (n,), of each target.
    """

    path: Path
    scene: Scene
    versions: str
    first: int
    status: NDArray[np.uint8]
    reason: NDArray[np.uint8]
    inputs: Values
    hardness: Values | None
    area: Values
    targets: list[tuple[Column, Values]]


def _stored(path: Path, targets: Sequence[str]) -> _Stored:
    """Read a database."""
    with Reader(path) as reader:
        draws = reader.scene.contact.draws_hardness
        columns = [_target_column(reader, target) for target in targets]
        return _Stored(
            path=path,
            scene=reader.scene,
            versions=str(reader.attributes["versions"]),
            first=reader.rows.start,
            status=reader.column("status"),
            reason=reader.column("reason"),
            inputs=np.stack([reader.column(name) for name in INPUTS], axis=1),
            hardness=reader.column("hardness") if draws else None,
            area=reader.column("area_percent"),
            targets=[
                (column, np.asarray(reader.column(column.name), dtype=np.float64))
                for column in columns
            ],
        )


def _usable(
    stored: _Stored,
    column: Column,
    values: Values,
    wanted: FeatureSet,
    made: Values,
    area_max: float | None,
) -> Dataset:
    """Keep the rows that can be used for one target."""
    inputs = stored.inputs
    reasons = _reasons(stored.status, stored.reason, inputs, values)
    if area_max is not None:
        reasons[(reasons == "") & (stored.area > area_max)] = f"area above {area_max:g} %"
    odd = (reasons == "") & ~np.isfinite(made).all(axis=1)
    reasons[odd] = f"{wanted.name} features not finite"
    kept = np.flatnonzero(reasons == "")
    dropped = {reason: number for reason, number in sorted(Counter(reasons).items()) if reason}
    _check(stored.path, column.name, values[kept], dropped)
    scene, described = stored.scene, inputs[kept]
    hardness = () if stored.hardness is None else (stored.hardness,)
    side, e_star = scene.surface.side, modulus(scene)
    scale = target_scale(wanted, column.name, described[:, 1:], described[:, 0], side, e_star)
    return Dataset(
        inputs=made[kept],
        target=values[kept] / scale,
        rows=stored.first + kept,
        groups=_surfaces(described),
        names=wanted.columns,
        target_name=column.name,
        unit=column.unit if (scale == 1).all() else "1",
        dropped=dropped,
        source={
            "database": str(stored.path),
            "database_sha256": _digest(stored.status, inputs, values, stored.area, *hardness),
            "scene": scene.text(),
            "versions": stored.versions,
        },
        described=described,
        scale=scale,
        features=wanted.name,
    )


def _features(wanted: FeatureSet, stored: _Stored, hybrid: Values | None) -> Values:
    """Return the features of all rows of a database, finite where they can be used."""
    scene, inputs = stored.scene, stored.inputs
    ratio: Values | float | None = None
    if wanted.needs_hardness and (limits := hardness_limits(scene)) is not None:
        ratio = limits[0] if stored.hardness is None else stored.hardness / modulus(scene)
    with np.errstate(over="ignore", invalid="ignore"):
        return build(
            wanted, inputs[:, 1:], inputs[:, 0], scene.surface.side, hybrid, hardness_ratio=ratio
        )


def short_name(column: str) -> str:
    """Return the name of a target's column in folders and on the command line.

    Parameters
    ----------
    column : str
        The column.
    """
    return next((short for short, name in TARGETS.items() if name == column), column)


def remarks(dataset: Dataset, normalisation: str) -> list[str]:
    """List remarks and warnings about the rows that a user should read before training on them.

    Parameters
    ----------
    dataset : Dataset
        The usable rows.
    normalisation : str
        One of `learn.models.NORMALISATIONS`.

    Returns
    -------
    list of str
        Lines of text, none if there is nothing to remark.
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
    if target.max() > DOMINANT * np.median(target):
        lines.append(
            f"warning: the largest {dataset.target_name} is {target.max():.1e}, the median"
            f" {np.median(target):.1e}: squared errors see nothing else"
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


def _target_column(reader: Reader, target: str) -> Column:
    """Find the column of a target, if the database stores it."""
    name = TARGETS.get(target, target)
    results = (*TARGETS.values(), *FURTHER_TARGETS)
    stored = {column.name: column for column in reader.columns() if column.name in results}
    if name not in stored:
        known = ", ".join([*TARGETS, *(column for column in FURTHER_TARGETS if column in stored)])
        raise InputError(f"--target {target!r}: {reader.path} stores {known}")
    return stored[name]


def _reasons(
    status: NDArray[np.uint8], reason: NDArray[np.uint8], inputs: Values, target: Values
) -> NDArray[np.object_]:
    """Return the reason why each row cannot be used, "" if it can."""
    reasons = np.full(status.size, "", dtype=object)
    with np.errstate(over="ignore", invalid="ignore"):
        square = np.einsum("ij,ij->i", inputs, inputs)
    reasons[~np.isfinite(target)] = "target not finite"
    reasons[~np.isfinite(square)] = "input not finite, or too large to be squared"
    reasons[status == Status.PENDING] = "not computed yet"
    for code in np.unique(reason[status == Status.FAILED]):
        text = REASONS.get(int(code), f"reason {code}") or "no reason given"
        reasons[(status == Status.FAILED) & (reason == code)] = f"failed: {text}"
    return reasons


def _check(path: Path, name: str, target: Values, dropped: dict[str, int]) -> None:
    """Refuse rows that nothing can be learnt from."""
    if target.size < SMALLEST:
        left_out = "; ".join(f"{number} {text}" for text, number in sorted(dropped.items()))
        raise InputError(
            f"{path}: {target.size} usable rows, {SMALLEST} at least are needed"
            + (f" (left out: {left_out})" if left_out else "")
        )
    if np.ptp(target) == 0:
        raise InputError(f"{path}: {name} is {target[0]:g} in all {target.size} usable rows")


def _surfaces(inputs: Values) -> Indices:
    """Number the surfaces: rows of one surface have its 22 statistics in common, bit for bit.

    Not by the column `surface`: where all surfaces are read from one file they differ in number
    only.
    """
    _, group = np.unique(inputs[:, 1:], axis=0, return_inverse=True)
    return np.asarray(group.ravel(), dtype=np.int64)


def _digest(*columns: NDArray[np.generic]) -> str:
    """Return a fingerprint of the columns that decide the results."""
    digest = hashlib.sha256()
    for column in columns:
        digest.update(np.ascontiguousarray(column).tobytes())
    return digest.hexdigest()
