"""The columns of a database by their role in learning: inputs, targets, places; and their content.

`read_stored` reads them, and `reasons_against` says why some rows cannot be used.
"""

import os
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
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


def short_name(column: str) -> str:
    """Return the name of a target's column in folders and on the command line."""
    return next((short for short, name in TARGETS.items() if name == column), column)


def results(scene: Scene) -> dict[str, Column]:
    """Return the columns of a scene's database that can be learnt, by their names.

    Area and force come first, then the other results in the order of the file.
    """
    given = NO_TARGETS | drawn_names(scene)
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
    return {name: found[name] for name in TARGETS.values()} | found


def drawn_names(scene: Scene) -> set[str]:
    """Return the columns of a scene's database that hold parameters of the surfaces."""
    return set(parameter_columns(scene).values())


@dataclass(frozen=True, eq=False)
class Stored:
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
        Status of each row, and the reason of its failure or of the statistics that it lacks.
    inputs : ndarray, shape (n, 23)
        Delta and the 22 statistics.
    hardness : ndarray, shape (n,), or None
        Hardness, where it varies [MPa].
    map, tile : ndarray of int, shape (n,), or None
        Map and tile of each surface, where surfaces are windows of maps.
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
    map: Indices | None
    tile: Indices | None
    area: Values
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


def read_stored(path: Path, targets: Sequence[str]) -> Stored:
    """Read the columns of a database that learning needs.

    Targets are short names or columns. InputError is raised if the file is no database, or lacks
    one.
    """
    with Reader(path) as reader:
        draws = reader.scene.contact.draws_hardness
        places = reader.scene.surface.PLACES.keys()
        columns = [_target_column(reader, target) for target in targets]
        return Stored(
            path=path,
            scene=reader.scene,
            versions=str(reader.attributes["versions"]),
            first=reader.rows.start,
            status=reader.column("status"),
            reason=reader.column("reason"),
            inputs=np.stack([reader.column(name) for name in INPUTS], axis=1),
            hardness=reader.column("hardness") if draws else None,
            map=_whole(reader, MAP) if MAP in places else None,
            tile=_whole(reader, TILE) if TILE in places else None,
            area=reader.column("area_percent"),
            targets=[
                (column, np.asarray(reader.column(column.name), dtype=np.float64))
                for column in columns
            ],
        )


def _whole(reader: Reader, name: str) -> Indices:
    """Read a column of whole numbers."""
    return np.asarray(reader.column(name), dtype=np.int64)


def _target_column(reader: Reader, target: str) -> Column:
    """Find the column of a target, if the database stores it."""
    found = results(reader.scene)
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


DIGITS = 8
"""Digits of a file's hash in the labels of maps, so that maps of one name differ."""


class Population(NamedTuple):
    """Where surfaces come from: those of one population are more alike than those of others.

    Attributes
    ----------
    database : str
        Path of the database.
    generator : str
        Name of the generator.
    map : str
        File name and hash of the map that windows were cut out of; "" for other generators.
    """

    database: str
    generator: str
    map: str = ""


class Origin(NamedTuple):
    """A database that rows were read from.

    Attributes
    ----------
    database : str
        Path of the database.
    sha256 : str
        Fingerprint of the columns that decide the results.
    scene : str
        Text of the scene.
    rows : int
        Number of usable rows.
    """

    database: str
    sha256: str
    scene: str
    rows: int


@dataclass(frozen=True, eq=False)
class Placed:
    """The rows of a database, with the labels that rows of other databases may share.

    Attributes
    ----------
    path, scene : Path, Scene
        The database and its scene.
    rows : ndarray of int, shape (n,)
        Numbers of the rows.
    statistics : ndarray, shape (n, 22)
        Statistics of the surfaces, NaN where a surface does not define one.
    map, tile : ndarray of int, shape (n,), or None
        Map and tile of each window; None for other surfaces.
    """

    path: Path
    scene: Scene
    rows: Indices
    statistics: Values
    map: Indices | None
    tile: Indices | None


