"""The columns of databases that learning needs, and which of their rows belong together.

Rows of one surface are never on both sides of a split, whichever databases they are in. Related are
surfaces with the same statistics, surfaces of one number and one seed, whatever their grid and
generator (they are made of the same random numbers), and windows of one tile of a map; where two
databases cut a map into other tiles, all windows of that map.
"""

import os
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Indices, Values
from gen.database import Reader
from gen.runtime.errors import InputError
from gen.scene import ScanSurface, Scene
from gen.scene.columns import columns_for, parameter_columns
from gen.scene.faults import shown
from gen.schema import REASONS, Column, Reason, Status, statistics_columns
from learn.features.scene import BY_FORCE, given_values, load_of
from learn.features.sets import modulus, patch_length

INPUTS: tuple[str, ...] = ("delta", *(column.name for column in statistics_columns()))
"""The 23 inputs: Delta and the 22 statistics, in the order of the paper's Table 1."""

TARGETS: dict[str, str] = {"area": "area_percent", "force": "force"}
"""Short names of the two targets that every database has, and their columns."""

WHOLE_TARGETS = ("contact_nodes", "contact_spots")
"""Results that are whole numbers, and are learnt like real numbers."""

NO_TARGETS = frozenset({*INPUTS, "load", "hardness", "residual"})
"""Columns of floating numbers that are no results: inputs, and how well a row was solved."""

MAP, TILE = "map", "tile"
"""Columns of the map and of its tile that a surface was cut out of."""

DIGITS = 8
"""Digits of a file's hash in the labels of maps, so that maps of one name differ."""


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
    found = {
        column.name: column
        for column in columns_for(scene)
        if column.name in WHOLE_TARGETS
        or (
            column.dtype == "f8"
            and not (column.group or column.shape_of)
            and column.name not in given
        )
    }
    return {name: found[name] for name in TARGETS.values() if name in found} | found


class Population(NamedTuple):
    """Where surfaces come from: those of one population are more alike than those of others."""

    database: str
    generator: str
    map: str = ""  # file name and hash of the map of a window


class Origin(NamedTuple):
    """A database that usable rows were read from, with the text of its scene."""

    database: str
    sha256: str  # of the columns that decide the results
    scene: str
    rows: int


@dataclass(frozen=True, eq=False)
class Stored:
    """The columns of some rows of a database, each (n,) unless said otherwise."""

    path: Path
    scene: Scene
    versions: str
    rows: Indices  # their numbers
    status: NDArray[np.uint8]
    reason: NDArray[np.uint8]  # of a failure, or of statistics that are undefined
    inputs: Values  # (n, 23), Delta and the 22 statistics
    hardness: Values | None  # where it varies [MPa]
    given: dict[str, Values]  # what the scene draws, and loads, see `learn.features.scene`
    map: Indices | None  # where surfaces are windows of maps
    tile: Indices | None
    area: Values  # [%]
    targets: list[tuple[Column, Values]]

    @property
    def length(self) -> float:
        """Scan length L of all rows [um]."""
        return patch_length(self.scene.sides)

    @property
    def undefined(self) -> NDArray[np.bool_]:
        """Done rows whose surfaces do not define all statistics, (n,)."""
        solved = self.status == Status.DONE
        return np.asarray(solved & (self.reason == Reason.NO_STATISTICS))

    def at(self, positions: Indices) -> "Stored":
        """Return the rows at some positions, (k,)."""
        arrays: dict[str, Any] = {
            name: value[positions]
            for name, value in vars(self).items()
            if isinstance(value, np.ndarray)
        }
        targets = [(column, values[positions]) for column, values in self.targets]
        given = {name: values[positions] for name, values in self.given.items()}
        return replace(self, **arrays, targets=targets, given=given)


def read_stored(path: Path, targets: Sequence[str], load: str = "delta") -> Stored:
    """Read the columns of a database for a load; targets are short names or columns.

    InputError is raised if the file is no database, or lacks a target.
    """
    with Reader(path) as reader:
        places = reader.scene.surface.PLACES.keys()

        def whole(name: str) -> Indices | None:
            return np.asarray(reader.column(name), dtype=np.int64) if name in places else None

        columns = [_target_column(reader, target, load) for target in targets]
        draws = reader.scene.contact.draws_hardness
        return Stored(
            path=path,
            scene=reader.scene,
            versions=str(reader.attributes["versions"]),
            rows=np.array(reader.rows, dtype=np.int64),
            status=reader.column("status"),
            reason=reader.column("reason"),
            inputs=np.stack([reader.column(name) for name in INPUTS], axis=1),
            hardness=reader.column("hardness") if draws else None,
            given=given_values(reader.scene, reader.column),
            map=whole(MAP),
            tile=whole(TILE),
            area=reader.column("area_percent"),
            targets=[
                (column, np.asarray(reader.column(column.name), dtype=np.float64))
                for column in columns
            ],
        )


