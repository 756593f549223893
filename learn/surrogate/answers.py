"""Predictions for files, surfaces or tables of statistics, with a row for each displacement."""

import csv
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from gen.arrays import Values
from gen.maps.bodies import read_surface
from gen.maps.read import files_in, parse_sides
from gen.maps.settings import Reading
from gen.maps.several import OF_MAP
from gen.material import Bodies
from gen.runtime.documents import Row
from gen.runtime.errors import InputError
from gen.runtime.files import require_file
from gen.runtime.terminal import command_to_type, echo
from learn.features import SurfaceFeatures, Undefined
from learn.features.columns import STATISTICS
from learn.features.rows import Grid, Rows
from learn.features.scene import LOADS, unit_of
from learn.surrogate.model import Prediction, Surrogate


def answers(
    surrogate: Surrogate,
    path: Path,
    loads: Values,
    bodies: Bodies,
    level: float,
    reading: Reading,
) -> Iterator[Row]:
    """Yield the rows of the predictions for a file, or for the files of a folder.

    Loads are k Deltas [um], or pressures [MPa]; `level` is the coverage of the intervals.
    """
    files = files_in(path)
    for file in files:
        warnings: list[str] = []
        first = ""  # names of a table's columns, or numbers of a map
        try:
            if file.suffix.lower() in {".csv", ".txt"}:
                with require_file(file).open(
                    encoding="utf-8-sig", errors="replace"
                ) as opened:
                    first = opened.readline()
            if {name.strip() for name in first.split(",")} & {*STATISTICS}:
                rows = rows_of_table(surrogate, file, loads, bodies, reading.side)
            else:
                found, warnings = read_surface(file, reading, surrogate.boundary)
                echo(f"{file}: {'; '.join(found.steps)}", err=True)
                for line in warnings:
                    echo(f"  warning: {line}", err=True)
                own = found.heights, found.sides, found.spacing, str(file), found.boundary
                how = bodies.hardness_ratio, bodies.e_star
                rows = SurfaceFeatures(*own).rows(surrogate.features, loads, *how)
            answer = surrogate.predict_rows(rows, e_star=bodies.e_star, level=level)
        except Undefined as error:
            if len(files) == 1:
                raise
            echo(f"  warning: {error}: no prediction", err=True)
            reason = str(error).removeprefix(f"{file}: ")
            unknown = dict.fromkeys(surrogate.learnt, np.full(loads.size, np.nan))
            given = {"pressure": loads} if surrogate.features.load == "pressure" else {}
            reasons = (reason,) * loads.size
            answer = Prediction(loads, unknown, unknown, unknown, reasons, given)
        except OSError as error:
            raise InputError(
                f"{file} cannot be read: {error.strerror or error}"
            ) from None
        except InputError as error:
            named = str(error).startswith(("--", str(file)))
            raise InputError(f"{'' if named else f'{file}: '}{error}") from None
        for row in _answered(surrogate, answer):
            yield {"input": str(file), **row, "warnings": "; ".join(warnings)}


