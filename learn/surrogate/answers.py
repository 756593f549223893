"""Predictions for files, surfaces or tables of statistics, with a row for each displacement."""

import csv
import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.table import Table as Printed

from gen.arrays import Values
from gen.database import is_database
from gen.maps.bodies import files_in, read_surface
from gen.maps.read import sides_from
from gen.maps.settings import Reading
from gen.material import Bodies
from gen.runtime.documents import Row
from gen.runtime.errors import InputError
from gen.runtime.files import require_file
from gen.runtime.terminal import brief, echo, print_table, to_type
from gen.schema import statistics_columns
from learn.features import Undefined
from learn.features.sets import HYBRID, STATISTICS, Rows
from learn.surrogate import flag
from learn.surrogate.model import Prediction, Surrogate

REASONS = 12
"""Reasons that are printed at most."""
VALUE = re.compile(r" \S+ outside")
"""The part of a reason that differs between rows with the same reason."""

UNDEFINED = "statistics undefined: {}"
"""Reason of a row whose surface does not define all statistics that the features need."""

WIDTH = 160
"""Width of the table without a terminal [characters]."""

SHOWN = 40
"""Rows that are printed at most; a file gets all of them."""


DELTA_NAMES = ("delta_um", "delta")
SIDE_NAMES = ("side_x_um", "side_y_um")
NODE_NAMES = ("nodes_x", "nodes_y")


@dataclass(frozen=True, eq=False)
class Table:
    """n rows of statistics from a file."""

    name: str
    statistics: Values  # (n, 22), in the order of Table 1, NaN where a surface defines none
    delta: Values | None  # (n,), far-field displacements, if the file has them [um]
    sides: Values  # (n, 2), scan lengths, NaN where the file has none [um]
    nodes: NDArray[np.int64]  # (n, 2), nodes along both axes, 0 where the file has none
    boundaries: tuple[str, ...]  # the different ones of the rows; "free" where the file has none


@dataclass(frozen=True)
class Question:
    """Settings of a prediction that do not depend on the file."""

    deltas: Values | None  # (k,), far-field displacements; None if the tables contain them [um]
    e_star: float | None  # of the forces; None for that of the training [MPa]
    hardness: float | None  # of the softer body; None for the only one of the training [MPa]
    level: float  # coverage of the intervals
    reading: Reading  # options that say how surfaces are read

    def bodies(self, surrogate: Surrogate) -> Bodies:
        """Return E* and hardness of the answers, of which the surrogate has defaults."""
        e_star = surrogate.modulus if self.e_star is None else self.e_star
        ratio = flag.hardness_ratio(surrogate.card, self.hardness, e_star)
        hardness = None if ratio is None else ratio * e_star
        return Bodies(e_star, hardness, known=self.e_star is not None)


def answers(
    surrogate: Surrogate,
    paths: Sequence[Path],
    question: Question,
    say: Callable[[str], None],
) -> Iterator[Row]:
    """Yield the rows of the predictions for files and folders, one file after the other.

    `say` is called with lines for the user about each surface. InputError is raised for the first
    file that cannot be used.
    """
    files, others = files_in(paths)
    if others:
        say(f"left out {others} files that hold no surfaces")
    for path in files:
        if path.suffix.lower() == ".h5" and is_database(path):
            raise InputError(
                f"{path}: is a database; {to_type('learn fit')} makes a surrogate of it, which"
                " predicts for surfaces"
            )
        if is_table(path):
            table = read_table(path, question.reading.side)
            yield from _rows(surrogate, table.name, _of_table(surrogate, table, question))
        else:
            yield from _of_surface(surrogate, path, question, say, alone=len(files) == 1)


def is_table(path: Path) -> bool:
    """Return True if a file has rows of statistics, by the names in its first line."""
    if path.suffix.lower() not in {".csv", ".txt"}:
        return False
    try:
        with require_file(path).open(encoding="utf-8-sig", errors="replace") as file:
            names = {name.strip() for name in file.readline().split(",")}
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}") from None
    return bool(names & {column.name for column in statistics_columns()})


