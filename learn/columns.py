"""The columns of a database by their role in learning: inputs, targets, places; and their content.

`read_stored` reads them, and `reasons_against` says why some rows cannot be used.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gen.database import Reader
from gen.runtime.errors import InputError
from gen.scene import Scene
from gen.scene.columns import columns_for, parameter_columns
from gen.schema import REASONS, Column, Reason, Status, statistics_columns
from learn.arrays import Indices, Values
from learn.features.sets import patch_length

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