def answers_of_parameters(
    surrogate: Surrogate,
    tables: Sequence[Path],
    numbers: Mapping[str, ArrayLike],
    level: float,
    *,
    mean: bool = False,
) -> Iterator[Row]:
    """Yield the rows of a scene's surrogate for numbers, or for each row of CSV tables with them.

    Numbers are those of the parameters and the load, (k,) each, by their names; the columns of a
    table have the names of the others, and its further columns are kept as they are. With `mean`
    intervals are those of the mean over surfaces. InputError is raised for a name that is missing
    or unknown, and for what is no number.
    """
    names = [name for name in surrogate.features.names if name not in numbers]
    fixed = {
        name: np.atleast_1d(np.asarray(each, float)) for name, each in numbers.items()
    }
    files: list[Path | None] = [*tables] or [None]
    for table in files:
        given, count, further = dict(fixed), 1, [dict[str, str]()]
        if table is not None:
            if table.suffix.lower() not in {".csv", ".txt"}:
                raise InputError(
                    f"{table}: the surrogate answers for {', '.join(surrogate.features.names)}, not"
                    f" for surfaces: ask {command_to_type('learn predict --at')}"
                )
            cells = _cells(table, names, f"the surrogate asks for {', '.join(names)}")
            if twice := sorted(fixed.keys() & cells[0].keys()):
                raise InputError(
                    f"{table}: has its own {', '.join(twice)}: leave out the option"
                )
            columns, count = _numbers(table, cells, names).T, len(cells)
            further = [
                {name: row[name] for name in row if name not in names} for row in cells
            ]
            given |= dict(zip(names, columns, strict=True))
        most = max((each.size for each in fixed.values()), default=1)
        spread = {
            name: np.resize(each, most * count)
            if name in numbers
            else np.repeat(each, most)
            for name, each in given.items()
        }
        try:
            rows = surrogate.of_numbers(spread)
        except InputError as error:
            raise InputError(f"{table}: {error}" if table else str(error)) from None
        prediction = surrogate.predict_rows(rows, level=level, mean=mean)
        for place, row in enumerate(_answered(surrogate, prediction)):
            yield {"input": str(table or ""), **further[place // most], **row}


def _answered(surrogate: Surrogate, prediction: Prediction) -> Iterator[Row]:
    """Yield rows of what was asked, with the answers, their intervals and flags.

    Columns have their units: delta_um, area_percent, force_uN, mean_gap_um.
    """
    asked = prediction.given or {"delta": prediction.delta}
    columns = [
        (name, LOADS.get(name) or unit_of(name), each, "") for name, each in asked.items()
    ]
    for target, learnt in surrogate.learnt.items():
        columns.append((learnt.column, learnt.unit, prediction.values[target], target))
    for place, reason in enumerate(prediction.reasons):
        row: Row = {}
        for name, unit, values, target in columns:
            key = name if unit in {"%", "1"} else f"{name}_{unit}"
            row[key] = float(values[place])
            if (
                target in prediction.low
            ):  # outside the training no interval holds: empty cells
                row[f"{key}_low"] = "" if reason else float(prediction.low[target][place])
                row[f"{key}_high"] = (
                    "" if reason else float(prediction.high[target][place])
                )
        yield {**row, "flag": "outside" if reason else "inside", "reason": reason}


def rows_of_table(
    surrogate: Surrogate, path: Path, loads: Values, bodies: Bodies, side: str
) -> Rows:
    """Read rows of statistics, as `gen describe --csv` writes them, each at all loads.

    The CSV's header names the 22 statistics; sides, nodes and boundary are optional, and other
    columns are ignored. So are the rows of mean and deviation of several maps. InputError names the
    row and column that is missing or no number.
    """
    cells = _cells(
        path, STATISTICS, f"{command_to_type('gen describe --csv')} writes all 22"
    )
    # a table of several maps ends with their mean and deviation
    cells = [row for row in cells if row.get("row", OF_MAP) == OF_MAP] or cells
    for boundary in sorted({row.get("boundary") or "free" for row in cells}):
        if boundary != surrogate.boundary:
            raise InputError(
                f"{path}: has a {boundary:.20} boundary, the surrogate was trained on patches with"
                f" a {surrogate.boundary} one: fit one to a database whose scene has this boundary"
            )
    wanted = STATISTICS, ("side_x_um", "side_y_um")
    statistics, sides = (_numbers(path, cells, names) for names in wanted)
    if side:
        given = parse_sides(side)
        if not np.allclose(sides[~np.isnan(sides[:, 0])], given, rtol=1e-3):
            raise InputError(
                f"{path}: names other sides than --side {side}: leave that out"
            )
        sides[:] = given
    if np.isnan(sides).any() and surrogate.features.scaled:
        raise InputError(f"{path}: names no sides: give --side, the scan length in um")
    undefined = [bool(np.isnan(row).any()) for row in statistics]
    if all(undefined):
        raise InputError(f"{path}: every row lacks statistics: nothing can be predicted")
    nodes = _numbers(path, cells, ("nodes_x", "nodes_y"), 0.0)
    usual, unknown = surrogate.card, np.isnan(sides).any(axis=1, keepdims=True)
    shapes = np.where(nodes.all(axis=1, keepdims=True), nodes, usual["nodes"]).astype(int)
    patches = np.where(unknown, usual["side"], sides)
    grids = [
        Grid(tuple(a), tuple(b))
        for a, b in zip(shapes.tolist(), patches.tolist(), strict=True)
    ]
    notes = ["statistics undefined: nan in the table" * lacks for lacks in undefined]
    rows = np.repeat(np.arange(len(cells)), loads.size)
    asked = np.tile(loads, len(cells))
    length, along = (np.sqrt(each.prod(axis=1))[rows] for each in (sides, nodes))
    found = Rows(
        statistics[rows],
        asked,
        length,
        bodies.hardness_ratio,
        along,
        notes=tuple(notes[row] for row in rows),
        grids=tuple(grids[row] for row in rows),
    )
    return (
        found if surrogate.features.load == "delta" else found.under(asked, bodies.e_star)
    )


def _cells(path: Path, wanted: Sequence[str], advice: str) -> list[dict[str, str]]:
    """Read the cells of a table by the names of its columns, all wanted ones among them."""
    try:
        with require_file(path).open(encoding="utf-8-sig", newline="") as file:
            reader = csv.DictReader(file, skipinitialspace=True)
            reader.fieldnames = names = [name.strip() for name in reader.fieldnames or []]
            rows = list(reader)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path} cannot be read: {error}") from None
    missing = [name for name in wanted if name not in names]
    if missing:
        more = f" and {len(missing) - 3} more" if len(missing) > 3 else ""
        raise InputError(
            f"{path}: has no column {', '.join(missing[:3])}{more}; {advice}"
        )
    if not rows:
        raise InputError(f"{path}: has a header and no rows")
    return rows


def _numbers(
    path: Path,
    cells: list[dict[str, str]],
    names: Sequence[str],
    otherwise: float = np.nan,
) -> Values:
    """Return columns of finite numbers, (n, k); statistics that are empty or "nan" are NaN."""
    found = np.full((len(cells), len(names)), otherwise)
    if not set(names) <= cells[0].keys():
        return found
    for row, of_row in enumerate(cells):
        for place, name in enumerate(names):
            text = str(of_row.get(name)).strip()
            undefined = name in STATISTICS and text.lower() in {"", "nan"}
            try:
                found[row, place] = np.nan if undefined else float(text)
            except ValueError:
                found[row, place] = np.inf
            if not (undefined or np.isfinite(found[row, place])):
                raise InputError(
                    f"{path}, row {row + 1}: {name} is {text[:40]!r}; give finite numbers"
                )
    return found