def _of_surface(
    surrogate: Surrogate,
    path: Path,
    question: Question,
    say: Callable[[str], None],
    *,
    alone: bool,
) -> Iterator[Row]:
    """Predict a surface; one whose statistics are undefined has no values, and is refused alone."""
    topography, warnings = read_surface(path, question.reading, surrogate.boundary)
    if question.deltas is None:
        raise InputError(f"{path}: give --delta, the far-field displacement in um")
    say(f"{path}: {'; '.join(topography.steps)}")
    for line in warnings:
        say(f"  warning: {line}")
    on_surface = surrogate.for_surface(topography.heights, topography.sides, str(path))
    ratio = flag.hardness_ratio(surrogate.card, question.hardness, question.e_star)
    try:
        rows = on_surface.rows(question.deltas, ratio)
    except Undefined as error:
        if alone:
            raise
        say(f"  warning: {error}: no prediction")
        statistics, hybrid = (
            np.full((question.deltas.size, len(names)), np.nan) for names in (STATISTICS, HYBRID)
        )
        reason = UNDEFINED.format(on_surface.surface.description.reason)
        rows = Rows(statistics, question.deltas, 1.0, nodes=1.0, hybrid=hybrid, notes=(reason,))
    yield from _rows(surrogate, str(path), _predicted(surrogate, rows, question), warnings)


def _predicted(surrogate: Surrogate, rows: Rows, question: Question) -> Prediction:
    """Predict rows of features as it is asked."""
    return surrogate.predict_rows(rows, e_star=question.e_star, level=question.level, std=True)


def _of_table(surrogate: Surrogate, table: Table, question: Question) -> Prediction:
    """Predict rows of statistics, each at its own Delta or at all given displacements."""
    for boundary in table.boundaries:
        if boundary != surrogate.boundary:
            raise InputError(
                f"{table.name}: has a {boundary:.20} boundary, the surrogate was trained on patches"
                f" with a {surrogate.boundary} one: fit one to a database whose scene has this"
                " boundary"
            )
    deltas = question.deltas
    if (table.delta is None) == (deltas is None):
        said = "no Delta: give --delta" if deltas is None else "its own Delta: leave out --delta"
        raise InputError(f"{table.name}: has {said}")
    repeated = 1 if deltas is None else len(deltas)
    rows = np.repeat(np.arange(len(table.statistics)), repeated)
    delta = table.delta if deltas is None else np.tile(deltas, len(table.statistics))
    assert delta is not None
    if np.isnan(table.sides).any() and surrogate.features.scaled:
        raise InputError(f"{table.name}: names no sides: give --side, the scan length in um")
    statistics, sides = table.statistics[rows], table.sides[rows]
    undefined = [bool(np.isnan(row).any()) for row in statistics]
    if all(undefined):
        raise InputError(f"{table.name}: every row lacks statistics: nothing can be predicted")
    missing = UNDEFINED.format("nan in the table")
    notes = tuple(
        missing if lacks else _note(surrogate, table, row)
        for row, lacks in zip(rows.tolist(), undefined, strict=True)
    )
    length, nodes = (np.sqrt(each.prod(axis=1)) for each in (sides, table.nodes[rows]))
    try:
        ratio = flag.hardness_ratio(surrogate.card, question.hardness, question.e_star)
        asked = Rows(statistics, delta, length, ratio, nodes, notes=notes)
        return _predicted(surrogate, asked, question)
    except InputError as error:
        raise InputError(f"{table.name}: {error}") from None


def _note(surrogate: Surrogate, table: Table, row: int) -> str:
    """Return how the grid of a row differs from the training's, as far as the table tells."""
    along_x, along_y = flag.pair(surrogate.card, "nodes")
    nodes, sides = (int(along_x), int(along_y)), flag.pair(surrogate.card, "side")
    if table.nodes[row].all():
        nodes = int(table.nodes[row, 0]), int(table.nodes[row, 1])
    if not np.isnan(table.sides[row]).any():
        sides = float(table.sides[row, 0]), float(table.sides[row, 1])
    return flag.grid_note(surrogate.card, surrogate.features, nodes, sides)


def _rows(
    surrogate: Surrogate, name: str, prediction: Prediction, warnings: Sequence[str] = ()
) -> Iterator[Row]:
    """Yield the rows of the table, each with the warnings about its surface.

    The ends of intervals are empty where a row is outside the training.
    """
    for place, (delta, reason) in enumerate(zip(prediction.delta, prediction.reasons, strict=True)):
        row: Row = {"input": name, "delta_um": float(delta)}
        for target, learnt in surrogate.learnt.items():
            key = heading(learnt.column, learnt.unit)
            row[key] = float(prediction.values[target][place])
            # Outside the training no interval holds: the cells stay empty.
            row[f"{key}_low"] = "" if reason else float(prediction.low[target][place])
            row[f"{key}_high"] = "" if reason else float(prediction.high[target][place])
            if target in prediction.std:
                row[f"{key}_std"] = float(prediction.std[target][place])
        row["flag"] = "outside" if reason else "inside"
        yield {**row, "reason": reason, "warnings": "; ".join(warnings)}