def load_drawn(path: Path) -> str:
    """Return the name of the load that a database's scene draws."""
    with Reader(path) as reader:
        return load_of(reader.scene)


def _target_column(reader: Reader, target: str, load: str) -> Column:
    """Find the column of a target, if the database stores it and it is not the load."""
    found = results(reader.scene, load)
    name = TARGETS.get(target, target)
    if name in found:
        return found[name]
    known = ", ".join(short_name(column) for column in found)
    alone = "give one target alone; " if "," in target else ""
    raise InputError(f"--target {target!r}: {alone}{reader.path} stores {known}")


def reasons_against(stored: Stored, target: Values) -> NDArray[np.object_]:
    """Return the reason why each row cannot be used with any features, (n,); "" if it can."""
    status, reason = stored.status, stored.reason
    reasons = np.full(status.size, "", dtype=object)
    excused = stored.undefined[:, None] & np.isnan(stored.inputs)
    inputs = np.where(excused, 0.0, stored.inputs)
    with np.errstate(over="ignore", invalid="ignore"):
        square = np.einsum("ij,ij->i", inputs, inputs)
    reasons[~np.isfinite(target)] = "target not finite"
    reasons[~np.isfinite(square)] = "input not finite, or too large to be squared"
    reasons[~np.isin(status, list(Status))] = "status unknown"
    reasons[status == Status.PENDING] = "not computed yet"
    for code in np.unique(reason[status == Status.FAILED]):
        text = REASONS.get(int(code), f"reason {code}") or "no reason given"
        reasons[(status == Status.FAILED) & (reason == code)] = f"failed: {text}"
    return reasons


def require_compatible(parts: Sequence[Stored], *, scaled: bool) -> None:
    """Refuse databases that no single surrogate describes, or that are given twice.

    With `scaled` features, which have no units, scan length and E* make no difference, and elastic
    bodies are very hard ones. InputError names the first key that differs, and the file that has
    it.
    """
    files = Counter(os.path.realpath(part.path) for part in parts)
    for file in [file for file, times in files.items() if times > 1]:
        raise InputError(f"{file}: is given twice: give each database once")
    wanted = _must_agree(parts[0].scene, scaled=scaled)
    for part in parts[1:]:
        for key, value in _must_agree(part.scene, scaled=scaled).items():
            if value != wanted[key]:
                raise InputError(
                    f"{part.path}: {key} is {shown(value)}, {shown(wanted[key])} in"
                    f" {parts[0].path}: they cannot be learnt together"
                )


def _must_agree(scene: Scene, *, scaled: bool) -> dict[str, Any]:
    """Return what all scenes of a fit have in common, by the keys of the scene that decide it."""
    contact, (along, across) = scene.contact, scene.sides
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
            "contact.modulus / (1 - contact.poisson^2)": float(f"{modulus(scene):.9g}"),
        }
    return common


def populations(parts: Sequence[Stored]) -> tuple[Indices, tuple[Population, ...]]:
    """Return the number of each row's population, (n,), and the populations by their numbers."""
    names = [each for part in parts for each in _populations(part)]
    known = {name: number for number, name in enumerate(dict.fromkeys(names))}
    return np.array([known[name] for name in names], dtype=np.int64), tuple(known)


def _populations(part: Stored) -> Iterator[Population]:
    """Yield the population of each row of a database."""
    surface = part.scene.surface
    own = Population(str(part.path), str(getattr(surface, "generator", "")))
    if part.map is None or not isinstance(surface, ScanSurface):
        return iter([own] * part.rows.size)
    maps = [
        own._replace(map=f"{Path(each.file).name} {each.sha256[:DIGITS]}")
        for each in surface.known().maps
    ]
    return (maps[index] for index in part.map)


