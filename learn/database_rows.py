"""Rows of databases: as they are stored, and those that a model learns from."""

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
    """All n rows of a database that learning reads, usable or not."""

    path: Path
    scene: Scene
    versions: str  # of the libraries that made the database, as it states them
    rows: Indices  # (n,), numbers of the rows
    columns: Mapping[str, NDArray[Any]]  # (n,) each, by name: all that learning needs
    quantities: Rows  # what features are computed from; hybrid columns are added later
    targets: Sequence[Column]  # columns of a request's targets, in their order
    described: Values  # (n, 23), Delta and the 22 statistics
    damage: str  # what `gen.database.Reader.damage` says of the database


class Origin(NamedTuple):
    """A database that usable rows were read from."""

    database: str  # its path
    sha256: str  # of the columns that decide the results
    scene: Scene
    rows: int  # number of usable rows
    versions: str = "{}"  # of the libraries that made it, as it states them
    damage: str = ""  # what `gen.database.Reader.damage` says of it


@dataclass(frozen=True, eq=False)
class Dataset:
    """The usable rows of a database, or of several: n rows of d inputs and one target."""

    inputs: Values  # (n, d)
    target: Values  # (n,), in the unit of its column over `scale`
    rows: Indices  # (n,), numbers of the rows in their databases
    groups: Indices  # (n,), of rows that no split divides: of a surface, or of a tile of a map
    database: Indices  # (n,), number in `origins`
    # (n,), number of the map, or of the database for surfaces from no map
    population: Indices
    features: FeatureSet  # what the d inputs are
    target_name: str  # the column of the target
    unit: str  # of the target, "1" if it was made free of units
    dropped: dict[str, int]  # number of rows left out, by reason
    # (n, 23), Delta and the 22 statistics, NaN if undefined and not needed
    described: Values
    scale: Values  # (n,), divisor of the target
    origins: tuple[Origin, ...]
    name: str  # the databases' paths
    # Of heights, lengths and E* that the target scales with; None for none, or none that is known.
    powers: Powers | None = None
    sha256: str = ""  # of the columns that decide the results, of all databases
    by_tile: bool = (
        False  # True if the groups are tiles of maps, from which all surfaces come
    )

    @property
    def size(self) -> int:
        """Number of usable rows."""
        return self.target.size

    @property
    def surfaces(self) -> Indices:
        """Surface, or tile, of each row, (n,); the row itself where all are of one."""
        if np.ptp(self.groups) == 0:
            return np.arange(self.size)
        return self.groups

    def at(self, positions: Indices) -> "Dataset":
        """Return the rows at some positions.

        Parameters
        ----------
        positions : ndarray, shape (k,)
            Positions in the dataset.

        Returns
        -------
        Dataset
            The k rows in the order of the positions, with groups that are numbered anew.
        """
        arrays: dict[str, Any] = {
            name: value[positions]
            for name, value in vars(self).items()
            if isinstance(value, np.ndarray)
        }
        _, arrays["groups"] = np.unique(arrays["groups"], return_inverse=True)
        return replace(self, **arrays)
