"""Tables for other programs: CSV files, written whole or not at all."""

import csv
import io
import math
from collections.abc import Sequence
from pathlib import Path

from gen.runtime.output import write

Row = dict[str, float | int | str]
"""One line of a table: values by the names of the columns."""

FORMULAS = ("=", "+", "-", "@", "\t", "\r", "\n")
"""First characters of a text that a spreadsheet would compute."""


def cell(value: object) -> object:
    """Return a value for a cell: no formula, and nothing for a number that is not finite.

    Parameters
    ----------
    value : object
        Number or text. Texts that look like formulas get an apostrophe, which is OWASP's advice for
        texts from strangers.
    """
    if isinstance(value, float) and not math.isfinite(value):
        return ""
    return f"'{value}" if isinstance(value, str) and value.startswith(FORMULAS) else value


def write_csv(path: Path, rows: Sequence[Row]) -> None:
    """Write rows as CSV under a header with their names.

    Parameters
    ----------
    path : Path
        File to write.
    rows : sequence of dict
        Rows with the same names, at least one.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, list(rows[0]))
    writer.writeheader()
    writer.writerows({name: cell(value) for name, value in row.items()} for row in rows)
    write(path, text.getvalue())
