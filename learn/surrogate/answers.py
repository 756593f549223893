"""Predictions for the files that a user names, as rows of a table.

`answers` predicts surfaces: maps of heights, or tables of their statistics. `answers_of_parameters`
predicts the contacts of a scene from its numbers. Both yield one row for each surface, or set of
numbers, and each load.
"""

import csv
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from math import isfinite, nan
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

import bem
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
from learn.features.layers import Layers
from learn.features.rows import Grid, Rows
from learn.features.scene import unit_of
from learn.surrogate.model import Prediction, Surrogate

TABLE_SUFFIXES = {".csv", ".txt"}
"""Suffixes, in lower case, of files that may be tables of statistics or of a scene's numbers."""

NAMED_COLUMNS = 3
"""Largest number of missing columns that an error names; it only counts the further ones."""

Cells = list[dict[str, str]]
"""Rows of a table: the text of each cell by the name of its column."""


@dataclass(frozen=True, eq=False)
class SurfaceQuestion:
    """Loads, bodies and level of the predictions for every surface, and how maps are read."""

    # (k,), Deltas [um], or pressures [MPa] if the surrogate has learnt pressures
    loads: Values
    bodies: Bodies  # E* and hardness of the contacts [MPa]
    level: float  # coverage of the intervals, between 0 and 1
    # how maps are read; the scan lengths of its `side` hold for tables of statistics, too
    reading: Reading


@dataclass(frozen=True, eq=False)
class FileAnswer:
    """The predictions for one file."""

    prediction: Prediction
    # reasons to distrust the contacts of a map, one line each
    warnings: Sequence[str] = ()


def answers(surrogate: Surrogate, path: Path, question: SurfaceQuestion) -> Iterator[Row]:
    """Predict contacts for a file, or for each file of a folder, and yield them as rows of a table.

    The preparation of maps, and warnings about them, are printed on standard error.

    Parameters
    ----------
    surrogate : Surrogate
        A surrogate of surfaces.
    path : Path
        A map of heights, a table of statistics as `gen describe --csv` writes it, or a folder of
        them.
    question : SurfaceQuestion
        Loads and bodies of the contacts, level of the intervals, and preparation of the maps.

    Yields
    ------
    Row
        For each surface and load in their order: "input", the file; the load; each target with the
        ends of its interval, as "force_uN", "force_uN_low" and "force_uN_high"; "flag", "inside" or
        "outside" the training; "reason", why it is outside, or ""; and "warnings" about the map. If
        a map of a folder has no statistics, its predictions are NaN, and its reason says why.

    Raises
    ------
    InputError
        If a file cannot be read, it has another boundary than the surrogate, or the surrogate
        cannot predict for it; or if the only file is a map without statistics.
    """
    files = files_in(path)
    for file in files:
        with _errors_about(file):
            if _is_table_of_statistics(file):
                answer = _answer_for_table(surrogate, file, question)
            else:
                is_only_file = len(files) == 1
                answer = _answer_for_map(
                    surrogate, file, question, is_only_file=is_only_file
                )
        warnings = "; ".join(answer.warnings)
        for row in _rows_of_prediction(surrogate, answer.prediction):
            yield {"input": str(file), **row, "warnings": warnings}


@contextmanager
def _errors_about(file: Path) -> Iterator[None]:
    """Turn each OSError or InputError of a `with` block into an InputError about a file.

    Its message begins with the file, or with an option if the original message does.
    """
    try:
        yield
    except OSError as error:
        raise InputError(f"{file} cannot be read: {error.strerror or error}") from None
    except InputError as error:
        message = str(error)
        if not message.startswith(("--", str(file))):
            message = f"{file}: {message}"
        raise InputError(message) from None


def _is_table_of_statistics(file: Path) -> bool:
    """Return whether a file is a table of text whose first line names a statistic.

    The suffix has to be one of `TABLE_SUFFIXES`; the names are separated by commas.
    """
    if file.suffix.lower() not in TABLE_SUFFIXES:
        return False
    with require_file(file).open(encoding="utf-8-sig", errors="replace") as opened:
        first_line = opened.readline()
    names = {name.strip() for name in first_line.split(",")}
    return not names.isdisjoint(STATISTICS)


def _answer_for_table(
    surrogate: Surrogate, file: Path, question: SurfaceQuestion
) -> FileAnswer:
    """Predict the rows of a table of statistics at all loads.

    Raises InputError if the table cannot be used.
    """
    rows = _rows_of_statistics(surrogate, file, question)
    prediction = surrogate.predict_rows(
        rows, e_star=question.bodies.e_star, level=question.level
    )
    return FileAnswer(prediction=prediction)


