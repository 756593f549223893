"""Input of predictions: surfaces from files and folders, statistics from tables."""

import csv
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bem.spacing import Boundary
from gen.measured.preparation import prepare, surface_warnings
from gen.measured.settings import Preparation
from gen.measured.topography import OWN_SUFFIXES, Topography, read, sides_from
from gen.runtime.errors import InputError
from gen.runtime.input_file import require_file
from gen.runtime.numbers import magnitude, shown, values_from
from learn.arrays import Values
from learn.features.sets import STATISTICS
from learn.reading import Reading

INSTRUMENTS = {
    *(".x3p", ".sur", ".al3d", ".opd", ".opdx", ".plu", ".plux", ".gwy", ".nc", ".di", ".ibw"),
    *(".spm", ".mi", ".zon", ".zag", ".top", ".frt", ".os3d", ".sdf", ".bcrf", ".bcr", ".h5"),
    *(".mat", ".xyz", ".vk4", ".vk6", ".vk7", ".jpk", ".gsf", ".nid", ".ezd", ".mnt", ".stp"),
}
"""Suffixes of files in a folder that are read as surfaces."""

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
        Statistics in the order of Table 1.
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


def deltas_from(text: str) -> Values:
    """Parse displacements, as "2", "1,2,5" or "5:45:9" [um].

    Raises
    ------
    InputError
        If the text is not made of numbers above 0.
    """
    values = numbers_from(text, "--delta", "give numbers above 0 um, as 2, 1,2,5 or 5:45:9")
    if not all(map(magnitude, values)):
        raise InputError(f"--delta {shown(text)}: give numbers above 0 um, as 2, 1,2,5 or 5:45:9")
    return values


def pressures_from(text: str) -> Values:
    """Parse nominal pressures, as "1:100:20" [MPa].

    Raises
    ------
    InputError
        If the text is not made of numbers of 0 or more, or all are 0.
    """
    advice = "give pressures of 0 MPa or more, not all 0, as 0:100:20"
    values = numbers_from(text, "--pressure", advice)
    if not values.any() or not all(value == 0 or magnitude(value) for value in values):
        raise InputError(f"--pressure {shown(text)}: {advice}")
    return values


def numbers_from(text: str, option: str, advice: str) -> Values:
    """Parse finite numbers, as "2", "1,2,5" or "5:45:9".

    Raises
    ------
    InputError
        If there are none or too many; the message has the option and the advice.
    """
    values = np.array(values_from(text, option, advice))
    if not np.isfinite(values).all():
        raise InputError(f"{option} {shown(text)}: {advice}")
    return values


def files_in(paths: Sequence[Path]) -> tuple[list[Path], int]:
    """Return the files, with those of folders that can hold surfaces, and the number left out.

    Raises
    ------
    InputError
        If there is no file.
    """
    files: list[Path] = []
    others = 0
    for path in paths:
        if not path.is_dir():
            if not path.is_file():
                raise InputError(f"{path}: is neither a file nor a folder")
            if path.suffix.lower() == ".h5" and _is_database(path):
                raise InputError(
                    f"{path}: is a database; python -m learn fit makes a surrogate of it, which"
                    " predicts for surfaces"
                )
            files.append(path)
            continue
        inside = [each for each in sorted(path.iterdir()) if each.is_file()]
        inside = [each for each in inside if not each.name.startswith(".")]
        wanted = [
            each for each in inside if each.suffix.lower() in (OWN_SUFFIXES - {""}) | INSTRUMENTS
        ]
        if not wanted:
            raise InputError(f"{path}: holds no surface")
        others += len(inside) - len(wanted)
        files += wanted
    return files, others


def _is_database(path: Path) -> bool:
    from gen.database import is_database  # which needs HDF5, as surfaces do not

    return is_database(path)


def is_table(path: Path) -> bool:
    """Return True if a file has rows of statistics, by the names in its first line."""
    if path.suffix.lower() not in {".csv", ".txt"}:
        return False
    try:
        with require_file(path).open(encoding="utf-8-sig", errors="replace") as file:
            names = {name.strip() for name in file.readline().split(",")}
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}") from None
    return bool(names & set(STATISTICS))


def read_surface(
    path: Path, reading: Reading, boundary: Boundary = "free"
) -> tuple[Topography, list[str]]:
    """Read and prepare a surface as a patch of a boundary; return it with the warnings about it."""
    try:
        measured = read(
            path,
            reading.side,
            reading.unit,
            channel=reading.channel,
            override_scale=reading.override_scale,
            boundary=boundary,
        )
        settings = Preparation(
            crop=reading.crop,
            invert=reading.invert,
            level=reading.level,
            fill=reading.fill,
            fill_most=reading.fill_most,
        )
        topography = prepare(measured, settings)
    except InputError as error:
        named = "" if str(error).startswith(("--", str(path))) else f"{path}: "
        raise InputError(f"{named}{error}") from None
    with np.errstate(over="ignore"):  # of slopes that are too steep for a square: warned of
        return topography, surface_warnings(topography)


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
            f"{path}: has no column {', '.join(missing[:3])}{more}; python -m gen describe --csv"
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
        statistics=_columns(path, rows, STATISTICS),
        delta=_columns(path, rows, deltas[:1])[:, 0] if deltas else None,
        sides=sides,
        nodes=nodes.astype(np.int64),
        boundaries=tuple(sorted({row.get("boundary") or "free" for row in rows})),
    )


def _columns(path: Path, rows: list[dict[str, str]], names: Sequence[str]) -> Values:
    """Return the finite numbers of some columns, (n, k)."""
    return np.array([list(_numbers(path, number, row, names)) for number, row in enumerate(rows)])


def _numbers(path: Path, number: int, row: dict[str, str], names: Sequence[str]) -> Iterator[float]:
    for name in names:
        try:
            value = float(row[name])
        except (TypeError, ValueError):
            value = np.nan
        if not np.isfinite(value):
            text = str(row.get(name))[:40]
            raise InputError(f"{path}, row {number + 1}: {name} is {text!r}; give finite numbers")
        yield value
