"""Small tables that people take on to other programs: CSV files, written whole or not at all."""

import csv
import io
from collections.abc import Sequence
from pathlib import Path

from gen.runtime.output import write

Row = dict[str, float | int | str]

FORMULAS = ("=", "+", "-", "@", "\t", "\r", "\n")
"""What a text begins with that a spreadsheet would compute."""


def cell(value: object) -> object:
    """Quote a text that a spreadsheet would take for a formula; numbers stay what they are.

    Parameters
    ----------
    value : of a cell; a text gets an apostrophe in front where it begins as a formula does, which
        is what OWASP advises for names that come from strangers
    """
    return f"'{value}" if isinstance(value, str) and value.startswith(FORMULAS) else value


def write_csv(path: Path, rows: Sequence[Row]) -> None:
    """Write rows under a header; a file that is there is replaced only by a whole one.

    Raises
    ------
    InputError
        If the file cannot be written
    """
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, list(rows[0]))
    writer.writeheader()
    writer.writerows({name: cell(each) for name, each in row.items()} for row in rows)
    write(path, text.getvalue())