def _answer_for_map(
    surrogate: Surrogate, file: Path, question: SurfaceQuestion, *, is_only_file: bool
) -> FileAnswer:
    """Read and prepare a map, print its preparation on standard error, and predict all loads.

    If a statistic of the map is undefined, `Undefined` is raised for an only file. If there are
    other files, the reason is printed too, and all predictions are NaN. Raises InputError if the
    map cannot be read, has another boundary than the surrogate, or a coarse solve fails.
    """
    bodies = question.bodies
    topography, warnings = read_surface(file, question.reading, surrogate.boundary)
    echo(f"{file}: {'; '.join(topography.steps)}", err=True)
    for line in warnings:
        echo(f"  warning: {line}", err=True)
    surface = SurfaceFeatures(
        heights=topography.heights,
        sides=topography.sides,
        spacing=topography.spacing,
        name=str(file),
        boundary=topography.boundary,
    )
    try:
        rows = surface.rows(
            surrogate.features,
            question.loads,
            bodies.hardness_ratio,
            bodies.e_star,
            _layered(bodies),
        )
    except Undefined as error:
        if is_only_file:
            raise
        echo(f"  warning: {error}: no prediction", err=True)
        reason = str(error).removeprefix(f"{file}: ")
        no_prediction = _no_prediction(surrogate, question.loads, reason)
        return FileAnswer(prediction=no_prediction, warnings=warnings)
    prediction = surrogate.predict_rows(rows, e_star=bodies.e_star, level=question.level)
    return FileAnswer(prediction=prediction, warnings=warnings)


def _layered(bodies: Bodies) -> list[bem.Layered]:
    """Return the body with a layer, as one body for all rows; none for half-spaces."""
    if bodies.layered is None:
        return []
    return [bodies.layered.alone]


def _no_prediction(surrogate: Surrogate, loads: Values, reason: str) -> Prediction:
    """Return a prediction of NaN for all targets and their intervals at k loads, (k,).

    `reason` is the reason of each row.
    """
    nothing = np.full(loads.size, np.nan)
    unknown = dict.fromkeys(surrogate.learnt, nothing)
    deltas = loads
    pressures: dict[str, Values] = {}
    if surrogate.features.load == "pressure":
        deltas = nothing
        pressures["pressure"] = loads
    return Prediction(
        delta=deltas,
        values=unknown,
        low=unknown,
        high=unknown,
        reasons=(reason,) * loads.size,
        given=pressures,
    )