def heading(column: str, unit: str) -> str:
    """Return the name of a target's column with its unit: area_percent, force_uN, mean_gap_um."""
    return column if unit in {"%", "1"} else f"{column}_{unit}"


def show(rows: Sequence[Row], level: float, bodies: Bodies) -> None:
    """Print the first rows of the table, and the reasons of those outside the training."""
    hidden = ("_low", "_high", "_std", "warnings")  # warnings were said with the surface
    names = [name for name in rows[0] if not name.endswith(hidden)]
    table = Printed(title=f"Predictions with {100 * level:g} % intervals, {bodies.text}")
    for name in names:
        table.add_column(name, justify="left" if name in {"input", "flag", "reason"} else "right")
    for row in rows[:SHOWN]:
        style = "dim" if row["flag"] == "outside" else ""
        table.add_row(*(_cell(row, name) for name in names), style=style)
    print_table(table, WIDTH)
    for doubt in bodies.doubts:
        echo(f"warning: {doubt}")
    if len(rows) > SHOWN:
        echo(f"... and {len(rows) - SHOWN} more: -o writes all of them")
    outside = [row for row in rows if row["flag"] == "outside"]
    if outside:
        echo(
            f"{len(outside)} of {len(rows)} rows lie outside what the surrogate was trained on: no"
            " interval holds there, and none is given (-)"
        )
    numbers: Counter[str] = Counter()
    first: dict[str, str] = {}
    for reason in (each for row in outside for each in str(row["reason"]).split("; ")):
        kind = VALUE.sub(" outside", reason)
        numbers[kind] += 1
        first.setdefault(kind, reason)
    for kind, number in numbers.most_common(REASONS):
        echo(f"  {number} of {len(rows)}: {first[kind]}")
    if len(numbers) > REASONS:
        echo(f"  and {len(numbers) - REASONS} more: -o writes all of them")


def _cell(row: Row, name: str) -> str:
    """Return a cell as printed: a value with its interval, or `-` for one that is withheld."""
    value = row[name]
    if name == "reason":
        return brief(str(value))
    if not isinstance(value, float):
        return str(value)
    if f"{name}_low" not in row:
        return f"{value:.4g}"
    if row["flag"] == "outside":
        return f"{value:.4g} (-)"
    spread = f" +- {row[f'{name}_std']:.2g}" if f"{name}_std" in row else ""
    return f"{value:.4g}{spread} ({row[f'{name}_low']:.4g} to {row[f'{name}_high']:.4g})"


def read_table(path: Path, side: str = "") -> Table:
    """Read rows of statistics, as `python -m gen describe --csv` writes them.

    The CSV's header names the 22 statistics; `delta_um` or `delta`, sides and nodes are optional,
    and other columns are ignored. `side` is one scan length, or two with a comma, for rows without
    [um]. InputError names the row and column that is missing or no number.
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

    def columns(wanted: Sequence[str], otherwise: float = np.nan) -> Values:
        if not set(wanted) <= set(names):
            return np.full((len(rows), len(wanted)), otherwise)
        return np.array([[_number(path, row, each, name) for name in wanted] for row, each in told])

    told = list(enumerate(rows, 1))
    deltas = [name for name in DELTA_NAMES if name in names][:1]
    sides = columns(SIDE_NAMES)
    if side:
        given = sides_from(side)
        if not np.allclose(sides[~np.isnan(sides[:, 0])], given, rtol=1e-3):
            raise InputError(f"{path}: names other sides than --side {side}: leave that out")
        sides[:] = given
    return Table(
        name=str(path),
        statistics=columns(STATISTICS),
        delta=columns(deltas)[:, 0] if deltas else None,
        sides=sides,
        nodes=columns(NODE_NAMES, 0.0).astype(np.int64),
        boundaries=tuple(sorted({row.get("boundary") or "free" for row in rows})),
    )


def _number(path: Path, row: int, cells: dict[str, str], name: str) -> float:
    """Return the finite number of a cell; NaN for a statistic that is empty or "nan"."""
    text = str(cells.get(name))
    if name in STATISTICS and text.strip().lower() in {"", "nan"}:
        return np.nan
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise InputError(f"{path}, row {row}: {name} is {text[:40]!r}; give finite numbers")
    return value
