"""Tables as files: CSV, under their names only once they are whole."""

import csv
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from io import StringIO
from pathlib import Path
from typing import Any

from bench.files import content_of
from gen.runtime.errors import InputError
from gen.runtime.output import make_folder, write

UNITS = {"delta": "um", "sigma0": "um"}
"""Units of the quantities whose names do not say them: they end the column's name."""


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


def write_rows(path: Path, rows: Iterable[Any]) -> Path:
    """Write rows that know their columns: dataclasses of one kind, or mappings with the same keys.

    A number is written with all its digits, None as nothing.
    """
    records = [record(row) for row in rows]
    return write_table(path, records[0], (list(each.values()) for each in records))


def markdown(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table as lines of Markdown."""
    lines = (f"| {' | '.join(cells)} |" for cells in rows)
    return "\n".join([f"| {' | '.join(header)} |", f"|{'---|' * len(header)}", *lines])


def formatted(columns: Mapping[str, str], rows: Iterable[Any]) -> str:
    """Return rows, as `write_rows` takes them, as lines of Markdown.

    The columns are headers, each with the format of its cells, as "{seconds:.2f}".
    """
    texts = ([form.format(**record(row)) for form in columns.values()] for row in rows)
    return markdown(list(columns), texts)


def read_table(path: Path) -> tuple[list[str], list[dict[str, str]]]:
    """Read the names of the columns of a table, and its rows by these names."""
    try:
        reader = csv.DictReader(StringIO(content_of(path).decode(), newline=""), restval="")
        return list(reader.fieldnames or ()), list(reader)
    except (InputError, ValueError, csv.Error) as error:
        raise InputError(f"{path}: cannot be read as a table ({error})") from None


def record(row: Any) -> dict[str, Any]:
    """Return a row's values by the names of its columns; a dataclass in a row has its own."""
    if not is_dataclass(row):
        return dict(row)
    values = {field.name: getattr(row, field.name) for field in fields(row)}
    found: dict[str, Any] = {}
    for name, value in values.items():
        column = f"{name}_{UNITS[name]}" if name in UNITS else name
        found |= record(value) if is_dataclass(value) else {column: value}
    return found