def answers_of_parameters(
    surrogate: Surrogate,
    tables: Sequence[Path],
    numbers: Mapping[str, ArrayLike],
    level: float,
    *,
    mean: bool = False,
) -> Iterator[Row]:
    """Predict contacts of a scene from its numbers, and yield them as rows of a table.

    Parameters
    ----------
    surrogate : Surrogate
        A surrogate of a scene's own features.
    tables : sequence of Path
        CSV tables with a column for each number that `numbers` lacks, by its name or with its unit
        as the answers have it. Without tables, `numbers` has all of them.
    numbers : mapping of str to ArrayLike
        Parameters of the scene and its load by name, in its units: one number each, or (k,). They
        hold for every row of the tables.
    level : float
        Coverage of the intervals, between 0 and 1.
    mean : bool
        True for intervals of the mean over all surfaces of the parameters, not of a new one.

    Yields
    ------
    Row
        For each row of the tables and each of the k loads: "input", the table, or "" without
        tables; the further columns of all tables, unchanged, "" where the row's table lacks one;
        the numbers; and targets, "flag" and "reason" as in the rows of `answers`. These replace
        further columns of the same names, with a warning on standard error.

    Raises
    ------
    InputError
        If a table cannot be read, has a column for one of `numbers`, or lacks a column for another
        number; if a name is missing or unknown; if a value is not allowed; or if `mean` is True and
        the model has no intervals of the mean.
    """
    fixed = {
        name: np.atleast_1d(np.asarray(values, float)) for name, values in numbers.items()
    }
    if not tables:
        prediction = surrogate.predict_rows(
            surrogate.of_numbers(fixed), level=level, mean=mean
        )
        for row in _rows_of_prediction(surrogate, prediction):
            yield {"input": "", **row}
    numbers_of_tables = [_read_numbers(path, surrogate, fixed) for path in tables]
    # All rows have the further columns of all tables; a table without one of them has "" there. The
    # first row of a table has all its columns.
    no_cells = {
        name: ""
        for table in numbers_of_tables
        for cells in table.further_cells[:1]
        for name in cells
    }
    for path, table in zip(tables, numbers_of_tables, strict=True):
        # How often each row of the table is repeated: once for each load of the options.
        repeats = max((values.size for values in fixed.values()), default=1)
        with _errors_about(path):
            rows = surrogate.of_numbers(table.combined_with(fixed, repeats))
        prediction = surrogate.predict_rows(rows, level=level, mean=mean)
        for place, row in enumerate(_rows_of_prediction(surrogate, prediction)):
            further_cells = table.further_cells[place // repeats]
            yield {"input": str(path), **no_cells, **further_cells, **row}


@dataclass(frozen=True, eq=False)
class NumbersTable:
    """A table of a scene's numbers, with n rows."""

    columns: dict[str, Values]  # numbers by name, (n,) each, in the units of the scene
    # for each row, the cells of columns that are no numbers of the scene
    further_cells: Cells

    def combined_with(
        self, fixed: Mapping[str, Values], repeats: int
    ) -> dict[str, Values]:
        """Combine each row with each value of the options.

        Parameters
        ----------
        fixed : mapping of str to ndarray
            Numbers of the options by name; each array has `repeats` values, or one.
        repeats : int
            Number of times that each row of the table is repeated, one after the other.

        Returns
        -------
        dict of str to ndarray, shape (n * repeats,)
            The numbers of the table and of the options by name.
        """
        size = repeats * len(self.further_cells)
        # `resize` repeats all values of an option as often as there are rows in the table.
        combined = {name: np.resize(values, size) for name, values in fixed.items()}
        for name, column in self.columns.items():
            combined[name] = np.repeat(column, repeats)
        return combined


def _read_numbers(
    path: Path, surrogate: Surrogate, fixed: Mapping[str, Values]
) -> NumbersTable:
    """Read a table with a column for each number of the scene that the options do not give.

    A column may have the name of its number, or the name with the unit that a table of answers has.
    `fixed` has the numbers of the options, for which the table has no column. Raises InputError for
    a table that cannot be used.
    """
    if path.suffix.lower() not in TABLE_SUFFIXES:
        raise InputError(
            f"{path}: the surrogate answers for {', '.join(surrogate.features.names)},"
            f" not for surfaces: ask {command_to_type('learn predict --at')}, or give tables"
            f" whose names end in {' or '.join(sorted(TABLE_SUFFIXES))}"
        )
    names = [name for name in surrogate.features.names if name not in fixed]
    titles = {_title(name, unit_of(name)): name for name in surrogate.features.names}
    cells = _read_cells(path, names, f"the surrogate asks for {', '.join(names)}", titles)
    given_twice = sorted(fixed.keys() & cells[0].keys())
    if given_twice:
        raise InputError(
            f"{path}: has its own {', '.join(given_twice)}: leave out the option"
        )
    columns = _finite_columns(path, cells, names).T
    further_cells = [
        {name: text for name, text in row.items() if name not in names} for row in cells
    ]
    _warn_of_replaced_columns(path, further_cells[0], surrogate)
    return NumbersTable(
        columns=dict(zip(names, columns, strict=True)), further_cells=further_cells
    )


def _warn_of_replaced_columns(
    path: Path, further_cells: Mapping[str, str], surrogate: Surrogate
) -> None:
    """Warn of further columns of a table that have the names of columns of the answers."""
    titles = ["flag", "reason"]
    for learnt in surrogate.learnt.values():
        title = _title(learnt.column, learnt.unit)
        titles += [title, f"{title}_low", f"{title}_high"]
    replaced = [title for title in titles if title in further_cells]
    if replaced:
        echo(
            f"  warning: {path}: the answers take the place of its own {', '.join(replaced)}:"
            " give these columns other names to keep them",
            err=True,
        )


@dataclass(frozen=True, eq=False)
class _ResultColumn:
    """A column of the table of predictions, for n rows."""

    title: str  # name with its unit, as "force_uN"
    values: Values  # (n,)
    # (n,), ends of the intervals; None for a column that has no intervals
    low: Values | None = None
    high: Values | None = None

    def cells(self, place: int, *, outside: bool) -> Row:
        """Return the cells of a row by their titles.

        The ends of the interval are "" if the row is `outside` the training: none holds there.
        """
        cells: Row = {self.title: float(self.values[place])}
        if self.low is None or self.high is None:
            return cells
        if outside:
            cells[f"{self.title}_low"] = ""
            cells[f"{self.title}_high"] = ""
        else:
            cells[f"{self.title}_low"] = float(self.low[place])
            cells[f"{self.title}_high"] = float(self.high[place])
        return cells


def _rows_of_prediction(surrogate: Surrogate, prediction: Prediction) -> Iterator[Row]:
    """Yield each row of a prediction: loads or numbers, targets, "flag" and "reason"."""
    columns = _result_columns(surrogate, prediction)
    for place, reason in enumerate(prediction.reasons):
        outside = reason != ""
        row: Row = {}
        for column in columns:
            row |= column.cells(place, outside=outside)
        row["flag"] = "outside" if outside else "inside"
        row["reason"] = reason
        yield row


def _result_columns(surrogate: Surrogate, prediction: Prediction) -> list[_ResultColumn]:
    """Return the columns of a prediction: loads or numbers of the question, then all targets."""
    inputs = prediction.given or {"delta": prediction.delta}
    columns = [
        _ResultColumn(_title(name, unit_of(name)), values)
        for name, values in inputs.items()
    ]
    for target, learnt in surrogate.learnt.items():
        column = _ResultColumn(
            title=_title(learnt.column, learnt.unit),
            values=prediction.values[target],
            low=prediction.low.get(target),
            high=prediction.high.get(target),
        )
        columns.append(column)
    return columns


def _title(name: str, unit: str) -> str:
    """Return the title of a column, its name and unit, as "force_uN".

    The names of shares in % end in the unit already, and pure numbers have none.
    """
    if unit in {"%", "1"}:
        return name
    return f"{name}_{unit}"


def _rows_of_statistics(
    surrogate: Surrogate, path: Path, question: SurfaceQuestion
) -> Rows:
    """Read a table of statistics, and return each of its rows at each of k loads.

    `gen describe --csv` writes the table. Its header names the 22 statistics. Sides, nodes and
    boundary are optional, and further columns are ignored. Rows with the mean and deviation of
    several maps are ignored, unless the table has only these. Each row of the table becomes k rows,
    one for each load; if its statistics are undefined, these have a note. Raises InputError for a
    table that cannot be used, and if all rows lack statistics.
    """
    cells = _read_cells(
        path, STATISTICS, f"{command_to_type('gen describe --csv')} writes all 22"
    )
    # A table of several maps ends with their mean and deviation. If it has no rows of maps, all its
    # rows are used.
    cells = [row for row in cells if row.get("row", OF_MAP) == OF_MAP] or cells
    _require_boundary(path, cells, surrogate)
    statistics = _finite_columns(path, cells, STATISTICS)
    sides = _sides_of_rows(path, cells, question.reading.side, surrogate)
    undefined = [bool(np.isnan(row).any()) for row in statistics]
    if all(undefined):
        raise InputError(f"{path}: every row lacks statistics: nothing can be predicted")
    nodes = _finite_columns(path, cells, ("nodes_x", "nodes_y"), missing=0.0)
    grids = _grids_of_rows(surrogate, sides, nodes)
    notes = [
        "statistics undefined: nan in the table" if lacks else "" for lacks in undefined
    ]
    loads = np.tile(question.loads, len(cells))
    layers: Layers | None = None
    if question.bodies.layered is not None:
        layers = Layers.of_bodies(_layered(question.bodies))
    places = np.repeat(np.arange(len(cells)), question.loads.size)
    rows = Rows(
        statistics=statistics[places],
        delta=loads,
        length=np.sqrt(sides.prod(axis=1))[places],
        hardness_ratio=question.bodies.hardness_ratio,
        nodes=np.sqrt(nodes.prod(axis=1))[places],
        notes=tuple(notes[place] for place in places),
        grids=tuple(grids[place] for place in places),
        layers=layers,
    )
    if surrogate.features.load == "delta":
        return rows
    return rows.under(loads, question.bodies.e_star)


def _require_boundary(path: Path, cells: Cells, surrogate: Surrogate) -> None:
    """Refuse rows of a table with another boundary than the surrogate's.

    An empty cell and a missing column mean "free".
    """
    if "boundary" not in cells[0] and surrogate.boundary != "free":
        raise InputError(
            f"{path}: has no column boundary, which means a free one, and the surrogate was"
            f" trained on patches with a {surrogate.boundary} one: give that column if these"
            " surfaces are of such patches"
        )
    for boundary in sorted({row.get("boundary") or "free" for row in cells}):
        if boundary != surrogate.boundary:
            # A cell may be long: the message quotes its first 20 letters.
            raise InputError(
                f"{path}: has a {boundary:.20} boundary, the surrogate was trained on"
                f" patches with a {surrogate.boundary} one: fit one to a database whose"
                " scene has this boundary"
            )


def _sides_of_rows(path: Path, cells: Cells, side: str, surrogate: Surrogate) -> Values:
    """Return the scan lengths along x and y of the n rows of a table, (n, 2) [um].

    `side` is the value of the option --side, or ""; it has to agree with the table to 0.1 %.
    Lengths that neither of them gives are NaN. Raises InputError if features without units need
    them.
    """
    sides = _finite_columns(path, cells, ("side_x_um", "side_y_um"))
    if side:
        sides_of_option = parse_sides(side)
        sides_of_table = sides[~np.isnan(sides[:, 0])]
        if not np.allclose(sides_of_table, sides_of_option, rtol=1e-3):
            raise InputError(
                f"{path}: names other sides than --side {side}: leave that out"
            )
        sides[:] = sides_of_option
    if np.isnan(sides).any() and surrogate.features.scaled:
        raise InputError(f"{path}: names no sides: give --side, the scan length in um")
    return sides


def _grids_of_rows(surrogate: Surrogate, sides: Values, nodes: Values) -> list[Grid]:
    """Return the grid of each of the n rows of a table.

    `sides` are the scan lengths, (n, 2) [um], NaN if unknown; `nodes` are the numbers of nodes
    along x and y, (n, 2), 0 if unknown. Unknown ones are replaced by those of the training.
    """
    sides_known = ~np.isnan(sides).any(axis=1, keepdims=True)
    nodes_known = nodes.all(axis=1, keepdims=True)
    lengths = np.where(sides_known, sides, surrogate.card["side"])
    shapes = np.where(nodes_known, nodes, surrogate.card["nodes"]).astype(int)
    pairs = zip(shapes.tolist(), lengths.tolist(), strict=True)
    return [Grid(shape=tuple(shape), sides=tuple(length)) for shape, length in pairs]


def _read_cells(
    path: Path,
    required: Sequence[str],
    advice: str,
    names_by_title: Mapping[str, str] | None = None,
) -> Cells:
    """Read the rows of a CSV table with a header, one row or more.

    A column with one of the titles of `names_by_title` gets its name, unless the table has a column
    of that name already.

    Raises InputError if the table cannot be read, has no rows, has a row with more cells than the
    header, or lacks one of the `required` columns. In the last case `advice` ends the message.
    """
    try:
        with require_file(path).open(encoding="utf-8-sig", newline="") as file:
            reader = csv.DictReader(file, skipinitialspace=True)
            titles = [name.strip() for name in reader.fieldnames or []]
            names = _names_of_columns(titles, names_by_title or {})
            reader.fieldnames = names
            rows = list(reader)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path} cannot be read: {error}") from None
    missing = [name for name in required if name not in names]
    if missing:
        listed = ", ".join(missing[:NAMED_COLUMNS])
        if len(missing) > NAMED_COLUMNS:
            listed += f" and {len(missing) - NAMED_COLUMNS} more"
        raise InputError(f"{path}: has no column {listed}; {advice}")
    if not rows:
        raise InputError(f"{path}: has a header and no rows")
    for number, row in enumerate(rows, start=1):
        # `DictReader` keeps the cells beyond the header as a list, by the name None.
        cells_beyond = row.pop(None, [])
        if any(text.strip() for text in cells_beyond):
            raise InputError(
                f"{path}, row {number}: has more cells than the header: are there commas in"
                " numbers or in texts without quotes?"
            )
    return rows


