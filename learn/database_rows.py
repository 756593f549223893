"""Records of rows: all rows of a database, and the usable rows from which a model learns."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Indices, Values
from gen.quantities import Powers
from gen.scene import Scene
from gen.schema import Column
from learn.features import FeatureSet
from learn.features.rows import Rows


@dataclass(frozen=True, eq=False)
class Stored:
    """All n rows of a database, usable or not, with the columns that learning needs."""

    path: Path  # of the database
    scene: Scene
    versions: str  # versions of the libraries that made the database, a text in JSON
    rows: Indices  # (n,), numbers of the rows in the database
    columns: Mapping[str, NDArray[Any]]  # columns by name, (n,) each
    # numbers from which features are computed; hybrid columns are added later
    quantities: Rows
    targets: Sequence[Column]  # columns of the targets, in the order of the request
    # (n, 23), Delta and the 22 statistics. Under a pressure, features of surfaces have a length in
    # place of Delta (`learn.features.rows.by_pressure`).
    described: Values
    damage: str  # remark of `gen.database.Reader.damage` on damaged rows; "" if there are none


class Origin(NamedTuple):
    """A database from which usable rows were read."""

    database: str  # path of the database
    # SHA-256 of the columns of all rows, usable or not, that decide what a model learns
    sha256: str
    scene: Scene
    rows: int  # number of usable rows
    # versions of the libraries that made the database, a text in JSON
    versions: str = "{}"
    # remark of `gen.database.Reader.damage` on damaged rows; "" if there are none
    damage: str = ""


@dataclass(frozen=True, eq=False)
class Dataset:
    """The n usable rows of one or more databases for one target: d inputs and the target."""

    inputs: Values  # (n, d), features
    target: Values  # (n,), values of the target's column over `scale`
    rows: Indices  # (n,), numbers of the rows in their databases
    # (n,), numbers of the groups that no split divides: surfaces, or tiles of maps
    groups: Indices
    database: Indices  # (n,), number of the row's database in `origins`
    # (n,), number of the row's population: a map, or a database whose surfaces are not from maps
    population: Indices
    features: FeatureSet  # set with the d columns of the inputs
    target_name: str  # name of the target's column
    unit: str  # of `target`; "1" if `scale` has the unit of the column
    dropped: dict[str, int]  # number of rows left out, by reason
    # (n, 23), as in `Stored`; NaN if undefined and not needed by the features
    described: Values
    scale: Values  # (n,), divisor of the target; 1 if the target keeps its unit
    origins: tuple[Origin, ...]  # the databases in their order
    name: str  # paths of the databases, joined by ", "
    # Powers of heights, lengths and E* to which the target is proportional; None if unknown, or if
    # it is not proportional to any.
    powers: Powers | None = None
    # SHA-256 of the only origin; for several origins a SHA-256 of all of theirs
    sha256: str = ""
    # True if all surfaces are windows of maps, and groups are tiles
    by_tile: bool = False

    @property
    def size(self) -> int:
        """Number of usable rows."""
        return self.target.size

    @property
    def surfaces(self) -> Indices:
        """Number of the surface or tile of each row, (n,).

        If all rows are of one surface or tile, each row has a number of its own, so that the rows
        can be split.
        """
        if np.ptp(self.groups) == 0:
            return np.arange(self.size)
        return self.groups

    def at(self, positions: Indices) -> "Dataset":
        """Return the rows at given positions.

        Parameters
        ----------
        positions : ndarray, shape (k,)
            Positions in the dataset.

        Returns
        -------
        Dataset
            The k rows in the order of the positions. Groups are numbered anew from 0; all other
            numbers are those of this dataset.
        """
        arrays: dict[str, Any] = {}
        for name, value in vars(self).items():
            if isinstance(value, np.ndarray):  # Every array has n rows.
                arrays[name] = value[positions]
        _, arrays["groups"] = np.unique(arrays["groups"], return_inverse=True)
        return replace(self, **arrays)
