"""Input of predictions: statistics from tables."""

import csv
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gen.maps.read import sides_from
from gen.runtime.errors import InputError
from gen.runtime.files import require_file
from gen.runtime.terminal import to_type
from learn.arrays import Values
from learn.features.sets import STATISTICS

DELTA_NAMES = ("delta_um", "delta")
SIDE_NAMES = ("side_x_um", "side_y_um")
NODE_NAMES = ("nodes_x", "nodes_y")


@dataclass(frozen=True, eq=False)
class Table:
    """Rows of statistics.

    Attributes
    ----------
    name : str
        Name of the file.
    statistics : ndarray, shape (n, 22)
        Statistics in the order of Table 1, NaN where a surface defines none.
    delta : ndarray, shape (n,) or None
        Far-field displacements, None if the file has none [um].
    sides : ndarray, shape (n, 2)
        Scan lengths, NaN where the file has none [um].
    nodes : ndarray of int, shape (n, 2)
        Nodes along both axes, 0 where the file has none.
    boundaries : tuple of str
        The different boundaries of the rows; "free" where the file has none.
    """

    name: str
    statistics: Values
    delta: Values | None
    sides: Values
    nodes: NDArray[np.int64]
    boundaries: tuple[str, ...]


def read_table(path: Path, side: str = "") -> Table:
    """Read rows of statistics, as `python -m gen describe --csv` writes them.

    Parameters
    ----------
    path : Path
        CSV with a header that names the 22 statistics; `delta_um` or `delta`, sides and nodes are
        optional, and other columns are ignored.
    side : str
        Scan length, or two with a comma, for rows without lengths [um].

    Raises
    ------
    InputError
        If a column is missing, or a value is no number; the message names row and column.
    """
    try:
        with require_file(path).open(encoding="utf-8-sig", newline="") as file:
            reader = csv.DictReader(file, skipinitialspace=True)
            names = [name.strip() for name in reader.fieldnames or []]
            reader.fieldnames = names
            rows = list(reader)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path} cannot be read: {error}") from None
    missing = [name for name in STATISTICS if name not in names]
    if missing:
        more = f" and {len(missing) - 3} more" if len(missing) > 3 else ""
        raise InputError(
            f"{path}: has no column {', '.join(missing[:3])}{more}; {to_type('gen describe --csv')}"
            " writes all 22"
        )
    if not rows:
        raise InputError(f"{path}: has a header and no rows")
    deltas = [name for name in DELTA_NAMES if name in names]
    sides = np.full((len(rows), 2), np.nan)
    if all(name in names for name in SIDE_NAMES):
        sides = _columns(path, rows, SIDE_NAMES)
    if side:
        given = sides_from(side)
        if not np.allclose(sides[~np.isnan(sides[:, 0])], given, rtol=1e-3):
            raise InputError(f"{path}: names other sides than --side {side}: leave that out")
        sides[:] = given
    nodes = np.zeros((len(rows), 2))
    if all(name in names for name in NODE_NAMES):
        nodes = _columns(path, rows, NODE_NAMES)
    return Table(
        name=str(path),
        statistics=_columns(path, rows, STATISTICS, undefined=True),
        delta=_columns(path, rows, deltas[:1])[:, 0] if deltas else None,
        sides=sides,
        nodes=nodes.astype(np.int64),
        boundaries=tuple(sorted({row.get("boundary") or "free" for row in rows})),
    )


def _columns(
    path: Path, rows: list[dict[str, str]], names: Sequence[str], *, undefined: bool = False
) -> Values:
    """Return the finite numbers of some columns, (n, k); an empty cell or "nan" has none."""
    return np.array(
        [
            list(_numbers(path, number, row, names, undefined=undefined))
            for number, row in enumerate(rows)
        ]
    )


def _numbers(
    path: Path, number: int, row: dict[str, str], names: Sequence[str], *, undefined: bool
) -> Iterator[float]:
    for name in names:
        if undefined and str(row[name]).strip().lower() in {"", "nan"}:
            yield np.nan
            continue
        try:
            value = float(row[name])
        except (TypeError, ValueError):
            value = np.nan
        if not np.isfinite(value):
            text = str(row.get(name))[:40]
            raise InputError(f"{path}, row {number + 1}: {name} is {text!r}; give finite numbers")
        yield value
