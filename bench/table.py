"""Tables as files: CSV, under their names only once they are whole."""

import csv
import math
from collections.abc import Iterable, Mapping, Sequence
from io import StringIO
from pathlib import Path
from typing import Any

from bench.files import content_of
from gen.runtime.errors import InputError
from gen.runtime.files import make_folder, write

Rows = Iterable[Mapping[str, Any]]  # values by the names of the columns, the same in all rows


def write_table(
    path: Path, header: Iterable[str], rows: Iterable[Sequence[object]], digits: int = 0
) -> Path:
    """Write a table; its folder is made where there is none, None is written as nothing.

    Numbers have all their digits, or as many significant ones as given: then NaN is nothing too.
    """
    text = StringIO(newline="")
    writer = csv.writer(text)
    writer.writerow(header)
    writer.writerows([_text(value, digits) for value in row] for row in rows)
    make_folder(path.parent)
    write(path, text.getvalue())
    return path


def _text(value: object, digits: int) -> object:
    if not digits or not isinstance(value, float):
        return value
    return "" if math.isnan(value) else f"{value:.{digits}g}"


def write_rows(path: Path, rows: Rows) -> Path:
    """Write rows under the names of their columns, numbers with all their digits."""
    rows = list(rows)
    return write_table(path, rows[0], (list(row.values()) for row in rows))


def markdown(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table as lines of Markdown."""
    lines = (f"| {' | '.join(cells)} |" for cells in rows)
    return "\n".join([f"| {' | '.join(header)} |", f"|{'---|' * len(header)}", *lines])


def formatted(columns: Mapping[str, str], rows: Rows) -> str:
    """Return rows as lines of Markdown; the columns are headers with formats ("{nodes:,}")."""
    return markdown(list(columns), ([f.format(**row) for f in columns.values()] for row in rows))


def read_table(path: Path) -> tuple[list[str], list[dict[str, str]]]:
    """Read the names of the columns of a table, and its rows by these names."""
    try:
        reader = csv.DictReader(StringIO(content_of(path).decode(), newline=""), restval="")
        return list(reader.fieldnames or ()), list(reader)
    except (InputError, ValueError, csv.Error) as error:
        raise InputError(f"{path}: cannot be read as a table ({error})") from None
