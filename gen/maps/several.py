"""Several maps of one command: a row for each, then mean and standard deviation over the maps.

A map that cannot be read or solved is named and left out, and the command goes on. Rows of a table
begin with `row`, which tells rows of maps from those computed over all maps, and `surface`, the
name of the map.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from gen.arrays import Values
from gen.maps.read import files_in
from gen.runtime import VERSION
from gen.runtime.documents import Row, json_text
from gen.runtime.errors import InputError
from gen.runtime.files import write
from gen.runtime.installation import git_commit
from gen.runtime.terminal import echo

# raised whenever a reader of the last version would misread a file
FORMAT_VERSION = 1
# relative deviation of numbers that are the same but for rounding
SAME = 1e-9
# kinds of rows
OF_MAP = "surface"
MEAN = "mean"
DEVIATION = "standard deviation"


@dataclass(frozen=True)
class CollectedRows:
    """The rows of several maps, and the maps without any."""

    rows: list[Row]  # rows of all maps that could be used
    left_out: dict[str, str]  # why maps could not be used, by their names


def are_several(inputs: Sequence[Path]) -> bool:
    """Tell whether inputs are more than one file, or a folder.

    Parameters
    ----------
    inputs : sequence of Path
        Files and folders, at least one.

    Returns
    -------
    bool
        False for a single path that is no folder.
    """
    return len(inputs) > 1 or inputs[0].is_dir()


def require_one(inputs: Sequence[Path], options: dict[str, Path | None]) -> None:
    """Refuse options that are for a single map.

    Parameters
    ----------
    inputs : sequence of Path
        The maps of the command, for the message.
    options : dict
        The file that each option gives, by the name of the option; None if it is not given.

    Raises
    ------
    InputError
        If one of the options is given.
    """
    for option, path in options.items():
        if path is not None:
            raise InputError(
                f"{option} {path}: is of one surface: give one file, or leave the option"
                f" out for {' '.join(map(str, inputs))}"
            )


def files_of(inputs: Iterable[Path]) -> list[Path]:
    """Return the files among the inputs, and those of folders that may hold maps.

    Parameters
    ----------
    inputs : iterable of Path
        Files and folders.

    Returns
    -------
    list of Path
        The files. An input without any stays as it is: `collect_rows` says what is wrong with it.
    """
    files: list[Path] = []
    for path in inputs:
        try:
            files += files_in(path)
        except InputError:
            files.append(path)
    return files


def collect_rows(
    files: Sequence[Path], rows_of: Callable[[Path], Iterable[Row]]
) -> CollectedRows:
    """Collect the rows of all maps, and name the maps that are left out on standard error.

    Parameters
    ----------
    files : sequence of Path
        Files of maps, from `files_of`.
    rows_of : callable
        Returns the rows of one map, or raises InputError.

    Returns
    -------
    CollectedRows
        The rows, each with the keys `row` and `surface` in front, and the maps that were left out.

    Raises
    ------
    InputError
        If no map has rows.
    """
    rows: list[Row] = []
    left_out: dict[str, str] = {}
    for file in files:
        try:
            rows += _rows_of_file(file, rows_of)
        except InputError as error:
            left_out[str(file)] = str(error)
    if not rows:
        first = next(iter(left_out.values()))
        raise InputError(
            f"none of {len(left_out)} maps could be used, the first: {first}"
        )
    for name, fault in left_out.items():
        place = "" if name in fault else f"{name}: "
        echo(f"warning: left out: {place}{fault}", err=True)
    return CollectedRows(rows, left_out)


def _rows_of_file(file: Path, rows_of: Callable[[Path], Iterable[Row]]) -> list[Row]:
    """Return the rows of a file with its name; InputError if there is no map or it is unusable."""
    rows: list[Row] = []
    for path in files_in(file):
        rows += [{"row": OF_MAP, "surface": str(file), **row} for row in rows_of(path)]
    return rows


def summary(rows: Sequence[Row]) -> list[Row]:
    """Return the rows of mean and standard deviation over the rows of maps.

    Parameters
    ----------
    rows : sequence of dict
        Rows of maps with the same columns, at least one.

    Returns
    -------
    list of dict
        Two rows with numbers in the columns that have a number in every row, and "" in all other
        columns. Without a second row the standard deviation is "".
    """
    mean: Row = {"row": MEAN, "surface": f"{len(rows)} surfaces"}
    deviation: Row = {"row": DEVIATION, "surface": f"{len(rows)} surfaces"}
    for name in rows[0]:
        if name in {"row", "surface"}:
            continue
        values = [row[name] for row in rows]
        mean[name] = ""
        deviation[name] = ""
        if all(isinstance(value, int | float) for value in values):
            numbers = np.array(values, dtype=np.float64)
            with np.errstate(invalid="ignore"):  # of infinite numbers
                mean[name] = _number_or_blank(numbers.mean())
                deviation[name] = _number_or_blank(_standard_deviation(numbers))
    return [mean, deviation]


def _standard_deviation(numbers: Values) -> float:
    """Return the standard deviation; NaN of a single number, 0 of numbers that differ by rounding.

    For example, the same load has been set on all maps.
    """
    if numbers.size < 2:
        return math.nan
    scatter = float(numbers.std(ddof=1))
    rounding = SAME * np.abs(numbers).max()
    if scatter <= rounding:
        return 0.0
    return scatter


def _number_or_blank(value: float) -> float | str:
    """Return a number, "" for NaN."""
    if math.isnan(value):
        return ""
    return float(value)


def write_json(
    path: Path, kind: str, rows: Sequence[Row], command: str, **entries: Any
) -> None:
    """Write the rows of a command's maps as JSON, with null for numbers that are not finite.

    Parameters
    ----------
    path : Path
        The file to write.
    kind : str
        What the rows are: "descriptions" or "contacts".
    rows : sequence of dict
        Rows of maps, and those of `summary` if there are several maps.
    command : str
        The command line, for the record.
    **entries : object
        Further keys of the document.
    """
    content = {
        "format": f"asperity {kind}",
        "version": FORMAT_VERSION,
        "command": command,
        "made": datetime.now(UTC).isoformat(timespec="seconds"),
        "asperity": VERSION,
        "commit": git_commit(),
        **entries,
        "rows": [_finite_or_null(row) for row in rows],
    }
    write(path, json_text(content))


def _finite_or_null(row: Row) -> dict[str, float | int | str | None]:
    """Return a row with None in place of numbers that are not finite, which JSON does not have."""
    finite: dict[str, float | int | str | None] = dict(row)
    for name, value in row.items():
        if isinstance(value, float) and not math.isfinite(value):
            finite[name] = None
    return finite