def related(parts: Sequence[Stored]) -> Indices:
    """Number the groups of rows that every split keeps together, (n,), database by database."""
    surfaces = _surfaces(np.concatenate([part.inputs[:, 1:] for part in parts]))
    labels = [surfaces]
    if any(part.tile is not None for part in parts):
        labels.append(_numbered(parts, [_tiles(part, parts) for part in parts]))
    if len(parts) > 1:
        labels.append(_numbered(parts, [_seeded(part) for part in parts]))
    return surfaces if len(labels) == 1 else linked(*labels)


def _surfaces(statistics: Values) -> Indices:
    """Number the surfaces: rows of one surface have its 22 statistics in common, bit for bit.

    Not by the column `surface`: where all surfaces are read from one file they differ in number
    only. No statistic is minus infinity, which stands for those that a surface does not define: NaN
    differs from itself.
    """
    defined = np.where(np.isnan(statistics), -np.inf, statistics)
    _, group = np.unique(defined, axis=0, return_inverse=True)
    return np.asarray(group.ravel(), dtype=np.int64)


Labels = tuple[object, Indices] | None
"""The kind of groups that a database's rows belong to, and their numbers, (n,); None for single
rows.
"""


def _seeded(part: Stored) -> Labels:
    """Number surfaces by the random numbers that made them; windows of maps by their tiles only."""
    if part.tile is not None:
        return None
    return ("seed", part.scene.seed), part.rows // part.scene.samples_per_surface


def _tiles(part: Stored, parts: Sequence[Stored]) -> Labels:
    """Number the windows of a database by their tiles, or by their maps where tiles differ."""
    surface = part.scene.surface
    if part.tile is None or part.map is None or not isinstance(surface, ScanSurface):
        return None
    own = _hashes(part.scene)
    shared = [other for other in parts if other is not part and own & _hashes(other.scene)]
    tiling = _tiling(part.scene)
    if all(_tiling(other.scene) == tiling for other in shared):
        return ("tiles", tiling), part.tile
    if any(each.scene.surface.against is not None for each in (part, *shared)):
        raise InputError(
            f"{part.path}: has windows of maps of {shared[0].path} in other tiles, and a second"
            " rough body: no split of both would keep their nodes apart"
        )
    numbers = np.array([int(each.sha256[:15], 16) for each in surface.known().maps])
    return "maps", numbers[part.map]


def _tiling(scene: Scene) -> str:
    """Return the table of surfaces of a scene, which decides the tiles of its maps."""
    content = scene.surface.model_dump(exclude_none=True)
    return str(sorted(scene.surface.relevant(content).items()))


def _hashes(scene: Scene) -> set[str]:
    """Return the hashes of a scene's maps."""
    surface = scene.surface
    if not isinstance(surface, ScanSurface):
        return set()
    found = [surface.known(), *filter(None, (surface.against_found,))]
    return {each.sha256 for maps in found for each in maps.maps}


def _numbered(parts: Sequence[Stored], labels: Sequence[Labels]) -> Indices:
    """Number the labels of all databases' rows, (n,); rows without a label stand alone."""
    kinds = {label[0]: number for number, label in enumerate(filter(None, labels))}
    pairs = np.empty((sum(part.rows.size for part in parts), 2), dtype=np.int64)
    start = 0
    for part, label in zip(parts, labels, strict=True):
        rows = slice(start, start + part.rows.size)
        alone = -1, np.arange(rows.start, rows.stop)
        pairs[rows, 0], pairs[rows, 1] = alone if label is None else (kinds[label[0]], label[1])
        start = rows.stop
    _, numbers = np.unique(pairs, axis=0, return_inverse=True)
    return np.asarray(numbers.ravel(), dtype=np.int64)


def linked(*labels: Indices) -> Indices:
    """Number the groups, (n,), of rows that share a label, each (n,), directly or by other rows."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    rows = np.arange(labels[0].size)
    nodes, first = [], rows.size
    for each in labels:
        values, place = np.unique(each, return_inverse=True)
        nodes.append(first + place.ravel())
        first += values.size
    ends = np.tile(rows, len(labels)), np.concatenate(nodes)
    graph = coo_array((np.ones(ends[0].size), ends), shape=(first, first))
    _, component = connected_components(graph, directed=False)
    _, group = np.unique(component[: rows.size], return_inverse=True)
    return np.asarray(group.ravel(), dtype=np.int64)
