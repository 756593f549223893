"""The columns of a database that learning needs, and why some of its rows cannot be used."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gen.database import Reader
from gen.runtime.errors import InputError
from gen.scene import Scene
from gen.schema import REASONS, Column, Reason, Status
from learn.arrays import Indices, Values
from learn.columns import INPUTS, MAP, TARGETS, TILE, results, short_name
from learn.features.sets import patch_length


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
    """Read the columns of a database.

    Parameters
    ----------
    path : Path
        A database made by `gen`.
    targets : sequence of str
        Short names or columns of the targets.

    Raises
    ------
    InputError
        If the file is no database or lacks a target.
    """
    with Reader(path) as reader:
        draws = reader.scene.contact.draws_hardness
        places = reader.scene.surface.places()
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
    """Return the reason why each row cannot be used with any features, "" if it can.

    Parameters
    ----------
    stored : Stored
        The columns.
    target : ndarray, shape (n,)
        Values of the target.

    Returns
    -------
    ndarray of str, shape (n,)
    """
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