def _names_of_columns(titles: list[str], names_by_title: Mapping[str, str]) -> list[str]:
    """Return the names of columns, each its title unless `names_by_title` has another for it.

    A title stays where another column has that name already.
    """
    names = []
    for title in titles:
        name = names_by_title.get(title, title)
        names.append(title if name in titles else name)
    return names


def _finite_columns(
    path: Path, cells: Cells, names: Sequence[str], missing: float = np.nan
) -> NDArray[np.float64]:
    """Return the numbers of columns of a table, (n rows, k columns).

    If the table lacks one of the columns, all numbers are `missing`. Statistics that are empty or
    "nan" are NaN. Raises InputError, with row and column, for any other text that is no finite
    number.
    """
    numbers = np.full((len(cells), len(names)), missing)
    if not set(names) <= cells[0].keys():
        return numbers
    for row, cells_of_row in enumerate(cells):
        for column, name in enumerate(names):
            text = str(cells_of_row.get(name)).strip()
            number = _number_in(text)
            is_undefined = name in STATISTICS and text.lower() in {"", "nan"}
            if not (is_undefined or isfinite(number)):
                raise InputError(
                    f"{path}, row {row + 1}: {name} is {text[:40]!r}; give finite numbers"
                )
            numbers[row, column] = number
    return numbers


def _number_in(text: str) -> float:
    """Return the number in the text of a cell; NaN if the text is no number."""
    try:
        return float(text)
    except ValueError:
        return nan
