"""Several maps of one command: rows of all maps, then mean and standard deviation over the maps.

A map that cannot be read or solved is left out with a warning, and the command goes on. Rows begin
with two columns: `row`, the kind of the row, and `surface`, the name of the map. The kinds of rows
are those of a map (`OF_MAP`), and those of statistics over all maps (`MEAN` and `DEVIATION`).
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

# version of the JSON files; raise it whenever a reader of the last version would misread a file
FORMAT_VERSION = 1
# largest standard deviation that is put down to rounding, relative to the largest number
SAME = 1e-9
# values of the column `row`
OF_MAP = "surface"
MEAN = "mean"
DEVIATION = "standard deviation"


@dataclass(frozen=True)
class CollectedRows:
    """The rows of the maps that could be used, and the maps that could not."""

    rows: list[Row]  # rows of the maps, in the order of the maps
    left_out: dict[str, str]  # why a map could not be used, by the path of its file


def are_several(inputs: Sequence[Path]) -> bool:
    """Tell whether inputs are more than one file, or a folder.

    Parameters
    ----------
    inputs : sequence of Path
        Files and folders, at least one.

    Returns
    -------
    bool
        False for a single path that is no folder, otherwise True.
    """
    return len(inputs) > 1 or inputs[0].is_dir()


def require_one(inputs: Sequence[Path], options: dict[str, Path | None]) -> None:
    """Refuse options that write a file about a single map.

    Parameters
    ----------
    inputs : sequence of Path
        Files and folders that the user gave, for the message.
    options : dict
        Path that the user gave to each option, by the name of the option; None if the user did not
        give the option.

    Raises
    ------
    InputError
        If the user gave one of the options.
    """
    for option, path in options.items():
        if path is not None:
            raise InputError(
                f"{option} {path}: is of one surface: give one file, or leave the option"
                f" out for {' '.join(map(str, inputs))}"
            )


def files_of(inputs: Iterable[Path]) -> list[Path]:
    """Replace folders among the inputs by the files in them that may hold maps.

    Parameters
    ----------
    inputs : iterable of Path
        Files and folders.

    Returns
    -------
    list of Path
        The files. A missing path, or a folder without such files, stays in the list as it is:
        `collect_rows` says what is wrong with it.
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
    """Collect the rows of all maps, and warn of maps that are left out on standard error.

    Parameters
    ----------
    files : sequence of Path
        Files of maps, from `files_of`.
    rows_of : callable
        Function of the path of a map. It returns the rows of the map, or raises InputError.

    Returns
    -------
    CollectedRows
        The rows, each with the columns `row` and `surface` in front, and the maps that are left
        out.

    Raises
    ------
    InputError
        If all maps are left out. The message gives the reason of the first one, and standard
        error has no warnings.
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
        file_name = "" if name in fault else f"{name}: "
        echo(f"warning: left out: {file_name}{fault}", err=True)
    return CollectedRows(rows=rows, left_out=left_out)


def _rows_of_file(file: Path, rows_of: Callable[[Path], Iterable[Row]]) -> list[Row]:
    """Return the rows of a file with the columns `row` and `surface` in front.

    InputError if the file is missing or a folder without maps, or `rows_of` cannot use it.
    """
    rows: list[Row] = []
    # This yields the file itself: folders that hold maps were replaced by `files_of`.
    for path in files_in(file):
        rows += [{"row": OF_MAP, "surface": str(file), **row} for row in rows_of(path)]
    return rows


def summary(rows: Sequence[Row]) -> list[Row]:
    """Compute the mean and the standard deviation of each column over the rows of maps.

    Parameters
    ----------
    rows : sequence of dict
        Rows of maps, at least one. All have the same columns.

    Returns
    -------
    list of dict
        The row of means and the row of sample standard deviations. A column that holds a text has
        "" in both. A result that is NaN is replaced by "", as the standard deviation of a single
        row is. A standard deviation that is due to rounding (`SAME`) is 0.
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
            # The difference of infinite numbers is NaN, and becomes "".
            with np.errstate(invalid="ignore"):
                mean[name] = _number_or_blank(numbers.mean())
                deviation[name] = _number_or_blank(_standard_deviation(numbers))
    return [mean, deviation]


def _standard_deviation(numbers: Values) -> float:
    """Return the sample standard deviation; NaN for a single number.

    It is 0 if it is due to rounding (`SAME`), as for a load that is set equally on all maps.
    """
    if numbers.size < 2:
        return math.nan
    deviation = float(numbers.std(ddof=1))
    largest_by_rounding = SAME * np.abs(numbers).max()
    if deviation <= largest_by_rounding:
        return 0.0
    return deviation


def _number_or_blank(value: float) -> float | str:
    """Return a number as it is, or "" if it is NaN."""
    if math.isnan(value):
        return ""
    return float(value)


def write_json(
    path: Path, kind: str, rows: Sequence[Row], command: str, **entries: Any
) -> None:
    """Write the rows of a command's maps as a JSON file, with null for numbers that are not finite.

    Parameters
    ----------
    path : Path
        The file to write.
    kind : str
        Kind of the rows: "descriptions" or "contacts".
    rows : sequence of dict
        Rows of maps, followed by the rows of `summary` if there are several maps.
    command : str
        The command line, which is recorded in the file.
    **entries : object
        Further keys of the document, written in front of the rows.
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
    """Return a copy of a row with None in place of numbers that are not finite.

    JSON has no such numbers, and writes None as null.
    """
    finite: dict[str, float | int | str | None] = dict(row)
    for name, value in row.items():
        if isinstance(value, float) and not math.isfinite(value):
            finite[name] = None
    return finite
