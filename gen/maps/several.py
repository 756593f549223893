"""Several maps of one command: a row for each, then mean and standard deviation over the maps.

A map that cannot be read or solved is named, and costs no other one. Rows of a table begin with
`row`, which tells maps from what is computed of them, and `surface`, the name of the map.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from gen.maps.read import files_in
from gen.runtime import VERSION
from gen.runtime.documents import Row, json_text
from gen.runtime.errors import InputError
from gen.runtime.files import write
from gen.runtime.installation import git_commit
from gen.runtime.terminal import echo

FORMAT_VERSION = 1  # raised whenever a reader of the last version would misread a file
SAME = 1e-9  # relative deviation of numbers that are one but for rounding
OF_MAP, MEAN, DEVIATION = "surface", "mean", "standard deviation"  # kinds of rows


@dataclass(frozen=True)
class Collected:
    """What several maps have given."""

    rows: list[Row]  # of all maps that could be used
    left_out: dict[str, str]  # why others could not be, by their names


def are_several(inputs: Sequence[Path]) -> bool:
    """Tell whether inputs are more than one file, or a folder."""
    return len(inputs) > 1 or inputs[0].is_dir()


def require_one(inputs: Sequence[Path], options: dict[str, Path | None]) -> None:
    """Refuse options, files by their names, that are for a single map."""
    for option, path in options.items():
        if path is not None:
            raise InputError(
                f"{option} {path}: is of one surface: give one file, or leave the option out for"
                f" {' '.join(map(str, inputs))}"
            )


def files_of(inputs: Iterable[Path]) -> list[Path]:
    """Return the files among the inputs, and those of folders that may hold maps.

    An input without any stays as it is: `collected` tells what is wrong with it.
    """
    files: list[Path] = []
    for path in inputs:
        try:
            files += files_in(path)
        except InputError:
            files.append(path)
    return files


def collected(
    files: Sequence[Path], rows_of: Callable[[Path], Iterable[Row]]
) -> Collected:
    """Collect the rows of all maps, and name those that are left out on standard error.

    Parameters
    ----------
    files : sequence of Path
        Files of maps, from `files_of`.
    rows_of : callable
        Returns the rows of one map, or raises InputError.

    Returns
    -------
    Collected
        The rows, and the maps that were left out.

    Raises
    ------
    InputError
        If no map is left.
    """
    rows: list[Row] = []
    left_out: dict[str, str] = {}
    for file in files:
        try:
            made = [row for path in files_in(file) for row in rows_of(path)]
        except InputError as error:
            left_out[str(file)] = str(error)
            continue
        rows += [{"row": OF_MAP, "surface": str(file), **row} for row in made]
    if not rows:
        first = next(iter(left_out.values()))
        raise InputError(
            f"none of {len(left_out)} maps could be used, the first: {first}"
        )
    for name, fault in left_out.items():
        named = "" if name in fault else f"{name}: "
        echo(f"warning: left out: {named}{fault}", err=True)
    return Collected(rows, left_out)


def summary(rows: Sequence[Row]) -> list[Row]:
    """Return the rows of mean and standard deviation over the rows of maps.

    They have numbers in the columns that have one in every row, and nothing in others. Without a
    second map there is no deviation.
    """
    mean: Row = {"row": MEAN, "surface": f"{len(rows)} surfaces"}
    deviation: Row = {"row": DEVIATION, "surface": f"{len(rows)} surfaces"}
    for name in rows[0]:
        if name in mean:
            continue
        values = [row[name] for row in rows]
        mean[name] = ""
        deviation[name] = ""
        if not all(isinstance(value, int | float) for value in values):
            continue
        numbers = np.array(values, dtype=np.float64)
        with np.errstate(invalid="ignore"):  # of infinite numbers
            mean[name] = _number(numbers.mean())
            if len(rows) > 1:
                scatter = numbers.std(ddof=1)
                rounding = (
                    SAME * np.abs(numbers).max()
                )  # of a load that is the same for all
                deviation[name] = 0.0 if scatter <= rounding else _number(scatter)
    return [mean, deviation]


def _number(value: float) -> float | str:
    """Return a number, "" for NaN."""
    return "" if math.isnan(value) else float(value)


def write_json(
    path: Path, kind: str, rows: Sequence[Row], command: str, **more: Any
) -> None:
    """Write the rows of a command's maps as JSON, with null for numbers that are not finite.

    Parameters
    ----------
    path : Path
        The file to write.
    kind : str
        What the rows are: "descriptions" or "contacts".
    rows : sequence of Row
        Rows of maps, and those of `summary` if there are several.
    command : str
        The command line, for the record.
    **more : object
        Further keys of the document.
    """
    content = {
        "format": f"asperity {kind}",
        "version": FORMAT_VERSION,
        "command": command,
        "made": datetime.now(UTC).isoformat(timespec="seconds"),
        "asperity": VERSION,
        "commit": git_commit(),
        **more,
        "rows": [{name: _or_null(value) for name, value in row.items()} for row in rows],
    }
    write(path, json_text(content))


def _or_null(value: float | int | str) -> float | int | str | None:
    """Return None for numbers that are not finite, which JSON has not."""
    return None if isinstance(value, float) and not math.isfinite(value) else value