def require_compatible(scenes: Sequence[tuple[Path, Scene]], *, scaled: bool) -> None:
    """Refuse databases that no single surrogate describes.

    With `scaled` features, which have no units, scan length and E* make no difference, and elastic
    bodies are very hard ones. InputError names the first key that differs, and the file that has
    it.
    """
    (first, reference), *others = scenes
    wanted = _must_agree(reference, scaled=scaled)
    for path, scene in others:
        for key, value in _must_agree(scene, scaled=scaled).items():
            if value != wanted[key]:
                raise InputError(
                    f"{path}: {key} is {shown(value)}, {shown(wanted[key])} in {first}: they cannot"
                    " be learnt together"
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


def populations(placed: Sequence[Placed]) -> tuple[Indices, tuple[Population, ...]]:
    """Return the number of each row's population, (n,), and the populations by their numbers."""
    names = [each for part in placed for each in _populations(part)]
    known = {name: number for number, name in enumerate(dict.fromkeys(names))}
    return np.array([known[name] for name in names], dtype=np.int64), tuple(known)


def _populations(part: Placed) -> Iterator[Population]:
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


def related(placed: Sequence[Placed]) -> Indices:
    """Number the groups of rows that every split keeps together, (n,), database by database."""
    surfaces = _surfaces(np.concatenate([part.statistics for part in placed]))
    labels = [surfaces]
    if any(part.tile is not None for part in placed):
        labels.append(_numbered(placed, [_tiles(part, placed) for part in placed]))
    if len(placed) > 1:
        labels.append(_numbered(placed, [_seeded(part) for part in placed]))
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


def _seeded(part: Placed) -> Labels:
    """Number surfaces by the random numbers that made them; windows of maps by their tiles only."""
    if part.tile is not None:
        return None
    return ("seed", part.scene.seed), part.rows // part.scene.samples_per_surface


def _tiles(part: Placed, placed: Sequence[Placed]) -> Labels:
    """Number the windows of a database by their tiles, or by their maps where tiles differ."""
    surface = part.scene.surface
    if part.tile is None or part.map is None or not isinstance(surface, ScanSurface):
        return None
    shared = [other for other in placed if other is not part and _share_maps(part, other)]
    own = _tiling(part.scene)
    if all(_tiling(other.scene) == own for other in shared):
        return ("tiles", own), part.tile
    if surface.against is not None or any(_is_pressed_on_rough(each.scene) for each in shared):
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


def _is_pressed_on_rough(scene: Scene) -> bool:
    """Tell whether surfaces are pressed against second rough ones."""
    return scene.surface.against is not None


def _share_maps(part: Placed, other: Placed) -> bool:
    """Tell whether two databases have windows of one map."""
    return bool(_hashes(part.scene) & _hashes(other.scene))


def _hashes(scene: Scene) -> set[str]:
    """Return the hashes of a scene's maps."""
    surface = scene.surface
    if not isinstance(surface, ScanSurface):
        return set()
    found = [surface.known(), *filter(None, (surface.against_found,))]
    return {each.sha256 for maps in found for each in maps.maps}


def _numbered(placed: Sequence[Placed], labels: Sequence[Labels]) -> Indices:
    """Number the labels of all databases' rows, (n,); rows without a label stand alone."""
    kinds = {label[0]: number for number, label in enumerate(filter(None, labels))}
    pairs = np.empty((sum(part.rows.size for part in placed), 2), dtype=np.int64)
    start = 0
    for part, label in zip(placed, labels, strict=True):
        rows = slice(start, start + part.rows.size)
        alone = -1, np.arange(rows.start, rows.stop)
        pairs[rows, 0], pairs[rows, 1] = alone if label is None else (kinds[label[0]], label[1])
        start = rows.stop
    _, numbers = np.unique(pairs, axis=0, return_inverse=True)
    return np.asarray(numbers.ravel(), dtype=np.int64)


def linked(*labels: Indices) -> Indices:
    """Number groups, (n,), such that rows with any label in common are in one group.

    Labels are numbers, each (n,), such as those of surfaces and of tiles; the groups are the
    connected components of rows that share one.
    """
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


def require_different(paths: Sequence[Path]) -> None:
    """Refuse a database that is given twice."""
    files = Counter(os.path.realpath(path) for path in paths)  # of a loop of links too
    twice = [file for file, times in files.items() if times > 1]
    if twice:
        raise InputError(f"{twice[0]}: is given twice: give each database once")
