"""Tables as people read them: few digits, units in the titles, red where a verdict failed."""

import math
from dataclasses import dataclass

from bench.page.content import Table
from bench.table import read_table
from gen.runtime.errors import InputError

DIGITS = 4
"""Significant digits of numbers on the page; the files have all of them."""

PASSED = "passed"
SPECIAL = {"": "", "nan": "nan", "inf": "∞", "-inf": "-∞"}
UNITS = {"um": "µm", "s": "s", "seconds": "s", "ms": "ms", "percent": "%", "uN": "µN"}
"""Last words of columns' names that are units."""


@dataclass(frozen=True)
class Cell:
    """A value as it is shown."""

    text: str
    number: bool


@dataclass(frozen=True)
class Row:
    """A line; `failed` ones are red."""

    cells: tuple[Cell, ...]
    failed: bool


@dataclass(frozen=True)
class Tabulated:
    """A table as it is shown.

    Attributes
    ----------
    titles : tuple of (str, bool)
        Titles of the columns, and whether they hold numbers.
    rows : tuple of Row
        The lines.
    judges : bool
        Whether it has verdicts.
    """

    titles: tuple[tuple[str, bool], ...]
    rows: tuple[Row, ...]
    judges: bool


def tabulated(table: Table) -> Tabulated:
    """Read a table and make it readable.

    Raises
    ------
    InputError
        If the file cannot be read, or lacks a column.
    """
    header, lines = read_table(table.data)
    columns = table.columns or tuple(header)
    wanted = {*columns, table.verdict} - {""}
    if missing := wanted - set(header):
        raise InputError(f"{table.data}: has no column {', '.join(sorted(missing))}")
    rows = tuple(
        Row(
            tuple(_cell(line[name]) for name in columns),
            bool(table.verdict) and line[table.verdict] != PASSED,
        )
        for line in lines
    )
    numeric = [all(row.cells[place].number for row in rows) for place in range(len(columns))]
    titles = tuple(zip(map(_title, columns), numeric, strict=True))
    return Tabulated(titles, rows, judges=bool(table.verdict))


def _title(name: str) -> str:
    """A column's name for people, its unit in brackets where it ends in one."""
    words = name.split("_")
    if len(words) > 1 and words[-1] in UNITS:
        return f"{' '.join(words[:-1])} [{UNITS[words[-1]]}]"
    return " ".join(words)


def _cell(text: str) -> Cell:
    if text in SPECIAL:
        return Cell(SPECIAL[text], number=True)
    try:
        value = float(text)
    except ValueError:
        return Cell(text, number=False)
    if not math.isfinite(value):  # a word: numbers that are written so are in SPECIAL
        return Cell(text, number=False)
    if value.is_integer() and abs(value) < 1e7:
        return Cell(f"{value:,.0f}" if abs(value) >= 1e4 else f"{value:.0f}", number=True)
    return Cell(f"{value:.{DIGITS}g}", number=True)
