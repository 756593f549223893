"""Several databases in one fit: whether they go together, and which of their rows are related.

Rows of one surface are never on both sides of a split, whichever databases they are in. Related are
surfaces with the same statistics, surfaces of one number and one seed, whatever their grid and
generator (they are made of the same random numbers), and windows of one tile of a map; where two
databases cut a map into other tiles, all windows of that map.
"""

import os
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gen.runtime.errors import InputError
from gen.scene import ScanSurface, Scene
from gen.scene.faults import shown
from learn.arrays import Indices, Values
from learn.features.sets import modulus

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
